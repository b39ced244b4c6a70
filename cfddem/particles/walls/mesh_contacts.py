"""Triangulated walls: how the triangles of a mesh share one contact.

A sphere may touch many triangles of one smooth surface at once. Two rules make them act as the surface does.
First, a triangle is inactive if its nearest point lies on a corner or an edge that it shares with a nearer triangle.
Second, two triangles that are both touched on their faces, as in a hollow, have a contact each. But where the common
edge is itself inside the overlap they share one contact, in the ratio of the distances of their nearest points from
that edge. So a force does not jump when a face is entered, and does not count twice where the faces are nearly in one
plane. An inactive triangle keeps a copy of the memory of the contact beside it, and continues from it when it becomes
active.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline, serial
from cfddem.particles.collision_events import move_event
from cfddem.particles.interactions.slots import RECORD, TRIANGLES, copy_memory
from cfddem.particles.vectors import at, dot, minus, times
from cfddem.particles.walls.nearest_point import (
    DISTANCE,
    FEATURE,
    FOOT,
    NORMAL,
    PLACE,
    SHARE,
    TOUCH,
    TRIANGLE,
    WallPairs,
    touch,
    touched,
    touched_distance,
)


@serial
def _share(at_walls, cutoff_ratio):
    """Find the share of each triangle in the contact and film of its mesh."""
    begin, number = at_walls.between_particles, len(at_walls.first)
    while begin < number:
        end = begin + 1
        while end < number and at_walls.first[end] == at_walls.first[begin]:
            end += 1
        active = 0
        for k in range(begin, end):
            if _within_reach(k, at_walls, cutoff_ratio):
                inactive, other = False, begin
                while other < end and not inactive:
                    inactive = _is_inactive_beside(k, other, at_walls)
                    other += 1
                at_walls.touch[_row(k, at_walls) + SHARE] = 0.0 if inactive else 1.0
                active += 0 if inactive else 1
        if active > 1:
            _divide(begin, end, at_walls, cutoff_ratio)
        begin = end


@inline
def _row(k, at_walls):
    """Where the columns of edge k begin in `touch`."""
    return TOUCH * (k - at_walls.between_particles)


@inline
def _within_reach(k, at_walls, cutoff_ratio):
    """Whether edge k is of a triangle near enough for its contact or film."""
    radius = at_walls.radius[at_walls.first[k]]
    gap = at_walls.touch[_row(k, at_walls) + DISTANCE] - radius
    return at_walls.kind[at_walls.second[k]] == TRIANGLE and gap <= max(cutoff_ratio * radius, at_walls.minimum_gap[k])


@inline
def _common(k, other, at_walls):
    """Corners that the triangles of two edges share, as sums of the corners of the first and of the second."""
    w, v = np.int64(at_walls.second[k]), np.int64(at_walls.second[other])
    own, theirs = 0, 0
    if at_walls.wall[w] == at_walls.wall[v] and at_walls.corner[3 * w] >= 0:
        for a in range(3):
            for b in range(3):
                if at_walls.corner[3 * w + a] == at_walls.corner[3 * v + b]:
                    own |= 1 << a
                    theirs |= 1 << b
    return own, theirs


@inline
def _is_inactive_beside(k, other, at_walls):
    """Whether the nearest point of k lies on what it shares with a nearer triangle, or with an equal earlier one."""
    own, theirs = _row(k, at_walls), _row(other, at_walls)
    if other == k or at_walls.touch[theirs + DISTANCE] > (1.0 + 1e-9) * at_walls.touch[own + DISTANCE]:
        return False
    mine, others = _common(k, other, at_walls)
    if mine == 0 or int(at_walls.touch[own + FEATURE]) & ~mine != 0:
        return False
    return int(at_walls.touch[theirs + FEATURE]) & ~others != 0 or at_walls.second[other] < at_walls.second[k]


@serial
def _divide(begin, end, at_walls, cutoff_ratio):
    """Divide the contact of one particle among its active triangles.

    The part that a triangle yields to a second one is reduced by the part that the second yields to a third.
    """
    active = np.zeros(end - begin, np.bool_)
    for k in range(begin, end):
        active[k - begin] = at_walls.touch[_row(k, at_walls) + SHARE] > 0.0 and _within_reach(k, at_walls, cutoff_ratio)
    rows = begin + np.flatnonzero(active)
    for k in rows:
        part = 1.0
        for other in rows:
            weight = 1.0 - _kept(k, other, at_walls)
            for third in rows:
                if weight > 0.0 and third != k:
                    weight *= _kept(other, third, at_walls)
            part *= 1.0 - weight
        at_walls.touch[_row(k, at_walls) + SHARE] = part


@serial
def _kept(k, other, at_walls):
    """Part that edge k keeps beside another of the same mesh: 1 where their common edge is outside the overlap."""
    common, _ = _common(k, other, at_walls)
    if common == 0 or k == other:
        return 1.0
    w, row = np.int64(at_walls.second[k]), _row(k, at_walls)
    distance = at_walls.touch[row + DISTANCE]
    gap = distance - at_walls.radius[at_walls.first[k]]
    beyond = _to_common(at_walls, w, common, row + PLACE) - distance
    joint = 1.0 - beyond / max(abs(gap), at_walls.minimum_gap[k], 1e-300)
    if joint <= 0.0:
        return 1.0
    mine = _to_common(at_walls, w, common, row + FOOT)
    others = _to_common(at_walls, w, common, _row(other, at_walls) + FOOT)
    return 1.0 - min(joint, 1.0) * others / max(mine + others, 1e-300)


@inline
def _to_common(at_walls, w, common, x):
    """Distance of the point at column x of `touch` from a corner or an edge of triangle w."""
    a = at(at_walls.shape, 4 * w + (0 if common & 1 else 1 if common & 2 else 2))
    b = at(at_walls.shape, 4 * w + (2 if common & 4 else 1 if common & 2 else 0))
    along, away = minus(b, a), minus((at_walls.touch[x], at_walls.touch[x + 1], at_walls.touch[x + 2]), a)
    length = dot(along, along)
    if length > 0.0:
        away = minus(away, times(min(max(dot(away, along) / length, 0.0), 1.0), along))
    return math.sqrt(dot(away, away))


@serial
def pairs_at_walls(system):
    """What the geometry of particle-wall edges needs of a system: the same for all laws."""
    particles, edges, walls = system.particles, system.edges, system.walls
    return WallPairs(
        edges.between_particles, edges.first, edges.second, system.memory.minimum_gap, edges.touch,
        particles.position, particles.velocity, particles.radius, np.array(system.parameters.free),
        walls.kind, walls.shape, walls.corner, walls.wall, walls.velocity, walls.spin, walls.centre, walls.shift,
        walls.turned, walls.sweep,
    )  # fmt: skip


@serial
def wall_contacts(at_walls, cutoff_ratio):
    """Find the geometry of all particle-wall edges.

    cutoff_ratio  reach of films over R*; 0 without films [-]
    """
    touch(at_walls)
    if TRIANGLES:
        _share(at_walls, cutoff_ratio)


@serial
def share_memory(system):
    """Copy the memory of each contact to the inactive triangles beside it, which may become active."""
    edges, memory, walls = system.edges, system.memory, system.walls
    pairs, number = edges.between_particles, len(edges.first)
    begin = pairs
    for k in range(pairs, number):
        if edges.first[k] != edges.first[begin]:
            begin = k
        if edges.touch[TOUCH * (k - pairs) + SHARE] > 0.0:
            continue
        own = times(touched_distance(edges, k), touched(edges, k, NORMAL))
        donor, least, other = -1, np.inf, begin
        while other < number and edges.first[other] == edges.first[k]:
            active = edges.touch[TOUCH * (other - pairs) + SHARE] > 0.0
            if active and walls.wall[edges.second[other]] == walls.wall[edges.second[k]]:
                way = minus(times(touched_distance(edges, other), touched(edges, other, NORMAL)), own)
                if dot(way, way) < least:
                    donor, least = other, dot(way, way)
            other += 1
        if donor >= 0:
            copy_memory(memory, donor, k)
            if RECORD:
                move_event(memory, k, donor)
