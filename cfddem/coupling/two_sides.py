"""Particles beside thin walls: they deposit on cells of their own side, and gather from these.

Cells and the layer around them stand twice in a row: once for particles on the side against the normals of the thin
walls, once for the others. A cell that a thin wall separates from particles of a side has, for them, the nearest cell
of their side as its home. Weights of a particle stay as they are, so that deposits change with its place without jumps.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt

from cfddem.coupling.ghost_deposit import GhostOwners
from cfddem.coupling.kernel_loops import Axes
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.thin_walls import ASIDE, ThinWall, TwoSided

BESIDE = 3.0
"""Cells from a thin wall within which cells may have other homes [-]."""


class OneSide:
    """Of a grid without thin walls: all particles have the same cells.

    homes  of the cells and of the layer around them
    """

    def __init__(self, homes: GhostOwners) -> None:
        self.homes = homes

    def choose(self, position: Array, first: np.ndarray) -> None:
        """Move the first cells (N, pieces) of particles at positions (N, 3) [m] to those of their side, in place."""


class TwoSides(OneSide):
    """Of a grid with thin walls.

    grid   of the fluid, whole
    cells  grid whose open cells take deposits
    homes  without thin walls
    axes   of the cells
    """

    def __init__(self, grid: Grid, cells: Grid, homes: GhostOwners, axes: Axes) -> None:
        self._thin: ThinWall = grid.walls.thin
        spacing = np.array(grid.spacing)
        centres = (
            np.stack([np.ravel(coordinate) for coordinate in np.broadcast_arrays(*grid.centres())], axis=-1)
            + ASIDE * spacing
        )
        away, is_open = self._thin.side(centres), cells.open.ravel()
        near = np.flatnonzero(np.abs(away) < BESIDE * spacing.max())
        of_side = []
        for sign in (1.0, -1.0):
            mine = ((sign * away > 0.0) & is_open).reshape(grid.shape)
            home = np.arange(away.size)
            if mine.any():
                nearest = distance_transform_edt(~mine, sampling=grid.spacing[::-1], return_indices=True)[1]
                nearest_cells = np.ravel_multi_index(tuple(nearest), grid.shape).ravel()[near]
                home[near] = np.where(self._thin.between(centres[near], centres[nearest_cells]), nearest_cells, near)
            of_side.append(home[homes.of_layered])
        both = np.concatenate(of_side)
        order = np.argsort(both, kind="stable")
        super().__init__(GhostOwners(both, order, np.searchsorted(both[order], np.arange(away.size + 1))))
        shape = tuple(int(n) + 2 for n in axes.cells[::-1])
        differs: Any = (of_side[0] != of_side[1]).reshape(shape)
        for axis in range(3):  # a particle beside such a cell, which is one of its eight
            differs = differs | np.roll(differs, -1, axis)
        self._beside, self._count = differs.ravel(), differs.size

    def choose(self, position: Array, first: np.ndarray) -> None:
        """See `OneSide.choose`."""
        rows = np.flatnonzero(self._beside[first].any(axis=1))
        first[rows[self._thin.side(position[rows]) < 0.0]] += np.uint32(self._count)


def sides_of(grid: Grid, cells: Grid, homes: GhostOwners, axes: Axes) -> OneSide:
    """The cells of particles on both sides of thin walls, or of all particles where a grid has none."""
    return TwoSides(grid, cells, homes, axes) if isinstance(grid.walls, TwoSided) else OneSide(homes)
