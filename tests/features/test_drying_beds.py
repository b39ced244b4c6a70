"""A wet bed that liquid bridges hold still fluidises again when it has dried; with solid bonds it stays still."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem.case.schema import Case
from cfddem.run.history import row
from cfddem.run.simulation import Simulation

BED = """
[fluid]
density = 1.0
viscosity = 2.08e-5

[material.seed]
density = 1000.0
youngs_modulus = 1.2e8
contact_modulus = 1.0e6
poisson = 0.3
restitution = 0.9
friction = 0.1
roughness = 1e-6

[column]
width = 0.0144
depth = 0.0108
height = 0.0432
cell = 0.0036
sides = "free_slip"

[bed]
diameter = 1.2e-3
count = 1500
seed = 2
start = "poured"
inlet_velocity = [[0.0, 0.0], [0.05, 0.8]]

[liquid]
viscosity = 1e-3
surface_tension = 0.06
liquid_fraction = 1e-4

[heat]
heat_capacity = {seed = 2000.0}
particle_temperature = 350.0
fluid_temperature = 350.0
fluid_heat_capacity = 1010.0
conductivity = 0.03

[evaporation]
vapour_fraction = 0.0

[laws]
drag = "beetstra"
lubrication = "none"
self_disturbance_correction = false

[run]
until = 0.5
particle_step = 1e-5
reference_speed = 0.3
"""
BOND = {"solid_fraction": 0.1, "youngs_modulus": 2e6, "tensile_strength": 1e6}


def history(case: Case, every: float = 0.02) -> dict[str, np.ndarray]:
    """Rows of the history of a bed."""
    simulation, rows = Simulation(case), []
    while simulation.time < case.run.until - 1e-9:
        simulation.until(simulation.time + every)
        rows.append(row(simulation))
    return {name: np.array([each[name] for each in rows]) for name in rows[0]}


@pytest.mark.slow
def test_a_dried_bed_fluidises_again_and_with_bonds_it_does_not() -> None:
    """2.5 times minimum fluidisation: still while wet; in motion once dry, and one piece that does not with bonds."""
    case, found = Case.from_text(BED), {}
    for name, changes in {"breaks": {}, "bonds": {"liquid.bond": BOND}}.items():
        found[name] = history(case.with_(**changes))
        time, motion = found[name]["time"], found[name]["granular_temperature"]
        wet, dry = (time > 0.1) & (time < 0.25), time > 0.4
        print(name, f"wet {motion[wet].max():.2g}, dry {motion[dry].mean():.2g} m2/s2")
        assert motion[wet].max() < 1e-6 and found[name]["largest_agglomerate"][wet].min() > 1400
        assert found[name]["liquid_imbalance"].max() < 1e-12
    dry, bonded = (found[name]["granular_temperature"][-5:].mean() for name in ("breaks", "bonds"))
    assert dry > 5e-4 and bonded < 0.02 * dry
    assert found["breaks"]["largest_agglomerate"][-1] < 50 < 1400 < found["bonds"]["largest_agglomerate"][-1]
    assert found["bonds"]["bond_count"][-1] > 3000
