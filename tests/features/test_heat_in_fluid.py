"""Temperature as a scalar in the cells of the fluid, and its exchange with the particles."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from golden.beds import SEEDS as golden_seeds
from in_process_ranks import on_ranks
from scipy.integrate import quad
from scipy.special import i0e
from two_phase_balance import Balances, TwoPhaseBalance

from cfddem import open_run
from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.backend.portions import collected
from cfddem.case.schema import Case
from cfddem.features.heat import HeatExchange
from cfddem.fluid.conditions import FreeSlip, Inlet, Outlet, Periodic
from cfddem.fluid.grid import Grid
from cfddem.fluid.scalar import Scalar, ScalarKind
from cfddem.fluid.scalar_conditions import ExchangeWall, FluxWall, HeldWall, ScalarSides
from cfddem.fluid.solver import FluidSolver
from cfddem.run.history import row
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation
from closures.registry import law

RHO_C, CONDUCTIVITY = 1200.0, 0.03


def scalar(fluid: FluidSolver, sides: ScalarSides, **changes: Any) -> Scalar:
    """A temperature that starts at 300 K."""
    given = {"start": 300.0, "capacity": RHO_C, "conductivity": CONDUCTIVITY} | changes
    return Scalar(fluid, ScalarKind("temperature", "K", "temperature of the fluid", **given), sides)


def fluid_of(cells: tuple[int, int, int], conditions: dict[str, Any], size: float = 0.01) -> FluidSolver:
    return FluidSolver(Grid(cells, (size,) * 3), conditions, density=1.2, viscosity=1.8e-5)


# ---------------------------------------------------------------- order


def manufactured_error(n: int, unlimited: bool) -> float:
    """L2 error of a manufactured temperature in a moving voidage, with exchange and diffusion.

    The voidage is a wave along x. The flux has its rate of change as divergence, and eddies.
    """
    length, end, steps = 1.0, 0.5, n
    k, h, beta, speed = 2.0 * math.pi / length, 0.5 / n, 3.0, 1.0
    periodic = dict.fromkeys(("x_low", "x_high", "z_low", "z_high"), Periodic())
    fluid = FluidSolver(
        Grid((n, 1, n), (length / n,) * 3), periodic | {"y_low": FreeSlip(), "y_high": FreeSlip()},
        density=1.0, viscosity=1e-3,
    )  # fmt: skip
    x, _, z = fluid.grid.centres()
    diffusivity, capacity = 0.02, 2.0

    def voidage(t: float) -> np.ndarray:
        return np.asarray(0.6 + 0.1 * np.cos(k * (x - speed * t)) + 0.0 * z)

    def exact(t: float) -> np.ndarray:
        return np.asarray(1.0 + np.sin(k * x - 2.0 * t) * np.cos(k * z + t))

    def flux(x: np.ndarray, z: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        eddy = 0.3
        along = 0.2 + 0.1 * speed * np.cos(k * (x - speed * t)) + eddy * np.sin(k * x) * np.cos(k * z)
        return along, 0.1 - eddy * np.cos(k * x) * np.sin(k * z)

    def source(t: float) -> np.ndarray:
        phase_x, phase_z = k * x - 2.0 * t, k * z + t
        sx, cx, sz, cz = np.sin(phase_x), np.cos(phase_x), np.sin(phase_z), np.cos(phase_z)
        eps, eps_x = voidage(t), -0.1 * k * np.sin(k * (x - speed * t))
        fx, fz = flux(x, z, t)
        carried = eps * (-2.0 * cx * cz - sx * sz) + fx * k * cx * cz - fz * k * sx * sz
        spread = eps * (-2.0 * k * k * sx * cz) + eps_x * k * cx * cz
        return np.asarray(capacity * (carried - diffusivity * spread))

    fluid.set_voidage(voidage(0.0))
    kind = ScalarKind("temperature", "K", "", 1.0, capacity, capacity * diffusivity, unlimited=unlimited)
    heat = Scalar(fluid, kind, ScalarSides(1.0))
    heat.value[:] = exact(0.0)
    for step in range(steps):
        t = step * h
        middle = t + 0.5 * h
        fluid._set_cells(fluid.fields.mean_voidage, voidage(middle))
        fluid.fields.owned("voidage_rate")[:] = (voidage(t + h) - voidage(t)) / h
        fluid.voidage[:] = voidage(t + h)
        for axis in (0, 2):
            at = fluid.grid.faces(axis)
            through = np.broadcast_arrays(flux(at[0], at[2], middle)[axis // 2] + 0.0 * at[0] + 0.0 * at[2])[0]
            fluid.face_velocity(axis)[:] = through
        fluid.boundaries.fill_velocity(fluid.fields.velocity)
        for axis in (0, 2):
            eps = 0.5 * (fluid.fields.mean_voidage + np.roll(fluid.fields.mean_voidage, 1, axis=2 - axis))
            fluid.fields.velocity[axis] /= eps
        fluid.last_step, fluid.time = h, t + h
        target = exact(middle) + source(middle) / beta
        heat.step(np.full(fluid.grid.shape, beta), beta * target)
    assert steps * h == end
    return float(np.sqrt(np.mean((heat.value - exact(end)) ** 2)))


def test_the_unlimited_scheme_is_second_order_with_moving_voidage_and_the_bounded_one_better_than_first() -> None:
    for unlimited, least in ((True, 1.9), (False, 1.5)):
        errors = [manufactured_error(n, unlimited) for n in (16, 32, 64)]
        orders = [math.log2(a / b) for a, b in pairwise(errors)]
        print(f"unlimited {unlimited}: errors {errors}, orders {orders}")
        assert min(orders) >= least


# ---------------------------------------------------------------- conservation and bounds


def moved(fluid: FluidSolver, random: np.random.Generator) -> np.ndarray:
    """A voidage near the present one, of the same sum."""
    change = random.random(fluid.grid.shape)
    change -= change.mean()
    return np.asarray(fluid.voidage + 0.1 * (0.6 + 0.2 * change - fluid.voidage))


def test_a_uniform_temperature_stays_uniform_to_round_off_in_a_moving_voidage() -> None:
    fluid, random = fluid_of((4, 5, 6), {"z_low": Inlet(0.3), "z_high": Outlet()}), np.random.default_rng(1)
    fluid.set_voidage(0.5 + 0.2 * random.random(fluid.grid.shape))
    fluid.set_velocity((0.0, 0.0, 0.0))
    heat = scalar(fluid, ScalarSides(300.0))
    for _ in range(100):
        fluid.step(1e-3, moved(fluid, random))
        heat.step()
    assert np.abs(heat.value - 300.0).max() < 1e-12 * 300.0
    assert np.abs(heat.fields.owned("stored") - fluid.voidage).max() < 1e-7


@pytest.mark.parametrize("steps", [200, pytest.param(10_000, marks=pytest.mark.slow)])
def test_heat_is_conserved_in_a_closed_box_and_stays_between_what_it_was(steps: int) -> None:
    fluid, random = fluid_of((4, 3, 5), {}), np.random.default_rng(2)
    fluid.set_voidage(0.6)
    fluid.set_velocity((0.0, 0.0, 0.0))
    heat, volume = scalar(fluid, ScalarSides(300.0)), fluid.grid.cell_volume
    heat.value[:] = 300.0 + 100.0 * random.random(fluid.grid.shape)
    solids, capacity, beta = 280.0 + 200.0 * random.random(fluid.grid.shape), 5e4, 2e5
    least, most = min(heat.value.min(), solids.min()), max(heat.value.max(), solids.max())
    start, given = heat.content + volume * capacity * float(solids.sum()), heat.content
    for _ in range(steps):
        fluid.step(1e-3, moved(fluid, random))
        share = beta / (1.0 + fluid.last_step * beta / capacity)
        seen = heat.step(np.full(fluid.grid.shape, share), share * solids)
        solids += fluid.last_step * share / capacity * (seen - solids)
        assert least - 1e-9 <= heat.value.min() and heat.value.max() <= most + 1e-9
    end = heat.content + volume * capacity * float(solids.sum())
    print(f"heat changed by {abs(end - start) / start:.2g} of all over {steps} steps")
    assert abs(end - start) < 1e-12 * start
    assert abs(heat.content - given) > 1e-3


def test_the_cells_have_the_same_bits_on_two_threads() -> None:
    """The step of the scalar, of the same flow."""
    found = []
    for threads in (1, 2):
        use_threads(1)
        fluid, random = fluid_of((7, 6, 9), {"z_low": Inlet(0.3), "z_high": Outlet()}), np.random.default_rng(3)
        fluid.set_voidage(0.5 + 0.2 * random.random(fluid.grid.shape))
        fluid.set_velocity((0.0, 0.0, 0.0))
        heat, beta = (
            scalar(fluid, ScalarSides(350.0, walls={"x_low": HeldWall(320.0)})),
            random.random(fluid.grid.shape),
        )
        for _ in range(5):
            use_threads(1)
            fluid.step(1e-3, moved(fluid, random))
            use_threads(threads)
            heat.step(100.0 * beta, 3.3e4 * beta)
        found.append(heat.value.copy())
    assert np.array_equal(*found) and np.ptp(found[0]) > 1.0


def test_fluid_that_particles_displace_takes_its_heat_along() -> None:
    fluid = fluid_of((3, 3, 3), {})
    fluid.set_voidage(0.8)
    heat = scalar(fluid, ScalarSides(300.0))
    heat.value[:] = 340.0
    fluid.add_voidage(np.full(fluid.grid.shape, -0.1))
    assert heat.sums["displaced"] == pytest.approx(-0.1 * RHO_C * 27e-6 * 40.0)
    assert heat.content == pytest.approx(0.7 * RHO_C * 27e-6 * 40.0) and (heat.value == 340.0).all()


# ---------------------------------------------------------------- sides


def at_rest(walls: dict[str, Any], seconds: float, step: float, **changes: Any) -> Scalar:
    """Eight cells along x after a time, without flow."""
    fluid = fluid_of((8, 1, 1), {"y_low": FreeSlip(), "y_high": FreeSlip(), "z_low": FreeSlip(), "z_high": FreeSlip()})
    heat = scalar(fluid, ScalarSides(300.0, walls=walls), **changes)
    for _ in range(round(seconds / step)):
        fluid.step(step)
        heat.step()
    return heat


def test_conduction_between_two_walls_is_linear_and_what_they_give_is_stored() -> None:
    heat = at_rest({"x_low": HeldWall(380.0), "x_high": HeldWall(300.0)}, 2000.0, 20.0)
    assert heat.value[0, 0] == pytest.approx(380.0 - 80.0 * (np.arange(8) + 0.5) / 8.0, abs=1e-6)
    assert heat.sums["walls"] == pytest.approx(heat.content, rel=1e-12)


@pytest.mark.parametrize("to_cell", [False, True])
def test_walls_with_a_flux_and_with_a_coefficient_balance(to_cell: bool) -> None:
    """In the end the flux in leaves through the wall with a coefficient, whose surface, or cell, is at 300 K + q/h."""
    heat = at_rest({"x_low": FluxWall(6.0), "x_high": ExchangeWall(2.0, 300.0, 1.0, to_cell)}, 4000.0, 20.0)
    slope = 6.0 / CONDUCTIVITY * 0.01
    beyond = 7.0 if to_cell else 7.5
    assert heat.value[0, 0] == pytest.approx(303.0 + slope * (beyond - np.arange(8)), abs=1e-4)


@pytest.mark.parametrize("cells", [2, 8])
def test_a_wall_with_a_coefficient_passes_the_heat_of_its_resistance_in_series_on_any_cells(cells: int) -> None:
    """Between 380 K outside of a coefficient of 2 W/m2/K and a surface of 300 K: q = 80 K / (1/h + L/k)."""
    closed = {"y_low": FreeSlip(), "y_high": FreeSlip(), "z_low": FreeSlip(), "z_high": FreeSlip()}
    fluid = fluid_of((cells, 1, 1), closed, size=0.08 / cells)
    heat = scalar(fluid, ScalarSides(300.0, walls={"x_low": ExchangeWall(2.0, 380.0), "x_high": HeldWall(300.0)}))
    flux = 80.0 / (1.0 / 2.0 + 0.08 / CONDUCTIVITY)
    at = (np.arange(cells) + 0.5) * 0.08 / cells
    heat.value[0, 0] = 300.0 + flux / CONDUCTIVITY * (0.08 - at)
    before = heat.value.copy()
    for _ in range(10):
        fluid.step(20.0)
        heat.step()
    assert heat.value == pytest.approx(before, abs=1e-9)


def test_voidage_lowers_the_conductivity_by_the_choice_of_the_user() -> None:
    for spread, share in (("none", 0.64), ("zehner_schluender", 0.4)):
        fluid = fluid_of((4, 1, 1), {"y_low": FreeSlip(), "y_high": FreeSlip()})
        fluid.set_voidage(0.64)
        heat = scalar(fluid, ScalarSides(300.0, walls={"x_low": HeldWall(310.0)}), spread=spread)
        fluid.step(1e-3)
        heat.step()
        given = share * CONDUCTIVITY * 10.0 / 0.005 * 1e-4 * 1e-3
        assert heat.sums["walls"] == pytest.approx(given, rel=1e-3)


# ---------------------------------------------------------------- with particles


@law("heat_transfer", "a number for these tests")
def four(reynolds: float, prandtl: float) -> float:
    """Nusselt number of four at any flow."""
    return 4.0


HEAT: dict[str, Any] = {
    "particle_temperature": 400.0,
    "fluid_temperature": 300.0,
    "conductivity": 0.026,
    "fluid_heat_capacity": 1000.0,
    "heat_capacity": {"glass": 800.0},
}


def lattice(spacing: float, counts: tuple[int, int, int]) -> list[tuple[float, float, float]]:
    x, y, z = (spacing * (np.arange(n) + 0.5) for n in counts)
    return [(float(a), float(b), float(c)) for c in z for b in y for a in x]


def case_of(**changes: Any) -> Case:
    """A packed bed of 2 mm spheres in air, on a lattice; changes with __ for the point."""
    values: dict[str, Any] = {
        "fluid": {"density": 1.2, "viscosity": 1.8e-5},
        "material.glass": {"density": 2500.0, "youngs_modulus": 1e6, "poisson": 0.25, "friction": 0.3},
        "column": {"width": 0.008, "height": 0.048, "cell": 0.004, "sides": "free_slip"},
        "bed": {"diameter": 2e-3, "positions": lattice(2e-3, (4, 4, 20)), "inlet_velocity": 0.5, "fixed": True},
        "laws": {"drag": "gidaspow_smooth", "lubrication": "none", "agitation": "none"},
        "run": {"until": 1.0, "reference_speed": 1.0},
        "heat": HEAT,
    }
    return Case.from_text("", overrides=values | {name.replace("__", "."): value for name, value in changes.items()})


def schumann(distance: float, time: float) -> float:
    """Temperature of the solids of a packed bed, 0 at the start, where a fluid of 1 enters (Schumann 1929).

    distance  h a x / (rho c u) of the place
    time      h a t / (rho c of the solids), since the first fluid has passed there
    """

    def rate(z: float) -> float:  # e^(-y - z) I0(2 sqrt(y z)), by the scaled Bessel function
        return math.exp(-((math.sqrt(distance) - math.sqrt(z)) ** 2)) * float(i0e(2.0 * math.sqrt(distance * z)))

    return float(quad(rate, 0.0, max(time, 0.0), limit=200)[0])


@pytest.mark.slow
def test_a_packed_bed_cools_as_schumann_solved_it() -> None:
    """Within 1 % of the driving difference everywhere, with cells of 0.27 transfer units and no filter."""
    layers, spacing, number, speed = 120, 2e-3, 4.0, 1.0
    case = case_of(
        column__height=0.26, bed__positions=lattice(spacing, (4, 4, layers)), bed__inlet_velocity=speed,
        laws__heat_transfer="four", laws__kernel_width=0.0,
        heat=HEAT | {"fluid_temperature": 400.0, "inlet_temperature": 300.0, "heat_capacity": {"glass": 5.0}},
    )  # fmt: skip
    simulation = Simulation(case)
    volume, conductance = math.pi / 6.0 * 8e-9, math.pi * 2e-3 * 0.026 * number
    per_length, rate = conductance / (1.2 * 1000.0 * speed * spacing**3), conductance / (2500.0 * volume * 5.0)
    voidage = 1.0 - volume / spacing**3
    for time in (0.5, 0.8, 1.1):
        simulation.until(time)
        order = np.argsort(simulation.particles.position[:, 2])
        z = simulation.particles.position[order, 2].reshape(layers, 16).mean(axis=1)
        found = (400.0 - simulation.particles.temperature[order].reshape(layers, 16).mean(axis=1)) / 100.0
        exact = np.array([schumann(per_length * x, rate * (time - voidage * x / speed)) for x in z])
        error = np.abs(found - exact)
        print(f"t = {time} s: mean {found.mean():.4f}, mean error {error.mean():.5f}, largest {error.max():.5f}")
        assert error.max() < 0.01
    assert simulation.feature(HeatExchange).imbalance < 1e-12


@pytest.mark.parametrize("box", [80e-6, 0.38e-3, 2e-3])
def test_tiny_hot_particles_and_gas_meet_at_the_common_temperature_with_steps_far_too_long(box: float) -> None:
    """Spheres of 20 um follow the gas in 3 ms; the capacity of the gas is 1/100 of theirs, the same, or 100 times it.

    Neither side leaves what both were, and heat is kept.
    """
    size, step = 20e-6, 0.01 if box < 1e-4 else 0.05
    case = case_of(
        column={"width": box, "height": box, "cell": 0.5 * box, "sides": "periodic", "ends": "periodic"},
        bed={"diameter": size, "positions": lattice(0.5 * box, (2, 2, 2)), "fixed": True},
        laws__gravity=(0.0, 0.0, 0.0),
    )  # fmt: skip
    simulation = Simulation(case)
    simulation.step()
    heat, fluid = simulation.feature(HeatExchange), simulation.fluid
    assert heat.cells is not None
    capacity = float(heat.capacity(simulation.particles).sum())
    of_gas = 1200.0 * (box**3 - float(simulation.particles.volume.sum()))
    common = (400.0 * capacity + 300.0 * of_gas) / (capacity + of_gas)
    hot, gas = simulation.particles.temperature, heat.cells.value
    for _ in range(20):
        fluid.step(step)
        heat.before(simulation, step)
        hot, gas = simulation.particles.temperature, heat.cells.value
        assert 300.0 <= hot.min() <= hot.max() <= 400.0 and 300.0 - 1e-9 <= gas.min() <= gas.max() <= 400.0 + 1e-9
        assert abs(capacity * (hot.mean() - 400.0) + heat.cells.content) < 1e-12 * (capacity + of_gas) * 400.0
    print(f"common {common:.4f} K: particles {hot.mean():.4f}, gas {gas.mean():.4f}, {heat.cells.parts} parts")
    assert hot == pytest.approx(common, abs=0.01) and gas == pytest.approx(common, abs=0.01)


SEEDS = Case.from_text(golden_seeds, "seeds", {"heat": {**HEAT, "heat_capacity": {"seed": 100.0}}})


def advanced(simulation: Simulation, steps: int) -> dict[str, np.ndarray]:
    """Temperatures after some steps, of particles by id and of the cells, and the columns of the history."""
    for _ in range(steps):
        simulation.step()
    heat, order = simulation.feature(HeatExchange), np.argsort(simulation.whole("id"))
    (cells,) = collected(heat.cells_for_snapshot(), simulation.communicator).values()
    values = {name: value for name, value in row(simulation).items() if "heat" in name or "temperature" in name}
    return {"particles": simulation.whole("temperature")[order], "cells": cells, "row": np.array(list(values.values()))}


def test_a_run_resumes_with_the_same_bits() -> None:
    first = Simulation(SEEDS)
    advanced(first, 20)
    again = Simulation.restored(SEEDS, first.checkpoint())
    expected, found = advanced(first, 10), advanced(again, 10)
    assert all(np.array_equal(values, found[name]) for name, values in expected.items())


def test_two_ranks_have_the_bits_of_one_process() -> None:
    alone = advanced(Simulation(SEEDS), 30)
    for found in on_ranks(2, lambda ranks: advanced(Simulation(SEEDS, communicator=ranks), 30)):
        assert all(np.array_equal(values, found[name]) for name, values in alone.items())
    assert np.ptp(alone["cells"]) > 10.0


def test_history_and_snapshots_have_the_temperature_of_the_fluid(tmp_path: Path) -> None:
    Run.begin(SEEDS.with_(**{"run.until": 0.004, "run.every": 0.002}), tmp_path / "run").go()
    data = open_run(tmp_path / "run")
    assert data.fluid("temperature").shape == data.fluid("voidage").shape
    assert data.fluid("temperature").max() > 310.0 and data.quantities["fluid"]["temperature"].unit == "K"
    stored, balance = data.history["heat_stored"][-1], data.history["heat_in"][-1] - data.history["heat_out"][-1]
    assert data.history["outlet_temperature"][-1] >= 300.0 and abs(stored - balance) < 1e-9


# ---------------------------------------------------------------- input


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inlet_temperature": -1.0}, "heat.inlet_temperature"),
        ({"wall_temperature": {"sides": -1.0}}, "heat.wall_temperature.sides"),
        ({"wall_temperature": {"roof": 300.0}}, "heat.wall_temperature.roof.*one of the walls sides, x_low"),
        ({"wall_coefficient": {"x_low": 20.0}}, "heat.wall_coefficient.x_low.*of a wall with a temperature"),
        ({"wall_temperature": {"x_low": 300.0}, "wall_flux": {"x_low": 5.0}}, "heat.wall_flux.x_low"),
        ({"fluid": "uniform", "inlet_temperature": 300.0}, "heat.inlet_temperature.*one temperature"),
        ({"fluid": "cells", "fluid_total_capacity": 1.0}, "heat.fluid_total_capacity.*left out with cells"),
        ({"fluid_heat_capacity": -1000.0}, "heat.fluid_heat_capacity"),
    ],
)
def test_wrong_input_is_refused_in_one_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as failure:
        case_of(heat=HEAT | changes)
    assert len(str(failure.value).splitlines()) == 1


def test_walls_warm_the_gas_by_their_names() -> None:
    walls = {"wall_temperature": {"sides": 350.0, "z_low": 320.0}, "wall_coefficient": {"sides": 50.0}}
    case = case_of(heat=HEAT | walls)
    sides = case.feature_tables[0].sides_of(case)  # type: ignore[attr-defined]
    assert sides.walls["y_high"] == ExchangeWall(50.0, 350.0) and sides.walls["z_low"] == HeldWall(320.0)
    round_case = case_of(
        heat=HEAT | walls, column={"width": 0.032, "height": 0.048, "cell": 0.004, "shape": "cylinder"},
        bed={"diameter": 2e-3, "count": 10},
    )  # fmt: skip
    sides = round_case.feature_tables[0].sides_of(round_case)  # type: ignore[attr-defined]
    assert sides.walls["solid"] == ExchangeWall(50.0, 350.0, math.pi / 4.0)


# ---------------------------------------------------------------- beds, slow


@pytest.mark.slow
def test_a_hot_bed_in_cold_gas_cools_by_the_balance_of_both_phases() -> None:
    """3 000 fluidised seeds: their mean temperature beside balances, of which each has one thing less than the one
    before: bubbles and the place of every seed; its place alone; neither, gas that leaves as hot as the mean.

    The first two are by another route (:mod:`two_phase_balance`) and within 2 % of the cooling. The gas takes up its
    heat within the lowest layers, whose seeds cool before they are mixed: it leaves hotter than the mean.
    """
    speed, capacity = 1.2, 400.0
    case = SEEDS.with_(**{
        "bed.count": 3000, "column.height": 0.0576, "bed.inlet_velocity": speed, "laws.heat_transfer": "gunn",
        "heat.heat_capacity": {"seed": capacity}, "run.reference_speed": 2.0,
    })  # fmt: skip
    simulation = Simulation(case)
    simulation.until(0.1)  # the gas of the start has left
    heat, flow = simulation.feature(HeatExchange), 1.13 * speed * 0.0144**2 * 1000.0
    assert heat.cells is not None
    air = (1.13, 1000.0, 0.026, 1.68144e-5)
    in_cells, in_layers = (TwoPhaseBalance(simulation, air, capacity, 300.0, each) for each in ("cells", "layers"))
    simulation.add(Balances([in_cells, in_layers]))
    of_bed = float(heat.capacity(simulation.particles).sum())
    begin, first, gas = simulation.time, float(simulation.particles.temperature.mean()), heat.cells.content
    by_air = first
    worst = dict.fromkeys(("air that leaves", "cells", "layers", "mixed"), 0.0)
    while simulation.time < 1.0:
        simulation.step()
        by_air -= flow * simulation.last_step * (heat.cells.leaving - 300.0) / of_bed
        mean = float(simulation.particles.temperature.mean())
        expected = {
            "air that leaves": by_air - (heat.cells.content - gas) / of_bed,
            "cells": float(in_cells.hot.mean()),
            "layers": float(in_layers.hot.mean()),
            "mixed": 300.0 + (first - 300.0) * math.exp(-flow / of_bed * (simulation.time - begin)),
        }
        worst = {name: max(worst[name], abs(mean - each)) for name, each in expected.items()}
    cooled, spread = first - mean, float(simulation.particles.temperature.std())
    print(f"cooled by {cooled:.1f} K, spread of the seeds {spread:.1f} K; gas leaves with {heat.cells.leaving:.1f} K")
    print("off, of the cooling: " + ", ".join(f"{name} {each / cooled:.5f}" for name, each in worst.items()))
    assert cooled > 20.0
    assert all(worst[name] < 0.02 * cooled for name in ("air that leaves", "cells", "layers"))
    assert worst["mixed"] > 0.05 * cooled and spread > 10.0
    assert simulation.feature(HeatExchange).imbalance < 1e-11
