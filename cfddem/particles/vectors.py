"""Three numbers as a vector, for compiled loops."""

from __future__ import annotations

from cfddem.kernels import inline

Vector = tuple[float, float, float]


@inline
def at(array, row):
    """Row of an (N, 3) array."""
    return (array[row, 0], array[row, 1], array[row, 2])


@inline
def put(array, row, a):
    """Write a vector into a row of an (N, 3) array."""
    array[row, 0] = a[0]
    array[row, 1] = a[1]
    array[row, 2] = a[2]


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
def across(a, normal):
    """The part of a that is perpendicular to a unit normal."""
    return minus(a, times(dot(a, normal), normal))
