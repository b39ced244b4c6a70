"""The rate of the gap after a step with a film: the short solution, and the safe one that it falls back to."""

from __future__ import annotations

import math

import numpy as np
import pytest

from closures.lubrication import film_potential, film_resistance, speed_after_film, speed_after_short_step

STEP, REACH = 1e-6, 1e-3


def states(count: int) -> list[tuple[float, ...]]:
    """Speed, gap, accounted gap, strength per mass and minimum gap: open films, films below h_min, and overlaps."""
    draw = np.random.default_rng(4)
    minimum_gap = 10.0 ** draw.uniform(-9, -6, count)
    gap = minimum_gap * 10.0 ** draw.uniform(-2, 3, count) * np.where(draw.random(count) < 0.8, 1.0, -1.0)
    stiffness = 10.0 ** draw.uniform(-6, 3, count)  # resistance times step over mass
    strength = stiffness * np.maximum(gap, minimum_gap) / STEP
    change = 10.0 ** draw.uniform(-7, -1, count) * draw.choice([-1.0, 1.0], count)
    speed = change * np.abs(gap) / STEP * np.where(draw.random(count) < 0.5, 1.0, 1.0 + stiffness)
    accounted = gap * (1.0 + 0.3 * draw.permutation(change))
    return list(zip(speed, gap, accounted, strength, minimum_gap))


def change_of_potential(gap: float, change: float, minimum_gap: float) -> float:
    """Of a film that stays on one side of h_min, to rounding."""
    if gap > minimum_gap:
        return math.log1p(change / gap)
    start, end = max(gap, 0.0), max(gap + change, 0.0)
    moved = change if start > 0.0 and end > 0.0 else end - start
    return moved * (end + start) / (2.0 * minimum_gap**2)


def test_the_short_solution_satisfies_its_equation() -> None:
    """To rounding, wherever it is not NaN; it is NaN for few of these."""
    known = 0
    for speed, gap, accounted, strength, minimum_gap in states(4000):
        rate = speed_after_short_step(speed, gap, accounted, STEP, strength, minimum_gap, REACH)
        if math.isnan(rate):
            continue
        known += 1
        left = rate - speed + strength * change_of_potential(accounted, gap - accounted + STEP * rate, minimum_gap)
        slope = 1.0 + STEP * film_resistance(strength, gap, minimum_gap, REACH)
        assert abs(left) < 2e-14 * slope * (abs(speed) + abs(rate)), (speed, gap, accounted, strength, minimum_gap)
    assert known > 3000


@pytest.mark.parametrize("end", ["beyond the reach", "through h_min", "through contact"])
def test_large_changes_are_left_to_the_safe_solution(end: str) -> None:
    speed, gap, minimum_gap = {
        "beyond the reach": (1.0, REACH - 5e-7, 1e-7),
        "through h_min": (-0.1, 1.05e-7, 1e-7),
        "through contact": (-0.1, 0.5e-7, 1e-7),
    }[end]
    arguments = (speed, gap, gap, STEP, 1e-9, minimum_gap, REACH)
    assert math.isnan(speed_after_short_step(*arguments))
    rate = speed_after_film(*arguments)
    moved = film_potential(gap + STEP * rate, minimum_gap, REACH) - film_potential(gap, minimum_gap, REACH)
    assert rate - speed == pytest.approx(-1e-9 * moved, abs=1e-15)
