"""Statements of the paper in words: order of the moments, suction, two regimes, and peaks of the liquid's energy."""

from __future__ import annotations

import math

import numpy as np

from closures.restitution import singh_crossover
from scenarios.collisions.film_impact.figures import Case
from scenarios.collisions.film_impact.result import FilmImpact
from scenarios.validation.table import Row

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
        found = np.linalg.lstsq(terms, np.log(restitution), rcond=None)[0]
        errors.append(float(((terms @ found - np.log(restitution)) ** 2).sum()))
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
