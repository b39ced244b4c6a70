"""The pressure equation: conjugate gradients, preconditioned by a geometric multigrid.

In every cell, with a face coefficient a >= 0 between neighbours and an anchor d >= 0 to a known pressure,

    sum over faces  a_f (p - p_neighbour)  +  d p  =  b.

A coefficient of zero is a wall; a cell without any coefficient is solid and keeps p = 0, so that solid cells cost
nothing. Arrays have no ghosts (:func:`cfddem.fluid.halo.neighbours`): the low face of the first cell is the periodic
face, and its coefficient is zero where the box is not periodic. If no cell of a connected region is anchored, the
region is closed (:class:`ClosedRegions`): fluid that enters it must leave it again, and its mean pressure is free. The
mean of b is removed there, and the pressure is returned with mean zero.

Multigrid: cells are merged in pairs along the directions of strong coupling, and transfer is piecewise constant. Coarse
coefficients are sums of the fine ones, halved across the merged direction, which compensates for the piecewise constant
transfer. Gauss-Seidel sweeps by colours run forward before the coarse correction and backward after it, so that the
preconditioner is symmetric.

Scalar products are sums of whole numbers: their bits depend neither on the threads nor on the ranks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.compile import Threaded
from cfddem.backend.errors import InputError, RunFailed
from cfddem.backend.exact_sums import put_together, unit_of
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.grid import HIGH, LOW, Array, Grid
from cfddem.fluid.pressure.multigrid_loops import (
    apply,
    coarsen,
    descend,
    largest_products,
    prolong,
    residual,
    restrict,
    smooth,
    split_products,
    take_diagonal,
)

STRONG = 0.3
"""Directions whose coupling exceeds this share of the strongest are coarsened together."""

SMALL = 20_000
"""Cells below which a level runs on one thread: waking the others takes longer than the work."""

MOST_ITERATIONS = 200
"""Iterations after which a solution has failed."""

SWEEPS = 2
"""Sweeps before and after each coarse correction."""

OVER_RELAXATION = 1.1
"""Relaxation of sweeps between smooth walls, where sweeps that go too far smooth better than those that balance each
cell: up to a fifth fewer iterations. Boxes need it less, and keep their bits."""

COARSEST = 32
"""Cells below which the multigrid stops coarsening and sweeps until converged."""


@dataclass
class Level:
    """One grid of the hierarchy: coefficients, unknown and right-hand side, all (nz, ny, nx)."""

    shape: tuple[int, int, int]
    factors: NDArray[np.int64]  # cells merged along x, y, z to make the next coarser grid
    outlets: NDArray[np.bool_]  # whether a side normal to x, y, z has a known pressure

    def __post_init__(self) -> None:
        self.ax, self.ay, self.az, self.anchor = (np.zeros(self.shape) for _ in range(4))
        self.diagonal, self.inverse, self.x, self.b, self.image = (np.zeros(self.shape) for _ in range(5))
        self.rows = np.zeros((2, *self.shape[::2]))  # of each plane two
        # first row of each plane that has unknowns, and the one after the last; all values beyond them stay zero
        self.wet = np.zeros((self.shape[0], 2), np.int64)
        self.relaxation = 1.0  # how far a sweep moves each cell, over what would balance it
        self.shift = np.zeros(3, np.int64)  # cell k lies in the coarse cell (k + shift) // factor
        self.small = self.x.size < SMALL

    @property
    def coefficients(self) -> tuple[Array, Array, Array, Array]:
        """Coefficients of the low faces along x, y, z, and anchors."""
        return self.ax, self.ay, self.az, self.anchor

    def coarsen_from(self, fine: Level) -> None:
        """Compute the coefficients from those of the finer grid."""
        self._coarsen(fine, fine.coefficients, self.coefficients, self.shape)

    def _coarsen(self, fine: Level, of_fine: Sequence[Array], of_coarse: Sequence[Array], whole: Sequence[int]) -> None:
        """Write coefficients from those of the fine cells; whole is the shape of the grid of all ranks."""
        # A coefficient falls with the distance that it spans: to the next cell, or to the side with a known pressure.
        farther = fine.factors[fine.outlets].min(initial=2)  # local: three directions
        coupled = np.array(whole[::-1]) > 1  # a single cell is its own periodic neighbour
        self.loop(coarsen)(tuple(of_fine), fine.factors, farther, coupled, tuple(of_coarse))

    def take_diagonal(self) -> None:
        """Compute the diagonal, and the relaxation over it, zero in solid cells, and find the wet rows."""
        self.loop(take_diagonal)(*self.coefficients, self.relaxation, self.diagonal, self.inverse, self.wet)

    def loop(self, loop: Threaded) -> Any:
        """A loop as it runs over the cells of this level: on all threads, or on one if they are few."""
        return loop.one if self.small else loop

    def sweep(self, sweeps: int, backward: bool) -> None:
        """Relax all cells so many times."""
        self.relax(int(backward), 2 * sweeps, backward)

    def relax(self, colour: int, halves: int, backward: bool) -> None:
        """Make so many halves of sweeps, beginning with a colour."""
        matrix = self.ax, self.ay, self.az, self.inverse, self.wet, 1.0 - self.relaxation
        self.loop(smooth)(self.x, self.b, matrix, self.rows[0], colour, halves, backward)

    def take_residual(self) -> None:
        """Compute the residual."""
        self.loop(residual)(self.x, self.b, self.ax, self.ay, self.az, self.diagonal, self.wet, self.image)

    def restrict_to(self, coarse: Level) -> None:
        """Write the right-hand side of the coarser grid."""
        self.take_residual()
        self.loop(restrict)(self.image, self.wet, self.factors, self.shift, self.rows[0], coarse.b)

    def correct_by(self, coarse: Level) -> None:
        """Add the correction of the coarser grid."""
        self.loop(prolong)(coarse.x, self.wet, self.factors, self.shift, self.rows[0], self.x)


class PressureEquation:
    """The Poisson equation of one grid, its multigrid hierarchy and its conjugate gradients.

    Fill `coefficients` (of the low faces of all cells along x, y, z, and anchors), call `prepare()`, then
    `solve(b, limit)` as often as these coefficients hold.
    """

    def __init__(
        self,
        grid: Grid,
        closed_regions: ClosedRegions | None,
        communicator: Communicator = SERIAL,
        outlets: Sequence[bool] | NDArray[np.bool_] = (False, False, True),
    ) -> None:
        """Allocate all levels.

        closed_regions  regions without anchor, or None
        communicator    path to sums and extremes over all ranks
        outlets         whether a side normal to x, y, z has a known pressure
        """
        self._outlets = np.array(outlets, bool)
        self.communicator = communicator
        self.levels = self._all_levels(grid)
        for level in self.levels if grid.walls else ():
            level.relaxation = OVER_RELAXATION
        self.finest = self.levels[0]
        self.closed_regions = closed_regions
        self.residual, self.direction = np.zeros(self.finest.shape), np.zeros(self.finest.shape)
        planes = self.finest.shape[0]
        self._largest, self._parts = np.zeros(planes), np.zeros((planes, 3), np.int64)

    def _all_levels(self, grid: Grid) -> list[Level]:
        return [Level(*coefficients, self._outlets) for coefficients in hierarchy(grid)]

    @property
    def coefficients(self) -> tuple[Array, Array, Array, Array]:
        """Coefficients of the low faces along x, y, z, and anchors, each (nz, ny, nx)."""
        return self.finest.coefficients

    def prepare(self) -> None:
        """Compute the coefficients of the whole hierarchy from those of the finest grid."""
        for fine, coarse in pairwise(self.levels):
            coarse.coarsen_from(fine)
        for level in self.levels:
            level.take_diagonal()

    def solve(self, b: Array, limit: float) -> tuple[Array, int]:
        """Solve L x = b until the largest residual of any cell is below `limit`.

        b        (nz, ny, nx) right-hand side [m3/s]; zero in solid cells
        limit    largest residual of any cell [m3/s]
        returns  x (nz, ny, nx) [Pa] and the number of iterations
        errors   RunFailed where the iteration does not get there
        """
        finest, x = self.finest, np.zeros(self.finest.shape)
        self._own(self.residual)[:] = b
        self._remove_means(self.residual)
        self.direction.fill(0.0)
        left = self.communicator.largest(np.abs(self.residual))
        product, iterations = 1.0, 0
        while left > limit:
            if iterations == MOST_ITERATIONS or not np.isfinite(left):
                raise RunFailed(
                    f"pressure: residual {left:.3g} m3/s after {iterations} iterations, must be below {limit:.3g}; "
                    "take a smaller step if the flow diverges, or a looser tolerance if this is round-off"
                )
            np.copyto(finest.b, self.residual)
            self._cycle(0)
            before, product = product, self._product(finest.x, self.residual)
            self.direction *= product / before
            self.direction += finest.x
            self._apply_to_direction()
            length = product / self._product(self.direction, finest.image)
            finest.loop(descend)(length, self.direction, finest.image, finest.wet, x, self.residual, self._largest)
            left = self.communicator.largest(self._largest)
            iterations += 1
        self._remove_means(x)
        return self._own(x), iterations

    def _own(self, values: Array) -> Array:
        """View of the cells of the grid in an array of the finest level."""
        return values

    def _apply_to_direction(self) -> None:
        """Write the image L d of the search direction d."""
        level = self.finest
        level.loop(apply)(self.direction, level.ax, level.ay, level.az, level.diagonal, level.wet, level.image)

    def _product(self, a: Array, b: Array) -> float:
        """Sum of a b over the cells of all ranks; NaN where a product is not finite."""
        finest = self.finest
        finest.loop(largest_products)(a, b, finest.wet, finest.rows, self._largest)
        largest = self.communicator.largest(self._largest)
        if not math.isfinite(largest):
            return math.nan
        unit = float(unit_of(largest))
        finest.loop(split_products)(a, b, finest.wet, unit, finest.rows, self._parts)
        whole, fine, missing = self.communicator.sum(self._parts, axis=0)
        return math.nan if missing else float(put_together(np.array([whole, fine]), unit))

    def _cycle(self, depth: int) -> None:
        """One V-cycle: sweep forward, correct from the coarser grid, sweep backward."""
        level = self.levels[depth]
        level.x.fill(0.0)
        if depth == len(self.levels) - 1:
            level.sweep(15, backward=False)
            level.sweep(15, backward=True)
            return
        coarse = self.levels[depth + 1]
        level.sweep(SWEEPS, backward=False)
        level.restrict_to(coarse)
        self._cycle(depth + 1)
        level.correct_by(coarse)
        level.sweep(SWEEPS, backward=True)

    def _remove_means(self, values: Array) -> None:
        if self.closed_regions is not None:
            self.closed_regions.remove_means(self._own(values))


def hierarchy(grid: Grid) -> list[tuple[tuple[int, int, int], NDArray[np.int64]]]:
    """Shape and factors of the levels from fine to coarse; only directions of strong coupling are merged
    (semi-coarsening)."""
    shape, width = np.array(grid.cells), np.array(grid.spacing)
    levels = []
    while True:
        coupling = np.where(shape > 1, width**-2.0, 0.0)
        merge = (coupling > STRONG * max(coupling)) & (shape > 1)
        nx, ny, nz = (int(n) for n in shape)
        levels.append(((nz, ny, nx), np.where(merge, 2, 1).astype(np.int64)))
        if math.prod(shape) <= COARSEST or not any(merge):
            return levels
        shape = np.where(merge, -(-shape // 2), shape)
        width = np.where(merge, 2 * width, width)


# ---------------------------------------------------------------- closed regions


class ClosedRegions(NamedTuple):
    """The closed regions of a grid."""

    number: NDArray[np.int64]  # (nz, ny, nx) of the region of a cell, from 1; 0 outside of all
    size: NDArray[np.int64]  # (regions + 1,) cells of each region on all ranks
    communicator: Communicator

    @classmethod
    def numbered(cls, number: NDArray[np.int64], communicator: Communicator) -> ClosedRegions | None:
        """Regions by the number of each cell; None if there are none."""
        count = int(communicator.largest(number))
        if count == 0:
            return None
        size = communicator.sum(np.bincount(number.ravel(), minlength=count + 1), axis=())
        return cls(number, size, communicator)

    @classmethod
    def of(cls, grid: Grid, boundaries: Boundaries, communicator: Communicator) -> ClosedRegions | None:
        """Closed regions of a grid with its boundaries; None if an outlet touches every region."""
        region, count = label(grid.whole.open)
        links = list(range(count + 1))

        def root(n: int) -> int:
            while links[n] != n:
                n = links[n]
            return n

        for axis in range(3):
            if boundaries.periodic[axis]:
                first, last = np.take(region, 0, 2 - axis).ravel(), np.take(region, -1, 2 - axis).ravel()
                for a, b in {(int(a), int(b)) for a, b in zip(first, last) if a and b}:
                    links[root(a)] = root(b)
        region = np.array([root(n) for n in range(count + 1)])[region]
        for side in boundaries.box.sides:
            touched = side.layer(region, -1 if side.high else 0)[side.outlet[LOW:-HIGH, LOW:-HIGH]]
            region[np.isin(region, touched[touched > 0])] = 0
        return cls.numbered(grid.part(region).astype(np.int64), communicator)

    def sums(self, values: Array) -> Array:
        """Sum of a cell field (nz, ny, nx) over each region; the first sum is that of the cells outside of all."""
        return np.array([self.communicator.sum(values[self.number == region]) for region in range(len(self.size))])

    def remove_means(self, values: Array) -> None:
        """Subtract from a cell field its mean over each region, in place."""
        mean = self.sums(values) / np.maximum(self.size, 1)
        mean[0] = 0.0
        values -= mean[self.number]

    def refuse_imbalance(self, missing: Array, scale: float, time: float) -> None:
        """Raise `InputError` unless inflow and change of voidage cancel in each region.

        missing  fluid that each cell lacks (nz, ny, nx) [m3/s]
        scale    largest volume flux of the step [m3/s]
        time     simulated time, for the message [s]
        """
        excess, size = self.sums(missing)[1:], self.sums(np.abs(missing))[1:]
        for amount in excess[np.abs(excess) > 1e-9 * size + 1e-9 * scale]:
            sign = "little" if amount > 0 else "much"
            raise InputError(
                "boundaries", None, "such that inflow and change of voidage cancel where there is no outlet",
                f"{abs(amount):.3g} m3/s too {sign} fluid at t = {time:g} s; add Outlet()",
            )  # fmt: skip
