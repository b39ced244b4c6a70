"""Diameter, density, material and species of every particle of a case."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError
from cfddem.case.bed import Species
from cfddem.case.schema import Case
from cfddem.model.fields import Field
from cfddem.particles.initial.packing import Seed, from_table, log_normal, mono, normal

Array = NDArray[np.float64]

SPECIES = Field("species", dtype=np.int32, snapshot=True, meaning="number of the species, in the order of the case")
"""Declared on the particles of a mixture."""


class ParticleProperties(NamedTuple):
    """Properties of every particle of a case, in the order of ids; particles of one species have consecutive ids."""

    diameter: Array  # (N,) [m]
    density: Array  # (N,) [kg/m3]
    material: np.ndarray  # (N,) row of the material table
    species: np.ndarray  # (N,) number of the species, in the order of the case


def particle_properties(case: Case) -> ParticleProperties:
    """Diameter, density, material and species of every particle."""
    names, counts = list(case.material), case.counts
    diameters, density, material = [], [], []
    for number, (name, species) in enumerate(case.species.items()):
        if counts[name] < 1:
            field = f"bed.species.{name}.fraction" if case.bed.species else "bed.height"
            raise InputError(field, None if case.bed.species else case.bed.height, "enough for one particle")
        seed: Seed = (case.bed.seed, number) if number else case.bed.seed
        diameters.append(diameters_of(species, counts[name], seed))
        density.append(np.full(counts[name], case.material_of(species).density))
        material.append(np.full(counts[name], names.index(species.material or names[0]), np.int32))
    of_species = np.repeat(np.arange(len(counts), dtype=np.int32), list(counts.values()))
    return ParticleProperties(np.concatenate(diameters), np.concatenate(density), np.concatenate(material), of_species)


def diameters_of(species: Species, count: int, seed: Seed) -> Array:
    """Diameters of the particles of a species (count,) [m]."""
    if species.sizes:
        diameters, shares = np.array(species.sizes).T
        return from_table(count, diameters, shares / diameters**3, seed)
    if species.spread == 0.0:
        return mono(count, species.diameter)
    if species.distribution == "log_normal":
        wide = math.sqrt(math.log1p(species.spread**2))
        return log_normal(count, species.diameter * math.exp(-0.5 * wide**2), wide, seed)
    return normal(count, species.diameter, species.spread * species.diameter, seed)
