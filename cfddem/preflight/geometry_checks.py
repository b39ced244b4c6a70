"""Checks that the particles and the bed fit into the column."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.case.bed import POURED_SOLID_FRACTION
from cfddem.case.schema import Case
from cfddem.case.vessel import on_the_wrong_side, start_behind_a_surface, vessel_of
from cfddem.preflight.bed_estimate import BedEstimate
from cfddem.preflight.issue import Issue, Severity

RANDOM_CLOSE_PACKING = 0.64
"""Highest solid fraction of a bed of equal spheres [-]."""

SUSPENDED_SOLID_FRACTION = math.pi / 6.0 / 1.02**3
"""Solid fraction of a cubic lattice with gaps of 2 % of the diameter, the densest suspended start [-]."""

LARGEST_INITIAL_OVERLAP = 0.02
"""Largest overlap of particles at given positions, over the diameter [-]."""


def fits(case: Case) -> bool:
    """Whether the largest particle fits into the column."""
    return case.bed.largest_diameter <= min(case.column.size) * (1.0 + 1e-9)


def check_particle_size(case: Case) -> Iterator[Issue]:
    """Check that one particle fits into the column."""
    diameter, narrowest = case.bed.largest_diameter, min(case.column.size)
    if not fits(case):
        yield Issue(
            "error", bed_key(case, "diameter"),
            f"{diameter:.3g} m is larger than the smallest edge of the column, {narrowest:.3g} m",
            "give both in m, or widen the column",
        )  # fmt: skip


def check_bed_size(case: Case, bed: BedEstimate) -> Iterator[Issue]:
    """Check that the particles fit into the column at the start, and the expanded bed below the lid."""
    column, diameter, start = case.column, case.bed.largest_diameter, case.bed.start
    vessel = vessel_of(case)
    volume = column.floor_area * column.height if vessel is None else float(vessel.volumes[-1])
    fraction = bed.solid_volume / volume
    limit = SUSPENDED_SOLID_FRACTION if start == "suspended" else POURED_SOLID_FRACTION
    remedy = f"at most {int(bed.count / fraction * limit)} of these particles fit; use fewer, or a higher column"
    count = bed_key(case, "count")
    if start == "suspended" and fraction > SUSPENDED_SOLID_FRACTION:
        yield Issue(
            "error", "bed.count",
            f"solid fraction {fraction:.2f} is above the limit {SUSPENDED_SOLID_FRACTION:.2f} of a suspended start",
            remedy,
        )  # fmt: skip
    elif fraction > RANDOM_CLOSE_PACKING:
        yield Issue(
            "error", count,
            f"voidage {1 - fraction:.2f} is below the limit {1 - RANDOM_CLOSE_PACKING:.2f} of a random close packing",
            remedy,
        )  # fmt: skip
    elif start == "poured" and bed.poured_height > column.height - 0.5 * diameter:
        yield Issue(
            "error", count, f"the poured bed is {bed.poured_height:.3g} m high, above the lid at {column.height:.3g} m",
            remedy,
        )  # fmt: skip
    elif bed.voidage < 1.0 and bed.height > 0.9 * column.height and start in ("poured", "expanded"):
        severity: Severity = "error" if bed.height > 1.2 * column.height else "warning"
        yield Issue(
            severity, "column.height",
            f"the bed expands to about {bed.height:.3g} m; the lid is at {column.height:.3g} m",
            f"use a height of {1.3 * bed.height:.2g} m, or a lower inlet velocity",
        )  # fmt: skip


def check_positions(case: Case) -> Iterator[Issue]:
    """Check that particles start on the right side of surfaces, given positions in the column and apart."""
    with suppress(InputError, OSError, ValueError):  # a surface that cannot be read is reported elsewhere
        if (wrong := start_behind_a_surface(case, case.particle_count)) is not None:
            yield Issue("error", *wrong)
    positions = np.array(case.bed.positions, float).reshape(-1, 3)
    if not len(positions):
        return
    size = np.array(case.column.size)
    outside = ~((positions >= 0.0) & (positions <= size)).all(axis=1)
    if case.column.shape == "cylinder":
        outside |= np.hypot(*(positions[:, :2] - 0.5 * size[:2]).T) > 0.5 * size[0]
    if outside.any():
        row = int(np.argmax(outside))
        others = int(outside.sum()) - 1
        yield Issue(
            "error", f"bed.positions.{row}",
            f"{[float(f'{x:.4g}') for x in positions[row]]} lies outside the column"
            + (f", and so do {others} more" if others else ""),
            f"the column extends from 0 to {case.column.size} m",
        )  # fmt: skip
    for number, wall in enumerate(case.wall):
        with suppress(InputError, OSError, ValueError):
            if (found := on_the_wrong_side(case, number, positions)) is not None:
                row, why, remedy = found
                reason = f"wall.{number}.file = {wall.file!r} is closed, and {why}"
                yield Issue("error", f"bed.positions.{row}", reason, remedy)
    overlap, rows = _largest_overlap(positions, case.bed.diameter)
    if overlap > LARGEST_INITIAL_OVERLAP:
        yield Issue(
            "error", "bed.positions",
            f"particles {min(rows)} and {max(rows)} overlap by {100.0 * overlap:.3g} % of their diameter; "
            f"the limit is {100.0 * LARGEST_INITIAL_OVERLAP:g} %",
            "move them apart",
        )  # fmt: skip


def bed_key(case: Case, word: str) -> str:
    """Key of a particle property: under bed, or under the species of a mixture."""
    return f"bed.species.NAME.{word}" if case.bed.species else f"bed.{word}"


def _largest_overlap(positions: np.ndarray, diameter: float) -> tuple[float, tuple[int, int]]:
    """Largest overlap of equal spheres over their diameter, and the rows of the pair."""
    largest, rows = 0.0, (0, 0)
    order = np.argsort(positions[:, 2])
    for k, row in enumerate(order):
        above = order[k + 1 :]
        above = above[: np.searchsorted(positions[above, 2], positions[row, 2] + diameter)]
        if len(above):
            overlap = diameter - np.linalg.norm(positions[above] - positions[row], axis=1)
            if overlap.max() > largest:
                largest, rows = float(overlap.max()), (int(row), int(above[np.argmax(overlap)]))
    return largest / diameter, rows
