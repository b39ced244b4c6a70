r"""What a scalar does at sides of the box, at solid cells and at smooth walls.

Sides and solid cells have faces with a rule each. At smooth walls the wall of every cut cell has a flux, and gradients
beside it are corrected. A group of cut cells has one value T, at the mean distance :math:`\delta` of its fluid from the
wall. The wall conducts over this distance, and so it is known how the value changes along its normal, by G. The
difference of two groups over the spacing h is not yet the gradient between them, because their fluid is not in the
middle of the cells. With the distance c of the middle of a cell,

.. math:: \partial_e T = \frac{T_2 - T_1}{h} + G\,\frac{(c_2 - c_1) - (\delta_2 - \delta_1)}{h}

which is exact for a value that changes with the distance alone. It is kept between 0 and twice the first part, so that
no value leaves those around.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.compile import prange, serial, threaded
from cfddem.fluid.boundaries import Boundaries, Side
from cfddem.fluid.cell_groups import CutGroups
from cfddem.fluid.cut_cells import CutCells, contents
from cfddem.fluid.grid import LOW, Array, Grid
from cfddem.fluid.scalar_conditions import SOLID, FluxWall, HeldWall, ScalarSides, Wall
from cfddem.fluid.scalar_loops import Carried, entering
from cfddem.fluid.solver import FluidSolver
from cfddem.fluid.wall_force import wall_area


class SideFaces(NamedTuple):
    """Faces of sides and solid cells; see `cfddem.fluid.scalar_loops.Carried`."""

    places: np.ndarray  # (m, 4)
    rules: Array  # (m, 6)
    area: Array  # (m,) [m2]
    wall: np.ndarray  # (m,) whether it is a wall

    @classmethod
    def of(cls, boundaries: Boundaries, sides: ScalarSides, capacity: float) -> SideFaces:
        """The faces of a grid; capacity is that of the fluid per volume, [J/m3/K] or [kg/m3]."""
        grid = boundaries.grid
        shape, steps = grid.padded_shape, (1, grid.padded_shape[2], grid.padded_shape[1] * grid.padded_shape[2])
        is_open: Any = boundaries.halo.padded(grid.open, outside=0.0) > 0.0
        solid: Any = boundaries.halo.padded(~grid.open, outside=0.0) > 0.0
        flat: Any = np.arange(is_open.size).reshape(shape)
        places, rules, wall = [np.zeros((0, 4), np.int64)], [np.zeros((0, 6))], [np.zeros(0, bool)]

        def add(axis: int, high: bool, cells: np.ndarray, rule: np.ndarray, is_wall: np.ndarray) -> None:
            face = cells + steps[axis] * high
            ends = np.full(len(cells), axis), face, cells, np.full(len(cells), -1 if high else 1)
            places.append(np.stack(ends, axis=1).astype(np.int64))
            rules.append(rule)
            wall.append(is_wall)

        for side in boundaries.sides:
            layer = LOW + grid.cells[side.axis] - 1 if side.high else LOW
            own = side.layer(grid.inner(is_open), -1 if side.high else 0)
            cells = np.moveaxis(flat, 2 - side.axis, 0)[layer][LOW : LOW + own.shape[0], LOW : LOW + own.shape[1]]
            inlet, outlet = np.isin(side.owner, side.inlets), side.outlet[LOW:, LOW:][: own.shape[0], : own.shape[1]]
            rule = np.zeros((*own.shape, 6))
            rule[:] = rule_of(sides.walls.get(side.name, FluxWall()), capacity)
            rule[..., 4] *= boundaries.open_share(side)
            rule[inlet] = 0.0, 0.0, 0.0, 0.0, 1.0, 0.0
            rule[inlet, 0] = _brought(grid, side, inlet, sides)
            rule[outlet] = math.nan if sides.backflow is None else sides.backflow, 0.0, 0.0, 0.0, 1.0, 0.0
            add(side.axis, side.high, cells[own], rule[own], ~(inlet | outlet)[own])
        if sides.walls.get(SOLID) is not None and grid.whole.solid is not None and not grid.walls:
            rule = rule_of(sides.walls[SOLID], capacity)
            for axis in range(3):
                for high in (False, True):
                    beside = np.roll(solid, -1 if high else 1, axis=2 - axis)
                    cells = grid.inner(flat)[grid.inner(is_open & beside)]
                    add(axis, high, cells, np.tile(rule, (len(cells), 1)), np.ones(len(cells), bool))
        every = np.concatenate(places)
        areas = np.array([grid.face_area(d) for d in range(3)])
        return cls(every, np.concatenate(rules), areas[every[:, 0]], np.concatenate(wall))


def _brought(grid: Grid, side: Side, inlet: np.ndarray, sides: ScalarSides) -> Any:
    """Value that inlets bring through the faces of a side that have one."""
    if not callable(sides.inflow):
        return sides.inflow
    at = np.broadcast_arrays(*grid.faces(side.axis))
    return sides.inflow(side.name, *(side.layer(coordinate, -1 if side.high else 0)[inlet] for coordinate in at))


def rule_of(wall: Wall, capacity: float) -> np.ndarray:
    """Numbers of a wall, see `cfddem.fluid.scalar_loops.Carried`."""
    if isinstance(wall, HeldWall):
        return np.array([math.nan, math.inf, wall.value, 0.0, wall.area, 1.0])
    if isinstance(wall, FluxWall):
        return np.array([math.nan, 0.0, 0.0, wall.flux / capacity, wall.area, 0.0])
    in_series = float(not wall.to_cell)
    return np.array([math.nan, wall.coefficient / capacity, wall.value, 0.0, wall.area, in_series])


# ---------------------------------------------------------------- smooth walls


LEAST_RISE = 1e-9
"""Correction of a gradient that is left out, over the gradient along the normal [-]."""


class InsulatedWalls:
    """Smooth walls through which nothing passes, or none at all.

    spread    as :class:`cfddem.fluid.cell_groups.SingleCells`, by walls alone
    rate      of each cell by coefficients of walls, beyond conduction (nz, ny, nx) [1/s]
    supplied  what the walls have given in the step [the value times m3]
    """

    spread: Any = 0.0
    rate: Any = 0.0
    supplied = 0.0

    def correct(self, value: Array, carried_by: Carried, stage: int) -> None:
        """Correct gradients beside the walls, and find what these give, in a stage."""

    def give(self, stage: int, step: float, left: Array) -> None:
        """Take what walls give in a stage from what leaves every cell (padded); counts it over a whole step [s]."""


class ScalarWalls(InsulatedWalls):
    """Smooth walls that give something to a scalar.

    fluid     with smooth walls
    groups    of its cells
    wall      what they do
    capacity  of the fluid per volume
    """

    def __init__(self, fluid: FluidSolver, groups: CutGroups, wall: Wall, capacity: float) -> None:
        cut, grid = fluid.boundaries.cut, fluid.grid
        assert isinstance(cut, CutCells)
        share, distance, centre = _distances(cut, groups)
        amount = np.linalg.norm(wall_area(cut), axis=0) / grid.cell_volume  # local: components
        beside = groups.averaged(amount) > 0.0  # in any cell of the group
        here = np.flatnonzero(beside & (share > 0.0))
        flat = grid.inner(np.arange(cut.volume.size).reshape(grid.padded_shape)).ravel()
        self.at, self.amount, self.distance = flat[here], amount.ravel()[here], distance.ravel()[here]
        self.rule, self._volume = rule_of(wall, capacity), grid.cell_volume
        self._entered = np.zeros((2, here.size))
        self._slope, self._fluid = np.zeros(cut.volume.shape), fluid
        self.faces = [_faces(fluid, d, beside, distance, centre) for d in range(3)]
        coefficient, in_series = self.rule[1], self.rule[5]
        per_group = groups.averaged(amount / np.maximum(share, 1e-300) * (share > 0.0))
        if in_series:
            self.spread = np.where(beside, 2.0 * per_group / np.where(beside, distance, 1.0), 0.0)
        else:
            self.rate = coefficient * per_group

    def correct(self, value: Array, carried_by: Carried, stage: int) -> None:
        """See `InsulatedWalls.correct`."""
        diffusivity = carried_by.diffusivity
        slope, walls = self._slope.reshape(-1), (self.at, self.amount, self.distance)
        through_walls(value, diffusivity, walls, self.rule, self._entered[stage], slope)
        self._fluid.boundaries.halo.fill(self._slope, extend=False)
        for d, faces in enumerate(self.faces):
            through = carried_by.through[stage, d]
            correct_gradients(value, slope, diffusivity, faces, carried_by.inverse[d], through)

    def give(self, stage: int, step: float, left: Array) -> None:
        """See `InsulatedWalls.give`."""
        mean = 0.5 * (self._entered[0] + self._entered[1]) if stage else self._entered[0]
        left.reshape(-1)[self.at] -= mean
        if stage:
            self.supplied = step * float(self._fluid.communicator.sum(mean)) * self._volume


def scalar_walls(fluid: FluidSolver, groups: Any, wall: Wall | None, capacity: float) -> InsulatedWalls:
    """What a scalar does at the smooth walls of a fluid."""
    if not fluid.grid.walls or wall is None or wall == FluxWall():
        return InsulatedWalls()
    return ScalarWalls(fluid, groups, wall, capacity)


class WallFaces(NamedTuple):
    """Faces of one direction beside walls.

    at        flat index of the face and of the cell above it; `step` below is the other cell
    share     of the face that is open [-]
    rise      of the distance, what is missing between the fluid of both cells, over the spacing [-]
    of_low, of_high  parts of both cells in the gradient along the normal [-]
    """

    at: np.ndarray
    step: int
    share: Array
    rise: Array
    of_low: Array
    of_high: Array


def _distances(cut: CutCells, groups: CutGroups) -> tuple[Array, Array, Array]:
    """Open share of every cell, mean distance of the fluid of its group, and distance of its middle [m]."""
    grid = cut.grid
    points = list(np.broadcast_arrays(*grid.centres()))
    centre = np.array(cut.surface.distance(*points))
    _, own = contents(cut.surface, grid.spacing, *points)
    return groups.volume, groups.averaged(np.where(groups.volume == 1.0, centre, own)), centre


def _faces(fluid: FluidSolver, d: int, beside: Any, distance: Array, centre: Array) -> WallFaces:
    """The faces normal to d whose gradients are corrected."""
    cut, halo, inverse = fluid.boundaries.cut, fluid.boundaries.halo, fluid.inverse_spacing[d]
    assert isinstance(cut, CutCells)
    away, middle = halo.padded(distance), halo.padded(centre)
    trust = halo.padded(np.where(beside, distance, 0.0))
    rise = (middle - np.roll(middle, 1, axis=2 - d)) - (away - np.roll(away, 1, axis=2 - d))
    low = np.roll(trust, 1, axis=2 - d)
    own = np.zeros(cut.volume.shape, bool)
    cut.grid.inner_faces(own, d)[:] = True
    is_open = halo.padded(cut.grid.open, outside=0.0)
    own &= (is_open * np.roll(is_open, 1, axis=2 - d) > 0.0) & (trust + low > 0.0)
    own &= (cut.aperture[d] > 0.0) & (np.abs(rise) * inverse > LEAST_RISE)
    at, step = np.flatnonzero(own), (1, cut.volume.shape[2], cut.volume.shape[1] * cut.volume.shape[2])[d]
    both = (trust + low).ravel()[at]
    return WallFaces(
        at, step, cut.aperture[d].ravel()[at], rise.ravel()[at] * inverse, low.ravel()[at] / both,
        trust.ravel()[at] / both,
    )  # fmt: skip


@serial
def through_walls(value, diffusivity, walls, rule, entered, slope):
    """What walls give to cells per time and volume of a whole cell, and the gradient along the normal.

    walls    flat indices of cells, areas over the volume of a cell [1/m], distances of the fluid [m]
    rule     see `cfddem.fluid.scalar_loops.Carried`
    slope    flat, padded
    """
    at, amount, distance = walls
    value, diffusivity = value.reshape(-1), diffusivity.reshape(-1)
    for n in range(len(at)):
        cell = at[n]
        half = diffusivity[cell] / distance[n]
        flux = rule[4] * entering(rule[1], rule[2], rule[3], rule[5], value[cell], half)
        entered[n] = amount[n] * flux
        slope[cell] = -flux / diffusivity[cell] if diffusivity[cell] > 0.0 else 0.0


@threaded
def correct_gradients(value, slope, diffusivity, faces, inverse, through):
    """Correct what diffusion carries through faces beside walls, along one direction."""
    value, diffusivity, through = value.reshape(-1), diffusivity.reshape(-1), through.reshape(-1)
    for n in prange(len(faces.at)):
        high = faces.at[n]
        low = high - faces.step
        first = (value[high] - value[low]) * inverse
        right = first + (faces.of_low[n] * slope[low] + faces.of_high[n] * slope[high]) * faces.rise[n]
        right = min(max(right, 0.0), 2.0 * first) if first > 0.0 else max(min(right, 0.0), 2.0 * first)
        spread = 0.5 * faces.share[n] * (diffusivity[low] + diffusivity[high])
        through[high] -= spread * (right - first)
