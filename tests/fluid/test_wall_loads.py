"""Force and torque of fluid and particles on walls, against balances of momentum, and weights."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.special import jn_zeros

from cfddem.case.schema import Case
from cfddem.fluid.conditions import FreeSlip, Inlet, NoSlip, Outlet, Periodic
from cfddem.fluid.cut_cells import within
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver, Scheme
from cfddem.fluid.surfaces import cylinder, turned
from cfddem.fluid.wall_force import SMOOTH, loads_on_walls, pressure_fall
from cfddem.run.history import all_columns, pressure_drop, row, wall_load
from cfddem.run.simulation import Simulation


def test_a_sliding_lid_drags_the_floor_by_mu_u_over_h() -> None:
    sides = {"x_low": Periodic(), "x_high": Periodic(), "y_low": FreeSlip(), "y_high": FreeSlip()}
    fluid = FluidSolver(
        Grid((4, 1, 8), (0.01,) * 3), sides | {"z_high": NoSlip((0.2, 0.0, 0.0))}, density=1.0, viscosity=0.1
    )
    fluid.run_until(0.1, largest=1e-3)  # 15 times the slowest decay, h^2/(pi^2 nu)
    loads, exact = loads_on_walls(fluid, np.zeros(3)), 0.1 * 0.2 / 0.08 * 4e-4
    assert loads["z_low"][0][0] == pytest.approx(exact, rel=1e-6)
    assert loads["z_high"][0][0] == pytest.approx(-exact, rel=1e-6)
    assert loads["z_high"][1][1] == pytest.approx(-0.08 * exact, rel=1e-6)  # about y
    assert loads["y_low"][0][1] == pytest.approx(0.0, abs=1e-12)


def test_walls_of_a_channel_carry_what_the_pressure_drives() -> None:
    """The momentum balance of steady flow, to the end of its start-up."""
    fluid = FluidSolver(
        Grid((2, 12, 10), (0.01,) * 3), {"x_low": Periodic(3.0), "x_high": Periodic(3.0)}, density=1.0, viscosity=0.5
    )
    fluid.run_until(0.02, largest=1e-3)  # 17 times the slowest decay
    loads = loads_on_walls(fluid, np.zeros(3))
    carried = sum(loads[name][0][0] for name in ("y_low", "y_high", "z_low", "z_high"))
    assert carried == pytest.approx(3.0 * 0.02 * 0.12 * 0.1, rel=1e-5)


def test_the_torque_of_a_vessel_that_spins_its_fluid_up_is_the_exact_one() -> None:
    """4 pi mu w R^2 h times the sum of exp(-x^2 nu t/R^2) over the zeros x of J1, from rest at t = 0."""
    n, spin, viscosity = 14, 2.0, 0.1
    h, across = 1.0 / n, n + 2
    centre = np.array(((0.5 * across + 0.3) * h, (0.5 * across + 0.1) * h, 0.0))
    grid = within(Grid((across, across, 1), (h,) * 3), cylinder(centre.tolist(), 0.5, spin=spin))
    fluid = FluidSolver(grid, {"z_low": FreeSlip(), "z_high": FreeSlip()}, density=1.0, viscosity=viscosity)
    for time in (0.1, 0.2):
        fluid.run_until(time, largest=0.002)
        force, torque = loads_on_walls(fluid, centre)[SMOOTH]
        sums = float(np.exp(-(jn_zeros(1, 20) ** 2) * viscosity * time / 0.25).sum())
        exact = -4.0 * math.pi * viscosity * spin * 0.25 * h * sums
        print(f"t = {time} s: torque {torque[2] / exact:.4f} of the exact one")
        assert torque[2] == pytest.approx(exact, rel=0.05)  # the layer at the wall is two cells thick
        pressed = 0.5 * (spin * 0.5) ** 2 * 1.0 * h  # by the pressure on one half of the wall, at the end
        assert np.abs(force).max() < 0.05 * pressed


def test_pressure_and_stress_on_a_cone_balance_what_flows_through_it() -> None:
    """Along the axis: pressure and momentum at the inlet, those at the outlet, and the force of the walls."""
    density, h = 1.0, 0.05
    grid = within(Grid((14, 14, 20), (h,) * 3), turned([(0.0, 0.15), (0.7, 0.32), (1.0, 0.32)], (0.36, 0.34, 0.0)))
    fluid = FluidSolver(grid, {"z_low": Inlet(1.0), "z_high": Outlet()}, density=density, viscosity=0.05)
    fluid.run_until(4.0, largest=0.02)
    area = h * h
    inflow, outflow = (fluid.volume_flux(2)[each] * area for each in (0, -1))
    speeds = [fluid.face_velocity(2)[each] for each in (0, -1)]
    open_floor = grid.inner_faces(np.asarray(fluid.boundaries.cut.of_faces(2)), 2)[0] * area
    at_floor = fluid.pressure[0] - 0.5 * h * fluid.cell_pressure_gradient()[2][0]
    pushed = float((at_floor * open_floor).sum()) + density * float((inflow * speeds[0]).sum())
    left = density * float((outflow * speeds[1]).sum())
    loads = loads_on_walls(fluid, np.zeros(3))
    on_walls = loads[SMOOTH][0][2]
    print(f"into the cone {pushed:.5g} N, out {left:.5g} N, on the walls {on_walls:.5g} N")
    assert abs(on_walls) > 0.2 * abs(pushed)
    assert pushed - left == pytest.approx(on_walls, abs=0.03 * (abs(pushed) + abs(on_walls)))


def bed_of_two_layers(model: str) -> tuple[FluidSolver, np.ndarray, np.ndarray]:
    """Fluid that flows steadily through particles at rest in the two lowest layers; voidage and drag coefficient."""
    voidage, beta = np.ones((6, 4, 4)), np.zeros((6, 4, 4))
    voidage[0], voidage[1], beta[0], beta[1] = 0.5, 0.6, 1e4, 5e3
    sides, scheme = {"z_low": Inlet(0.1), "z_high": Outlet(pressure=7.0)}, Scheme(model=model)
    grid = Grid((4, 4, 6), (0.01,) * 3)
    fluid = FluidSolver(grid, sides, density=1.0, viscosity=1e-5, voidage=voidage, scheme=scheme)
    for _ in range(40):
        fluid.step(1e-3, None, beta)
    return fluid, voidage, beta


@pytest.mark.parametrize("model", ["A", "B"])
def test_the_pressure_falls_by_what_particles_receive(model: str) -> None:
    """Drag and pressure on particles, and the momentum that leaves less that at the inlet, up to viscous stress."""
    fluid, voidage, beta = bed_of_two_layers(model)
    weight, seen = fluid.drag_response()
    received = (beta[..., None] * weight * seen)[..., 2]
    if model == "A":
        received = received - (1.0 - voidage) * fluid.cell_pressure_gradient()[2]
    out, inwards = fluid.volume_flux(2)[-1] * fluid.face_velocity(2)[-1], fluid.volume_flux(2)[0] ** 2 / voidage[0]
    expected = 0.01 * float(received.mean(axis=(1, 2)).sum()) + float((out - inwards).mean())
    assert pressure_fall(fluid, 2) == pytest.approx(expected, rel=1e-4)
    line = fluid.pressure.mean(axis=(1, 2))[:2] @ [1.5, -0.5] - 7.0  # through the two lowest cells
    assert abs(line / expected - 1.0) > 0.02


def test_the_pressure_on_sides_is_kept_in_a_checkpoint() -> None:
    fluid, voidage, _ = bed_of_two_layers("B")
    later = FluidSolver(
        fluid.grid, {"z_low": Inlet(0.1), "z_high": Outlet(pressure=7.0)}, density=1.0, viscosity=1e-5,
        voidage=voidage, scheme=Scheme(model="B"),
    )  # fmt: skip
    later.restore(fluid.checkpoint())
    assert pressure_fall(later, 2) == pressure_fall(fluid, 2)


def test_a_side_without_open_faces_has_no_pressure() -> None:
    solid = np.zeros((6, 4, 4), bool)
    solid[0] = True
    fluid = FluidSolver(Grid((4, 4, 6), (0.01,) * 3, solid=solid), {}, density=1.0, viscosity=1e-5)
    fluid.step(1e-3)
    assert math.isnan(pressure_fall(fluid, 2)) and pressure_fall(fluid, 0) == pytest.approx(0.0, abs=1e-12)


# ---------------------------------------------------------------- cases

BED = """
column = { width = 0.03, height = 0.04, cell = 0.005, ends = "closed" }
bed = { diameter = 2.0e-3, positions = [[0.015, 0.015, 0.002]] }
run = { until = 0.4, particle_step = 1e-5, fluid_step = 1e-3, wall_forces = true }
laws = { lubrication = "none" }

[material.glass]
density = 2500.0
youngs_modulus = 6.0e10
contact_modulus = 1.0e6
poisson = 0.25
restitution = 0.2
friction = 0.5
"""


@pytest.mark.parametrize(
    "vessel",
    [{"shape": "cylinder", "radius": 0.0046}, {"shape": "cone", "radius": 0.0046, "length": 0.02, "top_radius": 0.015}],
    ids=lambda vessel: str(vessel["shape"]),
)
def test_floor_and_wall_carry_the_weight_of_a_bed_at_rest(vessel: dict[str, Any]) -> None:
    """36 spheres fall from a lattice beside the axis, and come to rest."""
    x, y, z = np.meshgrid([0.0128, 0.015, 0.0172], [0.0128, 0.015, 0.0172], 1.3e-3 + 2.2e-3 * np.arange(4))
    lattice = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    places = (lattice + np.random.default_rng(4).uniform(-1e-4, 1e-4, lattice.shape)).tolist()
    rolling = {"laws.rolling_resistance": "constant_torque", "material.glass.rolling_friction": 0.02}
    simulation = Simulation(Case.from_text(BED, "c.toml", {"vessel": vessel, "bed.positions": places} | rolling))
    while simulation.time < 0.4:
        simulation.step()
    found, weight = row(simulation), 9.81 * float(simulation.particles.mass.sum())
    carried = -(found["floor_force_z"] + found["side_force_z"] + found["lid_force_z"])
    print(f"{found['particle_count']:g} particles: walls carry {carried / weight:.5f} of their weight")
    assert carried == pytest.approx(weight, rel=1e-3)
    assert found["lid_force_z"] == 0.0 and found["floor_force_z"] < 0.0
    if vessel["shape"] == "cone":
        assert found["side_force_z"] < -0.1 * weight
    sideways = [found["floor_force_x"] + found["side_force_x"], found["floor_force_y"] + found["side_force_y"]]
    assert np.abs(sideways).max() < 1e-3 * weight
    assert abs(found["floor_torque"] + found["side_torque"]) < 1e-3 * weight * 0.01


def test_columns_of_walls_are_there_by_choice_and_have_the_names_of_walls() -> None:
    case = Case.from_text(BED, "c.toml", {"vessel.shape": "cylinder", "fluid": {"density": 1.2, "viscosity": 1.8e-5}})
    names = [name for name in all_columns(case) if "torque" in name]
    assert names == [f"{wall}_{of}torque" for wall in ("floor", "lid", "side") for of in ("", "fluid_")]
    assert not [name for name in all_columns(Case.from_text(BED, "c.toml", {"run.wall_forces": False}))
                if "floor_force" in name]  # fmt: skip
    box = Case.from_text(BED, "c.toml")
    assert "x_low_force_x" in all_columns(box) and "x_low_fluid_force_x" not in all_columns(box)
    assert math.isclose(case.vessel.spin if case.vessel else 1.0, 0.0)


@pytest.mark.parametrize(
    ("table", "with_fluid", "without"),
    [
        ({"vessel.shape": "cylinder"}, {"floor", "lid", "side"}, set()),
        ({"column.sides": "no_slip"}, {"floor", "lid", "x_low", "x_high", "y_low", "y_high"}, set()),
        ({"column.shape": "cylinder"}, {"floor", "lid"}, {"side"}),
        ({"wall": [{"shape": "plane", "point": [0.0, 0.0, 0.03], "normal": [0.0, 0.0, -1.0], "solid": "none"}]},
         {"floor", "lid", "x_low", "x_high", "y_low", "y_high"}, {"wall_0"}),
    ],
    ids=["vessel", "box", "steps", "another wall"],
)  # fmt: skip
def test_the_fluid_has_a_force_on_those_walls_that_the_key_names(
    table: dict[str, Any], with_fluid: set[str], without: set[str]
) -> None:
    """Floor, lid, sides of a box and the wall of a vessel; not a wall of steps, nor one of `[[wall]]`."""
    case = Case.from_text(BED, "c.toml", {"fluid": {"density": 1.2, "viscosity": 1.8e-5}, **table})
    columns = all_columns(case)
    of_particles = {name.removesuffix("_force_z") for name in columns if name.endswith("_force_z")}
    of_fluid = {name.removesuffix("_fluid") for name in of_particles if name.endswith("_fluid")}
    assert of_fluid == with_fluid
    assert {name for name in of_particles if not name.endswith("_fluid")} == with_fluid | without
    said = str(type(case.run).model_fields["wall_forces"].description)
    assert "of particles on every wall, and of the fluid on floor, lid, sides of a box and the wall of a vessel" in said


SETTLING = """
column = { width = 0.012, height = 0.03, cell = 0.003, ends = "closed" }
bed = { diameter = 1.0e-3, count = 900, start = "expanded" }
fluid = { density = 1000.0, viscosity = 1.0e-3 }
run = { until = 1.2 }

[material.bead]
density = 1100.0
youngs_modulus = 5.0e7
contact_modulus = 2.0e5
poisson = 0.3
restitution = 0.5
friction = 0.5
"""


@pytest.mark.slow
@pytest.mark.parametrize("model, sides", [("A", "no_slip"), ("B", "periodic")])
def test_floor_sides_and_fluid_carry_a_suspension_that_settles(model: str, sides: str) -> None:
    """The floor of a closed box has the weight of the sediment by contacts, and that of the rest by the pressure.

    Their sum, less what the fluid pulls at the sides, is the buoyant weight and what both phases gain in momentum, also
    while a sediment grows within the lowest cells. A straight line through the pressures of the two lowest cells has up
    to 3 % more.
    """
    laws = {"laws.lubrication": "none", "laws.drag": "wen_yu", "laws.model": model, "column.sides": sides}
    simulation = Simulation(Case.from_text(SETTLING, "c.toml", laws))
    particles, fluid = simulation.particles, simulation.fluid
    weight = 9.81 * 100.0 * float(particles.volume.sum()) / 0.012**2

    def upward_momentum() -> float:
        of_fluid = fluid.density * fluid.mean_voidage * fluid.mean_velocity[..., 2] * fluid.grid.cell_volume
        return float((particles.mass * particles.velocity[:, 2]).sum() + of_fluid.sum()) / 0.012**2

    lying = []
    for end in (0.4, 0.6, 0.8, 1.0, 1.2):
        simulation.until(end - 0.05)
        begin, before, carried, load = simulation.time, upward_momentum(), [], wall_load(simulation)
        while simulation.time < end - 1e-9:
            earlier = load
            simulation.step()
            load = wall_load(simulation)
            pulled = sum(force[2] for name, (force, _) in loads_on_walls(fluid, np.zeros(3)).items() if name[0] in "xy")
            carried.append(pressure_drop(simulation) + 0.5 * (earlier + load) - pulled / 0.012**2)
        lying.append(load / weight)
        gained = (upward_momentum() - before) / (simulation.time - begin)
        balance = (float(np.mean(carried)) - gained) / weight
        print(f"{end} s: {lying[-1]:.2f} of the weight lies, balance {balance:.4f}")
        assert balance == pytest.approx(1.0, abs=1.5e-3)
    assert lying[-1] > lying[0] + 0.1
