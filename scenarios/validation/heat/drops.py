"""Drops that evaporate, and one that grows: MFIX, and the suspended drops of Fujita.

Wet bulb and condensation are tests of MFIX, legacy_tests/dem-tests/{evaporation, condensation}, of J. Musser. The drops
of Fujita are those of firemodels/exp, Droplet_Evaporation, with the set-ups of fds, Validation/Droplet_Evaporation. The
column of temperatures at 2.03 m/s in humid air repeats the time there, and is left out.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cfddem.case.schema import Case
from cfddem.features.evaporation_keys import Evaporation
from cfddem.features.heat_keys import Heat
from cfddem.run.simulation import Simulation
from closures.evaporation import (
    dilute_drive,
    latent_heat,
    saturation_pressure,
    stefan_drive,
    vapour_fraction,
    vapour_pressure,
)
from closures.heat_transfer import ranz_marshall
from scenarios.validation.heat.spheres import followed, in_a_stream
from scenarios.validation.table import Curves, Row, worst

ZERO = 273.15

HUMID = {"density": 1.156, "viscosity": 1.844e-5}
OF_HUMID = {"fluid_temperature": 303.15, "conductivity": 0.02532, "fluid_heat_capacity": 1017.0}
"""Air of 30 C with a mass fraction of vapour of 0.013135, by the rules of MFIX."""


def drop(diameter: float, speed: float, until: float, thermal: dict[str, Any], **changes: Any) -> Case:
    """A drop of water that is held in humid air, without drag.

    diameter, speed, until  at the start [m], of the air [m/s], end of the run [s]
    thermal  keys of [heat]
    changes  of the case, with __ for the point
    """
    keys: dict[str, Any] = {
        "fluid": HUMID,
        "material.water": {"density": 958.6, "youngs_modulus": 1e6, "poisson": 0.25},
        "evaporation": {"drops": ["water"], "vapour_fraction": 0.013135, "rate": "dilute"},
    }
    return in_a_stream(diameter, speed, until, {"heat_capacity": {"water": 4180.0}} | thermal, **keys | changes)


def wet_bulb(**changes: Any) -> Case:
    """The drop of MFIX in air of 50 % humidity at 3 m/s."""
    return drop(1e-3, 3.0, 15.0, {"particle_temperature": 303.15, **OF_HUMID}, **changes)


WET_BULB = {0.1: 28.821, 0.5: 25.672, 1.0: 23.694, 2.0: 22.252, 3.0: 21.885, 5.0: 21.765}
PLATEAU = 21.756
"""Temperature in MFIX by time [s], and in the end [C]."""


def condensing(rate: str) -> Case:
    """The cold drop of MFIX in hot humid air, with a law of evaporation."""
    heat = {"fluid_temperature": 353.15, "conductivity": 0.0273, "fluid_heat_capacity": 1300.0}
    gas = {"fluid": {"density": 0.82, "viscosity": 1.9e-5}, "evaporation__vapour_fraction": 0.355484}
    return drop(2.9e-3, 1.91, 4.0, {"particle_temperature": 289.15, **heat}, **gas, evaporation__rate=rate)


CONDENSING = {0.2: 25.491, 0.6: 42.685, 1.0: 56.692, 1.4: 66.832, 2.2: 76.766, 3.0: 79.401, 4.0: 80.020}
"""Temperature in MFIX by time [s], [C]."""

BY_FRACTIONS = "by fractions"
"""Rate of the condensation test of MFIX (usr_rates_des.f): pi d Sh rho D (Y - Y_s)."""


def condensing_balance(rate: str, step: float = 1e-3) -> dict[float, float]:
    """Temperature of the cold drop at the times of `CONDENSING` [C], by a balance of its own, explicit in Python.

    rate  "dilute", "stefan" or `BY_FRACTIONS`
    step  [s]
    """
    case = condensing("dilute")
    heat, keys, fluid = Heat.of(case), Evaporation.of(case), case.required_fluid
    assert heat and keys
    gas, share, speed = heat.fluid_temperature, float(keys.vapour_fraction or 0.0), case.bed.highest_inlet_velocity
    density, capacity = case.material["water"].density, heat.heat_capacity["water"]
    spread = fluid.density * keys.diffusivity_in(case)
    prandtl, schmidt = fluid.viscosity * heat.fluid_heat_capacity / heat.conductivity, fluid.viscosity / spread
    partial, diameter = vapour_pressure(share, keys.pressure), case.bed.largest_diameter
    mass, temperature, by_time = density * math.pi / 6.0 * diameter**3, float(heat.particle_temperature), {}
    for n in range(1, round(max(CONDENSING) / step) + 1):
        saturation = saturation_pressure(temperature)
        surface = vapour_fraction(saturation, keys.pressure)
        drive = {
            "dilute": dilute_drive(saturation, partial, gas, fluid.density),
            "stefan": stefan_drive(surface, share),
            BY_FRACTIONS: surface - share,
        }[rate]
        reynolds = fluid.density * speed * diameter / fluid.viscosity
        lost = step * math.pi * diameter * ranz_marshall(reynolds, schmidt) * spread * drive
        warmed = math.pi * diameter * heat.conductivity * ranz_marshall(reynolds, prandtl) * (gas - temperature)
        temperature += (step * warmed - latent_heat(temperature) * lost) / (mass * capacity)
        mass -= lost
        diameter = (6.0 * mass / (math.pi * density)) ** (1.0 / 3.0)
        by_time[round(n * step, 9)] = temperature - ZERO
    return {time: by_time[time] for time in CONDENSING}


def mfix(curves: Curves) -> list[Row]:
    """A drop that evaporates, and one on which vapour condenses, as in MFIX."""
    drop_at, _ = followed(wet_bulb(), [*WET_BULB, 10.0])
    points = [(time, drop_at[time][0] - ZERO, value) for time, value in WET_BULB.items()]
    rows = [
        worst("drop in air, MFIX: temperature on the way", points, 0.03, unit="degC"),
        Row("drop in air, MFIX: wet bulb", drop_at[10.0][0] - ZERO, PLATEAU, 0.1, "degC"),
    ]
    for rate in ("dilute", "stefan"):
        drop_at, _ = followed(condensing(rate), CONDENSING)
        points = [(time, drop_at[time][0] - ZERO, value) for time, value in CONDENSING.items()]
        rows.append(Row(f"condensation, {rate}, MFIX: temperature at 4 s", *points[-1][1:], 0.3, "degC"))
        note = "MFIX condenses by the difference of mass fractions"
        rows.append(worst(f"condensation, {rate}, MFIX: temperature on the way", points[:-1], unit="degC", note=note))
        expected = condensing_balance(rate)
        points = [(time, drop_at[time][0] - ZERO, expected[time]) for time in CONDENSING]
        rows.append(worst(f"condensation, {rate}, balance: temperature", points, 0.15, unit="degC"))
    points = [(time, value, CONDENSING[time]) for time, value in condensing_balance(BY_FRACTIONS).items()]
    rows.append(worst("balance with the rate of MFIX, MFIX: temperature", points, 0.5, unit="degC"))
    return rows


SHRUNK = {
    (0.813, 0.008059): (0.993, 0.981, 0.969, 0.950, 0.938, 0.920),
    (2.03, 0.008059): (0.986, 0.973, 0.947, 0.934, 0.914, 0.908),
    (0.813, 0.0): (0.980, 0.955, 0.942, 0.924, 0.911, 0.881),
    (2.03, 0.0): (0.974, 0.955, 0.929, 0.916, 0.885, 0.848),
}
"""(d/d0)^2 at `TIMES`, by speed [m/s] and mass fraction of vapour."""

TIMES = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0)
WARM_TIMES = (1.25, 2.5, 3.75, 5.0, 7.5, 10.0, 15.0, 20.0, 30.0)

WARMED = {
    (0.813, 0.008059): (1.17, 1.92, 2.36, 2.61, 2.86, 2.95, 2.99, 3.05, 3.04),
    (0.813, 0.0): (-0.97, -1.48, -1.72, -1.91, -2.14, -2.31, -2.64, -2.78, -2.87),
    (2.03, 0.0): (-0.69, -1.28, -1.72, -1.93, -2.22, -2.40, -2.44, -2.47, -2.44),
}
"""T - T0 at `WARM_TIMES` [K]; in dry air heat through the suspension warms the drop."""


def suspended(speed: float, fraction: float) -> Case:
    """The drop of Fujita in air of 30 C, of a speed [m/s] and a mass fraction of vapour."""
    heat = {"fluid_temperature": 303.15, "conductivity": 0.0264, "fluid_heat_capacity": 1007.0}
    air = {"fluid": {"density": 1.165, "viscosity": 1.86e-5}, "material__water__density": 999.0}
    return drop(
        1.2e-3, speed, 30.0, {"particle_temperature": 288.15, **heat}, **air, run__fluid_step=0.02,
        evaporation__vapour_fraction=fraction, evaporation__rate="stefan",
    )  # fmt: skip


def fujita(curves: Curves) -> list[Row]:
    """Suspended drops, beside the measurements of Fujita."""
    rows = []
    for (speed, fraction), measured in SHRUNK.items():
        simulation, drop_at = Simulation(suspended(speed, fraction)), {}
        for time in sorted({*TIMES, *WARM_TIMES}):
            simulation.until(time)
            size = float(simulation.particles.radius[0] / 0.6e-3) ** 2
            drop_at[time] = size, float(simulation.particles.temperature[0] - 288.15)
        name = f"drop of Fujita, {speed:g} m/s, {'30 %' if fraction else '0 %'} humidity"
        points = [(time, drop_at[time][0], value) for time, value in zip(TIMES, measured)]
        rows.append(worst(f"{name}: (d/d0)^2 up to 25 s", points[:-1], 0.025))
        rows.append(Row(f"{name}: (d/d0)^2 at 30 s", *points[-1][1:], 0.02))
        if (speed, fraction) in WARMED:
            warm = [(time, drop_at[time][1], value) for time, value in zip(WARM_TIMES, WARMED[speed, fraction])]
            note = "" if fraction else "heat through the suspension"
            rows.append(worst(f"{name}: T - T0", warm, 0.5 if fraction else None, unit="K", note=note))
        curves[f"fujita/{speed:g} m per s, vapour {fraction:g}"] = {
            "time": (np.array(sorted(drop_at)), "s"),
            "area": (np.array([drop_at[time][0] for time in sorted(drop_at)]), "-"),
            "warmed": (np.array([drop_at[time][1] for time in sorted(drop_at)]), "K"),
        }
    return rows
