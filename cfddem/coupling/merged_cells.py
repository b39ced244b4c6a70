"""Cut cells that a kernel takes together: a small one belongs to the nearest that is at least half open.

Particles deposit on the large cell of a group, and what they deposit is divided by the open volume of the group: all
cells of a group have one value, in the part of the cell that is fluid. A gathered field is the mean over a group, by
open volumes. The two are adjoint, so that what particles give to the cells they get from them.

The groups are those of the whole box, see :class:`cfddem.fluid.cell_groups.Groups`: on any number of ranks the same.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cfddem.fluid.block import Block
from cfddem.fluid.cell_groups import Groups
from cfddem.fluid.cut_cells import CutCells, cut_cells_of_box
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.halo import Halo


class SingleCells:
    """Of a grid without smooth walls: every cell is its own group.

    grid    that particles reach
    shares  open volume of the group of every cell over that of a cell (nz, ny, nx); (0, 0, 0) if each is a group
    """

    def __init__(self, grid: Grid) -> None:
        self.grid, self.shares = grid, np.empty((0, 0, 0))

    def share(self, deposits: Array) -> Array:
        """Deposits (m, nz, ny, nx), made deposits over the open share of their groups, in all cells of these."""
        return deposits

    def equalise(self, fields: Array) -> Array:
        """Means of fields (m, nz, ny, nx) over the groups, in all cells of these, as other fields."""
        return fields

    def copy(self, fields: Array) -> Array:
        """Fields (m, nz, ny, nx), given the value of the large cell in all cells of a group."""
        return fields

    def gates(self, halo: Halo) -> tuple[Array, Array, Array]:
        """What may pass through the low face of every cell in a sweep, for x, y, z; padded: 0 at walls and solid
        cells. The low face of the first layer of ghosts is not used."""
        fluid = halo.padded(self.grid.open, outside=0.0)
        gates = [fluid * np.roll(fluid, 1, axis=2 - axis) for axis in range(3)]
        return gates[0], gates[1], gates[2]


class MergedCells(SingleCells):
    """The groups of a grid with smooth walls."""

    def __init__(self, grid: Grid, periodic: Any) -> None:
        whole, self._groups = grid.whole, Groups(grid, periodic)
        cells = replace(whole, solid=self._groups.small, walls=None)
        super().__init__(Block(cells, grid.division, grid.communicator) if isinstance(grid, Block) else cells)
        self._box: CutCells = cut_cells_of_box(whole, tuple(bool(axis) for axis in periodic))
        at, total = self._groups.at, self._groups.total
        self._open, self._one, self.shares = self._groups.volume.ravel()[at], np.ones(len(at)), np.ones(grid.shape)
        self.shares.reshape(-1)[at] = total

    def share(self, deposits: Array) -> Array:
        """See `SingleCells.share`."""
        self._groups.put_copies(_flat(deposits), self._groups.total)
        return deposits

    def equalise(self, fields: Array) -> Array:
        """See `SingleCells.equalise`."""
        means = np.array(fields, float, order="C")
        self._groups.put_means(_flat(means), self._open)
        return means

    def copy(self, fields: Array) -> Array:
        """See `SingleCells.copy`."""
        self._groups.put_copies(_flat(fields), self._one)
        return fields

    def gates(self, halo: Halo) -> tuple[Array, Array, Array]:
        """See `SingleCells.gates`; never more than a group is open, so that sweeps stay stable."""
        total, gates = halo.padded(self.shares), super().gates(halo)
        grid, apertures = self.grid, self._box.grid.inner(self._box.aperture)
        least = [np.minimum(total, np.roll(total, 1, axis=2 - axis)) for axis in range(3)]
        x, y, z = (
            gate * np.minimum(halo.padded(grid.part(share)), most) for gate, share, most in zip(gates, apertures, least)
        )
        return x, y, z


def _flat(fields: Array) -> Array:
    """A view of fields (m, nz, ny, nx), contiguous, as (m, cells)."""
    return fields.reshape(len(fields), -1)


def merged_cells(grid: Grid, periodic: Any) -> SingleCells:
    """The groups of a grid, or its cells as they are where it has no smooth walls."""
    return MergedCells(grid, periodic) if grid.walls else SingleCells(grid)
