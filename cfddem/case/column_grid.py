"""The grid of a column: a vessel cuts its cells; cells outside a cylinder, and those that walls close, are solid."""

from __future__ import annotations

from functools import lru_cache, reduce
from typing import Any

import numpy as np

from cfddem.case.patches import CasePatch
from cfddem.case.tables import CaseTables, Column
from cfddem.case.vessel_shape import CaseVessel
from cfddem.case.vessel_surface import surface_in, with_openings
from cfddem.case.walls import CaseWall
from cfddem.fluid.cut_cells import within
from cfddem.fluid.grid import Array, Grid, Region, outside_cylinder
from cfddem.fluid.thin_walls import divided, thin_wall
from cfddem.particles.walls.meshes import stamp


def grid_of(case: CaseTables) -> Grid:
    """Cells of the column, cut by its vessel; cells outside a cylinder, and behind walls, are solid."""
    if case.has_smooth_walls:
        thin = case.thin_walls
        stamps = tuple(stamp(wall) for wall in (case.vessel, *thin) if wall)
        return _in_vessel(case.column, case.vessel, case.openings, thin, stamps)
    walls = tuple(filter(case.closes_cells, case.wall))
    return _grid(case.column, walls, tuple(stamp(wall) for wall in walls))


@lru_cache(maxsize=8)
def _in_vessel(
    column: Column,
    vessel: CaseVessel | None,
    openings: tuple[CasePatch, ...],
    thin: tuple[CaseWall, ...],
    _: tuple[tuple[int, int], ...],
) -> Grid:
    surface: Any = with_openings(surface_in(vessel, column), column, openings) if vessel else None
    if thin:
        surface = divided(thin_wall(*(wall.form.corners() for wall in thin)), surface)
    return within(Grid.of_size(column.size, column.cell), surface)


@lru_cache(maxsize=8)
def _grid(column: Column, walls: tuple[CaseWall, ...], _: tuple[tuple[int, int], ...]) -> Grid:
    closing = [_closed_by(wall) for wall in walls]
    if column.shape == "cylinder":
        closing.append(outside_cylinder((0.5 * column.width, 0.5 * column.width, 0.0), 0.5 * column.width))
    if not closing:
        return Grid.of_size(column.size, column.cell)

    def solid(x: Array, y: Array, z: Array) -> np.ndarray:
        return np.asarray(reduce(np.logical_or, (surface(x, y, z) for surface in closing)))

    return Grid.of_size(column.size, column.cell, solid=solid)


def open_floor(case: CaseTables) -> Region | None:
    """Part of the floor below open cells; None if all of them are open."""
    grid = grid_of(case)
    if grid.solid is None:
        return None
    width, depth, _ = grid.spacing
    is_open = grid.open[0]

    def inside(x: Array, y: Array, z: Array) -> np.ndarray:
        column, row = np.floor(x / width).astype(int), np.floor(y / depth).astype(int)
        return np.asarray(is_open[row, column])

    return inside


def _closed_by(wall: CaseWall) -> Region:
    """Region that a wall closes to the fluid."""

    def inside(x: Array, y: Array, z: Array) -> np.ndarray:
        points = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
        return wall.closes(points.reshape(-1, 3)).reshape(points.shape[:-1])

    return inside
