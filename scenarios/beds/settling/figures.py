"""Figure of the settling bead: its speed with and without the history force, and the measured fit.

`python -m scenarios.beds.settling.figures OUTPUT.png` runs both cases and draws them.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from cfddem.plotting.curves import BLUE, GREY, ORANGE, label, legend, panels, save
from scenarios.beds.settling.study import equation_of_motion, mordant, release
from scenarios.validation.table import numbers


def figure(path: Path) -> None:
    """Speed against time: runs, equation of motion, and the exponential fitted to the measured one."""
    measured = numbers("mordant2000_glass_0p5mm")
    terminal, lasting = float(measured["U_terminal"][0]), float(measured["tau95"][0])
    drawn, axes = panels(width=6.5, height=4.2)
    case = mordant()
    for history, colour, text in (
        (case.laws.history, BLUE, "with history force"),
        ("none", ORANGE, "without history force"),
    ):
        each = case.with_(**{"laws.history": history})
        times, speeds = release(each)
        axes.plot(1e3 * times, 1e3 * speeds, color=colour, label=text)
        axes.plot(1e3 * times, 1e3 * equation_of_motion(each, times), color="black", ls=":", lw=1.4)
    axes.plot([], [], color="black", ls=":", lw=1.4, label="equation of motion")
    exponential = 1e3 * terminal * (1.0 - np.exp(-3.0 * times / lasting))
    axes.plot(1e3 * times, exponential, color=GREY, ls="--", label="fit of Mordant and Pinton (2000)")
    where = (1e3 * lasting, 0.95e3 * terminal)
    axes.plot(*where, "o", color=GREY, ms=8)
    axes.annotate(f"95 % after {where[0]:.0f} ms", where, (70.0, 58.0), color="#444444")
    axes.set_xlim(0.0, 200.0)
    axes.set_ylim(0.0, 90.0)
    label(axes, "time", "ms", "speed of fall", "mm/s")
    legend(axes, loc="lower right")
    save(drawn, path)


if __name__ == "__main__":
    figure(Path(sys.argv[1] if len(sys.argv) > 1 else "settling.png"))
