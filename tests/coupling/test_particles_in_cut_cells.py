"""Particles in a round column whose smooth wall cuts the cells of the fluid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from cfddem import run_case
from cfddem.analysis.report import report
from cfddem.case.schema import Case
from cfddem.coupling.kernel import FilterKernel
from cfddem.fluid import budgets
from cfddem.fluid.conditions import Inlet, Outlet
from cfddem.fluid.cut_cells import open_share, within
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver
from cfddem.fluid.surfaces import cylinder
from cfddem.particles.state import sphere_volume
from cfddem.run.simulation import Simulation

CENTRE, RADIUS = (0.52, 0.47, 0.0), 0.44
GRID = within(Grid((8, 8, 10), (0.125, 0.125, 0.1)), cylinder(CENTRE, RADIUS))


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.031, 0.062), (0.02, -0.05)])
def test_the_pressure_drop_of_a_packed_bed_is_that_of_its_drag(shift):
    """eps dp/dz = beta u with u = U/eps, at any shift against the grid; the wall drags next to nothing."""
    grid = within(Grid((8, 8, 10), (0.125, 0.125, 0.1)), cylinder((0.5 + shift[0], 0.5 + shift[1], 0.0), RADIUS))
    speed, voidage, beta = 0.3, 0.42, np.full(grid.shape, 5e3)
    fluid = FluidSolver(
        grid, {"z_low": Inlet(speed), "z_high": Outlet()}, density=1.2, viscosity=1.8e-5, voidage=voidage
    )
    for _ in range(12):
        fluid.step(0.01, drag_coefficient=beta)
    pressure = np.where(grid.open, fluid.pressure, np.nan)
    gradient = (np.nanmean(pressure[2]) - np.nanmean(pressure[7])) / 0.5
    assert gradient == pytest.approx(5e3 * speed / voidage**2, rel=5e-3)
    assert np.nanmax(pressure[5]) - np.nanmin(pressure[5]) < 0.01 * gradient * 0.1


def particles(count: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Places in the column and radii."""
    rng = np.random.default_rng(3)
    distance, angle = (RADIUS - 0.02) * np.sqrt(rng.uniform(0, 1, count)), rng.uniform(0, 2 * np.pi, count)
    places = [
        CENTRE[0] + distance * np.cos(angle),
        CENTRE[1] + distance * np.sin(angle),
        rng.uniform(0.02, 0.98, count),
    ]
    return np.stack(places, axis=-1), np.full(count, 0.02)


@pytest.mark.parametrize("smoothing", [0.0, 0.3])
def test_deposits_keep_the_volume_and_are_adjoint_to_samples(smoothing):
    """Per open volume of the cells; what particles exert on the fluid they get from it."""
    kernel = FilterKernel(GRID, (False, False, False), smoothing=smoothing)
    cell_map, held = kernel.map_particles(*particles()), open_share(GRID)
    solid = kernel.solid_fraction(cell_map)
    assert (solid * held).sum() * GRID.cell_volume == pytest.approx(300 * math.pi / 6 * 0.04**3, rel=1e-12)
    rng = np.random.default_rng(1)
    values, field = rng.normal(size=(300, 1)), rng.normal(size=(1, *GRID.shape))
    deposited = (kernel.spread(cell_map, values)[0] * held * field[0]).sum()
    sampled = (values * kernel.sample(cell_map.stencil, cell_map.radius, field)).sum()
    assert deposited == pytest.approx(sampled, rel=1e-10)
    ones = kernel.sample(cell_map.stencil, cell_map.radius, np.ones((1, *GRID.shape)))
    assert ones == pytest.approx(1.0, rel=1e-12)


def test_a_uniform_suspension_is_uniform_up_to_the_wall():
    """Of many equal volumes, with the kernel of a bed; solid cells as groups would be off by the cut share."""
    kernel = FilterKernel(GRID, (False, False, False), smoothing=0.3)
    places, radius = particles(60_000)
    solid = kernel.solid_fraction(kernel.map_particles(places, 0.1 * radius))[2:-2]
    held = open_share(GRID)[2:-2] > 1e-3
    mean = (solid * open_share(GRID)[2:-2]).sum() / open_share(GRID)[2:-2].sum()
    assert np.abs(solid[held] / mean - 1.0).max() < 0.08


COLUMN = {"width": 0.0192, "height": 0.0576, "cell": 0.0024}


def bed_of(count: int, vessel: Mapping[str, Any], **others: Any) -> Case:
    """A bed of seeds in air, at twice the velocity of minimum fluidisation."""
    seed = {"density": 1000.0, "youngs_modulus": 1.2e8, "poisson": 0.3, "friction": 0.1, "restitution": 0.9}
    steps = {"particle_step": 1e-5, "fluid_step": 2e-4, "reference_speed": 0.4}
    return Case(
        fluid={"density": 1.2, "viscosity": 1.8e-5},
        material={"seed": seed | {"contact_modulus": 1e6}},
        column=COLUMN,
        vessel=vessel,
        bed={"diameter": 1.2e-3, "count": count, "seed": 1, "inlet_velocity": [[0.0, 0.2], [0.1, 0.75]]},
        laws={"drag": "beetstra", "lubrication": "none"},
        run={"until": 0.3, "every": 0.05, "history_every": 0.001, **steps},
        **others,
    )


@pytest.mark.slow
def test_the_pressure_drop_of_a_bubbling_bed_is_its_weight(tmp_path):
    """What the walls do not carry and what does not accelerate the bed, over 0.15 s."""
    run = run_case(bed_of(2200, {"shape": "cylinder"}), tmp_path / "bed")
    history, times, area = run.history, run.times, 0.25 * math.pi * 0.0192**2
    first, last = 3, len(times) - 1
    inside = (history["time"] > times[first] - 1e-9) & (history["time"] < times[last] + 1e-9)
    carried = np.trapezoid((history["pressure_drop"] + history["wall_load"])[inside], history["time"][inside])

    def momentum(place: int) -> float:
        found = run.particles(place)
        return float((1000.0 * sphere_volume(found["radius"].astype(float)) * found["velocity"][:, 2]).sum())

    lasted = times[last] - times[first]
    weight = 2200 * sphere_volume(0.6e-3) * (1000.0 - 1.2) * 9.81 / area
    assert carried / lasted == pytest.approx(weight + (momentum(last) - momentum(first)) / area / lasted, rel=5e-3)


@pytest.mark.slow
def test_the_weight_of_a_bubbling_bed_in_a_cone_is_carried_by_its_floor_and_its_wall(tmp_path):
    """Pressure on the floor, pressure and stress on the cone, contacts with both, and what accelerates bed and gas,
    over 0.2 s."""
    count, speed = 1600, 0.75
    cone = {"shape": "cone", "radius": 0.0072, "length": 0.03}
    case = bed_of(count, cone).with_(**{"run.wall_forces": True})
    run = run_case(case, tmp_path / "bed")
    history, times = run.history, run.times
    first, last = 2, len(times) - 1
    inside = (history["time"] > times[first] - 1e-9) & (history["time"] < times[last] + 1e-9)
    at_walls = sum(history[name] for name in ("floor_force_z", "side_force_z", "side_fluid_force_z"))
    pushed, lasted = history["pressure_drop"] * case.floor_area, times[last] - times[first]
    carried = np.trapezoid((pushed - at_walls)[inside], history["time"][inside]) / lasted

    def momentum(place: int) -> float:
        found = run.particles(place)
        return float((1000.0 * sphere_volume(found["radius"].astype(float)) * found["velocity"][:, 2]).sum())

    weight = count * sphere_volume(0.6e-3) * (1000.0 - 1.2) * 9.81
    gas = 1.2 * speed**2 * case.floor_area * (1.0 - case.floor_area / case.area_of("lid"))  # slows down in the cone
    expected = weight + (momentum(last) - momentum(first)) / lasted - gas
    share = np.trapezoid(history["side_fluid_force_z"][inside], history["time"][inside]) / lasted / weight
    print(f"carried / expected {carried / expected:.5f}; the pressure on the cone is {share:.3f} of the weight")
    assert carried == pytest.approx(expected, rel=5e-3) and share < -0.1


@pytest.mark.slow
def test_a_bed_in_a_round_column_accounts_for_its_energy(tmp_path):
    """Works of the terms of the fluid add up to its kinetic energy; the remainder is below 1 % of what was put in."""
    case = bed_of(800, {"shape": "cylinder"}).with_(**{"run.until": 0.02, "run.energy_budget": True})
    simulation = Simulation(case.with_(**{"run.energy_budget": False}))
    fluid = simulation.fluid
    for _ in range(20):
        before = budgets.kinetic_energy(fluid)
        simulation.step()
        done = budgets.works(fluid)
        assert done.kinetic == pytest.approx(budgets.kinetic_energy(fluid) - before, rel=1e-9)
        assert sum(done) - done.kinetic - done.inlet_drag == pytest.approx(done.kinetic, abs=1e-9 * sum(map(abs, done)))
    run_case(case, tmp_path / "bed")
    ledger = report(tmp_path / "bed").energy
    assert abs(ledger["remainder"]) < 0.01 * ledger["put_in"], ledger
