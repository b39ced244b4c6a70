"""Sub-grid viscosity, and the viscosity that a solid cell shows to the fluid beside it."""

from __future__ import annotations

import math

import numpy as np

from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.grid import HIGH, LOW, UNIT, Array, Grid
from cfddem.kernels import prange, threaded


@threaded
def eddy_viscosity(velocity, factor, inverse, viscosity):
    r"""Sub-grid viscosity rho (C Delta)^2 sqrt(2 S:S) of every cell; factor is rho (C Delta)^2 [kg/m]."""
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


def rim(grid: Grid, boundaries: Boundaries) -> tuple[np.ndarray, np.ndarray, Array] | None:
    """Solid cells that touch an open one: their places in a padded field, those of their 26 neighbours, shares."""
    if grid.solid is None:
        return None
    is_open = np.zeros(grid.padded_shape)
    grid.inner(is_open)[:] = grid.open
    boundaries.wrap(is_open)
    _, ny, nx = grid.padded_shape
    steps = np.array([(c * ny + b) * nx + a for c in (-1, 0, 1) for b in (-1, 0, 1) for a in (-1, 0, 1) if a or b or c])
    k, j, i = np.nonzero(grid.solid)
    cells = ((k + LOW) * ny + j + LOW) * nx + i + LOW
    neighbours = cells[:, None] + steps
    shares = is_open.ravel()[neighbours]
    total = shares.sum(axis=1)
    touching = total > 0.0
    return cells[touching], neighbours[touching], shares[touching] / total[touching, None]
