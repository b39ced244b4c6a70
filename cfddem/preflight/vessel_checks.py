"""Checks of a vessel and of the patches of a case: whether particles and cells fit, and patches are reached."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from cfddem.case.patches import ENDS, PLACES, CasePatch, along, on_the_side, open_share_of
from cfddem.case.schema import Case
from cfddem.preflight.issue import Issue, percent

FEWEST_ACROSS = 4.0
"""Cells across the narrowest part of a vessel, below which its flow has no profile [-]."""

FEWEST_OF_OPENING = 2.0
"""Cells across an opening in the wall of a vessel, below which walls take much of its flow [-]."""

MOSTLY = 0.99
"""Share of a patch that must be open to the fluid for no warning [-]."""


def check_vessel(case: Case) -> Iterator[Issue]:
    """Check that particles fit through a vessel, and that cells resolve it."""
    if not case.vessel:
        return
    if case.line:
        narrow = 2.0 * min(radius for _, radius in case.line)
        of_cone = "radius" if case.line[0][1] <= case.line[1][1] else "top_radius"
    else:
        narrow = min(case.vessel.size or (math.inf,))
        of_cone = ""
    key = {"cylinder": "radius", "cone": of_cone, "chain": "line", "box": "size", "surface": "file"}[case.vessel.shape]
    largest = case.bed.largest_diameter
    if 0.0 < narrow < largest:
        yield Issue(
            "warning", f"vessel.{key}", f"{narrow:.3g} m across, less than a particle, {largest:.3g} m",
            "use a larger radius; below about five diameters particles form arches",
        )  # fmt: skip
    if not case.fluid:
        return
    widest = max(case.column.cell_edges[:2])
    if 0.0 < narrow < FEWEST_ACROSS * widest:
        yield Issue(
            "warning", f"vessel.{key}",
            f"{narrow / widest:.2g} cells across the vessel where it is narrowest, {narrow:.3g} m; its flow needs "
            f"at least {FEWEST_ACROSS:g}",
            "use smaller cells, but of at least 2 diameters, or a wider vessel",
        )  # fmt: skip


def check_patches(case: Case) -> Iterator[Issue]:
    """Check that patches lie on the open part of floor or lid, and that cells resolve openings in a vessel."""
    of_lid = {name: patch for name, patch in case.patch.items() if patch.side == "lid"}
    leaves = case.column.ends == "flow" and _is_open(case, [*of_lid.values()])
    enters = case.fastest_inflow > 0.0 or any(e.kind == "inlet" and not e.brings for e in case.patch.values())
    if enters and of_lid and not leaves and "outlet" not in {e.kind for e in case.patch.values()}:
        yield Issue(
            "error", f"patch.{next(iter(of_lid))}",
            "the patches of the lid leave no part of it open: what enters has to leave",
            'make them smaller, or give a patch of kind = "outlet"',
        )  # fmt: skip
    if case.run.reference_speed is None and 0.0 < case.fastest_by_pressure == case.reference_speed:
        yield Issue(
            "note", "run.reference_speed",
            f"it is {case.reference_speed:.3g} m/s, that of free flow by the pressures of patches, and sets the steps",
            "give the speed of the fastest collisions, in m/s, if they are slower, as where a bed slows the flow",
        )  # fmt: skip
    for name, patch in case.patch.items():
        yield from _check_drain(case, name, patch)
        yield from _check_holes(case, name, patch)
        if patch.side not in ENDS:
            yield from _check_opening(case, name, patch)
            continue
        share = open_share_of(case, patch)
        if share == 0.0:
            end = 0 if patch.side == "floor" else -1
            radius = f", a disc of {2.0 * case.line[end][1]:.3g} m" if case.line else ""
            yield Issue(
                "error", f"patch.{name}", f"it lies outside of the {patch.side} of the column{radius}",
                "move its centre [x, y], in m from the corner of the column",
            )  # fmt: skip
        elif share < MOSTLY and patch.shape != "whole":
            outside = "has no flow" if patch.mass_flow is None else "passes its part of mass_flow to the rest"
            yield Issue(
                "warning", f"patch.{name}",
                f"{percent(1.0 - share)} of it lies outside of the {patch.side}, and {outside}",
                "make it smaller, or move its centre",
            )  # fmt: skip


def _check_holes(case: Case, name: str, patch: CasePatch) -> Iterator[Issue]:
    """Check that faces of cells resolve the jets of holes."""
    widest = max(case.column.cell_edges[:2])
    across = (patch.diameter or math.inf) / widest
    if patch.shape == "holes" and across < FEWEST_OF_OPENING:
        yield Issue(
            "note", f"patch.{name}.diameter",
            f"{across:.2g} cells across a hole: what enters is exact, but a jet begins at the mean velocity of its "
            "faces and has less momentum",
            f"only holes of at least {FEWEST_OF_OPENING * widest:.2g} m, {FEWEST_OF_OPENING:g} cells, have jets of "
            "their own",
        )  # fmt: skip


def _check_drain(case: Case, name: str, patch: CasePatch) -> Iterator[Issue]:
    """Check that particles fit through a patch by which they leave."""
    narrow = min(patch.size or (math.inf,))
    if patch.diameter:
        narrow = 0.5 * (patch.diameter - patch.inner_diameter) if patch.inner_diameter else patch.diameter
    smallest = min(species.smallest_diameter for species in case.species.values())
    largest = case.bed.largest_diameter
    if patch.particles == "leave" and narrow <= largest:
        none = narrow <= smallest
        reached = f"{'no' if none else 'not every'} particle fits through; "
        reached += f"the smallest is {smallest:.3g} m" if none else f"the largest is {largest:.3g} m"
        yield Issue(
            "error" if none else "warning", f"patch.{name}.particles", f"it is {narrow:.3g} m across, and {reached}",
            'make it wider, or set particles = "stay"',
        )  # fmt: skip


def _check_opening(case: Case, name: str, patch: CasePatch) -> Iterator[Issue]:
    """Check that cells resolve an opening in the wall of a vessel."""
    spacing = case.column.cell_edges
    edges = patch.size or 2 * (patch.diameter or math.inf,)
    narrow = min(edge / spacing[d] for edge, d in zip(edges, along(patch.side)))
    if patch in case.openings and narrow < FEWEST_OF_OPENING:
        yield Issue(
            "warning", f"patch.{name}",
            f"{narrow:.2g} cells across; the flow through an opening in a vessel needs at least {FEWEST_OF_OPENING:g}",
            "make it larger, or the cells smaller",
        )  # fmt: skip


def _is_open(case: Case, patches: Sequence[CasePatch]) -> bool:
    """Whether patches leave some of the lid free."""
    width, depth, _ = case.column.size
    along = (np.arange(PLACES) + 0.5) / PLACES
    x, y = (coordinate.reshape(-1) for coordinate in np.meshgrid(width * along, depth * along))
    free = on_the_side(case, "lid", x, y)
    for patch in patches:
        free &= patch.weight(x, y, (0.5 * width, 0.5 * depth)) == 0.0
    return bool(free.any())
