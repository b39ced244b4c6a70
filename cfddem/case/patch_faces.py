"""Which faces of floor, lid and sides the patches of a case cover, and what their inlets bring.

Faces of cells do not follow the edge of a disc: through one that a patch covers in part, that part of the flow enters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
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
from cfddem.case.tables import CaseTables
from cfddem.fluid.cut_cells import section
from cfddem.fluid.grid import layers

Array = NDArray[np.float64]

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
