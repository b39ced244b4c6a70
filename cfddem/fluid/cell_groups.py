"""Groups of cut cells: a small one belongs to the nearest that is at least half open.

A scalar has one value in all cells of a group, and the balance of a group is that of its open volume. So a cell of any
size takes part without limiting the step, and nothing is lost between cells. No cell with fluid belongs to a group
behind a thin wall; a solid cell may, whose faces are closed.

Groups are those of the whole box, which every rank finds before the run starts. Where a group has cells of several
ranks, that of its large cell adds them, in the order of one process, and gives the sum back.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, distance_transform_edt

from cfddem.backend.compile import serial
from cfddem.backend.errors import InputError
from cfddem.fluid.block import owners
from cfddem.fluid.cut_cells import CutCells, cut_cells_of_box
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

    A small cell without a large one on its side of the thin walls has a group of its own, and so has a solid cell that
    is farther than `BEYOND` layers from the fluid.

    grid        whole
    open_share  of every cell, 0 in solid cells (nz, ny, nx)
    """
    small = open_share < LEAST
    if small.all():
        raise InputError("walls", None, "such that some cells are at least half open", "take smaller cells")
    nearest = distance_transform_edt(small, sampling=grid.spacing[::-1], return_indices=True)[1]
    beside = binary_dilation(open_share > 0.0, iterations=BEYOND).ravel()
    home = np.where(beside, np.ravel_multi_index(tuple(nearest), grid.shape).ravel(), np.arange(small.size))
    if isinstance(grid.walls, TwoSided):
        home = _on_one_side(grid, small, np.flatnonzero(small & (open_share > 0.0)), home)
        small = small & ((open_share == 0.0) | (home != np.arange(home.size)).reshape(small.shape))
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


Columns = dict[int, NDArray[np.int64]]
"""By rank, columns of an array."""


class Groups:
    """The cells of a grid, or of the block of a rank, that are not one whole cell by themselves.

    at      flat indices of these cells (n,)
    total   open volume of the group of each, over that of a cell (n,)
    volume  share of every cell of the grid that is open (nz, ny, nx)
    small   whether each cell of the whole grid is too small for a group of its own (nz, ny, nx)
    """

    def __init__(self, grid: Grid, periodic: Any) -> None:
        whole = grid.whole
        share = cut_cells_of_box(whole, tuple(bool(axis) for axis in periodic)).own_volume() * whole.open
        self.small, home = large_cells(whole, share)
        self.volume, self._communicator = grid.part(share), grid.communicator
        total = np.bincount(home, weights=share.ravel(), minlength=home.size)[home]
        single = (np.bincount(home, minlength=home.size)[home] == 1) & ((total == 1.0) | (total == 0.0))
        grouped, owner, rank = np.flatnonzero(~single), owners(grid).ravel(), grid.communicator.rank
        own, members = grouped[owner[grouped] == rank], grouped[owner[home[grouped]] == rank]
        number = grid.part(np.arange(home.size).reshape(whole.shape)).ravel()
        self.at, self.total = np.searchsorted(number, own), total[own]
        large, self._group = np.unique(home[members], return_inverse=True)
        self._large, of_own, of_members = np.searchsorted(own, large), owner[home[own]], owner[members]
        # own cells by the rank of their large cell, and all cells of groups whose large cell is here by their rank
        self._sent = {other: np.flatnonzero(of_own == other) for other in np.unique(of_own).tolist()}
        self._received = {other: np.flatnonzero(of_members == other) for other in np.unique(of_members).tolist()}

    def put_means(self, fields: Array, shares: Array, at: NDArray[np.int64] | None = None) -> None:
        """Make fields (m, cells), contiguous, their sums over groups over `total`, in all cells of these.

        shares  weights of the cells `at` in the sums (n,)
        at      where the fields have these cells; as the grid if None
        """
        at, count = self.at if at is None else at, len(self._large)
        if self._communicator.size == 1:
            put_group_means(at, self._group, count, shares, self.total, fields)
            return
        members = self._exchanged(fields.take(at, axis=1) * shares, self._sent, self._received, len(self._group))
        sums = [np.bincount(self._group, weights=field, minlength=count) for field in members]
        self._put(fields, self._to_members(np.array(sums)) / self.total, at)

    def put_copies(self, fields: Array, divisor: Array, at: NDArray[np.int64] | None = None) -> None:
        """Give all cells of groups the value of their large cell in fields (m, cells), contiguous, over a divisor (n,).

        at  as in `put_means`
        """
        at = self.at if at is None else at
        if self._communicator.size == 1:
            put_group_copies(at, at[self._large][self._group], divisor, fields)
            return
        self._put(fields, self._to_members(fields.take(at, axis=1)[:, self._large]) / divisor, at)

    @staticmethod
    def _put(fields: Array, values: Array, at: NDArray[np.int64]) -> None:
        """Write values (m, n) into the cells `at` of fields (m, cells)."""
        for field, value in zip(fields, values):
            field[at] = value

    def _to_members(self, of_groups: Array) -> Array:
        """Values of groups whose large cell is here (m, groups), in the cells `at` of all ranks."""
        return self._exchanged(of_groups[:, self._group], self._received, self._sent, len(self.at))

    def _exchanged(self, values: Array, outgoing: Columns, wanted: Columns, count: int) -> Array:
        """Values (m, count) of which each rank has given some columns of its own, in the places that are wanted."""
        if self._communicator.size == 1:
            return values
        result, rank = np.empty((len(values), count)), self._communicator.rank
        sent = {other: values.take(columns, axis=1) for other, columns in outgoing.items()}
        if rank in sent:
            result[:, wanted[rank]] = sent.pop(rank)
        got = {other: np.empty((len(values), len(columns))) for other, columns in wanted.items() if other != rank}
        self._communicator.swap(sent, got)
        for other, received in got.items():
            result[:, wanted[other]] = received
        return result


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
    """The groups of a fluid with smooth walls."""

    def __init__(self, fluid: FluidSolver) -> None:
        grid, cut = fluid.grid, fluid.boundaries.cut
        assert isinstance(cut, CutCells)
        super().__init__(fluid)
        self._groups = Groups(grid, fluid.boundaries.periodic)
        self.volume = self._groups.volume
        self._at = grid.inner(np.arange(cut.volume.size).reshape(grid.padded_shape)).ravel()[self._groups.at]
        self._whole = np.ones(len(self._at))
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
        at, total = self._groups.at, self._groups.total
        self._groups.put_means(sums.reshape(1, -1), self._whole)
        of_groups = sums.ravel()[at]
        spread = self.spread.reshape(-1)
        spread[at] = np.maximum(spread[at], np.where(total == 1.0, 0.0, of_groups))

    def shut(self, flux: Array) -> None:
        """See `SingleCells.shut`."""
        for component, (at, share) in zip(flux, self._cut_faces):
            shut(at, share, component.reshape(-1))

    def gather(self, sums: Array) -> None:
        """See `SingleCells.gather`."""
        self._groups.put_means(sums.reshape(1, -1), self._whole, self._at)

    def copy(self, values: Array) -> None:
        """See `SingleCells.copy`."""
        self._groups.put_copies(values.reshape(1, -1), self._whole, self._at)

    def averaged(self, cells: Array) -> Array:
        """See `SingleCells.averaged`."""
        mean = np.array(cells, float, order="C")
        self._groups.put_means(mean.reshape(1, -1), self.volume.ravel()[self._groups.at])
        return mean


def cell_groups(fluid: FluidSolver) -> SingleCells:
    """The groups of the cells of a fluid."""
    return CutGroups(fluid) if fluid.grid.walls else SingleCells(fluid)


# ---------------------------------------------------------------- loops over the cells of groups


@serial
def put_group_means(at, group, count, shares, total, fields):
    """Make fields (m, cells) their means over groups, in all cells of these.

    at      cells of groups (n,), the group of each, and the number of groups
    shares  weights of these cells, whose sum over the group of each is `total` (n,)
    """
    sums = np.empty(count)
    for m in range(fields.shape[0]):
        sums[:] = 0.0
        for i in range(at.size):
            sums[group[i]] += fields[m, at[i]] * shares[i]
        for i in range(at.size):
            fields[m, at[i]] = sums[group[i]] / total[i]


@serial
def put_group_copies(at, large, divisor, fields):
    """Give all cells of groups the value of their large cell in fields (m, cells), over a divisor.

    at, large  cells of groups, and the large cell of each (n,)
    """
    values = np.empty(at.size)
    for m in range(fields.shape[0]):
        for i in range(at.size):
            values[i] = fields[m, large[i]] / divisor[i]
        for i in range(at.size):
            fields[m, at[i]] = values[i]
