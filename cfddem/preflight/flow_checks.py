"""Checks of cell size, filter kernel, inlet flow and drag law."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from cfddem.case.bed import Jet
from cfddem.case.schema import Case
from cfddem.case.vessel import vessel_of
from cfddem.fluid.cell_counts import cell_counts, suggested_cells
from cfddem.preflight.bed_estimate import BedEstimate, share_of_jet
from cfddem.preflight.geometry_checks import bed_key, unit_of_velocity
from cfddem.preflight.issue import Issue, percent, plain
from cfddem.preflight.step_estimate import StepEstimate
from cfddem.preflight.wall_checks import MOST_CELLS

SMALLEST_KERNEL, NARROW_KERNEL = 1.0, 2.0
"""Width of a box of the same variance as the kernel, over the diameter.

Below the first, a sphere has more volume than its kernel can hold; below the second, the voidage is poor [-].
"""

OF_SPHERE = 1.0 / math.sqrt(20.0)
"""Standard deviation of the volume of a sphere along a line, over the diameter; a narrower kernel is none [-]."""

FINEST = 6.0
"""More cells than this per standard deviation of the kernel cost time and resolve nothing more [-]."""

FEWEST_DIAMETERS = 2.0
"""Smallest cell over the Sauter mean diameter whose averages have a meaning [-]."""

UNEQUAL = 1.2
"""Ratio of species diameters from which a drag law should depend on the diameter ratio [-]."""

INEXACT_JET = 0.1
"""Difference between the flow of a jet and that through the cells that it covers, over the first, for a warning [-]."""

FEWEST_CELLS = 4.0
"""Fewest cells over the height of a fluidised bed and over the wider side of its column [-]."""

PROFILE_RANGE = 2.0
"""Ratio of `viscosity_profile` to `viscosity` inside the bed from which estimates mislead [-]."""


def check_kernel(case: Case, steps: StepEstimate) -> Iterator[Issue]:
    """Check that the filter kernel is wide enough for a particle, and the cells not needlessly small."""
    assert steps.cells is not None
    width, widest = case.laws.kernel_width, max(case.column.size[:2])
    across = 2.0 * width * case.bed.largest_diameter
    if 0.0 < width < OF_SPHERE:
        yield Issue(
            "warning", "laws.kernel_width",
            f"{width:.3g} diameters is narrower than a sphere, whose volume has a standard deviation of "
            f"{OF_SPHERE:.2g}: it filters nothing",
            "use 1.5, the default, or 0 for no kernel",
        )  # fmt: skip
    if across > widest and not case.is_one_sphere:
        yield Issue(
            "warning", "laws.kernel_width",
            f"{width:.3g} diameters reach {0.5 * across:.3g} m to each side; the column is {widest:.3g} m wide",
            "use 1.5, the default, or a wider column",
        )  # fmt: skip
    spacing = [length / count for length, count in zip(case.column.size, steps.cells) if count > 1]
    yield from _check_smallest_cell(case, min(spacing, default=min(case.column.size)))


def suggested_cell(case: Case, wanted: float | None = None) -> str:
    """A cell that fits the column along x, y and z and that the check does not object to, in words.

    wanted  size that it should have; default: that of the case [m]
    """
    widths = case.column.cell_edges if wanted is None else (wanted,) * 3
    return suggested_cells(case.column.size, widths, lambda edge: not any(_check_smallest_cell(case, edge, False)))


def _check_smallest_cell(case: Case, smallest: float, suggests: bool = True) -> Iterator[Issue]:
    """Check the smallest edge of a cell [m] against the kernel and the particles.

    suggests  whether the remedy names a cell of the column
    """
    diameter = case.bed.largest_diameter

    def cells(wanted: float) -> str:
        return suggested_cell(case, wanted) if suggests else ""

    divided, kernel = case.laws.mapping == "divided", case.laws.kernel_width * diameter
    own = 0.0 if divided else 1.0 / math.sqrt(6.0)
    sphere = OF_SPHERE * diameter if divided else 0.0
    deviation = max(kernel, own * smallest, math.hypot(sphere, smallest / math.sqrt(12.0)))
    width = math.sqrt(12.0) * deviation / diameter
    if width < NARROW_KERNEL:
        yield Issue(
            "error" if width < SMALLEST_KERNEL else "warning", "column.cell",
            f"{smallest:.3g} m distributes a particle over {width:.2g} diameters; use at least {NARROW_KERNEL:g}",
            f"use larger cells ({cells(3.0 * diameter)}), or laws.kernel_width = 1.5",
        )  # fmt: skip
    elif smallest < FEWEST_DIAMETERS * case.bed.diameter * (1.0 - 1e-9):
        yield Issue(
            "warning", "column.cell",
            f"{smallest:.3g} m is {smallest / case.bed.diameter:.3g} times the diameter; averages over cells below "
            f"{FEWEST_DIAMETERS:g} diameters have no meaning",
            f"use larger cells: {cells(FEWEST_DIAMETERS * case.bed.diameter)}",
        )  # fmt: skip
    if kernel > FINEST * smallest:
        yield Issue(
            "warning", "column.cell",
            f"{smallest:.3g} m is less than 1/{FINEST:g} of the kernel width {kernel:.3g} m, which costs time",
            f"use larger cells: {cells(2.0 * diameter)}", False,
        )  # fmt: skip


def check_cells(case: Case, bed: BedEstimate, steps: StepEstimate) -> Iterator[Issue]:
    """Check that a fluidised bed is several cells high, and its column several cells wide."""
    if case.is_one_sphere or case.bed.positions or case.wall or not bed.inlet > bed.onset:
        return
    assert steps.cells is not None
    cells, high = max(steps.cells[:2]), bed.height / case.column.height * steps.cells[2]
    if high < FEWEST_CELLS:
        needed = math.ceil(bed.count * FEWEST_CELLS / high)
        yield Issue(
            "warning", bed_key(case, "count"),
            f"the expected bed is {high:.2g} cells high, {bed.height:.3g} m; its flow needs at least {FEWEST_CELLS:g}",
            f"use at least {plain(needed)} particles, or a narrower column",
        )  # fmt: skip
    if cells < FEWEST_CELLS:
        yield Issue(
            "warning", "column.width",
            f"{case.column.width:.3g} m is {cells} cells wide; the flow needs at least {FEWEST_CELLS:g}",
            "use a wider column",
        )  # fmt: skip


def check_flow(case: Case, bed: BedEstimate) -> Iterator[Issue]:
    """Check fluid, gravity and boundaries, and that the inlet flow fluidises the bed and keeps it in the column."""
    yield from _check_viscosity(case, bed)
    ends, downward = case.column.ends, case.laws.gravity[2]
    if case.bed.start == "poured" and downward >= 0.0:
        yield Issue(
            "error", "laws.gravity", f"z component {downward:g} m/s2 is not negative, but the bed is poured",
            'point gravity down, or set bed.start = "suspended"',
        )  # fmt: skip
    if ends != "flow" and case.bed.fastest_inflow > 0.0:
        yield Issue(
            "warning", "bed.inlet_velocity", f'unused, because column.ends is "{ends}"', 'set column.ends = "flow"'
        )
    no_flow = ends == "flow" and case.fastest_inflow <= 0.0 and not any(e.pressure for e in case.patch.values())
    stirred = case.drains or case.feed or case.outlet or any(wall.moves for wall in case.wall)
    if no_flow and not stirred and case.bed.start in ("poured", "expanded") and not case.stands_still:
        yield Issue(
            "warning", "bed.inlet_velocity", "0 m/s, and no patch is an inlet: no fluid enters",
            'give it, or a patch of kind = "inlet"; for a bed at rest set column.ends = "closed"',
        )  # fmt: skip
    if ends == "periodic" and math.hypot(*case.laws.gravity) > 0.0:
        yield Issue(
            "warning", "column.ends", "periodic along gravity: particles and fluid accelerate without limit",
            "set laws.gravity = [0.0, 0.0, 0.0]",
        )  # fmt: skip
    if not (case.stands_still or bed.inlet <= 0.0 or (ends != "flow" and not case.patch) or downward == 0.0):
        yield from _check_inlet(case, bed)
    jet, in_a_box = case.bed.jet, not case.line and not vessel_of(case)
    if jet and ends == "flow" and in_a_box:
        yield from _check_jet(case, jet)
    if jet and not (in_a_box or jet.round or jet.depth):
        yield Issue(
            "note", "bed.jet", f"a slot across the whole vessel, {percent(share_of_jet(case, jet))} of its floor",
            "for a nozzle, set bed.jet.round = true; width is then its diameter", False,
        )  # fmt: skip


def _check_jet(case: Case, jet: Jet) -> Iterator[Issue]:
    """Check that the cells of a rectangular floor whose middles a jet covers have its area."""
    size, counts = case.column.size, cell_counts(case.column.size, case.column.cell)
    if counts[0] * counts[1] > MOST_CELLS:
        return
    x, y = ((np.arange(n) + 0.5) * length / n - 0.5 * length for n, length in zip(counts[:2], size))
    covered = int(np.count_nonzero(jet.covers(*np.meshgrid(x, y))))
    floor = size[0] * size[1]
    area, nominal = covered * floor / (counts[0] * counts[1]), share_of_jet(case, jet) * floor
    remedy = 'give it as a patch of kind = "inlet", whose flow does not depend on cells, or fit it to the cells'
    if area == 0.0:
        reason = f"no cell of the floor has its middle within {jet.width:.3g} m, so that nothing would enter"
        yield Issue("error", "bed.jet.width", reason, remedy)
    elif abs(area - nominal) > INEXACT_JET * nominal:
        reason = f"the jet enters through whole cells, {area:.3g} m2; its own area is {nominal:.3g} m2"
        yield Issue("warning", "bed.jet.width", reason, remedy)


def check_wall_drag(case: Case) -> Iterator[Issue]:
    """Check that drag beside walls has a fluid, walls at rest of a known shape, and no sum over several of them."""
    if case.laws.wall_drag == "none":
        return
    if not case.has_fluid:
        yield Issue("warning", "laws.wall_drag", "unused, because the case has no fluid", "leave it out")
    for number, wall in enumerate(case.wall):
        if not wall.form.exact or wall.moves:
            reason = "moves" if wall.form.exact else f"is a {wall.shape}"
            yield Issue("error", "laws.wall_drag", f"wall.{number} {reason}", 'set laws.wall_drag = "none"')
    if case.vessel and case.vessel.shape == "surface":
        reason = "the vessel is a surface from a file"
        yield Issue("error", "laws.wall_drag", reason, 'set laws.wall_drag = "none"')
    in_cells = case.column.shape == "cylinder" or case.thin_walls or any(case.closes_cells(wall) for wall in case.wall)
    if case.has_fluid and in_cells and not (case.vessel and case.vessel.shape == "surface"):
        yield Issue(
            "warning", "laws.wall_drag",
            "beside a round column, a thin wall or a wall with solid cells the grid slows the flow, too: a single "
            "sphere there has up to 8 % too much drag",
            'allow for it in comparisons, or set laws.wall_drag = "none"',
        )  # fmt: skip
    column = case.column
    pairs = column.ends, column.sides, column.sides if column.front is None else column.front
    faces = 2 * sum(pair != "periodic" for pair in pairs) + len(case.wall)
    if case.laws.wall_drag == "all" and case.has_fluid and faces > 1:
        yield Issue(
            "warning", "laws.wall_drag",
            'the sum over several walls is more than their drag: with "all" the spheres of ten Cate et al. (2002) fall '
            'at 0.73 to 0.89 of the measured largest speed, with "nearest" within 2.5 % of it',
            'set laws.wall_drag = "nearest"',
        )  # fmt: skip


def _check_viscosity(case: Case, bed: BedEstimate) -> Iterator[Issue]:
    """Check that drag has a viscosity, and that `viscosity` represents the profile inside the bed."""
    fluid = case.required_fluid
    if fluid.viscosity == 0.0 and case.laws.drag_law is not None:
        yield Issue(
            "error", "fluid.viscosity", "0 Pa s, but drag laws need a viscosity above 0",
            'set the viscosity, or laws.drag = "none"',
        )  # fmt: skip
    if not fluid.viscosity_profile:
        return
    inside = fluid.viscosity_at(np.linspace(0.0, min(bed.height, case.column.height), 50))
    if not fluid.viscosity / PROFILE_RANGE < inside.min() <= inside.max() < PROFILE_RANGE * fluid.viscosity:
        yield Issue(
            "warning", "fluid.viscosity",
            f"estimates use {fluid.viscosity:.3g} Pa s, but viscosity_profile is {inside.min():.3g} to "
            f"{inside.max():.3g} Pa s in the bed",
            "set it to the mean over the bed; the run uses the profile",
        )  # fmt: skip


def _check_inlet(case: Case, bed: BedEstimate) -> Iterator[Issue]:
    """Check the inlet velocity against minimum fluidisation and terminal velocity."""
    inlet = case.bed.inlet_velocity
    of_floor = (f"patch.{name}" for name, patch in case.patch.items() if (patch.kind, patch.side) == ("inlet", "floor"))
    key = next(of_floor, "bed.inlet_velocity")
    if case.laws.gravity[2] * (case.solid_density - case.required_fluid.density) > 0.0:
        names = {case.material_name_of(species) for species in case.species.values()}
        yield Issue(
            "warning", f"material.{names.pop() if len(names) == 1 else 'NAME'}.density",
            f"particles float (mean {case.solid_density:.4g} kg/m3, fluid {case.required_fluid.density:.4g} kg/m3), "
            "and the flow carries them to the lid",
            "reverse laws.gravity",
        )  # fmt: skip
    elif bed.inlet > bed.terminal:
        yield Issue(
            "error" if isinstance(inlet, float) else "warning", key,
            f"{bed.inlet:.3g} m/s is above the terminal velocity {bed.terminal:.3g} m/s: the flow carries the "
            "particles to the lid",
            unit_of_velocity(case, bed)
            or f"use less; fluidisation begins at {bed.onset:.2g} m/s. Or set bed.fixed = true",
        )  # fmt: skip
    elif bed.inlet < bed.onset and case.bed.start in ("poured", "expanded"):
        yield Issue(
            "warning", key,
            f"{bed.inlet:.3g} m/s is below minimum fluidisation, {bed.onset:.3g} m/s: the bed stays packed",
            "use more, or set bed.fixed = true, which runs much faster",
        )  # fmt: skip


def check_drag(case: Case) -> Iterator[Issue]:
    """Check that the drag law suits unequal particles."""
    law = case.laws.drag_law
    if law is None or not case.resists:
        return
    ratios = [species.sauter_diameter / case.bed.diameter for species in case.species.values()]
    if max(ratios) > UNEQUAL * min(ratios) and "diameter_ratio" not in law.arguments:
        yield Issue(
            "warning", "laws.drag",
            f"{law.name} is for equal spheres, but species diameters differ by a factor of "
            f"{max(ratios) / min(ratios):.3g}",
            'use "beetstra_polydisperse": the drag on each size decides which species sinks',
        )  # fmt: skip
