"""Liquid on walls: patches, from which bridges draw and to which they return.

A patch is a cube of fixed size in the frame in which its wall was made, which moves and turns with the wall. It stands
for a square of wall of that size, and is made when a bridge first draws from it or returns to it. Changes are made in
the order of the ids of particles.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline, serial
from cfddem.backend.errors import InputError
from cfddem.particles.interactions.bridge import FLAT, find_closed
from cfddem.particles.interactions.slots import WALL_LIQUID, returned_share
from cfddem.particles.walls.nearest_point import FOOT, Walls, carried_back, touched

CELLS = 1 << 17
"""Patches along each axis of the frame of a wall; half of them on each side of its origin."""

PATCHES_OF_A_PARTICLE = 8
"""Room, on average, for the patches on which a particle forms or breaks bridges between two neighbour lists."""

SMALLEST_PATCH = 0.5
"""Least edge of a patch over the radius of a particle; the particle would cover a dozen of smaller ones."""


def with_room(walls: Walls, edges: int) -> Walls:
    """The walls with room for the patches that may be made until the next list.

    edges  number of particle-wall edges of the list
    """
    needed = int(walls.patch_count[0]) + PATCHES_OF_A_PARTICLE * edges
    if needed <= len(walls.patch_key):
        return walls
    key, liquid = np.zeros(2 * needed, np.int64), np.zeros(2 * needed)
    used = len(walls.patch_key)
    key[:used], liquid[:used] = walls.patch_key, walls.patch_liquid
    return walls._replace(patch_key=key, patch_liquid=liquid)


def gained_by_walls(walls: Walls, film: float, size: float) -> float:
    """Liquid on the walls less that at the start [m3].

    film  thickness at the start [m]
    size  edge of a patch [m]
    """
    count = int(walls.patch_count[0])
    return float(walls.patch_liquid[:count].sum()) - count * film * size**2  # local: every rank has all patches


@inline
def _key(k, edges, walls, size):
    """Name of the patch below the particle of edge k: wall and cube."""
    m = np.int64(walls.wall[edges.second[k]])
    foot, key = touched(edges, k, FOOT), m
    if walls.sweep[m] == 0.0:  # else the nearest point is in the frame already
        foot = carried_back(walls, m, foot)
    for axis in range(3):
        key = key * CELLS + min(max(math.floor(foot[axis] / size) + CELLS // 2, 0), CELLS - 1)
    return key


@inline
def _place(walls, key):
    """Row of a patch, or where it belongs; rows are sorted by their keys."""
    low, high = 0, walls.patch_count[0]
    while low < high:
        middle = (low + high) // 2
        if walls.patch_key[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low


@inline
def wall_thickness(k, system):
    """Thickness of the liquid on the wall of edge k, below its particle [m]."""
    edges, walls, p = system.edges, system.walls, system.parameters
    if not WALL_LIQUID:
        return 0.0
    n = p.bridge
    key = _key(k, edges, walls, n.wall_patch)
    row = _place(walls, key)
    if row < walls.patch_count[0] and walls.patch_key[row] == key:
        return walls.patch_liquid[row] / (n.wall_patch * n.wall_patch)
    return n.wall_film


@inline
def share_left_by_wall(radius, p):
    """Part of a broken bridge at a wall that its particle gets."""
    n = p.bridge
    return returned_share(radius, FLAT, n.contact_angle, n.wall_contact_angle)


@inline
def thickest_wall(walls, p):
    """Upper bound of the thickness of the liquid on walls [m]."""
    return max(p.bridge.wall_film, walls.patch_thickest[0]) if WALL_LIQUID else 0.0


@inline
def _touched_patch(key, walls, n):
    """Row of a patch, made if there is none; -1 without room for another."""
    row, count = _place(walls, key), walls.patch_count[0]
    if row == count or walls.patch_key[row] != key:
        if count == len(walls.patch_key):
            return -1
        for last in range(count, row, -1):
            walls.patch_key[last], walls.patch_liquid[last] = walls.patch_key[last - 1], walls.patch_liquid[last - 1]
        walls.patch_key[row], walls.patch_liquid[row] = key, n.wall_film * n.wall_patch * n.wall_patch
        walls.patch_count[0] = count + 1
    return row


@serial
def wall_requests(system):
    """What bridges that form and break ask of patches: edges (n,), ids and patches (n, 2), amounts (n, 2).

    An amount is the area over which a new bridge draws [m2], and the volume that a broken one returns [m3].
    """
    particles, edges, memory, walls, p = system.particles, system.edges, system.memory, system.walls, system.parameters
    n, begin, number = p.bridge, edges.between_particles, len(edges.first)
    changed = begin + np.flatnonzero(memory.bridge_change[begin:number])
    names, amounts = np.empty((len(changed), 2), np.int64), np.zeros((len(changed), 2))
    for place in range(len(changed)):
        k = changed[place]
        i = edges.first[k]
        radius = particles.radius[i]
        if n.wall_patch < SMALLEST_PATCH * radius:
            raise InputError("wall_patch", None, "about a particle diameter", "the patches are too small")
        names[place, 0], names[place, 1] = particles.id[i], _key(k, edges, walls, n.wall_patch)
        if memory.bridge_change[k] > 0:
            amounts[place, 0] = n.wall_share * math.pi * radius * radius
        else:
            volume = memory.bridge_volume[k]
            amounts[place, 1] = volume - share_left_by_wall(radius, p) * volume
    return changed, names, amounts


@serial
def settle_wall_liquid(system, requesting, names, amounts):
    """Draw liquid for new bridges at walls, and return that of broken ones, in the order of the ids of particles.

    Where ranks share the particles, each has all patches and settles the requests of all ranks.

    requesting  (n,) edges of the requests; -1 for those of other ranks
    others      see `wall_requests`
    """
    particles, edges, memory, walls, p = system.particles, system.edges, system.memory, system.walls, system.parameters
    n = p.bridge
    area = n.wall_patch * n.wall_patch
    for place in np.argsort(names[:, 0], kind="mergesort"):
        row = _touched_patch(names[place, 1], walls, n)
        if row < 0:
            raise InputError("wall_patch", None, "about a particle diameter", "the patches are too many")
        k, there = requesting[place], walls.patch_liquid[row]
        if amounts[place, 0] > 0.0:
            drawn = min(amounts[place, 0] * there / area, there)
            if k >= 0:
                memory.bridge_volume[k] += drawn
                # of the whole volume; the reduced radius is the particle's
                find_closed(k, particles.radius[edges.first[k]], memory, p)
            walls.patch_liquid[row] = there - drawn
        else:
            walls.patch_liquid[row] = there + amounts[place, 1]
        walls.patch_thickest[0] = max(walls.patch_thickest[0], walls.patch_liquid[row] / area)
