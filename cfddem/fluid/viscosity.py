"""Effective viscosity of cells: voidage times viscosity, the sub-grid viscosity included."""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import prange, threaded, vector_inline
from cfddem.fluid.grid import HIGH, LOW, UNIT, Array, Grid
from cfddem.fluid.halo import Halo

BLOCK = 64
"""Solid cells whose means are found together."""


@threaded
def eddy_viscosity(velocity, factor, inverse, viscosity):
    """Write the sub-grid viscosity rho (C Delta)^2 sqrt(2 S:S) of every cell; factor is rho (C Delta)^2 [kg/m]."""
    pz, py, px = viscosity.shape
    for k in prange(LOW, pz - HIGH):
        for j in range(LOW, py - HIGH):
            for i in range(LOW, px - HIGH):
                squares = 0.0
                for d in range(velocity.shape[0]):
                    dk, dj, di = UNIT[d]
                    u = velocity[d]
                    for e in range(velocity.shape[0]):
                        ek, ej, ei = UNIT[e]
                        if e == d:
                            stretch = (u[k + dk, j + dj, i + di] - u[k, j, i]) * inverse[d]
                            squares += 2.0 * stretch * stretch
                        elif e > d:
                            v = velocity[e]
                            shear = 0.25 * inverse[e] * (
                                u[k + ek, j + ej, i + ei] + u[k + ek + dk, j + ej + dj, i + ei + di]
                                - u[k - ek, j - ej, i - ei] - u[k - ek + dk, j - ej + dj, i - ei + di]
                            ) + 0.25 * inverse[d] * (
                                v[k + dk, j + dj, i + di] + v[k + ek + dk, j + ej + dj, i + ei + di]
                                - v[k - dk, j - dj, i - di] - v[k - dk + ek, j - dj + ej, i - di + ei]
                            )  # fmt: skip
                            squares += shear * shear
                viscosity[k, j, i] = factor * math.sqrt(squares)


@threaded
def take_means(cells, steps, shares, values):
    """Write the weighted mean of the 26 neighbours of some cells, none of which has a weight.

    cells   (n,) flat index of the first neighbour of each; steps (26,) from this one to all
    shares  (26, n) weights
    values  a padded field, flat
    """
    for block in prange((cells.size + BLOCK - 1) // BLOCK):
        begin, end = block * BLOCK, min((block + 1) * BLOCK, cells.size)
        of_block, sums = cells[begin:end], np.zeros((8, end - begin))
        for m in range(24):  # eight sums, in the order in which numpy adds
            _add_neighbour(of_block, values[steps[m] :], shares[m, begin:end], sums[m % 8])
        middle, near, last = steps[25] // 2, values[steps[24] :], values[steps[25] :]
        for i in range(of_block.size):
            at, a, b, c, d = of_block[i], sums[0, i], sums[1, i], sums[2, i], sums[3, i]
            e, f, g, h = sums[4, i], sums[5, i], sums[6, i], sums[7, i]
            total = ((a + b) + (c + d)) + ((e + f) + (g + h))
            values[at + middle] = total + near[at] * shares[24, begin + i] + last[at] * shares[25, begin + i]


@vector_inline
def _add_neighbour(at, values, shares, sums):
    """Add one neighbour of each cell of a block."""
    for i in range(at.size):
        sums[i] += values[at[i]] * shares[i]


class EffectiveViscosity:
    """The effective viscosity of a fluid.

    A solid cell that touches open cells takes the mean of their values, so that the stress on a wall is that of the
    fluid next to it.

    grid         cells, some of them solid
    halo         fills ghosts
    density      rho [kg/m3]
    smagorinsky  constant C of the sub-grid viscosity; 0 for none
    """

    def __init__(self, grid: Grid, halo: Halo, density: float, smagorinsky: float) -> None:
        self.halo, self._inverse = halo, 1.0 / np.array(grid.spacing)
        resolved = [h for h, n in zip(grid.spacing, grid.whole.cells) if n > 1] or [0.0]
        width = math.prod(resolved) ** (1.0 / len(resolved))
        self._factor = density * (smagorinsky * width) ** 2
        self._has_eddies = smagorinsky > 0.0
        self._rim = _rim(grid, halo)

    def update(self, velocity: Array, voidage: Array, viscosity: Array, effective: Array) -> None:
        """Write the effective viscosity of every cell and ghost.

        velocity   padded, its ghosts filled (3, nz, ny, nx) [m/s]
        voidage    padded
        viscosity  dynamic viscosity of the fluid, padded [Pa s]
        effective  written, padded [Pa s]
        """
        if self._has_eddies:
            eddy_viscosity(velocity, self._factor, self._inverse, effective)
            effective += viscosity
            self.halo.fill(effective)
            effective *= voidage
        else:
            np.multiply(voidage, viscosity, out=effective)
        if self._rim is not None:
            take_means(*self._rim, effective.reshape(-1))
            self.halo.fill(effective)


def _rim(grid: Grid, halo: Halo) -> tuple[np.ndarray, np.ndarray, Array] | None:
    """Solid cells that touch open ones, as `take_means` takes them: first neighbours, steps from these, weights."""
    if grid.whole.solid is None:
        return None
    is_open = halo.padded(grid.open, outside=0.0)
    _, ny, nx = grid.padded_shape
    steps = np.array([(c * ny + b) * nx + a for c in (-1, 0, 1) for b in (-1, 0, 1) for a in (-1, 0, 1) if a or b or c])
    k, j, i = np.nonzero(~grid.open)
    cells = ((k + LOW) * ny + j + LOW) * nx + i + LOW
    neighbours = cells[:, None] + steps
    shares = is_open.ravel()[neighbours]
    total = shares.sum(axis=1)
    touching = total > 0.0
    shares = np.ascontiguousarray((shares[touching] / total[touching, None]).T)
    return neighbours[touching, 0].astype(np.uint32), steps - steps[0], shares
