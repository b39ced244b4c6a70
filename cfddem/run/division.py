"""How a case is divided among ranks, what a step costs there, and what the check of a case says of both.

The time of a step on many ranks is that of a model, from measured numbers of one machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cfddem.backend.communicator import Communicator, Shape, shapes
from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.fluid.block import Division, divide
from cfddem.particles.bricks import ENOUGH, Bricks
from cfddem.preflight.bed_estimate import estimate_bed
from cfddem.preflight.issue import Issue
from cfddem.preflight.overview import Row
from cfddem.preflight.step_estimate import BYTES_AT_LEAST, BYTES_PER_PARTICLE, estimate_cost, estimate_steps
from cfddem.preflight.summary import Preflight

RANDOM_PACKING = 0.6
"""Solid fraction of a bed, for its length in diameters."""


@dataclass(frozen=True)
class Machine:
    """Numbers of a machine. The defaults are rounded values of ordinary cores and of a network with 2 GB/s a rank.

    particle_step    time of a particle step, with its pairs, on one rank [s]
    latency          of a message [s]
    bandwidth        of a rank [byte/s]
    reduction        time of a sum over all ranks, for each doubling of their number [s]
    message          what a ghost receives in a step: 72 byte dry, 104 byte with films [byte]
    messages         exchanges in a step: 1 dry, 2 with films
    """

    particle_step: float = 1.5e-7
    latency: float = 5e-6
    bandwidth: float = 2e9
    reduction: float = 5e-6
    message: float = 72.0
    messages: int = 1


@dataclass(frozen=True)
class Scaling:
    """A step on many ranks, by the model.

    step        time of a step [s]
    exchange    part of it for halo and reductions [-]
    efficiency  speed-up over the number of ranks; without imbalance [-]
    owned       particles of a rank
    ghosts      of a rank
    memory      of a rank, without cells [byte]
    shape       ranks along x, y, z
    """

    step: float
    exchange: float
    efficiency: float
    owned: float
    ghosts: float
    memory: float
    shape: Shape


def weak_scaling(
    particles: float, ranks: int, machine: Machine | None = None, *, aspect: float = 1.0, reach: float = 1.1,
    shape: Shape | None = None,
) -> Scaling:  # fmt: skip
    """Time of a particle step on many ranks that divide a bed into bricks.

    A rank has ghosts within the reach of a pair around its brick, and up to 26 neighbours k. A pair across a border is
    computed on both sides:

    .. math:: t = c (n + g / 2) + m (k l + g b / w) + r \\log_2 p

    particles  number of particles of the bed
    ranks      number of ranks p
    machine    c, l, w, r, b and m; see `Machine`
    aspect     length of the bed along x over the side of a square section
    reach      of the list of pairs, in diameters: 1 and the skin, and the reach of films
    shape      ranks along x, y, z; that with the fewest ghosts if None
    returns    see `Scaling`

    >>> one, many = weak_scaling(1e6, 1), weak_scaling(64e6, 64)
    >>> one.efficiency, round(many.efficiency, 2), round(many.ghosts / many.owned, 2), many.shape
    (1.0, 0.95, 0.07, (4, 4, 4))
    >>> round(weak_scaling(64e6, 64, shape=(64, 1, 1)).efficiency, 2)
    0.79
    """
    computer, owned = machine or Machine(), particles / ranks
    volume = particles * math.pi / (6.0 * RANDOM_PACKING)  # in cubes of the diameter
    side = (volume / aspect) ** (1.0 / 3.0)
    edges = np.array([aspect * side, side, side])

    def ghosts_of(shape: Shape) -> float:
        """Ghosts of the rank that has most."""
        sides = np.minimum(np.array(shape) - 1, 2)
        around = float(np.prod(1.0 + sides * reach * np.array(shape) / edges))  # local: three axes
        return min((around - 1.0) * owned, particles - owned)

    best = shape or min(shapes(ranks, (ranks, ranks, ranks)), key=ghosts_of)
    ghosts = ghosts_of(best)
    work = computer.particle_step * (owned + 0.5 * ghosts)
    exchange = 0.0
    if ranks > 1:
        beside = math.prod(min(n, 3) for n in best) - 1
        halo = computer.messages * beside * computer.latency + ghosts * computer.message / computer.bandwidth
        exchange = halo + computer.reduction * math.log2(ranks)
    step = work + exchange
    memory = BYTES_PER_PARTICLE * (owned + ghosts)
    return Scaling(step, exchange / step, computer.particle_step * owned / step, owned, ghosts, memory, best)


CALL = 25e-6
"""Processor time of a rank for each exchange and each sum, beside the network [s]."""

WITH_FILMS, DRY = (4.0, 25.0), (1.0, 1.0)
"""Exchanges and sums over all ranks in a particle step; films are solved together by iteration."""

HALOS, SUMS = 100.0, 80.0
"""Exchanges of cells for each divided axis, and sums over all ranks, in a fluid step with its solution of the pressure.

Counted and measured by `tests/benchmarks/bench_scaling_model.py`; `HALOS` grow from 33 for few cells to 150 for 64^3.
"""


@dataclass(frozen=True)
class RunCost:
    """What a run costs one process, and how often its ranks would exchange.

    seconds         of one process [s]
    particle_steps  in the run
    fluid_steps     in the run; 0 without a fluid
    particles       in the run
    films           or bridges between particles, in the run
    cell_seconds    part of the seconds for the cells of the fluid [s]
    memory          of one process [byte]
    snapshot        size of one [byte]
    """

    seconds: float
    particle_steps: float
    fluid_steps: float
    particles: float
    films: bool = False
    cell_seconds: float = 0.0
    memory: float = 0.0
    snapshot: float = 0.0


class Shares(NamedTuple):
    """Shares of the busiest rank, ghosts included, over the mean without them.

    shape      ranks along x, y, z
    particles  and their ghosts
    cells      and the layer around them; 1 without a fluid
    """

    shape: Shape
    particles: float
    cells: float = 1.0


def time_of_a_rank(cost: RunCost, shares: Shares, machine: Machine | None = None) -> dict[str, float]:
    """Time of the busiest rank in a run, by what it is spent on [s].

    .. math:: t_p = \\frac{w_p t_P + w_c t_C}{p} + N_s (m (k l + c) + g b / B + s (r \\log_2 p + c))
              + N_f (h a (2 l + c) + s_f (r \\log_2 p + c))

    with the times t_P and t_C of one process for particles and cells, N_s particle steps of m exchanges with k
    neighbours and s sums, N_f fluid steps of h exchanges along each of a divided axes and s_f sums, and the time c of a
    rank for each of these.

    cost     of one process
    shares   w_p and w_c of the busiest rank
    machine  l, B, r and b; see `Machine`
    returns  the share of the work, and what is added to it, which is 0 in one process
    """
    computer, ranks = machine or Machine(), math.prod(shares.shape)
    work, cells = cost.seconds / ranks, cost.cell_seconds / ranks
    beside = math.prod(min(n, 3) for n in shares.shape) - 1
    reduction, many = computer.reduction * math.log2(ranks) + CALL, float(ranks > 1)
    exchanges, sums = WITH_FILMS if cost.films else DRY
    ghosts = (shares.particles - 1.0) * cost.particles / ranks
    messages = exchanges * (beside * computer.latency + CALL) + ghosts * computer.message / computer.bandwidth
    divided = sum(n > 1 for n in shares.shape)
    return {
        "work": work,
        "uneven particles, and ghosts": (shares.particles - 1.0) * (work - cells),
        "uneven cells, and ghosts": (shares.cells - 1.0) * cells,
        "messages of particles": many * cost.particle_steps * messages,
        "sums in particle steps": many * cost.particle_steps * sums * reduction,
        "messages of cells": cost.fluid_steps * HALOS * divided * (2.0 * computer.latency + CALL),
        "sums in fluid steps": many * cost.fluid_steps * SUMS * reduction,
    }


def efficiency(cost: RunCost, shares: Shares, machine: Machine | None = None) -> float:
    """Speed-up of a run over the number of its ranks, by `time_of_a_rank`; arguments as there.

    >>> dry = RunCost(seconds=1000.0, particle_steps=1e5, fluid_steps=0, particles=1e5)
    >>> round(efficiency(dry, Shares((1, 2, 1), 1.05)), 2), round(efficiency(dry, Shares((4, 4, 4), 1.3)), 2)
    (0.93, 0.36)
    """
    spent = time_of_a_rank(cost, shares, machine)
    return spent["work"] / sum(spent.values())  # local: known to every rank


PACKED, WRITTEN = 450.0, 4.4e7
"""Memory of rank 0 for a particle while all of them are made [byte]; what rank 0 writes of a snapshot [byte/s]."""


def memory_of_a_rank(cost: RunCost, shares: Shares) -> tuple[float, float]:
    """Memory of the busiest rank, and that of rank 0 while it makes all particles at the start [byte].

    The busiest rank has most of both particles and cells, at worst.
    """
    arrays = (cost.memory - BYTES_AT_LEAST) / math.prod(shares.shape)
    return BYTES_AT_LEAST + max(shares[1:]) * arrays, BYTES_AT_LEAST + PACKED * cost.particles


def seconds_of_a_snapshot(cost: RunCost) -> float:
    """Time in which rank 0 writes a snapshot, while the others wait [s]; how many ranks there are does not matter."""
    return cost.snapshot / WRITTEN


# ---------------------------------------------------------------- division of a case


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
