"""Openings in the side of a vessel: for the fluid, straight ducts through its wall to a side of the column."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError, shown
from cfddem.case.patches import ENDS, PLANES, CasePatch, along, lengths_of, middle_of
from cfddem.case.vessel_shape import ROUND_OFF
from cfddem.fluid.surfaces import Array, Joined, Plane, Surface, cylinder, together

OUTLINE = 48
"""Places on the outline of an opening at which it is looked at."""


def with_openings(vessel: Surface, column: Any, openings: tuple[CasePatch, ...]) -> Surface:
    """The wall of a vessel with the ducts of its openings."""
    return Joined((vessel, *(duct(opening, column) for opening in openings))) if openings else vessel


def duct(opening: CasePatch, column: Any) -> Surface:
    """The duct of an opening: from the middle of the column outwards, with the cross-section of the patch."""
    (axis, high), (first, second) = PLANES[opening.side], along(opening.side)
    place = [0.5 * length for length in column.size]
    if opening.centre:
        place[first], place[second] = opening.centre
    outward = np.eye(3)[axis] * (1.0 if high else -1.0)
    start = _plane(place, outward)
    if opening.diameter:
        return together(cylinder(place, 0.5 * opening.diameter, axis), start)
    sides = []
    for d, edge in zip((first, second), opening.size or (0.0, 0.0)):
        for sign in (1.0, -1.0):
            inward = sign * np.eye(3)[d]
            sides.append(_plane(np.array(place) - 0.5 * edge * inward, inward))
    return together(*sides, start)


def _plane(point: Any, normal: Any) -> Plane:
    return Plane(tuple(float(x) for x in point), tuple(float(n) for n in normal))  # type: ignore[arg-type]


def outline(opening: CasePatch, middle: tuple[float, float]) -> Array:
    """Places on the outline of a patch, in the order of its centre (N, 2) [m].

    middle  of its side [m]
    """
    turn = 2.0 * math.pi * np.arange(OUTLINE) / OUTLINE
    shape = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    if opening.size:  # a square around the circle, to its corners
        shape = shape / np.abs(shape).max(axis=1, keepdims=True)
    edges = np.array(opening.size or (opening.diameter, opening.diameter), float)
    return np.asarray(np.array(opening.centre or middle) + 0.5 * edges * shape)


def refuse_openings(case: Any) -> None:
    """Raise InputError for a patch of a side that is not there, or one that does not lie within it."""
    for name, patch in case.patch.items():
        if patch.side in ENDS:
            continue
        key, vessel, (axis, _) = f"patch.{name}", case.vessel, PLANES[patch.side]
        _refuse_side(case, key, patch)
        if patch.shape == "whole":
            continue
        at, lengths = outline(patch, middle_of(case, patch.side)), np.array(lengths_of(case, patch.side))
        beyond = (at < -ROUND_OFF * lengths) | (at > (1.0 + ROUND_OFF) * lengths)
        places = np.insert(at, axis, 0.5 * case.column.size[axis], axis=1)
        if beyond.any() or (vessel and (case.beyond_the_side(places) > ROUND_OFF * lengths.max()).any()):
            first, second = ("xyz"[d] for d in along(patch.side))
            (left, low), (right, top) = at.min(axis=0), at.max(axis=0)
            where = "wall of the vessel" if vessel else "side"
            raise InputError(
                f"{key}.centre", shown(patch.centre), f"such that the patch lies in the {where}, off its corners",
                f"it reaches from {first} = {left:.4g} to {right:.4g} m, {second} = {low:.4g} to {top:.4g} m; move it, "
                "or make it smaller",
            )  # fmt: skip
    openings = [(name, patch) for name, patch in case.patch.items() if patch in case.openings]
    for (first_name, one), (name, other) in combinations(openings, 2):
        common = overlap(one, other, middle_of(case, one.side)) if one.side == other.side else 0.0
        if common > ROUND_OFF * max(lengths_of(case, one.side)):
            raise InputError(
                f"patch.{name}.centre", shown(other.centre), f"such that it lies beside patch.{first_name}",
                f"they overlap by {common:.3g} m on {one.side}; move one of them, or make it smaller",
            )  # fmt: skip


def overlap(one: CasePatch, other: CasePatch, middle: tuple[float, float]) -> float:
    """How far two discs or boxes of one side reach into each other; negative where they are apart [m].

    middle  of the side [m]

    >>> disc = CasePatch(kind="outlet", shape="disc", diameter=0.03, centre=(0.04, 0.031))
    >>> round(overlap(disc, disc.model_copy(update={"centre": (0.04, 0.045)}), (0.0, 0.0)), 6)
    0.016
    """
    half = 0.5 * (np.array(one.size or (0.0, 0.0)) + np.array(other.size or (0.0, 0.0)))
    beyond = np.abs(np.subtract(one.centre or middle, other.centre or middle)) - half
    apart = math.hypot(*np.maximum(beyond, 0.0)) + min(float(max(beyond)), 0.0)
    return 0.5 * ((one.diameter or 0.0) + (other.diameter or 0.0)) - apart


def _refuse_side(case: Any, key: str, patch: CasePatch) -> None:
    """Raise InputError where the side of a patch has none."""
    vessel, axis = case.vessel, PLANES[patch.side][0]
    if case.column.shape == "cylinder":
        remedy = 'take [vessel] with shape = "cylinder"'
        raise InputError(f"{key}.side", patch.side, "floor or lid of a column with steps", remedy)
    if case.column.periodic[axis]:
        raise InputError(f"{key}.side", patch.side, "a side that is not periodic", 'set column.sides = "no_slip"')
    if not vessel:
        return
    if vessel.shape == "surface" or vessel.turn % 90.0:
        which = "a surface from a file" if vessel.shape == "surface" else "a box that is turned"
        raise InputError(f"{key}.side", patch.side, f"floor or lid of {which}", "other vessels open to a side")
    if vessel.spin:
        raise InputError("vessel.spin", vessel.spin, f"left out beside {key}", "an opening does not turn with the wall")
    if patch.kind == "wall":
        raise InputError(f"{key}.kind", "wall", "inlet or outlet in the wall of a vessel", "leave the patch out")
    if patch.shape not in ("box", "disc"):
        raise InputError(f"{key}.shape", patch.shape, "box or disc in the wall of a vessel")
