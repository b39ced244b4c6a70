"""Cholesky solution of a symmetric banded system, in one thread and always with the same bits.

LAPACK's routine starts as many threads as there are cores for matrices of this size; on a busy machine they wait for
each other for most of a run.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import serial


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
