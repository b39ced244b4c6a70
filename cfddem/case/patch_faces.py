"""Which faces of floor and lid the patches of a case cover, and what their inlets bring.

Faces of cells do not follow the edge of a disc: through one that a patch covers in part, that part of the flow enters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.patches import CasePatch, open_area_of
from cfddem.case.tables import CaseTables
from cfddem.fluid.cut_cells import section

Array = NDArray[np.float64]

PLACES = 24
"""Places along an edge of a face at which a patch is sampled."""

HALF = 0.5
"""Share of a face that an outlet or a wall must cover to have it [-]."""


class PatchFaces(NamedTuple):
    """The patches of a side and its faces.

    patches  by name
    shares   velocity through the open part of each face over that of the patch, by name (ny, nx) [-]
    rest     share of each face that is left to the inlet of the side itself (ny, nx) [-]
    """

    patches: Mapping[str, CasePatch]
    shares: Mapping[str, Array]
    rest: Any

    def whole(self, name: str) -> NDArray[np.bool_]:
        """The faces that an outlet or a wall has (ny, nx)."""
        return np.asarray(self.shares[name] >= HALF * self.shares[name].max())

    @property
    def inlets(self) -> list[str]:
        """Names of the inlets."""
        return [name for name, each in self.patches.items() if each.kind == "inlet"]


def patch_faces(case: CaseTables, side: str) -> PatchFaces:
    """The faces of the patches of a side, "floor" or "lid"; InputError for a patch that covers no opening."""
    patches = {name: each for name, each in case.patches.items() if each.side == side}
    made = PatchFaces(patches, {name: coverage(case, each) for name, each in patches.items()}, 1.0)
    for name, share in made.shares.items():
        flows = patches[name].mass_flow is not None
        if not share.any() or (flows and open_area_of(case, patches[name]) == 0.0):
            remedy = "move it, or make it larger than a cell"
            raise InputError(f"patch.{name}", None, f"on a part of the {side} that is open to the fluid", remedy)
    entering = [_covered(case, patches[name], made.shares[name]) for name in made.inlets]
    for name, each in patches.items():
        if each.mass_flow is not None:  # exactly, also where faces do not follow the edge
            area, face = open_area_of(case, each), grid_of(case).face_area(2)
            made.shares[name][:] *= area / (float((made.shares[name] * _apertures(case, side)).sum()) * face)
    closed = [made.whole(name) for name, each in patches.items() if each.kind != "inlet"]
    beside = np.maximum(1.0 - sum(entering), 0.0)
    return made._replace(rest=np.where(np.any(closed, axis=0), 0.0, beside) if closed else beside)


def _apertures(case: CaseTables, side: str) -> Array:
    """Open share of every face of floor or lid (ny, nx) [-]."""
    grid, layer = grid_of(case), 0 if side == "floor" else -1
    share = grid.open[layer].astype(float)
    if grid.walls:
        points = [each[layer] for each in np.broadcast_arrays(*grid.faces(2))]
        share *= section(grid.walls, points, 2, grid.spacing).share
    return share


def coverage(case: CaseTables, patch: CasePatch) -> Array:
    """Velocity through the open part of each face of a side over that of the patch (ny, nx) [-]."""
    (width, depth, height), (nx, ny, nz) = case.column.size, grid_of(case).cells
    z, solid = (0.0, 0) if patch.side == "floor" else (height, nz - 1)
    x = (np.arange(nx * PLACES) + 0.5) * width / (nx * PLACES)
    made = np.zeros((ny, nx))
    for row, is_open in enumerate(grid_of(case).open[solid]):
        y = (row * PLACES + np.arange(PLACES)[:, None] + 0.5) * depth / (ny * PLACES)
        places = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
        inside = np.repeat(is_open, PLACES) * np.ones(y.shape)
        if case.vessel:
            inside = inside * (case.beyond_the_side(places.reshape(-1, 3)) <= 0.0).reshape(inside.shape)
        weight = patch.weight(x, y, (0.5 * width, 0.5 * depth)) * inside
        sums = [values.reshape(PLACES, nx, PLACES).sum(axis=(0, 2)) for values in (weight, inside)]
        made[row] = sums[0] / np.maximum(sums[1], 1.0)
    return made


def _covered(case: CaseTables, patch: CasePatch, share: Array) -> Array:
    """Share of the open part of each face that a patch covers, whatever its profile (ny, nx) [-]."""
    return (
        share.copy() if patch.profile == "uniform" else coverage(case, patch.model_copy(update={"profile": "uniform"}))
    )


def face_at(case: CaseTables, x: Array, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the faces of floor and lid at some places."""
    hx, hy, _ = grid_of(case).spacing
    return np.floor(y / hy).astype(int), np.floor(x / hx).astype(int)


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
    found = {side: patch_faces(case, side) for side in ("floor", "lid")}
    own = case.bed.highest_inlet_velocity if case.column.ends == "flow" else 0.0

    def values(side: str, x: Array, y: Array, _: Array) -> Array:
        faces = found["floor" if side == "z_low" else "lid"]
        if not faces.inlets:
            return np.full(np.shape(x), rest)
        at = face_at(case, x, y)
        flow = {name: faces.patches[name].highest * faces.shares[name][at] for name in faces.inlets}
        beside = own * (side == "z_low") * faces.rest[at]
        total = beside + sum(flow.values())
        brought: Any = beside * rest + sum(of_patches.get(name, rest) * each for name, each in flow.items())
        return np.where(total > 0.0, brought / np.where(total > 0.0, total, 1.0), rest)

    return values
