"""Closed regions: connected open cells that no outlet touches.

The pressure of a closed region is known only up to a constant, and fluid that enters it must leave it again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.grid import HIGH, LOW, Array, Grid


class ClosedRegions(NamedTuple):
    """The closed regions of a grid."""

    number: NDArray[np.int64]  # (nz, ny, nx) of the region of a cell, from 1; 0 outside of all
    size: NDArray[np.int64]  # (regions + 1,) cells of each region on all ranks
    communicator: Communicator

    @classmethod
    def numbered(cls, number: NDArray[np.int64], communicator: Communicator) -> ClosedRegions | None:
        """Regions by the number of each cell; None if there are none."""
        count = int(communicator.largest(number))
        if count == 0:
            return None
        size = communicator.sum(np.bincount(number.ravel(), minlength=count + 1), axis=())
        return cls(number, size, communicator)

    @classmethod
    def of(cls, grid: Grid, boundaries: Boundaries, communicator: Communicator) -> ClosedRegions | None:
        """Closed regions of a grid with its boundaries; None if an outlet touches every region."""
        region, count = label(grid.whole.open)
        links = list(range(count + 1))

        def root(n: int) -> int:
            while links[n] != n:
                n = links[n]
            return n

        for axis in range(3):
            if boundaries.periodic[axis]:
                first, last = np.take(region, 0, 2 - axis).ravel(), np.take(region, -1, 2 - axis).ravel()
                for a, b in {(int(a), int(b)) for a, b in zip(first, last) if a and b}:
                    links[root(a)] = root(b)
        region = np.array([root(n) for n in range(count + 1)])[region]
        for side in boundaries.box.sides:
            touched = side.layer(region, -1 if side.high else 0)[side.outlet[LOW:-HIGH, LOW:-HIGH]]
            region[np.isin(region, touched[touched > 0])] = 0
        return cls.numbered(grid.part(region).astype(np.int64), communicator)

    def sums(self, values: Array) -> Array:
        """Sum of a cell field (nz, ny, nx) over each region; the first sum is that of the cells outside of all."""
        return np.array([self.communicator.sum(values[self.number == region]) for region in range(len(self.size))])

    def remove_means(self, values: Array) -> None:
        """Subtract from a cell field its mean over each region, in place."""
        mean = self.sums(values) / np.maximum(self.size, 1)
        mean[0] = 0.0
        values -= mean[self.number]

    def refuse_imbalance(self, missing: Array, scale: float, time: float) -> None:
        """Raise `InputError` unless inflow and change of voidage cancel in each region.

        missing  fluid that each cell lacks (nz, ny, nx) [m3/s]
        scale    largest volume flux of the step [m3/s]
        time     simulated time, for the message [s]
        """
        excess, size = self.sums(missing)[1:], self.sums(np.abs(missing))[1:]
        for amount in excess[np.abs(excess) > 1e-9 * size + 1e-9 * scale]:
            sign = "little" if amount > 0 else "much"
            raise InputError(
                "boundaries", None, "such that inflow and change of voidage cancel where there is no outlet",
                f"{abs(amount):.3g} m3/s too {sign} fluid at t = {time:g} s; add Outlet()",
            )  # fmt: skip
