"""Discharge of a hopper against and with air through its orifice, beside Beverloo's law and its correction for air.

>>> from cfddem.case.gallery import gallery
>>> round(beverloo(gallery()["hopper-with-air"]), 3)
0.174
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfddem.analysis.report import case_of
from cfddem.case.schema import Case
from cfddem.io.reading import RunData, open_run
from cfddem.plotting.curves import BLUE, GREY, ORANGE, RED, label, legend, panels, save
from closures.discharge import air_factor
from scenarios.beds.hopper.study import bulk_of, of_cone
from scenarios.beds.vessel_slice import draw_spheres, draw_vessel

BLOCKS = 6
"""Equal parts of the averaging window, whose rates give the error of their mean."""

COLOURS = (BLUE, ORANGE, RED)
"""Of runs, in the order in which they are drawn."""


@dataclass(frozen=True)
class Discharge:
    """Mass flow out of the hopper, and what drives it beside gravity."""

    pressure: float  # of the air below the orifice [Pa]
    rate: float  # over the averaging window [kg/s]
    error: float  # standard error of this mean, by its blocks [kg/s]
    air: float  # superficial velocity of the air through the orifice, upward [m/s]
    gradient: float  # of the pressure in the orifice, positive where it pushes the beads down [Pa/m]
    factor: float  # that this gradient makes by the law, over the discharge without it [-]

    def over(self, other: Discharge) -> tuple[float, float]:
        """Rate over that of another run, and the error of this ratio [-]."""
        ratio = self.rate / other.rate
        return ratio, ratio * math.hypot(self.error / self.rate, other.error / other.rate)

    def line(self) -> str:
        """The numbers in words."""
        return (
            f"{self.pressure:g} Pa: {self.rate:.4f} +- {self.error:.4f} kg/s; air {self.air:.2f} m/s, "
            f"{self.gradient:.0f} Pa/m, by the law a factor of {self.factor:.2f}"
        )


def beverloo(case: Case) -> float:
    """Discharge of the cone, the second piece of the vessel, without air: by Beverloo with a correction for its angle
    [kg/s]."""
    (low, orifice), (high, width) = case.line[1:3]
    return of_cone(case, orifice, (width - orifice) / (high - low))


def discharge(run: RunData, case: Case) -> Discharge:
    """Discharge of a run, from the mass that has left through its floor."""
    begin, end = case.run.average_from or 0.5 * case.run.until, case.run.until
    edges = np.linspace(begin, end, BLOCKS + 1)
    rates = np.diff(np.interp(edges, run.history["time"], run.history["removed_mass"])) / np.diff(edges)
    rate, error = float(rates.mean()), float(rates.std(ddof=1)) / math.sqrt(BLOCKS)
    late = [n for n, time in enumerate(run.times) if time >= begin]
    gradient = float(np.mean([_at_orifice(run, case, n)[0] for n in late]))
    air = float(np.mean([_at_orifice(run, case, n)[1] for n in late]))
    factor = air_factor(gradient / (bulk_of(case) * math.hypot(*case.laws.gravity)))
    return Discharge(case.patch["orifice"].pressure or 0.0, rate, error, air, gradient, factor)


def _at_orifice(run: RunData, case: Case, n: int) -> tuple[float, float]:
    """Pressure gradient [Pa/m] and superficial velocity [m/s] in the orifice, its four middle cells, in a snapshot.

    The orifice is the lower end of the cone, a face between two cells.
    """
    assert run.grid is not None
    nx, ny, _ = run.grid.cells
    above = round(case.line[1][0] / run.grid.spacing[2])
    middle = np.s_[above - 1 : above + 1, ny // 2 - 1 : ny // 2 + 1, nx // 2 - 1 : nx // 2 + 1]
    low, high = run.fluid("pressure", n)[middle].mean(axis=(1, 2))
    flow = run.fluid("voidage", n)[middle] * run.fluid("velocity", n)[middle][..., 2]
    return float(high - low) / run.grid.spacing[2], float(flow.mean())


# ---------------------------------------------------------------- figure of the hopper


def figure(runs: Sequence[RunData], path: Path) -> None:
    """Beads near the middle plane of some runs at the end, and the mass that has left against time."""
    drawn, axes = panels(len(runs) + 1, width=11.0, height=4.0, width_ratios=[*[1.0] * len(runs), 1.7])
    curve = axes[-1]
    for run, axis, colour in zip(runs, axes, COLOURS):
        case = case_of(run)
        flow = discharge(run, case)
        draw_spheres(axis, run, case, case.run.until, reach=0.75, size=14.0, most=0.6)
        draw_vessel(axis, case, 0.09)
        axis.set_title(f"{flow.pressure:g} Pa", fontsize=9.5, color=colour)
        words = f"{flow.pressure:g} Pa: {flow.rate:.3g} kg/s"
        curve.plot(run.history["time"], 1e3 * run.history["removed_mass"], color=colour, label=words)
    law, ends = beverloo(case_of(runs[0])), np.array([0.0, case_of(runs[0]).run.until])
    curve.plot(ends, 1e3 * law * ends, color=GREY, ls="--", label=f"Beverloo: {law:.3g} kg/s")
    label(curve, "time", "s", "mass that has left", "g")
    legend(curve)
    save(drawn, path)


if __name__ == "__main__":
    hoppers = [open_run(folder) for folder in sys.argv[2:]]
    flows = [discharge(hopper, case_of(hopper)) for hopper in hoppers]
    for flow in flows:
        print(flow.line())
    for still in (flow for flow in flows if flow.pressure == 0.0):
        for driven in (flow for flow in flows if flow is not still):
            print("{:g} Pa over 0 Pa: {:.3f} +- {:.3f}".format(driven.pressure, *driven.over(still)))
    print(f"without air, by Beverloo: {beverloo(case_of(hoppers[0])):.4g} kg/s")
    figure(hoppers, Path(sys.argv[1]))
