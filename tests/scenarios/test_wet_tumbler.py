"""Stirred wet spheres: conservation, and growth of agglomerates."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from scenarios.collisions.wet_tumbler import tumble


@pytest.mark.slow
def test_stirred_spheres_conserve_momentum_number_and_liquid() -> None:
    result = tumble(0.05, 150, until=0.03, samples=10)
    assert result.momentum_error < 1e-12
    assert result.liquid_error < 1e-12
    assert result.spheres == 150
    assert result.formed > 50
    assert result.run.bridges is not None
    assert result.formed - result.broken == result.run.bridges.count
    assert result.mean_size[-1] > 1.3


@pytest.mark.slow
def test_the_same_seed_gives_the_same_run() -> None:
    one, other = (tumble(0.05, 60, until=0.004, samples=2) for _ in range(2))
    assert np.array_equal(one.run.particles.position, other.run.particles.position)


@pytest.mark.parametrize(
    "given", [{"capillary_number": 0.0}, {"until": math.nan}, {"film_spread": 1.0}, {"film": -1.0}]
)
def test_an_impossible_tumbler_is_refused_by_name(given: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(given))):
        tumble(**({"count": 50} | given))  # type: ignore[arg-type]


@pytest.mark.slow
def test_agglomerates_grow_as_the_capillary_number_falls() -> None:
    results = [tumble(number, 500, until=0.15) for number in (0.3, 0.05, 0.01)]
    sizes = [result.late(result.mean_size) for result in results]
    assert sizes[1] > 1.3 * sizes[0]
    assert sizes[2] > 1.3 * sizes[1]
