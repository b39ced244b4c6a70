r"""Rates of drying in a window of a run, and what follows from them for the minutes after it.

A run has seconds, a dryer takes minutes. In a window in which the bed has become steady, the rate of evaporation E and
the water W on particles and in bridges are known. From then on one of two laws holds:

.. math:: \dot W = S - E \quad\text{(the air or the heat limits)}, \qquad
          \dot W = S - k\,W,\quad k = E/W \quad\text{(the wet surface limits)}

with the spray S. A real bed lies between them. In a steady coater both give the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfddem.analysis.report import window_of
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.io.reading import RunData, open_run

NEEDED = ("evaporated_mass", "liquid_on_particles", "liquid_in_bridges")
"""Columns of the history that it needs."""


@dataclass(frozen=True)
class DryingRates:
    """Means over a window; the water is that of particles and bridges."""

    begin: float  # of the window [s]
    end: float  # [s]
    water: float  # mean in the window [kg]
    last: float  # at the end of the window [kg]
    evaporated: float  # E [kg/s]
    sprayed: float  # S, what landed [kg/s]
    by_air: float  # vapour that leaves with the air, less what came with it; NaN without [vapour] [kg/s]
    temperature: float  # of the particles [K]
    warming: float  # rate of its change [K/s]
    drift: float  # of E from the first half of the window to the second, over its mean [-]

    @property
    def rate_constant(self) -> float:
        """k = E/W [1/s]."""
        return self.evaporated / self.water if self.water > 0.0 else math.nan

    @property
    def steady_water(self) -> float:
        """Water at which as much evaporates as is sprayed, where the wet surface limits [kg]."""
        return self.sprayed / self.rate_constant

    def water_after(self, time: float) -> tuple[float, float]:
        """Water after a time from the end of the window [s]: where the surface limits, and where the air does [kg].

        Evaporation rises with the water, at most in proportion. In a bed that grows wetter the first value is therefore
        a lower bound and the second, a straight line without an end, an upper one; in a bed that dries it is the other
        way round.
        """
        by_surface = self.steady_water + (self.last - self.steady_water) * math.exp(-self.rate_constant * time)
        return by_surface, max(0.0, self.last + (self.sprayed - self.evaporated) * time)

    def drying_times(self, share: float) -> tuple[float, float]:
        """Times from the end of the window, without spray, until this share of its water is left [s].

        returns  the shorter one, at the rate of the window; the longer one, where the surface limits
        """
        if not 0.0 < share < 1.0:
            raise InputError("share", share, "between 0 and 1")
        return (1.0 - share) * self.last / self.evaporated, -math.log(share) / self.rate_constant

    def __str__(self) -> str:
        return (
            f"from {self.begin:.3g} to {self.end:.3g} s: {self.water:.3g} kg of water, {self.evaporated:.3g} kg/s "
            f"evaporate (drift {100.0 * self.drift:+.1f} %), {self.sprayed:.3g} kg/s are sprayed; "
            f"k = {self.rate_constant:.3g} 1/s; particles at {self.temperature:.1f} K, {self.warming:+.2g} K/s"
        )


def drying_rates(run: RunData | str | Path, begin: float | None = None, end: float | None = None) -> DryingRates:
    """Rates in a window of a run with `[evaporation]` and a liquid.

    begin, end  of the window; default: that of the report [s]
    """
    run = open_run(run) if isinstance(run, str | Path) else run
    case, history = Case.from_text(run.case_text), run.history
    for name in NEEDED:
        if name not in history:
            raise InputError("run", name, "a column of the history", "the case needs [liquid] and [evaporation]")
    first, last = window_of(run, case)
    first, last = first if begin is None else begin, last if end is None else end
    inside = (history["time"] >= first) & (history["time"] <= last)
    if inside.sum() < 4:  # local: rows of a file
        raise InputError("begin", first, f"a window with at least 4 rows of the history up to {last:g} s")
    time, density = history["time"][inside], case.evaporation.liquid_density  # type: ignore[attr-defined]
    middle = len(time) // 2

    def column(name: str) -> np.ndarray:
        return np.asarray(history[name][inside]) if name in history else np.full(len(time), math.nan)

    def rate(values: np.ndarray, start: int = 0, stop: int = -1) -> float:
        return float((values[stop] - values[start]) / (time[stop] - time[start]))

    evaporated, water = (
        column("evaporated_mass"),
        density * (column("liquid_on_particles") + column("liquid_in_bridges")),
    )
    whole, temperature = rate(evaporated), column("mean_temperature")
    change = rate(evaporated, middle) - rate(evaporated, 0, middle)
    return DryingRates(
        begin=float(time[0]),
        end=float(time[-1]),
        water=float(np.trapezoid(water, time) / (time[-1] - time[0])),
        last=float(water[-1]),
        evaporated=whole,
        sprayed=density * rate(column("liquid_sprayed")) if "liquid_sprayed" in history else 0.0,
        by_air=rate(column("vapour_out") - column("vapour_in")),
        temperature=float(temperature.mean()),
        warming=rate(temperature),
        drift=change / whole if whole else math.nan,
    )
