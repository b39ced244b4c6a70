"""Heat and a vapour in cells that smooth walls cut: what walls give, what is kept, what inlets bring."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from example_case import GLASS

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.fluid.conditions import Inlet, Outlet, Periodic
from cfddem.fluid.cut_cells import within
from cfddem.fluid.grid import Grid
from cfddem.fluid.scalar import Scalar, ScalarKind
from cfddem.fluid.scalar_conditions import ExchangeWall, FluxWall, HeldWall, ScalarSides, Wall
from cfddem.fluid.solver import FluidSolver
from cfddem.fluid.surfaces import Plane, cylinder, turned
from cfddem.run.history import row
from cfddem.run.simulation import Simulation

RHO_C, CONDUCTIVITY = 1200.0, 0.03


def scalar(fluid: FluidSolver, wall: Wall | None = None, start: float = 300.0, **changes: Any) -> Scalar:
    given = {"capacity": RHO_C, "conductivity": CONDUCTIVITY} | changes
    walls = {} if wall is None else {"solid": wall}
    return Scalar(fluid, ScalarKind("temperature", "K", "", start, **given), ScalarSides(start, walls=walls))


def in_a_cone(conditions: dict[str, Any], voidage: float = 0.6) -> FluidSolver:
    """Slivers, and cells that the wall leaves to a fifth, at every height."""
    cone = turned([(0.0, 0.015), (0.06, 0.041)], (0.0503, 0.0497, 0.0))
    grid = within(Grid((10, 10, 6), (0.01,) * 3), cone)
    fluid = FluidSolver(grid, conditions, density=1.2, viscosity=1.8e-5, voidage=voidage)
    fluid.set_velocity((0.0, 0.0, 0.0))
    return fluid


def moved(heat: Scalar, random: np.random.Generator) -> np.ndarray:
    """A voidage near the present one, of the same sum, and uniform in groups, as that of particles is."""
    groups, voidage = heat.flow.groups, heat.fluid.voidage
    change = groups.averaged(random.random(voidage.shape))
    change -= (groups.volume * change).sum() / groups.volume.sum()
    return np.asarray(voidage + 0.1 * (0.6 + 0.2 * change - voidage))


# ---------------------------------------------------------------- conservation and bounds


@pytest.mark.parametrize("steps", [100, pytest.param(10_000, marks=pytest.mark.slow)])
def test_heat_is_conserved_in_a_closed_cone_and_stays_between_what_it_was(steps: int) -> None:
    fluid, random = in_a_cone({}), np.random.default_rng(2)
    heat = scalar(fluid)
    mean, share = heat.flow.groups.averaged, heat.flow.groups.volume * fluid.grid.cell_volume
    heat.value[:] = mean(300.0 + 100.0 * random.random(fluid.grid.shape))
    solids, capacity, beta = mean(280.0 + 200.0 * random.random(fluid.grid.shape)), 5e4, 2e5
    wet = share > 0.0
    least, most = (limit(heat.value[wet].tolist() + solids[wet].tolist()) for limit in (min, max))
    start, given = heat.content + capacity * float((share * solids).sum()), heat.content
    for _ in range(steps):
        fluid.step(1e-3, moved(heat, random))
        implicit = beta / (1.0 + fluid.last_step * beta / capacity)
        seen = heat.step(np.full(fluid.grid.shape, implicit), implicit * solids)
        solids += fluid.last_step * implicit / capacity * (seen - solids)
        assert least - 1e-9 <= heat.value[wet].min() and heat.value[wet].max() <= most + 1e-9
    end = heat.content + capacity * float((share * solids).sum())
    print(f"heat changed by {abs(end - start) / start:.2g} of all over {steps} steps")
    assert abs(end - start) < 1e-12 * start
    assert abs(heat.content - given) > 1e-3
    assert 0.0 < heat.flow.groups.volume[wet].min() < 0.2


def test_a_uniform_temperature_stays_uniform_to_round_off_as_fluid_flows_through_a_cone() -> None:
    fluid, random = in_a_cone({"z_low": Inlet(0.3), "z_high": Outlet()}), np.random.default_rng(1)
    heat = scalar(fluid)
    for _ in range(50):
        fluid.step(1e-3, moved(heat, random))
        heat.step()
    wet = heat.flow.groups.volume > 0.0
    assert np.abs(heat.value - 300.0)[wet].max() < 1e-12 * 300.0
    assert np.abs(heat.fields.owned("stored") - fluid.voidage)[wet].max() < 1e-7


# ---------------------------------------------------------------- walls


def tube(wall: Wall, n: int, start: float, seconds: float, step: float) -> tuple[Scalar, float]:
    """Fluid at rest in a tube of radius 0.04 m, n cells across, beside the grid's middle; and its length [m]."""
    h = 0.08 / n
    middle = (0.5 * (n + 2) + 0.27) * h, (0.5 * (n + 2) + 0.13) * h, 0.0
    grid = within(Grid((n + 2, n + 2, 1), (h,) * 3), cylinder(middle, 0.04))
    fluid = FluidSolver(grid, {"z_low": Periodic(), "z_high": Periodic()}, density=1.2, viscosity=1.8e-5)
    heat = scalar(fluid, wall, start)
    for _ in range(round(seconds / step)):
        fluid.step(step)
        heat.step()
    return heat, h


def test_a_flux_through_a_round_wall_heats_by_its_area() -> None:
    heat, length = tube(FluxWall(5.0), 8, 300.0, 100.0, 5.0)
    assert heat.sums["walls"] == pytest.approx(heat.content, rel=1e-12)
    assert heat.sums["walls"] == pytest.approx(5.0 * 2.0 * math.pi * 0.04 * length * 100.0, rel=0.01)


def test_a_tube_cools_as_the_first_mode_of_its_wall() -> None:
    """T decays by exp(-x^2 a t/R^2): x = 2.4048, zero of J0, at a wall of a temperature; with a coefficient h x is the
    root of x J1(x) = Bi J0(x), 1.2558 for Bi = h R/k = 1."""
    biot = CONDUCTIVITY / 0.04
    for wall, root in ((HeldWall(0.0), 2.404826), (ExchangeWall(biot, 0.0), 1.255784)):
        early, late = (tube(wall, 8, 100.0, seconds, 10.0)[0].mean for seconds in (20.0, 40.0))
        rate = math.log(early / late) / 20.0 / (CONDUCTIVITY / RHO_C / 0.04**2)
        print(f"root {math.sqrt(rate):.4f} for {root:.4f}")
        assert math.sqrt(rate) == pytest.approx(root, rel=0.02)


def test_conduction_between_a_slanting_wall_and_a_side_keeps_between_their_temperatures() -> None:
    grid = within(Grid((8, 8, 1), (0.01,) * 3), Plane((0.02, 0.0, 0.0), (1.0, -0.37, 0.0)))
    fluid = FluidSolver(grid, {"z_low": Periodic(), "z_high": Periodic()}, density=1.2, viscosity=1.8e-5)
    sides = ScalarSides(300.0, walls={"solid": HeldWall(400.0), "x_high": HeldWall(300.0)})
    heat = Scalar(fluid, ScalarKind("temperature", "K", "", 300.0, RHO_C, CONDUCTIVITY), sides)
    for _ in range(100):
        fluid.step(10.0)
        heat.step()
        wet = heat.flow.groups.volume > 0.0
        assert heat.value[wet].min() >= 300.0 - 1e-9 and heat.value[wet].max() <= 400.0 + 1e-9
    held = RHO_C * 400.0 * 64e-6  # above 0 K, of which round-off is a part
    assert heat.sums["walls"] == pytest.approx(heat.content, abs=1e-12 * held)


def nusselt(n: int, shift: tuple[float, float], peclet: float = 20.0) -> float:
    """Nusselt number 2.5 diameters behind the inlet of a pipe with n cells across and a wall of one temperature."""
    h, across, length = 1.0 / n, n + 2, 3
    x0, y0 = ((0.5 * across + each) * h for each in shift)
    grid = within(Grid((across, across, length * n), (h,) * 3), cylinder((x0, y0, 0.0), 0.5))

    def speed(x: np.ndarray, y: np.ndarray, z: np.ndarray, time: float) -> np.ndarray:
        return np.maximum(2.0 - 8.0 * ((x - x0) ** 2 + (y - y0) ** 2), 0.0) + 0.0 * z

    fluid = FluidSolver(grid, {"z_low": Inlet(speed), "z_high": Outlet()}, density=1.0, viscosity=0.05)
    fluid.set_velocity((0.0, 0.0, lambda x, y, z: speed(x, y, z, 0.0)))
    heat = scalar(fluid, HeldWall(0.0), 1.0, capacity=1.0, conductivity=1.0 / peclet)
    while fluid.time < 2.0 * length:
        fluid.step(fluid.largest_step(0.4).step)
        heat.step()
    flux = fluid.volume_flux(2) * h * h
    mixed = (0.5 * (flux[1:] + flux[:-1]) * heat.value).sum(axis=(1, 2)) / flux[0].sum()
    # what the wall takes is what the flow and conduction along the pipe lose between two planes
    one, other = round(2.25 * n), round(2.75 * n)
    through = grid.inner_faces(heat._through[1, 2], 2).sum(axis=(1, 2)) * h * h
    lost = through[one] - through[other]
    return float(lost / ((other - one) * h * math.pi) * peclet / mixed[one:other].mean())


@pytest.mark.parametrize(
    ("n", "within_"),
    [(8, 0.02), pytest.param(16, 0.01, marks=pytest.mark.slow)],
)
def test_the_nusselt_number_of_a_pipe_with_a_wall_of_one_temperature(n: int, within_: float) -> None:
    """3.6568 (1 + 1.227/Pe^2) with conduction along the pipe (Michelsen & Villadsen, Int. J. Heat Mass Transfer 17
    (1974) 1391), for a pipe beside the grid's middle."""
    exact = 3.6568 * (1.0 + 1.227 / 20.0**2)
    found = nusselt(n, (0.27, 0.13))
    print(f"{n} cells: {found:.4f} for {exact:.4f}")
    assert found == pytest.approx(exact, rel=within_)


# ---------------------------------------------------------------- a case

CASE = (
    """
fluid = { density = 1.2, viscosity = 1.8e-5 }
column = { width = 0.06, height = 0.08, cell = 0.005 }
vessel = { shape = "cone", radius = 0.015, length = 0.05 }
bed = { diameter = 2.5e-3, height = 0.006 }
run = { until = 0.1, reference_speed = 1.0 }

[patch.nozzle]
kind = "inlet"
shape = "disc"
diameter = 0.012
velocity = 2.0

[patch.annulus]
kind = "inlet"
shape = "ring"
inner_diameter = 0.014
diameter = 0.028
velocity = 0.5

[heat]
particle_temperature = 300.0
fluid_temperature = 300.0
conductivity = 0.026
fluid_heat_capacity = 1000.0
heat_capacity = { glass = 800.0 }
patch_temperature = { nozzle = 400.0 }
wall_temperature = { sides = 330.0 }

[vapour]
diffusivity = 2.5e-5
patch_fraction = { annulus = 0.02 }
"""
    + GLASS
)


def test_a_hot_inlet_through_a_patch_heats_the_particles_of_a_cone_and_the_balances_hold() -> None:
    simulation = Simulation(Case.from_text(CASE, "c.toml"))
    for _ in range(20):
        simulation.step()
    found, seconds = row(simulation), simulation.fluid.time
    nozzle, annulus = 2.0 * math.pi * 0.006**2, 0.5 * math.pi * (0.014**2 - 0.007**2)
    assert found["heat_in"] == pytest.approx(1200.0 * nozzle * 100.0 * seconds, rel=0.03)
    assert found["vapour_in"] == pytest.approx(1.2 * annulus * 0.02 * seconds, rel=0.03)
    assert found["heat_received"] > 0.1 * found["heat_in"] and found["heat_from_walls"] > 0.0
    assert found["heat_imbalance"] < 1e-12 and found["vapour_imbalance"] < 1e-12
    assert found["mean_temperature"] > 300.0


def test_a_hot_inlet_in_the_side_of_a_cone_brings_its_heat_and_the_balances_hold() -> None:
    side = {"kind": "inlet", "side": "y_high", "shape": "box", "centre": [0.032, 0.06], "size": [0.02, 0.015],
            "velocity": 1.5}  # fmt: skip
    given = {"patch.side": side, "heat.patch_temperature": {"side": 350.0}}
    simulation = Simulation(Case.from_text(CASE, "c.toml", given))
    for _ in range(10):
        simulation.step()
    found, seconds = row(simulation), simulation.fluid.time
    assert found["heat_in"] == pytest.approx(1200.0 * 1.5 * 0.02 * 0.015 * 50.0 * seconds, rel=1e-6)
    assert found["heat_imbalance"] < 1e-12 and found["vapour_imbalance"] < 1e-12


def test_a_temperature_of_no_inlet_is_refused_with_the_inlets() -> None:
    for key in ("heat.patch_temperature", "vapour.patch_fraction"):
        with pytest.raises(InputError, match=rf"{key}.jet: must be one of the inlets nozzle, annulus"):
            Case.from_text(CASE, "c.toml", {f"{key}.jet": 0.5})
    with pytest.raises(InputError, match=r"heat.wall_temperature.x_low: must be one of the walls sides, z_low"):
        Case.from_text(CASE, "c.toml", {"heat.wall_temperature.x_low": 350.0})


def test_what_enters_by_a_pressure_takes_the_value_of_outlets() -> None:
    driven = {"patch.nozzle.velocity": None, "patch.nozzle.pressure": 5.0, "patch.annulus.velocity": None,
              "patch.annulus.pressure": 5.0}  # fmt: skip
    said = r"heat.patch_temperature.nozzle = 400.0: .*driven by a pressure.*take heat.outlet_temperature"
    with pytest.raises(InputError, match=said):
        Case.from_text(CASE, "c.toml", driven)
    with pytest.raises(InputError, match=r"vapour.patch_fraction.annulus.*take vapour.outlet_fraction"):
        Case.from_text(CASE, "c.toml", driven | {"heat.patch_temperature": {}})
