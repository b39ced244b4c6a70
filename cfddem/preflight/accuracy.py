"""What cells, kernel and fluid step cost in accuracy, as far as it was measured in beds of the validation.

`LIQUID` and `GAS` have rows of `docs/tables` (`cfddem validate bed-steps`, `beds` and `gas-bed-steps`). The other
numbers are those of pages; no command computes them again, except those of a lattice. Another bed may differ from all
of these.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from cfddem.case.patches import ENDS
from cfddem.case.schema import Case
from cfddem.preflight.bed_estimate import BedEstimate
from cfddem.preflight.step_estimate import StepEstimate

PACKED_SMEARED = ((2.0, 0.69), (4.0, 0.89), (8.0, 0.94), (12.0, 0.95))
"""Height of a fixed poured bed in cells of three diameters, and its pressure drop over that of its law, with smeared
surfaces (`docs/limits.md`, "Scope")."""

PACKED_SHARP = ((1.25, 0.98), (2.5, 0.979), (10.0 / 3.0, 0.94), (5.0, 0.83))
"""Cell over diameter, and the pressure drop of a fixed lattice of six layers over that of its law, with sharp surfaces
(`docs/limits.md`, "Beds"; `pytest -m slow tests/coupling/test_seen_solids.py` holds them to limits)."""

BY_KERNEL = ((1.0, 1.11), (1.5, 1.0), (2.0, 0.90), (2.5, 0.80))
"""Width of the kernel in diameters, and the granular temperature of the bed of glass beads with agitation and smeared
surfaces, over that at 1.5. One run of 2.2 s each (`scenarios/validation/agitation/README.md`, "Step, filter and
cells")."""

GAS_BY_KERNEL = ((1.0, 1.033), (1.5, 1.0), (2.0, 0.944))
"""The same of the mean height of the small gas bed (`docs/tables/gas-bed-steps.json`)."""

OF_KERNEL = {
    True: ("granular temperature", BY_KERNEL, "glass beads, with smeared surfaces"),
    False: ("bed height", GAS_BY_KERNEL, "small gas bed, with sharp surfaces"),
}
"""What changes with the kernel, and the bed that it was measured in: in a liquid, or in a gas."""


class Change(NamedTuple):
    """By what a result changed in a bed of the validation."""

    name: str
    value: float
    error: float  # standard error
    table: str  # of `docs/tables`
    row: str  # that it is read from: a ratio, or a value with its reference
    bed: str
    surface: str

    def note(self, surface: str) -> str:
        """Standard error and bed, in words, for a case with sharp or smeared surfaces."""
        other = "" if surface == self.surface else f", with {self.surface} surfaces"
        return f"+- {self.error:.2g}, {self.bed}{other}"


STEPS = "smooth, 1e+05 Pa: {}, fluid step over a tenth of it"

LIQUID = (
    Change("tenth of fluid step: collisions", 1.002, 0.005, "bed-steps", STEPS.format("collisions of a sphere"),
           "film study", "sharp"),
    Change("the same: granular temperature", 1.003, 0.0088, "bed-steps", STEPS.format("granular temperature"),
           "film study", "sharp"),
    Change("cells finer by 1.5: bed height", 0.990, 0.0026, "beds",
           "liquid bed, cells finer by 1.5: height over the reference run", "alginate bed", "sharp"),
)  # fmt: skip
"""Beds in a liquid."""

SMALL = ("small gas bed", "sharp")
QUARTER, FINER = "0.125 ms, 2.40 d, 1.2 s: {}", "0.5 ms, 1.71 d, 2.2 s: {}"
HEIGHT, DROP, DEVIATION = "mean height", "pressure drop over weight", "its deviation in time"

GAS = (
    Change("quarter of fluid step: bed height", 1.001, 0.0083, "gas-bed-steps", QUARTER.format(HEIGHT), *SMALL),
    Change("the same: pressure drop", 0.998, 0.0042, "gas-bed-steps", QUARTER.format(DROP), *SMALL),
    Change("the same: its deviation in time", 1.005, 0.019, "gas-bed-steps", QUARTER.format(DEVIATION), *SMALL),
    Change("cells finer by 1.4: bed height", 0.964, 0.0042, "gas-bed-steps", FINER.format(HEIGHT), *SMALL),
    Change("the same: pressure drop", 1.025, 0.0074, "gas-bed-steps", FINER.format(DROP), *SMALL),
    Change("the same: its deviation in time", 0.863, 0.021, "gas-bed-steps", FINER.format(DEVIATION), *SMALL),
)
"""Beds in a gas: one of 2 000 seeds of the case `gas-bed`, 12 diameters high."""


def accuracy(case: Case, bed: BedEstimate, steps: StepEstimate) -> Iterator[tuple[str, float, str, str]]:
    """Name, value, unit and note of what the cells, the kernel and the fluid step of a case change.

    Only of beds on a grid, with the kernel; nothing of what was not measured: a bed without flow from below that is not
    fixed, one beside inlets in its sides, and one that particles leave.
    """
    width = case.laws.kernel_width * case.bed.largest_diameter
    if steps.cells is None or not case.resists or case.is_one_sphere or width == 0.0:
        return
    sharp = case.surface == "sharp"
    cell = max(length / count for length, count in zip(case.column.size, steps.cells) if count > 1)
    yield "filter width / kernel", widening(cell / width, case.surface), "", "of what drag sees; cells widen it"
    if math.isnan(bed.archimedes) or _is_no_plain_bed(case):
        return
    if case.stands_still or 0.0 < bed.inlet <= bed.onset:
        high = bed.height / case.column.height * steps.cells[2]
        table, at = (PACKED_SHARP, cell / case.bed.diameter) if sharp else (PACKED_SMEARED, high)
        measured = "a lattice of six layers" if sharp else f"fixed beds, here {high:.2g} cells"
        yield "packed bed: pressure drop / law", between(table, at), "", f"as measured in {measured}"
        return
    if bed.inlet == 0.0:
        return
    for figure in LIQUID if case.in_liquid else GAS:
        yield figure.name, figure.value, "", figure.note(case.surface)
    quantity, by_kernel, bed_of_it = OF_KERNEL[case.in_liquid]
    own = case.laws.kernel_width
    if own != 1.5 and by_kernel[0][0] <= own <= by_kernel[-1][0]:
        yield f"this kernel: {quantity}", between(by_kernel, own), "", f"over 1.5 d, {bed_of_it}"


def _is_no_plain_bed(case: Case) -> bool:
    """Whether particles leave the bed, or fluid enters through its sides."""
    patches = case.patches.values()
    leave = bool(case.outlet) or any(patch.particles == "leave" for patch in patches)
    return leave or any(patch.kind == "inlet" and patch.side not in ENDS for patch in patches)


def widening(cell: float, surface: str) -> float:
    r"""Standard deviation of the filter of what the drag sees, over that of the kernel [-].

    .. math:: \sqrt{\max(1, h^2/6\sigma^2) + h^2/6\sigma^2}

    with smeared surfaces. With sharp ones, whose cells are up to four times finer, the root of
    :math:`\max(1, h^2/48\sigma^2)`.

    cell     over the standard deviation of the kernel [-]
    surface  "smeared" or "sharp"

    >>> round(widening(2.0, "smeared"), 2), widening(2.0, "sharp")
    (1.29, 1.0)
    """
    own = cell**2 / 6.0
    return math.sqrt(max(1.0, own) + own if surface == "smeared" else max(1.0, own / 8.0))


def between(table: tuple[tuple[float, float], ...], at: float) -> float:
    """Value of a table of (place, value), linear between its places and constant beyond them.

    >>> between(((1.0, 0.5), (3.0, 0.7)), 2.0)
    0.6
    """
    if at <= table[0][0]:
        return table[0][1]
    for (low, first), (high, last) in pairwise(table):
        if at <= high:
            return first + (last - first) * (at - low) / (high - low)
    return table[-1][1]
