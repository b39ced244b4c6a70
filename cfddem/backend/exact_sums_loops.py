"""Loops over the terms of sums with the same bits in any order (:mod:`cfddem.backend.exact_sums`)."""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import serial
from cfddem.backend.exact_sums import DIGITS, FINE


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


@serial
def sums_of_rows(rows, bits, sums, bits_of_sums):
    """Sum of every row (k, n) of one process, to `sums` (k,), in one call; `bits` are those of the rows."""
    unit, parts = np.empty(len(rows)), np.empty((2, len(rows)), np.int64)
    largest_of_rows(bits, bits_of_sums)
    for k in range(len(rows)):
        most, unit[k] = sums[k], 1.0
        if most > 0.0:
            unit[k] = math.ldexp(1.0, min(DIGITS - math.frexp(most)[1], 1000)) if most < math.inf else 0.0
        elif most != 0.0:
            unit[k] = 0.0
    split(rows, unit, parts)
    for k in range(len(rows)):
        whole, fine = parts[0, k] + (parts[1, k] >> DIGITS), parts[1, k] & ((1 << DIGITS) - 1)
        sums[k] = (whole + fine / FINE) / unit[k] if unit[k] > 0.0 else math.nan
