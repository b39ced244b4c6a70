"""The vessel of a case, as it is written, and its wall in plain numbers.

A vessel is a round wall about an upright axis in the middle of the column, an upright box, or a closed surface from a
file. Particles meet it, and it cuts the cells of the fluid: both see the same line of heights and radii, or the same
triangles. For the fluid, an opening is a straight duct through the wall to a side of the column.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from itertools import combinations, pairwise
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from cfddem.backend.errors import InputError, shown
from cfddem.case.bed import NonNegative, Point, Positive
from cfddem.case.materials import Checked
from cfddem.case.patches import ENDS, PLANES, CasePatch, along, lengths_of, middle_of
from cfddem.case.walls import ORIGIN, CaseWall, SurfaceFile
from cfddem.fluid.surfaces import Joined, Plane, Surface, cylinder, together, turned
from cfddem.fluid.triangles import ClosedSurface, closed_surface, section_area, through_ends
from cfddem.model.triangles import Array
from cfddem.particles.walls.meshes import stamp

Line = tuple[tuple[float, float], ...]
"""Heights and radii from the floor up [m]."""

OWN_KEYS: Mapping[str, tuple[str, ...]] = {
    "cylinder": ("radius", "spin"),
    "cone": ("radius", "top_radius", "length", "spin"),
    "chain": ("line", "spin"),
    "box": ("size", "turn"),
    "surface": ("file", "scale", "point"),
}
"""Keys of each shape beside those of all vessels."""

NEEDED: Mapping[str, tuple[str, ...]] = {
    "cylinder": (),
    "cone": ("radius", "length"),
    "chain": ("line",),
    "box": ("size",),
    "surface": ("file",),
}

ROUND_OFF = 1e-9
"""Share of the width by which a vessel may reach out of the column [-]."""


class CaseVessel(Checked):
    """A vessel in the column, round, a box or a closed surface, whose smooth wall cuts the cells of a fluid."""

    shape: Literal["cylinder", "cone", "chain", "box", "surface"] = Field(
        description="a cylinder, a cone with a cylinder above it, or a chain of cones and cylinders, about an upright "
        "axis in the middle of the column; an upright box there; or a closed surface from a file"
    )
    radius: NonNegative | None = Field(
        None, description="radius of a cylinder, default half of column.width; of a cone at the floor [m]"
    )
    top_radius: Positive | None = Field(
        None, description="radius of a cone at its upper end, and above; default: half of column.width [m]"
    )
    length: Positive | None = Field(None, description="height of a cone; a cylinder goes on above it [m]")
    line: tuple[tuple[NonNegative, NonNegative], ...] = Field(
        (), description="[height, radius] points of a chain, from the floor up; a cylinder goes on above them [m]"
    )
    size: tuple[Positive, Positive] | None = Field(None, description="edges of a box, from floor to lid [m]")
    turn: float = Field(0.0, description="angle by which a box is turned about its upright axis [degree]")
    file: SurfaceFile | None = Field(
        None, description="STL, PLY or VTP file of a closed surface; its place is relative to the case file"
    )
    scale: Positive = Field(1.0, description="unit of length of the file [m]")
    point: Point = Field(ORIGIN, description="where the origin of the file lies [m]")
    spin: float = Field(0.0, description="the wall turns about its axis, and drags fluid and particles [rad/s]")

    @model_validator(mode="after")
    def _keys_suit_the_shape(self) -> CaseVessel:
        self._require_keys_of(self.shape, OWN_KEYS, NEEDED)
        if self.shape == "cylinder" and self.radius == 0.0:
            raise InputError("radius", self.radius, "above 0")
        if self.line:
            self._check_line()
        return self

    def _check_line(self) -> None:
        if len(self.line) < 2 or self.line[0][0] != 0.0:
            raise InputError("line", shown(self.line), "at least two points, the first at height 0, the floor")
        for (low, _), (high, _) in pairwise(self.line):
            if not high > low:
                remedy = "for a step, let the radius change over a short height"
                raise InputError(
                    "line", shown(self.line), f"of rising heights, but {high:g} m follows {low:g} m", remedy
                )
        if not all(radius > 0.0 for _, radius in self.line[1:]):
            raise InputError("line", shown(self.line), "of radii above 0 above the floor")

    def line_in(self, column: Any) -> Line:
        """Heights and radii of a round wall, from the floor to the lid [m]; empty if it is not round."""
        if not self.is_round:
            return ()
        half, height = 0.5 * column.width, column.height
        line: Line = self.line
        if self.shape == "cylinder":
            line = ((0.0, self.radius or half),)
        elif self.shape == "cone":
            line = ((0.0, self.radius or 0.0), (self.length or 0.0, self.top_radius or half))
        below = tuple(place for place in line if place[0] < height)
        return (*below, (height, float(np.interp(height, *np.array(line).T))))

    def refuse(self, column: Any) -> None:
        """Raise InputError where the vessel does not lie in the column, or the column has walls of its own."""
        if column.shape != "box":
            raise InputError("column.shape", column.shape, "left out where there is a vessel", "the vessel is the wall")
        if column.sides != "no_slip" or column.front:
            name = "front" if column.front else "sides"
            remedy = "fluid sticks to a vessel, which is inside the sides of the column"
            raise InputError(f"column.{name}", getattr(column, name), "left out where there is a vessel", remedy)
        if column.ends == "periodic" and not self.is_upright:
            raise InputError("column.ends", "periodic", '"flow" or "closed" in a vessel that is not upright')
        width, depth, _ = column.size
        if self.size:
            reach = np.abs(self.plan_in(column)).max(axis=0) - 0.5 * np.array((width, depth))
            if (reach > 0.5 * np.array((width, depth)) * (1.0 + ROUND_OFF)).any():
                limit = f"within the column, {width:g} m by {depth:g} m"
                raise InputError("vessel.size", shown(self.size), limit, "widen column.width and column.depth")
        if not self.is_round:
            return
        widest = max(radius for _, radius in self.line_in(column))
        if 2.0 * widest > min(width, depth) * (1.0 + ROUND_OFF):
            of_cone = "radius" if self.radius == widest else "top_radius"
            key = {"cylinder": "radius", "cone": of_cone, "chain": "line"}[self.shape]
            limit = f"within the column: at most {0.5 * min(width, depth):g} m"
            value, remedy = widest, "widen column.width and column.depth"
            if key == "top_radius" and self.top_radius not in (None, widest):  # it goes on to the lid, or ends there
                value, limit = self.top_radius, f"{limit} at the lid, where it is {widest:.4g} m"
            raise InputError(f"vessel.{key}", value, limit, remedy)

    @property
    def is_upright(self) -> bool:
        """Whether its cross-section is the same at every height."""
        return self.shape in ("cylinder", "box") or len({radius for _, radius in self.line}) == 1

    @property
    def is_round(self) -> bool:
        """Whether it is a line turned about its axis."""
        return self.shape in ("cylinder", "cone", "chain")

    def plan_in(self, column: Any) -> np.ndarray:
        """x and y of the four corners of a box, counter-clockwise from above (4, 2) [m]."""
        half, angle = 0.5 * np.array(self.size), math.radians(self.turn)
        corners = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        cosine, sine = math.cos(angle), math.sin(angle)
        return 0.5 * np.array(column.size[:2]) + corners @ np.array([[cosine, sine], [-sine, cosine]])

    def with_file(self, place: Callable[[str], str]) -> CaseVessel:
        """The vessel with another place of its file, from the one that it has now."""
        return self if self.file is None else self.model_copy(update={"file": place(self.file)})

    def walls_in(self, column: Any) -> tuple[CaseWall, ...]:
        """The pieces of the wall between floor and lid, for pictures and distances."""
        if self.shape == "surface":
            return (CaseWall(shape="surface", file=self.file, scale=self.scale, point=self.point, solid="outside"),)
        if self.shape == "box":
            plan, middle = self.plan_in(column), 0.5 * np.array(column.size[:2])
            sides = 0.5 * (plan + np.roll(plan, -1, axis=0))
            return tuple(
                CaseWall(shape="plane", point=(*at, 0.0), normal=(*(middle - at), 0.0)) for at in sides.tolist()
            )
        x, y = 0.5 * column.size[0], 0.5 * column.size[1]
        walls, height = [], column.height
        for (low, below), (high, above) in pairwise(self.line_in(column)):
            if low >= height:
                break
            end = min(high, height)
            above = below + (above - below) * (end - low) / (high - low)
            place = {"point": (x, y, low), "length": end - low, "radius": below}
            walls.append(CaseWall(shape="cylinder", **place) if above == below else CaseWall(
                shape="cone", top_radius=max(above, ROUND_OFF * column.width), **place
            ))  # fmt: skip
        return tuple(walls)


# ---------------------------------------------------------------- the wall in plain numbers


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


# ---------------------------------------------------------------- openings in the side of a vessel


OUTLINE = 48
"""Places on the outline of an opening at which it is looked at."""


def with_openings(vessel: Surface, column: Any, openings: tuple[CasePatch, ...]) -> Surface:
    """The wall of a vessel with the ducts of its openings."""
    return Joined((vessel, *(duct(opening, column) for opening in openings))) if openings else vessel


def duct(opening: CasePatch, column: Any) -> Surface:
    """The duct of an opening: from the middle of the column outwards, with the cross-section of the patch."""
    (axis, high), (first, second) = PLANES[opening.side], along(opening.side)
    place = [0.5 * length for length in column.size]
    if opening.centre:
        place[first], place[second] = opening.centre
    outward = np.eye(3)[axis] * (1.0 if high else -1.0)
    start = _plane(place, outward)
    if opening.diameter:
        return together(cylinder(place, 0.5 * opening.diameter, axis), start)
    sides = []
    for d, edge in zip((first, second), opening.size or (0.0, 0.0)):
        for sign in (1.0, -1.0):
            inward = sign * np.eye(3)[d]
            sides.append(_plane(np.array(place) - 0.5 * edge * inward, inward))
    return together(*sides, start)


def _plane(point: Any, normal: Any) -> Plane:
    return Plane(tuple(float(x) for x in point), tuple(float(n) for n in normal))  # type: ignore[arg-type]


def outline(opening: CasePatch, middle: tuple[float, float]) -> Array:
    """Places on the outline of a patch, in the order of its centre (N, 2) [m].

    middle  of its side [m]
    """
    turn = 2.0 * math.pi * np.arange(OUTLINE) / OUTLINE
    shape = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    if opening.size:  # a square around the circle, to its corners
        shape = shape / np.abs(shape).max(axis=1, keepdims=True)
    edges = np.array(opening.size or (opening.diameter, opening.diameter), float)
    return np.asarray(np.array(opening.centre or middle) + 0.5 * edges * shape)


def refuse_openings(case: Any) -> None:
    """Raise InputError for a patch of a side that is not there, or one that does not lie within it."""
    for name, patch in case.patch.items():
        if patch.side in ENDS:
            continue
        key, vessel, (axis, _) = f"patch.{name}", case.vessel, PLANES[patch.side]
        _refuse_side(case, key, patch)
        if patch.shape == "whole":
            continue
        at, lengths = outline(patch, middle_of(case, patch.side)), np.array(lengths_of(case, patch.side))
        beyond = (at < -ROUND_OFF * lengths) | (at > (1.0 + ROUND_OFF) * lengths)
        places = np.insert(at, axis, 0.5 * case.column.size[axis], axis=1)
        if beyond.any() or (vessel and (case.beyond_the_side(places) > ROUND_OFF * lengths.max()).any()):
            first, second = ("xyz"[d] for d in along(patch.side))
            (left, low), (right, top) = at.min(axis=0), at.max(axis=0)
            where = "wall of the vessel" if vessel else "side"
            raise InputError(
                f"{key}.centre", shown(patch.centre), f"such that the patch lies in the {where}, off its corners",
                f"it reaches from {first} = {left:.4g} to {right:.4g} m, {second} = {low:.4g} to {top:.4g} m; move it, "
                "or make it smaller",
            )  # fmt: skip
    openings = [(name, patch) for name, patch in case.patch.items() if patch in case.openings]
    for (first_name, one), (name, other) in combinations(openings, 2):
        common = overlap(one, other, middle_of(case, one.side)) if one.side == other.side else 0.0
        if common > ROUND_OFF * max(lengths_of(case, one.side)):
            raise InputError(
                f"patch.{name}.centre", shown(other.centre), f"such that it lies beside patch.{first_name}",
                f"they overlap by {common:.3g} m on {one.side}; move one of them, or make it smaller",
            )  # fmt: skip


def overlap(one: CasePatch, other: CasePatch, middle: tuple[float, float]) -> float:
    """How far two discs or boxes of one side reach into each other; negative where they are apart [m].

    middle  of the side [m]

    >>> disc = CasePatch(kind="outlet", shape="disc", diameter=0.03, centre=(0.04, 0.031))
    >>> round(overlap(disc, disc.model_copy(update={"centre": (0.04, 0.045)}), (0.0, 0.0)), 6)
    0.016
    """
    half = 0.5 * (np.array(one.size or (0.0, 0.0)) + np.array(other.size or (0.0, 0.0)))
    beyond = np.abs(np.subtract(one.centre or middle, other.centre or middle)) - half
    apart = math.hypot(*np.maximum(beyond, 0.0)) + min(float(max(beyond)), 0.0)
    return 0.5 * ((one.diameter or 0.0) + (other.diameter or 0.0)) - apart


def _refuse_side(case: Any, key: str, patch: CasePatch) -> None:
    """Raise InputError where the side of a patch has none."""
    vessel, axis = case.vessel, PLANES[patch.side][0]
    if case.column.shape == "cylinder":
        remedy = 'take [vessel] with shape = "cylinder"'
        raise InputError(f"{key}.side", patch.side, "floor or lid of a column with steps", remedy)
    if case.column.periodic[axis]:
        raise InputError(f"{key}.side", patch.side, "a side that is not periodic", 'set column.sides = "no_slip"')
    if not vessel:
        return
    if vessel.shape == "surface" or vessel.turn % 90.0:
        which = "a surface from a file" if vessel.shape == "surface" else "a box that is turned"
        raise InputError(f"{key}.side", patch.side, f"floor or lid of {which}", "other vessels open to a side")
    if vessel.spin:
        raise InputError("vessel.spin", vessel.spin, f"left out beside {key}", "an opening does not turn with the wall")
    if patch.kind == "wall":
        raise InputError(f"{key}.kind", "wall", "inlet or outlet in the wall of a vessel", "leave the patch out")
    if patch.shape not in ("box", "disc"):
        raise InputError(f"{key}.shape", patch.shape, "box or disc in the wall of a vessel")
