"""The fluid on several ranks: fields, pressure iterations and checkpoints are those of one process."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from in_process_ranks import Rank, on_ranks
from test_fluid_pressure import CASES, equation

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import InputError
from cfddem.backend.portions import collected
from cfddem.fluid import budgets
from cfddem.fluid.block import Block, Division, divide
from cfddem.fluid.conditions import SIDES, FreeSlip, Inlet, NoSlip, Outlet, Periodic, discs
from cfddem.fluid.cut_cells import within
from cfddem.fluid.grid import Array, Grid, outside_cylinder
from cfddem.fluid.halo import Borders
from cfddem.fluid.pressure import ranks as shared
from cfddem.fluid.pressure.multigrid import ClosedRegions
from cfddem.fluid.solver import FluidSolver, Scheme
from cfddem.fluid.surfaces import turned
from cfddem.fluid.wall_force import loads_on_walls


@pytest.fixture(autouse=True)
def _small_grids_are_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several levels of these small grids are divided, too."""
    monkeypatch.setattr(shared, "SMALL", 100)


def cut(cells: int, ranks: int) -> tuple[int, ...]:
    """Layers in unequal parts, so that borders lie at odd and even layers."""
    return 0, *(cells * n // ranks + (n == 1 and cells > 4 * ranks) for n in range(1, ranks)), cells


# ---------------------------------------------------------------- pressure


def bricks(cells: Sequence[int], *shape: int) -> Division:
    """Unequal bricks, so many along x, y, z."""
    x, y, z = (cut(count, ranks) for count, ranks in zip(cells, shape))
    return Division((x, y, z))


def along(axis: int, ranks: int) -> list[int]:
    """The shape of slabs."""
    return [ranks if axis == each else 1 for each in range(3)]


def solved_on_ranks(case: dict[str, Any], shape: Sequence[int]) -> tuple[tuple[Array, int], tuple[Array, int]]:
    """Pressure and iterations of one process, and of several ranks."""
    grid, system, b = equation(**case)
    limit, division, ranks = 1e-10 * np.abs(b).max(), bricks(grid.cells, *shape), int(np.prod(shape))
    periodic = np.array(case.get("periodic", (False, False, False)))

    def program(communicator: Communicator) -> tuple[Array, int]:
        block = Block(grid, division, communicator)
        closed = None
        if not case.get("anchored", True):
            closed = ClosedRegions.numbered(block.part(grid.open.astype(np.int64)), communicator)
        own = shared.pressure_equation(block, closed, communicator, periodic, np.array([False, False, True]))
        for level in own.levels:
            level.relaxation = case.get("relaxation", 1.0)
        for mine, whole in zip(own.coefficients, system.coefficients):
            mine[:] = block.part(whole)
        own.prepare()
        x, iterations = own.solve(block.part(b), limit)
        return block.joined(x), iterations

    return system.solve(b, limit), on_ranks(ranks, program)[-1]


@pytest.mark.parametrize("ranks", [2, 3])
@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_pressure_and_iterations_are_those_of_one_process(case: dict[str, Any], ranks: int) -> None:
    """For cuts along each axis that has enough cells."""
    for axis, cells in enumerate(case["cells"]):
        if cells >= 4 * ranks:
            (alone, iterations), (x, others) = solved_on_ranks(case, along(axis, ranks))
            assert others == iterations
            assert np.array_equal(x, alone)


@pytest.mark.parametrize("shape", [(2, 2, 1), (1, 2, 2), (2, 3, 2), (2, 2, 2)])
@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_pressure_of_bricks_is_that_of_one_process(case: dict[str, Any], shape: tuple[int, ...]) -> None:
    """Where each axis has enough cells; coarse cells lie in up to eight bricks."""
    if all(cells >= 4 * ranks or ranks == 1 for cells, ranks in zip(case["cells"], shape)):
        (alone, iterations), (x, others) = solved_on_ranks(case, shape)
        assert others == iterations
        assert np.array_equal(x, alone)


def test_without_messages_the_pressure_needs_more_iterations(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ghosts that are not filled between two colours are a different, slower iteration."""
    filled = []

    def seldom(self: Borders, *arguments: Any) -> None:
        filled.append(0)
        if len(filled) % 3:
            fill(self, *arguments)

    fill = Borders.fill
    (_, iterations), _ = solved_on_ranks(CASES["box"], (1, 1, 1))
    monkeypatch.setattr(Borders, "fill", seldom)
    try:
        _, (_, others) = solved_on_ranks(CASES["box"], (1, 1, 2))
    except Exception:  # it may not converge at all
        others = 10 * iterations
    assert others > iterations


# ---------------------------------------------------------------- fluid

SIZES = (0.1, 0.1, 0.12)

FLOWS: dict[str, tuple[Grid, dict[str, Any], dict[str, Any]]] = {
    "jet": (
        Grid((12, 10, 13), SIZES),
        {"z_low": [NoSlip(), Inlet(0.4, where=discs([(0.6, 0.5)], 0.62))], "z_high": Outlet()},
        {},
    ),
    "driven along x, with eddies": (
        Grid((13, 9, 12), SIZES),
        {
            "z_low": Inlet(lambda x, y, z, t: 0.3 + 0.1 * np.sin(6 * x)), "z_high": Outlet(),
            "x_low": Periodic(1.0), "x_high": Periodic(1.0),
        },
        {"smagorinsky": 0.1},
    ),
    "cylinder, model B": (
        Grid((12, 12, 10), SIZES).with_solid(outside_cylinder((0.6, 0.6, 0), 0.5)),
        {"z_low": Inlet(0.3, where=lambda x, y, z: (x - 0.6) ** 2 + (y - 0.6) ** 2 < 0.25), "z_high": Outlet(2.0)},
        {"model": "B"},
    ),
    "periodic": (Grid((10, 9, 11), SIZES), {side: Periodic() for side in SIDES}, {}),
    "stirred": (Grid((10, 9, 10), SIZES), {"z_high": NoSlip(velocity=(1.0, 0.2, 0.0)), "x_low": FreeSlip()}, {}),
    "outlets at the sides": (
        Grid((10, 9, 10), SIZES),
        {"x_low": Inlet(0.2), "x_high": Outlet(), "y_low": Outlet(1.0)},
        {"convection": "central"},
    ),
    "cone that turns": (
        within(Grid((10, 9, 10), SIZES), turned([(0.0, 0.3), (1.2, 0.43)], (0.52, 0.44, 0.0), spin=0.5)),
        {"z_low": Inlet(0.2), "z_high": Outlet()},
        {},
    ),
}  # fmt: skip


def fluid_of(name: str, communicator: Communicator = SERIAL, division: Division | None = None) -> FluidSolver:
    """A fluid of `FLOWS`, or the part of a rank."""
    whole, sides, others = FLOWS[name]
    grid = whole if division is None else Block(whole, division, communicator)
    fluid = FluidSolver(
        grid, sides, density=1.2, viscosity=1.8e-3, scheme=Scheme(tolerance=1e-11, **others), communicator=communicator
    )
    fluid.set_voidage(grid.part(np.random.default_rng(0).uniform(0.4, 0.9, whole.shape)))
    return fluid


def advanced(fluid: FluidSolver, steps: int = 2) -> None:
    """Steps with a voidage, drag and source that vary from cell to cell."""
    grid, rng = fluid.grid, np.random.default_rng(1)
    shape = grid.whole.shape

    def vectors(scale: float) -> Array:
        return np.moveaxis(grid.part(rng.normal(0.0, scale, (3, *shape))), 0, -1)

    for _ in range(steps):
        voidage = fluid.voidage.copy()
        if fluid.boundaries.has_outlet:
            voidage += grid.part(rng.uniform(-1e-3, 1e-3, shape))
        fluid.step(2e-3, voidage, grid.part(rng.uniform(0.0, 500.0, shape)), vectors(50.0), vectors(5.0))


def everything(fluid: FluidSolver, division: Division | None = None) -> dict[str, Array]:
    """State, forces, budgets, loads on walls and values at points of a fluid, of the whole box."""
    grid, total = fluid.grid, fluid.communicator.sum
    points = np.random.default_rng(2).uniform(0.0, 1.0, (100, 3)) * np.array(grid.whole.size)
    mine = np.ones(len(points), bool)
    if division is not None:
        inside = [np.searchsorted(planes, x, side="right") for planes, x in zip(division.planes(grid.whole), points.T)]
        mine = np.ravel_multi_index(inside, division.shape) == fluid.communicator.rank
    velocity = np.zeros((len(points), 3))
    velocity[mine] = fluid.velocity_at(points[mine])
    return collected(fluid.checkpoint(), fluid.communicator) | {
        "viscous force": grid.joined(fluid.cell_viscous_force()),
        "pressure gradient": grid.joined(fluid.cell_pressure_gradient()),
        "drag": grid.joined(np.moveaxis(budgets.drag_exchange(fluid), -1, 0)),
        "ledger": np.array([line for name, line in budgets.momentum_ledger(fluid).items() if name != "change"]),
        "work": np.array(budgets.works(fluid)),
        "kinetic energy": np.array(budgets.kinetic_energy(fluid)),
        "rates": np.array(fluid.rates()),
        "points": total(velocity, axis=()),
        "loads on walls": np.array(list(loads_on_walls(fluid, np.zeros(3)).values())),
    }


SHAPES = [(1, 2, 1), (2, 2, 2), (3, 1, 2), (3, 1, 1), (1, 1, 3), (2, 2, 1), (3, 3, 3)]
ON_EIGHT = ("driven along x, with eddies", "cylinder, model B", "cone that turns")
"""Flows whose plain test is on eight ranks, too; that of the others is on two alone."""


def is_plain(name: str, shape: tuple[int, ...]) -> bool:
    """Whether a flow on so many ranks is a plain test."""
    return shape == (1, 2, 1) or (shape == (2, 2, 2) and name in ON_EIGHT)


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        pytest.param(name, shape, marks=[pytest.mark.slow] * (not is_plain(name, shape)))
        for name in FLOWS
        for shape in SHAPES
    ],
)
def test_a_divided_fluid_is_the_whole_one(name: str, shape: tuple[int, ...]) -> None:
    """Fields, forces, budgets, loads on walls and values at points after two steps, bit for bit.

    Two ranks run on all threads, the others on one.
    """
    division = bricks(FLOWS[name][0].cells, *shape)

    def program(communicator: Communicator) -> dict[str, Array]:
        part = fluid_of(name, communicator, division)
        advanced(part)
        assert isinstance(communicator, Rank) and len(communicator.partners) <= 6
        return everything(part, division)

    alone = fluid_of(name)
    advanced(alone)
    threads = None if shape == (1, 2, 1) else 1
    expected, found = everything(alone), on_ranks(int(np.prod(shape)), program, threads)
    for state in found:
        for each, value in expected.items():
            assert np.array_equal(np.asarray(state[each]), value), each


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_checkpoint_of_three_ranks_goes_on_with_fewer(ranks: int) -> None:
    """The state after four steps, two of them on three ranks."""
    name = "driven along x, with eddies"

    def half(communicator: Communicator) -> dict[str, Any]:
        part = fluid_of(name, communicator, bricks((13, 9, 12), 3, 1, 1))
        advanced(part)
        return collected(part.checkpoint(), communicator)

    state = on_ranks(3, half)[1]

    def rest(communicator: Communicator) -> dict[str, Any]:
        part = fluid_of(name, communicator, bricks((13, 9, 12), ranks, 1, 1) if ranks > 1 else None)
        part.restore(state)
        advanced(part)
        return collected(part.checkpoint(), communicator)

    whole = fluid_of(name)
    advanced(whole)
    advanced(whole)
    expected, found = whole.checkpoint(), on_ranks(ranks, rest)[0]
    for each, value in expected.items():
        assert np.array_equal(found[each], value), each


# ---------------------------------------------------------------- division


def test_a_grid_is_divided_into_the_bricks_with_least_work() -> None:
    """Equal numbers of particles, at least three layers of cells, small surfaces; or the shape that is given."""
    grid = Grid((20, 8, 40), (0.1, 0.1, 0.1))
    whole = {0: (0, 20), 1: (0, 8), 2: (0, 40)}
    assert divide(grid, 4) == Division(((0, 10, 20), whole[1], (0, 20, 40)))
    assert divide(grid, 4, shape=(4, 1, 1)) == Division(((0, 5, 10, 15, 20), whole[1], whole[2]))
    assert divide(Grid((64, 64, 64), (0.1, 0.1, 0.1)), 8).shape == (2, 2, 2)
    deep = np.random.default_rng(1).uniform(0.0, (2.0, 0.8, 1.0), (1000, 3))  # below a freeboard
    assert divide(grid, 2, deep).shape == (2, 1, 1) and divide(grid, 6, deep).shape == (3, 2, 1)
    crowded = np.array([[0.95, 0.4, 0.1]] * 90 + [[1.95, 0.4, 0.1]] * 10)
    assert divide(grid, 2, crowded, (2, 1, 1)).starts[0][1] in (9, 10)
    assert divide(grid, 2, crowded, (2, 1, 1)).planes(grid)[0][0] <= 1.0
    with pytest.raises(InputError, match=r"at most 6 x 2 x 13.*take 156 ranks"):
        divide(grid, 157)
    with pytest.raises(InputError, match=r"division = '7x1x1'.*along that axis"):
        divide(grid, 7, shape=(7, 1, 1))
    with pytest.raises(InputError, match="4 ranks in all"):
        divide(grid, 4, shape=(2, 1, 1))
