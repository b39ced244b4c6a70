"""Figure of spray coating in hot and in cold air: moisture, temperature, and the beads at the end.

`python -m scenarios.beds.spray_coating_hot.figures HOT COLD OUTPUT.png` draws two runs.
"""

from __future__ import annotations

import sys
from pathlib import Path

from cfddem.io.reading import open_run
from cfddem.plotting.curves import BLUE, ORANGE, label, legend, panels, save
from scenarios.beds.spray_coating_hot.study import coated, moisture


def figure(hot: Path, cold: Path, output: Path) -> None:
    """Moisture, motion and temperature of the beads of both runs in time."""
    drawn, axes = panels(3, width=11.0, height=3.6)
    for folder, colour, name in ((hot, ORANGE, "hot air"), (cold, BLUE, "cold air")):
        run = open_run(folder)
        time, history = run.history["time"], run.history
        axes[0].plot(time, 100.0 * moisture(run), color=colour, label=name)
        axes[1].semilogy(time, history["granular_temperature"], color=colour, lw=0.8)
        axes[2].plot(time, history["mean_temperature"] - 273.15, color=colour, label=f"beads, {name}")
        axes[2].plot(time, history["outlet_temperature"] - 273.15, color=colour, ls="--", lw=0.9)
        print(f"{name}: {coated(run)}")
    label(axes[0], "time", "s", "liquid over solid volume", "%")
    label(axes[1], "time", "s", "granular temperature", "m2/s2")
    label(axes[2], "time", "s", "temperature, dashed: outlet", "C")
    legend(axes[0], loc="upper left")
    save(drawn, output)


if __name__ == "__main__":
    figure(*(Path(each) for each in sys.argv[1:4]))
