"""Evaporation of drops and of films on particles; the how-to page is docs/how-to/contact-heat.md."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.features.evaporation import EvaporationOfLiquid
from cfddem.features.evaporation_keys import Evaporation
from cfddem.features.heat import HeatExchange
from cfddem.preflight.summary import preflight
from cfddem.run.history import row
from cfddem.run.simulation import Simulation
from closures.evaporation import saturation_pressure, vapour_fraction, vapour_pressure
from scenarios.validation.heat.drops import OF_HUMID, ZERO, condensing, drop, fujita, mfix, wet_bulb
from scenarios.validation.table import Row


def failed(rows: list[Row]) -> list[Row]:
    """Rows whose limit does not hold."""
    return [each for each in rows if each.verdict == "FAILS"]


def test_drops_come_to_the_wet_bulb_and_condense_as_in_mfix() -> None:
    """On the way to condensation the laws differ: MFIX takes a difference of mass fractions. A balance that does so
    follows it."""
    rows = mfix({})
    off = {each.quantity: abs(each.difference or 0.0) for each in rows if each.limit is None}
    assert len(rows) == 9 and not failed(rows), failed(rows)
    assert len(off) == 2 and all(each < (1.6 if "dilute" in name else 6.9) for name, each in off.items()), off


def test_vapour_that_condenses_makes_the_drop_grow() -> None:
    simulation = Simulation(condensing("dilute"))
    simulation.until(1.0)
    assert simulation.particles.radius[0] > 1.45e-3 and row(simulation)["evaporated_mass"] < 0.0


@pytest.mark.slow
def test_suspended_drops_shrink_as_measured_by_fujita() -> None:
    rows = fujita({})
    assert len(rows) == 11 and not failed(rows), failed(rows)


def test_a_step_far_too_long_ends_at_the_wet_bulb_temperature_of_the_balance() -> None:
    simulation = Simulation(wet_bulb(evaporation__rate="stefan"))
    simulation.step()
    keys = Evaporation.of(simulation.case)
    assert keys is not None
    for _ in range(2):
        for kind in (HeatExchange, EvaporationOfLiquid):
            simulation.feature(kind).before(simulation, 60.0)
    assert simulation.particles.temperature[0] == pytest.approx(keys.wet_bulb(simulation.case), abs=0.01)


def test_a_drop_in_cells_of_their_own_temperature_cools_them_and_comes_to_the_wet_bulb() -> None:
    simulation = Simulation(wet_bulb(heat__fluid="cells"))
    simulation.until(6.0)
    assert simulation.particles.temperature[0] - ZERO == pytest.approx(21.756, abs=0.1)
    now = row(simulation)
    # 0.06 m3 of air hold 23 kJ above absolute zero, of which the drop takes some joules: round-off is 1e-10 of these
    assert now["fluid_temperature"] < 303.15 and now["heat_imbalance"] < 1e-9
    gained = simulation.particles.mass[0] * 4180.0 * (simulation.particles.temperature[0] - 303.15)
    assert now["heat_received"] == pytest.approx(now["latent_heat_taken"] + gained, rel=0.02)  # the drop has shrunk


def test_what_a_drop_loses_is_what_evaporated_and_a_drop_that_is_gone_warms_up() -> None:
    simulation = Simulation(wet_bulb())
    before = float(simulation.particles.mass[0])
    for _ in range(50):
        simulation.step()
    assert before - simulation.particles.mass[0] == pytest.approx(row(simulation)["evaporated_mass"], rel=1e-9)
    for kind in (HeatExchange, EvaporationOfLiquid):
        simulation.feature(kind).before(simulation, 1e5)
    assert simulation.particles.radius[0] == pytest.approx(1e-6, rel=1e-3)
    assert row(simulation)["evaporated_mass"] == pytest.approx(before, rel=1e-6)


def test_a_checkpoint_continues_with_the_same_bits() -> None:
    simulation = Simulation(wet_bulb())
    simulation.step()
    again = Simulation.restored(simulation.case, simulation.checkpoint())
    for each in (simulation, again):
        each.step()
    assert row(again) == row(simulation) and {"evaporated_mass", "latent_heat_taken"} <= row(again).keys()
    assert np.array_equal(again.particles.radius, simulation.particles.radius)


LIQUID = {
    "viscosity": 1e-3, "surface_tension": 0.072, "thickness": 5e-6, "pull": "pendular", "film": "none",
    "tangential": "none",
}  # fmt: skip
"""The loops of its bridges are those of `test_evaporating_bridges`."""


def wet_bead(**changes: Any) -> Case:
    """A glass bead with a film of water of 5 um in the same air."""
    heat = {"particle_temperature": 303.15, "heat_capacity": {"glass": 840.0}, **OF_HUMID}
    glass = {"density": 2500.0, "youngs_modulus": 1e8, "poisson": 0.25, "friction": 0.3}
    return drop(
        1e-3, 3.0, 15.0, heat,
        **({"material": {"glass": glass}, "liquid": LIQUID, "evaporation__drops": []} | changes),
    )  # fmt: skip


def test_a_film_dries_at_a_constant_rate_and_the_dry_bead_takes_the_temperature_of_the_gas() -> None:
    """The time of drying is that of the film at the rate of the wet-bulb plateau, within 2 %."""
    simulation = Simulation(wet_bead())
    film = float(simulation.particles.liquid[0])
    simulation.until(5.0)
    middle, mass = simulation.particles.temperature[0], row(simulation)["evaporated_mass"]
    assert middle - ZERO == pytest.approx(21.756, abs=0.1)
    simulation.until(6.0)
    rate = row(simulation)["evaporated_mass"] - mass
    expected = 6.0 + (998.0 * simulation.particles.liquid[0]) / rate
    while simulation.particles.liquid[0] > 0.0:
        simulation.step()
    assert simulation.time == pytest.approx(expected, rel=0.02)
    assert row(simulation)["evaporated_mass"] == pytest.approx(998.0 * film, rel=1e-9)
    assert row(simulation)["liquid_imbalance"] < 1e-12
    simulation.until(simulation.time + 15.0)
    assert simulation.particles.temperature[0] == pytest.approx(303.15, abs=0.05)


def test_a_film_thinner_than_the_full_thickness_evaporates_in_proportion() -> None:
    def rate(thickness: float) -> float:
        simulation = Simulation(wet_bead(evaporation__full_thickness=thickness))
        simulation.step()
        return row(simulation)["evaporated_mass"]

    full = rate(0.0)
    assert rate(4e-6) == pytest.approx(full, rel=1e-9)
    assert rate(1e-5) == pytest.approx(0.5 * full, rel=0.03)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"heat": None}, "evaporation.*without [heat]"),
        ({"evaporation__drops": []}, "evaporation.*without [liquid]"),
        ({"evaporation__drops": ["watr"]}, "evaporation.drops"),
        ({"evaporation__vapour_fraction": 0.1}, "evaporation.vapour_fraction = 0.1: must be at most saturated"),
        ({"evaporation__vapour_fraction": None, "evaporation__relative_humidity": 1.2}, "relative_humidity = 1.2"),
        ({"evaporation__relative_humidity": 0.2}, "found both"),
        ({"heat__fluid_temperature": 20.0}, "20.0: must be 253 to 640 K.*mean 293 K (20 °C)?"),
        ({"heat__fluid_total_capacity": 20.0}, "heat.fluid_total_capacity"),
    ],
)
def test_wrong_input_is_refused_in_one_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message).replace(r"\.\*", ".*")) as failure:
        wet_bulb(**changes)
    assert len(str(failure.value).splitlines()) == 1


def test_check_tells_the_wet_bulb_temperature() -> None:
    told = [each.reason for each in preflight(wet_bulb()).issues if each.key == "evaporation"]
    assert told == ["the wet-bulb temperature is 294.85 K at 3 m/s"]


def test_humidity_is_a_fraction_of_mass_or_relative_to_saturation() -> None:
    half = wet_bulb(evaporation__vapour_fraction=None, evaporation__relative_humidity=0.5)
    keys = Evaporation.of(half)
    assert keys is not None
    saturated = saturation_pressure(303.15)
    assert keys.partial_pressure(half) == pytest.approx(0.5 * saturated)
    assert vapour_pressure(vapour_fraction(0.5 * saturated, 101325.0), 101325.0) == pytest.approx(0.5 * saturated)
