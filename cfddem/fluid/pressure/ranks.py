"""The pressure equation of several ranks: the iteration of one process, with the cells divided among the ranks.

Arrays of a rank have a layer of ghosts below and above its cells along each divided axis. Ghosts are filled after each
colour of a sweep, so that sweeps, residuals and transfers are those of one process, and with them the number of
iterations and all bits. Coarse cells belong to the rank of their first fine cell. From the first small level down,
every rank computes the whole level: waiting for messages would take longer than the work. So it does from the first
level with an odd number of periodic layers along a divided axis, of which the last and the first have one colour.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.communicator import Communicator, place_of
from cfddem.fluid.block import Block, region_of
from cfddem.fluid.grid import Array, Grid, layers
from cfddem.fluid.halo import Borders
from cfddem.fluid.pressure.multigrid import ClosedRegions, Level, PressureEquation, hierarchy

SMALL = 5_000
"""Cells of the whole box below which every rank computes the whole level."""


def pressure_equation(
    grid: Grid,
    closed_regions: ClosedRegions | None,
    communicator: Communicator,
    periodic: NDArray[np.bool_],
    outlets: NDArray[np.bool_],
) -> PressureEquation:
    """The pressure equation of a grid, or of the block of a rank.

    periodic  whether x, y, z are periodic
    others    as of `PressureEquation`
    """
    if isinstance(grid, Block) and communicator.size > 1:
        return SharedPressureEquation(grid, periodic, closed_regions, communicator, outlets)
    return PressureEquation(grid, closed_regions, communicator, outlets=outlets)


class SharedLevel(Level):
    """The cells of one rank in one grid of the hierarchy, with a layer of ghosts below and above along divided axes.

    whole    shape of the grid of all ranks
    factors  cells merged along x, y, z
    outlets  whether a side normal to x, y, z has a known pressure
    starts   first layer of each rank along x, y, z and, at the end of each, the number of layers
    borders  with the cells of other ranks
    """

    def __init__(
        self,
        whole: tuple[int, int, int],
        factors: NDArray[np.int64],
        outlets: NDArray[np.bool_],
        starts: Sequence[NDArray[np.int64]],
        borders: Sequence[Borders],
    ) -> None:
        self.whole, self.starts, self.borders = whole, starts, borders
        self.axes, self.communicator = [border.axis for border in borders], borders[0].communicator
        x, y, z = (len(begins) - 1 for begins in starts)
        place = place_of(self.communicator.rank, (x, y, z))
        self.first = np.array([begins[n] for begins, n in zip(starts, place)])
        self.stop = np.array([begins[n + 1] for begins, n in zip(starts, place)])
        self.ghosts = np.isin(range(3), self.axes).astype(np.int64)  # layers below and above along x, y, z
        shape = (self.stop - self.first + 2 * self.ghosts)[::-1].tolist()
        super().__init__((shape[0], shape[1], shape[2]), factors, outlets)
        merged = factors == 2
        self.shift[:] = merged * self.ghosts * (self.first % 2 == 0)
        straddled = [merged[axis] and 1 in begins[1:-1] % 2 for axis, begins in enumerate(starts)]
        # a coarse cell has cells of two ranks
        self.straddled = [border for border in borders if straddled[border.axis]]
        self.next_starts = [-(-begins // factor) for begins, factor in zip(starts, factors)]
        self._own = self._inside(self.first, self.stop)

    def _inside(self, begin: NDArray[np.int64], end: NDArray[np.int64]) -> tuple[slice, ...]:
        """Index of the layers begin to end - 1 along x, y, z of the whole grid, in an array of this level."""
        offset = self.ghosts - self.first
        return tuple(slice(int(low), int(high)) for low, high in zip(begin + offset, end + offset))[::-1]

    def own(self, values: Array) -> Array:
        """View of an array of this level without its ghosts."""
        return values[self._own]

    def fill(self, values: Array) -> None:
        """Fill the ghosts of an array of this level."""
        for border in self.borders:
            border.fill(values, 1, 1)

    def without_ghosts(self, values: Array) -> None:
        """Set the ghosts of an array of this level to zero."""
        for axis in self.axes:
            values[layers(axis, 0)] = values[layers(axis, -1)] = 0.0

    def coarsen_from(self, fine: Level) -> None:
        """See `Level.coarsen_from`; a coarse cell at the border may contain a cell of the rank above."""
        assert isinstance(fine, SharedLevel)
        end = np.minimum(self.stop * fine.factors, fine.whole[::-1])
        inside = fine._inside(self.first * fine.factors, end)
        below = [values[inside] for values in fine.coefficients]
        self._coarsen(fine, below, [self.own(values) for values in self.coefficients], self.whole)
        for values in self.coefficients:
            self.fill(values)

    def take_diagonal(self) -> None:
        """See `Level.take_diagonal`; ghosts are not relaxed."""
        super().take_diagonal()
        self.without_ghosts(self.inverse)
        # the diagonal of a ghost lacks faces beyond the array: only its rank knows whether its row is dry
        ghosts = [slice(None)] if 1 in self.axes else [0, -1] if 2 in self.axes else []
        for planes in ghosts:
            self.wet[planes] = 0, self.shape[1]

    def sweep(self, sweeps: int, backward: bool) -> None:
        """Relax all cells of all ranks so many times."""
        corner = int((self.first - self.ghosts).sum())  # local: cell where arrays begin
        for half in range(2 * sweeps):
            self.relax((int(backward) + half + corner) & 1, 1, backward)
            self.fill(self.x)

    def take_residual(self) -> None:
        """Compute the residual; that of ghosts too, for coarse cells that hold cells of several ranks."""
        super().take_residual()
        self.without_ghosts(self.image)
        for border in self.straddled:
            border.fill(self.image, 1, 1)

    def gather_to(self, whole: Level, values: Array, target: Array) -> None:
        """Copy the cells of all ranks into an array of the same grid that every rank has."""
        target.reshape(-1)[self.places] = self.communicator.joined(self.own(values).reshape(-1))

    @cached_property
    def places(self) -> NDArray[np.int64]:
        """Where the cells of all ranks, one rank after the other, lie in an array of the whole grid."""
        x, y, z = (len(begins) - 1 for begins in self.starts)
        places = (place_of(rank, (x, y, z)) for rank in range(self.communicator.size))
        number = np.arange(math.prod(self.whole)).reshape(self.whole)
        return np.concatenate([number[region_of(self.starts, place)].ravel() for place in places])

    def take_from(self, whole: Level) -> None:
        """Take over the unknown, with ghosts, from the same grid that every rank has."""
        x, y, z = (
            np.arange(first - ghosts, stop + ghosts) % int(starts[-1])
            for first, stop, ghosts, starts in zip(self.first, self.stop, self.ghosts, self.starts)
        )
        self.x[:] = whole.x[np.ix_(z, y, x)]


class SharedPressureEquation(PressureEquation):
    """The pressure equation of one rank of several.

    grid      cells of this rank
    periodic  whether x, y, z are periodic
    other arguments as of `PressureEquation`
    """

    def __init__(
        self,
        grid: Block,
        periodic: NDArray[np.bool_],
        closed_regions: ClosedRegions | None,
        communicator: Communicator,
        outlets: NDArray[np.bool_],
    ) -> None:
        self._periodic = periodic
        self._given = tuple(np.zeros(grid.shape) for _ in range(4))
        super().__init__(grid, closed_regions, communicator, outlets=outlets)

    def _all_levels(self, grid: Grid) -> list[Level]:
        """Levels of which each rank has a part, the last of them again as a whole, and the coarser ones as a whole."""
        assert isinstance(grid, Block)
        borders, shared, whole = grid.borders(self._periodic), list[SharedLevel](), list[Level]()
        starts = [np.array(begins) for begins in grid.division.starts]
        for shape, factors in hierarchy(grid.whole):
            if not whole:
                shared.append(SharedLevel(shape, factors, self._outlets, starts, borders))
                starts = shared[-1].next_starts
            too_thin = any((np.diff(begins) < 1).any() for begins in starts)  # local: all ranks know all starts
            seam = any(self._periodic[border.axis] and shape[2 - border.axis] % 2 == 1 for border in borders)
            if whole or math.prod(shape) <= SMALL or too_thin or seam:
                whole.append(Level(shape, factors, self._outlets))
        if not whole:
            whole.append(Level(*hierarchy(grid.whole)[-1], self._outlets))
        self._shared = len(shared)
        return [*shared, *whole]

    @property
    def coefficients(self) -> tuple[Array, Array, Array, Array]:
        """See `PressureEquation.coefficients`."""
        return self._given  # type: ignore[return-value]

    def prepare(self) -> None:
        """See `PressureEquation.prepare`."""
        finest, coarsest, whole = self.levels[0], self.levels[self._shared - 1], self.levels[self._shared]
        assert isinstance(finest, SharedLevel) and isinstance(coarsest, SharedLevel)
        for values, coefficient in zip(finest.coefficients, self._given):
            finest.own(values)[:] = coefficient
            finest.fill(values)
        for depth, level in enumerate(self.levels):
            if depth == self._shared:
                for values, target in zip(coarsest.coefficients, whole.coefficients):
                    coarsest.gather_to(whole, values, target)
            elif depth > 0:
                level.coarsen_from(self.levels[depth - 1])
            level.take_diagonal()

    def _own(self, values: Array) -> Array:
        """See `PressureEquation._own`."""
        finest = self.finest
        assert isinstance(finest, SharedLevel)
        return finest.own(values)

    def _apply_to_direction(self) -> None:
        """See `PressureEquation._apply_to_direction`; the ghosts of the direction are current."""
        super()._apply_to_direction()
        assert isinstance(self.finest, SharedLevel)
        self.finest.without_ghosts(self.finest.image)

    def _cycle(self, depth: int) -> None:
        """See `PressureEquation._cycle`; the coarsest level of which ranks have parts is solved as a whole."""
        if depth != self._shared - 1:
            super()._cycle(depth)
            return
        level, whole = self.levels[depth], self.levels[depth + 1]
        assert isinstance(level, SharedLevel)
        level.gather_to(whole, level.b, whole.b)
        super()._cycle(depth + 1)
        level.take_from(whole)
