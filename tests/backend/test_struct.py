"""Structures of structures of arrays that compiled loops take by reference."""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numpy as np
import pytest

from cfddem.backend.compile import inline, part, prange, serial, threaded, use_threads
from cfddem.backend.named import named_arrays
from cfddem.backend.struct import struct

Rows = named_arrays("Memory", ("speed", "way"))


@struct
class Bodies(NamedTuple):
    """A structure with a structure, a vector, numbers, an empty structure and an array of rows in it."""

    rows: Any
    free: tuple[float, float, float]
    gain: float
    every: int
    nothing: Any
    table: np.ndarray


@inline
def move(i, bodies, step):  # type: ignore[no-untyped-def]
    """Move a row; a parallel loop writes through functions."""
    rows = bodies.rows
    rows.way[i] += bodies.free[2] * bodies.gain * step * rows.speed[i] + bodies.every + bodies.table[0].friction


@part
def move_all(bodies, step):  # type: ignore[no-untyped-def]
    for i in prange(len(bodies.rows.way)):
        move(i, bodies, step)


@serial
def walk(bodies, step):  # type: ignore[no-untyped-def]
    """Hands the structure on to a loop of its own."""
    move_all(bodies, step)
    return bodies.rows.way.sum()


@threaded
def on_threads(bodies, step):  # type: ignore[no-untyped-def]
    for i in prange(len(bodies.rows.way)):
        move(i, bodies, step)


def some() -> tuple[Bodies, np.ndarray]:
    """A structure of 1000 rows, and their places after a step of 0.1 s."""
    speed, way, table = np.linspace(0.0, 1.0, 1000), np.zeros(1000), np.recarray(1, dtype=[("friction", float)])
    table.friction = 0.5
    return Bodies(Rows(speed, way), (0.0, 0.0, 2.0), 3.0, 7, named_arrays("Numbers", ())(), table), 0.6 * speed + 7.5


def test_members_are_read_by_name_through_all_levels() -> None:
    bodies, expected = some()
    assert walk(bodies, 0.1) == pytest.approx(expected.sum())
    assert np.allclose(bodies.rows.way, expected, rtol=1e-15)


@pytest.mark.parametrize("threads", [1, 2])
def test_loops_on_all_threads_take_structures(threads: int) -> None:
    before = use_threads(None)
    bodies, expected = some()
    try:
        use_threads(threads)
        on_threads(bodies, 0.1)
    finally:
        use_threads(before)
    assert np.allclose(bodies.rows.way, expected, rtol=1e-15)


def test_a_call_keeps_no_array_alive() -> None:
    bodies, _ = some()
    walk(bodies, 0.1)
    before = sys.getrefcount(bodies.rows.way)
    for _ in range(10):
        walk(bodies, 0.1)
    after = sys.getrefcount(bodies.rows.way)  # pytest holds what it compares
    assert after == before


def test_a_member_of_another_type_is_another_structure() -> None:
    """The same class with whole numbers in place of numbers is compiled anew, not misread."""
    bodies, expected = some()
    walk(bodies._replace(gain=3), 0.1)  # type: ignore[arg-type]
    assert np.allclose(bodies.rows.way, expected, rtol=1e-15)
