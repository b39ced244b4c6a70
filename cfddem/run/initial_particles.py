"""The initial particles of a case: where they lie at the start."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.case.liquid import Liquid
from cfddem.case.particle_properties import SPECIES, ParticleProperties, particle_properties
from cfddem.case.schema import Case
from cfddem.case.vessel import on_the_wrong_side, start_behind_a_surface, start_box, vessel_of
from cfddem.fluid.grid import Array
from cfddem.particles.initial.filling import clear_of_walls, loose_places
from cfddem.particles.initial.packing import lattice, random_packing
from cfddem.particles.initial.pouring import AT_REST, NEARLY_AT_REST, Place, Spheres, poured_bed
from cfddem.particles.interactions.bridge import LIQUID
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.state import Particles
from cfddem.particles.state import make_particles as make_bodies
from cfddem.particles.walls.arrays import near_walls, wall_arrays
from cfddem.particles.walls.wall import Wall
from cfddem.preflight.bed_estimate import estimate_bed

LARGEST_EXPANDED_FRACTION = 0.55
"""Largest solid fraction of an expanded start [-]; a random packing takes long to find near 0.64."""

LARGEST_OVERLAP = 0.02
"""Largest overlap of a particle with a wall of the case at the start, over the radius [-]."""

_WET = 1
"""Random numbers that choose the wet particles; others use the seed alone."""


def particles_of(case: Case, table: np.ndarray, walls: Sequence[Wall], laws: Laws) -> Particles:
    """The particles of a case at the start."""
    bed, properties = case.bed, particle_properties(case)
    diameters = properties.diameter
    if (wrong := start_behind_a_surface(case, case.particle_count)) is not None:
        key, reason, remedy = wrong
        raise InputError(key, None, f"changed: {reason}", remedy)
    if bed.start == "poured":
        with _box_named_as_in(case):
            spheres = poured_bed(
                Spheres(table, diameters, properties.density, properties.material, _layer(case, properties)),
                Place(walls, *start_box(case), case.column.periodic_lengths),
                seed=bed.seed,
                gravity=abs(case.laws.gravity[2]),
                laws=laws.dry(),
                at_rest=NEARLY_AT_REST if case.has_fluid else AT_REST,
            ).particles
        places, diameters = spheres.position, 2.0 * spheres.radius
    elif bed.start in ("packed", "expanded"):
        places = _at_random(case, diameters)
    elif bed.start == "placed":
        places = np.array(bed.positions, float)
    elif bed.species:
        places = _spread_evenly(case, properties, walls)
    else:
        places = suspended_places(case, walls)
    places = in_the_box(places, case)
    particles = make_bodies(
        places, 0.5 * diameters, properties.density, velocity=np.array(bed.initial_velocity),
        material=properties.material,
        viscosity=case.around.viscosity_at(places[:, 2]), fixed=bed.fixed,
    )  # fmt: skip
    if bed.species:
        particles.declare(SPECIES, properties.species)
    if case.liquid is not None:
        particles.declare(LIQUID, liquid_of(case.liquid, particles.radius, bed.seed))
    _must_be_inside(particles.position, case)
    if case.wall or (case.vessel and bed.start != "poured"):
        _must_be_apart(particles, walls, len(walls) - len(case.wall))
        _must_be_on_one_side(case, particles.position)
    return particles


@contextmanager
def _box_named_as_in(case: Case) -> Iterator[None]:
    """Name the box into which particles are poured by the keys of the case, where it is too small."""
    try:
        yield
    except InputError as failure:
        if not failure.field.startswith("size"):
            raise
        key = "column.height" if case.bed.start_size is None else "bed.start_size"
        raise InputError(key, failure.value, failure.limit, "use fewer particles, or a larger box") from None


def liquid_of(liquid: Liquid, radius: Array, seed: int) -> Array:
    """Liquid on every particle at the start (N,) [m3]; which particles are wet depends on the seed only.

    radius  (N,) [m]
    """
    volume, count = liquid.volume_on(radius), len(radius)
    dry = count - round(liquid.share_of_wet_particles * count)
    volume[np.random.default_rng((seed, _WET)).permutation(count)[:dry]] = 0.0
    return volume


def expanded_height(case: Case) -> float:
    """Height of the bed in the flow, by the balance of weight and drag; at most that of the column [m]."""
    lowest = sum(case.volumes.values()) / (LARGEST_EXPANDED_FRACTION * case.floor_area)
    return min(case.column.height, max(lowest, estimate_bed(case).height))


def _at_random(case: Case, diameters: Array) -> Array:
    """A random packing of a column or an upright round vessel, up to the lid or the expected height (N, 3) [m]."""
    width, depth, height = case.column.size
    if case.bed.start == "expanded":
        height = expanded_height(case)
    share = float((math.pi / 6.0 * diameters**3).sum()) / (case.floor_area * height)
    x, y, z = case.column.periodic
    longer = case.bed.fixed and not case.vessel  # fixed particles are a slice of a longer bed; in a vessel it has ends
    repeats = (x, y, z or longer)
    if not case.line:
        return random_packing(diameters, share, case.bed.seed, shape=(width, depth, height), periodic=repeats)[0]
    across = 2.0 * case.line[0][1]
    places, _ = random_packing(
        diameters, share, case.bed.seed, shape=(across, across, height), periodic=repeats, in_cylinder=True
    )
    return places + 0.5 * np.array((width - across, depth - across, 0.0))


def suspended_places(case: Case, walls: Sequence[Wall] = ()) -> Array:
    """Places spread evenly over the column: a random subset of a perturbed lattice (count, 3) [m].

    walls   of which those of the case keep places free
    errors  InputError where the lattice has too little room
    """
    column, seed, diameters = case.column, case.bed.seed, particle_properties(case).diameter
    count, largest = len(diameters), float(diameters.max())
    corner, size = case.bed.start_corner or (0.0, 0.0, 0.0), case.bed.start_size or column.size
    vessel = vessel_of(case) if case.vessel and not case.vessel.is_upright else None
    volume = case.floor_area * column.height if vessel is None else float(vessel.volumes[-1])
    volume = math.prod(case.bed.start_size) if case.bed.start_size else volume
    pitch = min((volume / count) ** (1.0 / 3.0), *size)
    for _ in range(200):
        if pitch < 1.02 * largest:
            break
        places = lattice(largest, (corner, tuple(np.add(corner, size))), spacing=pitch / largest, seed=seed)
        places = places[case.beyond_the_side(places, 0.5 * largest) <= 0.0]
        if case.wall:
            places = places[clear_of_walls(places, 0.5 * largest, walls)]
        if len(places) >= count:
            chosen = np.random.default_rng(seed).permutation(len(places))[:count]
            return np.ascontiguousarray(places[np.sort(chosen)])
        pitch *= 0.99
    fraction = count * math.pi / 6.0 * largest**3 / volume
    limit = f"below what a lattice holds, whose places have room for the largest; a solid fraction of {fraction:.2f}"
    raise InputError("bed.count", count, limit, 'use fewer, or bed.start = "poured"')


def _must_be_apart(particles: Particles, walls: Sequence[Wall], of_column: int) -> None:
    """Refuse particles that overlap walls.

    of_column  number of walls of the column, which come first
    """
    arrays = wall_arrays(walls)
    movable = make_bodies(particles.position, particles.radius, particles.density)  # the fixed ones as well
    rows, pieces = near_walls(movable, arrays, -LARGEST_OVERLAP, 0.0)
    if len(rows):
        place = ", ".join(f"{coordinate:.4g}" for coordinate in particles.position[rows[0]])
        number = int(arrays.wall[pieces[0]]) - of_column
        name = f"wall.{number}" if number >= 0 else "a wall of the column"
        raise InputError(
            f"position of particle {rows[0]}", None, "away from walls",
            f"at ({place}) m it is in {name}; set bed.start_corner and bed.start_size",
        )  # fmt: skip


def _must_be_on_one_side(case: Case, position: Array) -> None:
    """Refuse particles on the wrong side of a closed surface."""
    for number in range(len(case.wall)):
        if (misplaced := on_the_wrong_side(case, number, position)) is not None:
            row, why, remedy = misplaced
            limit = f"on the other side of the closed surface of wall.{number}.file"
            raise InputError(f"position of particle {row}", None, limit, f"{why}; {remedy}")


def _spread_evenly(case: Case, properties: ParticleProperties, walls: Sequence[Wall]) -> Array:
    """Places of particles of unequal size: a loose filling, stretched to the height of the column (N, 3) [m]."""
    corner, size = start_box(case)
    places = loose_places(properties.diameter, walls, corner, size, case.bed.seed, _layer(case, properties))
    top, largest = float((places[:, 2] + 0.5 * properties.diameter).max()), float(properties.diameter.max())
    if top > size[2]:
        raise InputError(
            "bed.species", None, f"fewer particles: spread loosely they reach to {top:.3g} m, above the lid",
            f"the lid is at {size[2]:.3g} m",
        )  # fmt: skip
    places[:, 2] *= max(1.0, (size[2] - 0.6 * largest) / top)
    return places


def _layer(case: Case, properties: ParticleProperties) -> np.ndarray | None:
    return properties.species if case.bed.arrangement == "layers" else None


def in_the_box(places: Array, case: Case) -> Array:
    """The places, brought back into the column along its periodic directions (N, 3) [m]."""
    periodic, size = np.array(case.column.periodic), np.array(case.column.size)
    inside: Array = places - periodic * size * np.floor(places / size)
    return inside


def _must_be_inside(position: Array, case: Case) -> None:
    size = case.column.size
    outside = ~((position >= 0.0) & (position <= np.array(size))).all(axis=1)
    if outside.any():
        row = int(np.argmax(outside))
        raise InputError(f"position of particle {row}", position[row].tolist(), f"inside the column, 0 to {size} m")
    if case.vessel and (outside := case.beyond_the_side(position) > 0.0).any():
        row = int(np.argmax(outside))
        remedy = "set bed.start_corner and bed.start_size"
        raise InputError(f"position of particle {row}", position[row].tolist(), "inside the vessel", remedy)
