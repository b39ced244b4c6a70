"""Patches of floor and lid, by name: inlets, outlets and closed parts for the fluid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from cfddem.backend.errors import InputError, shown
from cfddem.case.bed import NonNegative, Positive, check_times, speeds_of
from cfddem.case.materials import Checked

PLACES = 120
"""Places along x and y at which a patch is sampled."""

Array = NDArray[np.float64]
Place = tuple[float, float]

OWN_KEYS: Mapping[str, tuple[str, ...]] = {
    "whole": (),
    "disc": ("centre", "diameter"),
    "ring": ("centre", "diameter", "inner_diameter"),
    "box": ("centre", "size"),
}
"""Keys of each shape beside those of all patches."""

NEEDED: Mapping[str, tuple[str, ...]] = {
    "whole": (), "disc": ("diameter",), "ring": ("diameter", "inner_diameter"), "box": ("size",),
}  # fmt: skip

OF_INLETS: Mapping[str, str] = {
    "velocity": "inlet", "mass_flow": "inlet", "profile": "inlet", "pressure": "outlet",
}  # fmt: skip
"""Keys of one kind of patch -> the kind."""


class CasePatch(Checked):
    """A part of floor or lid where fluid enters, leaves, or meets a wall; particles meet floor and lid everywhere."""

    kind: Literal["inlet", "outlet", "wall"] = Field(description="fluid enters, leaves, or meets a wall")
    side: Literal["floor", "lid"] = Field("floor", description="side of the column on which it is")
    shape: Literal["whole", "disc", "ring", "box"] = Field("whole", description="the whole side, or a part of it")
    centre: Place | None = Field(None, description="middle of the patch (x, y); default: that of the side [m]")
    diameter: Positive | None = Field(None, description="diameter of a disc, or outer one of a ring [m]")
    inner_diameter: Positive | None = Field(None, description="inner diameter of a ring [m]")
    size: tuple[Positive, Positive] | None = Field(None, description="edges of a box along x and y [m]")
    velocity: NonNegative | tuple[tuple[float, NonNegative], ...] | None = Field(
        None, description="superficial velocity of an inlet, into the column: a number, or [time, velocity] pairs [m/s]"
    )
    mass_flow: NonNegative | tuple[tuple[float, NonNegative], ...] | None = Field(
        None, description="mass flow of an inlet in place of velocity, by fluid.density: a number, or pairs [kg/s]"
    )
    profile: Literal["uniform", "parabolic"] = Field(
        "uniform", description="over a disc: the same velocity, or twice the mean in the middle and 0 at the edge"
    )
    pressure: float = Field(0.0, description="pressure p' at an outlet [Pa]")

    @model_validator(mode="after")
    def _keys_suit_kind_and_shape(self) -> CasePatch:
        for name in sorted({name for names in OWN_KEYS.values() for name in names} - {*OWN_KEYS[self.shape]}):
            if getattr(self, name) is not None:
                raise InputError(name, shown(getattr(self, name)), f'left out for shape = "{self.shape}"')
        for name in NEEDED[self.shape]:
            if getattr(self, name) is None:
                raise InputError(name, None, f'given for shape = "{self.shape}"')
        for name, kind in OF_INLETS.items():
            if kind != self.kind and getattr(self, name) != type(self).model_fields[name].default:
                raise InputError(name, shown(getattr(self, name)), f'left out for kind = "{self.kind}"')
        given = [name for name in ("velocity", "mass_flow") if getattr(self, name) is not None]
        if self.kind == "inlet" and not given:
            raise InputError("velocity", None, "given for an inlet", "or mass_flow, in kg/s")
        if len(given) > 1:
            raise InputError(
                "mass_flow", shown(self.mass_flow), "left out where there is a velocity", "give one of them"
            )
        for name in given:
            check_times(name, getattr(self, name))
        if self.inner_diameter and self.inner_diameter >= (self.diameter or 0.0):
            raise InputError("inner_diameter", self.inner_diameter, f"below the diameter, {self.diameter:g} m")
        if self.profile == "parabolic" and self.shape != "disc":
            raise InputError("profile", self.profile, f'uniform for shape = "{self.shape}"', "a disc may be parabolic")
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
        speed = tuple((t, each / through) for t, each in flow) if isinstance(flow, tuple) else flow / through
        return self.model_copy(update={"velocity": speed})

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
        if isinstance(self.velocity, tuple):
            return float(np.interp(time, *np.array(self.velocity).T))
        return self.velocity or 0.0

    def weight(self, x: Array, y: Array, middle: Place) -> Array:
        """Velocity at places on the side over its mean, 0 outside of the patch [-].

        middle  of the side [m]
        """
        across, along = x - (self.centre or middle)[0], y - (self.centre or middle)[1]
        if self.shape == "whole":
            return np.ones(np.shape(across + along))
        if self.shape == "box":
            width, depth = self.size or (0.0, 0.0)
            return ((np.abs(across) <= 0.5 * width) & (np.abs(along) <= 0.5 * depth)).astype(float)
        away, outer = np.hypot(across, along), 0.5 * (self.diameter or 0.0)
        inside = (away <= outer) & (away >= 0.5 * (self.inner_diameter or 0.0))
        return np.where(inside, 2.0 * (1.0 - (away / outer) ** 2) if self.profile == "parabolic" else 1.0, 0.0)

    @property
    def area(self) -> float:
        """Area of the patch; infinite for a whole side [m2]."""
        if self.size is not None:
            return math.prod(self.size)
        return 0.25 * math.pi * (self.diameter**2 - (self.inner_diameter or 0.0) ** 2) if self.diameter else math.inf


def on_the_side(case: Any, side: str, x: Array, y: Array) -> NDArray[np.bool_]:
    """Which places (N,) of the plane of floor or lid lie within the column of a case and its vessel (N,)."""
    width, depth, height = case.column.size
    z = np.full(x.size, 0.0 if side == "floor" else height)
    inside = (x >= 0.0) & (x <= width) & (y >= 0.0) & (y <= depth)
    return np.asarray(inside & (case.beyond_the_side(np.stack([x, y, z], axis=-1)) <= 0.0))


def _sampled(case: Any, patch: CasePatch) -> tuple[Array, NDArray[np.bool_]]:
    """Weights of a patch at places on and around it, and which of these lie on its side of the vessel."""
    width, depth, _ = case.column.size
    middle = patch.centre or (0.5 * width, 0.5 * depth)
    edges = patch.size or (2.0 * width, 2.0 * depth)
    reach = patch.diameter or float(max(edges))
    along = (np.arange(PLACES) + 0.5) / PLACES * reach - 0.5 * reach
    x, y = (each.reshape(-1) for each in np.meshgrid(middle[0] + along, middle[1] + along))
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


def refuse_no_inlets(case: Any, key: str, names: Mapping[str, float]) -> None:
    """Raise InputError for a name that is no inlet patch of a case.

    key  of the table with these names
    """
    inlets = [name for name, each in case.patch.items() if each.kind == "inlet"]
    for name in names:
        if name not in inlets:
            limit = "one of the inlets " + ", ".join(inlets) if inlets else "left out without inlets by [patch.NAME]"
            raise InputError(f"{key}.{name}", None, limit)
