"""Division of a grid among ranks, and the cells that a rank owns.

Cells are divided into slabs across one axis. The owner of a face is the owner of the cell above it; the last slab owns
the high side of the box too. A rank computes on its own cells and on ghosts, which neighbours fill
(:class:`cfddem.fluid.halo.Borders`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError
from cfddem.fluid.grid import HIGH, Array, Grid, layers
from cfddem.fluid.halo import Borders

THINNEST = HIGH
"""Layers of cells that a rank owns at least: its neighbours have so many as ghosts."""


@dataclass(frozen=True)
class Division:
    """Division of the cells among ranks: rank n owns the layers starts[n] to starts[n + 1] - 1 along an axis.

    axis    0, 1, 2 for x, y, z
    starts  first layer of each rank and, at the end, the number of layers
    """

    axis: int
    starts: tuple[int, ...]

    def __post_init__(self) -> None:
        thinnest = min(np.diff(self.starts))  # local: known to every rank
        if self.starts[0] != 0 or (thinnest < THINNEST and len(self.starts) > 2):
            raise InputError("layers of cells of a rank", int(thinnest), f"at least {THINNEST}", "take fewer ranks")

    def planes(self, grid: Grid) -> list[float]:
        """Positions of the borders between ranks along the axis [m]."""
        return [grid.origin[self.axis] + grid.spacing[self.axis] * first for first in self.starts[1:-1]]


def divide(grid: Grid, ranks: int, position: Array | None = None) -> Division:
    """Divide a grid so that ranks own equally many particles, or equally many cells without particles.

    The bed is cut along the longer horizontal axis if it has enough layers, else along the axis with most layers; along
    y rather than x if both are as long, because loops run along x.

    position  of the particles (N, 3) [m]
    errors    InputError if the grid has too few layers for so many ranks
    """
    x, y, z = grid.cells
    axis = 0 if x > y else 1
    if max(x, y) < THINNEST * ranks and z > max(x, y):
        axis = 2
    count = grid.cells[axis]
    if count < THINNEST * ranks:
        most = max(count // THINNEST, 1)
        raise InputError("ranks", ranks, f"at most {most} for {x} x {y} x {z} cells", "take fewer ranks or more cells")
    load = np.full(count, 1.0)
    if position is not None and len(position):
        layer = ((position[:, axis] - grid.origin[axis]) / grid.spacing[axis]).astype(np.int64)
        load = np.bincount(np.clip(layer, 0, count - 1), minlength=count) + 1e-3  # local: all particles
    wanted = np.cumsum(load) / load.sum()  # local: all layers
    starts = [0]
    for rank in range(1, ranks):
        nearest = int(np.argmin(np.abs(wanted - rank / ranks))) + 1  # local: all layers
        starts.append(min(max(nearest, starts[-1] + THINNEST), count - THINNEST * (ranks - rank)))
    return Division(axis, (*starts, count))


class Block(Grid):
    """The cells of a grid that one rank owns, as a grid of their own.

    whole         the grid of all ranks
    division      of its cells
    communicator  of the run; its rank is the owner
    """

    def __init__(self, whole: Grid, division: Division, communicator: Communicator) -> None:
        if len(division.starts) != communicator.size + 1:
            raise InputError("ranks", communicator.size, f"{len(division.starts) - 1}, as in the division of the cells")
        axis, rank = division.axis, communicator.rank
        first, cells, origin = [0, 0, 0], list(whole.cells), list(whole.origin)
        first[axis] = division.starts[rank]
        cells[axis] = division.starts[rank + 1] - first[axis]
        origin[axis] += first[axis] * whole.spacing[axis]
        known: Mapping[str, Any] = {
            "_whole": whole, "_first": tuple(first), "division": division, "communicator": communicator,
        }  # fmt: skip
        for name, value in known.items():
            object.__setattr__(self, name, value)
        solid = None if whole.solid is None else self.part(whole.solid)
        super().__init__(tuple(cells), whole.spacing, tuple(origin), solid, whole.walls)  # type: ignore[arg-type]

    division: Division
    communicator: Communicator
    _whole: Grid
    _first: tuple[int, int, int]

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
        starts = tuple(first * parts[self.division.axis] for first in self.division.starts)
        return Block(self.whole.divided(parts), Division(self.division.axis, starts), self.communicator)

    def touches(self, axis: int, high: bool) -> bool:
        """See `Grid.touches`."""
        if axis != self.division.axis:
            return True
        return self.communicator.rank == (self.communicator.size - 1 if high else 0)

    def borders(self, periodic: Sequence[bool] | NDArray[np.bool_]) -> tuple[Borders, ...]:
        """See `Grid.borders`."""
        axis, rank, ranks = self.division.axis, self.communicator.rank, self.communicator.size
        if ranks == 1:
            return ()
        below, above = (step % ranks if periodic[axis] or 0 <= step < ranks else None for step in (rank - 1, rank + 1))
        return (Borders(self.communicator, axis, below, above),)

    def part(self, values: np.ndarray, faces: bool = False) -> np.ndarray:
        """The part of this rank in an array over the whole grid (..., nz, ny, nx).

        faces  whether the array has one layer more than cells; the part has it too
        """
        starts, rank = self.division.starts, self.communicator.rank
        return values[layers(self.division.axis, slice(starts[rank], starts[rank + 1] + faces))]

    def joined(self, values: np.ndarray, faces: bool = False) -> np.ndarray:
        """The array over the whole grid of which every rank has a part (..., nz, ny, nx); the opposite of `part`."""
        own = values[layers(self.division.axis, slice(None, -1))] if faces and not self._is_last else values
        at = values.ndim - 1 - self.division.axis
        rows = self.communicator.joined(np.ascontiguousarray(np.moveaxis(own, at, 0)))
        return np.ascontiguousarray(np.moveaxis(rows, 0, at))

    @property
    def _is_last(self) -> bool:
        return self.communicator.rank == self.communicator.size - 1
