"""Figure of the drying bed: temperature of the seeds and rate of drying against time, beside the balance.

`python -m scenarios.beds.drying_bed.figures OUTPUT.png` runs the bed, which takes some minutes.
"""

from __future__ import annotations

import sys
from pathlib import Path

from cfddem.plotting.curves import BLUE, GREY, ORANGE, label, legend, panels, save
from scenarios.beds.drying_bed.study import Balance, Drying, case, drying


def figure(found: Drying, balance: Balance, path: Path) -> None:
    """Temperature, water and rate of a run, with what the balance says."""
    drawn, (left, right) = panels(2, width=9.0, height=3.8)
    left.plot(found.time, found.temperature - 273.15, color=BLUE, label="mean of the seeds")
    left.axhline(balance.temperature - 273.15, color=GREY, ls="--", label="balance")
    left.axvline(balance.end, color=GREY, lw=1.0, ls=":", label="end by the balance")
    label(left, "time", "s", "temperature", "°C")
    legend(left, loc="upper left")
    right.plot(found.time, 1e6 * found.rate, color=BLUE, label="from the seeds")
    right.plot(found.time, 1e6 * found.by_air, color=ORANGE, label="by the air that leaves")
    right.axhline(1e6 * balance.rate, color=GREY, ls="--", label="balance")
    right.axvline(balance.end, color=GREY, lw=1.0, ls=":")
    label(right, "time", "s", "rate of evaporation", "mg/s")
    legend(right, loc="lower left")
    save(drawn, path)


if __name__ == "__main__":
    figure(*drying(case()), Path(sys.argv[1] if len(sys.argv) > 1 else "drying_bed.png"))
