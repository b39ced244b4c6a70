"""Rates of drying from a window of a run, against a bed whose water is known at all times."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from test_heat_check import case_of

from cfddem.analysis.drying import DryingRates, drying_rates
from cfddem.backend.errors import InputError

K, SPRAY, START = 0.5, 2e-6, 1e-6
"""Rate constant [1/s], spray [kg/s] and water at the start [kg]."""


def water(time: np.ndarray) -> np.ndarray:
    return np.asarray(SPRAY / K + (START - SPRAY / K) * np.exp(-K * time))


def made_up(until: float) -> SimpleNamespace:
    """A bed whose surface limits the rate, under a spray."""
    time = np.linspace(0.0, until, 2001)
    liquid = water(time) / 998.0
    history = {
        "time": time, "liquid_on_particles": 0.25 * liquid, "liquid_in_bridges": 0.75 * liquid,
        "evaporated_mass": SPRAY * time + START - water(time), "liquid_sprayed": SPRAY * time / 998.0,
        "mean_temperature": 310.0 + 0.1 * time,
        "vapour_out": 3e-6 + 1.5 * (SPRAY * time + START - water(time)),
        "vapour_in": 0.5 * (SPRAY * time + START - water(time)),
    }  # fmt: skip
    return SimpleNamespace(history=history, case_text=case_of().to_toml(), averages_from=None)


def rates(until: float, begin: float) -> DryingRates:
    return drying_rates(made_up(until), begin)  # type: ignore[arg-type]


def test_rates_of_a_bed_whose_surface_limits_give_its_water_later() -> None:
    found = rates(4.0, 3.0)
    assert found.rate_constant == pytest.approx(K, rel=1e-6) and found.steady_water == pytest.approx(
        SPRAY / K, rel=1e-6
    )
    assert found.by_air == pytest.approx(found.evaporated, rel=1e-9) and found.sprayed == pytest.approx(SPRAY)
    assert found.temperature == pytest.approx(310.35) and found.warming == pytest.approx(0.1)
    for later in (1.0, 10.0, 600.0):
        by_surface, by_air = found.water_after(later)
        assert by_surface == pytest.approx(water(np.array(4.0 + later)), rel=1e-6)
        assert by_air >= by_surface


@pytest.mark.parametrize("water, grows", [(1e-7, True), (1e-4, False)])
def test_the_water_of_a_bed_lies_between_both_answers(water: float, grows: bool) -> None:
    """A bed whose evaporation saturates, E = E_air W/(W + W_half), integrated in small steps."""
    most, half, spray = 4e-6, 1e-6, 2e-6
    found = DryingRates(0.0, 1.0, water, water, most * water / (water + half), spray, math.nan, 300.0, 0.0, 0.0)
    for later in (0.1, 1.0, 5.0):
        true, step = water, 1e-3
        for _ in range(round(later / step)):
            true += step * (spray - most * true / (true + half))
        by_surface, by_air = found.water_after(later)
        assert (by_surface < true < by_air) if grows else (by_air < true < by_surface)


def test_a_window_that_is_not_steady_is_seen_by_its_drift() -> None:
    assert rates(1.0, 0.0).drift > 0.1 and abs(rates(30.0, 20.0).drift) < 1e-3
    steady = rates(30.0, 20.0)
    assert steady.water_after(600.0) == pytest.approx((SPRAY / K, SPRAY / K), rel=3e-3)
    assert "k = 0.5 1/s" in str(steady) and "drift" in str(steady)


def test_times_of_drying_bound_those_of_either_law() -> None:
    shorter, longer = rates(30.0, 20.0).drying_times(0.01)
    assert shorter == pytest.approx(0.99 / K, rel=1e-4) and longer == pytest.approx(math.log(100.0) / K, rel=1e-6)


def test_a_run_without_water_and_a_window_without_rows_are_refused() -> None:
    run = made_up(1.0)
    with pytest.raises(InputError, match="a window with at least 4 rows"):
        drying_rates(run, 5.0)  # type: ignore[arg-type]
    del run.history["evaporated_mass"]
    with pytest.raises(InputError, match=r"evaporated_mass.*needs \[liquid\] and \[evaporation\]"):
        drying_rates(run)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="between 0 and 1"):
        rates(30.0, 20.0).drying_times(0.0)
