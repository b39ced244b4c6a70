"""Patches of floor, lid and sides as conditions of the fluid: the flow through a patch is its velocity times its area.

Faces of cells do not follow the edge of a disc: through one that a patch covers in part, that part of the flow enters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cfddem.case.column_grid import grid_of
from cfddem.case.patch_faces import face_at, patch_faces
from cfddem.case.patches import PLANES
from cfddem.case.schema import Case
from cfddem.fluid.conditions import Condition, Inlet, NoSlip, Outlet
from cfddem.fluid.grid import Array, Region, layers


def with_patches(case: Case, side: str, base: Condition | list[Condition]) -> Condition | list[Condition]:
    """The conditions of a side with the patches of a case.

    side    as a patch names it
    base    conditions without patches
    errors  InputError for a patch that covers no opening
    """
    of_side = patch_faces(case, side)
    if not of_side.patches:
        return base
    listed = base if isinstance(base, list) else [base]
    flow, inlets = _before(listed[0]), of_side.inlets
    entering = np.sum([of_side.shares[name] for name in inlets], axis=0) > 0.0
    covered = entering | np.any([of_side.whole(name) for name in of_side.patches if name not in inlets], axis=0)
    axis, high = PLANES[side]
    replaced = any(patch.shape == "whole" and not patch.brings for patch in of_side.patches.values())
    if replaced or np.all(covered | ~grid_of(case).open[layers(axis, -1 if high else 0)]):
        listed = [NoSlip()]  # nothing of the side itself is left
    conditions = [*listed]
    for name, patch in of_side.patches.items():
        if not patch.brings:
            where = _at(case, side, of_side.whole(name))
            conditions.append(
                NoSlip(where=where) if patch.kind == "wall" else Outlet(patch.pressure or 0.0, where=where)
            )
        elif name == inlets[-1]:  # all inlets at once: two may share a face
            speeds = [(of_side.patches[one].speed, of_side.shares[one]) for one in inlets]
            velocity = _velocity(case, side, speeds, flow, of_side.rest)
            conditions.append(Inlet(velocity, where=_at(case, side, entering)))
    return conditions


def _before(condition: Condition) -> Callable[[float], float]:
    """Velocity that enters through the whole side without patches, as a function of time."""
    if not isinstance(condition, Inlet):
        return lambda time: 0.0
    speed, factor = float(condition.velocity), condition.in_time  # type: ignore[arg-type]
    return lambda time: speed * (factor(time) if factor else 1.0)


def _velocity(
    case: Case,
    side: str,
    speeds: Sequence[tuple[Callable[[float], float], Array]],
    flow: Callable[[float], float],
    rest: Array,
) -> Callable[[Array, Array, Array, float], Array]:
    """Inward speed at faces: that of every patch by its share, and that of the floor by the rest."""

    def velocity(x: Array, y: Array, z: Array, time: float) -> Array:
        face = face_at(case, side, x, y, z)
        entering: Any = sum(speed(time) * share[face] for speed, share in speeds)
        return np.asarray(entering + flow(time) * rest[face])

    return velocity


def _at(case: Case, side: str, chosen: np.ndarray) -> Region:
    """The faces of a side that are chosen."""

    def where(x: Array, y: Array, z: Array) -> np.ndarray:
        return np.asarray(chosen[face_at(case, side, x, y, z)])

    return where
