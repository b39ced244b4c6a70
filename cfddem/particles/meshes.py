"""Triangulated walls: how the triangles of a mesh share one contact.

A sphere may touch many triangles of one smooth surface at once. Two rules make them act as the surface does.
A triangle whose nearest point lies on a corner or an edge that it shares with a nearer triangle is silent. Two
triangles that are both touched on their faces, as in a hollow, have a contact each; but where the common edge
is itself inside the overlap they share one, in the ratio of the distances of their nearest points from that
edge, so that a force neither jumps when a face is entered nor counts twice where the faces are nearly in one
plane. A silent triangle keeps the memory of the contact beside it, and goes on with it when its turn comes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cfddem.kernels import inline, kernel
from cfddem.particles.pairs import ENTRY
from cfddem.particles.surfaces import (
    DISTANCE,
    FEATURE,
    FOOT,
    NORMAL,
    PLACE,
    SHARE,
    TOUCH,
    TRIANGLE,
    touch,
    touched,
    touched_distance,
)
from cfddem.particles.vectors import at, dot, minus, times


class _Crowd(NamedTuple):
    """What is asked of the triangles near a particle; few arrays, so that the functions compile fast."""

    pairs: int
    first: np.ndarray
    second: np.ndarray
    minimum_gap: np.ndarray
    touch: np.ndarray
    radius: np.ndarray
    kind: np.ndarray
    wall: np.ndarray
    corner: np.ndarray
    shape: np.ndarray


@kernel
def _share(crowd, cutoff_ratio):
    """Say which part each triangle has in the contact and film of its mesh."""
    begin, number = crowd.pairs, len(crowd.first)
    while begin < number:
        end = begin + 1
        while end < number and crowd.first[end] == crowd.first[begin]:
            end += 1
        speaking = 0
        for k in range(begin, end):
            if _within_reach(k, crowd, cutoff_ratio):
                silent, other = False, begin
                while other < end and not silent:
                    silent = _is_silenced(k, other, crowd)
                    other += 1
                crowd.touch[_row(k, crowd) + SHARE] = 0.0 if silent else 1.0
                speaking += 0 if silent else 1
        if speaking > 1:
            _divide(begin, end, crowd, cutoff_ratio)
        begin = end


@inline
def _row(k, crowd):
    """Where the columns of edge k begin in `touch`."""
    return TOUCH * (k - crowd.pairs)


@inline
def _within_reach(k, crowd, cutoff_ratio):
    """Whether edge k is of a triangle near enough for its contact or film."""
    radius = crowd.radius[crowd.first[k]]
    gap = crowd.touch[_row(k, crowd) + DISTANCE] - radius
    return crowd.kind[crowd.second[k]] == TRIANGLE and gap <= max(cutoff_ratio * radius, crowd.minimum_gap[k])


@inline
def _common(k, other, crowd):
    """Corners that the triangles of two edges share, as sums of the corners of the first and of the second."""
    w, v = np.int64(crowd.second[k]), np.int64(crowd.second[other])
    own, theirs = 0, 0
    if crowd.wall[w] == crowd.wall[v] and crowd.corner[3 * w] >= 0:
        for a in range(3):
            for b in range(3):
                if crowd.corner[3 * w + a] == crowd.corner[3 * v + b]:
                    own |= 1 << a
                    theirs |= 1 << b
    return own, theirs


@inline
def _is_silenced(k, other, crowd):
    """Whether the nearest point of k lies on what it shares with a nearer triangle, or with an equal earlier one."""
    own, theirs = _row(k, crowd), _row(other, crowd)
    if other == k or crowd.touch[theirs + DISTANCE] > (1.0 + 1e-9) * crowd.touch[own + DISTANCE]:
        return False
    mine, others = _common(k, other, crowd)
    if mine == 0 or int(crowd.touch[own + FEATURE]) & ~mine != 0:
        return False
    return int(crowd.touch[theirs + FEATURE]) & ~others != 0 or crowd.second[other] < crowd.second[k]


@kernel
def _divide(begin, end, crowd, cutoff_ratio):
    """Divide the contact of one particle among the triangles that speak.

    What a triangle yields to another counts only as far as that one does not yield to a third.
    """
    speaks = np.zeros(end - begin, np.bool_)
    for k in range(begin, end):
        speaks[k - begin] = crowd.touch[_row(k, crowd) + SHARE] > 0.0 and _within_reach(k, crowd, cutoff_ratio)
    speaking = begin + np.flatnonzero(speaks)
    for k in speaking:
        part = 1.0
        for other in speaking:
            weight = 1.0 - _kept(k, other, crowd)
            for third in speaking:
                if weight > 0.0 and third != k:
                    weight *= _kept(other, third, crowd)
            part *= 1.0 - weight
        crowd.touch[_row(k, crowd) + SHARE] = part


@kernel
def _kept(k, other, crowd):
    """Part that edge k keeps beside another of the same mesh: 1 where their common edge is outside the overlap."""
    common, _ = _common(k, other, crowd)
    if common == 0 or k == other:
        return 1.0
    w, row = np.int64(crowd.second[k]), _row(k, crowd)
    distance = crowd.touch[row + DISTANCE]
    gap = distance - crowd.radius[crowd.first[k]]
    beyond = _to_common(crowd, w, common, row + PLACE) - distance
    joint = 1.0 - beyond / max(abs(gap), crowd.minimum_gap[k], 1e-300)
    if joint <= 0.0:
        return 1.0
    mine = _to_common(crowd, w, common, row + FOOT)
    others = _to_common(crowd, w, common, _row(other, crowd) + FOOT)
    return 1.0 - min(joint, 1.0) * others / max(mine + others, 1e-300)


@inline
def _to_common(crowd, w, common, x):
    """Distance of the point at column x of `touch` from a corner or an edge of triangle w."""
    a = at(crowd.shape, 4 * w + (0 if common & 1 else 1 if common & 2 else 2))
    b = at(crowd.shape, 4 * w + (2 if common & 4 else 1 if common & 2 else 0))
    along, away = minus(b, a), minus((crowd.touch[x], crowd.touch[x + 1], crowd.touch[x + 2]), a)
    length = dot(along, along)
    if length > 0.0:
        away = minus(away, times(min(max(dot(away, along) / length, 0.0), 1.0), along))
    return math.sqrt(dot(away, away))


@kernel
def meet_walls(bodies, edges, walls, free, cutoff_ratio):
    """Find how particles and walls stand to each other, for all that is asked of particle-wall edges."""
    touch(bodies, edges, walls, free)
    if len(walls.cell_member) > 0:
        crowd = _Crowd(
            edges.between_particles,
            edges.first,
            edges.second,
            edges.minimum_gap,
            edges.touch,
            bodies.radius,
            walls.kind,
            walls.wall,
            walls.corner,
            walls.shape,
        )
        _share(crowd, cutoff_ratio)


@kernel
def hand_over(edges, walls):
    """Give what a contact remembers to the silent triangles beside it."""
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
            _copy_memory(edges, donor, k)


@inline
def _copy_memory(edges, donor, k):
    """All that edge k needs to go on for the donor; `resistance` says that the film has begun."""
    for x in range(3):
        edges.spring[3 * k + x] = edges.spring[3 * donor + x]
        if len(edges.roll) > 0:
            edges.roll[3 * k + x] = edges.roll[3 * donor + x]
    edges.minimum_gap[k] = edges.minimum_gap[donor]
    if len(edges.resistance) > 0:
        edges.approach_speed[k] = edges.approach_speed[donor]
        edges.accounted_gap[k] = edges.accounted_gap[donor]
        edges.resistance[k] = edges.resistance[donor]
    if len(edges.entry) > 0 and not np.isnan(edges.entry[ENTRY * k]):  # an encounter goes on where the contact is now
        begin, own = edges.entry[ENTRY * donor], edges.entry[ENTRY * k]
        moves = np.isnan(begin) or own < begin
        for x in range(ENTRY):
            if moves:
                edges.entry[ENTRY * donor + x] = edges.entry[ENTRY * k + x]
            edges.entry[ENTRY * k + x] = np.nan
