"""The cells of a filter kernel: those that the particles of a rank reach, and cut cells that it takes together.

Ranks divide particles and cells in two ways. The particles of a rank deposit on the cells of its brick and on some
layers around it: its *box*. Where boxes and blocks of cells overlap, what is deposited travels from the one to the
other. Both divisions are known to every rank, so that the table is made without a message, anew after each cut.

In a run of one process the box is the grid.

Particles beside thin walls deposit on cells of their own side, and gather from these. Cells and the layer around them
stand twice in a row: once for particles on the side against the normals of the thin walls, once for the others. A cell
that a thin wall separates from particles of a side has, for them, the nearest cell of their side as its home. Weights
of a particle stay as they are, so that deposits change with its place without jumps.

**Cut cells.** A small one belongs to the nearest that is at least half open. Particles deposit on the large cell of a
group, and what they deposit is divided by the open volume of the group: all cells of a group have one value, in the
part of the cell that is fluid. A gathered field is the mean over a group, by open volumes. The two are adjoint, so that
what particles give to the cells they get from them. The groups are those of the whole box, see
:class:`cfddem.fluid.cell_groups.Groups`: on any number of ranks the same.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from cfddem.backend.errors import RunFailed
from cfddem.coupling.kernel_loops import Axes
from cfddem.fluid.block import THINNEST, Block
from cfddem.fluid.cell_groups import Groups
from cfddem.fluid.cut_cells import CutCells, cut_cells_of_box
from cfddem.fluid.grid import Array, Grid
from cfddem.fluid.halo import Halo
from cfddem.fluid.thin_walls import ASIDE, ThinWall, TwoSided
from cfddem.particles.bricks import Bricks

LAYERS = THINNEST
"""Layers of cells around a brick. A particle may lie half a cell less beyond it: it moves until the next neighbour
list, and is mapped where it was two fluid steps ago, or where it will be after the next one."""

TO_HOME = 3
"""Layers more beside solid and small cells: what is deposited on one goes to the nearest other, seldom farther."""

NEARLY = 1e-6
"""Part of a cell by which a plane between two ranks may miss the border of cells on which it lies."""

Region = tuple[slice, ...]
"""Some cells of fields (m, nz, ny, nx)."""

Overlaps = dict[int, list[Region]]
"""By rank, the regions that it shares."""


class GhostOwners(NamedTuple):
    """Cells that receive what is deposited on the cells and on a layer around them; flat indices.

    A cell receives its own, those of solid cells to which it is the nearest open one, and those of ghosts that take its
    value.
    """

    of_layered: np.ndarray  # (n,) home of each of the cells and of the layer
    order: np.ndarray  # (n,) cells and layer, sorted by home
    begins: np.ndarray  # (cells + 1,) first place of each home in `order`


def _sorted_by_home(homes: np.ndarray, cells: int) -> GhostOwners:
    """The owners of homes (n,) among so many cells."""
    order = np.argsort(homes, kind="stable")
    return GhostOwners(homes, order, np.searchsorted(homes[order], np.arange(cells + 1)))


class GhostDeposit:
    """The cells that the particles of a rank reach.

    grid      cells of the rank
    periodic  whether x, y, z are periodic
    parts     into how many the cells of the fluid are divided along x, y, z
    division  of the particles among the ranks; that of the cells if None

    Attributes: `shape` of the box (nz, ny, nx); `wraps`, whether it begins again at its end along x, y, z.
    """

    def __init__(
        self,
        grid: Grid,
        periodic: Sequence[bool] | np.ndarray,
        parts: Sequence[int] = (1, 1, 1),
        division: Bricks | None = None,
    ) -> None:
        self.grid, self.periodic, self.division = grid, np.array(periodic, bool), division
        counts = np.array(grid.whole.cells)
        self._bare = self._box = np.array([[0, 0, 0], counts])  # cells of the brick, and those of the box, from and to
        self._layers = self._around = np.zeros(3, np.int64)  # that particles reach, and all around the brick
        if isinstance(grid, Block):
            bricks = division or Bricks(grid.division.planes(grid.whole))
            self._layers = LAYERS * np.array(parts) * (np.array(bricks.shape) > 1)
            self._around = self._layers + TO_HOME * (self._layers > 0) * (grid.whole.solid is not None)
            self._share(grid, bricks)
        nx, ny, nz = (self._box[1] - self._box[0]).tolist()
        self.shape, self.wraps = (nz, ny, nx), self.periodic & (self._layers == 0)

    def _share(self, block: Block, bricks: Bricks) -> None:
        """Find the box of this rank, and its overlaps with the cells of others, and those of their boxes with its."""
        whole, rank, counts = block.whole, block.communicator.rank, np.array(block.whole.cells)
        low, high = (bricks.ends - np.array(whole.origin)) / np.array(whole.spacing)
        low, high = np.floor(low + NEARLY), np.ceil(high - NEARLY)
        bare = np.clip([low, np.maximum(low, high)], 0, counts).astype(np.int64)
        boxes = bare + np.array([-self._around, self._around])[:, None]
        boxes = np.where(self.periodic, boxes, np.clip(boxes, 0, counts))
        self._bare, self._box = bare[:, rank], boxes[:, rank]
        ends = [[np.array(begins)[n : len(begins) - 1 + n] for begins in block.division.starts] for n in (0, 1)]
        cells = np.array([np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3) for axes in ends])
        around = [range(-n, n + 1) for n in np.where(self.periodic, -(-self._around // counts), 0).tolist()]
        shifts = [np.array(image) * counts for image in itertools.product(*around)]
        self._communicator = block.communicator
        self._in_box = _overlaps(self._box, cells, shifts)
        self._in_cells = _overlaps(cells[:, rank], boxes, [-shift for shift in shifts])  # in the same order

    def homes(self) -> GhostOwners:
        """Homes of the cells and of the layer around them."""
        return _sorted_by_home(self.home_of_each(), math.prod(self.shape))

    def home_of_each(self, others: Any = None) -> np.ndarray:
        """Cell that receives the deposit on each of the cells and of a layer around them; flat indices.

        others  home of every cell of the whole grid, beside its solid cells (cells,)
        """
        whole, counts = self.grid.whole, self.grid.whole.cells
        lines = []
        for first, last, count, repeats, wraps in zip(*self._box, counts, self.periodic, self.wraps):
            cells = np.arange(first - 1, last + 1)
            if not repeats:
                cells = np.clip(cells, 0, count - 1)
            elif wraps:
                cells %= count
            lines.append(cells)
        homes = np.array(np.meshgrid(*lines[::-1], indexing="ij"))
        if whole.solid is not None:
            nearest_open = distance_transform_edt(whole.solid, sampling=whole.spacing[::-1], return_indices=True)[1]
            homes = self._moved(homes, nearest_open)
        if others is not None:
            homes = self._moved(homes, np.array(np.unravel_index(others, whole.shape)).reshape(3, *whole.shape))
        begin = self._box[0][::-1, None, None, None]
        # outside are homes of cells so deep in the solid that no particle reaches them
        inside = np.clip(homes - begin, 0, np.array(self.shape)[:, None, None, None] - 1)
        return np.ravel_multi_index(tuple(inside), self.shape).ravel()

    def _moved(self, cells: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Cells (3, ...), maybe beyond periodic sides, each moved to another as that of the whole grid is."""
        at = tuple(cells % np.array(self.grid.whole.shape)[:, None, None, None])
        return np.asarray(cells + others[:, *at] - np.array(at))

    def axes(self) -> Axes:
        """These cells along x, y, z."""
        whole, cells = self.grid.whole, np.array(self.shape[::-1], np.int64)
        period = np.array(whole.cells, np.int64) * (self.periodic & ~self.wraps)
        return Axes(np.array(whole.origin), 1.0 / np.array(whole.spacing), cells, self._box[0].copy(), period)

    def refuse_beyond(self, position: Array, radius: Array | None = None) -> None:
        """Raise `RunFailed` for a particle beyond the box.

        position  (N, 3) [m]
        radius    of particles that reach beyond their centres (N,) [m]
        """
        whole, around = self.grid.whole, 0.0 if radius is None else radius
        for axis in np.flatnonzero(self._layers).tolist():
            h, count, place, farthest = whole.spacing[axis], whole.cells[axis], position[:, axis], 0.0
            begin, end = whole.origin[axis] + h * self._bare[:, axis]
            if self.periodic[axis]:
                length = whole.size[axis]
                place = place - length * np.rint((place - 0.5 * (begin + end)) / length)
            if self.periodic[axis] or self._bare[0, axis] > 0:
                farthest = float(np.max(begin - place + around, initial=0.0))  # local: own particles
            if self.periodic[axis] or self._bare[1, axis] < count:
                farthest = max(farthest, float(np.max(place - end + around, initial=0.0)))  # local: own particles
            layers = int(self._layers[axis])
            if not farthest <= (layers - 0.5) * h:
                raise RunFailed(
                    f"a particle reaches {farthest / h:.3g} cells beyond the cells of its rank, must be at most "
                    f"{layers - 0.5}; take larger cells, or a smaller run.fluid_step"
                )

    def collected(self, fields: NDArray[np.int64]) -> NDArray[np.int64]:
        """Fields (m, nz, ny, nx) of the rank's cells: what was deposited on them, also by other ranks.

        fields  int64, in the box of this rank
        """
        if not isinstance(self.grid, Block):
            return fields
        whole = np.zeros((len(fields), *self.grid.shape), np.int64)
        for region, values in self._given(fields, self._in_box, self._in_cells):
            whole[region] += values
        return whole

    def spread(self, fields: Array) -> Array:
        """Fields (m, nz, ny, nx) of the rank's cells, in its box; the adjoint of `collected`."""
        if not isinstance(self.grid, Block):
            return fields
        in_box = np.empty((len(fields), *self.shape))
        for region, values in self._given(fields, self._in_cells, self._in_box):
            in_box[region] = values
        return in_box

    def _given(self, fields: np.ndarray, sent: Overlaps, got: Overlaps) -> Iterator[tuple[Region, np.ndarray]]:
        """Give other ranks what they wait for; returns what they give, region by region."""
        mine, width = self._communicator.rank, len(fields)
        outgoing = {
            rank: np.concatenate([fields[region].reshape(-1) for region in regions]) for rank, regions in sent.items()
        }
        sizes = {
            rank: [[_length(length) for length in region[1:]] for region in regions] for rank, regions in got.items()
        }
        incoming = {
            rank: np.empty(width * sum(map(math.prod, shapes)), fields.dtype)
            for rank, shapes in sizes.items() if rank != mine
        }  # fmt: skip
        self._communicator.swap({rank: values for rank, values in outgoing.items() if rank != mine}, incoming)
        for rank, regions in got.items():
            values, end = incoming[rank] if rank != mine else outgoing[rank], 0
            for region, size in zip(regions, sizes[rank]):
                begin, end = end, end + width * math.prod(size)
                yield region, values[begin:end].reshape(width, *size)


def _overlaps(box: np.ndarray, others: np.ndarray, shifts: Iterable[np.ndarray]) -> Overlaps:
    """Regions of a box that the boxes of ranks overlap, all of which repeat.

    box     its first and last corner (2, 3); cells
    others  those of each rank (2, ranks, 3)
    shifts  where the others lie, too (3,); cells
    """
    overlaps: Overlaps = {}
    for shift in shifts:
        begin = np.maximum(box[0], others[0] + shift) - box[0]
        end = np.minimum(box[1], others[1] + shift) - box[0]
        for rank in np.flatnonzero((begin < end).all(axis=1)).tolist():  # local: three axes
            x, y, z = (slice(*bounds) for bounds in zip(begin[rank].tolist(), end[rank].tolist()))
            overlaps.setdefault(rank, []).append((slice(None), z, y, x))
    return overlaps


def _length(cells: slice) -> int:
    return int(cells.stop - cells.start)


# ---------------------------------------------------------------- particles beside thin walls


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
    cells  whole grid whose open cells take deposits
    reach  of particles
    axes   of the cells that they reach
    """

    def __init__(self, grid: Grid, cells: Grid, reach: GhostDeposit, axes: Axes) -> None:
        self._thin: ThinWall = grid.walls.thin
        spacing = np.array(grid.spacing)
        centres = (
            np.stack([np.ravel(coordinate) for coordinate in np.broadcast_arrays(*grid.centres())], axis=-1)
            + ASIDE * spacing
        )
        away, is_open = self._thin.side(centres), cells.open.ravel()
        near = np.flatnonzero(np.abs(away) < BESIDE * spacing.max())  # local: every rank knows the whole box
        of_side = []
        for sign in (1.0, -1.0):
            mine = ((sign * away > 0.0) & is_open).reshape(grid.shape)
            home = np.arange(away.size)
            if mine.any():  # local: likewise
                nearest = distance_transform_edt(~mine, sampling=grid.spacing[::-1], return_indices=True)[1]
                nearest_cells = np.ravel_multi_index(tuple(nearest), grid.shape).ravel()[near]
                home[near] = np.where(self._thin.between(centres[near], centres[nearest_cells]), nearest_cells, near)
            of_side.append(reach.home_of_each(home))
        super().__init__(_sorted_by_home(np.concatenate(of_side), math.prod(reach.shape)))
        shape = tuple(int(n) + 2 for n in axes.cells[::-1])
        differs: Any = (of_side[0] != of_side[1]).reshape(shape)
        for axis in range(3):  # a particle beside such a cell, which is one of its eight
            differs = differs | np.roll(differs, -1, axis)
        self._beside, self._count = differs.ravel(), differs.size

    def choose(self, position: Array, first: np.ndarray) -> None:
        """See `OneSide.choose`."""
        rows = np.flatnonzero(self._beside[first].any(axis=1))  # local: pieces of a particle
        first[rows[self._thin.side(position[rows]) < 0.0]] += np.uint32(self._count)


def sides_of(grid: Grid, cells: Grid, reach: GhostDeposit, axes: Axes) -> OneSide:
    """The cells of particles on both sides of thin walls, or of all particles where a grid has none.

    grid, cells, reach, axes  as of `TwoSides`
    """
    return TwoSides(grid, cells, reach, axes) if isinstance(grid.walls, TwoSided) else OneSide(reach.homes())


# ---------------------------------------------------------------- cut cells that are taken together


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
