"""Sums, extremes and decisions over all ranks: what the communicator returns, and that there is no other route."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from in_process_ranks import on_ranks

from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError, RunFailed
from cfddem.fluid.conditions import Inlet, Outlet
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver

ROOT = Path(__file__).parents[2]

ROOMS = ("particles", "fluid", "coupling", "run")
"""Rooms whose arrays have rows of particles or cells, and so are divided among ranks."""

REDUCTIONS = {
    "sum", "max", "min", "any", "all", "mean", "average", "std", "var", "median", "quantile", "percentile", "prod",
    "argmax", "argmin", "dot", "vdot", "norm", "count_nonzero", "bincount", "ptp", "amax", "amin", "nansum", "nanmax",
    "nanmin", "nanmean", "reduce", "array_equal", "allclose",
}  # fmt: skip
"""Methods, and functions of NumPy, that make one number of an array."""

LOCAL_FILES = {
    "fluid/grid.py": "every rank knows the grid of the whole box",
    "fluid/cell_counts.py": "three lengths",
    "fluid/conditions.py": "regions of the whole box",
    "fluid/boundaries.py": "every rank knows the conditions of the whole box",
    "particles/walls/": "every rank knows all walls",
    "particles/initial/": "every rank makes all particles before the run starts",
    "coupling/self_disturbance_tables.py": "every rank computes the tables of the whole lattice",
    "run/initial_particles.py": "every rank makes all particles before the run starts",
    "fluid/viscosity.py": "every rank knows the solid cells of the whole box",
    "fluid/cut_cells.py": "every rank knows the smooth walls of the whole box",
    "fluid/cell_groups.py": "every rank knows the groups of the whole box",
    "fluid/near_walls.py": "along axes and neighbours of one cell",
    "fluid/surfaces.py": "every rank knows the smooth walls of the whole box",
    "fluid/triangles.py": "every rank knows the smooth walls of the whole box",
    "fluid/thin_walls.py": "every rank knows the walls of the whole box",
    "fluid/wall_force.py": "along the axes of one cell",
}
"""Files and folders that reduce only arrays that every rank knows whole: the input of a run, and what is made before it
starts."""


def reductions(path: Path) -> Iterator[tuple[int, str]]:
    """Lines of a file that reduce an array without a communicator and without a mark `# local: reason`."""
    lines = path.read_text(encoding="utf-8").splitlines()

    def visit(node: ast.AST) -> Iterator[int]:
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            owner = ast.unparse(node.func.value)
            if owner.endswith("communicator"):
                return
            if node.func.attr in REDUCTIONS and owner != "math":
                yield node.end_lineno or node.lineno
        for child in ast.iter_child_nodes(node):
            yield from visit(child)

    for number in sorted(set(visit(ast.parse("\n".join(lines))))):
        reason = lines[number - 1].partition("# local: ")[2].strip()
        if not reason:
            yield number, lines[number - 1].strip()


def other_routes(room: str) -> list[str]:
    """All reductions of a room that bypass the communicator, as file:line: text."""
    found = []
    for path in sorted((ROOT / "cfddem" / room).rglob("*.py")):
        name = path.relative_to(ROOT / "cfddem").as_posix()
        if not name.startswith(tuple(LOCAL_FILES)):
            found += [f"cfddem/{name}:{number}: {text}" for number, text in reductions(path)]
    return found


@pytest.mark.parametrize("room", ROOMS)
def test_arrays_of_particles_and_cells_are_reduced_by_the_communicator_only(room):
    found = other_routes(room)
    assert not found, "\n".join(["use the communicator, or mark the line with `# local: reason`:", *found])


def test_files_that_reduce_whole_arrays_exist():
    missing = [name for name in LOCAL_FILES if not (ROOT / "cfddem" / name).exists()]
    assert not missing


def test_the_scan_finds_reductions_and_accepts_the_communicator_and_marks(tmp_path):
    path = tmp_path / "example.py"
    path.write_text(
        "a = x.max()\n"
        "b = float(np.linalg.norm(v))\n"
        "c = self.communicator.sum(np.abs(x.sum(axis=1)))\n"
        "d = x.sum(axis=1)  # local: components of a row\n"
        "e = x.sum(axis=1)  # local:\n"
        "f = math.prod((2, 3)) + max(1, 2)\n"
        "g = np.count_nonzero(\n    x > communicator.largest(x)\n)\n",
        encoding="utf-8",
    )
    assert [number for number, _ in reductions(path)] == [1, 2, 5, 9]


# ---------------------------------------------------------------- values


@pytest.mark.parametrize("values", [np.random.default_rng(1).normal(size=(7, 5, 9)), np.arange(12).reshape(3, 4)])
def test_serial_reductions_are_those_of_numpy(values):
    one = Communicator()
    assert (one.rank, one.size) == (0, 1)
    assert one.sum(values) == pytest.approx(math.fsum(values.flat), rel=1e-15)
    assert one.largest(values) == values.max()
    assert one.smallest(values) == values.min()
    assert one.mean(values) == pytest.approx(values.mean(), rel=1e-14)
    assert one.count(values > 1) == np.count_nonzero(values > 1)
    assert one.sum(values, axis=0) == pytest.approx(values.sum(axis=0), rel=1e-14)
    assert np.array_equal(one.largest(values, axis=(0, 1)), values.max(axis=(0, 1)))
    assert np.array_equal(one.sum(values, axis=()), values)


@pytest.mark.parametrize("ranks", [2, 3, 5, 8])
def test_a_sum_has_the_bits_of_one_process_however_the_array_is_divided(ranks):
    """Terms of very different size, in another order on every number of ranks; sums in turn by NumPy differ."""
    random = np.random.default_rng(ranks)
    values = random.normal(size=(4001, 3)) * 10.0 ** random.uniform(-12.0, 12.0, size=(4001, 1))
    parts = np.split(values[random.permutation(len(values))], np.sort(random.integers(0, len(values), ranks - 1)))
    alone = Communicator().sum(values), Communicator().sum(values, axis=0)
    exact = math.fsum(values.flat)
    assert alone[0] == pytest.approx(exact, abs=len(values) * 2.0**-61 * np.abs(values).max() + 1e-15 * abs(exact))

    def program(communicator):
        mine = parts[communicator.rank]
        return communicator.sum(mine), communicator.sum(mine, axis=0), communicator.mean(mine)

    for total, columns, mean in on_ranks(ranks, program):
        assert total == alone[0]
        assert np.array_equal(columns, alone[1])
        assert mean == Communicator().mean(values)
    assert sum(float(part.sum()) for part in parts) != float(values.sum())  # otherwise this shows nothing


@given(
    st.lists(st.floats(-1e300, 1e300, allow_subnormal=True), min_size=1, max_size=40),
    st.randoms(use_true_random=False),
)
def test_an_exact_sum_is_that_of_any_order(values, random):
    one, shuffled = Communicator(), list(values)
    random.shuffle(shuffled)
    assert one.sum(values) == one.sum(shuffled)
    limit = 2.0**-55 * max(map(abs, values))
    assert abs(one.sum(values) - math.fsum(values)) <= limit + 2.0**-52 * abs(math.fsum(values)) + 1e-300


def test_rows_of_all_ranks_are_joined_in_their_order():
    rows = [np.arange(6.0).reshape(3, 2), np.full((1, 2), 7.0)]
    assert np.array_equal(Communicator().joined(rows[0]), rows[0])
    joined = on_ranks(2, lambda communicator: communicator.joined(rows[communicator.rank]))[0]
    assert np.array_equal(joined, np.concatenate(rows))


def test_results_are_plain_numbers():
    one = Communicator()
    assert type(one.sum(np.ones(3))) is float
    assert type(one.sum(np.ones(3, int))) is int
    assert type(one.largest(np.arange(3))) is int
    assert type(one.any(np.array([True]))) is bool


def test_nan_survives_extremes_and_sums():
    one, values = Communicator(), np.array([1.0, np.nan, -2.0])
    assert math.isnan(one.largest(values))
    assert math.isnan(one.smallest(values))
    assert math.isnan(one.sum(values))
    assert np.array_equal(one.sum(np.array([values, values]).T, axis=1), [2.0, np.nan, -4.0], equal_nan=True)

    def program(communicator):
        mine = [1.0 if communicator.rank else math.nan]
        return communicator.largest(mine), communicator.smallest(mine), communicator.sum(mine)

    for found in on_ranks(2, program):
        assert all(map(math.isnan, found))


def test_a_rank_without_rows_changes_nothing():
    one, nothing = Communicator(), np.zeros(0)
    assert one.sum(nothing) == 0.0
    assert one.largest(nothing) == -math.inf
    assert one.smallest(nothing) == math.inf
    assert one.largest(np.zeros(0, int), default=-1) == -1
    assert np.array_equal(one.largest(np.zeros((0, 2)), axis=0), [-math.inf, -math.inf])
    assert not one.any(nothing)
    assert one.all(nothing)
    assert math.isnan(one.mean(nothing))


def test_a_parallel_communicator_combines_the_values_of_its_ranks():
    def program(communicator):
        other = communicator.rank == 1
        return {
            "sum": communicator.sum([4.0] if other else [1.0, 2.0]),
            "largest": communicator.largest([4.0] if other else [1.0, 2.0]),
            "smallest": communicator.smallest([-4.0] if other else [1.0, 2.0]),
            "any": communicator.any([other]),
            "all": communicator.all([not other]),
            "count": communicator.count([True] * 5 if other else [True, False]),
            "mean": communicator.mean([5.0] if other else [1.0]),
            "first": communicator.first("second" if other else None),
            "added": communicator.sum(np.array([1, 2] if other else [10, 20]), axis=()).tolist(),
        }

    wanted = {
        "sum": 7.0, "largest": 4.0, "smallest": -4.0, "any": True, "all": False, "count": 6, "mean": 3.0,
        "first": "second", "added": [11, 22],
    }  # fmt: skip
    assert on_ranks(2, program) == [wanted, wanted]


# ---------------------------------------------------------------- the fluid asks it


class Beside(Communicator):
    """Beside a second rank whose share of the fluid is what `change` makes of each combined value."""

    size = 2
    change = staticmethod(lambda value, operation: value)

    def _combine(self, local: Any, operation: Any) -> Any:
        return self.change(local, operation)


def channel(communicator: Communicator) -> FluidSolver:
    """A channel with an inlet and an outlet."""
    grid = Grid((4, 4, 6), (0.1, 0.1, 0.1))
    sides = {"z_low": Inlet(0.1), "z_high": Outlet()}
    return FluidSolver(grid, sides, density=1.2, viscosity=1.8e-5, communicator=communicator)


def test_faster_flow_on_another_rank_shortens_the_step_of_the_fluid():
    other = Beside()
    fluid = channel(other)
    alone = fluid.largest_step().step
    other.change = lambda value, operation: 10.0 * value if operation is np.maximum else value
    assert fluid.largest_step().step == pytest.approx(0.1 * alone, rel=1e-12)


def test_nan_on_another_rank_stops_the_fluid_on_this_one():
    other = Beside()
    fluid = channel(other)
    fluid.step(1e-3)
    other.change = lambda value, operation: value * math.nan if operation is np.maximum else value
    with pytest.raises(RunFailed, match="not finite"):
        fluid.step(1e-3)


def test_a_wrong_field_on_another_rank_is_refused_on_this_one():
    other = Beside()
    fluid = channel(other)
    other.change = lambda value, operation: ([9, 0, 0], 1.7) if value is None else value
    with pytest.raises(InputError, match=r"voidage = 1.7: .*\[9, 0, 0\]"):
        fluid.step(1e-3, np.ones(fluid.grid.shape))
