"""Groups of cut cells: a small one belongs to the nearest that is at least half open.

A scalar has one value in all cells of a group, and the balance of a group is that of its open volume. So a cell of any
size takes part without limiting the step, and nothing is lost between cells. No group reaches through a thin wall.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, distance_transform_edt

from cfddem.backend.compile import serial
from cfddem.backend.errors import InputError
from cfddem.fluid.cut_cells import CutCells
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.near_walls_loops import shut
from cfddem.fluid.solver import FluidSolver
from cfddem.fluid.thin_walls import ASIDE, TwoSided

LEAST = 0.5
"""Share of a cell that must be open for a group of its own [-]."""

BEYOND = 2
"""Layers of solid cells beside the fluid that take the value of the nearest group: fluxes look so far."""

REACH = 3
"""Layers of cells among which a cell beside a thin wall finds a large one on its side."""


def large_cells(grid: Grid, open_share: Any) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Which cells are too small for a group of their own (nz, ny, nx), and the large cell of every one, flat.

    A small cell without a large one on its side of the thin walls has a group of its own.

    open_share  of every cell, 0 in solid cells (nz, ny, nx)
    """
    small = open_share < LEAST
    if small.all():
        raise InputError("walls", None, "such that some cells are at least half open", "take smaller cells")
    nearest = distance_transform_edt(small, sampling=grid.spacing[::-1], return_indices=True)[1]
    home = np.ravel_multi_index(tuple(nearest), grid.shape).ravel()
    if isinstance(grid.walls, TwoSided):
        home = _on_one_side(grid, small, np.flatnonzero(small & (open_share > 0.0)), home)
        small = small & (home != np.arange(home.size)).reshape(small.shape)
    return small, home


def _on_one_side(
    grid: Grid, small: NDArray[np.bool_], cells: NDArray[np.int64], home: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The homes of all cells, where those of some small cells have no thin wall before them, or are these cells."""
    centres = [np.ravel(coordinate) for coordinate in np.broadcast_arrays(*grid.centres())]
    places = np.stack(centres, axis=-1) + ASIDE * np.array(grid.spacing)
    across = cells[grid.walls.thin.between(places[cells], places[home[cells]])]
    steps = np.indices((2 * REACH + 1,) * 3).reshape(3, -1).T - REACH
    away = np.linalg.norm(steps * grid.spacing[::-1], axis=1)
    steps = steps[np.argsort(away, kind="stable")]
    there = np.stack(np.unravel_index(across, grid.shape), axis=-1)[:, None] + steps
    inside = ((there >= 0) & (there < grid.shape)).all(axis=2)
    others = np.ravel_multi_index(tuple(np.moveaxis(there, 2, 0)), grid.shape, mode="clip")
    rows, columns = np.nonzero(inside & ~small.ravel()[others])
    reached = np.zeros(others.shape, bool)
    reached[rows, columns] = ~grid.walls.thin.between(places[across[rows]], places[others[rows, columns]])
    nearest = others[np.arange(len(across)), reached.argmax(axis=1)]
    home = home.copy()
    home[across] = np.where(reached.any(axis=1), nearest, across)
    return home


class SingleCells:
    """Of a fluid without smooth walls: every cell is its own group.

    volume   share of every cell that holds fluid (nz, ny, nx)
    spread   rate at which a diffusivity of 1 m2/s can change the value of a cell (nz, ny, nx) [1/m2]
    """

    def __init__(self, fluid: FluidSolver) -> None:
        self.volume = fluid.open_cells
        self.spread = np.full(fluid.grid.shape, 4.0 * float(np.sum(fluid.inverse_spacing**2)))

    def shut(self, flux: Array) -> None:
        """Take the open parts of faces from a flux through all of them (3, ...)."""

    def gather(self, sums: Array) -> None:
        """Make sums over cells (padded) those over groups, per open volume, in all cells of these."""

    def copy(self, values: Array) -> None:
        """Give the values of large cells (padded) to all cells of their groups."""

    def averaged(self, cells: Array) -> Array:
        """Mean over groups by open volume, in all cells of these (nz, ny, nx)."""
        return cells


class CutGroups(SingleCells):
    """The groups of a fluid with smooth walls.

    total  open volume of the group of every cell, over that of a cell (nz, ny, nx)
    """

    def __init__(self, fluid: FluidSolver) -> None:
        grid, cut = fluid.grid, fluid.boundaries.cut
        assert isinstance(cut, CutCells)
        if grid.whole is not grid:
            remedy = "take one process, or solid cells"
            raise InputError("ranks", None, "1 for a temperature or a vapour within smooth walls", remedy)
        super().__init__(fluid)
        self.volume = np.asarray(cut.own_volume() * fluid.open_cells)
        small, home = large_cells(grid, self.volume)
        total = np.bincount(home, weights=self.volume.ravel(), minlength=home.size)
        beside = binary_dilation(grid.open, iterations=BEYOND) & small
        flat = grid.inner(np.arange(cut.volume.size).reshape(grid.padded_shape)).ravel()
        self._small = flat[beside.ravel()]
        self._home = flat[home[beside.ravel()]]
        merged = ~small.ravel() & (total != 1.0)
        self._merged, self._inverse = flat[merged], 1.0 / total[merged]
        self._all, self.total = home, total[home].reshape(grid.shape)
        faces = [np.flatnonzero(cut.aperture[d] < 1.0) for d in range(3)]
        self._cut_faces = [(at, cut.aperture[d].ravel()[at]) for d, at in enumerate(faces)]
        self._allow_for(cut, fluid.inverse_spacing)

    def _allow_for(self, cut: CutCells, inverse: Array) -> None:
        """Let `spread` of groups count the open parts of all their faces, twice: gradients there are corrected."""
        sums = np.zeros(cut.grid.shape)
        for d in range(3):
            faces = cut.grid.inner_faces(cut.aperture[d], d) * (4.0 * inverse[d] ** 2)
            low, high = [slice(None)] * 3, [slice(None)] * 3
            low[2 - d], high[2 - d] = slice(None, -1), slice(1, None)
            sums += faces[tuple(low)] + faces[tuple(high)]
        of_groups = np.bincount(self._all, weights=sums.ravel(), minlength=sums.size)[self._all].reshape(sums.shape)
        self.spread = np.maximum(self.spread, np.where(self.total == 1.0, 0.0, of_groups / self.total))

    def shut(self, flux: Array) -> None:
        """See `SingleCells.shut`."""
        for component, (at, share) in zip(flux, self._cut_faces):
            shut(at, share, component)

    def gather(self, sums: Array) -> None:
        """See `SingleCells.gather`."""
        gather(self._small, self._home, self._merged, self._inverse, sums)

    def copy(self, values: Array) -> None:
        """See `SingleCells.copy`."""
        values.reshape(-1)[self._small] = values.reshape(-1)[self._home]

    def averaged(self, cells: Array) -> Array:
        """See `SingleCells.averaged`."""
        sums = np.bincount(self._all, weights=(self.volume * cells).ravel(), minlength=cells.size)[self._all]
        return np.asarray(sums.reshape(cells.shape) / self.total)


def cell_groups(fluid: FluidSolver) -> SingleCells:
    """The groups of the cells of a fluid."""
    return CutGroups(fluid) if fluid.grid.walls else SingleCells(fluid)


@serial
def gather(small, home, merged, inverse, sums):
    """Add the sums of small cells to those of their large ones, over the open volume, and copy these back.

    small, home      flat indices of small cells and of their large ones
    merged, inverse  large cells of groups that are not one whole cell, and one over their open volume
    sums             padded
    """
    sums = sums.reshape(-1)
    for n in range(len(small)):
        sums[home[n]] += sums[small[n]]
    for n in range(len(merged)):
        sums[merged[n]] *= inverse[n]
    for n in range(len(small)):
        sums[small[n]] = sums[home[n]]
