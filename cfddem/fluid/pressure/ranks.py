"""The pressure equation of several ranks: the iteration of one process, with the cells divided among the ranks.

Arrays of a rank have a layer of ghosts below and above its cells along the divided axis. Ghosts are filled after each
colour of a sweep, so that sweeps, residuals and transfers are those of one process, and with them the number of
iterations and all bits. Coarse cells belong to the rank of their first fine cell. From the first small level down,
every rank computes the whole level: waiting for messages would take longer than the work. So it does from the first
level with an odd number of periodic layers, of which the last and the first have one colour.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.communicator import Communicator
from cfddem.fluid.block import Block
from cfddem.fluid.grid import Array, Grid, layers
from cfddem.fluid.halo import Borders
from cfddem.fluid.pressure.multigrid import Level, PressureEquation, hierarchy
from cfddem.fluid.pressure.regions import ClosedRegions

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
        borders = grid.borders(periodic)[0]
        repeats = bool(periodic[borders.axis])
        return SharedPressureEquation(grid, borders, repeats, closed_regions, communicator, outlets)
    return PressureEquation(grid, closed_regions, communicator, outlets=outlets)


class SharedLevel(Level):
    """The cells of one rank in one grid of the hierarchy, with a layer of ghosts below and above.

    whole    shape of the grid of all ranks
    factors  cells merged along x, y, z
    outlets  whether a side normal to x, y, z has a known pressure
    starts   first layer of each rank along the divided axis and, at the end, the number of layers
    borders  with the cells of other ranks
    """

    def __init__(
        self,
        whole: tuple[int, int, int],
        factors: NDArray[np.int64],
        outlets: NDArray[np.bool_],
        starts: NDArray[np.int64],
        borders: Borders,
    ) -> None:
        self.whole, self.starts, self.borders, self.axis = whole, starts, borders, borders.axis
        rank = borders.communicator.rank
        self.first, self.stop = int(starts[rank]), int(starts[rank + 1])
        shape = list(whole)
        shape[2 - self.axis] = self.stop - self.first + 2
        super().__init__((shape[0], shape[1], shape[2]), factors, outlets)
        merged = factors[self.axis] == 2
        self.shift[self.axis] = int(merged and self.first % 2 == 0)
        self.straddled = bool(merged and (starts[1:-1] % 2).any())  # local: all ranks know all starts
        self.next_starts = -(-starts // factors[self.axis])

    def own(self, values: Array) -> Array:
        """View of an array of this level without its ghosts."""
        return values[layers(self.axis, slice(1, -1))]

    def fill(self, values: Array) -> None:
        """Fill the ghosts of an array of this level."""
        self.borders.fill(values, 1, 1)

    def without_ghosts(self, values: Array) -> None:
        """Set the ghosts of an array of this level to zero."""
        values[layers(self.axis, 0)] = values[layers(self.axis, -1)] = 0.0

    def coarsen_from(self, fine: Level) -> None:
        """See `Level.coarsen_from`; a coarse cell at the border may contain a cell of the rank above."""
        assert isinstance(fine, SharedLevel)
        factor = int(fine.factors[self.axis])
        begin, end = self.first * factor, min(self.stop * factor, int(fine.starts[-1]))
        inside = layers(self.axis, slice(begin - fine.first + 1, end - fine.first + 1))
        below = [values[inside] for values in fine.coefficients]
        self._coarsen(fine, below, [self.own(values) for values in self.coefficients], self.whole)
        for values in self.coefficients:
            self.fill(values)

    def take_diagonal(self) -> None:
        """See `Level.take_diagonal`; ghosts are not relaxed."""
        super().take_diagonal()
        self.without_ghosts(self.inverse)

    def sweep(self, sweeps: int, backward: bool) -> None:
        """Relax all cells of all ranks so many times."""
        for half in range(2 * sweeps):
            # arrays begin at the layer before the first
            self.relax(int(backward) + half + self.first + 1, 1, backward)
            self.fill(self.x)

    def take_residual(self) -> None:
        """Compute the residual; that of ghosts too, for coarse cells that hold cells of two ranks."""
        super().take_residual()
        self.without_ghosts(self.image)
        if not self.straddled:
            return
        ends, above = self.image[layers(self.axis, [0, 1, -2, -1])], layers(self.axis, -1)
        self.fill(ends)
        self.image[layers(self.axis, 0)] = ends[layers(self.axis, 0)]
        if self.stop < self.starts[-1]:  # the last coarse cell may have one fine cell only
            self.image[above] = ends[above]

    def gather_to(self, whole: Level, values: Array, target: Array) -> None:
        """Copy the cells of all ranks into an array of the same grid that every rank has."""
        at = 2 - self.axis
        rows = self.borders.communicator.joined(np.ascontiguousarray(np.moveaxis(self.own(values), at, 0)))
        target[:] = np.moveaxis(rows, 0, at)

    def take_from(self, whole: Level) -> None:
        """Take over the unknown, with ghosts, from the same grid that every rank has."""
        places = np.arange(self.first - 1, self.stop + 1) % int(self.starts[-1])
        np.take(whole.x, places, axis=2 - self.axis, out=self.x)


class SharedPressureEquation(PressureEquation):
    """The pressure equation of one rank of several.

    grid     cells of this rank
    borders  with the cells of other ranks
    repeats  whether the divided axis is periodic
    other arguments as of `PressureEquation`
    """

    def __init__(
        self,
        grid: Block,
        borders: Borders,
        repeats: bool,
        closed_regions: ClosedRegions | None,
        communicator: Communicator,
        outlets: NDArray[np.bool_],
    ) -> None:
        self._borders, self._repeats = borders, repeats
        self._given = tuple(np.zeros(grid.shape) for _ in range(4))
        super().__init__(grid, closed_regions, communicator, outlets=outlets)

    def _all_levels(self, grid: Grid) -> list[Level]:
        """Levels of which each rank has a part, the last of them again as a whole, and the coarser ones as a whole."""
        assert isinstance(grid, Block)
        starts, shared, whole = np.array(grid.division.starts), list[SharedLevel](), list[Level]()
        for shape, factors in hierarchy(grid.whole):
            if not whole:
                shared.append(SharedLevel(shape, factors, self._outlets, starts, self._borders))
                starts = shared[-1].next_starts
            too_thin = (np.diff(starts) < 1).any()  # local: all ranks know all starts
            seam = self._repeats and shape[2 - self._borders.axis] % 2 == 1
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
        for values, given in zip(finest.coefficients, self._given):
            finest.own(values)[:] = given
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
