"""Temperature as a scalar in the cells of the fluid, and its exchange with the particles."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from golden.beds import SEEDS as golden_seeds
from in_process_ranks import on_ranks

from cfddem import open_run
from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.backend.portions import collected
from cfddem.case.schema import Case
from cfddem.features.heat import HeatExchange
from cfddem.fluid.conditions import FreeSlip, Inlet, Outlet
from cfddem.fluid.scalar import Scalar
from cfddem.fluid.scalar_conditions import ExchangeWall, FluxWall, HeldWall, ScalarSides
from cfddem.run.history import row
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation
from scenarios.validation.heat.hot_bed import hot_bed
from scenarios.validation.heat.packed import HEAT, lattice, packed, schumann
from scenarios.validation.heat.scheme import CONDUCTIVITY, RHO_C, closed_box, fluid_of, moved, orders, scalar

# ---------------------------------------------------------------- order


def test_the_unlimited_scheme_is_second_order_with_moving_voidage_and_the_bounded_one_better_than_first() -> None:
    unlimited, bounded = orders({})
    print(f"orders {unlimited.value:.3f} and {bounded.value:.3f}")
    assert unlimited.verdict == "holds" and unlimited.value >= 1.9 and bounded.value >= 1.5


# ---------------------------------------------------------------- conservation and bounds


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
    lost, outside, received = closed_box(steps)
    print(f"heat changed by {lost:.2g} of all over {steps} steps")
    assert lost < 1e-12 and outside < 1e-9 and abs(received) > 1e-3


@pytest.mark.slow  # as plain tests: the fluid, its pressure, the coupling and particles on all threads
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
    use_threads(1)
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
    heat = at_rest({"x_low": FluxWall(6.0), "x_high": ExchangeWall(2.0, 300.0, 1.0, to_cell)}, 4000.0, 40.0)
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


@pytest.mark.slow
def test_a_packed_bed_cools_as_schumann_solved_it() -> None:
    """Within 1 % of the driving difference everywhere, with cells of 0.27 transfer units and no filter."""
    rows = [each for each in schumann({}) if each.limit is not None]
    assert len(rows) == 3 and all(each.verdict == "holds" for each in rows), rows


@pytest.mark.parametrize("box", [80e-6, pytest.param(0.38e-3, marks=pytest.mark.slow), 2e-3])
def test_tiny_hot_particles_and_gas_meet_at_the_common_temperature_with_steps_far_too_long(box: float) -> None:
    """Spheres of 20 um follow the gas in 3 ms; the capacity of the gas is 1/100 of theirs, the same, or 100 times it.

    Neither side leaves what both were, and heat is kept.
    """
    size, step = 20e-6, 0.01 if box < 1e-4 else 0.05
    case = packed(
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
    for _ in range(8):
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
        packed(heat=HEAT | changes)
    assert len(str(failure.value).splitlines()) == 1


def test_walls_warm_the_gas_by_their_names() -> None:
    walls = {"wall_temperature": {"sides": 350.0, "z_low": 320.0}, "wall_coefficient": {"sides": 50.0}}
    case = packed(heat=HEAT | walls)
    sides = case.feature_tables[0].sides_of(case)  # type: ignore[attr-defined]
    assert sides.walls["y_high"] == ExchangeWall(50.0, 350.0) and sides.walls["z_low"] == HeldWall(320.0)
    round_case = packed(
        heat=HEAT | walls, column={"width": 0.032, "height": 0.048, "cell": 0.004, "shape": "cylinder"},
        bed={"diameter": 2e-3, "count": 10},
    )  # fmt: skip
    sides = round_case.feature_tables[0].sides_of(round_case)  # type: ignore[attr-defined]
    assert sides.walls["solid"] == ExchangeWall(50.0, 350.0, math.pi / 4.0)


# ---------------------------------------------------------------- beds, slow


@pytest.mark.slow
def test_a_hot_bed_in_cold_gas_cools_by_the_balance_of_both_phases() -> None:
    """The gas takes up its heat within the lowest layers, whose seeds cool before they are mixed: it leaves hotter than
    the mean, and a bed that is mixed at once is no balance of it."""
    rows = hot_bed({})
    named = {each.quantity: each for each in rows}
    mixed = next(each for each in rows if "mixed" in each.quantity)
    judged = [each for each in rows if each.limit is not None]
    assert len(judged) == 4 and all(each.verdict == "holds" for each in judged), judged
    assert named["hot bed in cold gas: cooling of the seeds"].value > 20.0 and mixed.value > 0.05
    assert named["hot bed in cold gas: standard deviation of the seeds at the end"].value > 10.0
