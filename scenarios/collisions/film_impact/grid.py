"""The axisymmetric grid, and which part of it the bead leaves open.

Cells are squares of width dx in the plane of radius and height. Pressure is at their centres, radial velocity u on the
faces at r = i dx, vertical velocity w on the faces at z = j dx. The plate is at z = 0. Only the lower half of the bead
bounds the liquid; the space above it, within its projected area, is closed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import inline, serial

FAR = 1e30
"""Height of the bead's surface outside its projected area [m]."""

TINY = 1e-6
"""Open share of a cell that the bead fills but for a corner: liquid passes through it, and pressure too."""


class Faces(NamedTuple):
    """A number on every face, for loops."""

    u: np.ndarray  # on radial faces (radial + 1, vertical)
    w: np.ndarray  # on horizontal faces (radial, vertical + 1)


class Cells(NamedTuple):
    """The liquid in the cells, for loops."""

    liquid: np.ndarray  # which cells are liquid (radial, vertical)
    filled: np.ndarray  # share of each that is filled [-]
    dx: float  # width of a cell [m]
    outer_open: bool  # whether the side lets liquid out
    density: float  # of the liquid [kg/m3]


class Underside(NamedTuple):
    """The bead as a boundary of the flow, for loops."""

    radius: float  # [m]
    gap: float  # height of the lowest point [m]
    velocity: float  # [m/s]
    dx: float  # width of a cell [m]


@dataclass
class Grid:
    """Sizes of the grid and the open fractions of its faces and cells."""

    radial: int  # cells along the radius
    vertical: int  # cells along the height
    dx: float  # width of a cell [m]
    outer_open: bool = False  # the side lets liquid out at zero pressure; otherwise it is a slip wall
    open_u: np.ndarray = field(init=False, repr=False)  # open fraction of radial faces (radial + 1, vertical)
    open_w: np.ndarray = field(init=False, repr=False)  # of horizontal faces (radial, vertical + 1)
    open_cell: np.ndarray = field(init=False, repr=False)  # of cells (radial, vertical)

    def __post_init__(self) -> None:
        self.open_u = np.ones((self.radial + 1, self.vertical))
        self.open_w = np.ones((self.radial, self.vertical + 1))
        self.open_cell = np.ones((self.radial, self.vertical))

    def place_bead(self, radius: float, gap: float) -> None:
        """Compute the open fractions for a bead whose lowest point is at a height `gap`."""
        cut(radius, gap, self.dx, self.open_u, self.open_w, self.open_cell)

    @property
    def open(self) -> Faces:
        """Open fractions of the faces."""
        return Faces(self.open_u, self.open_w)

    @property
    def ring(self) -> np.ndarray:
        """Horizontal area of each column [m2]."""
        return np.pi * self.dx**2 * (2.0 * np.arange(self.radial) + 1.0)


@inline
def surface_height(radius, gap, r):
    """Height of the underside of the bead at a distance from the axis [m]."""
    if r >= radius:
        return FAR
    return gap + r * r / (radius + math.sqrt(radius * radius - r * r))


@inline
def surface_radius_squared(radius, gap, z):
    """Square of the radius at which the underside of the bead has a height [m2]."""
    depth = min(max(z - gap, 0.0), radius)
    return depth * (2.0 * radius - depth)


@serial
def cut(radius, gap, dx, open_u, open_w, open_cell):
    """Open fractions of faces and cells; exact for faces, by four strips for cells."""
    radial, vertical = open_cell.shape
    for i in range(radial + 1):
        height = surface_height(radius, gap, i * dx) / dx
        for j in range(vertical):
            open_u[i, j] = min(max(height - j, 0.0), 1.0)
    for j in range(vertical + 1):
        edge = surface_radius_squared(radius, gap, j * dx) / (dx * dx)
        for i in range(radial):
            inner, outer = float(i * i), float((i + 1) * (i + 1))
            open_w[i, j] = (outer - min(max(edge, inner), outer)) / (outer - inner)
    for i in range(radial):
        for j in range(vertical):
            open_cell[i, j] = 0.0
        for strip in range(4):
            place = i + (strip + 0.5) / 4.0
            height = surface_height(radius, gap, place * dx) / dx
            share = place / (4.0 * (i + 0.5))
            for j in range(vertical):
                open_cell[i, j] += share * min(max(height - j, 0.0), 1.0)
        for j in range(vertical):
            if open_u[i + 1, j] > 0.0 or open_w[i, j] > 0.0:
                open_cell[i, j] = max(open_cell[i, j], TINY)
