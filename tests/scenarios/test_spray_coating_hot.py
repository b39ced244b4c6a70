"""The scenario of spray coating in hot air: its cases, and its numbers from a made-up run."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from cfddem.features.evaporation_keys import Evaporation
from cfddem.features.heat_keys import Heat
from cfddem.preflight.summary import preflight
from scenarios.beds.spray_coating_hot import case, coated, moisture


def number(cold: bool, name: str) -> float:
    return next(row.value for row in preflight(case(cold)).rows if row.name == name)


def test_hot_air_can_carry_the_spray_and_cold_air_cannot() -> None:
    assert number(False, "water sprayed / carried") == pytest.approx(0.58, abs=0.01)
    assert number(True, "water sprayed / carried") == pytest.approx(3.5, abs=0.1)
    assert [each.key for each in preflight(case()).to_act_on] == ["heat.solid_conductivity.glass"]
    assert "spray.rate" in [each.key for each in preflight(case(cold=True)).to_act_on]


def test_the_beads_start_at_the_temperature_of_the_balance() -> None:
    """That of air that evaporates the spray, and warms it up."""
    hot = case()
    heat, water, spray = Heat.of(hot), Evaporation.of(hot), hot.spray
    assert heat and water and spray
    flow = number(False, "water that the air can carry") / 0.0183  # of the air, by its drive
    evaporated = spray.rate * water.liquid_density * 2.43e6
    warmed = spray.rate * heat.spray_heat_capacity * (heat.particle_temperature - 298.0)
    balance = (heat.inlet_temperature or 0.0) - (evaporated + warmed) / (flow * heat.fluid_heat_capacity)
    assert balance == pytest.approx(heat.particle_temperature, abs=2.0)


def test_a_bed_of_the_moisture_after_a_time_is_a_short_run() -> None:
    later = case(cold=True, moisture=0.01)
    assert later.liquid is not None and later.liquid.liquid_fraction == 0.01 and later.run.until == 0.8
    assert later.bed == case().bed and later.spray == case().spray


def test_numbers_of_a_run() -> None:
    time, volume = np.linspace(0.0, 2.7, 541), sum(case().volumes.values())
    history = {
        "time": time, "liquid_on_particles": np.full(541, 4e-9), "liquid_in_bridges": np.full(541, 3e-9),
        "evaporated_mass": 1e-5 * time, "liquid_sprayed": 1e-5 * time / 998.0, "mean_temperature": np.full(541, 317.0),
        "granular_temperature": np.full(541, 3e-4), "pressure_drop": np.full(541, 330.0),
        "agglomerated_share": np.full(541, 0.9), "vapour_out": 1e-5 * time, "vapour_in": 0.0 * time,
    }  # fmt: skip
    beads = {"liquid_carried": np.array([0.0, 3e-9, 4e-9]), "temperature": np.array([307.0, 315.0, 325.0])}
    run = SimpleNamespace(
        history=history, case_text=case().to_toml(), averages_from=None, particles=lambda snapshot: beads
    )
    found = coated(run)  # type: ignore[arg-type]
    assert found.wet_share == pytest.approx(2.0 / 3.0) and (found.lowest, found.highest) == (307.0, 325.0)
    assert found.moisture == pytest.approx(7e-9 / volume) == moisture(run)[-1]  # type: ignore[arg-type]
    assert found.evaporated_share == pytest.approx(1.0) and found.rates.rate_constant == pytest.approx(1e-5 / 6.986e-6)
    assert found.carried == pytest.approx(330.0 / 405.5, rel=0.01) and found.joined_share == 0.9
