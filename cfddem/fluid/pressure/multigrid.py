"""The pressure equation: conjugate gradients, preconditioned by a geometric multigrid.

In every cell, with a face coefficient a >= 0 between neighbours and an anchor d >= 0 to a known pressure,

    sum over faces  a_f (p - p_neighbour)  +  d p  =  b.

A coefficient of zero is a wall; a cell without any coefficient is solid and keeps p = 0, so that solid cells cost
nothing. Arrays have no ghosts (:func:`cfddem.fluid.halo.neighbours`): the low face of the first cell is the periodic
face, and its coefficient is zero where the box is not periodic. If no cell of a connected region is anchored, its mean
pressure is free: the mean of b is removed there, and the pressure is returned with mean zero.

Multigrid: cells are merged in pairs along the directions of strong coupling, and transfer is piecewise constant. Coarse
coefficients are sums of the fine ones, halved across the merged direction, which compensates for the piecewise constant
transfer. Gauss-Seidel sweeps by colours run forward before the coarse correction and backward after it, so that the
preconditioner is symmetric.

Sums are taken plane by plane and then over the planes in order: the bits do not depend on the thread count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.compile import prange, serial, threaded, use_threads
from cfddem.backend.errors import RunFailed
from cfddem.fluid.grid import Array, Grid, layers
from cfddem.fluid.halo import neighbours
from cfddem.fluid.pressure.regions import ClosedRegions

STRONG = 0.3
"""Directions whose coupling exceeds this share of the strongest are coarsened together."""

SMALL = 20_000
"""Cells below which a level runs on one thread: waking the others takes longer than the work."""

COARSEST = 32
"""Cells below which the multigrid stops coarsening and sweeps until converged."""


@serial
def _relax_plane(k, colour, backward, x, b, ax, ay, az, inverse):
    """Relax the cells of one colour in a plane; whole rows are computed, which vectorises, and half is kept."""
    nz, ny, nx = x.shape
    below, above = neighbours(k, nz)
    new = np.empty(nx)
    # Of one colour only the first and the last row can be neighbours (periodic y): backward takes the last one first.
    shift = ny - 1 if backward else 0
    for count in range(ny):
        j = (count + shift) % ny
        front, back = neighbours(j, ny)
        here, west, rhs, invert = x[k, j], ax[k, j], b[k, j], inverse[k, j]
        south, north, down, up = x[k, front], x[k, back], x[below, j], x[above, j]
        a_south, a_north, a_down, a_up = ay[k, j], ay[k, back], az[k, j], az[above, j]
        for i in range(nx):
            new[i] = (rhs[i] + a_south[i] * south[i] + a_north[i] * north[i]) + (a_down[i] * down[i] + a_up[i] * up[i])
        for i in range(1, nx - 1):
            new[i] = (new[i] + west[i] * here[i - 1] + west[i + 1] * here[i + 1]) * invert[i]
        parity = (k + j + colour) & 1
        # The ends of a row can be neighbours across a periodic boundary: one after the other.
        for count_end in range(min(2, nx)):
            i = nx - 1 if (count_end == 1) != backward else 0
            if (i & 1) == parity:
                left, right = neighbours(i, nx)
                sides = west[i] * here[left] + west[right] * here[right]
                here[i] = (new[i] + sides) * invert[i]
        for i in range(1, nx - 1):
            here[i] = new[i] if (i & 1) == parity else here[i]


@threaded
def smooth(x, b, ax, ay, az, inverse, sweeps, backward):
    """Gauss-Seidel by colours in place; backward is the exact transpose of forward."""
    nz = x.shape[0]
    # Of an odd number of planes the last has the colour of the first, its neighbour if periodic: it goes alone.
    together = nz - (nz & 1)
    for half in range(2 * sweeps):
        colour = (half + 1) & 1 if backward else half & 1
        for part in range(2):
            alone = (part == 0) == backward
            begin, end = (together, nz) if alone else (0, together)
            if begin < end:
                for k in prange(begin, end):
                    _relax_plane(k, colour, backward, x, b, ax, ay, az, inverse)


@serial
def _apply_row(k, j, x, ax, ay, az, diagonal, out):
    """out = L x along one row."""
    nz, ny, nx = x.shape
    (below, above), (front, back) = neighbours(k, nz), neighbours(j, ny)
    here, west, diag = x[k, j], ax[k, j], diagonal[k, j]
    south, north, down, up = x[k, front], x[k, back], x[below, j], x[above, j]
    a_south, a_north, a_down, a_up = ay[k, j], ay[k, back], az[k, j], az[above, j]
    for i in range(nx):
        out[i] = (diag[i] * here[i] - a_south[i] * south[i] - a_north[i] * north[i]) - (
            a_down[i] * down[i] + a_up[i] * up[i]
        )
    for i in range(1, nx - 1):
        out[i] -= west[i] * here[i - 1] + west[i + 1] * here[i + 1]
    for end in range(min(2, nx)):
        i = nx - 1 if end == 1 else 0
        left, right = neighbours(i, nx)
        out[i] -= west[i] * here[left] + west[right] * here[right]


@threaded
def restrict(b, image, factors, coarse_b):
    """Residual b - image of a level, summed over the cells that make one coarse cell."""
    nz, ny, nx = b.shape
    fx, fy, fz = factors[0], factors[1], factors[2]
    for kc in prange(coarse_b.shape[0]):
        for jc in range(coarse_b.shape[1]):
            for ic in range(coarse_b.shape[2]):
                total = 0.0
                for k in range(kc * fz, min(kc * fz + fz, nz)):
                    for j in range(jc * fy, min(jc * fy + fy, ny)):
                        for i in range(ic * fx, min(ic * fx + fx, nx)):
                            total += b[k, j, i] - image[k, j, i]
                coarse_b[kc, jc, ic] = total


@threaded
def prolong(coarse_x, factors, x):
    """Add the coarse correction to every cell below it."""
    nz, ny, nx = x.shape
    for k in prange(nz):
        for j in range(ny):
            source = coarse_x[k // factors[2], j // factors[1]]
            for i in range(nx):
                x[k, j, i] += source[i // factors[0]]


@threaded
def apply(x, ax, ay, az, diagonal, out, sums):
    """out = L x; sums[k] is the part of x.Lx in plane k."""
    for k in prange(x.shape[0]):
        total = 0.0
        for j in range(x.shape[1]):
            row = out[k, j]
            _apply_row(k, j, x, ax, ay, az, diagonal, row)
            for i in range(row.size):
                total += x[k, j, i] * row[i]
        sums[k] = total


@threaded
def descend(length, direction, image, x, residual, largest):
    """x += length direction, residual -= length image; largest[k] is the largest residual in plane k."""
    for k in prange(x.shape[0]):
        most = 0.0
        for j in range(x.shape[1]):
            for i in range(x.shape[2]):
                x[k, j, i] += length * direction[k, j, i]
                left = residual[k, j, i] - length * image[k, j, i]
                residual[k, j, i] = left
                most = max(most, abs(left))
        largest[k] = most


@dataclass
class Level:
    """One grid of the hierarchy: coefficients, unknown and right-hand side, all (nz, ny, nx)."""

    shape: tuple[int, int, int]
    factors: NDArray[np.int64]  # cells merged along x, y, z to make the next coarser grid

    def __post_init__(self) -> None:
        self.ax, self.ay, self.az, self.anchor = (np.zeros(self.shape) for _ in range(4))
        self.diagonal, self.inverse, self.x, self.b, self.image = (np.zeros(self.shape) for _ in range(5))
        self.sums = np.zeros(self.shape[0])

    def coarsen_from(self, fine: Level) -> None:
        """Compute the coefficients from those of the finer grid."""
        for d, (own, its) in enumerate(((self.ax, fine.ax), (self.ay, fine.ay), (self.az, fine.az))):
            if self.shape[2 - d] == 1:
                continue  # a single cell is its own periodic neighbour: no coupling is left
            kept = its[tuple(slice(None, None, fine.factors[d] if axis == 2 - d else None) for axis in range(3))]
            for e in range(3):
                if e != d and fine.factors[e] == 2:
                    kept = _pairs(kept, 2 - e)
            np.multiply(kept, 1.0 / fine.factors[d], out=own)
        held = fine.anchor
        for d in range(3):
            held = _pairs(held, 2 - d) if fine.factors[d] == 2 else held
        np.multiply(held, 0.5, out=self.anchor)

    def take_diagonal(self) -> None:
        """Compute the diagonal and its inverse, zero in solid cells."""
        np.add(self.ax, self.ay, out=self.diagonal)
        self.diagonal += self.az
        self.diagonal += self.anchor
        for d, a in enumerate((self.ax, self.ay, self.az)):
            self.diagonal[layers(d, slice(-1))] += a[layers(d, slice(1, None))]
            self.diagonal[layers(d, -1)] += a[layers(d, 0)]
        self.inverse.fill(0.0)
        np.divide(1.0, self.diagonal, out=self.inverse, where=self.diagonal > 0.0)


def _pairs(values: Array, axis: int) -> Array:
    """Sums of neighbours two by two along an axis; an odd last one stands alone."""
    total: Array = values[layers(2 - axis, slice(0, None, 2))].copy()
    odd = values[layers(2 - axis, slice(1, None, 2))]
    total[layers(2 - axis, slice(odd.shape[axis]))] += odd
    return total


class PressureEquation:
    """The Poisson equation of one grid, its multigrid hierarchy and its conjugate gradients.

    Fill `finest.ax`, `.ay`, `.az` (coefficient of the low face of each cell) and `.anchor`, call `prepare()`,
    then `solve(b, limit)` as often as these coefficients hold.
    """

    def __init__(
        self,
        grid: Grid,
        closed_regions: ClosedRegions | None,
        communicator: Communicator = SERIAL,
        most_iterations: int = 200,
    ) -> None:
        """Allocate all levels.

        closed_regions   regions without anchor, or None
        communicator     path to sums and extremes over all ranks
        most_iterations  after so many the solution has failed
        """
        self.communicator = communicator
        self.levels = _hierarchy(grid)
        self.finest = self.levels[0]
        self.closed_regions = closed_regions
        self.most_iterations = most_iterations
        self.residual, self.direction = np.zeros(grid.shape), np.zeros(grid.shape)

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
        finest, x = self.finest, np.zeros_like(b)
        np.copyto(self.residual, b)
        self._remove_means(self.residual)
        self.direction.fill(0.0)
        left = self.communicator.largest(np.abs(self.residual))
        product, iterations = 1.0, 0
        while left > limit:
            if iterations == self.most_iterations or not np.isfinite(left):
                raise RunFailed(
                    f"pressure: residual {left:.3g} m3/s after {iterations} iterations, must be below {limit:.3g}; "
                    "a smaller step helps if a field has run away, a looser tolerance if it is at round-off"
                )
            np.copyto(finest.b, self.residual)
            self._cycle(0)
            before, product = product, self.communicator.sum(np.einsum("kji,kji->k", finest.x, self.residual))
            self.direction *= product / before
            self.direction += finest.x
            operator = (finest.ax, finest.ay, finest.az, finest.diagonal)
            apply(self.direction, *operator, finest.image, finest.sums)
            length = product / self.communicator.sum(finest.sums)
            descend(length, self.direction, finest.image, x, self.residual, finest.sums)
            left = self.communicator.largest(finest.sums)
            iterations += 1
        self._remove_means(x)
        return x, iterations

    def _cycle(self, depth: int) -> None:
        """One V-cycle, on one thread from the first small level down."""
        threads = use_threads(None)
        if threads > 1 and self.levels[depth].x.size < SMALL:
            use_threads(1)
            try:
                self._cycle_here(depth)
            finally:
                use_threads(threads)
        else:
            self._cycle_here(depth)

    def _cycle_here(self, depth: int) -> None:
        """Sweep forward, correct from the coarser grid, sweep backward."""
        level = self.levels[depth]
        system = (level.x, level.b, level.ax, level.ay, level.az)
        level.x.fill(0.0)
        if depth == len(self.levels) - 1:
            smooth(*system, level.inverse, 15, False)
            smooth(*system, level.inverse, 15, True)
            return
        coarse = self.levels[depth + 1]
        smooth(*system, level.inverse, 2, False)
        apply(level.x, level.ax, level.ay, level.az, level.diagonal, level.image, level.sums)
        restrict(level.b, level.image, level.factors, coarse.b)
        self._cycle(depth + 1)
        prolong(coarse.x, level.factors, level.x)
        smooth(*system, level.inverse, 2, True)

    def _remove_means(self, values: Array) -> None:
        if self.closed_regions is not None:
            self.closed_regions.remove_means(values)


def _hierarchy(grid: Grid) -> list[Level]:
    """Grids from fine to coarse; only directions of strong coupling are merged (semi-coarsening)."""
    shape, width = np.array(grid.cells), np.array(grid.spacing)
    levels = []
    while True:
        coupling = np.where(shape > 1, width**-2.0, 0.0)
        merge = (coupling > STRONG * max(coupling)) & (shape > 1)
        levels.append(Level((shape[2], shape[1], shape[0]), np.where(merge, 2, 1).astype(np.int64)))
        if math.prod(shape) <= COARSEST or not any(merge):
            return levels
        shape = np.where(merge, -(-shape // 2), shape)
        width = np.where(merge, 2 * width, width)
