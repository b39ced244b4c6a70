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

from cfddem.backend.compile import serial

DIGITS = 30
"""Binary digits of each of the two whole numbers."""

FINE = 2.0**DIGITS


def unit_of(largest: float, digits: int = DIGITS) -> float:
    """Power of two U with U times the largest term of at most 2^digits; 1 where that is zero or not finite."""
    if not 0.0 < largest < math.inf:
        return 1.0
    return math.ldexp(1.0, min(digits - math.frexp(largest)[1], 1000))


@serial
def largest_of_rows(bits, largest):
    """Largest size in every row (k, n), as 64-bit integers, written to `largest` (k,) as such: NaN if there is one.

    Sizes are ordered as the integers of the same bits, and NaN is above all. Integers are compared many at once.
    """
    for k in range(len(bits)):
        most = 0
        for n in range(bits.shape[1]):
            most = max(most, bits[k, n] & 0x7FFFFFFFFFFFFFFF)
        largest[k] = most


@serial
def split(rows, unit, parts):
    """Sums of the two whole numbers of the values of every row (k, n), written to `parts` (2, k); none of unit 0."""
    for k in range(len(rows)):
        whole_sum, fine_sum, of_one = 0, 0, unit[k]
        if of_one > 0.0:
            for n in range(rows.shape[1]):
                scaled = rows[k, n] * of_one
                whole = np.rint(scaled)
                whole_sum += np.int64(whole)
                fine_sum += np.int64(np.rint((scaled - whole) * FINE))
        parts[0, k], parts[1, k] = whole_sum, fine_sum


def put_together(parts: Any, unit: Any) -> Any:
    """The sums of which the two whole numbers are given (2, ...), as numbers or arrays."""
    whole, fine = parts[0] + (parts[1] >> DIGITS), parts[1] & ((1 << DIGITS) - 1)
    return (whole + fine / FINE) / unit
