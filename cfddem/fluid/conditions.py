"""Conditions on the sides of the box, and functions for the times and regions in which they hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.fluid.grid import Array, Region

SIDES = ("x_low", "x_high", "y_low", "y_high", "z_low", "z_high")


@dataclass(frozen=True, kw_only=True)
class Condition:
    """A condition on a side; `where(x, y, z)` selects its region, None is the whole side."""

    where: Region | None = None


@dataclass(frozen=True)
class NoSlip(Condition):
    """A no-slip wall. velocity: of the wall in its own plane (x, y, z) [m/s], for example of a lid."""

    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class FreeSlip(Condition):
    """A frictionless wall, or a plane of symmetry."""


@dataclass(frozen=True)
class Inlet(Condition):
    """Fluid enters at a given superficial velocity, volume per area and time [m/s].

    velocity  inward speed, or a vector (x, y, z), or a function f(x, y, z, t) of points (n,) and time that
              returns speeds (n,) or vectors (n, 3)
    in_time   factor as a function of time, such as `ramp(0, 1)`; None is 1
    """

    velocity: float | Sequence[float] | Callable[[Array, Array, Array, float], Any] = 0.0
    in_time: Callable[[float], float] | None = None


@dataclass(frozen=True)
class Outlet(Condition):
    """Fluid leaves against a given pressure p' [Pa]; fluid that flows back enters without momentum."""

    pressure: float = 0.0


@dataclass(frozen=True)
class Periodic(Condition):
    """A periodic side: fluid that leaves here enters at the opposite side.

    pressure_gradient  mean fall of the pressure along the axis, which drives the flow; the same on both sides [Pa/m]
    """

    pressure_gradient: float = 0.0


def ramp(begin: float, end: float) -> Callable[[float], float]:
    """Time factor that rises linearly from 0 at `begin` to 1 at `end` [s]."""
    return lambda t: min(max((t - begin) / (end - begin), 0.0), 1.0)


def discs(centres: Sequence[Sequence[float]], diameter: float, axis: int = 2) -> Region:
    """Round holes of a distributor normal to `axis`; centres: their two coordinates in the plane, in order [m]."""

    def region(*coordinates: Array) -> Any:
        first, second = (coordinates[d] for d in range(3) if d != axis)
        return sum(((first - a) ** 2 + (second - b) ** 2 <= 0.25 * diameter**2) for a, b in centres) > 0

    return region


def rectangle(low: Sequence[float], high: Sequence[float]) -> Region:
    """Points between two opposite corners (x, y, z) [m]; give them some depth across the side."""

    def region(*coordinates: Array) -> Any:
        return np.logical_and.reduce(
            np.broadcast_arrays(*((a <= x) & (x <= b) for x, a, b in zip(coordinates, low, high)))
        )

    return region
