"""How a case is divided among ranks, and what its check says of that: by the same planes, or particles alone."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from cfddem.backend.brick_shapes import Shape
from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.fluid.block import Division, divide
from cfddem.particles.bricks import ENOUGH, Bricks
from cfddem.preflight.bed_estimate import estimate_bed
from cfddem.preflight.issue import Issue
from cfddem.preflight.overview import Row
from cfddem.preflight.step_estimate import estimate_cost, estimate_steps
from cfddem.preflight.summary import Preflight
from cfddem.preflight.weak_scaling import (
    CALL,
    DRY,
    WITH_FILMS,
    WRITTEN,
    Machine,
    RunCost,
    Shares,
    efficiency,
    memory_of_a_rank,
    seconds_of_a_snapshot,
    time_of_a_rank,
)

MOST_RANKS = 100_000
"""Largest number of processes that is checked."""

GHOSTS = 1.1
"""About how far from a brick its ghosts lie, in diameters."""

WORTHWHILE = 0.7
"""Efficiency from which more ranks are recommended."""

SAMPLE = (20_000, 100, ENOUGH)
"""Places that stand for the bed where no particles have been made yet: at least, for each rank, and at most."""

SPREAD = np.array([0.8191725134, 0.6710436067, 0.5497004779])
"""Steps from place to place over the width, depth and height, 1/g, 1/g^2 and 1/g^3 with g^4 = g + 1, which fill a box
evenly."""


def require_parallel(case: Case, ranks: int, shape: Shape | None = None) -> None:
    """Refuse what several ranks cannot share, by its key, before anything is prepared.

    shape  ranks along x, y, z, where the user gives it
    """
    for table in case.feature_tables:
        if ranks > 1 and table.one_process:
            raise InputError(table.table, None, "left out in a run of several processes", "take one process")
    if ranks > 1 and case.fluid:
        divide(grid_of(case), ranks, shape=shape)


def cells_of(case: Case, position: np.ndarray, communicator: Communicator) -> Division | None:
    """Division of the cells among ranks; None without a fluid, or in one process.

    position  of the particles that this rank has at the start (N, 3) [m]
    """
    if communicator.size == 1 or not case.fluid:
        return None
    places = _some(position, communicator)
    return divide(grid_of(case), communicator.size, _expected(case, places), communicator.shape)


def space_of(case: Case, position: np.ndarray, communicator: Communicator, cells: Division | None) -> Bricks | None:
    """Space divided among ranks: as the cells, else by the particles; None in one process.

    position  of the particles that this rank has at the start (N, 3) [m]
    """
    if communicator.size == 1:
        return None
    if cells is not None:
        return Bricks(cells.planes(grid_of(case)))
    places = _some(position, communicator)
    shape = communicator.shape or _dry(case, _expected(case, places), communicator.size).shape
    return Bricks.balanced(shape, position, communicator)


def _some(position: np.ndarray, communicator: Communicator) -> np.ndarray:
    """Places of at most about `ENOUGH` of the particles of all ranks (n, 3) [m]."""
    return communicator.joined(position[:: max(communicator.sum([len(position)]) // ENOUGH, 1)])


def expected_shares(case: Case, ranks: int, shape: Shape | None = None) -> Shares:
    """Ranks along x, y, z for a case, and shares of the busiest rank, before particles are made.

    shape  as given by the user; that with the least work if None
    """
    placed = case.bed.start == "placed"
    places = _expected(case, np.array(case.bed.positions, float) if placed else _sample(case, ranks))
    grid, reach, most = grid_of(case) if case.fluid else None, GHOSTS * case.bed.largest_diameter, 1.0
    if grid is not None:
        cells = divide(grid, ranks, places, shape)
        shape, most = cells.shape, cells.work(grid, places[:0])
    bricks = Bricks.balanced(shape, places) if shape else _dry(case, places, ranks)
    return Shares(bricks.shape, bricks.work(places, reach), most)


def cost_of(case: Case) -> RunCost:
    """What a case costs one process, and how often ranks would exchange."""
    bed = estimate_bed(case)
    cost = estimate_cost(case, bed, estimate_steps(case, bed))
    films = case.has_films or bool(case.liquid)
    return RunCost(
        cost.seconds, cost.particle_steps, cost.fluid_steps, float(case.particle_count), films, cost.cell_seconds,
        cost.memory, cost.disk / cost.snapshots,
    )  # fmt: skip


def most_ranks(case: Case, cost: RunCost) -> int:
    """The most ranks, of 1, 2, 3, 4, 6, 8, 12 and so on, at which the efficiency is worthwhile by the model."""
    most = 1
    for ranks in sorted(n * 2**k for k in range(1, 20) for n in (1, 1.5) if n * 2**k <= case.particle_count):
        try:
            shares = expected_shares(case, int(ranks))
        except InputError:  # too few layers of cells
            break
        if efficiency(cost, shares) < WORTHWHILE:
            break
        most = int(ranks)
    return most


def _dry(case: Case, places: np.ndarray, ranks: int) -> Bricks:
    """Bricks for particles alone."""
    return Bricks.of_least_work(ranks, places, GHOSTS * case.bed.largest_diameter)


def _expected(case: Case, position: np.ndarray) -> np.ndarray:
    """Places of particles in the bed that is expected: lower where they begin above its height (N, 3) [m]."""
    top, height = position[:, 2].max(initial=0.0), estimate_bed(case).height  # local: all particles
    if not (math.isfinite(height) and 0.0 < height < top):
        return position
    return position * (1.0, 1.0, height / top)


def _sample(case: Case, ranks: int) -> np.ndarray:
    """Places spread evenly over the column (n, 3) [m]."""
    least, for_rank, most = SAMPLE
    places = np.arange(min(max(least, for_rank * ranks), most))[:, None] * SPREAD % 1.0 * case.column.size
    return places[case.beyond_the_side(places) <= 0.0]


# ---------------------------------------------------------------- what a check says of several processes


def with_ranks(result: Preflight, case: Case, ranks: int, shape: Shape | None) -> Preflight:
    """The result of a check, and whether several processes can share the case."""
    if not 1 <= ranks <= MOST_RANKS:
        raise InputError("ranks", ranks, f"1 to {MOST_RANKS}")
    try:
        require_parallel(case, ranks, shape)
    except InputError as failure:
        return result.with_errors(
            [Issue("error", failure.field, f"{failure.value} must be {failure.limit}", failure.remedy)]
        )
    return replace(result, rows=(*result.rows, *_rows(case, ranks, shape)))


def _rows(case: Case, ranks: int, shape: Shape | None) -> Iterator[Row]:
    """What several processes make of a case, by the model."""
    group, count, cost = "several processes", case.particle_count, cost_of(case)
    share = f", about {count / ranks:.3g} particles each" if count >= ranks else "; some hold no particle"
    shares = expected_shares(case, ranks, shape)
    x, y, z = shares.shape
    yield Row(group, "ranks", ranks, "", f"can share the case{share}")
    bricks = f"with ghosts; {x} x {y} x {z} bricks, {'as given' if shape else 'the least work'}"
    yield Row(group, "most / mean particles", shares.particles, "", bricks)
    if case.fluid:
        yield Row(group, "most / mean cells", shares.cells, "", "with a layer around them")
    spent = time_of_a_rank(cost, shares)
    lost, total = max((part for part in spent if part != "work"), key=spent.__getitem__), sum(spent.values())
    yield Row(group, "efficiency", efficiency(cost, shares), "", "speed-up over ranks, by the model")
    yield Row(group, "largest loss", spent[lost] / total, "", f"of the time: {lost}")
    for name, value, unit, note in _inputs(cost):
        yield Row(group, name, value, unit, note)
    memory, at_the_start = memory_of_a_rank(cost, shares)
    yield Row(group, "memory of a rank", memory / 1e9, "GB", "at most")
    yield Row(group, "memory of rank 0 at the start", at_the_start / 1e9, "GB", "it makes all particles")
    rate = f"{cost.snapshot / 1e9:.3g} GB at {WRITTEN / 1e6:.3g} MB/s, by rank 0"
    yield Row(group, "time of a snapshot", seconds_of_a_snapshot(cost), "s", rate)
    most = most_ranks(case, cost)
    yield Row(group, "recommended ranks", most, "", f"the most with {WORTHWHILE:.0%} efficiency")


def _inputs(cost: RunCost) -> Iterator[tuple[str, float, str, str]]:
    """What the model takes for machine and run: name, value, unit and note."""
    (exchanges, sums), machine = WITH_FILMS if cost.films else DRY, Machine()
    steps = f"in a particle step, {exchanges:g} of them with neighbours"
    yield "work of one process", cost.seconds, "s", f"{cost.cell_seconds / cost.seconds:.0%} of it for cells"
    yield "message", 1e6 * machine.latency, "us", f"and {machine.bandwidth / 1e9:g} GB/s for each rank"
    yield "sum over all ranks", 1e6 * machine.reduction, "us", f"times log2 p, and {1e6 * CALL:g} us of the processor"
    yield "exchanges and sums", exchanges + sums, "", steps
