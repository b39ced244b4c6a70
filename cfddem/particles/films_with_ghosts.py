"""Films that are solved together where several processes share the particles: one phase after the other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from cfddem.backend.communicator import Communicator
from cfddem.backend.law_set import specialise
from cfddem.particles.interactions.joint_solution import (
    MOST_ITERATIONS,
    PASSES,
    SETTLED,
    along_direction,
    begin_solution,
    best_factor,
    finish_solution,
    new_direction,
    new_product,
    new_residual,
    new_scale,
    scale_of,
    start_films,
    units_of,
)
from cfddem.particles.system import System


class FilmsWithGhosts:
    """The loop of :func:`cfddem.particles.interactions.joint_solution.film_kick` on one rank of several.

    Arguments as of :class:`cfddem.particles.ghosts.StepsWithGhosts`.
    """

    def __init__(self, choices: Mapping[str, Any], threads: bool, ghosts: Any, communicator: Communicator) -> None:
        self.ghosts, self.communicator = ghosts, communicator
        loops = (start_films, begin_solution, finish_solution, new_residual, new_scale)
        more = (new_direction, new_product, along_direction, units_of)
        made = [specialise(loop, choices, threads) for loop in (*loops, *more)]
        self.start, self.begin, self.finish, self.new_residual, self.new_scale = made[: len(loops)]
        self.new_direction, self.new_product, self.along, self.units_of = made[len(loops) :]

    def __call__(self, system: System, step: float) -> None:
        """Arguments of `film_kick`."""
        self.ghosts.refresh("film")
        count, owned = self.start(system)
        number = int(self.communicator.sum([owned]))
        if number == 0:
            return
        tolerance = system.parameters.film_tolerance
        self.begin(system, count, step)
        self.ghosts.refresh("film_change")
        iterations, passes = 0, 0
        while passes < PASSES:
            largest = self.new_residual(system, count, step, True)
            by_wanted, by_residual = (self._total(system, count, number, column, largest) for column in (2, 3))
            if by_wanted + by_residual < 0.0:
                self.new_scale(system, count, best_factor.py_func(by_wanted, by_residual))
                largest = self.new_residual(system, count, step, False)
            left, whole = (self._total(system, count, number, column, largest) for column in (0, 1))
            limit = tolerance * tolerance * whole
            if not left > (4.0 * limit if passes > 0 else min(limit, SETTLED * whole)):
                break
            passes += 1
            share, tops = 0.0, (0.0, 0.0)
            for _ in range(MOST_ITERATIONS):
                self.new_direction(system, count, share)
                self.ghosts.refresh("film_direction")
                product = self._total(system, count, number, 0, (self.new_product(system, count),))
                tops = self.along(system, count, left / product, step)
                before, left = left, self._total(system, count, number, 0, tops)
                iterations += 1
                share = left / before
                if not left > limit:
                    break
            if not self._total(system, count, number, 1, tops) > limit:
                break
        self.finish(system, count)
        system.film_counts[:] += (1.0, iterations, passes, owned)

    def _total(self, system: System, count: int, number: int, column: int, tops: Sequence[float]) -> float:
        """Sum of a column of the terms of all films on all ranks, see `total_of`; `tops`, the largest of each here."""
        largest = self.communicator.largest([tops[column]])
        if not 0.0 < largest < math.inf:
            return largest
        power = scale_of.py_func(largest, number)
        return math.ldexp(float(self.communicator.sum([self.units_of(system, count, column, power)])), -power)
