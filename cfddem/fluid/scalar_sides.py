"""The faces of sides and of solid cells, and what a scalar does there."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from cfddem.fluid.boundaries import Boundaries, Side
from cfddem.fluid.grid import LOW, Array, Grid
from cfddem.fluid.scalar_conditions import SOLID, FluxWall, HeldWall, ScalarSides, Wall


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
