"""A bubbling gas bed dry and wet: what liquid bridges do to pressure, height and motion.

The beds differ in their liquid only. Nothing is fitted: the laws of the bridges and their constants are published, and
the amount of liquid, its viscosity and its surface tension are those of the case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.io.reading import Run

LIQUIDS: dict[str, dict[str, float] | None] = {
    "dry": None,
    "oil 0.01 %": {"liquid_fraction": 1e-4},
    "oil 0.1 %": {},
    "water 0.1 %": {"viscosity": 1e-3, "surface_tension": 0.0728},
}
"""States of the bed by name: None is dry, others change keys of the table [liquid]."""


@dataclass(frozen=True)
class Effects:
    """Means of a bed over its averaging window."""

    height: float  # [m]
    height_deviation: float  # standard deviation in time [m]
    pressure_drop: float  # [Pa]
    pressure_deviation: float  # standard deviation in time [Pa]
    granular_temperature: float  # [m2/s2]
    bridges_per_particle: float  # 0 for a dry bed
    agglomerate_size: float  # of the agglomerate of a particle; 1 for a dry bed


def bed(state: str = "oil 0.1 %") -> Case:
    """The case of the gallery in one of the states of `LIQUIDS`."""
    case = Case.from_toml(gallery()["wet-bed"])
    changes = LIQUIDS[state]
    if changes is None:
        return case.with_(liquid=None, title=f"{case.title}, {state}")
    return case.with_(title=f"{case.title}, {state}", **{f"liquid.{name}": value for name, value in changes.items()})


def wide_bed(state: str = "oil 0.1 %") -> Case:
    """The same beads in a column 120 mm wide and 7.5 mm deep, periodic in depth, at 1.4 times minimum fluidisation."""
    changes = {"column.width": 0.120, "column.depth": 0.0075, "column.front": "periodic"}
    changes |= {"bed.inlet_velocity": [[0.0, 0.0], [0.1, 2.0]], "run.until": 0.6, "run.particle_step": 1.2e-5}
    return bed(state).with_(**changes)


def effects(run: Run, begin: float) -> Effects:
    """Means of a run from a time on [s]."""
    history = run.history
    late = history["time"] >= begin

    def mean(name: str, absent: float = 0.0) -> float:
        return float(np.nanmean(history[name][late])) if name in history else absent

    def deviation(name: str) -> float:
        return float(np.nanstd(history[name][late]))

    return Effects(
        height=mean("bed_height"),
        height_deviation=deviation("bed_height"),
        pressure_drop=mean("pressure_drop"),
        pressure_deviation=deviation("pressure_drop"),
        granular_temperature=mean("granular_temperature"),
        bridges_per_particle=mean("bridges_per_particle"),
        agglomerate_size=mean("agglomerate_size", 1.0),
    )
