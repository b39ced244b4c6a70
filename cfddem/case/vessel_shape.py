"""The vessel of a case, as it is written: a round wall about an upright axis in the middle of the column, an upright
box, or a closed surface from a file.

Particles meet it, and it cuts the cells of the fluid: both see the same line of heights and radii, or the same
triangles (`cfddem.case.vessel_surface`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from cfddem.backend.errors import InputError, shown
from cfddem.case.bed import NonNegative, Point, Positive
from cfddem.case.materials import Checked
from cfddem.case.walls import ORIGIN, CaseWall, SurfaceFile

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
            key = {"cylinder": "radius", "cone": "top_radius", "chain": "line"}[self.shape]
            limit = f"within the column: at most {0.5 * min(width, depth):g} m"
            raise InputError(f"vessel.{key}", widest, limit, "widen column.width and column.depth")

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
