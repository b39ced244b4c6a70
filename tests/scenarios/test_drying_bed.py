"""The scenario of the drying bed: rate, plateau and end beside the balance of heat and water."""

from __future__ import annotations

import numpy as np
import pytest

from closures.evaporation import latent_heat
from scenarios.beds.drying_bed import Drying, balance, case, drying


def test_the_balance_is_that_of_saturated_air() -> None:
    """Heat of the air equals the latent heat of what it takes; water dries in its mass over the rate."""
    described = case()
    found = balance(described, water=5e-6, capacity=0.0)
    given = 1010.0 * (400.0 - found.temperature)
    assert given == pytest.approx(latent_heat(found.temperature) * (found.outlet - 0.005), rel=1e-9)
    assert found.rate == pytest.approx(0.95 * 0.7 * 0.0144 * 0.0108 * (found.outlet - 0.005), rel=1e-9)
    assert found.end == pytest.approx(5e-6 / found.rate + 0.025, rel=1e-9)  # the inlet opens within 0.05 s
    warmer = balance(described, water=5e-6, capacity=1.0)
    assert 0.0 < warmer.end - found.end < 0.02


def test_a_bed_is_dry_when_a_hundredth_of_its_water_is_left() -> None:
    time = np.linspace(0.1, 1.0, 10)
    made = Drying(time, np.minimum(time / 0.6, 1.0), *np.ones((4, 10)), 0.0)
    assert made.end == pytest.approx(0.6) and made.mean(time, 0.25, 0.55) == pytest.approx(0.4)


@pytest.mark.slow
def test_the_bed_dries_as_the_balance_says() -> None:
    """Rate against the air that leaves and the balance within 1 %, plateau within 0.3 K; the end comes after that of
    the balance, because the seeds at the floor dry first."""
    found, expected = drying(case())
    rate, by_air = found.mean(found.rate, 0.2, 0.5), found.mean(found.by_air, 0.2, 0.5)
    plateau = found.mean(found.temperature, 0.2, 0.5)
    print(f"rate {rate:.5g}, by the air {by_air:.5g}, balance {expected.rate:.5g} kg/s")
    print(f"plateau {plateau:.2f} K, balance {expected.temperature:.2f} K; end {found.end:.3f}, {expected.end:.3f} s")
    assert rate == pytest.approx(by_air, rel=0.01) and rate == pytest.approx(expected.rate, rel=0.01)
    assert plateau == pytest.approx(expected.temperature, abs=0.3)
    assert 1.0 < found.end / expected.end < 1.4  # bubbles: 1.22; smeared 1.18 to 1.30 in runs that differ in steps
    assert found.imbalance < 1e-9
