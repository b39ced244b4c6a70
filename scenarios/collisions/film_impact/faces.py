"""Velocities on faces that no particle reaches: in a gap thinner than their spacing, and outside the liquid."""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import serial
from scenarios.collisions.film_impact.liquid import sample

AROUND, BESIDE = 3, 2
"""Layers of faces to which velocities are extended, and to which their change in a step is; beyond, liquid falls
freely."""


@serial
def carry(dt, dx, along, values, known, last, last_known):
    """Velocities of faces without particles from the step before, carried along the radius with the speed `along`."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            if not known[i, j] and last_known[i, j]:
                values[i, j] = sample(last, i - dt * along[i, min(j, along.shape[1] - 1)] / dx, float(j))
                known[i, j] = True


@serial
def extend(values, known, layers):
    """Extend values outwards, layer by layer, by the mean of the neighbours that are known."""
    known = known.copy()
    for _ in range(layers):
        fresh = known.copy()
        for i in range(values.shape[0]):
            for j in range(values.shape[1]):
                if known[i, j]:
                    continue
                total, count = 0.0, 0
                for k, m in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                    if 0 <= k < values.shape[0] and 0 <= m < values.shape[1] and known[k, m]:
                        total += values[k, m]
                        count += 1
                if count:
                    values[i, j] = total / count
                    fresh[i, j] = True
        known[:] = fresh


def cells_to_faces(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether each radial and each horizontal face has a marked cell on one side."""
    u = np.zeros((cells.shape[0] + 1, cells.shape[1]), dtype=np.bool_)
    w = np.zeros((cells.shape[0], cells.shape[1] + 1), dtype=np.bool_)
    u[:-1] |= cells
    u[1:] |= cells
    w[:, :-1] |= cells
    w[:, 1:] |= cells
    return u, w


def extended_change(after: np.ndarray, before: np.ndarray, wet: np.ndarray, elsewhere: float) -> np.ndarray:
    """Velocities after a step, also beside the liquid and within the solids, where the change is that next to them.

    after, before  velocities of the step
    wet            faces on which the step has computed one
    elsewhere      change far from the liquid [m/s]
    """
    change = np.where(wet, after - before, np.nan)
    extend(change, wet, BESIDE)
    return before + np.where(np.isnan(change), elsewhere, change)
