"""A fluidised bed of hot seeds in cold gas, beside balances of both phases."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cfddem.case.schema import Case
from cfddem.features.heat import HeatExchange
from cfddem.run.simulation import Simulation
from scenarios.validation.heat.packed import HEAT
from scenarios.validation.heat.two_phase_balance import Balances, TwoPhaseBalance
from scenarios.validation.table import Curves, Row

SEED = {"density": 1000.0, "youngs_modulus": 1.2e8, "contact_modulus": 1e6, "poisson": 0.3, "friction": 0.1}
LAWS = {"drag": "beetstra", "lubrication": "none", "self_disturbance_correction": False}

INLET, CAPACITY, SPEED = 300.0, 400.0, 1.2
"""Temperature [K] and velocity [m/s] of the cold gas, heat capacity of the hot seeds [J/kg/K]."""


def hot_case() -> Case:
    """3000 seeds of 400 K in gas of 300 K."""
    values: dict[str, Any] = {
        "fluid": {"density": 1.13, "viscosity": 1.68144e-5},
        "material": {
            "seed": SEED | {"restitution": 0.986},
            "wall": {"density": 1000.0, "youngs_modulus": 1.2e8, "contact_modulus": 1e6, "poisson": 0.3},
        },
        "column": {"width": 0.0144, "height": 0.0576, "cell": 0.0024, "material": "wall"},
        "bed": {
            "material": "seed", "diameter": 1.2e-3, "count": 3000, "seed": 1, "start": "suspended",
            "inlet_velocity": SPEED,
        },
        "laws": LAWS | {"heat_transfer": "gunn"},
        "heat": HEAT | {"heat_capacity": {"seed": CAPACITY}},
        "run": {"until": 1.0, "particle_step": 1e-5, "fluid_step": 2e-4, "reference_speed": 2.0},
    }  # fmt: skip
    return Case(**values)


def hot_bed(curves: Curves) -> list[Row]:
    """Hot seeds in cold gas, beside balances of both phases.

    Each balance has one thing less than the one before: bubbles and the place of every seed; its place alone; neither,
    gas that leaves as hot as the mean. The first two are by another route (:mod:`two_phase_balance`).
    """
    simulation = Simulation(hot_case())
    simulation.until(0.1)  # the gas of the start has left
    fluid, particles, heat = simulation.case.fluid, simulation.particles, simulation.feature(HeatExchange)
    assert fluid and heat.cells is not None
    flow = fluid.density * SPEED * simulation.case.column.floor_area * HEAT["fluid_heat_capacity"]
    air = (fluid.density, HEAT["fluid_heat_capacity"], HEAT["conductivity"], fluid.viscosity)
    in_cells, in_layers = (
        TwoPhaseBalance(simulation, air, CAPACITY, INLET, resolution) for resolution in ("cells", "layers")
    )
    simulation.add(Balances([in_cells, in_layers]))
    of_bed = float(heat.capacity(particles).sum())
    begin, first, gas = simulation.time, float(particles.temperature.mean()), heat.cells.content
    left, lines = first, []
    while simulation.time < 1.0:
        simulation.step()
        left -= flow * simulation.last_step * (heat.cells.leaving - INLET) / of_bed
        by_air = left - (heat.cells.content - gas) / of_bed
        mixed = INLET + (first - INLET) * math.exp(-flow / of_bed * (simulation.time - begin))
        mean = float(particles.temperature.mean())
        lines.append((simulation.time, mean, by_air, float(in_cells.hot.mean()), float(in_layers.hot.mean()), mixed))
    names = ("time", "run", "air that leaves", "every cell", "layers", "mixed at once")
    columns = dict(zip(names, np.array(lines).T))
    curves["hot bed"] = {name: (values, "s" if name == "time" else "K") for name, values in columns.items()}
    cooled = first - columns["run"][-1]
    rows = [Row("hot bed in cold gas: cooling of the seeds", cooled, unit="K")]
    for name in names[2:]:
        off = float(np.abs(columns["run"] - columns[name]).max()) / cooled
        limit = None if name == "mixed at once" else 0.02
        rows.append(Row(f"hot bed, balance ({name}): largest difference of the mean over the cooling", off, 0.0, limit))
    spread = float(particles.temperature.std())
    rows.append(Row("hot bed in cold gas: standard deviation of the seeds at the end", spread, unit="K"))
    return [*rows, Row("hot bed in cold gas: imbalance of heat", heat.imbalance, 0.0, 1e-11)]
