r"""Sums with the same bits in any order of their terms, and so on any number of threads and ranks.

A sum of whole numbers has no rounding. Each term is therefore written as two whole numbers,

.. math:: x = (a + 2^{-30} b)/U,\qquad |a|, |b| \le 2^{30},

with a power of two U that the largest of all terms sets. Both are summed as 64-bit integers, of up to 2^31 terms. What
is lost of a term is at most 2^-61 of the largest one.
"""

from __future__ import annotations

import math
from typing import Any

DIGITS = 30
"""Binary digits of each of the two whole numbers."""

FINE = 2.0**DIGITS


def unit_of(largest: float, digits: int = DIGITS) -> float:
    """Power of two U with U times the largest term of at most 2^digits; 1 where that is zero or not finite."""
    if not 0.0 < largest < math.inf:
        return 1.0
    return math.ldexp(1.0, min(digits - math.frexp(largest)[1], 1000))


def put_together(parts: Any, unit: Any) -> Any:
    """The sums of which the two whole numbers are given (2, ...), as numbers or arrays."""
    whole, fine = parts[0] + (parts[1] >> DIGITS), parts[1] & ((1 << DIGITS) - 1)
    return (whole + fine / FINE) / unit
