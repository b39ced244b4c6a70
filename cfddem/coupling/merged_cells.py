"""Cut cells that a kernel takes together: a small one belongs to the nearest that is at least half open.

Particles deposit on the large cell of a group, and what they deposit is divided by the open volume of the group: all
cells of a group have one value, in the part of the cell that is fluid. A gathered field is the mean over a group, by
open volumes. The two are adjoint, so that what particles give to the cells they get from them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.fluid.cell_groups import large_cells
from cfddem.fluid.cut_cells import cut_cells_of_box
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.halo import Halo


class SingleCells:
    """Of a grid without smooth walls: every cell is its own group. `grid` is the one that particles reach."""

    def __init__(self, grid: Grid) -> None:
        self.grid = grid

    def shared(self, deposits: Array) -> Array:
        """Deposits (m, nz, ny, nx) over the open share of their groups, in all cells of these."""
        return deposits

    def mean(self, fields: Array) -> Array:
        """Mean of fields (m, nz, ny, nx) over the groups, in all cells of these."""
        return fields

    def copied(self, fields: Array) -> Array:
        """Fields (m, nz, ny, nx) with the value of the large cell in all cells of a group."""
        return fields

    def relax(self, before: Array, after: Array) -> None:
        """Divide what a sweep has changed by the open share of the groups, in place."""

    def gates(self, halo: Halo) -> tuple[Array, Array, Array]:
        """What may pass through the low face of every cell in a sweep, for x, y, z; padded: 0 at walls and solid
        cells. The low face of the first layer of ghosts is not used."""
        fluid = halo.padded(self.grid.open, outside=0.0)
        gates = [fluid * np.roll(fluid, 1, axis=2 - axis) for axis in range(3)]
        return gates[0], gates[1], gates[2]


class MergedCells(SingleCells):
    """The groups of a grid with smooth walls."""

    def __init__(self, grid: Grid, periodic: Any) -> None:
        if grid.whole is not grid:
            raise InputError("ranks", None, "1 for particles within smooth walls", "take one process, or solid cells")
        self._cut = cut_cells_of_box(grid, tuple(bool(axis) for axis in periodic))
        open_share = self._cut.own_volume() * grid.open
        small, self._home = large_cells(grid, open_share)
        super().__init__(replace(grid, solid=small, walls=None))
        total = np.bincount(self._home, weights=open_share.ravel(), minlength=self._home.size)
        self._open, self._total = open_share.ravel(), total[self._home]

    def shared(self, deposits: Array) -> Array:
        """See `SingleCells.shared`."""
        flat = deposits.reshape(len(deposits), -1)
        return np.asarray((flat[:, self._home] / self._total).reshape(deposits.shape))

    def mean(self, fields: Array) -> Array:
        """See `SingleCells.mean`."""
        flat = fields.reshape(len(fields), -1) * self._open
        sums = np.stack([np.bincount(self._home, weights=values, minlength=values.size) for values in flat])
        return np.asarray((sums[:, self._home] / self._total).reshape(fields.shape))

    def copied(self, fields: Array) -> Array:
        """See `SingleCells.copied`."""
        return np.asarray(fields.reshape(len(fields), -1)[:, self._home].reshape(fields.shape))

    def relax(self, before: Array, after: Array) -> None:
        """See `SingleCells.relax`."""
        after[:] = before + (after - before) / self._total.reshape(after.shape[1:])

    def gates(self, halo: Halo) -> tuple[Array, Array, Array]:
        """See `SingleCells.gates`; never more than a group is open, so that sweeps stay stable."""
        total, whole = halo.padded(self._total.reshape(self.grid.shape)), super().gates(halo)
        gates = []
        for axis in range(3):
            apertures = halo.padded(self.grid.inner(self._cut.aperture[axis]))
            least = np.minimum(total, np.roll(total, 1, axis=2 - axis))
            gates.append(whole[axis] * np.minimum(apertures, least))
        return gates[0], gates[1], gates[2]


def merged_cells(grid: Grid, periodic: Any) -> SingleCells:
    """The groups of a grid, or its cells as they are where it has no smooth walls."""
    return MergedCells(grid, periodic) if grid.walls else SingleCells(grid)
