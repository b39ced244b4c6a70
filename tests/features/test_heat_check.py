"""What `check` says about heat and drying: numbers, times, what the air can carry, and bad input in one line."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.preflight.summary import preflight
from closures.heat_transfer import ranz_marshall


def case_of(**changes: Any) -> Case:
    """Wet glass beads in hot air under a spray; changes with __ for the point, None for a table that is left out."""
    values: dict[str, Any] = {
        "fluid": {"density": 1.0, "viscosity": 2e-5},
        "material.glass": {"density": 2500.0, "youngs_modulus": 1e8, "contact_modulus": 1e7, "poisson": 0.25},
        "column": {"width": 0.02, "height": 0.06, "cell": 0.005},
        "bed": {"diameter": 1e-3, "count": 5000, "inlet_velocity": 0.9},
        "liquid": {"viscosity": 1e-3, "surface_tension": 0.07, "thickness": 1e-6},
        "spray": {
            "rate": 1e-10, "drop_volume": 5e-14, "zone": "box", "corner": (0.0, 0.0, 0.01), "size": (0.02, 0.02, 0.01),
        },
        "heat": {
            "particle_temperature": 300.0, "fluid_temperature": 350.0, "conductivity": 0.028,
            "fluid_heat_capacity": 1000.0, "heat_capacity": {"glass": 840.0},
        },
        "vapour": {"diffusivity": 2.6e-5},
        "evaporation": {},
        "run": {"until": 1.0},
    }  # fmt: skip
    for name, value in changes.items():
        if value is None:
            del values[name]
        else:
            values[name.replace("__", ".")] = value
    return Case.from_text("", overrides=values)


def numbers(case: Case) -> dict[str, float]:
    """Rows on heat and drying by name."""
    return {row.name: row.value for row in preflight(case).rows if row.group == "heat and drying"}


def test_numbers_and_times_of_heat_are_those_of_their_definitions() -> None:
    found = numbers(case_of(heat__solid_conductivity={"glass": 1.0}))
    reynolds, prandtl = 1.0 * 0.9 * 1e-3 / 2e-5, 2e-5 * 1000.0 / 0.028
    nusselt = ranz_marshall(reynolds, prandtl, 0.42)
    assert found["Pr"] == pytest.approx(prandtl) and found["Pe"] == pytest.approx(reynolds * prandtl)
    assert found["Nu"] == pytest.approx(nusselt, rel=0.02)
    assert found["Bi"] == pytest.approx(found["Nu"] * 0.028 / 6.0)
    sphere = math.pi / 6.0 * 1e-9
    conductance = found["Nu"] * 0.028 / 1e-3 * math.pi * 1e-6
    assert found["heating time of a particle"] == pytest.approx(2500.0 * sphere * 840.0 / conductance)
    inflow = 1.0 * 0.9 * 4e-4
    assert found["heating time of the bed"] == pytest.approx(5000 * 2500.0 * sphere * 840.0 / (inflow * 1000.0))
    assert found["Le"] == pytest.approx(0.028 / (1000.0 * 2.6e-5))


def test_water_that_the_air_carries_takes_the_heat_by_which_it_cools() -> None:
    """Adiabatic saturation of dry air of 350 K: a psychrometric chart gives 29 C and 0.0208 kg/kg at sea level, where
    the vapour warms up, too; here the heat capacity is that of the fluid of the case."""
    found = numbers(case_of())
    inflow = 1.0 * 0.9 * 4e-4
    per_air = found["water that the air can carry"] / inflow
    assert per_air == pytest.approx(0.0208, rel=0.06)
    saturated = float(
        re.search(r"saturated at (\S+) K", next(r.note for r in preflight(case_of()).rows if "carry" in r.name))[1]  # type: ignore[index]
    )
    assert 1000.0 * (350.0 - saturated) == pytest.approx(per_air * 2.43e6, rel=0.03)
    assert found["wet bulb"] == pytest.approx(saturated, abs=3.0)
    water = 5000 * 998.0 * math.pi * 1.003e-6 * 1e-6
    reached = found["part of it when all is wet"]
    assert found["drying time"] == pytest.approx(water / (found["water that the air can carry"] * reached), rel=1e-3)


def test_what_leaves_no_bond_is_told() -> None:
    bond = {"solid_fraction": 0.1, "youngs_modulus": 2e6, "tensile_strength": 1e6}
    (found,) = (each for each in preflight(case_of(liquid__bond=bond)).issues if each.key == "liquid.bond")
    assert found.severity == "note" and "bridges at walls" in found.reason
    assert not [each for each in preflight(case_of()).issues if each.key == "liquid.bond"]


@pytest.mark.parametrize(("share", "severity"), [(0.5, None), (0.9, "note"), (1.2, "warning")])
def test_a_spray_that_the_air_cannot_carry_is_told_with_the_rate_that_it_can(share: float, severity: str) -> None:
    most = numbers(case_of())["water that the air can carry"] / 998.0
    found = [each for each in preflight(case_of(spray__rate=share * most)).issues if "carry" in each.reason]
    assert [each.severity for each in found] == ([severity] if severity else [])
    if severity:
        enough = float(re.search(r"below (\S+) m3/s", found[0].remedy)[1])  # type: ignore[index]
        again = preflight(case_of(spray__rate=0.98 * enough)).issues
        assert enough == pytest.approx(0.8 * most, rel=0.05) and not [each for each in again if "carry" in each.reason]


def test_a_gas_that_keeps_its_humidity_in_a_wet_bed_is_told() -> None:
    case = case_of(vapour=None, evaporation={"relative_humidity": 0.01})
    (found,) = (each for each in preflight(case).to_act_on if each.key == "evaporation")
    assert "way to saturation" in found.reason and "[vapour]" in found.remedy


def test_a_solid_that_conducts_badly_is_warned_of_and_one_of_unknown_conductivity_is_named() -> None:
    warnings = preflight(case_of(heat__solid_conductivity={"glass": 0.05})).to_act_on
    (found,) = (each for each in warnings if each.key == "heat.solid_conductivity.glass")
    assert "the limit is 0.1" in found.reason
    (row,) = (row for row in preflight(case_of()).rows if row.name == "Bi")
    assert math.isnan(row.value) and "heat.solid_conductivity" in row.note
    contacts = case_of(contact_heat={"conductivity": {"glass": 0.04}})
    assert [each for each in preflight(contacts).to_act_on if each.key == "contact_heat.conductivity.glass"]
    assert numbers(contacts)["Bi"] == pytest.approx(numbers(contacts)["Nu"] * 0.028 / (6.0 * 0.04))


def test_a_heat_capacity_in_kilojoules_is_asked_about() -> None:
    case = case_of(heat__fluid_heat_capacity=1.01, heat__heat_capacity={"glass": 0.84})
    found = {each.key: each.remedy for each in preflight(case).to_act_on}
    assert "did you mean 1010 J/kg/K" in found["heat.fluid_heat_capacity"]
    assert "did you mean 840 J/kg/K" in found["heat.heat_capacity.glass"]
    assert not [each for each in preflight(case_of()).to_act_on if "heat_capacity" in each.key]


PATCH = {"patch__jet": {"kind": "inlet", "shape": "disc", "diameter": 0.01, "velocity": 0.9}}
"""An inlet with a name."""


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"heat__fluid_temperature": -3.0}, r"heat.fluid_temperature.*absolute zero.*273.15"),
        ({"heat__inlet_temperature": -3.0}, r"heat.inlet_temperature.*absolute zero.*273.15"),
        ({"heat__wall_temperature": {"sides": -3.0}}, r"heat.wall_temperature.sides.*absolute zero.*273.15"),
        ({"contact_heat": {"wall": {"floor": {"temperature": -3.0}}}}, r"wall.floor.temperature.*absolute zero"),
        ({"heat__heat_capacity": {"glass": -1.0}}, r"heat.heat_capacity.glass.*above 0; .*J/kg/K"),
        ({"heat__fluid_heat_capacity": -1.0}, r"heat.fluid_heat_capacity.*above 0; .*J/kg/K"),
        ({"heat__spray_temperature": 290.0, "spray": None}, r"heat.spray_temperature.*left out without \[spray\]; add"),
        ({"heat": None}, r"(evaporation|vapour): must be left out without \[heat\]; add"),
        ({"heat": None, "evaporation": None}, r"vapour: must be left out without \[heat\]; add"),
        ({"vapour__inlet_fraction": 0.5}, r"vapour.inlet_fraction.*at most saturated; .*at 350 K is 0.30"),
        (
            {"vapour__fluid_fraction": 0.5, "vapour__inlet_fraction": 0.0},
            r"vapour.fluid_fraction.*at most saturated; .*at 350 K is 0.30",
        ),
        ({"heat__fluid_temperature": 60.0}, r"heat.fluid_temperature.*253 to 640 K"),
        ({"heat__particle_temperature": 40.0}, r"heat.particle_temperature.*253 to 640 K"),
        ({"heat__spray_temperature": 20.0}, r"heat.spray_temperature.*253 to 640 K"),
        ({"heat__inlet_temperature": 700.0}, r"heat.inlet_temperature.*253 to 640 K"),
        (
            PATCH | {"vapour__patch_fraction": {"jet": 0.4}},
            r"vapour.patch_fraction.jet.*at most saturated; .*at 350 K is 0.30",
        ),
        (
            PATCH | {"vapour__inlet_fraction": 0.2, "heat__patch_temperature": {"jet": 310.0}},
            r"heat.patch_temperature.jet = 310.0: .*at most saturated; vapour.inlet_fraction = 0.2, .*at 310 K is 0.03",
        ),
        (
            PATCH | {"vapour__fluid_fraction": 0.2, "heat__patch_temperature": {"jet": 310.0}},
            r"heat.patch_temperature.jet = 310.0: .*at most saturated; vapour.fluid_fraction = 0.2, .*at 310 K is 0.03",
        ),
        (
            {"vapour__fluid_fraction": 0.2, "heat__inlet_temperature": 310.0},
            r"vapour.fluid_fraction = 0.2: .*at most saturated; .*at 310 K is 0.03",
        ),
        (
            {"heat__outlet_temperature": 310.0, "vapour__outlet_fraction": 0.2},
            r"vapour.outlet_fraction = 0.2: .*at most saturated; .*at 310 K is 0.03",
        ),
        ({"heat__outlet_temperature": 60.0}, r"heat.outlet_temperature.*253 to 640 K"),
        (PATCH | {"heat__patch_temperature": {"jet": 60.0}}, r"heat.patch_temperature.jet.*253 to 640 K"),
    ],
)
def test_impossible_heat_and_humidity_are_refused_in_one_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as failure:
        case_of(**changes)
    assert len(str(failure.value).splitlines()) == 1
