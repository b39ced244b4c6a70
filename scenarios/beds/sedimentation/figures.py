"""Figure of hindered settling: velocity against voidage, and the law of Richardson and Zaki.

`python -m scenarios.beds.sedimentation.figures OUTPUT.png` runs the five suspensions (100 s) and draws them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cfddem.plotting.curves import BLUE, GREY, label, legend, panels, save
from closures.bed import exponent_richardson_zaki
from scenarios.beds.sedimentation.study import SOLID_FRACTIONS, Settling, exponent, in_periodic_box, vessel


def figure(found: Sequence[Settling], path: Path) -> None:
    """Velocities of suspensions over that of one sphere, on logarithmic axes, and two power laws."""
    case = vessel()
    terminal = found[0].terminal
    power, alone = exponent(found)
    reynolds = case.required_fluid.density * terminal * case.bed.diameter / case.required_fluid.viscosity
    published = exponent_richardson_zaki(reynolds, 0.0)
    drawn, axes = panels(width=6.5, height=4.2)
    voidage = np.linspace(0.55, 1.0, 50)
    axes.plot(
        voidage, alone / terminal * voidage**power, color=BLUE, label=f"power law through the points, n = {power:.3f}"
    )
    axes.plot(voidage, voidage**published, color=GREY, ls="--", label=f"Richardson and Zaki, n = {published:.3f}")
    points = [(1.0 - each.solid_fraction, each.velocity / terminal) for each in found]
    axes.plot(*np.transpose(points), "o", color=BLUE, ms=7, label="runs in a periodic box")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks([0.6, 0.7, 0.8, 0.9, 1.0], ["0.6", "0.7", "0.8", "0.9", "1"])
    axes.set_yticks([0.2, 0.3, 0.5, 0.7, 1.0], ["0.2", "0.3", "0.5", "0.7", "1"])
    axes.minorticks_off()
    label(axes, "voidage", "-", "settling velocity over that of one sphere", "-")
    legend(axes, loc="upper left")
    save(drawn, path)


if __name__ == "__main__":
    suspensions = [in_periodic_box(each, distance=24.0) for each in SOLID_FRACTIONS]
    figure(suspensions, Path(sys.argv[1] if len(sys.argv) > 1 else "sedimentation.png"))
