"""Estimates of a typical collision: Stokes number, minimum gap, overlap."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cfddem.backend.law_choice import called_by_name
from cfddem.case.bed import Species
from cfddem.case.schema import Case
from cfddem.particles.material_pairs import pair_table
from cfddem.preflight.bed_estimate import BedEstimate
from closures import lubrication, minimum_gap, numbers
from closures.kinds import FILM_ARGUMENTS, GAP_ARGUMENTS


@dataclass(frozen=True)
class CollisionEstimate:
    """Collision of two particles of mean size of one species at the reference speed."""

    species: str
    speed: float  # [m/s]
    stokes: float
    roughness_gap: float  # h_sigma [m]
    film_gap: float  # elastohydrodynamic gap with the real modulus [m]
    softened_film_gap: float  # the same, if the film used the contact modulus [m]
    overlap: float  # largest overlap of a dry collision [m]
    real_overlap: float  # the same with the real modulus [m]
    resting_overlap: float  # under the weight of the bed [m]
    softening: float  # contact modulus over real modulus
    film_damping_rate: (
        float  # of all species, largest resistance of a film over the reduced mass; 0 without films [1/s]
    )

    @property
    def gap(self) -> float:
        """Minimum gap: the larger of roughness and film gap [m]."""
        return max(self.roughness_gap, self.film_gap)

    @property
    def softened_gap(self) -> float:
        """Minimum gap if the film used the contact modulus [m]."""
        return max(self.roughness_gap, self.softened_film_gap)


def estimate_collision(case: Case, bed: BedEstimate) -> CollisionEstimate:
    """Estimate a typical collision; in a mixture, for the species with the largest overlap over diameter."""
    estimates = (_of_species(case, bed, name, species) for name, species in case.species.items())
    return max(estimates, key=lambda estimate: estimate.overlap / case.species[estimate.species].diameter)


def pair_row(case: Case, species: Species) -> np.void:
    """Entry of the pair table for two particles of a species."""
    row: np.void = pair_table([case.material_of(species)])[0, 0]
    return row


def reduced(case: Case, species: Species, diameter: float) -> tuple[float, float]:
    """Reduced mass [kg] and reduced radius [m] of two particles of a species with a diameter [m]."""
    return 0.5 * math.pi / 6.0 * diameter**3 * case.material_of(species).density, 0.25 * diameter


def _of_species(case: Case, bed: BedEstimate, name: str, species: Species) -> CollisionEstimate:
    row = pair_row(case, species)
    mass, radius = reduced(case, species, species.diameter)
    speed = max(case.reference_speed, 1e-12)
    real, soft = float(row["film_modulus"]), float(row["contact_modulus"])
    law, hard = case.laws.contact_law, row.copy()
    hard["contact_modulus"] = real
    load = bed.weight * species.diameter**2
    viscosity = case.around.viscosity
    roughness_gap = float(row["roughness_gap"])
    films = case.has_films
    return CollisionEstimate(
        species=name,
        speed=speed,
        stokes=numbers.stokes(mass, speed, viscosity, radius) if viscosity > 0.0 else math.inf,
        roughness_gap=roughness_gap if films else 0.0,
        film_gap=_film_gap(case, (roughness_gap, speed, viscosity, real, radius)) if films else 0.0,
        softened_film_gap=_film_gap(case, (roughness_gap, speed, viscosity, soft, radius)) if films else 0.0,
        overlap=law.largest_overlap(mass, radius, row, speed),
        real_overlap=law.largest_overlap(mass, radius, hard, speed),
        resting_overlap=law.resting_overlap(mass, radius, row, load),
        softening=soft / real if law.takes("contact_modulus") else 1.0,
        film_damping_rate=max(_film_rate(case, species, viscosity) for species in case.species.values())
        if films
        else 0.0,
    )


def _film_rate(case: Case, species: Species, viscosity: float) -> float:
    """Largest resistance of a film over m*, of the smallest particles of a species at the smallest gap [1/s].

    Between two of them, and at a wall, where the reduced mass and radius are twice as large.
    """
    mass, radius = reduced(case, species, species.smallest_diameter)
    solid, law = case.material_of(species), case.laws.pair_laws.get("lubrication")
    bodies = [(solid, mass, radius)]
    if _has_walls(case):
        wall = case.material[case.column.material] if case.column.material else solid
        bodies.append((wall, 2.0 * mass, 2.0 * radius))
    rates = []
    for other, mass, radius in bodies:
        gap = float(pair_table([solid, other])[0, 1]["roughness_gap"])
        # films of a run end at the gap R*
        if law is None:
            resistance = lubrication.film_resistance(lubrication.film_strength(viscosity, radius), gap, gap, radius)
        else:
            resistance = called_by_name(law.function, FILM_ARGUMENTS, (gap, viscosity, radius, gap, radius))
        rates.append(resistance / mass)
    return max(rates)


def _has_walls(case: Case) -> bool:
    """Whether particles of a case can meet a wall."""
    column = case.column
    ends = {column.sides, column.front or column.sides, column.ends}
    return ends != {"periodic"} or bool(case.line or case.vessel or case.wall)


def _film_gap(case: Case, values: tuple[float, float, float, float, float]) -> float:
    """Minimum gap by the law of the case [m]; `values` are those of GAP_ARGUMENTS."""
    law = case.laws.pair_laws.get("minimum_gap")
    return called_by_name(law.function if law else minimum_gap.elastohydrodynamic, GAP_ARGUMENTS, values)
