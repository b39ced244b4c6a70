"""One and two spheres beside exact solutions of their heat, all by keys of a case.

The tests of MFIX, legacy_tests/dem-tests/{convection, contact-conduction, particle-fluid-particle-conduction,
radiation}, of J. Musser. Their exact solutions are those of the files usr2_des.f, their inputs in calories and
centimetres.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from cfddem.case.schema import Case
from cfddem.run.history import row
from cfddem.run.simulation import Simulation
from scenarios.validation.table import Curves, Row, worst

CALORIE = 4.1868
CALORIES = CALORIE * 100.0
"""cal/s/cm/K in W/m/K."""

COLD, HOT = 298.15, 453.15
RADII = 3.3e-3
"""Sum of the radii of the two spheres [m]."""

SHARE = 1e-3
"""Limit over the difference of temperature at the start [-]."""

HEAT: dict[str, Any] = {
    "held": True,
    "particle_temperature": {"cold": COLD, "hot": HOT},
    "conductivity": {"light": 0.131453 * CALORIES, "heavy": 0.002008 * CALORIES},
    "heat_capacity": {"light": 0.191204 * CALORIE * 1e3, "heavy": 0.013145 * CALORIE * 1e3},
}
"""Of the two spheres."""

GAS = 1.239e-4 * CALORIES
"""Conductivity of the gas in the gap [W/m/K]."""


def with_changes(values: dict[str, Any], changes: dict[str, Any]) -> Case:
    """The case of some values by dotted names; names of changes have __ for the point."""
    return Case.from_text("", overrides=values | {name.replace("__", "."): value for name, value in changes.items()})


def in_a_stream(diameter: float, speed: float, until: float, thermal: dict[str, Any], **changes: Any) -> Case:
    """A sphere that is held in a stream, without drag.

    diameter, speed, until  of the sphere [m], of the stream [m/s], end of the run [s]
    thermal  keys of [heat]
    changes  of the case, with __ for the point
    """
    values: dict[str, Any] = {
        "column": {"width": 0.4, "height": 0.4, "cell": 0.1, "sides": "free_slip"},
        "bed": {"diameter": diameter, "positions": [(0.2, 0.2, 0.2)], "fixed": True, "inlet_velocity": speed},
        "laws": {"drag": None, "gravity": (0.0, 0.0, 0.0), "lubrication": "none"},
        "run": {"until": until, "reference_speed": speed, "fluid_step": 0.01},
        "heat": thermal,
    }
    return with_changes(values, changes)


SPHERE: dict[str, Any] = {
    "particle_temperature": 373.15,
    "fluid_temperature": 298.15,
    "conductivity": 1.2396e-4 * CALORIES,
    "fluid_heat_capacity": 0.23878 * CALORIE * 1e3,
    "heat_capacity": {"metal": 0.013145 * CALORIE * 1e3},
}
"""Keys of [heat] of the test of convection."""


def cooling() -> Case:
    """The sphere of the test of convection."""
    metal = {"density": 8850.0, "youngs_modulus": 1e6, "poisson": 0.25, "friction": 0.3}
    air = {"density": 1.1854, "viscosity": 1.8603e-5}
    return in_a_stream(3.6e-3, 6.0, 6.0, SPHERE, fluid=air, material__metal=metal)


COOLED = {0.5: 346.4858, 1.0: 329.3013, 2.0: 311.0888, 3.0: 303.5241, 5.0: 299.0771}
"""Temperature of the exact solution of convection by time [s], [K]."""


def two_spheres(gap: float, step: float, until: float, contacts: dict[str, Any] | None = None, **changes: Any) -> Case:
    """Two spheres in vacuum beside each other.

    gap, step, until  between the surfaces [m], of the heat and end of the run [s]
    contacts  keys of [contact_heat] beside `HEAT`
    changes   of the case, with __ for the point
    """
    values: dict[str, Any] = {
        "material.light": {"density": 420.0, "youngs_modulus": 1e7, "poisson": 0.25},
        "material.heavy": {"density": 8850.0, "youngs_modulus": 1e7, "poisson": 0.25},
        "column": {"width": 0.045, "depth": 0.02, "height": 0.0108, "cell": (0.015, 0.01, 0.0108)},
        "bed": {
            "species": {
                "cold": {"material": "light", "diameter": 3e-3, "count": 1},
                "hot": {"material": "heavy", "diameter": 3.6e-3, "count": 1},
            },
            "positions": [(0.005, 0.005, 0.005), (0.005 + RADII + gap, 0.005, 0.005)],
        },
        "laws": {"gravity": (0.0, 0.0, 0.0)},
        "run": {"until": until, "fluid_step": step, "reference_speed": 0.1},
        "contact_heat": HEAT | (contacts or {}),
    }
    return with_changes(values, changes)


EXACT: dict[str, tuple[dict[str, Any], dict[float, float], dict[float, float]]] = {
    "contact": (
        {"radius": "overlap_circle"},
        {1.0: 299.73199, 10.0: 312.99221, 100.0: 382.62917, 500.0: 408.82180},
        {1.0: 452.51802, 100.0: 419.40198, 500.0: 408.93846},
    ),
    "gap": (
        {"contact": "none", "gap": "lens", "gas_conductivity": GAS},
        {1.0: 304.19589, 10.0: 345.72254, 100.0: 408.50084},
        {10.0: 434.14556},
    ),
    "radiation": (
        {
            "contact": "none",
            "emissivity": {"light": 0.8, "heavy": 0.8},
            "surroundings_temperature": 400.0,
            "surroundings": "local",
        },
        {1.0: 302.74482, 10.0: 338.06780, 50.0: 394.96504},
        {1.0: 450.58386, 10.0: 432.95174},
    ),
}
"""Keys, and exact temperatures of the cold and the hot sphere by time [s], [K]."""

SETUP = {"contact": (-1.33e-7, 0.25), "gap": (1.8e-4, 0.02), "radiation": (1.2e-3, 0.02)}
"""Gap [m] and step [s]. The cell that both spheres see by radiation is 15 x 10 x 3.6 mm, as in MFIX."""

FLAT = {
    "column__height": 0.0036,
    "column__cell": (0.015, 0.01, 0.0036),
    "bed__positions": [(0.004, 0.005, 0.0018), (0.0095, 0.005, 0.0018)],
}


def followed(case: Case, times: Iterable[float]) -> tuple[dict[float, list[float]], dict[str, float]]:
    """Temperatures of the spheres of a case by time [s], [K], and the last row of its history."""
    simulation, by_time = Simulation(case), {}
    for time in sorted(times):
        simulation.until(time)
        by_time[time] = simulation.particles.temperature.tolist()
    return by_time, row(simulation)


def exact_cases(curves: Curves, latest: float = math.inf) -> list[Row]:
    """One sphere in a stream, and two spheres, beside exact solutions.

    latest  end of the comparison [s]
    """

    def until_latest(by_time: dict[float, float]) -> dict[float, float]:
        return {time: value for time, value in by_time.items() if time <= latest}

    by_time, now = followed(cooling(), cooled := until_latest(COOLED))
    lost = [now["heat_imbalance"]]
    points = [(time, by_time[time][0], value) for time, value in cooled.items()]
    rows = [worst("sphere that air cools, exact: temperature", points, SHARE * 75.0, unit="K")]
    for name, (keys, *exact) in EXACT.items():
        (gap, step), (cold, hot) = SETUP[name], map(until_latest, exact)
        case = two_spheres(gap, step, 500.0, keys, **(FLAT if name == "radiation" else {}))
        by_time, now = followed(case, {*cold, *hot})
        lost.append(now["contact_heat_imbalance"])
        points = [(time, by_time[time][0], value) for time, value in cold.items()]
        points += [(time, by_time[time][1], value) for time, value in hot.items()]
        rows.append(worst(f"two spheres, {name}, exact: temperature", points, SHARE * (HOT - COLD), unit="K"))
    return [*rows, Row("one and two spheres: largest imbalance of heat (4)", max(lost), 0.0, 1e-12)]
