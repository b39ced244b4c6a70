"""The grid of a column, and the faces of its floor, lid and sides that patches cover.

A vessel cuts the cells of a column; cells outside a cylinder, and those that walls close, are solid. Faces of cells do
not follow the edge of a disc: through one that a patch covers in part, that part of the flow enters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError
from cfddem.case.patches import (
    ENDS,
    PLANES,
    CasePatch,
    along,
    lengths_of,
    middle_of,
    on_the_side,
    open_area_of,
    samples_by_cells,
)
from cfddem.case.tables import CaseTables, Column
from cfddem.case.vessel_shape import CaseVessel, surface_in, with_openings
from cfddem.case.walls import CaseWall
from cfddem.fluid.cut_cells import section, within
from cfddem.fluid.grid import Array, Grid, Region, layers, outside_cylinder
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


# ---------------------------------------------------------------- faces that patches cover


PLACES = 24
"""Places along an edge of a face at which a patch is sampled."""

SIDE_OF: Mapping[str, str] = {"z_low": ENDS[0], "z_high": ENDS[1]} | {name: name for name in PLANES if name not in ENDS}
"""Sides by their names in the fluid -> those of patches."""

HALF = 0.5
"""Share of a face that an outlet or a wall must cover to have it [-]."""


class PatchFaces(NamedTuple):
    """The patches of a side and its faces.

    patches  by name
    shares   velocity through the open part of each face over that of the patch, by name (ny, nx), (nz, ny) or (nz, nx)
             [-]
    rest     share of each face that is left to the inlet of the side itself [-]
    """

    patches: Mapping[str, CasePatch]
    shares: Mapping[str, Array]
    rest: Any

    def whole(self, name: str) -> NDArray[np.bool_]:
        """The faces that an outlet or a wall has."""
        return np.asarray(self.shares[name] >= HALF * self.shares[name].max())

    @property
    def inlets(self) -> list[str]:
        """Names of the inlets of a given flow."""
        return [name for name, patch in self.patches.items() if patch.brings]


def patch_faces(case: CaseTables, side: str) -> PatchFaces:
    """The faces of the patches of a side; InputError for a patch that covers no opening."""
    patches = {name: patch for name, patch in case.patches.items() if patch.side == side}
    faces = PatchFaces(patches, {name: coverage(case, patch) for name, patch in patches.items()}, 1.0)
    for name, share in faces.shares.items():
        flows = patches[name].mass_flow is not None
        if not share.any() or (flows and open_area_of(case, patches[name]) == 0.0):
            remedy = "move it, or make it larger than a cell"
            raise InputError(f"patch.{name}", None, f"on a part of the {side} that is open to the fluid", remedy)
    entering = [_covered(case, patches[name], faces.shares[name]) for name in faces.inlets]
    closed = [faces.whole(name) for name, patch in patches.items() if not patch.brings]
    for name, patch in patches.items():
        opens = bool(case.vessel) and side not in ENDS
        if opens and patch.brings and closed:  # openings lie apart, and two may still meet in a face
            faces.shares[name][np.any(closed, axis=0)] = 0.0
        exact = patch.mass_flow is not None or opens or patch.shape == "holes"
        if patch.brings and exact:  # also where faces do not follow the edge
            area, face = open_area_of(case, patch), grid_of(case).face_area(PLANES[side][0])
            faces.shares[name][:] *= area / (float((faces.shares[name] * _apertures(case, side)).sum()) * face)
    beside = np.maximum(1.0 - sum(entering), 0.0)
    return faces._replace(rest=np.where(np.any(closed, axis=0), 0.0, beside) if closed else beside)


def _apertures(case: CaseTables, side: str) -> Array:
    """Open share of every face of a side [-]."""
    grid, (axis, high) = grid_of(case), PLANES[side]
    here = layers(axis, -1 if high else 0)
    share: Array = grid.open[here].astype(float)
    if grid.walls:
        points = [coordinate[here] for coordinate in np.broadcast_arrays(*grid.faces(axis))]
        share *= section(grid.walls, points, axis, grid.spacing).share
    return share


def coverage(case: CaseTables, patch: CasePatch) -> Array:
    """Velocity through the open part of each face of a side over that of the patch [-]."""
    if patch.shape == "holes":
        return _through_holes(case, patch)
    (width, depth), (axis, high), grid = lengths_of(case, patch.side), PLANES[patch.side], grid_of(case)
    nx, ny = (grid.cells[d] for d in along(patch.side))
    x = (np.arange(nx * PLACES) + 0.5) * width / (nx * PLACES)
    shares = np.zeros((ny, nx))
    for row, is_open in enumerate(grid.open[layers(axis, -1 if high else 0)]):
        y = (row * PLACES + np.arange(PLACES)[:, None] + 0.5) * depth / (ny * PLACES)
        inside = np.repeat(is_open, PLACES) * np.ones(y.shape)
        if case.vessel:
            at = [coordinate.ravel() for coordinate in np.broadcast_arrays(x, y)]
            inside = inside * on_the_side(case, patch.side, *at).reshape(inside.shape)
        weight = patch.weight(x, y, middle_of(case, patch.side)) * inside
        sums = [values.reshape(PLACES, nx, PLACES).sum(axis=(0, 2)) for values in (weight, inside)]
        shares[row] = sums[0] / np.maximum(sums[1], 1.0)
    return shares


def _through_holes(case: CaseTables, patch: CasePatch) -> Array:
    """The same of holes, which may be smaller than a face: by places in each of them."""
    cell = grid_of(case).spacing
    x, y = samples_by_cells(patch.places(middle_of(case, patch.side)), patch.diameter or 0.0, (cell[0], cell[1]))
    part, inside = patch.area / len(x), on_the_side(case, patch.side, x, y)
    free = _apertures(case, patch.side) * grid_of(case).face_area(PLANES[patch.side][0])
    area = np.zeros(free.shape)
    np.add.at(area, face_at(case, patch.side, x[inside], y[inside], np.zeros(inside.sum())), part)
    return np.divide(area, free, out=np.zeros_like(area), where=free > 0.0)


def _covered(case: CaseTables, patch: CasePatch, share: Array) -> Array:
    """Share of the open part of each face that a patch covers, whatever its profile [-]."""
    return (
        share.copy() if patch.profile == "uniform" else coverage(case, patch.model_copy(update={"profile": "uniform"}))
    )


def face_at(case: CaseTables, side: str, *place: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the faces of a side at some places x, y, z [m]."""
    first, second = along(side)
    row, column = (np.floor(place[d] / grid_of(case).spacing[d]).astype(int) for d in (second, first))
    return row, column


def brought_in(
    case: CaseTables, rest: float, of_patches: Mapping[str, float]
) -> float | Callable[[str, Array, Array, Array], Array]:
    """Value that the fluid of inlets brings: one number, or a function of the name of a side and of places on it.

    A face that several inlets share has their mean by their highest flows.

    rest        of inlets without a value of their own
    of_patches  by the names of patches
    """
    if not of_patches:
        return rest
    by_side = {name: patch_faces(case, side) for name, side in SIDE_OF.items()}
    own = case.bed.highest_inlet_velocity if case.column.ends == "flow" else 0.0

    def values(side: str, x: Array, y: Array, z: Array) -> Array:
        faces = by_side[side]
        if not faces.inlets:
            return np.full(np.shape(x), rest)
        at = face_at(case, SIDE_OF[side], x, y, z)
        flow = {name: faces.patches[name].highest * faces.shares[name][at] for name in faces.inlets}
        beside = own * (side == "z_low") * faces.rest[at]
        total = beside + sum(flow.values())
        brought: Any = beside * rest + sum(of_patches.get(name, rest) * speed for name, speed in flow.items())
        return np.where(total > 0.0, brought / np.where(total > 0.0, total, 1.0), rest)

    return values
