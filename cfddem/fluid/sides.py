"""A side of the box as arrays over its plane, and the loop that applies its conditions to a velocity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.backend.compile import serial
from cfddem.fluid.conditions import Condition
from cfddem.fluid.grid import HIGH, LOW, Grid, layers
from cfddem.fluid.halo import place


@dataclass
class Side:
    """A side as arrays over its plane, ghost rows included, in the order of the two remaining array axes."""

    name: str
    axis: int
    high: bool
    conditions: list[Condition]

    def __post_init__(self) -> None:
        self.owner = np.zeros(0, dtype=np.int64)  # index of the condition that holds, without ghost rows
        self.mirror = np.zeros(0)  # of tangential velocities: ghost = mirror * inside + 2 wall at no-slip walls
        self.wall = np.zeros(0)  # (3, plane) velocity given on the face [m/s]
        self.outlet = np.zeros(0, dtype=bool)
        self.pressure = np.zeros(0)  # given on outlets [Pa]
        self.inlets: list[int] = []  # indices of the conditions that are inlets

    def cut(self, here: Sequence[slice]) -> Side:
        """The part of the side that belongs to a block of cells.

        here  which cells of the whole grid the block has along z, y, x
        """
        made = Side(self.name, self.axis, self.high, self.conditions)
        across = tuple(cells for n, cells in enumerate(here) if n != 2 - self.axis)
        padded: Any = (Ellipsis, *(slice(cells.start, cells.stop + LOW + HIGH) for cells in across))
        made.owner, made.inlets = self.owner[across], self.inlets
        made.mirror, made.wall = self.mirror[padded].copy(), self.wall[padded].copy()
        made.outlet, made.pressure = self.outlet[padded].copy(), self.pressure[padded].copy()
        return made

    @property
    def inward(self) -> float:
        """Sign of a normal velocity that points into the box."""
        return -1.0 if self.high else 1.0

    def face(self, grid: Grid) -> int:
        """Index of the layer of faces on the side, in padded velocities."""
        return LOW + grid.cells[self.axis] if self.high else LOW

    def layer(self, array: Any, index: int) -> Any:
        """View of one layer of cells parallel to the side."""
        return array[layers(self.axis, index)]


@serial
def fill_side(velocity, axis, high, n, wall, mirror, outlet):
    """Set the boundary faces and ghosts of a velocity (3, nz, ny, nx) at one side of n cells.

    wall    (3, plane) velocity given on the face [m/s]
    mirror  (plane) of tangential velocities: ghost = mirror * inside + 2 wall at no-slip walls
    outlet  (plane) whether the normal velocity is free
    """
    face, out = (n + LOW, 1) if high else (LOW, -1)
    last = n + LOW - 1 if high else LOW  # the cell at the side
    before = max(last - 1, LOW) if high else min(last + 1, n + LOW - 1)  # the one inward of it
    size = velocity.shape[3 - axis]
    for a in range(mirror.shape[0]):
        for b in range(mirror.shape[1]):
            k, j, i = place(axis, face, a, b)
            kk, jj, ii = place(axis, face - out, a, b)
            at_face = velocity[axis, k, j, i] if outlet[a, b] else wall[axis, a, b]
            # Fluid that flows back through an outlet comes from rest: it brings no momentum.
            leaves = 0.0 if outlet[a, b] and at_face * out < 0.0 else 1.0
            velocity[axis, k, j, i] = at_face
            beyond = at_face * leaves if outlet[a, b] else 2.0 * at_face - velocity[axis, kk, jj, ii]
            for ghost in (face + out, face + 2 * out):
                if 0 <= ghost < size:
                    k, j, i = place(axis, ghost, a, b)
                    velocity[axis, k, j, i] = beyond
            for component in range(3):
                if component == axis:
                    continue
                fixed = 2.0 * wall[component, a, b] if mirror[a, b] < 0.0 else 0.0
                for depth in range(HIGH if high else LOW):
                    k, j, i = place(axis, last + out * (depth + 1), a, b)
                    kk, jj, ii = place(axis, before if depth else last, a, b)
                    velocity[component, k, j, i] = mirror[a, b] * leaves * velocity[component, kk, jj, ii] + fixed
