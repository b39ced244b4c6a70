"""A bubbling gas bed dry and wet: what liquid bridges do to pressure, height and motion.

The beds differ in their liquid only. Nothing is fitted: the laws of the bridges and their constants are published, and
the amount of liquid, its viscosity and its surface tension are those of the case.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from cfddem.backend.compile import use_threads
from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.io.reading import RunData
from cfddem.run.simulation import Simulation

LIQUIDS: dict[str, dict[str, float] | None] = {
    "dry": None,
    "oil 0.01 %": {"liquid_fraction": 1e-4},
    "oil 0.1 %": {},
    "water 0.1 %": {"viscosity": 1e-3, "surface_tension": 0.0728},
}
"""States of the bed by name: None is dry, others change keys of the table [liquid]."""

MEASURED = (0.10, 0.20, 0.02)
"""Begin, end and pieces of the time over which `bench` measures; both beds have been lifted by then [s]."""


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
    case = gallery()["wet-bed"]
    changes = LIQUIDS[state]
    if changes is None:
        return case.with_(liquid=None, title=f"{case.title}, {state}")
    return case.with_(title=f"{case.title}, {state}", **{f"liquid.{name}": value for name, value in changes.items()})


def wide_bed(state: str = "oil 0.1 %") -> Case:
    """The same beads in a column 120 mm wide and 7.5 mm deep, periodic in depth, at 1.4 times minimum fluidisation."""
    changes = {"column.width": 0.120, "column.depth": 0.0075, "column.front": "periodic"}
    changes |= {"bed.inlet_velocity": [[0.0, 0.0], [0.1, 2.0]], "run.until": 0.6, "run.particle_step": 1.2e-5}
    return bed(state).with_(**changes)


def effects(run: RunData, begin: float) -> Effects:
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


def bench(threads: int = 1, measured: tuple[float, float, float] = MEASURED) -> dict[str, Any]:
    """Cost of the bed with oil over that of the same bed dry, in one process, in turn, by processor time.

    threads   of the run
    measured  begin, end and pieces of the measurement [s]
    returns   for both beds the processor time of a simulated second and its shares, contacts and bridges; the ratio
    """
    use_threads(threads)
    begin, end, piece = measured
    beds = {name: Simulation(bed(name).with_(**{"run.particle_step": 1.2e-5})) for name in ("dry", "oil 0.1 %")}
    for simulation in beds.values():
        simulation.until(begin)
    before = {name: dict(simulation.timers.seconds) for name, simulation in beds.items()}
    spent = dict.fromkeys(beds, 0.0)
    for time in np.arange(begin + piece, end + 0.5 * piece, piece):
        for name, simulation in beds.items():
            now = process_time()
            simulation.until(float(time))
            spent[name] += process_time() - now
    costs = {name: _cost(simulation, before[name], spent[name], end - begin) for name, simulation in beds.items()}
    dry, wet = (cost["processor [s/s]"] for cost in costs.values())
    return {"particles": bed().bed.count, "threads": threads, "beds": costs, "wet over dry": wet / dry}


def _cost(run: Simulation, before: dict[str, float], spent: float, time: float) -> dict[str, Any]:
    """What a bed has cost; `spent` processor time over a simulated time [s]."""
    solver = run.particle_solver
    parts = {name: seconds - before.get(name, 0.0) for name, seconds in run.timers.seconds.items()}
    return {
        "processor [s/s]": spent / time,
        "shares": {part: seconds / sum(parts.values()) for part, seconds in parts.items() if seconds > 0.0},
        "listed pairs": solver.edges.between_particles,
        "contacts": int((solver.gap < 0.0).sum()),
        "bridges": solver.bridge_count,
    }


def rows(result: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """A result of `bench` as lines of a table."""
    yield "wet bubbling bed", f"{result['particles']} spheres, {result['threads']} thread(s)"
    for name, cost in result["beds"].items():
        yield name, f"{cost['processor [s/s]']:.0f} s of processor per simulated second"
        yield "", ", ".join(f"{part} {share:.0%}" for part, share in cost["shares"].items())
        yield "", f"{cost['listed pairs']} listed pairs, {cost['contacts']} contacts, {cost['bridges']} bridges"
    yield "wet over dry", f"{result['wet over dry']:.2f}"
