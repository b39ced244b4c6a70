r"""Sums with the same bits in any order of their terms, and so on any number of threads and ranks.

A sum of whole numbers has no rounding. Each term is therefore written as two whole numbers,

.. math:: x = (a + 2^{-30} b)/U,\qquad |a|, |b| \le 2^{30},

with a power of two U that the largest of all terms sets. Both are summed as 64-bit integers, of up to 2^31 terms. What
is lost of a term is at most 2^-61 of the largest one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.compile import prange, threaded, vector_inline

DIGITS = 30
"""Binary digits of each of the two whole numbers."""

FINE = 2.0**DIGITS


def unit_of(largest: float, digits: int = DIGITS) -> float:
    """Power of two U with U times the largest term of at most 2^digits; 1 where that is zero or not finite."""
    if not 0.0 < largest < math.inf:
        return 1.0
    return math.ldexp(1.0, min(digits - math.frexp(largest)[1], 1000))


def split(values: NDArray[np.float64], unit: Any, axis: Any) -> NDArray[np.int64]:
    """Sums of the two whole numbers of finite values over some axes (2, ...); `unit` as `values` with these axes."""
    scaled = values * unit
    whole = np.rint(scaled)
    fine = np.rint((scaled - whole) * FINE)
    return np.stack([part.astype(np.int64).sum(axis=axis) for part in (whole, fine)])


def put_together(parts: NDArray[np.int64], unit: Any) -> Any:
    """The sums of which the two whole numbers are given (2, ...)."""
    whole, fine = parts[0] + (parts[1] >> DIGITS), parts[1] & ((1 << DIGITS) - 1)
    return (whole + fine / FINE) / unit


@threaded
def largest_products(a, b, rows, largest):
    """Largest magnitude of a b in each plane of two cell fields (nz, ny, nx); rows (2, nz, nx) are overwritten."""
    for k in prange(a.shape[0]):
        rows[0, k] = 0.0
        for j in range(a.shape[1]):
            _take_largest(a[k, j], b[k, j], rows[0, k])
        most = 0.0
        for i in range(a.shape[2]):
            most = max(most, rows[0, k, i])
        largest[k] = most


@threaded
def split_products(a, b, unit, rows, parts):
    """Sums of the two whole numbers of a b in each plane of two cell fields (nz, 2); rows as of `largest_products`."""
    for k in prange(a.shape[0]):
        rows[0, k] = rows[1, k] = 0.0
        for j in range(a.shape[1]):
            _add_split(a[k, j], b[k, j], unit, rows[0, k], rows[1, k])
        parts[k, 0] = parts[k, 1] = 0
        for i in range(a.shape[2]):  # sums over a row of the plane are below 2^53
            parts[k, 0] += np.int64(rows[0, k, i])
            parts[k, 1] += np.int64(rows[1, k, i])


@vector_inline
def _take_largest(a, b, row):
    """row = max(row, |a b|)"""
    for i in range(row.size):
        row[i] = max(row[i], abs(a[i] * b[i]))


@vector_inline
def _add_split(a, b, unit, whole, fine):
    """Add the whole numbers of a b, as floats."""
    for i in range(whole.size):
        scaled = a[i] * b[i] * unit
        rounded = np.rint(scaled)
        whole[i] += rounded
        fine[i] += np.rint((scaled - rounded) * FINE)
