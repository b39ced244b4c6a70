"""Patches of floor and lid as conditions of the fluid: the flow through a patch is its velocity times its area.

Faces of cells do not follow the edge of a disc: through one that a patch covers in part, that part of the flow enters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.patches import CasePatch
from cfddem.case.schema import Case
from cfddem.fluid.conditions import Condition, Inlet, NoSlip, Outlet
from cfddem.fluid.grid import Array, Region

PLACES = 24
"""Places along an edge of a face at which a patch is sampled."""

HALF = 0.5
"""Share of a face that an outlet or a wall must cover to have it [-]."""


def with_patches(case: Case, side: str, base: Condition | list[Condition]) -> Condition | list[Condition]:
    """The conditions of a side with the patches of a case.

    side    "floor" or "lid"
    base    conditions without patches
    errors  InputError for a patch that covers no opening
    """
    patches = {name: each for name, each in case.patch.items() if each.side == side}
    if not patches:
        return base
    listed = base if isinstance(base, list) else [base]
    covered = {name: coverage(case, each) for name, each in patches.items()}
    for name, share in covered.items():
        if not share.any():
            remedy = "move it, or make it larger than a cell"
            raise InputError(f"patch.{name}", None, f"on a part of the {side} that is open to the fluid", remedy)
    made, inlets = [*listed], [name for name, each in patches.items() if each.kind == "inlet"]
    around = np.ones(next(iter(covered.values())).shape)  # whether the side itself is open beside the inlets
    for name, each in patches.items():
        if each.kind != "inlet":
            whole = covered[name] >= HALF * covered[name].max()
            around[whole] = 0.0
            where = _at(case, whole)
            made.append(Outlet(each.pressure, where=where) if each.kind == "outlet" else NoSlip(where=where))
        elif name == inlets[-1]:  # all inlets at once: two may share a face
            speeds = [(patches[one].speed, covered[one]) for one in inlets]
            entering = np.sum([share for _, share in speeds], axis=0) > 0.0
            made.append(Inlet(_velocity(case, speeds, _before(listed[0]), around), where=_at(case, entering)))
    return made


def coverage(case: Case, patch: CasePatch) -> Array:
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


def _before(condition: Condition) -> Callable[[float], float]:
    """Velocity that enters through the whole side without patches, as a function of time."""
    if not isinstance(condition, Inlet):
        return lambda time: 0.0
    speed, factor = float(condition.velocity), condition.in_time  # type: ignore[arg-type]
    return lambda time: speed * (factor(time) if factor else 1.0)


def _velocity(
    case: Case, speeds: Sequence[tuple[Callable[[float], float], Array]], flow: Callable[[float], float], around: Array
) -> Callable[[Array, Array, Array, float], Array]:
    """Inward speed at faces: that of every patch by its share, and that of the floor by the rest if it is `around`."""
    rest = around * np.maximum(1.0 - np.sum([share for _, share in speeds], axis=0), 0.0)

    def velocity(x: Array, y: Array, z: Array, time: float) -> Array:
        face = _face(case, x, y)
        entering: Any = sum(speed(time) * share[face] for speed, share in speeds)
        return np.asarray(entering + flow(time) * rest[face])

    return velocity


def _at(case: Case, chosen: np.ndarray) -> Region:
    """The faces of a side that are chosen (ny, nx)."""

    def where(x: Array, y: Array, z: Array) -> np.ndarray:
        return np.asarray(chosen[_face(case, x, y)])

    return where


def _face(case: Case, x: Array, y: Array) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the faces of a side at some places."""
    hx, hy, _ = grid_of(case).spacing
    return np.floor(y / hy).astype(int), np.floor(x / hx).astype(int)
