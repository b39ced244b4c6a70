"""Cavitation: where the pressure would fall below that of the vapour, a void opens, and closes before it carries load.

Each liquid cell either has no void and a pressure above the floor, or the pressure of the floor and a void whose volume
grows or shrinks. The set of cells with voids is found by exchanging cells until every one satisfies its inequality.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import serial

EXCHANGES = 50
"""Largest number of exchanges between the two sets; then the last set is taken and the step counted."""


def coupled(
    matrix: np.ndarray, outflow: np.ndarray, projected: np.ndarray, velocity: float, share: float
) -> tuple[np.ndarray, float]:
    """Pressure and bead speed for which the outflow of every cell and the bead's displacement add to zero.

    matrix     lower bands of the pressure equation
    outflow    of each cell before the pressure [m3/s]
    projected  projected area of the bead in each cell [m2]
    velocity   of the bead before the pressure [m/s]
    share      time step over its mass [s/kg]
    """
    both = np.stack([-outflow, projected], axis=1)
    at_rest, moving = solve_banded(matrix, both).T
    speed = float((velocity + share * (projected @ at_rest)) / (1.0 + share * (projected @ moving)))
    return at_rest - speed * moving, speed


def with_voids(
    matrix: np.ndarray, outflow: np.ndarray, projected: np.ndarray, velocity: float, share: float, floor: float,
    closing: np.ndarray,
) -> tuple[np.ndarray, float, np.ndarray, bool]:  # fmt: skip
    """The same with a lowest pressure.

    floor    lowest pressure [Pa]
    closing  void of each cell over the time step [m3/s]
    returns  pressure, speed, the rate at which the void of each cell grows [m3/s], and whether every cell satisfies its
             inequality
    """
    void = closing > 0.0
    for _ in range(EXCHANGES):
        pressure, speed = _with_fixed(
            matrix, outflow + np.where(void, 0.0, closing), projected, velocity, share, floor * void
        )
        growth = np.where(void, _times(matrix, pressure) + outflow + projected * speed, -closing)
        opens, shuts = ~void & (pressure < floor), void & (growth < -closing)
        if not (opens.any() or shuts.any()):
            return pressure, speed, growth, True
        void = (void | opens) & ~shuts
    return pressure, speed, growth, False


def _with_fixed(
    matrix: np.ndarray, outflow: np.ndarray, projected: np.ndarray, velocity: float, share: float, fixed: np.ndarray
) -> tuple[np.ndarray, float]:
    """Pressure and bead speed with the pressure given in some cells, where `fixed` is not 0."""
    known = fixed != 0.0
    if not known.any():
        return coupled(matrix, outflow, projected, velocity, share)
    free = matrix.copy()
    free[:, known] = 0.0
    for band in range(1, len(matrix)):
        free[band, :-band][known[band:]] = 0.0
    free[0, known] = 1.0
    both = np.stack([-outflow - _times(matrix, fixed), projected], axis=1)
    both[known] = np.stack([fixed[known], np.zeros(known.sum())], axis=1)
    at_rest, moving = solve_banded(free, both).T
    speed = float((velocity + share * (projected @ at_rest)) / (1.0 + share * (projected @ moving)))
    return at_rest - speed * moving, speed


def _times(matrix: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Product of a symmetric matrix, given by its lower bands, with a vector."""
    product = matrix[0] * values
    for band in range(1, len(matrix)):
        product[band:] += matrix[band, :-band] * values[:-band]
        product[:-band] += matrix[band, :-band] * values[band:]
    return product


# ---------------------------------------------------------------- banded systems


@serial
def factorise(matrix, lower):
    """Cholesky factor, and whether all its pivots are above 0.

    matrix  lower bands (bands, n), entry [b, c] in row c + b
    lower   factor by columns (n, bands), entry [c, b] in row c + b
    """
    bands, count = matrix.shape
    for c in range(count):
        for b in range(bands):
            lower[c, b] = matrix[b, c] if c + b < count else 0.0
    for c in range(count):
        if not lower[c, 0] > 0.0:
            return False
        pivot = math.sqrt(lower[c, 0])
        for b in range(bands):
            lower[c, b] /= pivot
        for b in range(1, min(bands, count - c)):
            factor = lower[c, b]
            if factor != 0.0:
                for k in range(bands - b):
                    lower[c + b, k] -= factor * lower[c, b + k]
    return True


@serial
def substitute(lower, values):
    """Solve with the factor for each column of `values` (n, m), in place."""
    count, bands = lower.shape
    for m in range(values.shape[1]):
        for c in range(count):
            values[c, m] /= lower[c, 0]
            for b in range(1, min(bands, count - c)):
                values[c + b, m] -= lower[c, b] * values[c, m]
        for c in range(count - 1, -1, -1):
            for b in range(1, min(bands, count - c)):
                values[c, m] -= lower[c, b] * values[c + b, m]
            values[c, m] /= lower[c, 0]


def solve_banded(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution of a positive definite banded system.

    matrix   lower bands (bands, n), as for scipy.linalg.solveh_banded with lower=True
    right    right-hand sides (n, m)
    returns  solutions (n, m)
    """
    lower, solution = np.empty(matrix.shape[::-1]), np.array(right, dtype=float)
    if not factorise(matrix, lower):
        raise np.linalg.LinAlgError("the matrix of the pressure is not positive definite")
    substitute(lower, solution)
    return solution
