"""Figure of the heated bed: temperature over height at three times, and Schumann's solution.

`python -m scenarios.beds.packed_bed_heating.figures OUTPUT.png` takes a few seconds.
"""

from __future__ import annotations

import sys
from pathlib import Path

from cfddem.plotting.curves import BLUE, GREY, label, legend, panels, save
from scenarios.beds.packed_bed_heating.study import case, heating

TIMES = (0.2, 0.4, 0.6)


def figure(path: Path) -> None:
    """Temperatures of the beads against height, with the exact ones."""
    drawn, axes = panels(width=6.5, height=4.0)
    for number, each in enumerate(heating(case(), TIMES)):
        first = number == 0
        axes.plot(1e3 * each.height, each.exact_solids, color=GREY, label="exact, beads" if first else None)
        axes.plot(1e3 * each.height, each.exact_fluid, color=GREY, ls="--", label="exact, water" if first else None)
        axes.plot(1e3 * each.height, each.solids, "o", color=BLUE, ms=4, label="run, beads" if first else None)
        axes.plot(
            1e3 * each.height, each.fluid, "o", color=BLUE, mfc="none", ms=4, label="run, water" if first else None
        )
        print(f"t = {each.time} s: largest {each.error:.4f}, mean {each.mean_error:.4f}")
    label(axes, "height", "mm", "temperature, 0 at the start, 1 at the inlet", "-")
    legend(axes, loc="upper right")
    save(drawn, path)


if __name__ == "__main__":
    figure(Path(sys.argv[1] if len(sys.argv) > 1 else "packed_bed_heating.png"))
