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

from cfddem.backend.communicator import Communicator
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
    return n - 1 if n > 0 else count - 1, n + 1 if n + 1 < count else 0  # a division would take longer


@serial
def fill_ghosts(fields, low, counts, periodic, extend):
    """Fill the ghosts of fields (m, nz, ny, nx), one axis after the other, edges and corners included.

    low       layers of ghosts below the inside layers
    counts    (m, 3) inside layers along x, y, z; or (1, 3), the same for all fields
    periodic  (3,) whether an axis is periodic
    extend    (3, 2) whether ghosts below and above along other axes take the value of the nearest layer; if not, they
              are left alone
    """
    _, nz, ny, nx = fields.shape
    for axis in range(3):
        if not (periodic[axis] or extend[axis, 0] or extend[axis, 1]):
            continue
        for m in range(fields.shape[0]):
            field, n = fields[m], counts[min(m, counts.shape[0] - 1), axis]
            for ghost in range(fields.shape[3 - axis]):
                if low <= ghost < n + low or not (periodic[axis] or extend[axis, 1 if ghost >= low else 0]):
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


class Borders:
    """The borders of a rank's cells with those of its neighbours along one axis.

    Arrays have ghosts below and above the own layers of cells along this axis; whatever other axes they have is sent.

    communicator  of the run
    axis          0, 1, 2 for x, y, z
    below, above  ranks of the neighbours; None where the box ends. Both may be the same rank
    """

    def __init__(self, communicator: Communicator, axis: int, below: int | None, above: int | None) -> None:
        self.communicator, self.axis, self.below, self.above = communicator, axis, below, above

    def fill(self, fields: np.ndarray, low: int, high: int, at: int | None = None) -> None:
        """Fill the ghosts that neighbours own.

        low, high  layers of ghosts below and above
        at         array axis of the layers; that of `axis` in the last three if None
        """
        if at is None:
            at = fields.ndim - 1 - self.axis
        before, own = (slice(None),) * at, fields.shape[at] - low - high
        below, above = self._swapped(fields[*before, low : low + high], fields[*before, own : own + low])
        if below is not None:
            fields[*before, :low] = below
        if above is not None:
            fields[*before, low + own :] = above

    def add(self, fields: np.ndarray, layers: int) -> None:
        """Add what ghosts hold to the cells of the neighbours that they stand for: the adjoint of `fill`.

        layers  of ghosts below and above
        """
        before = (slice(None),) * (fields.ndim - 1 - self.axis)
        below, above = self._swapped(fields[*before, :layers], fields[*before, -layers:])
        if below is not None:
            fields[*before, layers : 2 * layers] += below
        if above is not None:
            fields[*before, -2 * layers : -layers] += above

    def _swapped(self, down: np.ndarray, up: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Give layers to the neighbours below and above; returns what these give: as `up`, and as `down`."""
        sent, got = dict[int, np.ndarray](), dict[int, np.ndarray]()
        below, above, size = self.below, self.above, down.size
        if below is not None:
            sent[below], got[below] = np.ascontiguousarray(down).reshape(-1), np.empty(up.size, up.dtype)
        if above is not None and above != below:
            sent[above], got[above] = np.ascontiguousarray(up).reshape(-1), np.empty(size, up.dtype)
        elif above is not None:  # on both sides: first what lies above the receiver, then what lies below it
            sent[above], got[above] = np.concatenate([sent[above], up.ravel()]), np.empty(size + up.size, up.dtype)
        self.communicator.swap(sent, got)
        return (
            None if below is None else got[below][-up.size :].reshape(up.shape),
            None if above is None else got[above][:size].reshape(down.shape),
        )


class Halo:
    """The ghost cells of a grid, or of the part of it that a rank owns.

    cells      nx, ny, nz
    periodic   (3,) whether x, y, z are periodic
    low, high  layers of ghosts below and above the cells in every direction
    borders    with the cells of other ranks
    """

    def __init__(
        self,
        cells: Sequence[int],
        periodic: Sequence[bool] | np.ndarray,
        low: int = LOW,
        high: int = HIGH,
        borders: Sequence[Borders] = (),
    ) -> None:
        self.periodic, self.low, self.high, self.borders = np.array(periodic, bool), low, high, tuple(borders)
        self._cells = np.array([cells], dtype=np.int64)
        self.ends = np.ones((3, 2), bool)
        for border in self.borders:
            self.ends[border.axis] = border.below is None, border.above is None
        self.ends[self.periodic] = False
        self._wraps = self.periodic & ~np.isin(range(3), [border.axis for border in self.borders])
        # A direction that is not periodic has one more face than cells.
        self._faces = self._cells + np.diag(self.ends[:, 1])

    def inner(self, padded: Array) -> Array:
        """View of padded cell fields (..., nz, ny, nx) without their ghosts."""
        nx, ny, nz = self._cells[0] + self.low
        return padded[..., self.low : nz, self.low : ny, self.low : nx]

    def fill(self, fields: Array, extend: bool = True) -> None:
        """Fill the ghosts of a padded cell field (nz, ny, nx), or of several (m, nz, ny, nx).

        extend  whether to fill the ghosts beyond sides that are not periodic, which not every loop reads
        """
        stacked = fields[None] if fields.ndim == 3 else fields
        fill_ghosts(stacked, self.low, self._cells, self._wraps, self.ends & extend)
        self.fill_borders(fields)

    def fill_borders(self, fields: Array) -> None:
        """Fill the ghosts that other ranks own, of fields (..., nz, ny, nx)."""
        for border in self.borders:
            border.fill(fields, self.low, self.high)

    def fill_faces(self, vector: Array) -> None:
        """Fill the ghosts of a face field (3, nz, ny, nx), but those beyond sides that are not periodic, which boundary
        conditions fill; the faces on the sides of the box are not ghosts."""
        fill_ghosts(vector, self.low, self._faces, self._wraps, np.zeros_like(self.ends))
        self.fill_borders(vector)

    def padded(self, values: ArrayLike, outside: float | None = None) -> Array:
        """A padded copy of a cell field (nz, ny, nx), or of several (m, nz, ny, nx), with its ghosts.

        outside  value of ghosts beyond sides that are not periodic; that of the nearest cell if None
        """
        inside = np.asarray(values, dtype=float)
        shape = tuple(n + self.low + self.high for n in inside.shape[-3:])
        array = np.full((*inside.shape[:-3], *shape), 0.0 if outside is None else outside)
        self.inner(array)[:] = inside
        fill_ghosts(array.reshape(-1, *shape), self.low, self._cells, self._wraps, self.ends & (outside is None))
        self.fill_borders(array)
        return array

    def extended(self, plane: np.ndarray, axis: int) -> np.ndarray:
        """Values (..., a, b) over a side normal to `axis`, continued into the ghost rows around it as `fill` would."""
        for at, other in zip((-2, -1), [d for d in (2, 1, 0) if d != axis]):
            layers, n = np.arange(-self.low, plane.shape[at] + self.high), plane.shape[at]
            plane = plane.take(layers % n if self._wraps[other] else layers.clip(0, n - 1), axis=at)
            for border in self.borders:
                if border.axis == other:
                    border.fill(plane, self.low, self.high, plane.ndim + at)
        return plane
