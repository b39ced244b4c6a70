"""The vessel of a case, as it is written: a round wall about an upright axis in the middle of the column.

Particles meet it, and it cuts the cells of the fluid: both see the same line of heights and radii.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from cfddem.backend.errors import InputError, shown
from cfddem.case.bed import NonNegative, Positive
from cfddem.case.materials import Checked
from cfddem.case.walls import CaseWall

Line = tuple[tuple[float, float], ...]
"""Heights and radii from the floor up [m]."""

OWN_KEYS: Mapping[str, tuple[str, ...]] = {
    "cylinder": ("radius",),
    "cone": ("radius", "top_radius", "length"),
    "chain": ("line",),
}
"""Keys of each shape beside those of all vessels."""

NEEDED: Mapping[str, tuple[str, ...]] = {"cylinder": (), "cone": ("radius", "length"), "chain": ("line",)}

ROUND_OFF = 1e-9
"""Share of the width by which a vessel may reach out of the column [-]."""


class CaseVessel(Checked):
    """A round vessel about an upright axis in the middle of the column, whose smooth wall cuts the cells of a fluid."""

    shape: Literal["cylinder", "cone", "chain"] = Field(
        description="a cylinder, a cone with a cylinder above it, or a chain of cones and cylinders"
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
    spin: float = Field(0.0, description="the wall turns about its axis, and drags fluid and particles [rad/s]")

    @model_validator(mode="after")
    def _keys_suit_the_shape(self) -> CaseVessel:
        for name in sorted({name for names in OWN_KEYS.values() for name in names} - {*OWN_KEYS[self.shape]}):
            if getattr(self, name) != type(self).model_fields[name].default:
                owners = " or ".join(shape for shape, names in OWN_KEYS.items() if name in names)
                limit = f'left out for shape = "{self.shape}"'
                raise InputError(name, shown(getattr(self, name)), limit, f"it belongs to a {owners}")
        for name in NEEDED[self.shape]:
            if getattr(self, name) in (None, ()):
                raise InputError(name, None, f'given for shape = "{self.shape}"')
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
        """Heights and radii of the wall, from the floor to the lid [m]."""
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
            raise InputError("column.ends", "periodic", '"flow" or "closed" in a vessel that is no cylinder')
        width, depth, _ = column.size
        widest = max(radius for _, radius in self.line_in(column))
        if 2.0 * widest > min(width, depth) * (1.0 + ROUND_OFF):
            key = {"cylinder": "radius", "cone": "top_radius", "chain": "line"}[self.shape]
            limit = f"within the column: at most {0.5 * min(width, depth):g} m"
            raise InputError(f"vessel.{key}", widest, limit, "widen column.width and column.depth")

    @property
    def is_upright(self) -> bool:
        """Whether its radius is the same at every height."""
        return self.shape == "cylinder" or len({radius for _, radius in self.line}) == 1

    def walls_in(self, column: Any) -> tuple[CaseWall, ...]:
        """The pieces of the wall between floor and lid as cones and cylinders, for pictures and distances."""
        x, y = 0.5 * column.size[0], 0.5 * column.size[1]
        made, height = [], column.height
        for (low, below), (high, above) in pairwise(self.line_in(column)):
            if low >= height:
                break
            end = min(high, height)
            above = below + (above - below) * (end - low) / (high - low)
            place = {"point": (x, y, low), "length": end - low, "radius": below}
            made.append(CaseWall(shape="cylinder", **place) if above == below else CaseWall(
                shape="cone", top_radius=max(above, ROUND_OFF * column.width), **place
            ))  # fmt: skip
        return tuple(made)

    def floor_area(self, column: Any) -> float:
        """Cross-section at the floor [m2]."""
        return math.pi * self.line_in(column)[0][1] ** 2
