"""Spray coating in hot air and in cold air: whether the bed dries as fast as it is wetted, or loses its fluidisation.

Both runs have the same beads, nozzle, spray and volume flow of air. Nothing is fitted.

`python -m scenarios.beds.spray_coating_hot.study FOLDER` runs the case with cold air; with one more word, the liquid at
the start over the volume of the beads, for 0.8 s. With HOT COLD OUTPUT.png it draws two runs.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfddem.analysis.drying import DryingRates, drying_rates
from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.io.reading import RunData, open_run
from cfddem.plotting.curves import BLUE, ORANGE, label, legend, panels, save
from cfddem.run.runner import Run

ROOM = 293.15
"""Temperature of the room, from which the air comes [K]."""

COLD: dict[str, object] = {
    **dict.fromkeys((f"heat.{name}_temperature" for name in ("inlet", "fluid", "particle", "spray")), ROOM),
    "fluid.density": 1.2,
    "fluid.viscosity": 1.81e-5,
}
"""Keys of the case with air that is not heated."""


@dataclass(frozen=True)
class Coated:
    """The bed at the end of a run, and its rates in the averaging window."""

    moisture: float  # liquid over the volume of the beads
    wet_share: float  # of the beads that carry liquid
    joined_share: float  # of the beads that a bridge joins to another
    evaporated_share: float  # of the water that landed
    lowest: float  # temperature of the coldest bead [K]
    highest: float  # [K]
    granular_temperature: float  # mean in the window; tells whether the bed moves [m2/s2]
    carried: float  # pressure drop over the weight of the beads, mean in the window
    rates: DryingRates


def case(cold: bool = False, moisture: float = 0.0) -> Case:
    """The case of the gallery, or the same with air that is not heated.

    moisture  liquid at the start over the volume of the beads; if it is above 0, the run is short
    """
    changes = dict(COLD) if cold else {}
    if moisture > 0.0:
        changes |= {"liquid.liquid_fraction": moisture, "run.until": 0.8, "run.average_from": 0.6}
    return Case.from_toml(gallery_files()["spray-coating-hot"], changes)


def coated(run: RunData) -> Coated:
    """What a run has done to its bed."""
    described, history, beads = Case.from_text(run.case_text), run.history, run.particles(-1)
    rates = drying_rates(run)
    inside = history["time"] >= rates.begin
    density = described.evaporation.liquid_density  # type: ignore[attr-defined]
    weight = described.solid_density * sum(described.volumes.values()) * 9.81 / described.column.floor_area
    return Coated(
        moisture=float(beads["liquid_carried"].sum()) / sum(described.volumes.values()),
        wet_share=float((beads["liquid_carried"] > 0.0).mean()),
        joined_share=float(history["agglomerated_share"][-1]),
        evaporated_share=float(history["evaporated_mass"][-1] / (density * history["liquid_sprayed"][-1])),
        lowest=float(beads["temperature"].min()),
        highest=float(beads["temperature"].max()),
        granular_temperature=float(history["granular_temperature"][inside].mean()),
        carried=float(history["pressure_drop"][inside].mean()) / weight,
        rates=rates,
    )


def moisture(run: RunData) -> np.ndarray:
    """Liquid on beads and in bridges over the volume of the beads, in time (n,)."""
    history, described = run.history, Case.from_text(run.case_text)
    return np.asarray((history["liquid_on_particles"] + history["liquid_in_bridges"]) / sum(described.volumes.values()))


# ---------------------------------------------------------------- figure of the coater


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
    if len(sys.argv) == 4:
        figure(*map(Path, sys.argv[1:]))
    else:
        Run.begin(case(True, *map(float, sys.argv[2:])), Path(sys.argv[1])).go()
