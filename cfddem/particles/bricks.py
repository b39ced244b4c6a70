"""Space divided among ranks by planes across x, y and z: who owns a place, and who is near it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.backend.brick_shapes import Shape, place_of, shapes, with_ghosts
from cfddem.backend.communicator import SERIAL, Communicator

BINS = 1000
"""Places among which a plane between two ranks is chosen."""

ENOUGH = 100_000
"""Particles among which the work of the ranks is compared."""

FAR = 1e300
"""Where the space of the first and the last rank ends along an open axis: a number, since differences are taken [m]."""


@dataclass(frozen=True)
class Bricks:
    """Space divided by planes across x, y and z; a brick ends at the next plane along each axis.

    planes  positions along x, y, z, each in ascending order, one fewer than ranks along the axis [m]
    """

    planes: tuple[Sequence[float], Sequence[float], Sequence[float]]

    @classmethod
    def slabs(cls, axis: int, planes: Sequence[float]) -> Bricks:
        """Bricks of one rank along two axes, divided by planes across the third."""
        x, y, z = (planes if axis == each else () for each in range(3))
        return cls((x, y, z))

    @classmethod
    def balanced(cls, shape: Shape, position: np.ndarray, communicator: Communicator = SERIAL) -> Bricks:
        """Layers of bricks that hold equally many particles, within a thousandth of the length that these take up.

        shape         ranks along x, y, z
        position      of the particles (N, 3); those of this rank where several share them [m]
        communicator  of these ranks
        """
        x, y, z = (_balanced(ranks, position[:, axis], communicator) for axis, ranks in enumerate(shape))
        return cls((x, y, z))

    @classmethod
    def of_least_work(cls, ranks: int, position: np.ndarray, reach: float) -> Bricks:
        """Balanced bricks of the shape for which the busiest rank has the least particles and ghosts.

        position  of all particles (N, 3) [m]
        reach     within which a rank needs ghosts [m]
        """
        places = position[:: max(len(position) // ENOUGH, 1)]
        made = [cls.balanced(shape, places) for shape in shapes(ranks, (ranks, ranks, ranks))]
        best = min(made, key=lambda each: round(each.work(places, reach), 2))
        return cls.balanced(best.shape, position)

    def work(self, position: np.ndarray, reach: float) -> float:
        """Particles and ghosts of the busiest rank over the mean number of particles.

        position  of all particles (N, 3) [m]
        reach     within which a rank needs ghosts [m]
        """
        if not len(position):
            return 1.0
        counts = np.bincount(self.owner(position), minlength=math.prod(self.shape))  # local: all particles
        ends = [[*position.min(axis=0)], [*position.max(axis=0)]]  # local: all particles
        widths = [np.diff([low, *planes, high]) for low, planes, high in zip(ends[0], self.planes, ends[1])]
        busy = counts.reshape(self.shape) * with_ghosts([np.maximum(each, 1e-3 * reach) for each in widths], reach)
        return float(busy.max() * busy.size / len(position))  # local: all ranks

    @property
    def shape(self) -> Shape:
        """Ranks along x, y, z."""
        x, y, z = (len(planes) + 1 for planes in self.planes)
        return x, y, z

    def owner(self, position: np.ndarray) -> np.ndarray:
        """Rank that owns each position (N,)."""
        places = [np.searchsorted(np.asarray(planes), x, side="right") for planes, x in zip(self.planes, position.T)]
        return np.ravel_multi_index(places, self.shape)

    def near(self, rank: int, reach: float, box: np.ndarray) -> list[int]:
        """Other ranks whose bricks are closer than `reach` [m] to that of a rank along each axis.

        box  (3,) length of the periodic box, which begins at 0; infinite along open axes [m]
        """
        beside = []
        for axis, here in enumerate(place_of(rank, self.shape)):
            (low, high), length = self._ranges(axis, box), box[axis]
            from_here = _gap(np.array([low[here], high[here]])[:, None], low, high, length)
            from_there = _gap(np.stack([low, high]), low[here], high[here], length)  # what the other rank finds
            gaps = np.concatenate([from_here, from_there]).min(axis=0)  # local: borders
            beside.append(np.flatnonzero(gaps < reach))
        others = np.ravel_multi_index(np.ix_(*beside), self.shape)
        return [other for other in sorted(others.ravel().tolist()) if other != rank]

    def rows_near(self, ranks: Sequence[int], position: np.ndarray, reach: float, box: np.ndarray) -> list[np.ndarray]:
        """Rows of the positions (N, 3) [m] that are closer than `reach` [m] to the brick of each of some ranks.

        Closer along each axis, over the borders of a periodic box too.

        box  (3,) length of the periodic box, which begins at 0; infinite along open axes [m]
        """
        close = dict[tuple[int, int], np.ndarray]()
        found = []
        for rank in ranks:
            here = list(enumerate(place_of(rank, self.shape)))
            for axis, n in here:
                if (axis, n) not in close:
                    low, high = self._ranges(axis, box)
                    close[axis, n] = _gap(position[:, axis], low[n], high[n], box[axis]) < reach
            x, y, z = (close[each] for each in here)
            found.append(np.flatnonzero(x & y & z))
        return found

    def _ranges(self, axis: int, box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper ends of the bricks along an axis, within a periodic box [m]."""
        low, high = np.array([-FAR, *self.planes[axis]]), np.array([*self.planes[axis], FAR])
        if np.isfinite(box[axis]):
            low, high = np.maximum(low, 0.0), np.minimum(high, box[axis])
        return low, high


def _balanced(ranks: int, place: np.ndarray, communicator: Communicator) -> list[float]:
    """Planes between ranks with equally many places along an axis."""
    if ranks == 1:
        return []
    low, high = communicator.smallest(place), communicator.largest(place)
    borders = np.linspace(low, high, BINS + 1)[1:-1]
    counts = np.bincount(np.searchsorted(borders, place, side="right"), minlength=BINS)  # local: summed below
    below = np.cumsum(communicator.sum(counts, axis=()))
    wanted = below[-1] * np.arange(1, ranks) / ranks
    planes: list[float] = borders[np.minimum(np.searchsorted(below, wanted), BINS - 2)].tolist()
    return planes


def _gap(place: Any, low: Any, high: Any, length: float) -> np.ndarray:
    """Distance of places from ranges, over the borders of a periodic box of finite length, too; arrays [m]."""
    images = (-length, 0.0, length) if np.isfinite(length) else (0.0,)
    gaps = [np.maximum(low - place - shift, place + shift - high) for shift in images]
    return np.maximum(np.minimum.reduce(gaps), 0.0)  # local: images
