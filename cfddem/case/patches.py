"""Patches of floor, lid and sides, by name: inlets, outlets and closed parts for the fluid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import reduce
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from cfddem.backend.errors import InputError, shown
from cfddem.case.bed import NonNegative, Positive, at_times, check_times, speeds_of
from cfddem.case.holes import in_rows, refuse_holes, samples
from cfddem.case.materials import Checked

PLACES = 120
"""Places along x and y at which a patch is sampled."""

Array = NDArray[np.float64]
Place = tuple[float, float]
Count = Annotated[int, Field(ge=1, le=10000)]
Places = Annotated[tuple[Place, ...], Field(min_length=1)]

OWN_KEYS: Mapping[str, tuple[str, ...]] = {
    "whole": (),
    "disc": ("centre", "diameter"),
    "ring": ("centre", "diameter", "inner_diameter"),
    "box": ("centre", "size"),
    "holes": ("centre", "diameter", "holes", "pitch"),
}
"""Keys of each shape beside those of all patches."""

NEEDED: Mapping[str, tuple[str, ...]] = {
    "whole": (), "disc": ("diameter",), "ring": ("diameter", "inner_diameter"), "box": ("size",),
    "holes": ("diameter", "holes"),
}  # fmt: skip

OF_KINDS: Mapping[str, tuple[str, ...]] = {
    "velocity": ("inlet",), "mass_flow": ("inlet",), "profile": ("inlet",), "pressure": ("inlet", "outlet"),
}  # fmt: skip
"""Keys of some kinds of patch -> these kinds."""

PLANES: Mapping[str, tuple[int, bool]] = {
    "floor": (2, False), "lid": (2, True),
    "x_low": (0, False), "x_high": (0, True), "y_low": (1, False), "y_high": (1, True),
}  # fmt: skip
"""Sides of the column -> the axis that each is normal to, and whether it is at its high end."""

ENDS = ("floor", "lid")
"""Sides at the ends of a vessel; patches of others are openings in its wall."""


class CasePatch(Checked):
    """A part of floor, lid or a side where fluid enters, leaves, or meets a wall; particles meet a wall everywhere."""

    kind: Literal["inlet", "outlet", "wall"] = Field(description="fluid enters, leaves, or meets a wall")
    side: Literal["floor", "lid", "x_low", "x_high", "y_low", "y_high"] = Field(
        "floor",
        description="side of the column on which it is; through the wall of a vessel a straight duct leads to it",
    )
    shape: Literal["whole", "disc", "ring", "box", "holes"] = Field(
        "whole", description="the whole side, a part of it, or the holes of a distributor plate"
    )
    centre: Place | None = Field(
        None, description="middle of the patch: (x, y), or (y, z) or (x, z) on a side; default: that of the side [m]"
    )
    diameter: Positive | None = Field(None, description="diameter of a disc or a hole, or outer one of a ring [m]")
    inner_diameter: Positive | None = Field(None, description="inner diameter of a ring [m]")
    size: tuple[Positive, Positive] | None = Field(None, description="edges of a box, along the axes of centre [m]")
    holes: Count | Places | None = Field(
        None, description="number of holes, in rows at 60 degrees around centre, or the place (x, y) of each [-, m]"
    )
    pitch: Positive | None = Field(None, description="distance of neighbouring holes, for more than one by number [m]")
    velocity: NonNegative | tuple[tuple[float, NonNegative], ...] | None = Field(
        None, description="superficial velocity of an inlet, into the column: a number, or [time, velocity] pairs [m/s]"
    )
    mass_flow: NonNegative | tuple[tuple[float, NonNegative], ...] | None = Field(
        None, description="mass flow of an inlet in place of velocity, by fluid.density: a number, or pairs [kg/s]"
    )
    profile: Literal["uniform", "parabolic"] = Field(
        "uniform", description="over a disc: the same velocity, or twice the mean in the middle and 0 at the edge"
    )
    pressure: float | None = Field(
        None,
        allow_inf_nan=False,
        description="pressure p' at an outlet, default 0, or at an inlet in place of velocity [Pa]",
    )

    particles: Literal["stay", "leave"] = Field(
        "stay", description="whether particles meet a wall here, or leave where they touch it, all within the patch"
    )

    @model_validator(mode="after")
    def _keys_suit_kind_and_shape(self) -> CasePatch:
        self._require_keys_of(self.shape, OWN_KEYS, NEEDED)
        for name, kinds in OF_KINDS.items():
            if self.kind not in kinds and getattr(self, name) != type(self).model_fields[name].default:
                raise InputError(name, shown(getattr(self, name)), f'left out for kind = "{self.kind}"')
        driven = [name for name in ("velocity", "mass_flow", "pressure") if getattr(self, name) is not None]
        if self.kind == "inlet" and not driven:
            raise InputError("velocity", None, "given for an inlet", "or mass_flow, in kg/s, or pressure, in Pa")
        if len(driven) > 1:
            limit = f"left out where there is a {driven[0]}"
            raise InputError(driven[1], shown(getattr(self, driven[1])), limit, "give one of them")
        for name in ("velocity", "mass_flow"):
            if name in driven:
                check_times(name, getattr(self, name))
        if self.profile == "parabolic" and "pressure" in driven:
            raise InputError(
                "profile", self.profile, "left out where there is a pressure", "the pressure drives the flow"
            )
        if self.inner_diameter and self.inner_diameter >= (self.diameter or 0.0):
            raise InputError("inner_diameter", self.inner_diameter, f"below the diameter, {self.diameter:g} m")
        if self.profile == "parabolic" and self.shape != "disc":
            raise InputError("profile", self.profile, f'uniform for shape = "{self.shape}"', "a disc may be parabolic")
        if self.shape == "holes":
            refuse_holes(self)
        return self

    def by_velocity(self, density: float, area: float) -> CasePatch:
        """The same patch with the velocity of its mass flow; as it is where no part of it is open.

        density  of the fluid that enters [kg/m3]
        area     through which it enters, see `open_area_of` [m2]
        """
        through = density * area
        if self.mass_flow is None or through == 0.0:
            return self
        flow = self.mass_flow
        speed = tuple((t, value / through) for t, value in flow) if isinstance(flow, tuple) else flow / through
        return self.model_copy(update={"velocity": speed})

    @property
    def brings(self) -> bool:
        """Whether it is an inlet of a given flow; a pressure drives the others that are open."""
        return self.kind == "inlet" and self.pressure is None

    @property
    def highest(self) -> float:
        """Highest superficial velocity of an inlet over time, its mean over the patch [m/s]."""
        return max(speeds_of(self.velocity or 0.0))

    @property
    def fastest(self) -> float:
        """Highest superficial velocity of an inlet over time and place [m/s]."""
        return self.highest * (2.0 if self.profile == "parabolic" else 1.0)

    def speed(self, time: float) -> float:
        """Superficial velocity of an inlet at a time, its mean over the patch [m/s]."""
        return float(at_times(self.velocity or 0.0, time))

    def weight(self, x: Array, y: Array, middle: Place) -> Array:
        """Velocity at places on the side over its mean, 0 outside of the patch [-].

        x, y    of the places, or the coordinates on another side, in the order of `centre` [m]
        middle  of the side [m]
        """
        inside = self.holds(x, y, middle).astype(float)
        if self.profile != "parabolic":
            return inside
        away = np.hypot(x - (self.centre or middle)[0], y - (self.centre or middle)[1])
        return np.asarray(inside * 2.0 * (1.0 - (2.0 * away / (self.diameter or math.inf)) ** 2))

    def holds(self, x: Array, y: Array, middle: Place, radius: Array | float = 0.0) -> NDArray[np.bool_]:
        """Which discs at places on the side lie within the patch; arguments as of `weight`.

        radius  of the discs [m]
        """
        if self.shape == "whole":
            return np.ones(np.shape(x + y), bool)
        if self.shape == "box":
            across, beside = x - (self.centre or middle)[0], y - (self.centre or middle)[1]
            width, depth = self.size or (0.0, 0.0)
            inside = (np.abs(across) + radius <= 0.5 * width) & (np.abs(beside) + radius <= 0.5 * depth)
        else:
            away = reduce(np.minimum, (np.hypot(x - a, y - b) for a, b in self.places(middle)))
            inside = away + radius <= 0.5 * (self.diameter or 0.0)
            if self.inner_diameter:
                inside = inside & (away - radius >= 0.5 * self.inner_diameter)
        return np.asarray(inside)

    def places(self, middle: Place) -> Array:
        """Centres of its holes, or the one centre of another shape (N, 2) [m]; `middle` as of `weight`."""
        if isinstance(self.holes, tuple):
            return np.array(self.holes)
        return np.array(self.centre or middle) + in_rows(self.holes or 1, self.pitch or 0.0)

    @property
    def area(self) -> float:
        """Area of the patch; infinite for a whole side [m2]."""
        if self.size is not None:
            return math.prod(self.size)
        if not self.diameter:
            return math.inf
        number = len(self.places((0.0, 0.0)))
        return number * 0.25 * math.pi * (self.diameter**2 - (self.inner_diameter or 0.0) ** 2)


def along(side: str) -> tuple[int, int]:
    """The two axes along a side, in the order of `centre`."""
    first, second = (d for d in range(3) if d != PLANES[side][0])
    return first, second


def lengths_of(case: Any, side: str) -> Place:
    """Lengths of a side of the column, in the order of `centre` [m]."""
    first, second = along(side)
    return case.column.size[first], case.column.size[second]


def middle_of(case: Any, side: str) -> Place:
    """Middle of a side of the column, in the order of `centre` [m]."""
    first, second = lengths_of(case, side)
    return 0.5 * first, 0.5 * second


def on_the_side(case: Any, side: str, x: Array, y: Array) -> NDArray[np.bool_]:
    """Which places (N,) of the plane of a side lie within the column of a case and its vessel (N,); on a side that a
    vessel does not reach, within the ducts of its openings.

    x, y  coordinates in the order of `centre` [m]
    """
    (width, depth), (axis, high) = lengths_of(case, side), PLANES[side]
    inside = (x >= 0.0) & (x <= width) & (y >= 0.0) & (y <= depth)
    if side not in ENDS and case.vessel:
        ducts = (
            opening.weight(x, y, (0.5 * width, 0.5 * depth)) > 0.0 for opening in case.openings if opening.side == side
        )
        return np.asarray(inside & np.any([*ducts], axis=0))
    places = np.insert(np.stack([x, y], axis=-1), axis, case.column.size[axis] if high else 0.0, axis=-1)
    return np.asarray(inside & (case.beyond_the_side(places) <= 0.0))


def _sampled(case: Any, patch: CasePatch) -> tuple[Array, NDArray[np.bool_]]:
    """Weights of a patch at places on and around it, and which of these lie on its side of the vessel."""
    width, depth = lengths_of(case, patch.side)
    middle = patch.centre or (0.5 * width, 0.5 * depth)
    if patch.shape == "holes":
        x, y = samples(patch.places(middle), patch.diameter or 0.0)
        return np.ones(len(x)), on_the_side(case, patch.side, x, y)
    edges = patch.size or (2.0 * width, 2.0 * depth)
    reach = patch.diameter or float(max(edges))
    around = (np.arange(PLACES) + 0.5) / PLACES * reach - 0.5 * reach
    x, y = (coordinate.reshape(-1) for coordinate in np.meshgrid(middle[0] + around, middle[1] + around))
    return patch.weight(x, y, middle), on_the_side(case, patch.side, x, y)


def open_share_of(case: Any, patch: CasePatch) -> float:
    """Share of a patch that lies on its side of the vessel [-]; of a whole side that of the side."""
    weight, inside = _sampled(case, patch)
    return float(np.count_nonzero((weight > 0.0) & inside)) / max(int(np.count_nonzero(weight)), 1)


def open_area_of(case: Any, patch: CasePatch) -> float:
    """Flow through the part of a patch on its side of the vessel over the velocity of the patch: the area of this part,
    weighted by the profile [m2]."""
    if patch.shape == "whole":
        return float(case.area_of(patch.side))
    weight, inside = _sampled(case, patch)
    return patch.area * float((weight * inside).sum() / max(weight.sum(), 1e-300))


def refuse_no_inlets(case: Any, key: str, names: Mapping[str, float], instead: str) -> None:
    """Raise InputError for a name that is no inlet patch of a given flow.

    key      of the table with these names
    instead  the key of what enters by a pressure
    """
    inlets = [name for name, patch in case.patch.items() if patch.brings]
    for name, value in names.items():
        if name in case.patch and case.patch[name].pressure is not None:
            limit = "left out for a patch that is driven by a pressure"
            raise InputError(f"{key}.{name}", value, limit, f"take {instead}")
        if name not in inlets:
            limit = "one of the inlets " + ", ".join(inlets) if inlets else "left out without inlets by [patch.NAME]"
            raise InputError(f"{key}.{name}", None, limit)
