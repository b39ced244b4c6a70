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
"""Cells along each side of the blocks in which liquid and room are compared."""


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

    Summed over blocks of four cells by four, in which the number of particles varies little.

    particles  radius and height in the first two columns [m]
    volume     of each particle [m3]
    """
    held = np.zeros(grid.open_cell.shape)
    place = np.minimum((particles[:, :2] / grid.dx).astype(int), np.array(held.shape) - 1)
    np.add.at(held, (place[:, 0], place[:, 1]), volume)
    room = grid.open_cell * (grid.ring * grid.dx)[:, None]
    return float(np.maximum(_blocks(held) - _blocks(room), 0.0).sum() / held.sum())


def _blocks(cells: np.ndarray) -> np.ndarray:
    """Sums over blocks; an incomplete block at an end is left out."""
    radial, vertical = (length // BLOCK for length in cells.shape)
    whole = cells[: radial * BLOCK, : vertical * BLOCK]
    return np.asarray(whole.reshape(radial, BLOCK, vertical, BLOCK).sum(axis=(1, 3)))
