"""Cells that the particles of a rank reach: its own cells, and ghosts of the cells of its neighbours.

In a run of one process these are the cells of the grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from cfddem.backend.errors import RunFailed
from cfddem.coupling.kernel_loops import Axes
from cfddem.fluid.block import THINNEST
from cfddem.fluid.grid import Array, Grid

LAYERS = THINNEST
"""Layers of ghosts beyond a border. A particle may lie half a cell less beyond its rank's cells: it moves until the
next neighbour list, and is mapped where it was two fluid steps ago, or where it will be after the next one."""


class Homes(NamedTuple):
    """Cells that receive what is deposited on the cells and on a layer around them; flat indices.

    A cell receives its own, those of solid cells to which it is the nearest open one, and those of ghosts that take its
    value.
    """

    of_layered: np.ndarray  # (n,) home of each of the cells and of the layer
    order: np.ndarray  # (n,) cells and layer, sorted by home
    begins: np.ndarray  # (cells + 1,) first place of each home in `order`


class Reach:
    """The cells that the particles of a rank reach.

    grid      cells of the rank
    periodic  whether x, y, z are periodic
    parts     into how many the cells of the fluid are divided along x, y, z

    Attributes: `shape` (nz, ny, nx), ghosts included.
    """

    def __init__(self, grid: Grid, periodic: Sequence[bool] | np.ndarray, parts: Sequence[int] = (1, 1, 1)) -> None:
        self.grid, self.periodic, self.borders = grid, np.array(periodic, bool), grid.borders(periodic)
        self._ghosts = np.zeros(3, np.int64)
        for each in self.borders:
            self._ghosts[each.axis] = LAYERS * parts[each.axis]
        nx, ny, nz = (int(n) for n in np.array(grid.cells) + 2 * self._ghosts)
        self.shape = (nz, ny, nx)

    def homes(self) -> Homes:
        """Homes of the cells and of the layer around them."""
        homes = self._home_of_each()
        layered = np.arange(homes.size).reshape([n + 2 for n in self.shape])
        own = layered[1:-1, 1:-1, 1:-1].ravel()
        order = np.argsort(homes, kind="stable")
        return Homes(homes, order, np.searchsorted(homes[order], np.arange(own.size + 1)))

    def _home_of_each(self) -> np.ndarray:
        """Cell that receives the deposit on each of the cells and of a layer around them; flat indices."""
        whole, counts = self.grid.whole, self.grid.whole.cells
        lines = []
        for first, n, ghosts, count, repeats in zip(
            self.grid.first, self.grid.cells, self._ghosts, counts, self.periodic
        ):
            cells = np.arange(first - ghosts - 1, first + n + ghosts + 1)
            if not repeats:
                cells = np.clip(cells, 0, count - 1)
            elif not ghosts:
                cells %= count
            lines.append(cells)
        homes = np.array(np.meshgrid(*lines[::-1], indexing="ij"))
        if whole.solid is not None:
            nearest_open = distance_transform_edt(whole.solid, sampling=whole.spacing[::-1], return_indices=True)[1]
            at = tuple(homes % np.array(counts[::-1])[:, None, None, None])
            homes += nearest_open[:, *at] - np.array(at)
        begin = (np.array(self.grid.first) - self._ghosts)[::-1, None, None, None]
        # a particle cannot reach a home so deep in the solid that it lies outside
        inside = np.clip(homes - begin, 0, np.array(self.shape)[:, None, None, None] - 1)
        return np.ravel_multi_index(tuple(inside), self.shape).ravel()

    def axes(self) -> Axes:
        """These cells along x, y, z."""
        whole, period = self.grid.whole, np.zeros(3, np.int64)
        for each in self.borders:
            period[each.axis] = whole.cells[each.axis] * self.periodic[each.axis]
        first = np.array(self.grid.first, np.int64) - self._ghosts
        cells = np.array(self.shape[::-1], np.int64)
        return Axes(np.array(whole.origin), 1.0 / np.array(whole.spacing), cells, first, period)

    def refuse_beyond(self, position: Array, radius: Array | None = None) -> None:
        """Raise `RunFailed` for a particle beyond the ghosts.

        position  (N, 3) [m]
        radius    of particles that reach beyond their centres (N,) [m]
        """
        for each in self.borders:
            axis, grid = each.axis, self.grid
            begin, h, place = grid.origin[axis], grid.spacing[axis], position[:, axis]
            end, around = begin + grid.cells[axis] * h, 0.0 if radius is None else radius
            if self.periodic[axis]:
                length = grid.whole.size[axis]
                place = place - length * np.rint((place - 0.5 * (begin + end)) / length)
            below = 0.0 if each.below is None else np.max(begin - place + around, initial=0.0)  # local: own particles
            above = 0.0 if each.above is None else np.max(place - end + around, initial=0.0)  # local: own particles
            farthest = max(float(below), float(above))
            layers = int(self._ghosts[axis])
            if not farthest <= (layers - 0.5) * h:
                raise RunFailed(
                    f"a particle reaches {farthest / h:.3g} cells beyond the cells of its rank, must be at most "
                    f"{layers - 0.5}; take larger cells, or a smaller run.fluid_step"
                )

    def collected(self, fields: NDArray[np.int64]) -> NDArray[np.int64]:
        """Fields (m, nz, ny, nx) of the rank's cells: what was deposited on them, also by other ranks.

        fields  int64, on the cells of this rank and its ghosts; ghosts are added to the cells that they stand for
        """
        for each in self.borders:
            each.add(fields, int(self._ghosts[each.axis]))
        return fields if not self.borders else np.ascontiguousarray(self._inner(fields))

    def spread(self, fields: Array) -> Array:
        """Fields (m, nz, ny, nx) of the rank's cells, with ghosts; the adjoint of `collected`."""
        if not self.borders:
            return fields
        made = np.zeros((len(fields), *self.shape))
        self._inner(made)[:] = fields
        for each in self.borders:
            layers = int(self._ghosts[each.axis])
            each.fill(made, layers, layers)
        return made

    def _inner(self, fields: NDArray[Any]) -> NDArray[Any]:
        """View of fields without ghosts."""
        x, y, z = (slice(int(ghosts), int(ghosts) + n) for ghosts, n in zip(self._ghosts, self.grid.cells))
        return fields[:, z, y, x]
