"""The vessel of a case: the side of each wall on which particles are, and the open cross-section over the height."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.case.bed import Point
from cfddem.case.tables import CaseTables, Column
from cfddem.case.vessel_shape import Line, start_box_in, surface_in
from cfddem.case.walls import CaseWall
from cfddem.fluid.triangles import signed_volume
from cfddem.model.triangles import Array, inside_surface
from cfddem.particles.walls.meshes import stamp

Side = Literal["inside", "outside", "behind"]

VESSEL = 0.5
"""Share of the column from which a closed surface is taken for a vessel, whose particles are inside [-]."""

ACROSS, LEVELS = 48, 160
"""Places along x and y, and heights, at which the vessel is sampled; areas of round ones are within 2 %."""

SEVERAL = 3.0
"""Expected number of particles on the wrong side of a surface from which a suspended start is refused."""

SET_OUTSIDE = 'set wall.{}.solid = "outside" if it is their vessel, or set bed.start_corner and bed.start_size'
SET_START = "set bed.start_corner and bed.start_size"
"""Remedies for particles on the wrong side of a closed surface."""


# ---------------------------------------------------------------- where particles start


def start_box(case: CaseTables) -> tuple[Point, Point]:
    """Corner and size of the box in which particles start [m]: as given, or the column, or a box in a round one.

    In a vessel it fits into the widest part; walls keep particles out of what it has beyond narrower ones.
    """
    if case.bed.start_corner is not None and case.bed.start_size is not None:
        return case.bed.start_corner, case.bed.start_size
    width, depth, height = case.column.size
    if case.vessel and not case.vessel.is_round:
        return start_box_in(case.vessel, case.column, stamp(case.vessel))
    if not case.line:
        return (0.0, 0.0, 0.0), (width, depth, height)
    side = 2.0 * max(radius for _, radius in case.line) / math.sqrt(2.0)
    return (0.5 * (width - side), 0.5 * (depth - side), 0.0), (side, side, height)


def start_places(case: CaseTables) -> Array:
    """Places where particles start: as given, or a lattice in their box, half a diameter from its faces (N, 3) [m]."""
    if case.bed.positions:
        return np.array(case.bed.positions, float)
    corner, size = (np.array(corner_or_size) for corner_or_size in start_box(case))
    margin = np.minimum(0.5 * case.bed.largest_diameter, 0.45 * size)
    along = [np.linspace(low, high, 8) for low, high in zip(corner + margin, corner + size - margin)]
    return np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 3)


def belongs_inside(case: CaseTables, wall: CaseWall, corners: Array, places: Array) -> bool:
    """Whether particles belong inside a closed surface.

    They do if its outside is solid to the fluid; without solid cells if it encloses most of the column, or most of the
    particles.

    corners  of its triangles (T, 3, 3) [m]
    places   of the particles (N, 3) [m]
    """
    if case.closes_cells(wall):
        return wall.solid == "outside"
    if abs(signed_volume(corners)) > VESSEL * math.prod(case.column.size):
        return True
    inside = inside_surface(corners, places)
    return bool(2 * np.count_nonzero(inside) > len(inside))


def on_the_wrong_side(case: CaseTables, number: int, positions: Array) -> tuple[int, str, str] | None:
    """The first particle on the wrong side of a closed surface, what is wrong, and the remedy; None if there is none.

    number     of the wall
    positions  of the particles (N, 3) [m]
    """
    wall = case.wall[number]
    if not len(positions) or not wall.form.encloses:
        return None
    corners = wall.form.corners()
    wanted = belongs_inside(case, wall, corners, positions)
    wrong = np.flatnonzero(inside_surface(corners, positions) != wanted)
    if not len(wrong):
        return None
    place = ", ".join(f"{coordinate:.4g}" for coordinate in positions[wrong[0]])
    others = f", and so are {len(wrong) - 1} more" if len(wrong) > 1 else ""
    why = f"at ({place}) m it is {'outside' if wanted else 'inside'}{others}"
    return int(wrong[0]), why, _remedy(case, number, wanted)


def start_behind_a_surface(case: CaseTables, count: int) -> tuple[str, str, str] | None:
    """Key, reason and remedy where particles start on the wrong side of a closed surface; None if none does.

    It holds before particles have places. A poured bed fills the larger part of its box, so that most of the box
    decides; particles that are spread evenly go everywhere.

    count  of the particles
    """
    if case.bed.positions:
        return None
    places = start_places(case)
    for number, wall in enumerate(case.wall):
        if not wall.form.encloses:
            continue
        corners = wall.form.corners()
        wanted = belongs_inside(case, wall, corners, places)
        wrong = inside_surface(corners, places) != wanted
        for axis in range(3):  # places closer to the surface than a radius stay empty
            for step in (-0.5, 0.5):
                shift = step * case.bed.largest_diameter * np.eye(3)[axis]
                wrong &= inside_surface(corners, places + shift) != wanted
        share = float(wrong.mean())
        spread = case.bed.start == "suspended" and share * count >= SEVERAL
        if share <= 0.5 and not spread:
            continue
        side = "outside of" if wanted else "inside"
        key = f"wall.{number}.solid" if _solid_inside(case, number, wanted) else "bed.start_corner"
        reason = f"{100.0 * share:.0f} % of the places where particles start lie {side} the closed surface of "
        return key, f"{reason}wall.{number}.file, the wrong side", _remedy(case, number, wanted)
    return None


def _remedy(case: CaseTables, number: int, wanted: bool) -> str:
    """What puts particles on the right side of a closed surface."""
    return SET_OUTSIDE.format(number) if _solid_inside(case, number, wanted) else SET_START


def _solid_inside(case: CaseTables, number: int, wanted: bool) -> bool:
    """Whether particles are on the wrong side of a surface because its inside is solid to the fluid."""
    return case.closes_cells(case.wall[number]) and not wanted


# ---------------------------------------------------------------- the open cross-section


@dataclass(frozen=True)
class Vessel:
    """The part of a column that walls leave to the particles, by height.

    edges         heights of the levels (n + 1,) [m]
    areas         open cross-section of each level (n,) [m2]
    column        cross-section of the column, above the last level [m2]
    floor_places  x and y of evenly spread places in the lowest open level (2, m) [m]
    """

    edges: Array
    areas: Array
    column: float
    floor_places: Array

    @property
    def volumes(self) -> Array:
        """Volume below each edge (n + 1,) [m3]."""
        return np.concatenate([[0.0], np.cumsum(self.areas * np.diff(self.edges))])

    @property
    def floor(self) -> float:
        """Cross-section of the lowest level that is open [m2]."""
        return float(self.areas[np.flatnonzero(self.areas)[0]])

    def height_of(self, volume: float) -> float:
        """Height of the surface of a bed of some volume, above z = 0 [m]."""
        below = self.volumes
        beyond = max(volume - float(below[-1]), 0.0) / self.column
        return float(np.interp(volume, below, self.edges)) + beyond

    def below(self, height: float) -> float:
        """Volume below a height [m3]."""
        return float(np.interp(height, self.edges, self.volumes))

    def area_at(self, height: float) -> float:
        """Cross-section at a height [m2]."""
        level = np.searchsorted(self.edges, height, side="right") - 1
        return float(self.areas[min(max(int(level), 0), len(self.areas) - 1)])

    def layers(self, height: float) -> tuple[Array, Array]:
        """Thickness [m] and cross-section [m2] of the open levels below a height."""
        thickness = np.diff(np.minimum(self.edges, height))
        used = (thickness > 0.0) & (self.areas > 0.0)
        return thickness[used], self.areas[used]


def vessel_of(case: CaseTables) -> Vessel | None:
    """The vessel that walls at rest, or the vessel of a case, form in its column; None if the column is as wide
    everywhere, or a surface cannot be read.

    An open cone or tube without a fluid has no side: particles may be on both.
    """
    if case.vessel and not case.vessel.is_round:
        surface_in(case.vessel, case.column)  # refuses a surface that is no vessel
    try:
        closing: tuple[tuple[CaseWall, str], ...] = tuple(
            (wall, side) for wall in case.wall if (side := closed_side(case, wall)) is not None
        )
        if not closing and (not case.vessel or case.vessel.is_upright):
            return None
        if case.vessel and not case.vessel.is_round:
            closing += tuple((wall, wall.solid or "behind") for wall in case.vessel.walls_in(case.column))
        vessel = _vessel(case.column, case.line, closing, tuple(stamp(wall) for wall, _ in closing))
    except (InputError, OSError, ValueError):  # reported by the checks of walls
        return None
    return vessel if vessel.areas.any() else None


def closed_side(case: CaseTables, wall: CaseWall) -> Side | None:
    """The side of a wall that is closed to particles at the start; None if there is none."""
    if wall.leaves_its_place:
        return None
    if wall.form.encloses:
        return "outside" if belongs_inside(case, wall, wall.form.corners(), start_places(case)) else "inside"
    if wall.form.side.default == "behind":
        return "behind"
    return wall.solid if wall.form.is_open and wall.solid in ("inside", "outside") else None


@lru_cache(maxsize=8)
def _vessel(
    column: Column, line: Line, closing: Sequence[tuple[CaseWall, str]], _: tuple[tuple[int, int], ...]
) -> Vessel:
    """The vessel within a round wall, if there is one, and some walls with their closed sides; with these it is sampled
    on a lattice of places."""
    width, depth, height = column.size
    x, y = _across(column)
    edges = np.linspace(0.0, height, LEVELS + 1)
    z = 0.5 * (edges[1:] + edges[:-1])
    points = np.stack(np.meshgrid(z, y, x, indexing="ij")[::-1], axis=-1).reshape(-1, 3)
    is_open = np.ones(len(points), bool)
    radii = np.interp(z, *np.array(line).T) if line else np.zeros(0)
    if line:
        away = np.hypot(*(points[:, :2] - 0.5 * np.array((width, depth))).T)
        is_open &= away < np.interp(points[:, 2], *np.array(line).T)
    for wall, side in closing:
        is_open &= ~wall.form.closes(points, side)
    levels = is_open.reshape(LEVELS, -1)
    lowest = levels[np.argmax(levels.any(axis=1))]
    above = math.pi * line[-1][1] ** 2 if line else column.floor_area
    areas = math.pi * radii**2 if line and not closing else levels.mean(axis=1) * width * depth
    return Vessel(edges, areas, above, points[: len(lowest), :2][lowest].T)


def floor_places(case: CaseTables, within: bool = True) -> Array:
    """x and y of evenly spread places over the floor of a column (2, m) [m].

    within  its vessel, or its round wall, or else its whole box
    """
    places = np.stack(np.meshgrid(*_across(case.column))).reshape(2, -1)
    if not within:
        return places
    return places[:, case.beyond_the_side(np.stack([*places, np.zeros(places.shape[1])], axis=-1)) < 0.0]


def _across(column: Column) -> tuple[Array, Array]:
    """Places along x and along y at which a column is sampled [m]."""
    x, y = (((np.arange(ACROSS) + 0.5) / ACROSS) * length for length in column.size[:2])
    return x, y
