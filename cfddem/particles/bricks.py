"""Space divided among ranks by planes across x, y and z: who owns a place, and who is near it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator, Shape, shapes

BINS = 1000
"""Places among which a plane between two ranks is chosen, in each layer or column."""

ENOUGH = 100_000
"""Particles among which the work of the ranks is compared."""

FAR = 1e300
"""Where the space of the first and the last rank ends along an open axis: a number, since differences are taken [m]."""


@dataclass(frozen=True, eq=False)
class Bricks:
    """Space divided by planes: across x first, then each layer across y, then each column of a layer across z.

    planes  positions along x; along y for all layers, or of each layer; along z for all columns, or of each column of
            each layer. All in ascending order, one fewer than ranks along the axis [m]
    """

    planes: tuple[Any, Any, Any]

    def __post_init__(self) -> None:
        x, y, z = (np.asarray(cuts, float) for cuts in self.planes)
        y = np.broadcast_to(y, (len(x) + 1, y.shape[-1]))
        z = np.broadcast_to(z, (len(x) + 1, y.shape[-1] + 1, z.shape[-1]))
        object.__setattr__(self, "planes", (x, y, z))

    @classmethod
    def slabs(cls, axis: int, planes: Sequence[float]) -> Bricks:
        """Bricks of one rank along two axes, divided by planes across the third."""
        x, y, z = (planes if axis == other else () for other in range(3))
        return cls((x, y, z))

    @classmethod
    def balanced(
        cls, shape: Shape, position: np.ndarray, communicator: Communicator = SERIAL, work: np.ndarray | None = None
    ) -> Bricks:
        """Bricks with equal work, within a thousandth of the length that the particles of a layer or column take up.

        shape         ranks along x, y, z
        position      of the particles (N, 3); those of this rank where several share them [m]
        communicator  of these ranks
        work          of each particle (N,), whole numbers; 1 if None
        """
        work = np.ones(len(position), np.int64) if work is None else work
        part, planes = np.zeros(len(position), np.int64), list[np.ndarray]()
        for axis, ranks in enumerate(shape):
            cuts = _cuts(ranks, position[:, axis], part, math.prod(shape[:axis]), work, communicator)
            part = part * ranks + _below(cuts, part, position[:, axis])
            planes.append(cuts.reshape(*shape[:axis], ranks - 1))
        return cls((planes[0], planes[1], planes[2]))

    @classmethod
    def of_least_work(cls, ranks: int, position: np.ndarray, reach: float) -> Bricks:
        """Balanced bricks of the shape for which the busiest rank has the least particles and ghosts.

        position  of all particles (N, 3) [m]
        reach     within which a rank needs ghosts [m]
        """
        places = position[:: max(len(position) // ENOUGH, 1)]
        divisions = [cls.balanced(shape, places) for shape in shapes(ranks, (ranks, ranks, ranks))]
        best = min(divisions, key=lambda bricks: round(bricks.work(places, reach), 2))
        return cls.balanced(best.shape, position)

    def work(self, position: np.ndarray, reach: float) -> float:
        """Particles and ghosts of the busiest rank over the mean number of particles.

        position  of all particles (N, 3) [m]
        reach     within which a rank needs ghosts [m]
        """
        if not len(position):
            return 1.0
        counts = np.bincount(self.owner(position), minlength=math.prod(self.shape))  # local: all particles
        first, last = position.min(axis=0), position.max(axis=0)  # local: all particles
        low, high = np.clip(self.ends, first, last)
        sides = (low > first).astype(float) + (high < last)
        around = np.prod(1.0 + sides * reach / np.maximum(high - low, 1e-3 * reach), axis=1)  # local: three axes
        return float((counts * around).max() * len(counts) / len(position))  # local: all ranks

    @property
    def shape(self) -> Shape:
        """Ranks along x, y, z."""
        x, y, z = (cuts.shape[-1] + 1 for cuts in self.planes)
        return x, y, z

    @cached_property
    def ends(self) -> np.ndarray:
        """Lowest and highest place of the brick of each rank along x, y, z (2, ranks, 3) [m]."""
        ends = np.empty((2, *self.shape, 3))
        for axis, planes in enumerate(self.planes):
            outside = np.full((*planes.shape[:-1], 1), FAR)
            for n, border in enumerate(([-outside, planes], [planes, outside])):
                ends[n, ..., axis] = np.concatenate(border, axis=-1).reshape(*self.shape[: axis + 1], *[1] * (2 - axis))
        return ends.reshape(2, -1, 3)

    def owner(self, position: np.ndarray) -> np.ndarray:
        """Rank that owns each position (N,)."""
        rank = np.zeros(len(position), np.int64)
        for axis, planes in enumerate(self.planes):
            cuts = planes.reshape(math.prod(planes.shape[:-1]), planes.shape[-1])
            rank = rank * (planes.shape[-1] + 1) + _below(cuts, rank, position[:, axis])
        return rank

    def near(self, rank: int, reach: float, box: np.ndarray) -> list[int]:
        """Other ranks whose bricks are closer than `reach` [m] to that of a rank along each axis.

        box  (3,) length of the periodic box, which begins at 0; infinite along open axes [m]
        """
        is_near = np.ones(math.prod(self.shape), bool)
        for axis in range(3):
            (low, high), length = self._ranges(axis, box), box[axis]
            from_here = _gap(np.array([low[rank], high[rank]])[:, None], low, high, length)
            from_there = _gap(np.stack([low, high]), low[rank], high[rank], length)  # what the other rank finds
            is_near &= np.concatenate([from_here, from_there]).min(axis=0) < reach  # local: borders
        is_near[rank] = False
        ranks: list[int] = np.flatnonzero(is_near).tolist()
        return ranks

    def rows_near(self, ranks: Sequence[int], position: np.ndarray, reach: float, box: np.ndarray) -> list[np.ndarray]:
        """Rows of the positions (N, 3) [m] that are closer than `reach` [m] to the brick of each of some ranks.

        Closer along each axis, over the borders of a periodic box too.

        box  (3,) length of the periodic box, which begins at 0; infinite along open axes [m]
        """
        close = dict[tuple[int, float, float], np.ndarray]()
        ranges, rows = [self._ranges(axis, box) for axis in range(3)], []
        for rank in ranks:
            here = [(axis, float(low[rank]), float(high[rank])) for axis, (low, high) in enumerate(ranges)]
            for axis, low, high in here:
                if (axis, low, high) not in close:
                    close[axis, low, high] = _gap(position[:, axis], low, high, box[axis]) < reach
            x, y, z = (close[bounds] for bounds in here)
            rows.append(np.flatnonzero(x & y & z))
        return rows

    def _ranges(self, axis: int, box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper ends of the bricks of all ranks along an axis, within a periodic box [m]."""
        low, high = self.ends[..., axis]
        if np.isfinite(box[axis]):
            low, high = np.maximum(low, 0.0), np.minimum(high, box[axis])
        return low, high


def _below(cuts: np.ndarray, part: np.ndarray, place: np.ndarray) -> np.ndarray:
    """How many of the planes of its part lie at or below each place (N,).

    cuts   planes of each part (parts, n)
    part   of each place (N,)
    place  along the axis that they divide (N,) [m]
    """
    if len(cuts) == 1:
        return np.searchsorted(cuts[0], place, side="right")
    count = np.zeros(len(place), np.int64)
    if cuts.shape[1]:
        order = np.argsort(part, kind="stable")
        begins = np.searchsorted(part[order], np.arange(len(cuts) + 1))
        for piece in np.unique(part).tolist():
            rows = order[begins[piece] : begins[piece + 1]]
            count[rows] = np.searchsorted(cuts[piece], place[rows], side="right")
    return count


def _cuts(
    ranks: int, place: np.ndarray, part: np.ndarray, parts: int, work: np.ndarray, communicator: Communicator
) -> np.ndarray:
    """Planes between ranks with equal work along an axis, in each of some parts of space (parts, ranks - 1) [m].

    place  of the particles of this rank along the axis (N,) [m]
    part   in which each of them lies (N,)
    work   of each of them (N,)
    """
    if ranks == 1:
        return np.zeros((parts, 0))
    ends = np.full((2, parts), -np.inf)
    np.maximum.at(ends[0], part, -place)
    np.maximum.at(ends[1], part, place)
    ends = communicator.largest(ends, axis=())
    low, high = np.where(np.isfinite(ends), ends * ((-1.0,), (1.0,)), 0.0)  # 0 where nothing lies
    borders = np.linspace(low, high, BINS + 1, axis=1)
    step = np.where(high > low, high - low, 1.0) / BINS
    bins = np.clip(((place - low[part]) / step[part]).astype(np.int64), 0, BINS - 1)
    counts = np.zeros((parts, BINS), np.int64)
    np.add.at(counts, (part, bins), work)
    below = np.cumsum(communicator.sum(counts, axis=()), axis=1)  # local: summed
    cuts = np.empty((parts, ranks - 1))
    for piece, reached in enumerate(below):
        wanted = reached[-1] * np.arange(1, ranks) / ranks
        above = np.minimum(np.searchsorted(reached, wanted), BINS - 2)
        under = np.maximum(above - 1, 0)
        cuts[piece] = borders[piece, np.where(wanted - reached[under] < reached[above] - wanted, under, above) + 1]
    return cuts


def _gap(place: Any, low: Any, high: Any, length: float) -> np.ndarray:
    """Distance of places from ranges, over the borders of a periodic box of finite length, too; arrays [m]."""
    images = (-length, 0.0, length) if np.isfinite(length) else (0.0,)
    gaps = [np.maximum(low - place - shift, place + shift - high) for shift in images]
    return np.maximum(np.minimum.reduce(gaps), 0.0)  # local: images
