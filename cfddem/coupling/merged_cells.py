"""Cut cells that a kernel takes together: a small one belongs to the nearest that is at least half open.

Particles deposit on the large cell of a group, and what they deposit is divided by the open volume of the group: all
cells of a group have one value, in the part of the cell that is fluid. A gathered field is the mean over a group, by
open volumes. The two are adjoint, so that what particles give to the cells they get from them.

The groups are those of the whole box, see :class:`cfddem.fluid.cell_groups.Groups`: on any number of ranks the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from cfddem.fluid.block import Block
from cfddem.fluid.cell_groups import Groups
from cfddem.fluid.cut_cells import CutCells, cut_cells_of_box
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.halo import Halo


class SingleCells:
    """Of a grid without smooth walls: every cell is its own group. `grid` is the one that particles reach."""

    def __init__(self, grid: Grid) -> None:
        self.grid = grid

    def shared(self, deposits: Array) -> Array:
        """Deposits (m, nz, ny, nx) over the open share of their groups, in all cells of these."""
        return deposits

    def averaged(self, fields: Array) -> Array:
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
        whole, self._groups = grid.whole, Groups(grid, periodic)
        cells = replace(whole, solid=self._groups.small, walls=None)
        super().__init__(Block(cells, grid.division, grid.communicator) if isinstance(grid, Block) else cells)
        self._box: CutCells = cut_cells_of_box(whole, tuple(bool(axis) for axis in periodic))
        at, self._total = self._groups.at, np.ones(grid.shape)
        self._total.reshape(-1)[at] = self._groups.total
        self._open = self._groups.volume.ravel()[at]

    def shared(self, deposits: Array) -> Array:
        """See `SingleCells.shared`."""
        return self._with_group_values(deposits, self._groups.copied) / self._total

    def averaged(self, fields: Array) -> Array:
        """See `SingleCells.averaged`."""
        return self._with_group_values(
            fields, lambda values: self._groups.summed(values * self._open) / self._groups.total
        )

    def copied(self, fields: Array) -> Array:
        """See `SingleCells.copied`."""
        return self._with_group_values(fields, self._groups.copied)

    def _with_group_values(self, fields: Array, of_groups: Callable[[Array], Array]) -> Array:
        """A copy of fields (m, nz, ny, nx) with other values in the cells of groups."""
        taken = np.array(fields, float)
        flat, at = taken.reshape(len(taken), -1), self._groups.at
        flat[:, at] = of_groups(flat[:, at])
        return taken

    def relax(self, before: Array, after: Array) -> None:
        """See `SingleCells.relax`."""
        after[:] = before + (after - before) / self._total

    def gates(self, halo: Halo) -> tuple[Array, Array, Array]:
        """See `SingleCells.gates`; never more than a group is open, so that sweeps stay stable."""
        total, gates = halo.padded(self._total), super().gates(halo)
        grid, apertures = self.grid, self._box.grid.inner(self._box.aperture)
        least = [np.minimum(total, np.roll(total, 1, axis=2 - axis)) for axis in range(3)]
        x, y, z = (
            gate * np.minimum(halo.padded(grid.part(share)), most) for gate, share, most in zip(gates, apertures, least)
        )
        return x, y, z


def merged_cells(grid: Grid, periodic: Any) -> SingleCells:
    """The groups of a grid, or its cells as they are where it has no smooth walls."""
    return MergedCells(grid, periodic) if grid.walls else SingleCells(grid)
