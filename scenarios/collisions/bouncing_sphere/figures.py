"""Figure of the bouncing sphere: its height after contact with three sets of forces, and the measured height.

`python -m scenarios.collisions.bouncing_sphere.figures OUTPUT.png` computes the collisions and draws them.
"""

from __future__ import annotations

import sys
from pathlib import Path

from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, label, legend, panels, save
from scenarios.collisions.bouncing_sphere.study import ALL, bounce
from scenarios.validation.table import numbers

FORCES = (
    ((), "film alone", ORANGE, "--"),
    (("drag", "added_mass"), "with drag and added mass", GREEN, "-."),
    (ALL, "with all forces of the fluid", BLUE, "-"),
)
"""Forces of the fluid beyond the film, their names, colours and lines."""


def figure(path: Path) -> None:
    """Gap between sphere and wall against time."""
    drawn, axes = panels(width=6.5, height=4.2)
    for forces, text, colour, line in FORCES:
        time, gap = bounce(surroundings=forces)
        axes.plot(1e3 * time, 1e3 * gap, color=colour, ls=line, label=text)
    measured = numbers("gondret2002_st27_trajectory")
    axes.plot(
        1e3 * measured["t"], 1e3 * measured["gap"], "o", color=GREY, ms=5, label="measured, Gondret et al. (2002)"
    )
    axes.set_xlim(-4.0, 44.0)
    axes.set_ylim(0.0, 3.2)
    label(axes, "time after contact", "ms", "gap between sphere and wall", "mm")
    legend(axes, loc="upper right")
    save(drawn, path)


if __name__ == "__main__":
    figure(Path(sys.argv[1] if len(sys.argv) > 1 else "bouncing_sphere.png"))
