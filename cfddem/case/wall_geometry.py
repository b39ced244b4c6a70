"""Where the walls of a case are, in plain arrays: distances, extents, and the side that a fluid cannot enter."""

from __future__ import annotations

import itertools
import os
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError
from cfddem.case.walls import CaseWall
from cfddem.particles.walls.stl import read_stl

if TYPE_CHECKING:
    from cfddem.case.schema import Case

Array = NDArray[np.float64]


def stamp(wall: CaseWall) -> tuple[int, int]:
    """Time and size of the file of a surface, which tell whether it has changed; 0 without a file."""
    try:
        found = os.stat(wall.file or "")
    except (OSError, ValueError):
        return 0, 0
    return found.st_mtime_ns, found.st_size


@lru_cache(maxsize=8)
def _triangles(file: str, scale: float, place: tuple[float, float, float], _: tuple[int, int]) -> Array:
    return np.asarray(np.array(place) + scale * read_stl(file))


def triangles(wall: CaseWall) -> Array:
    """Corners of the triangles of a surface (T, 3, 3) [m].

    errors  InputError if the file cannot be read
    """
    return _triangles(wall.file or "", wall.scale, wall.point, stamp(wall))


def is_closed(corners: Array) -> bool:
    """Whether every edge of triangles (T, 3, 3) belongs to two of them."""
    names = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    edges = np.sort(np.concatenate([names[:, [0, 1]], names[:, [1, 2]], names[:, [2, 0]]]), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, count = np.unique(edges, axis=0, return_counts=True)
    return bool((count % 2 == 0).all())


def extent(wall: CaseWall) -> Array | None:
    """Lower and upper corner of a box around a wall at the start (2, 3) [m]; None if the wall has no end."""
    if wall.shape == "surface":
        corners = triangles(wall).reshape(-1, 3)
        return np.array([corners.min(axis=0), corners.max(axis=0)])
    if wall.length is None:
        return None
    axis = np.array(wall.axis) / np.linalg.norm(wall.axis)
    ends = np.array([wall.point, np.array(wall.point) + wall.length * axis])
    radii = [wall.radius or 0.0, wall.top_radius or wall.radius or 0.0]
    across = np.sqrt(np.maximum(1.0 - axis**2, 0.0))
    reach = [radius * across for radius in radii]
    return np.array([
        np.minimum(*(end - r for end, r in zip(ends, reach))), np.maximum(*(end + r for end, r in zip(ends, reach)))
    ])  # fmt: skip


def distance(wall: CaseWall, points: Array) -> Array:
    """Distance of points (N, 3) [m] from a plane, cylinder or cone at the start (N,) [m].

    Negative behind a wall with one side. NaN for a surface from a file.
    """
    if wall.shape == "surface":
        return np.full(len(points), np.nan)
    if wall.shape == "plane":
        normal = np.array(wall.normal) / np.linalg.norm(wall.normal)
        return np.asarray((points - np.array(wall.point)) @ normal)
    height, radius = _about_axis(wall, points)
    own, length = wall.radius or 0.0, wall.length
    if wall.is_open:
        assert length is not None
        slope = (wall.top_radius or own) - own
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
    if wall.solid == "none":
        return np.zeros(len(points), bool)
    if wall.shape == "surface":
        inside = inside_surface(triangles(wall), points)
        return ~inside if wall.solid == "outside" else inside
    if not wall.is_open:
        return distance(wall, points) < 0.0
    height, radius = _about_axis(wall, points)
    length, own = wall.length or 0.0, wall.radius or 0.0
    there = own + ((wall.top_radius or own) - own) * height / length
    beside = (height >= 0.0) & (height <= length)
    return beside & ((radius > there) if wall.solid == "outside" else (radius < there))


def _about_axis(wall: CaseWall, points: Array) -> tuple[Array, Array]:
    """Height along the axis and distance from it (N,), (N,) [m]."""
    axis = np.array(wall.axis) / np.linalg.norm(wall.axis)
    away = points - np.array(wall.point)
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
    x = points[near][:, 0]
    order = np.argsort(lines[:, 0], kind="stable")
    crossings: dict[int, list[float]] = {}
    for a, b, c in corners:
        box = np.array([a[1:], b[1:], c[1:]])
        first, last = np.searchsorted(lines[order, 0], (box[:, 0].min(), box[:, 0].max()))
        for n in order[first:last]:
            if not box[:, 1].min() <= lines[n, 1] <= box[:, 1].max():
                continue
            weights = _weights(box, lines[n])
            if weights is not None:
                crossings.setdefault(int(n), []).append(float(weights @ np.array([a[0], b[0], c[0]])))
    for place, (own, number) in enumerate(zip(x, line.reshape(-1))):
        odd[near[place]] = sum(each > own for each in crossings.get(int(number), ())) % 2 == 1
    return odd


def _weights(triangle: Array, point: Array) -> Array | None:
    """Weights of the corners of a triangle in the plane (3, 2) at a point (2,); None outside."""
    (ay, az), (by, bz), (cy, cz) = triangle
    area = (by - ay) * (cz - az) - (bz - az) * (cy - ay)
    if area == 0.0:
        return None
    of_b = ((point[0] - ay) * (cz - az) - (point[1] - az) * (cy - ay)) / area
    of_c = ((by - ay) * (point[1] - az) - (bz - az) * (point[0] - ay)) / area
    weights = np.array([1.0 - of_b - of_c, of_b, of_c])
    return weights if (weights >= 0.0).all() else None


VESSEL = 0.5
"""Share of the column from which a closed surface is taken for a vessel, whose particles are inside [-]."""


def on_the_wrong_side(case: Case, wall: CaseWall, positions: Array) -> tuple[int, str] | None:
    """The first particle on the wrong side of a closed surface, and what is wrong; None if there is none.

    Particles belong inside a surface whose outside is solid or that encloses most of the column, outside one whose
    inside is solid, and to one side of any other.

    positions  of the particles (N, 3) [m]
    """
    if wall.shape != "surface" or not len(positions) or not is_closed(corners := triangles(wall)):
        return None
    inside = inside_surface(corners, positions)
    wanted = enclosed_volume(corners) > VESSEL * float(np.prod(case.column.size))
    wanted = wanted or bool(2 * np.count_nonzero(inside) > len(inside))
    if case.fluid is not None and wall.solid != "none":
        wanted = wall.solid == "outside"
    wrong = np.flatnonzero(inside != wanted)
    if not len(wrong):
        return None
    place = ", ".join(f"{each:.4g}" for each in positions[wrong[0]])
    others = f", and so are {len(wrong) - 1} more" if len(wrong) > 1 else ""
    return int(wrong[0]), f"at ({place}) m it is {'outside' if wanted else 'inside'}{others}"


def enclosed_volume(corners: Array) -> float:
    """Volume inside a closed surface of triangles (T, 3, 3) [m3]."""
    return abs(float(np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])))) / 6.0


def corners_of(low: Array, high: Array) -> Array:
    """The eight corners of a box (8, 3) [m]."""
    return np.array(list(itertools.product(*zip(low, high))), float)
