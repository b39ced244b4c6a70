"""Spray coating in hot air and in cold air: whether the bed dries as fast as it is wetted, or loses its fluidisation.

Both runs have the same beads, nozzle, spray and volume flow of air. Nothing is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cfddem.analysis.drying import DryingRates, drying_rates
from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.io.reading import RunData

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


def case(cold: bool = False) -> Case:
    """The case of the gallery, or the same with air that is not heated."""
    return Case.from_toml(gallery_files()["spray-coating-hot"], COLD if cold else {})


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
