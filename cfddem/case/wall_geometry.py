"""Where the walls of a case are, in plain arrays: distances, extents, and the side that a fluid cannot enter."""

from __future__ import annotations

import itertools
import math
import os
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError
from cfddem.case.walls import CaseWall
from cfddem.fluid.triangles import edges_of
from cfddem.particles.walls.stl import read_surface

Array = NDArray[np.float64]

SIDES = 96
"""Sides of an open cylinder or cone as a thin wall of the fluid."""


def stamp(wall: Any) -> tuple[int, int]:
    """Time and size of the file of a wall or vessel, which tell whether it has changed; 0 without a file."""
    try:
        status = os.stat(wall.file or "")
    except (OSError, ValueError):
        return 0, 0
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=8)
def _triangles(file: str, scale: float, place: tuple[float, float, float], _: tuple[int, int]) -> Array:
    return np.asarray(np.array(place) + scale * read_surface(file))


def triangles(wall: CaseWall) -> Array:
    """Corners of the triangles of a surface or plate, or of an open cylinder or cone with many sides (T, 3, 3) [m].

    errors  InputError if the file cannot be read
    """
    if wall.edges:
        first, second = np.array(wall.edges)
        quad = np.array(wall.point) + np.array([0.0 * first, first, first + second, second])
        return quad[[[0, 1, 2], [0, 2, 3]]]
    return _around(wall) if wall.is_open else _triangles(wall.file or "", wall.scale, wall.point, stamp(wall))


def _around(wall: CaseWall) -> Array:
    """Triangles of an open cylinder or cone (T, 3, 3) [m]."""
    axis = direction(wall)
    around, (own, top) = circle(axis, SIDES), wall.radii
    low = np.array(wall.point) + own * around
    high = np.array(wall.point) + (wall.length or 0.0) * axis + top * around
    after = [np.roll(corner, -1, axis=0) for corner in (low, high)]
    return np.concatenate([np.stack([low, after[0], after[1]], 1), np.stack([low, after[1], high], 1)])


def direction(wall: CaseWall) -> Array:
    """Axis of a cylinder or cone, of unit length (3,)."""
    return np.asarray(np.array(wall.axis) / np.linalg.norm(wall.axis))


def circle(axis: Array, count: int) -> Array:
    """Points on a circle of radius 1 about an axis of unit length (count, 3)."""
    one = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    one /= np.linalg.norm(one)
    angle = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)[:, None]
    return np.asarray(np.cos(angle) * one + np.sin(angle) * np.cross(axis, one))


def is_closed(corners: Array) -> bool:
    """Whether every edge of triangles (T, 3, 3) belongs to two of them."""
    _, _, count = edges_of(corners)
    return not (count.sum(axis=1) % 2).any()


@lru_cache(maxsize=8)
def _closed(file: str, scale: float, place: tuple[float, float, float], written: tuple[int, int]) -> bool:
    return is_closed(_triangles(file, scale, place, written))


def encloses(wall: CaseWall) -> bool:
    """Whether a surface from a file is closed.

    errors  InputError if the file cannot be read
    """
    return _closed(wall.file or "", wall.scale, wall.point, stamp(wall))


def extent(wall: CaseWall) -> Array | None:
    """Lower and upper corner of a box around a wall at the start (2, 3) [m]; None if the wall has no end."""
    if wall.has_triangles:
        corners = triangles(wall).reshape(-1, 3)
        return np.array([corners.min(axis=0), corners.max(axis=0)])
    if wall.length is None:
        return None
    axis = direction(wall)
    ends = np.array([wall.point, np.array(wall.point) + wall.length * axis])
    reach = np.outer(wall.radii, np.sqrt(np.maximum(1.0 - axis**2, 0.0)))
    return np.array([(ends - reach).min(axis=0), (ends + reach).max(axis=0)])


def distance(wall: CaseWall, points: Array) -> Array:
    """Distance of points (N, 3) [m] from a plane, cylinder or cone at the start (N,) [m].

    Negative behind a wall with one side. NaN for a surface from a file and for a plate.
    """
    if wall.has_triangles:
        return np.full(len(points), np.nan)
    if wall.shape == "plane":
        normal = np.array(wall.normal) / np.linalg.norm(wall.normal)
        return np.asarray((points - np.array(wall.point)) @ normal)
    height, radius = _about_axis(wall, points)
    (own, top), length = wall.radii, wall.length
    if wall.is_open:
        assert length is not None
        slope = top - own
        along = np.clip(((radius - own) * slope + height * length) / (slope**2 + length**2), 0.0, 1.0)
        return np.hypot(radius - own - along * slope, height - along * length)
    side = radius - own
    if length is None:
        return side if wall.outside else -side
    ends = np.maximum(-height, height - length)
    beyond = np.hypot(np.maximum(side, 0.0), np.maximum(ends, 0.0)) + np.minimum(np.maximum(side, ends), 0.0)
    return beyond if wall.outside else -np.maximum(side, ends)


def solid_part(wall: CaseWall, points: Array) -> NDArray[np.bool_]:
    """Which points (N, 3) [m] a wall closes to the fluid (N,)."""
    if wall.solid == "none" or wall.is_thin:
        return np.zeros(len(points), bool)
    if wall.shape == "surface":
        inside = inside_surface(triangles(wall), points)
        return ~inside if wall.solid == "outside" else inside
    if not wall.is_open:
        return distance(wall, points) < 0.0
    height, radius = _about_axis(wall, points)
    length, (own, top) = wall.length or 0.0, wall.radii
    there = own + (top - own) * height / length
    beside = (height >= 0.0) & (height <= length)
    return beside & ((radius > there) if wall.solid == "outside" else (radius < there))


def _about_axis(wall: CaseWall, points: Array) -> tuple[Array, Array]:
    """Height along the axis and distance from it (N,), (N,) [m]."""
    axis, away = direction(wall), points - np.array(wall.point)
    height = away @ axis
    return height, np.linalg.norm(away - height[:, None] * axis, axis=1)


def inside_surface(corners: Array, points: Array) -> NDArray[np.bool_]:
    """Which points (N, 3) lie inside a closed surface of triangles (T, 3, 3) (N,).

    A point is inside if a ray along x crosses the surface an odd number of times. The rays are shifted by a millionth
    of the size of the surface, so that none runs along an edge.

    errors  InputError if the surface is not closed
    """
    if not is_closed(corners):
        limit = 'a closed surface, every edge with two triangles, or solid = "none"'
        raise InputError("file", None, limit, "an open surface has no inside")
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    shift = 1e-6 * np.linalg.norm(high - low) * np.array([0.0, 0.618, 0.414])
    odd, near = np.zeros(len(points), bool), np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    lines, line = np.unique(points[near][:, 1:] + shift[1:], axis=0, return_inverse=True)
    line = line.reshape(-1)
    crossed, at = _crossings(corners, lines)
    # along each line, in the order of x: how many crossings are beyond a point
    every, x = np.concatenate([crossed, line]), np.concatenate([at, points[near][:, 0]])
    is_point = np.arange(len(every)) >= len(crossed)
    order = np.lexsort((is_point, x, every))
    so_far = np.empty(len(every), int)
    so_far[order] = np.cumsum(~is_point[order])
    upto = np.cumsum(np.bincount(crossed, minlength=len(lines)))
    odd[near] = (upto[line] - so_far[is_point]) % 2 == 1
    return odd


MOST_PAIRS = 1_000_000
"""Pairs of triangles and lines that are computed together."""


def _crossings(corners: Array, lines: Array) -> tuple[NDArray[np.int64], Array]:
    """Where lines along x cross triangles: number of the line and x of each crossing.

    corners  of the triangles (T, 3, 3)
    lines    their y and z (L, 2), sorted by y
    """
    low, high = corners[:, :, 1].min(axis=1), corners[:, :, 1].max(axis=1)
    first, last = np.searchsorted(lines[:, 0], low), np.searchsorted(lines[:, 0], high)
    ends = np.cumsum(last - first)
    numbers, places, begin = [np.zeros(0, np.int64)], [np.zeros(0)], 0
    while begin < len(corners):
        done = ends[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, done + MOST_PAIRS)))
        count = (last - first)[begin:end]
        triangle = np.repeat(np.arange(begin, begin + len(count)), count)
        number = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count) + first[triangle]
        z = lines[number, 1]
        beside = (z >= corners[triangle, :, 2].min(axis=1)) & (z <= corners[triangle, :, 2].max(axis=1))
        triangle, number = triangle[beside], number[beside]
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners[triangle].transpose(1, 2, 0)
        y, z = lines[number].T
        area = (by - ay) * (cz - az) - (bz - az) * (cy - ay)
        with np.errstate(divide="ignore", invalid="ignore"):  # a triangle along the lines has no area, and no weights
            of_b = ((y - ay) * (cz - az) - (z - az) * (cy - ay)) / area
            of_c = ((by - ay) * (z - az) - (bz - az) * (y - ay)) / area
            of_a = 1.0 - of_b - of_c
            inside = (of_a >= 0.0) & (of_b >= 0.0) & (of_c >= 0.0) & (area != 0.0)
            numbers.append(number[inside])
            places.append((of_a * ax + of_b * bx + of_c * cx)[inside])
        begin = end
    return np.concatenate(numbers), np.concatenate(places)


def corners_of(low: Array, high: Array) -> Array:
    """The eight corners of a box (8, 3) [m]."""
    return np.array(list(itertools.product(*zip(low, high))), float)
