"""Division of a grid among ranks, and the cells that a rank owns.

Cells are divided by planes across x, y and z. The owner of a face is the owner of the cell above it; the last rank
along an axis owns the high side of the box too. A rank computes on its own cells and on ghosts, which neighbours fill
(:class:`cfddem.fluid.halo.Borders`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.communicator import Communicator, Shape, place_of, shapes, with_ghosts
from cfddem.backend.errors import InputError
from cfddem.backend.portions import LARGEST, Parts, Portions
from cfddem.fluid.grid import HIGH, Array, Grid
from cfddem.fluid.halo import Borders

THINNEST = HIGH
"""Layers of cells that a rank owns at least along a divided axis: its neighbours have so many as ghosts."""

ENOUGH = 100_000
"""Particles among which the work of the ranks is compared."""

Starts = Sequence[Sequence[int] | NDArray[np.int64]]
"""First layer of each rank along x, y, z and, at the end of each, the number of layers."""


@dataclass(frozen=True)
class Division:
    """Division of the cells among ranks: planes across x, y and z.

    starts  first layer of each rank along x, y, z and, at the end of each, the number of layers
    """

    starts: tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]

    def __post_init__(self) -> None:
        for starts in self.starts:
            thinnest = min(np.diff(starts))  # local: known to every rank
            if starts[0] != 0 or (thinnest < THINNEST and len(starts) > 2):
                raise InputError("layers of cells of a rank", int(thinnest), f"at least {THINNEST}", "take fewer ranks")

    @property
    def shape(self) -> Shape:
        """Ranks along x, y, z."""
        x, y, z = (len(starts) - 1 for starts in self.starts)
        return x, y, z

    def planes(self, grid: Grid) -> tuple[list[float], list[float], list[float]]:
        """Positions of the borders between ranks along x, y, z [m]."""
        x, y, z = (
            [x0 + h * first for first in starts[1:-1]] for x0, h, starts in zip(grid.origin, grid.spacing, self.starts)
        )
        return x, y, z

    def work(self, grid: Grid, position: Array) -> float:
        """Work of the busiest rank over the mean: its shares of particles and cells, and of the layer around them.

        position  of some of the particles (N, 3) [m]
        """
        wide = [np.diff(starts).astype(float) for starts in self.starts]
        cells = np.einsum("x,y,z->xyz", *wide)
        load = cells / cells.mean()  # local: all ranks
        if len(position):
            at = [
                np.searchsorted(planes, position[:, axis], side="right")
                for axis, planes in enumerate(self.planes(grid))
            ]
            owner = np.ravel_multi_index(at, self.shape)
            particles = np.bincount(owner, minlength=cells.size).reshape(self.shape)  # local: the same on all ranks
            load = 0.5 * (load + particles * (cells.size / len(position)))
        return float((load * with_ghosts(wide, 1.0)).max())  # local: all ranks


def divide(grid: Grid, ranks: int, position: Array | None = None, shape: Shape | None = None) -> Division:
    """Divide a grid so that along each axis ranks own equally many particles, or equally many cells without particles.

    position  of the particles (N, 3) [m]
    shape     ranks along x, y, z; those with the least work of the busiest rank if None
    errors    InputError if the grid has too few layers for so many ranks
    """
    places = np.zeros((0, 3)) if position is None else position[:: max(len(position) // ENOUGH, 1)]
    most = [max(count // THINNEST, 1) for count in grid.cells]
    if shape and math.prod(shape) != ranks:
        raise InputError("--division", "x".join(map(str, shape)), f"{ranks} ranks in all, one for each process")
    options = [shape] if shape else shapes(ranks, most)
    if not options or any(n > limit for n, limit in zip(options[0], most)):
        x, y, z = grid.cells
        fewer = next(n for n in range(min(ranks, math.prod(most)), 0, -1) if shapes(n, most))
        limit = f"at most {most[0]} x {most[1]} x {most[2]} for {x} x {y} x {z} cells"
        if shape:
            raise InputError("--division", "x".join(map(str, shape)), limit, "take fewer ranks along that axis")
        raise InputError("ranks", ranks, limit, f"take {fewer} ranks or more cells")
    divisions = [_cut(grid, ranks, places) for ranks in options]
    # of shapes that take equally long the first: loops run along x, which is divided last but for z
    return min(divisions, key=lambda division: round(division.work(grid, places), 2))  # local: known to every rank


def _cut(grid: Grid, shape: Shape, position: Array) -> Division:
    """The division with so many ranks along x, y, z."""
    of_axes = []
    for axis, (ranks, count) in enumerate(zip(shape, grid.cells)):
        load = np.full(count, 1.0)
        if len(position):
            layer = ((position[:, axis] - grid.origin[axis]) / grid.spacing[axis]).astype(np.int64)
            load = np.bincount(np.clip(layer, 0, count - 1), minlength=count) + 1e-3  # local: all particles
        wanted = np.cumsum(load) / load.sum()  # local: all layers
        starts = [0]
        for rank in range(1, ranks):
            nearest = int(np.argmin(np.abs(wanted - rank / ranks))) + 1  # local: all layers
            starts.append(min(max(nearest, starts[-1] + THINNEST), count - THINNEST * (ranks - rank)))
        of_axes.append((*starts, count))
    return Division((of_axes[0], of_axes[1], of_axes[2]))


def region_of(starts: Starts, place: Sequence[int], more: Sequence[int] = (0, 0, 0)) -> tuple[Any, ...]:
    """Index of the cells of a rank in the last three axes (nz, ny, nx) of an array over the whole grid.

    place  of the rank along x, y, z
    more   layers beyond its cells along x, y, z
    """
    cuts = [slice(int(begins[n]), int(begins[n + 1]) + beyond) for begins, n, beyond in zip(starts, place, more)]
    return (Ellipsis, *cuts[::-1])


def owners(grid: Grid) -> NDArray[np.int64]:
    """The rank that owns every cell of the whole grid (nz, ny, nx); 0 in one process."""
    if not isinstance(grid, Block):
        return np.zeros(grid.shape, np.int64)
    x, y, z = (np.repeat(np.arange(len(begins) - 1), np.diff(begins)) for begins in grid.division.starts)
    ranks: NDArray[np.int64] = np.ravel_multi_index(
        (x[None, None, :], y[None, :, None], z[:, None, None]), grid.division.shape
    )
    return ranks


def put_together(values: np.ndarray, starts: Starts, communicator: Communicator) -> np.ndarray:
    """The array over the whole grid of which every rank has a part (..., nz, ny, nx)."""
    shape = len(starts[0]) - 1, len(starts[1]) - 1, len(starts[2]) - 1
    whole = np.empty((*values.shape[:-3], *(int(begins[-1]) for begins in starts[::-1])), values.dtype)
    parts = [whole[region_of(starts, place_of(rank, shape))] for rank in range(communicator.size)]
    joined = communicator.joined(values.reshape(-1))
    end = 0
    for part in parts:
        begin, end = end, end + part.size
        part[...] = joined[begin:end].reshape(part.shape)
    return whole


def in_portions(grid: Grid, values: np.ndarray, axis: int, faces: bool = False) -> np.ndarray | Portions:
    """The array over the whole grid of which every rank has a part, for files; a copy in one process.

    axis   that of z, which y and x follow
    faces  whether the array has one layer more than cells along each axis
    """
    return _layers(grid, values, axis, faces) if isinstance(grid, Block) else values.copy()


def _layers(block: Block, values: np.ndarray, axis: int, faces: bool) -> Portions:
    """See `in_portions`: some layers along z after the other."""
    communicator, starts, shape = block.communicator, block.division.starts, block.division.shape
    before, beyond = values.shape[:axis], values.shape[axis + 3 :]
    nz, ny, nx = (n + faces for n in block.whole.shape)
    step = max(LARGEST // (ny * nx * math.prod(before + beyond)), 1)
    regions = []
    for rank in range(communicator.size):
        place = place_of(rank, shape)
        regions.append(region_of(starts, place, [int(faces and n + 1 == ranks) for n, ranks in zip(place, shape)])[1:])
    mine = regions[communicator.rank]

    def parts() -> Parts:
        for first in range(0, nz, step):
            last, everything = min(first + step, nz), (slice(None),) * axis

            z = _within(mine[0], first, last)
            own = slice(z.start - mine[0].start, z.stop - mine[0].start), *(slice(r.stop - r.start) for r in mine[1:])
            received = communicator.gathered(values[*everything, *own].reshape(-1))
            slab, end = np.empty((*before, (last - first) * (communicator.rank == 0), ny, nx, *beyond), values.dtype), 0
            for z, y, x in regions if communicator.rank == 0 else []:
                z = _within(z, first, last)
                part = slab[*everything, z.start - first : z.stop - first, y, x]
                begin, end = end, end + part.size
                part[...] = received[begin:end].reshape(part.shape)
            yield (*everything, slice(first, last)), slab

    return Portions((*before, nz, ny, nx, *beyond), values.dtype, parts)


def _within(layers: slice, first: int, last: int) -> slice:
    """Those of the layers that are among some others."""
    return slice(min(max(layers.start, first), last), min(max(layers.stop, first), last))


class Block(Grid):
    """The cells of a grid that one rank owns, as a grid of their own.

    whole         the grid of all ranks
    division      of its cells
    communicator  of the run; its rank is the owner
    """

    def __init__(self, whole: Grid, division: Division, communicator: Communicator) -> None:
        if math.prod(division.shape) != communicator.size:
            raise InputError(
                "ranks", communicator.size, f"{math.prod(division.shape)}, as in the division of the cells"
            )
        place = place_of(communicator.rank, division.shape)
        first = tuple(starts[n] for starts, n in zip(division.starts, place))
        cells: Any = tuple(starts[n + 1] - starts[n] for starts, n in zip(division.starts, place))
        origin: Any = tuple(x0 + n * h for x0, n, h in zip(whole.origin, first, whole.spacing))
        own: Mapping[str, Any] = {
            "_whole": whole, "_first": first, "_place": place, "division": division, "communicator": communicator,
        }  # fmt: skip
        for name, value in own.items():
            object.__setattr__(self, name, value)
        solid = None if whole.solid is None else self.part(whole.solid)
        super().__init__(cells, whole.spacing, origin, solid, whole.walls)

    division: Division
    communicator: Communicator
    _whole: Grid
    _first: tuple[int, int, int]
    _place: tuple[int, int, int]

    @property
    def whole(self) -> Grid:
        """See `Grid.whole`."""
        return self._whole

    @property
    def first(self) -> tuple[int, int, int]:
        """See `Grid.first`."""
        return self._first

    def divided(self, parts: tuple[int, int, int]) -> Block:
        """See `Grid.divided`; the rank owns the same part of the box."""
        x, y, z = (tuple(first * count for first in starts) for starts, count in zip(self.division.starts, parts))
        return Block(self.whole.divided(parts), Division((x, y, z)), self.communicator)

    def touches(self, axis: int, high: bool) -> bool:
        """See `Grid.touches`."""
        return self._place[axis] == (self.division.shape[axis] - 1 if high else 0)

    def borders(self, periodic: Sequence[bool] | NDArray[np.bool_]) -> tuple[Borders, ...]:
        """See `Grid.borders`."""
        borders = []
        for axis, ranks in enumerate(self.division.shape):
            beside: list[int | None] = []
            for step in (self._place[axis] - 1, self._place[axis] + 1):
                place = list(self._place)
                place[axis] = step % ranks
                inside = periodic[axis] or 0 <= step < ranks
                beside.append(int(np.ravel_multi_index(place, self.division.shape)) if inside else None)
            if ranks > 1:
                borders.append(Borders(self.communicator, axis, *beside))
        return tuple(borders)

    def part(self, values: np.ndarray, faces: bool = False) -> np.ndarray:
        """The part of this rank in an array over the whole grid (..., nz, ny, nx).

        faces  whether the array has one layer more than cells along each axis; the part has it too
        """
        own: np.ndarray = values[region_of(self.division.starts, self._place, (faces,) * 3)]
        return own

    def joined(self, values: np.ndarray) -> np.ndarray:
        """The array over the whole grid of which every rank has a part (..., nz, ny, nx); the opposite of `part`."""
        return put_together(values, self.division.starts, self.communicator)
