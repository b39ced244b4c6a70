"""Wet collisions: three spheres (Davis 2023), pairs (Punch et al. 2023), thick films (Singh et al.), and the wet wall.

Printed numbers are compared with 0.5 %. Three statements of the first paper do not follow from its printed equations;
they stand in the table without a limit, beside what the equations give.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.view.plots import save
from closures.restitution import davis_sitison, singh
from scenarios import three_spheres_figures, wet_pair_figures, wet_wall_validation
from scenarios.three_spheres import Triplet, outcomes, simulate
from scenarios.validation import Columns, Row, Tell, reference, worst, write_histories
from scenarios.wet_checks import cartesian
from scenarios.wet_pair import TRANSITION_PRESSURES, collide_wet

Curves = dict[str, Columns]
HEAD_ON_CRITICAL = {
    ("static", "constant"): 1.193,
    ("static", "zero"): 1.217,
    ("deforming", "constant"): 1.196,
    ("deforming", "zero"): 1.214,
}
"""Stokes number above which a pair bounces head-on: converged solutions of the published equations."""

UNPRINTED: tuple[dict[str, Any], ...] = (
    {"stokes": 9.0, "theta12": 37.5},
    {"stokes": 6.0, "theta12": 55.0, "friction": 0.2, "restitution": 0.9},
    {"stokes": 15.0, "theta12": 20.0, "theta23": 40.0, "gap23": 0.6, "capillary_number": 60.0},
    {"stokes": 5.0, "theta12": 45.0, "film23": 1.5, "gap23": 1.2, "minimum_gap": 0.1, "film_ratio": 0.05},
    {"stokes": 12.0, "theta12": 10.0, "restitution": 0.8, "film_ratio": 0.02, "gap23": 3.0, "minimum_gap": 0.02},
    {"stokes": 11.0, "theta12": -50.0, "theta23": 30.0, "friction": 0.1},
)
"""Conditions printed nowhere, compared with the second solution."""


def study(folder: Path, tell: Tell) -> list[Row]:
    """Run all parts, write histories and figures, and return the table."""
    rows, curves = [], {}  # type: ignore[var-annotated]
    for part in PARTS:
        tell((part.__doc__ or "").splitlines()[0])
        rows += part(folder, curves)
    write_histories(folder / "wet.h5", curves)
    return rows + wet_wall_validation.study(folder, tell)


def of(run: Triplet, quantity: str, pair: int) -> float:
    """A number of a run by the words of the data file: "restitution", or an event and its clock."""
    if quantity == "restitution":
        return {12: run.restitution12, 23: run.restitution23}[pair]
    kind, clock = quantity.split()
    found = [event for event in run.events if event.kind == kind and event.pair == pair]
    if not found:
        return math.nan
    return found[0].time_star if clock == "t_star" else found[0].time


def printed(_: Path, __: Curves) -> list[Row]:
    """Three spheres: numbers printed by Davis (2023)."""
    data, rows = reference("davis2023_printed"), []
    for place, figure in enumerate(data["figure"]):
        stokes, one, two, gap, friction = (
            float(data[name][place])
            for name in ("stokes [-]", "theta12 [deg]", "theta23 [deg]", "minimum_gap [-]", "friction [-]")
        )
        quantity, pair, value = data["quantity"][place], int(data["pair"][place]), float(data["printed [-]"][place])
        run = simulate(stokes, one, two, minimum_gap=gap, friction=friction)
        title = f"fig. {figure}, St {stokes:g}, {one:g} deg: {quantity} of {pair}"
        if friction:
            title = title.replace("deg:", f"deg, mu {friction:g}:")
        rows.append(Row(title, of(run, quantity, pair), value, 0.005 * value))
    return rows


def first_above(holds: Callable[[float], bool], low: float, high: float) -> float:
    """The number between `low`, where something does not hold, and `high`, where it does, at which it begins to."""
    for _ in range(14):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def parts_before(stokes: float, angle: float) -> bool:
    """Whether spheres 1 and 2 part before 2 strikes 3."""
    run = simulate(stokes, angle)
    return of(run, "separate t", 12) < of(run, "contact t", 23)


def thresholds(_: Path, __: Curves) -> list[Row]:
    """Three spheres: where the outcome changes."""
    jumps = [(angle, first_above(lambda st, a=angle: parts_before(st, a), low, high), at)  # type: ignore[misc]
             for angle, low, high, at in ((30.0, 12.0, 20.0, 14.1), (45.0, 5.0, 9.0, 7.0))]  # fmt: skip
    slower = {
        ca: simulate(3.5, 45.0, capillary_number=ca, until=5.65) for ca in (math.inf, 1000.0, 500.0, 200.0, 100.0)
    }
    times = [of(run, "separate t", 12) for run in slower.values()]
    pull = first_above(lambda ca: simulate(7.0, 45.0, capillary_number=ca, until=0.5).restitution12 > 0.0, 4.0, 12.0)
    touch = first_above(lambda st: not math.isnan(of(simulate(st, 45.0, until=2.0), "contact t", 12)), 1.2, 3.0)
    leaves = first_above(lambda st: simulate(st, 0.0).restitution23 > 0.0, 4.0, 8.0)
    return [
        *(Row(f"jump of e12 at {angle:g} deg: St", value, at, 0.005 * at) for angle, value, at in jumps),
        Row("St 3.5, Ca 1000: time of parting over that without pull", times[1] / times[0], 44.7 / 39.0, 0.006),
        Row("St 3.5, Ca 100: has parted by t = 400", 0.0 if math.isnan(times[4]) else 1.0, 0.0, 0.0),
        Row("not reproduced: St 7, 45 deg stays together up to Ca", pull, 6.0, note="printed: for Ca of 6 and less"),
        Row("not reproduced: 45 deg, solids touch from St", touch, 2.4),
        Row("not reproduced: in line, sphere 3 leaves from St", leaves, 4.8),
        Row("in line, sphere 3 leaves from St, exact: v23 = 1/3 at contact", leaves, 5.841, 0.002),
    ]


def second_solution(_: Path, __: Curves) -> list[Row]:
    """Three spheres: points printed nowhere, against a second solution in Cartesian coordinates."""
    times, speeds, missing = [], [], 0
    for place, conditions in enumerate(UNPRINTED):
        ours = simulate(**conditions, until=2.0).events
        theirs = cartesian(**conditions)
        for a, (kind, pair, time, speed) in zip(ours, theirs):
            missing += (a.kind, a.pair) != (kind, pair)
            times.append((place, a.time / time, 1.0))
            speeds.append((place, a.speed, speed))
        missing += len(theirs) > len(ours)
    return [
        Row("second solution: events in another order", float(missing), 0.0, 0.0),
        worst("second solution: time of an event, ratio", times, 0.002),
        worst("second solution: normal speed of an event", speeds, 0.005),
    ]


def two_spheres(_: Path, __: Curves) -> list[Row]:
    """Two spheres head-on: the analytic law of Davis & Sitison (2020)."""
    points = []
    for stokes in (2.0, 4.5, 6.0, 10.0, 20.0):
        for e, gap in ((1.0, 0.05), (0.8, 0.01), (0.9, 0.2)):
            run = simulate(stokes, 0.0, minimum_gap=gap, restitution=e, spheres=2)
            points.append((stokes, run.restitution12, davis_sitison(stokes, e, gap)))
    return [worst("two spheres head-on: restitution against the analytic law", points, 1e-4)]


def pairs(_: Path, __: Curves) -> list[Row]:
    """Wet pair: converged solutions of the equations of Punch et al. (2023)."""
    data = reference("wet_pair_converged")
    restitutions, spins = [], []
    for place, bridge in enumerate(data["bridge"]):
        stokes, angle, friction, e, omega = (
            float(data[name][place])
            for name in ("stokes [-]", "angle [deg]", "friction [-]", "restitution [-]", "spin [rad/s]")
        )
        run = collide_wet(stokes, angle, bridge=bridge, cut=data["cut"][place], friction=friction)
        restitutions.append((stokes, run.restitution, e))
        if not math.isnan(omega):
            spins.append((stokes, run.spin / omega, 1.0))
    rows = [worst("wet pair: restitution", restitutions, 0.003), worst("wet pair: spin, ratio", spins, 0.01)]
    for (bridge, cut), critical in HEAD_ON_CRITICAL.items():

        def bounces(stokes: float, bridge: str = bridge, cut: str = cut) -> bool:
            return collide_wet(stokes, bridge=bridge, cut=cut, duration=50.0).restitution > 0.0

        rows.append(
            Row(f"{bridge} bridge, cut to {cut}: critical St_n", first_above(bounces, 0.9, 1.5), critical, 0.01)
        )
    return [*rows, *other_films(), *soft_and_hard()]


def other_films() -> list[Row]:
    """Film across the line of centres, capillary pull, and where the spin is largest."""
    peak = max((collide_wet(stokes, 60.0).spin, stokes) for stokes in np.arange(0.70, 1.2, 0.01))
    return [
        Row("60 deg, St 1.2, film of Nase: spin", collide_wet(1.2, 60.0, tangential="nase").spin, 12.3, 0.123, "rad/s"),
        Row(
            "60 deg, St 0.5, no film across: restitution",
            collide_wet(0.5, 60.0, tangential=None).restitution,
            0.117,
            0.003,
        ),
        Row(
            "60 deg, St 0.5, capillary pull: restitution",
            collide_wet(0.5, 60.0, capillary=True).restitution,
            0.0716,
            0.003,
        ),
        Row("60 deg: largest spin", peak[0], 8.84, 0.0884, "rad/s"),
        Row("60 deg: St_n of the largest spin; the text says about 1.5", peak[1], 1.5),
    ]


def soft_and_hard() -> list[Row]:
    """Soft contact of the wet pair against the hard contact of the three spheres without the third."""
    restitutions, spins = [], []
    for stokes in (0.5, 0.8, 1.0, 1.2, 1.4, 2.0, 4.0):
        soft = collide_wet(stokes, 60.0)
        film, diameter = 270e-6, 25.4e-3
        hard = simulate(
            stokes, 60.0, film_ratio=film / diameter, minimum_gap=soft.minimum_gap / film, restitution=0.9, spheres=2
        )
        leaves = of(hard, "separate t", 12)
        spin = float(np.interp(leaves, hard.history["time"], hard.history["spin1"])) * soft.velocity / film
        restitutions.append((stokes, soft.restitution / hard.restitution12, 1.0))
        spins.append((stokes, soft.spin / spin, 1.0))
    return [
        worst("soft over hard contact, 60 deg: restitution", restitutions, 0.01),
        worst("soft over hard contact, 60 deg: spin", spins, 0.02),
    ]


def thick_films(_: Path, __: Curves) -> list[Row]:
    """Thick films: the law of Singh et al. is the lower of its two planes and has no jump."""
    jumps = []
    for ratio in (0.05, 0.1, 0.143):
        stokes = math.exp((0.86 - 0.06 * math.log(ratio)) / 0.16)  # where the planes meet
        jumps.append((ratio, singh(stokes * (1.0 + 1e-12), ratio), singh(stokes * (1.0 - 1e-12), ratio)))
    rounded = 0.4 * 500.0**0.01 * 0.1**-0.22
    return [
        worst("thick film: law on both sides of the line of its planes", jumps, 1e-12),
        Row("thick film, St 500, 0.1: rounded prefactors over exact", rounded / (math.exp(-0.90) / 0.4 * rounded), 1.0),
    ]


def three_sphere_figures(folder: Path, curves: Curves) -> list[Row]:
    """Three spheres: maps of outcomes and restitutions, sequences, gaps."""
    figures = three_spheres_figures
    stokes, angles = np.linspace(0.5, 20.0, 40), np.linspace(0.0, 85.0, 40)
    for name, number in (("three_spheres_map", math.inf), ("three_spheres_map_capillary", 40.0)):
        table = outcomes(stokes, angles, capillary_number=number)
        title = "$h_a$ = 0.01, $h_m$ = 0.05, " + ("no capillary pull" if number == math.inf else f"Ca = {number:g}")
        save(figures.outcome_map(stokes, angles, table, title), folder / f"{name}.png")
        for key in ("restitution12", "restitution23"):
            curves[f"{name}/{key}"] = {"value": (table[key], "-"), "stokes": (stokes, "-"), "angle": (angles, "deg")}
    fine, finer = np.linspace(0.5, 20.0, 79), np.linspace(2.0, 88.0, 87)
    save(
        figures.restitution_contours(fine, finer, outcomes(fine, finer, until=3.0)),
        folder / "three_spheres_contours.png",
    )
    angles = np.array([15.0, 22.5, 30.0, 37.5, 45.0, 60.0])
    table = outcomes(fine, angles, until=3.0)
    head_on = np.array([davis_sitison(each, 1.0, 0.05) for each in fine])
    by_angle = {angle: {key: values[row] for key, values in table.items()} for row, angle in enumerate(angles)}
    save(figures.restitution_curves(fine, by_angle, head_on), folder / "three_spheres_restitution.png")
    runs = [
        ("St = 2: changes partners", simulate(2.0, 45.0), [0.0, 1.0, 2.0, 2.6, 3.5, 5.0]),
        ("St = 5", simulate(5.0, 45.0), [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]),
        ("St = 10", simulate(10.0, 45.0), [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]),
        ("St = 2, 2-3 at -45 deg", simulate(2.0, 45.0, -45.0, minimum_gap=0.04), [0.0, 0.6, 1.5, 3.0, 6.1, 7.5]),
    ]
    save(figures.sequences(runs), folder / "three_spheres_sequences.png")
    save(
        figures.gaps({f"St = {each}": simulate(each, 30.0) for each in (7, 12, 20)}, 0.05),
        folder / "three_spheres_gaps.png",
    )
    for title, run, _ in runs:
        group = title.split(":")[0].replace(" ", "_").replace(",", "")
        curves[f"sequence/{group}"] = {name: (values, _unit(name)) for name, values in run.history.items()}
    return []


def _unit(column: str) -> str:
    return "deg" if column.startswith("angle") else "-"


def pair_figures(folder: Path, curves: Curves) -> list[Row]:
    """Wet pair: restitution and spin against the Stokes number."""
    stokes, angles = np.linspace(0.1, 4.0, 79), (0.0, 15.0, 30.0, 45.0, 60.0)
    by_film = {
        kind: {a: np.array([collide_wet(st, a, *kind).restitution for st in stokes]) for a in angles}
        for kind in TRANSITION_PRESSURES
    }
    save(wet_pair_figures.films(stokes, by_film), folder / "wet_pair_restitution.png")
    by_friction = {
        mu: {a: np.array([collide_wet(st, a, friction=mu).spin for st in stokes]) for a in angles[1:]}
        for mu in (0.0, 0.05)
    }
    save(wet_pair_figures.spins(stokes, by_friction), folder / "wet_pair_spin.png")
    options: dict[str, dict[str, Any]] = {
        "Davis": {},
        "Nase": {"tangential": "nase"},
        "none": {"tangential": None},
        "Davis, capillary pull": {"capillary": True},
    }
    low = np.linspace(0.1, 2.0, 77)
    by_option = {
        name: np.array([collide_wet(st, 60.0, **more).restitution for st in low]) for name, more in options.items()
    }
    save(wet_pair_figures.tangential(low, by_option), folder / "wet_pair_tangential.png")
    for kind, curve in by_film.items():
        columns: dict[str, tuple[Any, str]] = {f"restitution_{a:g}_deg": (values, "-") for a, values in curve.items()}
        curves["wet_pair/" + "_".join(kind)] = {"stokes": (stokes, "-"), **columns}
    return []


PARTS: tuple[Callable[[Path, Curves], list[Row]], ...] = (
    printed,
    thresholds,
    second_solution,
    two_spheres,
    pairs,
    thick_films,
    three_sphere_figures,
    pair_figures,
)
