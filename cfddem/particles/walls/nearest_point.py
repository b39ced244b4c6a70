"""Nearest point of each simple piece of a wall to the centre of a sphere.

A wall consists of pieces. Each piece has one nearest point to a centre, so a sphere has at most one contact with it.
The pieces of a moving wall stay in the frame in which the wall was made; positions are transformed into that frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import inline, part, prange, serial
from cfddem.particles.vectors import at, cross, dot, minus, plus, put, times

PLANE, TRIANGLE, REVOLVED, SOLID_CYLINDER = 0, 1, 2, 3
"""Kinds of piece: a plane; a triangle; a straight line turned about an axis; a solid cylinder seen from outside."""

NUMBERS = 12
"""Numbers that describe a piece: see `nearest`."""

NORMAL, DISTANCE, SURFACE, TURN, FEATURE, SHARE, PLACE, FOOT, TOUCH = 0, 3, 4, 7, 10, 11, 12, 15, 18
"""Columns of `Graph.touch`, and their number; PLACE and FOOT: centre and nearest point in the frame of the wall."""

FACE = 7
"""Feature of a triangle as the sum of its corners (1, 2, 4): one for a corner, two for an edge, all for the face."""

_FLAT = (0.0, 0.0, 0.0)


class Walls(NamedTuple):
    """The arrays of P pieces of M walls, as compiled loops take them."""

    kind: np.ndarray  # (P,) int8
    shape: np.ndarray  # (P, 12) numbers of the piece, in the frame the wall was made in
    corner: np.ndarray  # (P, 3) int32, corners of a triangle by number; equal numbers are one point
    material: np.ndarray  # (P,) int32
    wall: np.ndarray  # (P,) int32, wall that the piece belongs to
    velocity: np.ndarray  # (M, 3) [m/s]
    spin: np.ndarray  # (M, 3) [rad/s]
    centre: np.ndarray  # (M, 3) of the spin, at the start [m]
    shift: np.ndarray  # (M, 3) displacement of the wall since the start [m]
    turned: np.ndarray  # (M, 9) rotation since the start, row by row
    sweep: np.ndarray  # (M,) bound of the speed at which the surface leaves its position; 0 if it stays [m/s]
    travel: np.ndarray  # (M,) bound of the displacement since the last neighbour list [m]
    single: np.ndarray  # int32, pieces that are not triangles
    cell_low: np.ndarray  # (M, 3) lower corner of the cells of a mesh [m]
    cell_width: np.ndarray  # (M,) [m]
    cell_number: np.ndarray  # (M, 3) int64; 0 for a wall without triangles
    cell_offset: np.ndarray  # (M,) int64, first cell of a mesh in `cell_start`
    cell_start: np.ndarray  # (all cells + 1,) int64, where the triangles of a cell begin in `cell_member`
    cell_member: np.ndarray  # int32, pieces
    patch_key: np.ndarray = np.zeros(0, np.int64)  # names of the patches whose liquid has changed, in ascending order
    patch_liquid: np.ndarray = np.zeros(0)  # on each of them [m3]
    patch_count: np.ndarray = np.zeros(1, np.int64)  # (1,) their number; arrays have room for more
    patch_thickest: np.ndarray = np.zeros(1)  # (1,) largest thickness of the liquid on a patch so far [m]


class WallPairs(NamedTuple):
    """The particle-wall edges, and all that their geometry depends on: one compiled loop serves all laws."""

    between_particles: int  # edges that come before
    first: np.ndarray
    second: np.ndarray
    minimum_gap: np.ndarray  # gap below which the solids of each edge touch [m]
    touch: np.ndarray  # what is found
    position: np.ndarray  # of the particles [m]
    moved: np.ndarray  # velocity of the particles [m/s]
    radius: np.ndarray  # of the particles [m]
    free: np.ndarray  # (3,) 1 for each axis along which particles can move
    kind: np.ndarray  # of the pieces, and so on: see `Walls`
    shape: np.ndarray
    corner: np.ndarray
    wall: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    centre: np.ndarray
    shift: np.ndarray
    turned: np.ndarray
    sweep: np.ndarray


@inline
def _triangle(shape, w, place):
    """Direction from the nearest point, distance, and the feature of the triangle it lies on (Ericson 2004, 5.1.5)."""
    a, b, c = at(shape, 4 * w), at(shape, 4 * w + 1), at(shape, 4 * w + 2)
    face = at(shape, 4 * w + 3)
    ab, ac = minus(b, a), minus(c, a)
    pa, pb, pc = minus(place, a), minus(place, b), minus(place, c)
    d1, d2, d3, d4, d5, d6 = dot(ab, pa), dot(ac, pa), dot(ab, pb), dot(ac, pb), dot(ab, pc), dot(ac, pc)
    to_c, to_b, to_a = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    along = _FLAT
    if d1 <= 0.0 and d2 <= 0.0:
        away, feature = pa, 1
    elif d3 >= 0.0 and d4 <= d3:
        away, feature = pb, 2
    elif d6 >= 0.0 and d5 <= d6:
        away, feature = pc, 4
    elif to_c <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        away, feature, along = minus(pa, times(d1 / (d1 - d3), ab)), 3, ab
    elif to_b <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        away, feature, along = minus(pa, times(d2 / (d2 - d6), ac)), 5, ac
    elif to_a <= 0.0 and d4 >= d3 and d5 >= d6:
        away, feature, along = minus(pb, times((d4 - d3) / (d4 - d3 + d5 - d6), minus(c, b))), 6, minus(c, b)
    else:
        distance = dot(pa, face)
        if distance < 0.0:
            return times(-1.0, face), -distance, FACE, 0.0, 0.0, _FLAT
        return face, distance, FACE, 0.0, 0.0, _FLAT
    distance = math.sqrt(dot(away, away))
    curvature = 1.0 / distance
    length = math.sqrt(dot(along, along))
    if length == 0.0:
        return times(curvature, away), distance, feature, curvature, 0.0, _FLAT
    return times(curvature, away), distance, feature, curvature, -curvature, times(1.0 / length, along)


@inline
def _around(shape, w, place):
    """Height along the axis, distance from it, and the unit vectors outward and around."""
    axis = at(shape, 4 * w + 1)
    away = minus(place, at(shape, 4 * w))
    height = dot(away, axis)
    away = minus(away, times(height, axis))
    radius = math.sqrt(dot(away, away))
    if radius == 0.0:  # all directions are equally near
        away = cross(axis, (0.0, 0.0, 1.0) if abs(axis[2]) < 0.5 else (1.0, 0.0, 0.0))
        outward = times(1.0 / math.sqrt(dot(away, away)), away)
    else:
        outward = times(1.0 / radius, away)
    return height, radius, outward, axis, cross(axis, outward)


@inline
def _revolved(shape, w, place):
    """Nearest point of a line turned about an axis, as seen in the half-plane of distance and height."""
    height, radius, outward, axis, around = _around(shape, w, place)
    x = np.uint64(NUMBERS) * np.uint64(w) + np.uint64(6)
    tangent_r, tangent_z = shape[x + np.uint64(1)], shape[x + np.uint64(2)]
    r = radius - shape[x]
    along = r * tangent_r + height * tangent_z
    end = min(max(along, shape[x + np.uint64(3)]), shape[x + np.uint64(4)])
    curvature = 0.0
    if along == end:
        normal_r, normal_z = -tangent_z, tangent_r
        distance = r * normal_r + height * normal_z
        if distance < 0.0 and shape[x + np.uint64(5)] != 0.0:
            normal_r, normal_z, distance = -normal_r, -normal_z, -distance
    else:
        r, z = r - end * tangent_r, height - end * tangent_z
        distance = math.sqrt(r * r + z * z)
        curvature = 1.0 / distance
        normal_r, normal_z = r * curvature, z * curvature
    normal = plus(times(normal_r, outward), times(normal_z, axis))
    return normal, distance, FACE, curvature, (normal_r / radius if radius > 0.0 else 0.0) - curvature, around


@inline
def _solid_cylinder(shape, w, place):
    """Nearest point of a solid cylinder."""
    height, radius, outward, axis, around = _around(shape, w, place)
    x = np.uint64(NUMBERS) * np.uint64(w) + np.uint64(6)
    side = radius - shape[x]
    end, beyond = (axis, height - shape[x + np.uint64(1)]) if 2.0 * height > shape[x + np.uint64(1)] else (
        times(-1.0, axis), -height
    )  # fmt: skip
    if side > 0.0 and beyond > 0.0:
        distance = math.sqrt(side * side + beyond * beyond)
        curvature = 1.0 / distance
        normal = plus(times(side * curvature, outward), times(beyond * curvature, end))
        return normal, distance, FACE, curvature, side * curvature / radius - curvature, around
    if side > beyond:
        return outward, side, FACE, 0.0, 1.0 / radius, around
    return end, beyond, FACE, 0.0, 0.0, around


@serial
def nearest(kind, shape, w, place):
    """The nearest point of piece w to a position, both in the frame of the wall.

    Numbers of a piece: a plane has a point and its normal; a triangle three corners and its normal; a turned
    line the origin and direction of the axis, where the line crosses height 0 (distance from the axis), its
    direction (outward, along the axis), its begin and end along that, and whether it has two faces; a solid
    cylinder origin and direction of the axis, radius and length.

    returns  unit normal, from the surface to the position
             distance along it, negative behind a surface with one face [m]
             feature of a triangle
             curvature, bend [1/m] and direction: a motion v along the surface turns the normal by
             curvature v + bend (v . direction) direction
    """
    if kind[w] == TRIANGLE:
        return _triangle(shape, w, place)
    if kind[w] == REVOLVED:
        return _revolved(shape, w, place)
    if kind[w] == SOLID_CYLINDER:
        return _solid_cylinder(shape, w, place)
    normal = at(shape, 4 * w + 1)
    return normal, dot(minus(place, at(shape, 4 * w)), normal), FACE, 0.0, 0.0, _FLAT


@inline
def _rotated(turned, m, a):
    """A vector of the frame of wall m in its present orientation."""
    return (
        dot(at(turned, 3 * m), a),
        dot(at(turned, 3 * m + 1), a),
        dot(at(turned, 3 * m + 2), a),
    )  # fmt: skip


@inline
def in_frame(walls, m, place):
    """A position in the frame in which wall m was made."""
    return place if walls.sweep[m] == 0.0 else carried_back(walls, m, place)


@inline
def carried_back(walls, m, place):
    """A position in the frame that moves with the surface of wall m, also where the wall stays in place."""
    away = minus(place, plus(at(walls.shift, m), at(walls.centre, m)))
    back = plus(
        times(away[0], at(walls.turned, 3 * m)),
        plus(times(away[1], at(walls.turned, 3 * m + 1)), times(away[2], at(walls.turned, 3 * m + 2))),
    )
    return plus(back, at(walls.centre, m))


@part
def touch(at_walls):
    """Geometry of each particle-wall edge: normal, distance, velocity of the surface, turning rate of the normal."""
    for k in prange(at_walls.between_particles, len(at_walls.first)):
        touch_edge(k, at_walls)


@inline
def touch_edge(k, at_walls):
    """Geometry of particle-wall edge k."""
    i, w, free = np.int64(at_walls.first[k]), np.int64(at_walls.second[k]), at_walls.free
    m = np.int64(at_walls.wall[w])
    place = at(at_walls.position, i)
    local = in_frame(at_walls, m, place)
    normal, distance, feature, curvature, bend, direction = nearest(at_walls.kind, at_walls.shape, w, local)
    row = TOUCH * (k - at_walls.between_particles)
    _put(at_walls.touch, row + PLACE, local)
    _put(at_walls.touch, row + FOOT, minus(local, times(distance, normal)))
    if at_walls.sweep[m] != 0.0:
        normal, direction = _rotated(at_walls.turned, m, normal), _rotated(at_walls.turned, m, direction)
    velocity, spin = at(at_walls.velocity, m), at(at_walls.spin, m)
    arm = minus(place, plus(at(at_walls.centre, m), at(at_walls.shift, m)))
    surface = plus(velocity, cross(spin, minus(arm, times(distance, normal))))
    moved = at(at_walls.moved, i)
    moved = (free[0] * moved[0], free[1] * moved[1], free[2] * moved[2])
    moved = minus(moved, plus(velocity, cross(spin, arm)))
    turn = plus(times(curvature, moved), times(bend * dot(moved, direction), direction))
    _put(at_walls.touch, row + NORMAL, normal)
    at_walls.touch[row + DISTANCE] = distance
    _put(at_walls.touch, row + SURFACE, surface)
    _put(at_walls.touch, row + TURN, plus(turn, cross(spin, normal)))
    at_walls.touch[row + FEATURE] = feature
    at_walls.touch[row + SHARE] = 1.0


@inline
def _put(array, x, a):
    array[x], array[x + 1], array[x + 2] = a


@inline
def touched(edges, k, column):
    """A vector of the geometry of particle-wall edge k."""
    x = np.uint64(TOUCH) * (np.uint64(k) - np.uint64(edges.between_particles)) + np.uint64(column)
    return (edges.touch[x], edges.touch[x + np.uint64(1)], edges.touch[x + np.uint64(2)])


@inline
def touched_distance(edges, k):
    """Distance of the centre from the wall along particle-wall edge k [m]."""
    return edges.touch[np.uint64(TOUCH) * (np.uint64(k) - np.uint64(edges.between_particles)) + np.uint64(DISTANCE)]


@inline
def portion(edges, k):
    """Share of edge k in its contact and film: below 1 where triangles of a mesh share one."""
    if k < edges.between_particles:
        return 1.0
    return edges.touch[np.uint64(TOUCH) * (np.uint64(k) - np.uint64(edges.between_particles)) + np.uint64(SHARE)]


@serial
def advance_walls(walls, step):
    """Move the walls by a step; returns the largest displacement of a surface since the last list [m]."""
    longest = 0.0
    for m in range(len(walls.sweep)):
        put(walls.shift, m, plus(at(walls.shift, m), times(step, at(walls.velocity, m))))
        walls.travel[m] += step * walls.sweep[m]
        longest = max(longest, walls.travel[m])
        spin = at(walls.spin, m)
        rate = math.sqrt(dot(spin, spin))
        if rate == 0.0:
            continue
        axis = times(1.0 / rate, spin)
        sine, versine = math.sin(step * rate), 2.0 * math.sin(0.5 * step * rate) ** 2
        for column in range(3):
            x = 9 * m + column
            a = (walls.turned[x], walls.turned[x + 3], walls.turned[x + 6])
            across = cross(axis, a)
            a = plus(a, plus(times(sine, across), times(versine, cross(axis, across))))
            walls.turned[x], walls.turned[x + 3], walls.turned[x + 6] = a
    return longest
