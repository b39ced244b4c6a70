"""Estimates of a typical collision: Stokes number, minimum gap, overlap; of wet particles also bridge and regime."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cfddem.backend.law_choice import called_by_name
from cfddem.case.bed import Species
from cfddem.case.liquid import Liquid
from cfddem.case.schema import Case
from cfddem.particles.material_pairs import pair_table
from cfddem.preflight.bed_estimate import BedEstimate
from cfddem.preflight.issue import Issue
from cfddem.preflight.law_ranges import effect_of_bridge
from closures import bridge, capillary, capillary_pull, lubrication, minimum_gap, numbers
from closures.kinds import FILM_ARGUMENTS, GAP_ARGUMENTS
from closures.liquid_film import film_thickness


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


# ---------------------------------------------------------------- liquid bridges


SLOW = 0.1
"""Speed of a common collision over the reference speed, which is that of the fastest ones [-]."""

PENDULAR, WILLETT = 0.1, 1e-3
"""Volume of a bridge over R^3: liquid beyond the first fills pores; the law of Willett was fitted below the second."""

CONTENT = 0.1
"""Volume of liquid over that of the particles above which the pores fill and bridges merge [-]."""

DROPS = 1e9
"""Drops in a run above which landing them takes hours, and those of one time step may exceed the memory."""


@dataclass(frozen=True)
class WetEstimate:
    """Bridge between two wet particles of mean size of one species, and their collision at the reference speed."""

    liquid: Liquid  # of the case
    film: float  # its thickness on each particle [m]
    volume: float  # of liquid in the bridge, V [m3]
    volume_ratio: float  # V/R^3
    content: float  # volume of liquid at the start over that of the particles
    minimum_gap: float  # [m]
    bond: float  # granular Bond number
    capillary: float  # capillary number
    stokes: float  # at the reference speed
    ennis: float  # critical Stokes number
    critical: float  # critical Stokes number of the film law of the case, without the pull
    rupture: float  # gap at which a slowly stretched bridge breaks [m]
    capillary_time: float  # period of two particles held by the pull of their bridge, 2 pi sqrt(m*/k) [s]
    crossing_time: float  # both films over the reference speed [s]
    relaxation_time: float  # m* over the resistance at the minimum gap [s]

    @property
    def regime(self) -> str:
        """The regime of growth in words, after Ennis et al. (1991)."""
        if self.volume == 0.0:
            return "dry at the start"
        critical = max(self.ennis, self.critical)
        if self.stokes < critical:
            return "non-inertial: all collisions stick"
        if SLOW * self.stokes < critical:
            return "inertial: slow collisions stick"
        return "coating: collisions rebound"


def estimate_wet(case: Case, collision: CollisionEstimate) -> WetEstimate | None:
    """Estimates for the bridges of a case; None without a liquid."""
    liquid = case.liquid
    if liquid is None:
        return None
    species = case.species[collision.species]
    mass, radius = reduced(case, species, species.diameter)
    solid, speed = case.material_of(species), collision.speed
    own = float(liquid.volume_on(np.array([0.5 * species.diameter]))[0])
    film = film_thickness(0.5 * species.diameter, own)
    volume = 2.0 * own * capillary.liquid_share(1.0, 1.0)
    least = liquid.minimum_gap or float(pair_row(case, species)["roughness_gap"])
    angle, wet = math.radians(liquid.contact_angle), volume > 0.0
    weight = 2.0 * mass * math.hypot(*case.laws.gravity)
    drag = 6.0 * math.pi * liquid.viscosity * radius**2
    return WetEstimate(
        liquid=liquid,
        film=film,
        volume=volume,
        volume_ratio=volume / (2.0 * radius) ** 3,
        content=_content(case, liquid),
        minimum_gap=least,
        bond=numbers.granular_bond(liquid.surface_tension, angle, radius, weight) if weight else math.inf,
        capillary=_over(liquid.viscosity * speed, liquid.surface_tension),
        stokes=_over(mass * speed, drag),
        ennis=numbers.ennis_critical_stokes(solid.restitution, 2.0 * film, least) if liquid.film != "none" else 0.0,
        critical=(1.0 + 1.0 / solid.restitution) * _film_stop(liquid, least, 2.0 * film, radius, volume),
        rupture=capillary.rupture_length(0.0, angle, volume),
        capillary_time=_period(liquid, mass, radius, volume) if wet else math.inf,
        crossing_time=2.0 * film / speed,
        relaxation_time=_over(mass * least, drag),
    )


def check_wet(case: Case, wet: WetEstimate | None) -> Iterator[Issue]:
    """Check that the laws of bridges hold for this liquid, and that the spray wets without flooding."""
    if wet is None:
        return
    liquid = wet.liquid
    key = "liquid." + next((name for name in ("volume_per_particle", "liquid_fraction") if getattr(liquid, name)),
                           "thickness")  # fmt: skip
    if wet.content > 1.0:
        yield Issue(
            "error", key, f"{100.0 * wet.content:.3g} % of the volume of the particles is more liquid than solid, "
            f"in films of {wet.film:.2g} m", "use less liquid; films are micrometres thick",
        )  # fmt: skip
    elif wet.volume_ratio > PENDULAR or wet.content > CONTENT:
        yield Issue(
            "warning", key, f"bridges of {wet.volume_ratio:.2g} R^3 and {100.0 * wet.content:.3g} % of liquid merge, "
            f"but the laws hold for single bridges below {PENDULAR:g} R^3", "use less liquid",
        )  # fmt: skip
    elif liquid.pull == "willett" and wet.volume_ratio > WILLETT:
        yield Issue(
            "warning", key, f"bridges of {wet.volume_ratio:.2g} R^3; the pull of Willett was fitted below "
            f"{WILLETT:g} R^3{_effect(liquid, wet)}", 'use less liquid, or compare with liquid.pull = "lambert"',
        )  # fmt: skip
    if liquid.contact_angle > 90.0:
        yield Issue(
            "warning", "liquid.contact_angle", f"{liquid.contact_angle:g} degrees: bridges push instead of pulling",
            "angles are in degrees; below 90 the liquid wets the solids",
        )  # fmt: skip
    if case.in_liquid:
        yield Issue(
            "warning", "liquid", f"bridges in a fluid of {case.required_fluid.density:g} kg/m3, a liquid",
            "give the interfacial tension of the two liquids, which do not mix, or use a gas",
        )  # fmt: skip
    if wet.volume > 0.0 and wet.minimum_gap >= 2.0 * wet.film:
        yield from _check_thin_films(liquid, wet)
    yield from _check_spray(case)


def _check_thin_films(liquid: Liquid, wet: WetEstimate) -> Iterator[Issue]:
    """Say what does not act where asperities keep the solids farther apart than the films are thick."""
    gaps = f"{wet.minimum_gap:.2g} m is at least both films together, {2.0 * wet.film:.2g} m"
    remedy = "use more liquid, or a smaller gap"
    if liquid.film in ("static", "deforming"):
        yield Issue("warning", "liquid.minimum_gap", f"{gaps}: they do not resist", remedy)
    elif liquid.tangential != "none":
        yield Issue("note", "liquid.minimum_gap", f"{gaps}: bridges do not resist sliding", f"if they should, {remedy}")


def _effect(liquid: Liquid, wet: WetEstimate) -> str:
    """What the law of Willett changes beyond its range, in words."""
    radius = (wet.volume / wet.volume_ratio) ** (1.0 / 3.0)
    return effect_of_bridge(math.radians(liquid.contact_angle), 0.5 * radius, wet.volume, wet.rupture)


def _check_spray(case: Case) -> Iterator[Issue]:
    spray = case.spray
    if spray is None:
        return
    duration = max(min(spray.end or math.inf, case.run.until) - spray.begin, 0.0)
    if spray.begin >= case.run.until:
        yield Issue(
            "warning", "spray.begin", f"{spray.begin:g} s is not before the end of the run, {case.run.until:g} s: "
            "nothing is sprayed", "begin earlier, or run longer",
        )  # fmt: skip
        return
    content = spray.rate * duration / sum(case.volumes.values())
    if content > CONTENT:
        yield Issue(
            "warning", "spray.rate", f"brings {100.0 * content:.3g} % of the volume of the particles, whose pores "
            f"fill from {100.0 * CONTENT:g} % on", "use a lower rate, or a shorter time",
        )  # fmt: skip
    if spray.rate and spray.drop_volume > spray.rate * duration:
        yield Issue(
            "warning", "spray.drop_volume", f"{spray.drop_volume:.2g} m3 is more than is sprayed in all, "
            f"{spray.rate * duration:.2g} m3: no drop lands", "use smaller drops; a drop of 0.1 mm has 5e-13 m3",
        )  # fmt: skip
    drops = spray.rate * duration / spray.drop_volume
    if drops > DROPS:
        yield Issue(
            "error", "spray.drop_volume", f"{spray.drop_volume:.2g} m3 makes {drops:.2g} drops, more than {DROPS:.0e}",
            "use larger drops; a drop of 0.1 mm has 5e-13 m3",
        )  # fmt: skip


def _content(case: Case, liquid: Liquid) -> float:
    """Volume of liquid at the start over that of the particles [-]."""
    counts = case.counts
    total = sum(
        counts[name] * float(liquid.volume_on(np.array([0.5 * species.mean_power(3) ** (1.0 / 3.0)]))[0])
        for name, species in case.species.items()
    )
    return liquid.share_of_wet_particles * total / sum(case.volumes.values())


def _film_stop(liquid: Liquid, gap: float, film: float, radius: float, volume: float) -> float:
    """Stokes number that the film takes on the way from where it begins to the minimum gap."""
    if liquid.film == "pitois":
        return -bridge.pitois_potential(gap, radius, volume) if volume > 0.0 else 0.0
    law = {"static": bridge.static_potential, "deforming": bridge.deforming_potential}.get(liquid.film)
    return 0.0 if law is None or gap >= film else -law(gap, film)


def _period(liquid: Liquid, mass: float, radius: float, volume: float) -> float:
    """Period of a pair in the potential of its bridge, from the slope of Willett's pull at contact [s]."""
    angle = math.radians(liquid.contact_angle)
    contact = capillary_pull.willett_pull(liquid.surface_tension, angle, radius, volume, 0.0)
    slope = 1.05 * abs(contact) / math.sqrt(volume / (2.0 * radius))
    return 2.0 * math.pi * math.sqrt(mass / slope) if slope > 0.0 and liquid.pull != "none" else math.inf


def _over(value: float, by: float) -> float:
    return value / by if by > 0.0 else math.inf
