"""Ghost cells of padded fields.

Every array that a loop reads beyond its cells is padded by layers of ghosts below and above in every direction, and
`Halo` is the only place that fills them. A ghost takes the value of the cell that lies there: the image of an inside
cell in a periodic direction, the nearest inside cell in any other. Where a boundary condition says more,
`cfddem.fluid.boundaries` then overwrites the ghosts beyond that side. On a cluster the ghosts beyond a border between
ranks take the values of the neighbour, by the same calls.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from cfddem.backend.compile import inline, serial
from cfddem.fluid.grid import HIGH, LOW, Array


@inline
def place(axis, layer, a, b):
    """Indices k, j, i of a cell in a layer normal to an axis; a, b count along the two other array axes in order."""
    if axis == 0:
        return a, b, layer
    return (a, layer, b) if axis == 1 else (layer, a, b)


@inline
def neighbours(n, count):
    """Indices of the layers before and after layer n of an array without ghosts, which begins again at its end.

    The multigrid of the pressure takes its neighbours from here instead of from ghosts: small levels would spend more
    time on their ghosts than on their cells.
    """
    return (n - 1) % count, (n + 1) % count


@serial
def fill_ghosts(fields, low, counts, periodic, extend):
    """Fill the ghosts of fields (m, nz, ny, nx), one axis after the other, edges and corners included.

    low       layers of ghosts below the inside layers
    counts    (m, 3) inside layers along x, y, z; or (1, 3), the same for all fields
    periodic  (3,) whether an axis is periodic
    extend    whether ghosts along other axes take the value of the nearest layer; if not, they are left alone
    """
    _, nz, ny, nx = fields.shape
    for axis in range(3):
        if not (periodic[axis] or extend):
            continue
        for m in range(fields.shape[0]):
            field, n = fields[m], counts[min(m, counts.shape[0] - 1), axis]
            for ghost in range(fields.shape[3 - axis]):
                if low <= ghost < n + low:
                    continue
                inside = low + (ghost - low) % n if periodic[axis] else min(max(ghost, low), n + low - 1)
                if axis == 0:
                    for k in range(nz):
                        for j in range(ny):
                            field[k, j, ghost] = field[k, j, inside]
                elif axis == 1:
                    for k in range(nz):
                        for i in range(nx):
                            field[k, ghost, i] = field[k, inside, i]
                else:
                    for j in range(ny):
                        for i in range(nx):
                            field[ghost, j, i] = field[inside, j, i]


class Halo:
    """The ghost cells of a grid.

    cells      nx, ny, nz
    periodic   (3,) whether x, y, z are periodic
    low, high  layers of ghosts below and above the cells in every direction
    """

    def __init__(
        self, cells: Sequence[int], periodic: Sequence[bool] | np.ndarray, low: int = LOW, high: int = HIGH
    ) -> None:
        self.periodic, self.low, self.high = np.array(periodic, bool), low, high
        self._cells = np.array([cells], dtype=np.int64)
        # A direction that is not periodic has one more face than cells.
        self._faces = self._cells + np.diag(~self.periodic)

    def inner(self, padded: Array) -> Array:
        """View of padded cell fields (..., nz, ny, nx) without their ghosts."""
        nx, ny, nz = self._cells[0] + self.low
        return padded[..., self.low : nz, self.low : ny, self.low : nx]

    def fill(self, fields: Array) -> None:
        """Fill the ghosts of a padded cell field (nz, ny, nx), or of several (m, nz, ny, nx)."""
        stacked = fields[None] if fields.ndim == 3 else fields
        fill_ghosts(stacked, self.low, self._cells, self.periodic, True)

    def fill_faces(self, vector: Array, extend: bool = True) -> None:
        """Fill the ghosts of a face field (3, nz, ny, nx); the faces on the sides of the box are not ghosts.

        extend  whether to fill the ghosts beyond sides that are not periodic; if not, boundary conditions do
        """
        fill_ghosts(vector, self.low, self._faces, self.periodic, extend)

    def padded(self, values: ArrayLike, outside: float | None = None) -> Array:
        """A padded copy of a cell field (nz, ny, nx), or of several (m, nz, ny, nx), with its ghosts.

        outside  value of ghosts beyond sides that are not periodic; that of the nearest cell if None
        """
        given = np.asarray(values, dtype=float)
        shape = tuple(n + self.low + self.high for n in given.shape[-3:])
        made = np.full((*given.shape[:-3], *shape), 0.0 if outside is None else outside)
        self.inner(made)[:] = given
        fill_ghosts(made.reshape(-1, *shape), self.low, self._cells, self.periodic, outside is None)
        return made

    def extended(self, plane: np.ndarray, axis: int) -> np.ndarray:
        """Values (..., a, b) over a side normal to `axis`, continued into the ghost rows around it as `fill` would."""
        for at, other in zip((-2, -1), [d for d in (2, 1, 0) if d != axis]):
            width = [(0, 0)] * plane.ndim
            width[at] = (self.low, self.high)
            plane = np.pad(plane, width, mode="wrap" if self.periodic[other] else "edge")
        return plane
