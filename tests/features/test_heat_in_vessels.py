"""Heat and a vapour in cells that smooth walls cut: what walls give, what is kept, what inlets bring."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from example_case import GLASS

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.coupling.kernel import FilterKernel
from cfddem.features.heat import HeatExchange
from cfddem.features.vapour import Vapour
from cfddem.fluid.conditions import Inlet, Outlet, Periodic
from cfddem.fluid.cut_cells import within
from cfddem.fluid.grid import Grid
from cfddem.fluid.scalar import Scalar, ScalarKind
from cfddem.fluid.scalar_conditions import ExchangeWall, FluxWall, HeldWall, ScalarSides, Wall
from cfddem.fluid.solver import FluidSolver
from cfddem.fluid.surfaces import Plane, cylinder, turned
from cfddem.fluid.thin_walls import ASIDE, ThinWall, divided, thin_wall
from cfddem.run.history import row
from cfddem.run.simulation import Simulation

RHO_C, CONDUCTIVITY = 1200.0, 0.03


def scalar(fluid: FluidSolver, wall: Wall | None = None, start: float = 300.0, **changes: Any) -> Scalar:
    given = {"capacity": RHO_C, "conductivity": CONDUCTIVITY} | changes
    walls = {} if wall is None else {"solid": wall}
    return Scalar(fluid, ScalarKind("temperature", "K", "", start, **given), ScalarSides(start, walls=walls))


def in_a_cone(conditions: dict[str, Any], voidage: Any = 0.6, thin: ThinWall | None = None) -> FluidSolver:
    """Slivers, and cells that the wall leaves to a fifth, at every height; a thin wall may divide them."""
    cone = turned([(0.0, 0.015), (0.06, 0.041)], (0.0503, 0.0497, 0.0))
    grid = within(Grid((10, 10, 6), (0.01,) * 3), divided(thin, cone) if thin else cone)
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


# ---------------------------------------------------------------- beside thin walls

SHEET = np.array([[0.035, -1.0, -1.0], [0.071, 1.0, -1.0], [0.071, 1.0, 1.0], [0.035, -1.0, 1.0]])
"""A baffle through all of the cone, beside its middle and not along the cells."""


class Divided:
    """The cone with a baffle, and particles on both sides that exchange heat with the cells around them."""

    def __init__(self, conditions: dict[str, Any], of_sides: tuple[float, float], is_there: bool = True) -> None:
        self.thin = thin_wall(SHEET[[[0, 1, 2], [0, 2, 3]]])
        self.random, kind = np.random.default_rng(3), ScalarKind("temperature", "K", "", 300.0, RHO_C, CONDUCTIVITY)
        self.position = self.random.uniform((0.03, 0.03, 0.004), (0.07, 0.07, 0.05), (300, 3))
        self.radius, self.capacity = np.full(300, 1.5e-3), 0.02
        grid = in_a_cone({}, 1.0, self.thin if is_there else None).grid
        self.kernel = FilterKernel(grid, (False,) * 3, smoothing=0.015)
        self.cells = self.kernel.map_particles(self.position, self.radius)
        self.fluid = in_a_cone(conditions, self.voidage, self.thin if is_there else None)
        self.heat = Scalar(self.fluid, kind, ScalarSides(lambda side, x, y, z: self.by_side(of_sides, x, y, z)))
        points = np.broadcast_arrays(*self.fluid.grid.centres())
        self.heat.value[:] = self.by_side(of_sides, *points)
        self.temperature = self.by_side(of_sides, *self.position.T)
        self.cells_on, self.on = (self.by_side((0.0, 1.0), *each) > 0.5 for each in (points, self.position.T))

    @property
    def voidage(self) -> np.ndarray:
        """Of the cells of the fluid."""
        return np.asarray(1.0 - self.kernel.solid_fraction(self.cells))

    def by_side(self, values: tuple[float, float], *places: np.ndarray) -> np.ndarray:
        """One of two values by the side of places x, y, z."""
        side = self.thin.side(np.stack([each.ravel() for each in places], axis=-1) + ASIDE * 0.01)
        return np.where(side > 0.0, values[1], values[0]).reshape(places[0].shape)

    def step(self) -> None:
        """Particles move a little on their side; the fluid follows, and both exchange heat."""
        moved = self.position + self.random.uniform(-2e-4, 2e-4, self.position.shape)
        stays = (self.by_side((0.0, 1.0), *moved.T) > 0.5) == self.on
        self.position = np.where(stays[:, None], moved, self.position)
        self.cells, h = self.kernel.map_particles(self.position, self.radius), 1e-3
        self.fluid.step(h, self.voidage)
        given = np.stack([np.full(300, 2.0), 2.0 * self.temperature], axis=1)  # conductance, in W/K
        seen = self.heat.step(*(self.kernel.spread(self.cells, given) / self.fluid.grid.cell_volume))
        around = self.kernel.sample(self.cells.stencil, self.radius, seen[None])[:, 0]
        self.temperature = self.temperature + h * 2.0 / self.capacity * (around - self.temperature)

    def content(self, on: bool) -> float:
        """Heat of fluid and particles on a side, above 0 K [J]."""
        heat, here = self.heat, self.cells_on == on
        fluid = (heat.fields.owned("stored") * heat.flow.groups.volume * heat.value)[here].sum()
        solids = self.capacity * self.temperature[self.on == on].sum()
        return float(RHO_C * self.fluid.grid.cell_volume * fluid + solids)


@pytest.mark.parametrize("is_there", [True, False])
def test_both_sides_of_a_baffle_keep_their_temperatures_to_round_off_as_fluid_flows_beside_it(is_there: bool) -> None:
    """Without the baffle they mix."""
    both = Divided({"z_low": Inlet(0.3), "z_high": Outlet()}, (300.0, 400.0), is_there)
    for _ in range(30):
        both.step()
    wet = both.heat.flow.groups.volume > 0.0
    apart = [np.abs(both.heat.value - np.where(both.cells_on, 400.0, 300.0))[wet].max(),
             np.abs(both.temperature - np.where(both.on, 400.0, 300.0)).max()]  # fmt: skip
    print(f"fluid and particles are {apart[0]:.2g} and {apart[1]:.2g} K from the temperatures of their sides")
    assert min(both.on.sum(), (~both.on).sum()) > 100
    assert max(apart) < 1e-9 if is_there else min(apart) > 1.0


def test_each_side_of_a_baffle_keeps_its_heat_in_a_closed_cone() -> None:
    both = Divided({}, (300.0, 300.0))
    both.temperature = both.random.uniform(280.0, 480.0, 300)
    fluid = both.heat.content
    before = [both.content(on) for on in (False, True)]
    for _ in range(50):
        both.step()
    changed = [abs(both.content(on) / was - 1.0) for on, was in zip((False, True), before)]
    print(f"heat of the sides changed by {changed[0]:.2g} and {changed[1]:.2g}")
    assert max(changed) < 1e-12 and both.heat.content > fluid + 0.01


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


def test_heat_and_vapour_beside_a_draft_tube_are_what_the_inlets_brought() -> None:
    """By the fluid's own voidage and the temperatures of cells and particles, against the flux through the floor."""
    tube = {"shape": "cylinder", "point": [0.03, 0.03, 0.0025], "radius": 0.0105, "length": 0.03, "solid": "thin"}
    given = {"wall": [tube], "heat.wall_temperature": {}, "heat.patch_temperature": {}, "heat.inlet_temperature": 400.0,
             "vapour.patch_fraction": {}, "vapour.inlet_fraction": 0.02}  # fmt: skip
    simulation = Simulation(Case.from_text(CASE, "c.toml", given))
    fluid, entered = simulation.fluid, 0.0
    for _ in range(20):
        simulation.step()
        entered += fluid.last_step * fluid.face_areas[2] * float(fluid.volume_flux(2)[0].sum())
    heat, found = simulation.feature(HeatExchange), row(simulation)
    amount = fluid.grid.cell_volume * fluid.voidage * fluid.boundaries.cut.own_volume() * fluid.open_cells
    in_fluid = 1200.0 * float((amount * (heat.cells.value - 300.0)).sum())
    in_particles = float((heat.capacity(simulation.owned) * (simulation.owned.temperature - 300.0)).sum())
    vapour = 1.2 * float((amount * simulation.feature(Vapour).cells.value).sum())
    assert in_fluid + in_particles == pytest.approx(1200.0 * 100.0 * entered, rel=1e-6)
    assert vapour == pytest.approx(1.2 * 0.02 * entered, rel=1e-6)
    assert in_particles > 0.05 * in_fluid and (fluid.boundaries.cut.thin > 0.0).sum() > 50
    assert found["heat_imbalance"] < 1e-12 and found["vapour_imbalance"] < 1e-12


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
