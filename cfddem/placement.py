"""The particles of a case at the start: sizes and materials of every species, and where they lie."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cfddem.bed import Species
from cfddem.case import Case
from cfddem.errors import InputError
from cfddem.fluid.grid import Array
from cfddem.particles.filling import loose_places
from cfddem.particles.forces import Laws
from cfddem.particles.packing import Seed, from_table, lattice, log_normal, mono, normal, random_packing
from cfddem.particles.pouring import AT_REST, NEARLY_AT_REST, pour_into
from cfddem.particles.state import Bodies
from cfddem.particles.state import bodies as make_bodies
from cfddem.particles.walls import Wall


class Grains(NamedTuple):
    """What distinguishes the particles of a case, by their ids; those of a species stand together."""

    diameter: Array  # (N,) [m]
    density: Array  # (N,) [kg/m3]
    material: np.ndarray  # (N,) row of the table of materials
    species: np.ndarray  # (N,) number of the species, in the order of the case


def grains_of(case: Case) -> Grains:
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
    return Grains(np.concatenate(diameters), np.concatenate(density), np.concatenate(material), species_of(case))


def species_of(case: Case) -> np.ndarray:
    """Number of the species of every particle, by id (N,)."""
    counts = list(case.counts.values())
    return np.repeat(np.arange(len(counts), dtype=np.int32), counts)


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


def particles_of(case: Case, table: np.ndarray, walls: Sequence[Wall], laws: Laws) -> Bodies:
    """The particles at the start."""
    bed, grains = case.bed, grains_of(case)
    diameters = grains.diameter
    if bed.start == "poured":
        spheres = pour_into(
            table, diameters, grains.density, walls, *_room(case, float(diameters.max())), box=periodic_box(case),
            seed=bed.seed, material=grains.material, layer=_layer(case, grains), gravity=abs(case.laws.gravity[2]),
            laws=laws.dry(), at_rest=AT_REST if case.fluid is None else NEARLY_AT_REST,
        )  # fmt: skip
        places, diameters = spheres.position, 2.0 * spheres.radius
    elif bed.start == "packed":
        share = float((math.pi / 6.0 * diameters**3).sum()) / math.prod(case.column.size)
        places, _ = random_packing(diameters, share, bed.seed, shape=case.column.size)
    elif bed.start == "at":
        places = np.array(bed.positions, float)
    elif bed.species:
        places = _spread_evenly(case, grains, walls)
    else:
        places = _suspended(len(diameters), float(diameters.max()), case.column.size, bed.seed)
    made = make_bodies(
        places, 0.5 * diameters, grains.density, velocity=np.array(bed.velocity), material=grains.material,
        viscosity=case.fluid.viscosity_at(places[:, 2]) if case.fluid else 0.0, fixed=bed.fixed,
    )  # fmt: skip
    if case.fluid is not None:
        made.inverse_mass[:] /= 1.0 + case.laws.added_mass * case.fluid.density / grains.density
    _must_be_inside(made.position, case.column.size)
    return made


def _suspended(count: int, largest: float, size: tuple[float, float, float], seed: int) -> Array:
    """Particles spread evenly over the column: a shaken lattice of as many places, thinned at random."""
    volume = size[0] * size[1] * size[2]
    pitch = (volume / count) ** (1.0 / 3.0)
    for _ in range(200):
        if pitch < 1.02 * largest:
            break
        places = lattice(largest, ((0.0, 0.0, 0.0), size), spacing=pitch / largest, seed=seed)
        if len(places) >= count:
            chosen = np.random.default_rng(seed).permutation(len(places))[:count]
            return np.ascontiguousarray(places[np.sort(chosen)])
        pitch *= 0.99
    fraction = count * math.pi / 6.0 * largest**3 / volume
    raise InputError("bed.count", count, f"below what a lattice holds; the solid fraction would be {fraction:.2f}")


def _spread_evenly(case: Case, grains: Grains, walls: Sequence[Wall]) -> Array:
    """Particles of unequal size spread over the column: loose places, drawn apart upward as far as there is room."""
    corner, size = _room(case, float(grains.diameter.max()))
    places = loose_places(grains.diameter, walls, corner, size, case.bed.seed, _layer(case, grains))
    top, largest = float((places[:, 2] + 0.5 * grains.diameter).max()), float(grains.diameter.max())
    if top > size[2]:
        raise InputError(
            "bed.species", None, f"of few enough particles: spread loosely they reach to {top:.3g} m, beyond the lid",
            f"which is at {size[2]:.3g} m",
        )  # fmt: skip
    places[:, 2] *= max(1.0, (size[2] - 0.6 * largest) / top)
    return places


def _layer(case: Case, grains: Grains) -> np.ndarray | None:
    return grains.species if case.bed.arrangement == "layers" else None


def _must_be_inside(position: Array, size: tuple[float, float, float]) -> None:
    outside = ~((position >= 0.0) & (position <= np.array(size))).all(axis=1)
    if outside.any():
        row = int(np.argmax(outside))
        raise InputError(f"position of particle {row}", position[row].tolist(), f"inside the column, 0 to {size} m")


def _room(case: Case, largest: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Corner and size of the room that particles are poured into."""
    width, depth, height = case.column.size
    if case.column.shape == "box":
        return (0.0, 0.0, 0.0), (width, depth, height)
    side = width / math.sqrt(2.0)
    corner = 0.5 * (width - side)
    return (corner, corner, 0.0), (side, side, height)


def periodic_directions(case: Case) -> tuple[bool, bool, bool]:
    """Which of x, y, z repeat."""
    column = case.column
    return column.sides == "periodic", (column.front or column.sides) == "periodic", column.ends == "periodic"


def periodic_box(case: Case) -> tuple[float | None, float | None, float | None]:
    """Lengths of the periodic directions, None along the others [m]."""
    x, y, z = (length if repeats else None for length, repeats in zip(case.column.size, periodic_directions(case)))
    return x, y, z
