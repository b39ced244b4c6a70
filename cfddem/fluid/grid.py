"""The grid: a box of equal cells. Velocities sit on faces, all other fields at cell centres.

Index order is `[k, j, i]` for `(z, y, x)` everywhere, x running fastest: a cell field has the shape
`(nz, ny, nx)`, which is also the order of the output files. Users pass and receive cell fields as
`(nz, ny, nx)` and vectors at cells as `(nz, ny, nx, 3)`; points are `(N, 3)` with columns x, y, z.

Inside the solver fields carry ghost cells, `LOW` below and `HIGH` above in every direction, and vectors have
their component first: `(3, nz + 5, ny + 5, nx + 5)`. Component d of a velocity at padded index p sits on the
*low* d-face of cell p; the face on the high side of the box is therefore the low face of the first ghost cell.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.communicator import SERIAL
from cfddem.backend.compile import inline, prange, threaded
from cfddem.backend.errors import InputError
from cfddem.fluid.cell_counts import cell_counts

Array = NDArray[np.float64]
Region = Callable[[Array, Array, Array], NDArray[np.bool_]]
"""A function of coordinates x, y, z [m] that broadcast: true for points in the region."""

LOW, HIGH = 2, 3
"""Layers of ghosts. A limited flux reads two faces upstream, on the high boundary face from one face further out."""

UNIT = ((0, 0, 1), (0, 1, 0), (1, 0, 0))
"""Index step (k, j, i) along x, y, z."""

AT_FACES = np.array([[0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.5, 0.5, 0.0]])
AT_CENTRES = np.full((1, 3), 0.5)
"""Where in its cell a component is stored, in cell widths along x, y, z."""


def layers(axis: int, which: int | slice | list[int]) -> tuple[Any, ...]:
    """Index of layers of cells normal to x, y or z (axis 0, 1, 2) in the last three axes of an array."""
    return (Ellipsis, which, *(slice(None),) * axis)


@dataclass(frozen=True, eq=False)
class Grid:
    """A box of nx x ny x nz equal cells, some of which may be solid.

    cells    nx, ny, nz; 1 makes the problem two-dimensional
    spacing  hx, hy, hz of a cell [m]; need not be equal
    origin   corner of the box with the lowest x, y, z [m]
    solid    (nz, ny, nx) true where a cell is solid, or None
    walls    smooth walls, which cut cells (:func:`cfddem.fluid.cut_cells.within`), or None

    Attributes: `communicator`, of the ranks that share the grid.

    >>> Grid(cells=(4, 4, 24), spacing=(5e-3, 5e-3, 5e-3)).origin
    (0.0, 0.0, 0.0)
    """

    cells: tuple[int, int, int]
    spacing: tuple[float, float, float]
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    solid: NDArray[np.bool_] | None = field(default=None, repr=False)
    walls: Any = field(default=None, repr=False)
    communicator = SERIAL

    def __post_init__(self) -> None:
        if len(self.cells) != 3 or any(int(n) != n or n < 1 for n in self.cells):
            raise InputError("grid.cells", self.cells, "three whole numbers of at least 1")
        if len(self.spacing) != 3 or not all(np.isfinite(h) and h > 0 for h in self.spacing):
            raise InputError("grid.spacing", self.spacing, "three positive lengths in m")
        object.__setattr__(self, "cells", tuple(int(n) for n in self.cells))
        object.__setattr__(self, "spacing", tuple(float(h) for h in self.spacing))
        object.__setattr__(self, "origin", tuple(float(x) for x in self.origin))
        if self.solid is not None:
            solid = np.ascontiguousarray(self.solid, dtype=bool)
            if solid.shape != self.shape:
                raise InputError("grid.solid", solid.shape, f"an array of shape (nz, ny, nx) = {self.shape}")
            if self.whole is self and solid.all():
                raise InputError("grid.solid", None, "open in at least one cell", "the mask fills the whole box")
            object.__setattr__(self, "solid", solid if solid.any() else None)

    @classmethod
    def of_size(
        cls,
        size: Sequence[float],
        cell: float | Sequence[float],
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        solid: Region | None = None,
    ) -> Grid:
        """The grid that fills a box with cells of a given size.

        size     edge lengths of the box along x, y, z [m]
        cell     edge of a cube, or three edges [m]; must divide the box to within 1e-6
        origin   lowest corner [m]
        solid    region of solid cells; a cell is solid if its centre lies in it
        returns  Grid
        errors   InputError where the cells do not fit the box
        """
        counts = cell_counts(size, cell)
        grid = cls(
            counts,
            tuple(float(length) / n for length, n in zip(size, counts)),  # type: ignore[arg-type]
            tuple(float(x) for x in origin),  # type: ignore[arg-type]
        )
        return grid if solid is None else grid.with_solid(solid)

    def with_solid(self, region: Region) -> Grid:
        """The same grid with every cell solid whose centre lies in `region`."""
        inside = np.broadcast_to(region(*self.centres()), self.shape)
        return Grid(self.cells, self.spacing, self.origin, np.array(inside, dtype=bool))

    @property
    def whole(self) -> Grid:
        """The grid of the whole box; another one if this grid is the :class:`cfddem.fluid.block.Block` of a rank."""
        return self

    @property
    def first(self) -> tuple[int, int, int]:
        """Number of the first cell along x, y, z in the whole grid."""
        return 0, 0, 0

    def divided(self, parts: tuple[int, int, int]) -> Grid:
        """The same box with every cell divided along x, y, z into so many, and the same walls."""
        cells: Any = tuple(n * count for n, count in zip(self.cells, parts))
        spacing: Any = tuple(h / count for h, count in zip(self.spacing, parts))
        solid = self.solid
        if solid is not None:
            for axis, count in enumerate(parts):
                solid = np.repeat(solid, count, axis=2 - axis)
        return Grid(cells, spacing, self.origin, solid, self.walls)

    def touches(self, axis: int, high: bool) -> bool:
        """Whether the low or high end of an axis is a side of the box."""
        return True

    def borders(self, periodic: Sequence[bool] | NDArray[np.bool_]) -> tuple[Any, ...]:
        """Borders with the cells of other ranks (:class:`cfddem.fluid.halo.Borders`).

        periodic  (3,) whether x, y, z are periodic
        """
        return ()

    def part(self, values: np.ndarray, faces: bool = False) -> np.ndarray:
        """The part of this grid in an array over the whole one (..., nz, ny, nx), as `Block.part`."""
        return values

    def joined(self, values: np.ndarray) -> np.ndarray:
        """The array over the whole grid of which every rank has a part (..., nz, ny, nx), as `Block.joined`."""
        return values

    @property
    def shape(self) -> tuple[int, int, int]:
        """(nz, ny, nx)."""
        return self.cells[2], self.cells[1], self.cells[0]

    @property
    def padded_shape(self) -> tuple[int, int, int]:
        """Shape of a cell field with its ghost cells."""
        nz, ny, nx = self.shape
        return nz + LOW + HIGH, ny + LOW + HIGH, nx + LOW + HIGH

    @property
    def size(self) -> tuple[float, float, float]:
        """Edge lengths of the box [m]."""
        return tuple(n * h for n, h in zip(self.cells, self.spacing))  # type: ignore[return-value]

    @property
    def cell_volume(self) -> float:
        """Volume of a cell [m3]."""
        return self.spacing[0] * self.spacing[1] * self.spacing[2]

    @property
    def open(self) -> NDArray[np.bool_]:
        """(nz, ny, nx) true where a cell holds fluid."""
        return np.ones(self.shape, dtype=bool) if self.solid is None else ~self.solid

    def face_area(self, axis: int) -> float:
        """Area of a face normal to axis 0, 1, 2 = x, y, z [m2]."""
        return self.cell_volume / self.spacing[axis]

    def centres(self) -> tuple[Array, Array, Array]:
        """Coordinates of cell centres [m], three arrays that broadcast to (nz, ny, nx)."""
        return self._coordinates((0.5, 0.5, 0.5), self.cells)

    def faces(self, axis: int) -> tuple[Array, Array, Array]:
        """Coordinates of the faces normal to `axis` [m], both boundary faces included, ready to broadcast."""
        offset = [0.5, 0.5, 0.5]
        offset[axis] = 0.0
        counts = list(self.cells)
        counts[axis] += 1
        return self._coordinates(tuple(offset), tuple(counts))

    def _coordinates(self, offset: Sequence[float], counts: Sequence[int]) -> tuple[Array, Array, Array]:
        lines: list[Array] = [
            x0 + h * (np.arange(first, first + n, dtype=float) + o)
            for x0, h, first, n, o in zip(self.whole.origin, self.spacing, self.first, counts, offset)
        ]
        return lines[0][None, None, :], lines[1][None, :, None], lines[2][:, None, None]

    def inner(self, padded: Array) -> Array:
        """View of a padded field (last three axes) without its ghost cells."""
        nz, ny, nx = self.shape
        return padded[..., LOW : LOW + nz, LOW : LOW + ny, LOW : LOW + nx]

    def inner_faces(self, padded: Array, axis: int) -> Array:
        """View of one padded velocity component on the faces of the box, both boundaries included."""
        counts = list(self.shape)
        counts[2 - axis] += 1
        nz, ny, nx = counts
        return padded[LOW : LOW + nz, LOW : LOW + ny, LOW : LOW + nx]


def on_faces(cells: Array, axis: int) -> Array:
    """Mean of the two cells on both sides of every face normal to `axis`, of a padded cell field."""
    return np.asarray(0.5 * (cells + np.roll(cells, 1, axis=2 - axis)))


def outside_cylinder(centre: Sequence[float], radius: float, axis: int = 2) -> Region:
    """Region outside an infinite cylinder along `axis` through the point `centre` [m]: the wall of a pipe."""
    return outside_cone(centre, (0.0, 1.0), (radius, radius), axis)


def outside_cone(
    centre: Sequence[float], heights: tuple[float, float], radii: tuple[float, float], axis: int = 2
) -> Region:
    """Region outside a cone frustum, continued as cylinders below and above it.

    centre   a point on the axis [m]
    heights  coordinates along the axis where the cone begins and ends [m]
    radii    its radius at these two places [m]
    axis     0, 1, 2 for x, y, z
    """

    def region(*coordinates: Array) -> NDArray[np.bool_]:
        across = [d for d in range(3) if d != axis]
        distance = np.sqrt(sum((coordinates[d] - centre[d]) ** 2 for d in across))
        return np.asarray(distance > np.interp(coordinates[axis], heights, radii))

    return region


@inline
def _layer_and_share(coordinate, lowest, layers):
    """Layer of a padded array below a coordinate, and share of the next one; `lowest` is the number of the first."""
    inside = min(max(coordinate, float(lowest)), lowest + (layers - 1.001))
    below = math.floor(inside)
    return below - lowest, inside - below


def at_points(grid: Grid, faces: Array, points: Array) -> Array:
    """Tri-linear values of a padded field on faces (3, ...) at points (N, 3) [m]: (N, 3)."""
    points = np.ascontiguousarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError("points", points.shape, "of shape (N, 3)")
    values, origin, first = np.empty((len(points), 3)), np.array(grid.whole.origin), np.array(grid.first)
    sample(faces, AT_FACES, points, origin, first, 1.0 / np.array(grid.spacing), values)
    return values


@threaded
def sample(fields, place, points, origin, first, inverse_spacing, values):
    """Tri-linear values of padded fields at points.

    fields  (m, nz+5, ny+5, nx+5), ghosts filled; place (m, 3) where in its cell each field sits;
    points (N, 3) [m], taken at the edge of the ghosts where they lie outside; values (N, m) is written.
    origin  lowest corner of the whole grid (3,) [m]; coordinates count its cells, with the same bits on every rank
    first   number of the first cell of this rank (3,)
    """
    nz, ny, nx = fields.shape[1:]
    for n in prange(points.shape[0]):
        x = (points[n, 0] - origin[0]) * inverse_spacing[0]
        y = (points[n, 1] - origin[1]) * inverse_spacing[1]
        z = (points[n, 2] - origin[2]) * inverse_spacing[2]
        for m in range(fields.shape[0]):
            i, a = _layer_and_share(x - place[m, 0], first[0] - LOW, nx)
            j, b = _layer_and_share(y - place[m, 1], first[1] - LOW, ny)
            k, c = _layer_and_share(z - place[m, 2], first[2] - LOW, nz)
            f = fields[m]
            low = (1 - b) * ((1 - a) * f[k, j, i] + a * f[k, j, i + 1])
            low += b * ((1 - a) * f[k, j + 1, i] + a * f[k, j + 1, i + 1])
            high = (1 - b) * ((1 - a) * f[k + 1, j, i] + a * f[k + 1, j, i + 1])
            high += b * ((1 - a) * f[k + 1, j + 1, i] + a * f[k + 1, j + 1, i + 1])
            values[n, m] = (1 - c) * low + c * high
