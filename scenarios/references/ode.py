"""Events of `scipy.integrate.solve_ivp`, and the tolerances shared by the collisions of a few spheres."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

METHOD = "DOP853"
"""Runge-Kutta method of Dormand and Prince of order 8, with an interpolant of order 7."""

RELATIVE, ABSOLUTE = 1e-11, 1e-13
"""Tolerances of the integration. With tighter ones, times of events change by less than 1e-8 of their value."""


def event(function: Callable[[float, Any], float], direction: int, *, terminal: bool = True) -> Any:
    """Make an event of `solve_ivp`.

    function   f(time, state); the event is where it passes zero
    direction  -1 where it falls, 1 where it rises
    terminal   whether the integration ends there
    """

    def crossing(time: float, state: Any) -> float:
        return float(function(time, state))

    crossing.direction, crossing.terminal = direction, terminal  # type: ignore[attr-defined]
    return crossing
