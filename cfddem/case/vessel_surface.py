"""The wall of a vessel in plain numbers: for the fluid, and for what lies inside of it."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError, shown
from cfddem.case.bed import Point
from cfddem.case.vessel_shape import ROUND_OFF, CaseVessel
from cfddem.fluid.surfaces import Plane, Surface, together, turned
from cfddem.fluid.triangles import ClosedSurface, closed_surface, section_area, through_ends
from cfddem.model.triangles import Array
from cfddem.particles.walls.stl import stamp

IN_MILLIMETRES = 30.0
"""Size of a surface over that of the column from which its file may be in millimetres [-]."""

LEAST_SIZE = 0.05
"""Size of a surface over that of the column below which its unit may be wrong [-]."""

BEYOND = 8.0
"""Cells by which flat ends of a surface at floor and lid are moved out, so that these are open to the fluid [-]."""

LEVELS, ACROSS = 24, 48
"""Heights, and places along x and y, at which the room within a vessel is sampled."""


def surface_in(vessel: CaseVessel, column: Any) -> Surface:
    """The wall of a vessel as the fluid sees it.

    errors  InputError for a surface that is not closed, inside out, beyond the column or through itself
    """
    if vessel.shape == "surface":
        return _closed(vessel, column, stamp(vessel))
    if vessel.is_round:
        centre = (0.5 * column.size[0], 0.5 * column.size[1], 0.0)
        return turned(vessel.line_in(column), centre, spin=vessel.spin)
    return together(*(Plane(wall.point, wall.normal) for wall in vessel.walls_in(column)))


def area_of_end(vessel: CaseVessel, column: Any, side: str) -> float:
    """Cross-section at "floor" or "lid", or at the end of a surface that does not reach it [m2]."""
    if vessel.is_round:
        return math.pi * vessel.line_in(column)[0 if side == "floor" else -1][1] ** 2
    if vessel.size:
        return math.prod(vessel.size)
    surface = surface_in(vessel, column)
    assert isinstance(surface, ClosedSurface)
    heights, beside = surface.corners[:, :, 2], 1e-6 * column.height
    if side == "floor":
        return section_area(surface.corners, max(0.0, float(heights.min())) + beside)
    return section_area(surface.corners, min(column.height, float(heights.max())) - beside)


def corners_in(vessel: CaseVessel, column: Any) -> Array:
    """Triangles that particles meet (T, 3, 3) [m]: those of a surface, without flat ends at floor and lid, or the sides
    of a box."""
    height = column.height
    if vessel.shape == "surface":
        surface_in(vessel, column)  # refuses what is no vessel
        corners = vessel.walls_in(column)[0].form.corners()
        flat = [(np.abs(corners[:, :, 2] - level) < 1e-6 * height).all(axis=1) for level in (0.0, height)]
        return np.asarray(corners[~(flat[0] | flat[1])])
    low, high = (np.column_stack([vessel.plan_in(column), np.full(4, z)]) for z in (-0.1 * height, 1.1 * height))
    next_low, next_high = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
    return np.concatenate([np.stack([low, next_low, next_high], 1), np.stack([low, next_high, high], 1)])


@lru_cache(maxsize=8)
def start_box_in(vessel: CaseVessel, column: Any, _: tuple[int, int]) -> tuple[Point, Point]:
    """Corner and size of the largest box with edges along x and y in the widest part of a vessel [m]."""
    x, y, z = ((np.arange(n) + 0.5) * length / n for n, length in zip((ACROSS, ACROSS, LEVELS), column.size))
    inside = surface_in(vessel, column).distance(x[None, None, :], y[None, :, None], z[:, None, None]) > 0.0
    levels = np.flatnonzero(inside.any(axis=(1, 2)))
    widest = inside[np.argmax(inside.sum(axis=(1, 2)))]
    steps = [length / n for length, n in zip(column.size, (ACROSS, ACROSS, LEVELS))]
    (left, right), (front, back) = _largest_rectangle(widest)
    low = (left * steps[0], front * steps[1], float(levels[0]) * steps[2])
    size = ((right - left) * steps[0], (back - front) * steps[1], (levels[-1] + 1.0) * steps[2] - low[2])
    return low, size


def _largest_rectangle(mask: np.ndarray) -> tuple[tuple[int, int], tuple[int, int]]:
    """Columns and rows, from and to, of the largest rectangle of true values of a mask (rows, columns)."""
    best, place = 0, ((0, 0), (0, 0))
    for first in range(len(mask)):
        every = np.ones(mask.shape[1], bool)
        for last in range(first, len(mask)):
            every &= mask[last]
            edges = np.flatnonzero(np.diff(np.concatenate([[False], every, [False]])))
            if not len(edges):
                break
            longest = int(np.argmax(edges[1::2] - edges[::2]))
            begin, end = int(edges[2 * longest]), int(edges[2 * longest + 1])
            if (end - begin) * (last + 1 - first) > best:
                best, place = (end - begin) * (last + 1 - first), ((begin, end), (first, last + 1))
    return place


@lru_cache(maxsize=8)
def _closed(vessel: CaseVessel, column: Any, _: tuple[int, int]) -> ClosedSurface:
    """The closed surface of a file, with open ends at floor and lid."""
    try:
        corners = vessel.walls_in(column)[0].form.corners()
    except InputError as failure:
        raise InputError("vessel.file", failure.value, failure.limit, failure.remedy) from None
    size = np.array(column.size)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    ends = " to ".join(f"({', '.join(f'{coordinate:.4g}' for coordinate in corner)})" for corner in (low, high))
    times = float((high - low).max() / size.max())
    if times > IN_MILLIMETRES or times < LEAST_SIZE:
        remedy = "scale = 0.001 reads a file in millimetres" if times > 1.0 else "scale is the unit of the file in m"
        raise InputError("vessel.scale", vessel.scale, f"such that the surface is about as large as the column; it "
                         f"reaches from {ends} m, {times:.3g} times its size", remedy)  # fmt: skip
    if ((low < -ROUND_OFF * size) | (high > (1.0 + ROUND_OFF) * size))[:2].any() or high[2] < 0.0 or low[2] > size[2]:
        raise InputError("vessel.point", shown(vessel.point), f"such that the surface lies in the column, 0 to "
                         f"{column.size} m; it reaches from {ends} m", "move it, or widen the column")  # fmt: skip
    near = 1e-6 * float(size[2])
    if column.ends == "flow" and (low[2] > near or high[2] < size[2] - near):
        raise InputError("column.ends", "flow", f'"closed" with a vessel that does not reach from the floor, 0, to the '
                         f"lid, {size[2]:g} m", f"it reaches from {low[2]:.4g} to {high[2]:.4g} m")  # fmt: skip
    return closed_surface(
        through_ends(corners, float(size[2]), BEYOND * max(column.cell_edges)), "vessel.file", vessel.file
    )
