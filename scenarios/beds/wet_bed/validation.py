"""Mueller's bed with liquid bridges: what they do to height, pressure, bubbles, agitation and minimum fluidisation.

Four states that differ in the pull of their bridges only, each with three packings and one ramp. Runs are kept as
folders: interrupted ones are continued, finished ones are not repeated. Nothing is fitted and nothing was measured in
this bed when wet: the rows are predictions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cfddem.analysis.bubbles import find_bubbles
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.io.reading import Run as Written
from scenarios.beds.defluidisation.study import layers, onsets
from scenarios.beds.gas_bed.study import mueller
from scenarios.validation.kept_runs import finished
from scenarios.validation.table import Progress, Row

ANGLES: dict[str, float | None] = {"dry": None, "weak": 85.0, "medium": 75.0, "strong": 60.0}
"""Contact angle of the oil by state [degrees]; the pulls are 0.7, 2.2 and 4.2 times the weight of a particle."""

SEEDS = (1, 2, 3)
UNTIL, SETTLED = 10.1, 1.1
"""End of a run and start of its averages [s]."""

RAMP = [[0.0, 0.0066], [0.2, 0.66], [0.6, 0.66], [4.6, 0.05]]
"""Inlet velocity of a ramp: the bed is mixed, then slowly defluidised [s, m/s]."""

OIL = {"viscosity": 5e-3, "surface_tension": 0.02, "liquid_fraction": 1e-3}


class Means(NamedTuple):
    """Means of one run."""

    height: float  # [m]
    height_deviation: float  # in time [m]
    pressure_deviation: float  # in time [Pa]
    temperature: float  # granular temperature [m2/s2]
    bubble: float  # diameter of a bubble, mean by area [m]


def state(name: str) -> Case:
    """Mueller's bed in one of the states of `ANGLES`."""
    angle, case = ANGLES[name], mueller()
    title = f"Mueller's bed, {name}"
    if angle is None:
        return case.with_(title=title)
    rough = {f"material.{each}.roughness": 1e-6 for each in case.material}
    return case.with_(**rough, title=title, liquid=OIL | {"contact_angle": angle})


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run all states, and return the table."""
    found = {name: [_run(name, seed, folder, progress) for seed in SEEDS] for name in ANGLES}
    onset = {name: minimum_fluidisation(name, folder, progress) for name in ANGLES}
    return [
        *(row for name, runs in found.items() for row in rows(name, runs)),
        *(Row(f"{name}: minimum fluidisation on the way down", onset[name], unit="m/s") for name in ANGLES),
        *directions(found, onset),
    ]


def rows(name: str, runs: Sequence[Means]) -> list[Row]:
    """Means over the packings, with the standard error of their mean."""
    named = {"height": "m", "height_deviation": "m", "pressure_deviation": "Pa", "temperature": "m2/s2", "bubble": "m"}
    made = []
    for quantity, unit in named.items():
        mean, error = over_packings([getattr(each, quantity) for each in runs])
        made.append(Row(f"{name}: {quantity.replace('_', ' ')}", mean, unit=unit, note=f"standard error {error:.2g}"))
    return made


def directions(found: dict[str, list[Means]], onset: dict[str, float]) -> list[Row]:
    """Ratios to the dry bed, as logarithms: above 0 where they should rise, with their standard errors."""
    made = []
    for name in (each for each in ANGLES if each != "dry"):
        for quantity, sign in (("bubble", 1.0), ("pressure_deviation", 1.0), ("temperature", -1.0)):
            wet, dry = (over_packings([getattr(run, quantity) for run in found[each]]) for each in (name, "dry"))
            value = sign * math.log(wet[0] / dry[0])
            error = math.hypot(wet[1] / wet[0], dry[1] / dry[0])
            word = "larger" if sign > 0.0 else "smaller"
            made.append(
                Row(
                    f"{name}: {quantity.replace('_', ' ')} {word} than dry, logarithm of the ratio", value,
                    note=f"standard error {error:.2g}; experiments report above 0",
                )
            )  # fmt: skip
        made.append(Row(f"{name}: minimum fluidisation over that of the dry bed", onset[name] / onset["dry"]))
    return made


def over_packings(values: Sequence[float]) -> tuple[float, float]:
    """Mean, and its standard error.

    >>> over_packings([1.0, 2.0, 3.0])
    (2.0, 0.5773502691896258)
    """
    return float(np.mean(values)), float(np.std(values, ddof=1) / math.sqrt(len(values)))


def means(run: Written, begin: float) -> Means:
    """Means of a run from a time on [s]."""
    late = run.history["time"] >= begin
    history = {name: column[late] for name, column in run.history.items()}
    return Means(
        float(history["bed_height"].mean()),
        float(history["bed_height"].std()),
        float(history["pressure_drop"].std()),
        float(history["granular_temperature"].mean()),
        mean_bubble(run, begin),
    )


def mean_bubble(run: Written, begin: float) -> float:
    """Diameter of the bubbles in the snapshots from a time on, weighted by their areas [m]; NaN without any."""
    grid: Any = run.grid
    diameters: list[np.ndarray] = []
    for place in np.flatnonzero(run.times >= begin):
        surface = float(np.interp(run.times[place], run.history["time"], run.history["bed_height"]))
        voidage = run.fluid("voidage", int(place))
        diameters.append(find_bubbles(voidage, grid.spacing, surface=surface, flat=True)["diameter"])
    seen = np.concatenate([*diameters, np.zeros(0)])
    return float((seen**3).sum() / (seen**2).sum()) if len(seen) else math.nan


def minimum_fluidisation(name: str, folder: Path, progress: Progress) -> float:
    """Velocity at which the pressure drop of the packed bed equals the weight, on the way down [m/s]; NaN if never."""
    case = state(name)
    changes = {"bed.inlet_velocity": RAMP, "run.until": RAMP[-1][0], "run.every": 0.05}
    run = finished(case, folder, f"{name}_ramp", progress, changes)
    try:
        return onsets(case.with_(**{"bed.inlet_velocity": RAMP}), run.history, layers(run))[1].velocity
    except InputError:
        return math.nan


def _run(name: str, seed: int, folder: Path, progress: Progress) -> Means:
    """One state with one packing."""
    changes = {"run.until": UNTIL, "bed.seed": seed, "run.average_from": SETTLED}
    return means(finished(state(name), folder, f"{name}_{seed}", progress, changes), SETTLED)
