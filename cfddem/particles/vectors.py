"""Three numbers as a vector, for compiled loops.

Loops take the vectors of all rows as one flat array: x, y, z of row 0, then of row 1. Rows are unsigned, so that
no row can be negative. Both let the compiler work on several rows at once.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

from cfddem.backend.compile import inline

Vector = tuple[float, float, float]
Arrays = TypeVar("Arrays", bound=tuple[Any, ...])

NOTHING = (0.0, 0.0, 0.0)
LEAST = 1e-300
"""Keeps divisions finite where the result is dropped."""

_1, _2, _3 = np.uint64(1), np.uint64(2), np.uint64(3)


def flat(arrays: Arrays) -> Arrays:
    """The same named arrays, every table of vectors as one flat array; nothing is copied."""
    views = {name: value.reshape(-1) for name, value in arrays._asdict().items() if np.ndim(value) == 2}  # type: ignore[attr-defined]
    return arrays._replace(**views)  # type: ignore[attr-defined, no-any-return]


@inline
def at(array, row):
    """Vector of a row of a flat array."""
    x = _3 * np.uint64(row)
    return (array[x], array[x + _1], array[x + _2])


@inline
def of_row(array, row):
    """Vector of a row of an array of rows (N, 3)."""
    return array[row, 0], array[row, 1], array[row, 2]


@inline
def put(array, row, a):
    """Write a vector into a row of a flat array."""
    x = _3 * np.uint64(row)
    array[x] = a[0]
    array[x + _1] = a[1]
    array[x + _2] = a[2]


@inline
def plus(a, b):
    """a + b"""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@inline
def minus(a, b):
    """a - b"""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inline
def times(factor, a):
    """factor a"""
    return (factor * a[0], factor * a[1], factor * a[2])


@inline
def dot(a, b):
    """a . b"""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def cross(a, b):
    """a x b"""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@inline
def through(matrix, a):
    """M a, with M as three rows"""
    return dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a)


@inline
def solved(matrix, b):
    """x with M x = b, by Cramer's rule"""
    first, second, third = matrix
    along = cross(second, third)
    whole = plus(plus(times(b[0], along), times(b[1], cross(third, first))), times(b[2], cross(first, second)))
    return times(1.0 / dot(first, along), whole)


@inline
def across(a, normal):
    """The part of a that is perpendicular to a unit normal."""
    return minus(a, times(dot(a, normal), normal))


@inline
def select(condition, a, b):
    """a where the condition holds, else b; without a branch."""
    return (a[0] if condition else b[0], a[1] if condition else b[1], a[2] if condition else b[2])
