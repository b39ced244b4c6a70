"""Ghost cells of padded fields.

Every array that a loop reads beyond its cells is padded, `LOW` layers below and `HIGH` above in every direction, and
`Halo` is the only place that fills these layers. A ghost takes the value of the cell that lies there: the image of an
inside cell in a periodic direction, the nearest inside cell in any other. Where a boundary condition says more,
`cfddem.fluid.boundaries` then overwrites the ghosts beyond that side. On a cluster the ghosts beyond a border between
ranks take the values of the neighbour, by the same calls.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cfddem.backend.compile import inline, serial
from cfddem.fluid.grid import HIGH, LOW, Array, Grid


@inline
def place(axis, layer, a, b):
    """Indices k, j, i of a cell in a layer normal to an axis; a, b count along the two other array axes in order."""
    if axis == 0:
        return a, b, layer
    return (a, layer, b) if axis == 1 else (layer, a, b)


@serial
def fill_ghosts(fields, counts, periodic, extend):
    """Fill the ghosts of fields (m, nz, ny, nx), one axis after the other, edges and corners included.

    counts    (m, 3) layers along x, y, z that hold values of their own
    periodic  (3,) whether an axis repeats
    extend    whether ghosts along other axes take the value of the nearest layer; if not, they are left alone
    """
    for axis in range(3):
        if not (periodic[axis] or extend):
            continue
        layers = fields.shape[3 - axis]
        planes = fields.shape[2 if axis == 2 else 1], fields.shape[2 if axis == 0 else 3]
        for m in range(fields.shape[0]):
            n = counts[m, axis]
            for ghost in range(layers):
                if LOW <= ghost < n + LOW:
                    continue
                inside = LOW + (ghost - LOW) % n if periodic[axis] else min(max(ghost, LOW), n + LOW - 1)
                for a in range(planes[0]):
                    for b in range(planes[1]):
                        k, j, i = place(axis, ghost, a, b)
                        kk, jj, ii = place(axis, inside, a, b)
                        fields[m, k, j, i] = fields[m, kk, jj, ii]


class Halo:
    """The ghost cells of a grid.

    grid      the cells
    periodic  (3,) whether the box repeats along x, y, z
    """

    def __init__(self, grid: Grid, periodic: np.ndarray) -> None:
        self.grid, self.periodic = grid, np.array(periodic, bool)
        cells = np.array(grid.cells)
        self._cells = np.tile(cells, (3, 1))
        # A direction that does not repeat has one more face than cells.
        self._faces = self._cells + np.diag(~self.periodic)

    def fill(self, fields: Array) -> None:
        """Fill the ghosts of a cell field (nz, ny, nx), or of up to three (m, nz, ny, nx)."""
        stacked = fields[None] if fields.ndim == 3 else fields
        fill_ghosts(stacked, self._cells, self.periodic, True)

    def fill_faces(self, vector: Array, extend: bool = True) -> None:
        """Fill the ghosts of a face field (3, nz, ny, nx); the faces on the sides of the box are not ghosts.

        extend  whether to fill the ghosts beyond sides that are not periodic; if not, boundary conditions do
        """
        fill_ghosts(vector, self._faces, self.periodic, extend)

    def padded(self, values: ArrayLike, outside: float | None = None) -> Array:
        """A padded copy of a cell field (nz, ny, nx) with its ghosts.

        outside  value of ghosts beyond sides that are not periodic; that of the nearest cell if None
        """
        array = np.array(values, dtype=float)
        for axis in range(3):
            width = [(0, 0)] * 3
            width[2 - axis] = (LOW, HIGH)
            if self.periodic[axis]:
                array = np.pad(array, width, mode="wrap")
            elif outside is None:
                array = np.pad(array, width, mode="edge")
            else:
                array = np.pad(array, width, constant_values=outside)
        return array

    def extended(self, plane: np.ndarray, axis: int) -> np.ndarray:
        """Values (..., a, b) over a side normal to `axis`, continued into the ghost rows around it as `fill` would."""
        for at, other in zip((-2, -1), [d for d in (2, 1, 0) if d != axis]):
            width = [(0, 0)] * plane.ndim
            width[at] = (LOW, HIGH)
            plane = np.pad(plane, width, mode="wrap" if self.periodic[other] else "edge")
        return plane
