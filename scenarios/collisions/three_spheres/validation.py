"""Three wet spheres against Davis (2023), the law of two spheres, a second solution, and the particle engine.

Printed numbers are compared with 0.5 %. Three statements of the paper do not follow from its printed equations; they
are in the table without a limit, with the results of the equations.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.plotting.curves import save
from closures.restitution import davis_sitison
from scenarios.collisions.three_spheres import figures
from scenarios.collisions.three_spheres.study import Triplet, outcomes, simulate_three_spheres
from scenarios.references.three_spheres.cartesian import cartesian
from scenarios.validation.table import Curves, Row, reference, worst

hard_spheres = partial(simulate_three_spheres, solver="equations")

UNPRINTED: tuple[dict[str, Any], ...] = (
    {"stokes": 9.0, "theta12": 37.5},
    {"stokes": 6.0, "theta12": 55.0, "friction": 0.2, "restitution": 0.9},
    {"stokes": 15.0, "theta12": 20.0, "theta23": 40.0, "gap23": 0.6, "capillary_number": 60.0},
    {"stokes": 5.0, "theta12": 45.0, "film23": 1.5, "gap23": 1.2, "minimum_gap": 0.1, "film_ratio": 0.05},
    {"stokes": 12.0, "theta12": 10.0, "restitution": 0.8, "film_ratio": 0.02, "gap23": 3.0, "minimum_gap": 0.02},
    {"stokes": 11.0, "theta12": -50.0, "theta23": 30.0, "friction": 0.1},
)
"""Conditions that are not printed, compared with the second solution."""


def of(run: Triplet, quantity: str, pair: int) -> float:
    """A result of a run, by its name in the data file: "restitution", or an event and its time."""
    if quantity == "restitution":
        return {12: run.restitution12, 23: run.restitution23}[pair]
    kind, clock = quantity.split()
    events = [event for event in run.events if event.kind == kind and event.pair == pair]
    if not events:
        return math.nan
    return events[0].time_star if clock == "t_star" else events[0].time


def printed(_: Path, __: Curves) -> list[Row]:
    """Three spheres: numbers printed by Davis (2023), in the particle engine."""
    data, rows = reference("davis2023_printed"), []
    for place, figure in enumerate(data["figure"]):
        stokes, one, two, gap, friction = (
            float(data[name][place])
            for name in ("stokes [-]", "theta12 [deg]", "theta23 [deg]", "minimum_gap [-]", "friction [-]")
        )
        quantity, pair, value = data["quantity"][place], int(data["pair"][place]), float(data["printed [-]"][place])
        run = simulate_three_spheres(stokes, one, two, minimum_gap=gap, friction=friction)
        title = f"fig. {figure}, St {stokes:g}, {one:g} deg: {quantity} of {pair}"
        if friction:
            title = title.replace("deg:", f"deg, mu {friction:g}:")
        rows.append(Row(title, of(run, quantity, pair), value, 0.005 * value))
    return rows


def first_above(holds: Callable[[float], bool], low: float, high: float) -> float:
    """The threshold between `low`, where a condition does not hold, and `high`, where it does, by bisection."""
    for _ in range(14):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def parts_before(stokes: float, angle: float) -> bool:
    """Whether spheres 1 and 2 separate before 2 strikes 3."""
    run = hard_spheres(stokes, angle)
    return of(run, "separate t", 12) < of(run, "contact t", 23)


def thresholds(_: Path, __: Curves) -> list[Row]:
    """Three spheres: where the outcome changes."""
    jumps = [(angle, first_above(lambda st, a=angle: parts_before(st, a), low, high), at)  # type: ignore[misc]
             for angle, low, high, at in ((30.0, 12.0, 20.0, 14.1), (45.0, 5.0, 9.0, 7.0))]  # fmt: skip
    slower = {
        ca: hard_spheres(3.5, 45.0, capillary_number=ca, until=5.65) for ca in (math.inf, 1000.0, 500.0, 200.0, 100.0)
    }
    times = [of(run, "separate t", 12) for run in slower.values()]
    pull = first_above(
        lambda ca: hard_spheres(7.0, 45.0, capillary_number=ca, until=0.5).restitution12 > 0.0, 4.0, 12.0
    )
    touch = first_above(lambda st: not math.isnan(of(hard_spheres(st, 45.0, until=2.0), "contact t", 12)), 1.2, 3.0)
    leaves = first_above(lambda st: hard_spheres(st, 0.0).restitution23 > 0.0, 4.0, 8.0)
    return [
        *(Row(f"jump of e12 at {angle:g} deg: St", value, at, 0.005 * at) for angle, value, at in jumps),
        Row(
            "St 3.5, Ca 1000: time of separation over that without capillary force",
            times[1] / times[0],
            44.7 / 39.0,
            0.006,
        ),
        Row("St 3.5, Ca 100: separated by t = 400 (1: yes)", 0.0 if math.isnan(times[4]) else 1.0, 0.0, 0.0),
        Row("not reproduced: St 7, 45 deg stays together up to Ca", pull, 6.0, note="printed: for Ca of 6 and less"),
        Row("not reproduced: 45 deg, solids touch from St", touch, 2.4),
        Row("not reproduced: in line, sphere 3 leaves from St", leaves, 4.8),
        Row("in line, sphere 3 leaves from St, exact: v23 = 1/3 at contact", leaves, 5.841, 0.002),
    ]


def second_solution(_: Path, __: Curves) -> list[Row]:
    """Three spheres: other conditions, against a second solution in Cartesian coordinates."""
    times, speeds, missing = [], [], 0
    for place, conditions in enumerate(UNPRINTED):
        ours = hard_spheres(**conditions, until=2.0).events
        theirs = cartesian(**conditions)
        for a, (kind, pair, time, speed) in zip(ours, theirs):
            missing += (a.kind, a.pair) != (kind, pair)
            times.append((place, a.time / time, 1.0))
            speeds.append((place, a.speed, speed))
        missing += len(theirs) > len(ours)
    return [
        Row("second solution: events out of order", float(missing), 0.0, 0.0),
        worst("second solution: time of an event, ratio", times, 0.002),
        worst("second solution: normal speed of an event", speeds, 0.005),
    ]


def two_spheres(_: Path, __: Curves) -> list[Row]:
    """Two spheres head-on: the analytic law of Davis & Sitison (2020)."""
    points = []
    for stokes in (2.0, 4.5, 6.0, 10.0, 20.0):
        for e, gap in ((1.0, 0.05), (0.8, 0.01), (0.9, 0.2)):
            run = hard_spheres(stokes, 0.0, minimum_gap=gap, restitution=e, spheres=2)
            points.append((stokes, run.restitution12, davis_sitison(stokes, e, gap)))
    return [worst("two spheres head-on: restitution against the analytic law", points, 1e-4)]


IN_ENGINE: tuple[dict[str, Any], ...] = (
    {"stokes": 12.0, "theta12": 30.0},
    {"stokes": 20.0, "theta12": 30.0},
    {"stokes": 8.0, "theta12": 45.0},
    {"stokes": 8.0, "theta12": 45.0, "friction": 0.1},
    {"stokes": 15.0, "theta12": 37.5, "friction": 0.15, "restitution": 0.95},
    {"stokes": 15.0, "theta12": 20.0, "theta23": 40.0, "capillary_number": 60.0, "restitution": 0.9},
)
ENGINE_UNTIL = 5.0
"""End of the runs in the particle engine, in delta_12 / v_n0."""

OVERLAPS = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002)


def _in_engine(conditions: dict[str, Any], overlap: float = 0.002) -> Triplet:
    until = ENGINE_UNTIL * 0.01 / math.cos(math.radians(conditions["theta12"]))
    return simulate_three_spheres(**conditions, until=until, overlap=overlap)


def particle_engine(folder: Path, curves: Curves) -> list[Row]:
    """Three spheres: the particle engine with soft contacts against the polar equations with hard ones."""
    times, restitutions, missing = [], [], 0
    for place, conditions in enumerate(IN_ENGINE):
        soft, hard = _in_engine(conditions), hard_spheres(**conditions)
        for a, b in zip(soft.events, hard.events):
            missing += (a.kind, a.pair) != (b.kind, b.pair)
            times.append((place, a.time / b.time, 1.0))
            if a.kind == "separate":
                restitutions.append((place, a.speed, b.speed))
    hard = hard_spheres(**IN_ENGINE[0])
    runs = {overlap: _in_engine(IN_ENGINE[0], overlap) for overlap in OVERLAPS}
    errors = {
        pair: np.abs(
            [getattr(run, f"restitution{pair}") - getattr(hard, f"restitution{pair}") for run in runs.values()]
        )
        for pair in ("12", "23")
    }
    save(figures.soft_and_hard(hard, runs[0.02], OVERLAPS, errors), folder / "three_spheres_engine.png")
    curves["three_spheres_engine"] = {"overlap": (OVERLAPS, "-"), **{f"error{k}": (v, "-") for k, v in errors.items()}}
    return [
        Row("particle engine: events out of order", float(missing), 0.0, 0.0),
        worst("particle engine: time of an event, ratio", times, 0.002),
        worst("particle engine: restitution", restitutions, 0.005),
    ]


def three_sphere_figures(folder: Path, curves: Curves) -> list[Row]:
    """Three spheres: maps of outcomes and restitutions, sequences, gaps."""
    stokes, angles = np.linspace(0.5, 20.0, 40), np.linspace(0.0, 85.0, 40)
    for name, number in (("three_spheres_map", math.inf), ("three_spheres_map_capillary", 40.0)):
        table = outcomes(stokes, angles, capillary_number=number)
        title = "$h_a$ = 0.01, $h_m$ = 0.05, " + ("no capillary pull" if number == math.inf else f"Ca = {number:g}")
        save(figures.outcome_map(stokes, angles, table, title), folder / f"{name}.png")
        for key in ("restitution12", "restitution23"):
            curves[f"{name}/{key}"] = {"value": (table[key], "-"), "stokes": (stokes, "-"), "angle": (angles, "deg")}
    fine, finer = np.linspace(0.5, 20.0, 40), np.linspace(2.0, 88.0, 44)
    save(
        figures.restitution_contours(fine, finer, outcomes(fine, finer, until=3.0)),
        folder / "three_spheres_contours.png",
    )
    angles = np.array([15.0, 22.5, 30.0, 37.5, 45.0, 60.0])
    table = outcomes(fine, angles, until=3.0)
    head_on = np.array([davis_sitison(number, 1.0, 0.05) for number in fine])
    by_angle = {angle: {key: values[row] for key, values in table.items()} for row, angle in enumerate(angles)}
    save(figures.restitution_curves(fine, by_angle, head_on), folder / "three_spheres_restitution.png")
    runs = [
        ("St = 2: changes partners", hard_spheres(2.0, 45.0), [0.0, 1.0, 2.0, 2.6, 3.5, 5.0]),
        ("St = 5", hard_spheres(5.0, 45.0), [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]),
        ("St = 10", hard_spheres(10.0, 45.0), [0.0, 0.3, 0.6, 0.9, 1.2, 1.5]),
        ("St = 2, 2-3 at -45 deg", hard_spheres(2.0, 45.0, -45.0, minimum_gap=0.04), [0.0, 0.6, 1.5, 3.0, 6.1, 7.5]),
    ]
    save(figures.sequences(runs), folder / "three_spheres_sequences.png")
    save(
        figures.gaps({f"St = {number}": hard_spheres(number, 30.0) for number in (7, 12, 20)}, 0.05),
        folder / "three_spheres_gaps.png",
    )
    for title, run, _ in runs:
        group = title.split(":")[0].replace(" ", "_").replace(",", "")
        curves[f"sequence/{group}"] = {name: (values, _unit(name)) for name, values in run.history.items()}
    return []


def _unit(column: str) -> str:
    return "deg" if column.startswith("angle") else "-"


PARTS: tuple[Callable[[Path, Curves], list[Row]], ...] = (
    printed,
    thresholds,
    second_solution,
    two_spheres,
    particle_engine,
    three_sphere_figures,
)
