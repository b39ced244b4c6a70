"""Mueller's bed with liquid bridges: what they do to height, pressure, bubbles, agitation and minimum fluidisation.

Four states that differ in the pull of their bridges only, each with three packings and one ramp; a fifth ramp has ten
times the oil. Runs are kept as folders: interrupted ones are continued, finished ones are not repeated. The runs
advance in rounds, so that a table can be made at any time. Nothing is fitted and nothing was measured in this bed when
wet: the rows are predictions.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from cfddem.analysis.bed_laws import buoyant_weight
from cfddem.analysis.bubbles import find_bubbles
from cfddem.analysis.run_warnings import defluidisation_of
from cfddem.analysis.series import block_average
from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.io.reading import RunData, open_run
from cfddem.plotting.curves import BLUE, GREEN, ORANGE, label, legend, line_styles, panels, save
from scenarios.beds.defluidisation.study import onset
from scenarios.beds.gas_bed.study import mueller
from scenarios.validation.kept_runs import advanced, taken
from scenarios.validation.table import Progress, Row


class Oil(NamedTuple):
    """What the particles carry."""

    contact_angle: float  # [degrees]
    share: float = 1e-3  # of the volume of the particles


STATES = {"dry": None, "weak": Oil(85.0), "medium": Oil(75.0), "strong": Oil(60.0)}
"""Oil by state; the pulls are 0.7, 2.2 and 4.2 times the weight of a particle."""

RAMPS = STATES | {"weak, 1 % oil": Oil(85.0, 1e-2)}
"""States that are defluidised."""

SEEDS = (1, 2, 3)
SETTLED = 0.6
"""Start of the averages [s]."""

ROUNDS = (1.1, 1.6, 2.1, 3.1, 5.1, 10.1)
"""Ends of the rounds in which runs advance [s]."""

FEWEST = 0.4
"""Shortest time that is averaged [s]."""

RAMP = [[0.0, 0.0066], [0.2, 0.66], [0.6, 0.66], [4.6, 0.05]]
"""Inlet velocity of a ramp: the bed is mixed, then slowly defluidised [s, m/s]."""

VISCOSITY = 5e-3
"""Of the oil [Pa s]."""

SURFACE_TENSION = 0.02
"""Of the oil [N/m]."""

UNITS = {"height": "m", "height_deviation": "m", "pressure_deviation": "Pa", "temperature": "m2/s2", "bubble": "m"}
"""Quantities of the table and their units."""

EXPECTED = {"bubble": 1.0, "pressure_deviation": 1.0, "temperature": -1.0}
"""Whether experiments report that a quantity is larger (1) or smaller (-1) in wet beds than in dry ones."""


class Means(NamedTuple):
    """Means of one run, each with the standard error that follows from its own variation in time."""

    time: float  # that was averaged [s]
    height: Estimate  # [m]
    height_deviation: Estimate  # in time [m]
    pressure_deviation: Estimate  # in time [Pa]
    temperature: Estimate  # granular temperature [m2/s2]
    bubble: Estimate  # diameter of a bubble, mean by area [m]


def state(name: str) -> Case:
    """Mueller's bed with smeared surfaces, in one of the states of `RAMPS`."""
    oil, case = RAMPS[name], mueller().with_(**{"laws.surface": "smeared"})
    title = f"Mueller's bed, {name}"
    if oil is None:
        return case.with_(title=title)
    rough = {f"material.{material}.roughness": 1e-6 for material in case.material}
    liquid = {"viscosity": VISCOSITY, "surface_tension": SURFACE_TENSION}
    return case.with_(
        **rough, title=title, liquid=liquid | {"contact_angle": oil.contact_angle, "liquid_fraction": oil.share}
    )


def study(folder: Path, progress: Progress, hours: float = math.inf) -> list[Row]:
    """Advance all runs on one thread, and return the table. Several processes may share the folder.

    From then on, this process runs on one thread.

    hours  after which no further round of a run begins
    """
    use_threads(1)
    end = monotonic() + 3600.0 * hours
    while monotonic() <= end and advance_one(folder, progress):
        pass
    return table(folder)


def advance_one(folder: Path, progress: Progress) -> bool:
    """Make the first piece of the plan that is left and whose run no other process has; False if there is none."""
    for name, case, until in plan():
        with taken(folder, name) as free:
            if free and not is_there(folder / name, until):
                advanced(case, folder, name, progress, until)
                return True
    return False


def plan() -> Iterator[tuple[str, Case, float]]:
    """Folder, case and end [s] of every piece of the study: one packing, then ramps, then the other packings."""
    for until in ROUNDS[:3]:
        for name in STATES:
            yield f"{name}_1", _packing(name, 1), until
    for name in RAMPS:
        changes: dict[str, Any] = {"bed.inlet_velocity": RAMP, "run.every": 0.05}
        yield ramp_folder(name), state(name).with_(**changes), RAMP[-1][0]
    for seed in SEEDS:
        for until in ROUNDS:
            for name in STATES:
                yield f"{name}_{seed}", _packing(name, seed), until


def ramp_folder(name: str) -> str:
    """Name of the folder of the ramp of a state.

    >>> ramp_folder("weak, 1 % oil")
    'weak_1_oil_ramp'
    """
    return "_".join([*re.findall(r"\w+", name), "ramp"])


def pull_over_weight(name: str) -> float:
    """Pull of a bridge between touching particles over the weight of one."""
    oil, case = RAMPS[name], state(name)
    if oil is None:
        return 0.0
    weight = case.solid.density * math.pi / 6.0 * case.bed.diameter**3 * math.hypot(*case.laws.gravity)
    return math.pi * case.bed.diameter * SURFACE_TENSION * math.cos(math.radians(oil.contact_angle)) / weight


def _packing(name: str, seed: int) -> Case:
    """One state with one packing."""
    return state(name).with_(**{"bed.seed": seed, "run.average_from": SETTLED})


# ---------------------------------------------------------------- the table


def table(folder: Path) -> list[Row]:
    """The rows that the runs so far allow, and their figure.

    States are compared over the same times, but a bed that comes to rest only as long as it moves.
    """
    by_state: dict[str, list[Means]] = {}
    rows_of_states: list[Row] = []
    for name, ends in windows(folder).items():
        runs = {seed: open_run(folder / f"{name}_{seed}") for seed in ends}
        moving = while_moving(ends, rests := {seed: rest(run, _packing(name, seed)) for seed, run in runs.items()})
        averaged = sum(end - SETTLED for end in moving.values())
        note = f"packings: {len(moving)} of {len(SEEDS)}; {ROUNDS[-1] - SETTLED:g} s of each are planned"
        rows_of_states.append(Row(f"{name}: simulated time in the means", averaged, unit="s", note=note))
        for seed, time in rests.items():
            if math.isfinite(time):
                rows_of_states.append(Row(f"{name}: packing {seed} comes to rest after", time, unit="s"))
        if moving:
            by_state[name] = [means(runs[seed], SETTLED, end) for seed, end in moving.items()]
            rows_of_states += rows(name, by_state[name])
    ramps = {name: falling(name, folder) for name in RAMPS if is_there(folder / ramp_folder(name), RAMP[-1][0])}
    if "dry" in by_state and len(by_state) > 1:
        ratios = {quantity: [over_dry(by_state, name, quantity) for name in by_state] for quantity, *_ in QUANTITIES}
        draw(folder / "wet-beds.png", [pull_over_weight(state) for state in by_state], ratios, ramps)
    return [
        *rows_of_states,
        *(
            Row(f"{name}: minimum fluidisation on the way down", ramp.onset, unit="m/s", note=ramp.note)
            for name, ramp in ramps.items()
        ),
        *directions(by_state, {name: ramp.onset for name, ramp in ramps.items()}),
    ]


def windows(folder: Path) -> dict[str, dict[int, float]]:
    """State -> packing -> end of the means [s], the same for all states that have come so far."""
    ends: dict[str, dict[int, float]] = {}
    for seed in SEEDS:
        times = {name: reached(folder / f"{name}_{seed}") for name in STATES}
        far = {name: time for name, time in times.items() if time >= SETTLED + FEWEST}
        for name in far:
            ends.setdefault(name, {})[seed] = min(far.values())
    return ends


def rest(run: RunData, case: Case) -> float:
    """Time from which on a wet bed is not fluidised [s]; infinite if it is at the end."""
    loss = defluidisation_of(run, case)
    return math.inf if loss is None else loss.time


def while_moving(ends: Mapping[int, float], rests: Mapping[int, float]) -> dict[int, float]:
    """Packing -> end of the means [s]: at the latest when it comes to rest; without those that never moved for long.

    >>> while_moving({1: 10.1, 2: 10.1, 3: 10.1}, {1: 5.0, 2: math.inf, 3: 0.7})
    {1: 5.0, 2: 10.1}
    """
    moving = {seed: min(end, rests[seed]) for seed, end in ends.items()}
    return {seed: end for seed, end in moving.items() if end >= SETTLED + FEWEST}


def is_there(home: Path, until: float) -> bool:
    """Whether a run has come to a time [s]."""
    return reached(home) >= until * (1.0 - 1e-9)


def reached(home: Path) -> float:
    """Time up to which a run has been written [s]; 0 without one or without a snapshot."""
    times = open_run(home).times.tolist() if (home / "run.json").exists() else []
    return max(times, default=0.0)


def rows(name: str, runs: Sequence[Means]) -> list[Row]:
    """Means over the packings, with the standard error of their mean."""
    lines = []
    for quantity, unit in UNITS.items():
        mean, error = over_packings(runs, quantity)
        lines.append(Row(f"{name}: {quantity.replace('_', ' ')}", mean, unit=unit, note=f"standard error {error:.2g}"))
    return lines


def directions(by_state: dict[str, list[Means]], onsets: dict[str, float]) -> list[Row]:
    """Ratios to the dry bed, as logarithms: above 0 where they should rise, with their standard errors."""
    lines = []
    for name in (state for state in by_state if state != "dry" and "dry" in by_state):
        for quantity, sign in EXPECTED.items():
            ratio, error = over_dry(by_state, name, quantity)
            word = "larger" if sign > 0.0 else "smaller"
            lines.append(
                Row(
                    f"{name}: {quantity.replace('_', ' ')} {word} than dry, logarithm of the ratio",
                    sign * math.log(ratio),
                    note=f"standard error {error / ratio:.2g}; experiments report above 0",
                )
            )
    for name in (state for state in onsets if state != "dry" and "dry" in onsets):
        lines.append(Row(f"{name}: minimum fluidisation over that of the dry bed", onsets[name] / onsets["dry"]))
    return lines


def over_dry(by_state: Mapping[str, Sequence[Means]], name: str, quantity: str) -> Estimate:
    """Mean of a quantity in a state over that in the dry bed; 1 without error for the dry bed itself."""
    wet, dry = (over_packings(by_state[state], quantity) for state in (name, "dry"))
    ratio = wet[0] / dry[0]
    return ratio, 0.0 if name == "dry" else ratio * math.hypot(wet[1] / wet[0], dry[1] / dry[0])


def over_packings(runs: Sequence[Means], quantity: str) -> Estimate:
    """Mean over packings, weighted by their times, and its standard error.

    The error is that by the scatter of the packings or that by their variation in time, whichever is larger: two or
    three packings may agree by chance.
    """
    times = np.array([run.time for run in runs])
    values, errors = np.array([getattr(run, quantity) for run in runs]).T
    shares, count = times / times.sum(), len(runs)
    mean = float(shares @ values)
    scatter = math.sqrt(count / (count - 1)) * np.linalg.norm(shares * (values - mean)) if count > 1 else 0.0
    return mean, float(max(scatter, np.linalg.norm(shares * errors)))


# ---------------------------------------------------------------- one run


def means(run: RunData, begin: float, end: float = math.inf) -> Means:
    """Means of a run between two times [s]."""
    inside = (run.history["time"] >= begin) & (run.history["time"] <= end * (1.0 + 1e-9))
    history = {name: column[inside] for name, column in run.history.items()}
    return Means(
        float(np.ptp(history["time"])),
        _mean(history["bed_height"]),
        _deviation(history["bed_height"]),
        _deviation(history["pressure_drop"]),
        _mean(history["granular_temperature"]),
        mean_bubble(run, begin, end),
    )


def _mean(values: np.ndarray) -> Estimate:
    """Mean and its error of a correlated series."""
    average = block_average(values)
    return average.mean, average.error


def _deviation(values: np.ndarray) -> Estimate:
    """Standard deviation of a correlated series, and its error: that of the mean square deviation."""
    square, error = _mean((values - values.mean()) ** 2)
    return math.sqrt(square), error / (2.0 * math.sqrt(square)) if square > 0.0 else 0.0


def mean_bubble(run: RunData, begin: float, end: float = math.inf) -> Estimate:
    """Diameter of the bubbles in the snapshots between two times, weighted by their areas [m]; NaN without any.

    The error takes bubbles of different snapshots as independent. Snapshots are closer than a bubble lives: it is a
    lower bound.
    """
    grid: Any = run.grid
    sums: list[tuple[float, float]] = []
    for place in np.flatnonzero((run.times >= begin) & (run.times <= end * (1.0 + 1e-9))):
        surface = float(np.interp(run.times[place], run.history["time"], run.history["bed_height"]))
        voidage = run.fluid("voidage", int(place))
        diameter = find_bubbles(voidage, grid.spacing, surface=surface, flat=True)["diameter"]
        sums.append((float((diameter**3).sum()), float((diameter**2).sum())))
    cubes, squares = np.array(sums).reshape(-1, 2).T
    if not squares.sum() > 0.0:
        return math.nan, math.nan
    mean = float(cubes.sum() / squares.sum())
    return mean, float(np.sqrt(((cubes - mean * squares) ** 2).sum()) / squares.sum())


def falling(name: str, folder: Path) -> Ramp:
    """The part of a ramp in which the velocity falls, and where the pressure drop of the packed bed is the weight."""
    run, case = open_run(folder / ramp_folder(name)), state(name).with_(**{"bed.inlet_velocity": RAMP})
    falls = run.history["time"] > RAMP[-2][0]
    time, drop = (run.history[column][falls] for column in ("time", "pressure_drop"))
    velocity = np.interp(time, *np.array(RAMP).T)
    share = drop * case.column.floor_area / buoyant_weight(case)
    try:
        return Ramp(time, velocity, share, onset(case, run.history, rising=False).velocity)
    except InputError as missing:
        return Ramp(time, velocity, share, math.nan, str(missing))


# ---------------------------------------------------------------- figures


Estimate = tuple[float, float]
"""A mean and its standard error."""

QUANTITIES = (
    ("bubble", "bubble diameter", BLUE, "o"),
    ("pressure_deviation", "pressure fluctuation", ORANGE, "s"),
    ("temperature", "granular temperature", GREEN, "^"),
)
"""Quantities whose ratios to the dry bed are drawn: name, words, colour, marker."""

SMOOTHED = 0.4
"""Time over which the curves of the ramps are averaged [s]."""


class Ramp(NamedTuple):
    """A bed while its gas velocity falls."""

    time: np.ndarray  # (n,) [s]
    velocity: np.ndarray  # (n,) superficial [m/s]
    share: np.ndarray  # (n,) pressure drop over the weight
    onset: float  # minimum fluidisation [m/s]; NaN if not found
    note: str = ""  # why it was not found


def draw(
    path: Path, pulls: Sequence[float], ratios: Mapping[str, Sequence[Estimate]], ramps: Mapping[str, Ramp]
) -> None:
    """Ratios to the dry bed against the pull of a bridge, and the pressure drop of the ramps.

    pulls   of each state over the weight of a particle
    ratios  quantity -> its mean in each state over that of the dry bed
    ramps   by state
    """
    figure, (left, right) = panels(2, width=10.0, height=4.4)
    for name, words, colour, marker in QUANTITIES:
        values, errors = np.array(ratios[name]).T
        left.errorbar(pulls, values, 2.0 * errors, color=colour, marker=marker, capsize=3.0, label=words)
    left.set_yscale("log")
    left.set_yticks((0.3, 0.5, 1.0, 2.0), ("0.3", "0.5", "1", "2"))
    left.minorticks_off()
    label(left, "pull of a bridge over weight", "-", "over that of the dry bed", "-", "In the bubbling bed")
    legend(left)
    for style, (name, ramp) in zip(line_styles(len(ramps)), ramps.items()):
        width = max(round(SMOOTHED / float(np.median(np.diff(ramp.time)))), 1)
        kernel = np.full(width, 1.0 / width)
        velocity, share = (np.convolve(series, kernel, "valid") for series in (ramp.velocity, ramp.share))
        right.plot(velocity, share, label=name, **style)
        right.plot([ramp.onset], [1.0], "o", color=style["color"], markersize=7.0)
    label(right, "gas velocity", "m/s", "pressure drop over weight", "-", "While the velocity falls")
    if ramps:
        legend(right)
    save(figure, path)
