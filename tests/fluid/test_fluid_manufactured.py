"""Manufactured solution: order of the whole solver with moving voidage and drag."""

from __future__ import annotations

from itertools import pairwise

import pytest

from scenarios.references.flows import error, order, rms


@pytest.mark.parametrize("cells", [(16, 32), pytest.param((16, 32, 64), marks=pytest.mark.slow)], ids=str)
@pytest.mark.parametrize("model", ["A", "B"])
def test_manufactured_solution_with_moving_voidage_and_drag_is_second_order(model, cells):
    """Velocity and pressure in L2, grid and step refined together, unlimited scheme: order >= 1.9."""
    velocity, pressure, _ = zip(*(error(n, n // 2, model=model) for n in cells))
    assert min(order(velocity)) > 1.9
    assert min(order(pressure)) > 1.9


@pytest.mark.parametrize("finest", [64, pytest.param(128, marks=pytest.mark.slow)])
def test_manufactured_solution_is_second_order_in_time(finest):
    """Runs on one grid whose steps halve: their differences fall by four."""
    fields = [error(24, steps)[2] for steps in (16, 32, 64, 128) if steps <= finest]
    assert min(order([rms(a - b) for a, b in pairwise(fields)])) > 1.9
