"""How a case is divided among ranks: cells and particles by the same planes, or particles alone."""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.brick_shapes import Shape
from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.fluid.block import Division, divide
from cfddem.particles.bricks import Bricks
from cfddem.preflight.bed_estimate import estimate_bed
from cfddem.preflight.step_estimate import estimate_cost, estimate_steps
from cfddem.preflight.weak_scaling import RunCost, efficiency

GHOSTS = 1.1
"""About how far from a brick its ghosts lie, in diameters."""

WORTHWHILE = 0.7
"""Efficiency from which more ranks are recommended."""

SAMPLE = 20_000
"""Places that stand for the bed where no particles have been made yet."""


def require_parallel(case: Case, ranks: int, shape: Shape | None = None) -> None:
    """Refuse what several ranks cannot share, by its key, before anything is prepared.

    shape  ranks along x, y, z, where the user gives it
    """
    for table in case.feature_tables:
        if ranks > 1 and table.one_process:
            raise InputError(table.table, None, "left out in a run of several processes", "take one process")
    if ranks > 1 and case.has_smooth_walls:
        key = "vessel" if case.vessel else "wall"
        limit = "left out" if case.vessel else "without a thin one"
        raise InputError(key, None, f"{limit} in a run of a fluid on several processes", "take one process")
    if ranks > 1 and case.fluid:
        divide(grid_of(case), ranks, shape=shape)


def cells_of(case: Case, position: np.ndarray, communicator: Communicator) -> Division | None:
    """Division of the cells among ranks; None without a fluid, or in one process.

    position  of all particles at the start (N, 3) [m]
    """
    if communicator.size == 1 or not case.fluid:
        return None
    return divide(grid_of(case), communicator.size, _expected(case, position), communicator.shape)


def space_of(case: Case, position: np.ndarray, communicator: Communicator, cells: Division | None) -> Bricks | None:
    """Space divided among ranks: as the cells, else by the particles; None in one process.

    position  of all particles at the start (N, 3) [m]
    """
    if communicator.size == 1:
        return None
    if cells is not None:
        return Bricks(cells.planes(grid_of(case)))
    shape = communicator.shape or _dry(case, _expected(case, position), communicator.size).shape
    return Bricks.balanced(shape, position)


def expected_division(case: Case, ranks: int, shape: Shape | None = None) -> tuple[Shape, float]:
    """Ranks along x, y, z for a case, and work of the busiest rank over the mean, before particles are made.

    shape  as given by the user; that with the least work if None
    """
    places = _expected(case, np.array(case.bed.positions, float) if case.bed.start == "placed" else _sample(case))
    if case.fluid:
        cells = divide(grid_of(case), ranks, places, shape)
        return cells.shape, cells.work(grid_of(case), places)
    bricks = Bricks.balanced(shape, places) if shape else _dry(case, places, ranks)
    return bricks.shape, bricks.work(places, GHOSTS * case.bed.largest_diameter)


def cost_of(case: Case) -> RunCost:
    """What a case costs one process, and how often ranks would exchange."""
    bed = estimate_bed(case)
    cost = estimate_cost(case, bed, estimate_steps(case, bed))
    films = case.has_films or bool(case.liquid)
    return RunCost(cost.seconds, cost.particle_steps, cost.fluid_steps, float(case.particle_count), films)


def most_ranks(case: Case, cost: RunCost) -> int:
    """The most ranks, of 1, 2, 3, 4, 6, 8, 12 and so on, at which the efficiency is worthwhile by the model."""
    most = 1
    for ranks in sorted(n * 2**k for k in range(1, 20) for n in (1, 1.5) if n * 2**k <= case.particle_count):
        try:
            shape, work = expected_division(case, int(ranks))
        except InputError:  # too few layers of cells
            break
        if efficiency(cost, shape, work) < WORTHWHILE:
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


def _sample(case: Case) -> np.ndarray:
    """Places spread over the column (n, 3) [m]."""
    places = np.random.default_rng(0).uniform(0.0, case.column.size, (SAMPLE, 3))
    return places[case.beyond_the_side(places) <= 0.0]
