"""Circles, boxes, triangles, and what lies inside a closed surface of them, in plain arrays."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError

Array = NDArray[np.float64]


def circle(axis: Array, count: int) -> Array:
    """Points on a circle of radius 1 about an axis of unit length (count, 3)."""
    one = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    one /= np.linalg.norm(one)
    angle = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)[:, None]
    return np.asarray(np.cos(angle) * one + np.sin(angle) * np.cross(axis, one))


def edges_of(corners: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of the corners (T, 3); edges (E, 2), the lower number first; and how many triangles have each edge in
    this direction and in the other (E, 2)."""
    names = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    begin, after = names.ravel(), np.roll(names, -1, axis=1).ravel()
    ordered = np.stack([np.minimum(begin, after), np.maximum(begin, after)], axis=1)
    edges, which = np.unique(ordered, axis=0, return_inverse=True)
    which = which.reshape(-1)
    count = [np.bincount(which, weights=way, minlength=len(edges)) for way in (begin < after, begin > after)]
    return names, edges, np.stack(count, axis=1).astype(np.int64)


def is_closed(corners: Array) -> bool:
    """Whether every edge of triangles (T, 3, 3) belongs to two of them."""
    _, _, count = edges_of(corners)
    return not (count.sum(axis=1) % 2).any()


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
