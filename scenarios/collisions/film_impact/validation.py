"""The film impact against the fit of Singh, Windows-Yule & Nair (2026), its convergence, and its sensitivity.

The comparison with the fit has no limit: no parameter is adjusted to it. Limits apply to convergence, conservation, and
the statements of the paper without numbers.
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from closures.restitution import singh, singh_crossover
from scenarios.collisions.film_impact.figures import (
    Case,
    draw_energies,
    draw_laws,
    draw_moments,
    draw_motion,
    draw_restitution,
    draw_tension,
)
from scenarios.collisions.film_impact.materials import LIQUIDS, laws_of
from scenarios.collisions.film_impact.result import COLUMNS, FilmImpact
from scenarios.collisions.film_impact.study import impact, sweep
from scenarios.references.isph.impact import layer_at_rest, taylor_green
from scenarios.validation.table import Columns, Progress, Row, worst, write_histories

VELOCITIES = (0.2, 0.35, 0.5, 0.75, 1.0, 1.5)
CASES: tuple[Case, ...] = (
    (8e-3, "water", 0.4e-3),
    (5.5e-3, "water", 0.4e-3),
    (4e-3, "water", 0.4e-3),
    (2.8e-3, "water", 0.4e-3),
    (5.5e-3, "m5", 0.45e-3),
)
"""Beads and films of the paper; 20 cells in the film."""

SENSITIVITIES: dict[str, dict[str, Any]] = {
    "minimum gap of 0.3 um": {"minimum_gap": 0.3e-6},
    "minimum gap of 3 um": {"minimum_gap": 3e-6},
    "elastohydrodynamic minimum gap": {"gap_rule": "elastohydrodynamic"},
    "wetted column may lack 0.25": {"wetted_missing": 0.25},
    "wetted column may lack 1": {"wetted_missing": 1.0},
    "wetted radius guessed, share 0": {"wetted_share": 0.0},
    "wetted radius guessed, share 0.6": {"wetted_share": 0.6},
    "wetted radius guessed, share 0.9": {"wetted_share": 0.9},
    "cavitation at -1e5 Pa": {"cavitation": -1e5},
    "FLIP share of 0.9": {"flip": 0.9},
    "FLIP share of 1": {"flip": 1.0},
    "4 particles in a cell": {"particles_per_side": 2},
    "16 particles in a cell": {"particles_per_side": 4},
    "half the Courant number": {"courant": 0.25},
}
"""Changes of the oil impact at 10 cells, one at a time."""

SMOOTHED: dict[str, tuple[float, str, float, float]] = {
    "8 mm, water, 0.2 m/s": (8e-3, "water", 0.4e-3, 0.2),
    "2.8 mm, water, 0.35 m/s": (2.8e-3, "water", 0.4e-3, 0.35),
    "5.5 mm, m5, 0.5 m/s": (5.5e-3, "m5", 0.45e-3, 0.5),
    "8 mm, water, 1 m/s": (8e-3, "water", 0.4e-3, 1.0),
    "4 mm, water, 1 m/s": (4e-3, "water", 0.4e-3, 1.0),
    "2.8 mm, water, 1.5 m/s": (2.8e-3, "water", 0.4e-3, 1.5),
}
"""Impacts that are repeated with smoothed particles, three in each regime of the paper."""

Pairs = dict[str, tuple[FilmImpact, FilmImpact]]
"""The same impact with smoothed particles and on the grid, by name."""

ANGLES = (0.0, 90.0)
"""Contact angles of the impacts with surface tension; 10 cells in the film [deg]."""

oil = partial(impact, 5.5e-3, "m5", 0.45e-3, 0.5)
"""The case of the paper's study of resolution."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run convergence, sensitivities and the sweep; write histories and figures; return the table."""
    rows = convergence(progress) + sensitivities(progress) + cavitating(progress) + exact_solutions(progress)
    pairs = with_smoothed_particles(progress)
    cases = {case: sweep(VELOCITIES, progress, diameter=case[0], liquid=case[1], film=case[2]) for case in CASES}
    stretched = {case: with_tension(case, progress) for case in (CASES[0], CASES[3], CASES[4])}
    rows += smoothed(pairs) + fit(cases) + conservation(cases) + words(cases) + film_laws(cases) + tension(stretched)
    histories = {f"{d * 1e3:g}mm_{liquid}_{v:g}": result
                 for (d, liquid, _), results in cases.items() for v, result in zip(VELOCITIES, results)}  # fmt: skip
    write_histories(folder / "histories.h5", {name: _columns(history) for name, history in histories.items()})
    largest = cases[CASES[0]]
    draw_moments(folder / "film_impact.png", largest[2], CASES[0][0])
    draw_motion(folder / "film_impact_motion.png", largest[0], largest[-1])
    draw_energies(folder / "film_impact_energies.png", pairs)
    draw_restitution(folder / "film_impact_restitution.png", cases)
    draw_laws(folder / "film_impact_laws.png", cases)
    draw_tension(folder / "film_impact_tension.png", stretched)
    return rows


def convergence(progress: Progress) -> list[Row]:
    """Oil, 5.5 mm, 0.5 m/s: restitution against the cells in the film and the width of the domain."""
    results = {}
    for cells in (5, 10, 20, 40):
        progress(f"{cells} cells in the film")
        results[cells] = oil(cells=cells)
    e = {cells: result.restitution for cells, result in results.items()}
    wide = oil(cells=10, domain=1.5).restitution
    return [
        Row("oil, 0.5 m/s: restitution at 5 cells", e[5], e[40]),
        Row("oil, 0.5 m/s: restitution at 10 cells", e[10], e[40], 0.01),
        Row("oil, 0.5 m/s: restitution at 20 cells", e[20], e[40], 0.01),
        Row("oil, 0.5 m/s: domain wider by half, 10 cells", wide, e[10], 0.005),
        Row("oil, 0.5 m/s: processor time of a run at 20 cells", results[20].seconds, unit="s"),
        Row("oil, 0.5 m/s: processor time of a run at 40 cells", results[40].seconds, unit="s"),
    ]


def sensitivities(progress: Progress) -> list[Row]:
    """Restitution of the oil impact at 10 cells with one number of the method changed."""
    rows, base, changed = [], oil(cells=10).restitution, {}
    for name, change in SENSITIVITIES.items():
        progress(name)
        changed[name] = oil(cells=10, **change).restitution
        rows.append(Row(f"oil, 0.5 m/s: {name}", changed[name], base))
    tracked = [base] + [e for name, e in changed.items() if "may lack" in name]
    guessed = [e for name, e in changed.items() if "guessed" in name]
    return [
        *rows,
        Row("oil, 0.5 m/s: spread of e over the tracked wetted radii", np.ptp(tracked), 0.0, 0.03),
        Row("oil, 0.5 m/s: spread of e over the guessed wetted radii", np.ptp(guessed)),
    ]


def cavitating(progress: Progress) -> list[Row]:
    """Water that cavitates at -1e5 Pa, 8 mm, 1 m/s, 20 cells; and whether the voids were found in every step."""
    progress("cavitation in water")
    results = [impact(*SMOOTHED["8 mm, water, 1 m/s"], cavitation=-1e5), oil(cells=10, cavitation=-1e5)]
    whole = impact(*SMOOTHED["8 mm, water, 1 m/s"]).restitution
    unsettled = sum(len(result.warnings) for result in results)
    return [
        Row("8 mm, water, 1 m/s: cavitation at -1e5 Pa", results[0].restitution, whole),
        Row("impacts with cavitation whose voids were not found in some step", float(unsettled), 0.0, 0.0),
    ]


def exact_solutions(progress: Progress) -> list[Row]:
    """Smoothed particles against a layer at rest and a decaying vortex."""
    progress("smoothed particles")
    pool, name = layer_at_rest(10), "smoothed particles, layer at rest"
    return [
        Row(f"{name}: force on the plate over its weight", 1.0 + pool.plate_force, 1.0, 0.02),
        Row(f"{name}: largest speed over 0.5 m/s", pool.largest_speed / 0.5, 0.0, 0.01),
        Row("smoothed particles, Taylor-Green vortex of 50 x 50: speed", 1.0 + taylor_green(50), 1.0, 0.01),
    ]


def with_smoothed_particles(progress: Progress) -> Pairs:
    """Impacts by the method of the paper, smoothed particles at its coarsest resolution, and on the grid."""
    pairs = {}
    for name, case in SMOOTHED.items():
        progress(f"{name} with smoothed particles")
        pairs[name] = impact(*case, method="isph"), impact(*case, cells=10)
    return pairs


def smoothed(pairs: Pairs) -> list[Row]:
    """Smoothed particles beside the grid with 10 cells, and their own account of energy."""
    rows = []
    for name, (result, on_grid) in pairs.items():
        same = f"{name}: smoothed particles and grid"
        rows += [
            Row(f"{same}, restitution", result.restitution, on_grid.restitution, 0.1),
            Row(f"{same}, speed at the plate", result.p2.velocity, on_grid.p2.velocity, unit="m/s"),
            Row(f"{same}, speed once turned", result.turned_speed, on_grid.turned_speed, unit="m/s"),
        ]
    every = [(-r.p1.velocity, r) for r, _ in pairs.values()]
    ordered = [in_order(r) for _, r in every]
    doubled = {regime: [r.regime == regime and peaks(r) > 1 for _, r in every].count(True) for regime in (1, 2)}
    return [
        *rows,
        Row("smoothed particles: impacts with P1 to P4 out of order", float(ordered.count(False)), 0.0, 0.0),
        worst("smoothed particles: energy unexplained", [(v, r.ledger_error, 0.0) for v, r in every], 0.02),
        worst("smoothed particles: loss of the projection", [(v, r.energies["exchange"], 0.0) for v, r in every]),
        worst("smoothed particles: processor time", [(v, r.seconds, 0.0) for v, r in every], unit="s"),
        Row("smoothed particles: impacts of regime 1 with a second peak of energy, of 3", float(doubled[1])),
        Row("smoothed particles: impacts of regime 2 with a second peak of energy, of 3", float(doubled[2])),
    ]


def fit(cases: dict[Case, list[FilmImpact]]) -> list[Row]:
    """Restitution of every impact beside the fit."""
    rows, differences = [], []
    for (diameter, liquid, _), results in cases.items():
        points = [(-r.p1.velocity, r.restitution, singh(r.stokes, r.film_ratio)) for r in results]
        rows += [Row(f"{diameter * 1e3:g} mm, {liquid}, {v:g} m/s: restitution", e, fitted) for v, e, fitted in points]
        differences += [e - fitted for _, e, fitted in points if liquid == "water"]
    return [
        *rows,
        Row("water: root mean square of the deviation from the fit", float(np.sqrt(np.mean(np.square(differences))))),
    ]


def conservation(cases: dict[Case, list[FilmImpact]]) -> list[Row]:
    """Energy, exchange between particles and grid, momentum and volume, over all impacts."""
    every = [(-r.p1.velocity, r) for results in cases.values() for r in results]
    seconds = sum(r.seconds for _, r in every)
    return [
        worst("energy left unexplained", [(v, r.ledger_error, 0.0) for v, r in every], 0.02),
        worst("energy lost between particles and grid", [(v, r.energies["exchange"], 0.0) for v, r in every], 0.02),
        worst("momentum of the particles against the impulses", [(v, r.momentum_error, 0.0) for v, r in every]),
        worst("liquid where there is no room for it", [(v, r.volume_error, 0.0) for v, r in every], 0.005),
        Row(f"processor time of the sweep of {len(every)}", seconds, 0.0, 300.0, unit="s"),
        worst("processor time of one impact at 20 cells", [(v, r.seconds, 0.0) for v, r in every], 10.0, unit="s"),
    ]


def with_tension(case: Case, progress: Progress) -> dict[float | None, list[FilmImpact]]:
    """Sweeps of one bead without surface tension (None) and with it at each contact angle, 10 cells in the film."""
    diameter, liquid, film = case
    common: dict[str, Any] = {"diameter": diameter, "liquid": liquid, "film": film, "cells": 10}
    sigma = LIQUIDS[liquid].surface_tension
    results: dict[float | None, list[FilmImpact]] = {None: sweep(VELOCITIES, progress, **common)}
    for angle in ANGLES:
        results[angle] = sweep(VELOCITIES, progress, surface_tension=sigma, contact_angle=angle, **common)
    return results


def tension(cases: dict[Case, dict[float | None, list[FilmImpact]]]) -> list[Row]:
    """Restitution with surface tension beside that without, and how the energy is accounted for."""
    rows, every = [], []
    for (diameter, liquid, _), results in cases.items():
        for angle in ANGLES:
            every += [(-result.p1.velocity, result) for result in results[angle]]
            for bare, result in zip(results[None], results[angle]):
                name = f"{diameter * 1e3:g} mm, {liquid}, {-result.p1.velocity:g} m/s"
                rows.append(Row(f"{name}: surface tension, {angle:g} degrees", result.restitution, bare.restitution))
    return [
        *rows,
        worst("surface tension: energy left unexplained", [(v, r.ledger_error, 0.0) for v, r in every], 0.02),
        worst("surface tension: energy lost in exchange", [(v, r.energies["exchange"], 0.0) for v, r in every]),
        worst("surface tension: liquid where there is no room, 10 cells", [(v, r.volume_error, 0.0) for v, r in every]),
    ]


def film_laws(cases: dict[Case, list[FilmImpact]]) -> list[Row]:
    """Laws of thin films beside the resolved impacts: the largest deviation of each."""
    points: dict[str, list[tuple[float, float, float]]] = {}
    for (diameter, liquid, film), results in cases.items():
        for result in results:
            speed = -result.p1.velocity
            for name, e in laws_of(diameter, LIQUIDS[liquid], film, speed).items():
                points.setdefault(name, []).append((speed, e, result.restitution))
    return [worst(f"restitution by the {name} against the resolved", law_points) for name, law_points in points.items()]


def _columns(result: FilmImpact) -> Columns:
    return {name: (result.history[name], unit) for name, unit in COLUMNS.items()}


# ---------------------------------------------------------------- statements of the papers


PEAK = 0.02
"""Least height of a peak of the liquid's energy above what surrounds it, over the highest."""


def words(cases: dict[Case, list[FilmImpact]]) -> list[Row]:
    """Statements of the paper: order of the moments, suction, two regimes, peaks, and a straight line in 1/St."""
    every = [r for results in cases.values() for r in results]
    ordered = [in_order(r) for r in every]
    suction = [r.highest_pressure > 0.0 > r.lowest_pressure for r in every]
    rows = [
        Row("impacts with P1 to P4 out of order", float(ordered.count(False)), 0.0, 0.0),
        Row("impacts without suction after the contact", float(suction.count(False)), 0.0, 0.0),
    ]
    for (diameter, liquid, _), results in cases.items():
        name = f"{diameter * 1e3:g} mm, {liquid}"
        stokes, e = np.array([r.stokes for r in results]), np.array([r.restitution for r in results])
        ratio = change_of_slope(stokes, e) / singh_crossover(results[0].film_ratio)
        limit = math.log(1.5) if results[-1].regime == 2 else None  # all impacts in oil are in regime 1
        rows.append(Row(f"{name}: ln of St where the slope changes, over St*", math.log(ratio), 0.0, limit))
        rows.append(Row(f"{name}: R2 of e against 1/St", straight(1.0 / stokes, e), 1.0, 0.02))
    return rows + second_peaks(every)


def second_peaks(results: list[FilmImpact]) -> list[Row]:
    """Peaks of the kinetic energy of the liquid up to P4, as in figure 9 of the paper, in both regimes."""
    slow, fast = ([r for r in results if r.regime == regime] for regime in (1, 2))
    more, fewer = [peaks(r) > 1 for r in slow].count(True), [peaks(r) < 2 for r in fast].count(True)
    rows = [
        Row(f"regime 1: impacts with a second peak of the liquid's energy, of {len(slow)}", float(more), 0.0, 0.0),
        Row(f"regime 2: impacts without a second peak of the liquid's energy, of {len(fast)}", float(fewer), 0.0, 0.0),
    ]
    for regime, those in ((1, slow), (2, fast)):
        least, after = np.mean([r.turning_energy for r in those], axis=0)
        rows += [
            Row(f"regime {regime}: least energy of the liquid while it turns, over that before, mean", float(least)),
            Row(f"regime {regime}: energy of the liquid after it has turned, over that before, mean", float(after)),
        ]
    return rows


def in_order(result: FilmImpact) -> bool:
    """Whether the bead passes P1 to P4 in this order, towards the plate and away from it."""
    times = result.p1.time < result.p2.time <= result.p3.time < result.p4.time
    return times and result.p2.velocity < 0.0 < result.p4.velocity


def change_of_slope(stokes: np.ndarray, restitution: np.ndarray) -> float:
    """Stokes number of the corner of the two joined lines that fit ln e against ln St best."""
    errors = []
    corners = np.geomspace(1.1 * stokes[0], stokes[-1] / 1.1, 200)
    for corner in corners:
        x = np.log(stokes / corner)
        terms = np.stack([np.ones_like(x), np.minimum(x, 0.0), np.maximum(x, 0.0)], axis=1)
        coefficients = np.linalg.lstsq(terms, np.log(restitution), rcond=None)[0]
        errors.append(float(((terms @ coefficients - np.log(restitution)) ** 2).sum()))
    return float(corners[int(np.argmin(errors))])


def straight(x: np.ndarray, y: np.ndarray) -> float:
    """Coefficient of determination R2 of a straight line."""
    rest = y - np.polyval(np.polyfit(x, y, 1), x)
    return float(1.0 - (rest**2).sum() / ((y - y.mean()) ** 2).sum())


def peaks(result: FilmImpact) -> int:
    """Peaks of the kinetic energy of the liquid, in all steps up to P4."""
    from scipy.signal import find_peaks

    energy = result.history["liquid_kinetic"]
    return len(find_peaks(energy / energy.max(), prominence=PEAK)[0])
