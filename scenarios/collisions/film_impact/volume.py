"""Volume of the liquid: particles that drift together are moved apart, without a force."""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline, serial
from scenarios.collisions.film_impact.grid import Grid

FROM = 0.03
"""Excess of a cell, over its room, that is within the noise of the particles [-]."""

SHARE, FARTHEST = 0.25, 0.1
"""Shift of a particle in a step down the gradient of the filled share, in cells, and the largest."""

BLOCK = 4
"""Half the width of the tents with which liquid and room are compared [cells]."""


@serial
def spread_out(particles, dx, filled, open_cell, first):
    """Shift the particles of crowded cells towards emptier ones, in columns from `first` on."""
    for n in range(len(particles)):
        i = min(int(particles[n, 0] / dx), filled.shape[0] - 1)
        j = min(int(particles[n, 1] / dx), filled.shape[1] - 1)
        if i < first or filled[i, j] <= 1.0 + FROM:
            continue
        along = beside(filled, open_cell, i + 1, j, i, j) - beside(filled, open_cell, i - 1, j, i, j)
        up = beside(filled, open_cell, i, j + 1, i, j) - beside(filled, open_cell, i, j - 1, i, j)
        particles[n, 0] -= dx * min(max(0.5 * SHARE * along, -FARTHEST), FARTHEST)
        particles[n, 1] -= dx * min(max(0.5 * SHARE * up, -FARTHEST), FARTHEST)


@inline
def beside(filled, open_cell, k, m, i, j):
    """Filled share of a neighbour; that of the cell itself where the neighbour is closed."""
    if 0 <= k < filled.shape[0] and 0 <= m < filled.shape[1] and open_cell[k, m] > 0.5:
        return filled[k, m]
    return filled[i, j]


def overfilled(grid: Grid, particles: np.ndarray, volume: np.ndarray) -> float:
    """Liquid that lies where there is no room for it, over all liquid [-].

    Liquid and room are summed with tents of four cells to each side, which add up to 1. Sums over blocks with sharp
    edges would count the particles that happen to lie on one side of an edge: 1 to 2.5 % in a lattice that is merely
    stretched.

    particles  radius and height in the first two columns [m]
    volume     of each particle [m3]
    """
    cells = np.stack(np.meshgrid(*(np.arange(length) + 0.5 for length in grid.open_cell.shape), indexing="ij"), axis=-1)
    room = grid.open_cell * (grid.ring * grid.dx)[:, None]
    held = _tents(particles[:, :2] / grid.dx, volume, grid)
    return float(np.maximum(held - _tents(cells.reshape(-1, 2), room.ravel(), grid), 0.0).sum() / volume.sum())


def _tents(places: np.ndarray, volume: np.ndarray, grid: Grid) -> np.ndarray:
    """Volumes at places, in cells, summed with tents around every fourth corner of the cells."""
    sums = np.zeros([length // BLOCK + 2 for length in grid.open_cell.shape])
    most = np.array(grid.open_cell.shape) - 1e-9
    corner, share = np.divmod(np.minimum(places, most) / BLOCK, 1.0)
    i, j = corner.astype(int).T
    for a, b in ((0, 0), (0, 1), (1, 0), (1, 1)):
        weight = np.abs(1.0 - a - share[:, 0]) * np.abs(1.0 - b - share[:, 1])
        np.add.at(sums, (i + a, j + b), weight * volume)
    return sums
