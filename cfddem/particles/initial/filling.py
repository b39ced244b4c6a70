"""Loose positions of spheres inside walls, filled from below, before they are poured."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from cfddem.backend.errors import InputError
from cfddem.particles.state import make_particles
from cfddem.particles.walls.arrays import near_walls, wall_arrays
from cfddem.particles.walls.wall import Wall

SPACING = 1.05
"""Distance of neighbouring positions over the diameter of the largest sphere."""

MOST_PER_EDGE = 12
"""Largest number of small spheres along an edge of the cube that replaces a large sphere."""


def loose_places(
    diameters: np.ndarray,
    walls: Sequence[Wall],
    corner: tuple[float, float, float],
    size: tuple[float, float, float],
    seed: int,
    layer: np.ndarray | None = None,
) -> np.ndarray:
    """Centres of spheres that touch neither each other nor a wall (N, 3) [m].

    Positions lie on a cubic lattice with room for the largest sphere; several small spheres share one site. The lattice
    fills the part of the box that walls do not cut off, and continues upward where the box is full.

    diameters     (N,) [m]
    corner, size  lowest corner and edges of the box in which the spheres start, open upward [m]
    seed          of the random order and shifts
    layer         (N,) spheres of a lower number lie below those of a higher one; mixed if not given

    Raises InputError where the walls leave too little room.
    """
    generator = np.random.default_rng(seed)
    largest = float(diameters.max())
    pitch = SPACING * largest
    for axis in range(2):
        if not size[axis] >= pitch:
            raise InputError(f"size[{axis}]", size[axis], f"at least {pitch:.3g} m, a little more than a sphere")
    edge = np.clip((pitch / (SPACING * diameters) * (1.0 + 1e-9)).astype(int), 1, MOST_PER_EDGE)
    blocks = {int(k): _block(int(k), pitch) for k in np.unique(edge)[::-1]}
    layers = [np.arange(len(diameters))] if layer is None else [np.flatnonzero(layer == k) for k in np.unique(layer)]
    wanted = [sum(math.ceil((edge[those] == k).sum() / len(block)) for k, block in blocks.items()) for those in layers]
    places = np.empty((len(diameters), 3))
    while True:
        sites, missing = _sites(walls, corner, size, pitch, sum(wanted)), []
        for those, share in zip(layers, np.split(sites, np.cumsum(wanted)[:-1])):
            sharing = {k: those[edge[those] == k] for k in blocks}
            missing.append(_fill(share, sharing, diameters, blocks, pitch, walls, generator, places))
        if not any(missing):
            return places
        wanted = [number + more for number, more in zip(wanted, missing)]


def _fill(
    sites: np.ndarray,
    sharing: dict[int, np.ndarray],
    diameters: np.ndarray,
    blocks: dict[int, np.ndarray],
    pitch: float,
    walls: Sequence[Wall],
    generator: np.random.Generator,
    places: np.ndarray,
) -> int:
    """Place some of the spheres at random on sites; returns the number of missing sites.

    sharing  rows of the spheres that share a site with as many in each direction
    """
    order, begin, missing = generator.permutation(len(sites)), 0, 0
    for k, block in blocks.items():
        members = generator.permutation(sharing[k])
        if not len(members):
            continue
        free = 0.5 * (pitch / k - float(diameters[members].max()))
        taken = np.zeros((0, 3))
        while len(taken) < len(members) and begin < len(order):
            more = order[begin : begin + math.ceil((len(members) - len(taken)) / len(block))]
            begin += len(more)
            fresh = (sites[more][:, None, :] + block[None]).reshape(-1, 3)
            if k > 1:  # a site is half a pitch away from walls, its corners perhaps not
                fresh = fresh[clear_of_walls(fresh, 0.5 * pitch / k, walls)]
            taken = np.concatenate([taken, fresh])
        missing += max(0, len(members) - len(taken)) // len(block) + (len(taken) < len(members))
        if len(taken) >= len(members):
            shake = free / math.sqrt(3.0) * (1.0 - 1e-9)
            places[members] = taken[: len(members)] + generator.uniform(-shake, shake, (len(members), 3))
    return missing


def _block(number: int, pitch: float) -> np.ndarray:
    """Positions that share a site: those of a cube of number^3 within half a pitch of its centre (n, 3) [m]."""
    line = ((np.arange(number) + 0.5) / number - 0.5) * pitch
    cube = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    return cube[np.linalg.norm(cube, axis=1) <= 0.5 * pitch]


def _sites(
    walls: Sequence[Wall],
    corner: tuple[float, float, float],
    size: tuple[float, float, float],
    pitch: float,
    wanted: int,
) -> np.ndarray:
    """The lowest connected sites of the lattice that are half a pitch away from walls (n, 3) [m].

    There is no wall between two neighbouring sites that are both half a pitch away from it.
    """
    along = [max(1, int(length / pitch * (1.0 + 1e-9))) for length in size]
    start = [corner[axis] + 0.5 * (size[axis] - (along[axis] - 1) * pitch) for axis in range(2)]
    lines = [start[axis] + pitch * np.arange(along[axis]) for axis in range(2)]

    def layers(begin: int, end: int) -> np.ndarray:
        heights = corner[2] + pitch * (np.arange(begin, end) + 0.5)
        return np.stack(np.meshgrid(*lines, heights, indexing="ij"), axis=-1)

    inside = layers(0, along[2])
    joined, number = ndimage.label(clear_of_walls(inside.reshape(-1, 3), 0.5 * pitch, walls).reshape(inside.shape[:3]))
    if number == 0:
        raise InputError(
            "size", tuple(size), f"a box with room for a sphere of {pitch / SPACING:.3g} m between the walls"
        )
    room = joined == 1 + int(np.argmax(np.bincount(joined.reshape(-1))[1:]))
    sites = [inside[room]]
    open_above, begin = room[:, :, -1], along[2]
    while (count := sum(len(part) for part in sites)) < wanted and open_above.any():
        end = begin + max(1, math.ceil((wanted - count) / int(open_above.sum())))
        above = layers(begin, end)
        clear = clear_of_walls(above.reshape(-1, 3), 0.5 * pitch, walls).reshape(above.shape[:3])
        room = np.logical_and.accumulate(clear & open_above[:, :, None], axis=2)
        sites.append(above[room])
        open_above, begin = room[:, :, -1], end
    if count < wanted:
        raise InputError(
            "size", tuple(size), f"a box with {wanted} places for the largest sphere, not {count}, below the walls' top"
        )
    every = np.concatenate(sites)
    return every[np.argsort(every[:, 2], kind="stable")[:wanted]]


def clear_of_walls(places: np.ndarray, distance: float, walls: Sequence[Wall]) -> np.ndarray:
    """Whether each position is in front of all walls and at least this far away from them (n,)."""
    clear = np.ones(len(places), bool)
    if len(walls) and len(places):
        probes = make_particles(places, 0.5 * distance, 1.0)
        touched, _ = near_walls(probes, wall_arrays(walls), 0.0, 0.5 * distance * (1.0 - 1e-6))
        clear[touched] = False
    return clear
