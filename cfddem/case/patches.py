"""Patches of floor, lid and sides, by name: inlets, outlets and closed parts for the fluid.

One inlet may enter through the holes of a distributor plate: discs in rows around a centre, or each at its place.
"""

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


# ---------------------------------------------------------------- holes of a distributor plate


SAMPLES, OF_A_CELL = 24, 12
"""Fewest places across a hole, and across a cell, at which a hole is sampled."""


def in_rows(number: int, pitch: float) -> Array:
    """Places of holes in rows at 60 degrees about the origin, those nearest to it (N, 2) [m].

    number  of holes; 1, 7, 19, 37, 61 ... are whole rings of six sides
    pitch   distance of neighbours [m]

    >>> in_rows(7, 0.01).round(4).tolist()[:3]
    [[0.0, 0.0], [0.01, 0.0], [0.005, 0.0087]]
    """
    reach = math.ceil(math.sqrt(number)) + 1
    i, j = (steps.ravel() for steps in np.meshgrid(*2 * [np.arange(-reach, reach + 1)]))
    x, y = i + 0.5 * j, 0.5 * math.sqrt(3.0) * j
    turn = np.round(np.arctan2(y, x) % (2.0 * math.pi), 6)
    nearest = np.lexsort((turn, i * i + i * j + j * j))[:number]
    return np.asarray(pitch * np.stack([x, y], axis=-1)[nearest])


def samples(places: Array, diameter: float, spacing: tuple[float, float] | None = None) -> tuple[Array, Array]:
    """x and y of places spread evenly over the holes (M,) [m].

    places    of their centres (N, 2) [m]
    diameter  of each [m]
    spacing   of the places along x and y; default: for SAMPLES across a hole [m]
    """
    lines = []
    for apart in spacing or 2 * (diameter / SAMPLES,):
        reach = math.ceil(0.5 * diameter / apart)
        lines.append((np.arange(-reach, reach) + 0.5) * apart)
    x, y = (offsets.ravel() for offsets in np.meshgrid(*lines))
    within = np.hypot(x, y) <= 0.5 * diameter
    return (places[:, :1] + x[within]).ravel(), (places[:, 1:] + y[within]).ravel()


def samples_by_cells(places: Array, diameter: float, cell: tuple[float, float]) -> tuple[Array, Array]:
    """The same, with equally many places in every cell that a hole covers, so that it gets the velocity of the hole.

    The holes move onto the lattice of places, by less than 1/24 of a cell and 1/48 of their diameter along x and y.

    cell  edges along x and y of cells that begin at the origin [m]

    >>> x, y = samples_by_cells(np.array([[0.05, 0.05]]), 0.1, (0.01, 0.01))
    >>> middle = np.histogram2d(x, y, 10, [(0.0, 0.1)] * 2)[0][3:7, 3:7]
    >>> float(middle.min()), float(middle.max())
    (144.0, 144.0)
    """
    even = [2 * math.ceil(0.5 * max(OF_A_CELL, SAMPLES * edge / diameter)) for edge in cell]
    spacing = cell[0] / even[0], cell[1] / even[1]
    return samples(np.round(places / spacing) * spacing, diameter, spacing)


def refuse_holes(patch: Any) -> None:
    """Raise InputError for holes that are not an inlet of a plate, or that overlap.

    patch  of shape = "holes"
    """
    if not patch.brings or patch.side not in ("floor", "lid"):
        key, value = ("side", patch.side) if patch.brings else ("shape", "holes")
        limit = "floor or lid" if patch.brings else "that of an inlet by velocity or mass_flow"
        raise InputError(key, value, limit, 'holes are for a distributor plate; take shape = "disc" here')
    if isinstance(patch.holes, int):
        if patch.holes > 1 and patch.pitch is None:
            raise InputError("pitch", None, "given for a number of holes", "or list the places [x, y] of holes, in m")
        closest, key = patch.pitch if patch.holes > 1 else math.inf, "pitch"
    else:
        for name in ("pitch", "centre"):
            if getattr(patch, name) is not None:
                raise InputError(name, shown(getattr(patch, name)), "left out where holes are listed by place")
        places, key = np.array(patch.holes, float), "holes"
        rows = [np.hypot(*(places[n + 1 :] - place).T) for n, place in enumerate(places[:-1])]
        closest = float(np.concatenate(rows).min()) if rows else math.inf
    if closest < patch.diameter * (1.0 - 1e-9):
        raise InputError(
            key, shown(closest) if key == "pitch" else None, f"such that holes lie beside each other, "
            f"at least {patch.diameter:g} m apart", f"the nearest two are {closest:.3g} m apart; move them, or make "
            "diameter smaller",
        )  # fmt: skip
