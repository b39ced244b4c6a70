"""What speaks against a run with a fluid: cells that are too small for particles, a flow that leaves the bed, drag."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from cfddem.case import Case
from cfddem.expected import LIQUID, Bed, Steps
from cfddem.finding import Finding

NARROWEST_KERNEL, NARROW_KERNEL = 1.0, 2.0
"""Kernel, as a box of equal variance, over the diameter: below the first a sphere overfills its box."""

FINEST = 6.0
"""Cells in the standard deviation of the kernel; more resolve nothing."""

UNEQUAL = 1.2
"""Species whose diameters differ by this and more want a drag law that knows of sizes."""

LAYERED = 2.0
"""Factor between the viscosity in the bed and that of the estimates from which these mislead."""


def of_the_kernel(case: Case, steps: Steps) -> Iterator[Finding]:
    """Is what a particle fills large enough for it?"""
    assert steps.cells is not None
    spacing = [length / count for length, count in zip(case.column.size, steps.cells) if count > 1]
    smallest, diameter = min(spacing, default=min(case.column.size)), case.bed.largest
    own = 0.0 if case.laws.mapping == "divided" else 1.0 / math.sqrt(6.0)
    sphere = diameter / math.sqrt(20.0) if case.laws.mapping == "divided" else 0.0
    deviation = max(case.laws.smoothing * diameter, own * smallest, math.hypot(sphere, smallest / math.sqrt(12.0)))
    width = math.sqrt(12.0) * deviation / diameter
    if width < NARROW_KERNEL:
        yield Finding(
            "red" if width < NARROWEST_KERNEL else "amber", "column.cell",
            f"{smallest:.3g} m spreads a particle over {width:.2g} diameters; a bed needs {NARROW_KERNEL:g}",
            f"take cells of {3.0 * diameter:.2g} m, or laws.smoothing = 1.5",
        )  # fmt: skip
    if case.laws.smoothing * diameter > FINEST * smallest:
        yield Finding(
            "amber", "column.cell",
            f"{smallest:.3g} m is far below the kernel of {case.laws.smoothing * diameter:.3g} m, which costs time",
            f"take cells of {2.0 * diameter:.2g} m or more",
        )  # fmt: skip


def of_the_flow(case: Case, bed: Bed) -> Iterator[Finding]:
    """Does the flow fluidise the bed, and leave it in the column?"""
    assert case.fluid is not None
    inlet, ends = case.bed.inlet_velocity, case.column.ends
    if case.fluid.viscosity == 0.0 and case.laws.drag_law is not None:
        yield Finding(
            "red", "fluid.viscosity", "0 Pa s: drag laws need a viscous fluid", 'set it, or laws.drag = "none"'
        )
    within = case.fluid.viscosity_at(np.linspace(0.0, min(bed.height, case.column.height), 50))
    if (
        case.fluid.viscosity_profile
        and not case.fluid.viscosity / LAYERED < within.min() <= within.max() < LAYERED * case.fluid.viscosity
    ):
        yield Finding(
            "amber", "fluid.viscosity", f"estimates take {case.fluid.viscosity:.3g} Pa s; by viscosity_profile it is "
            f"{within.min():.3g} to {within.max():.3g} Pa s in the bed",
            "give the mean of the bed; the run keeps to the profile",
        )  # fmt: skip
    weight = case.laws.gravity[2] * (case.solid_density - case.fluid.density)
    if case.bed.start == "poured" and case.laws.gravity[2] >= 0.0:
        yield Finding("red", "laws.gravity", "does not point down, but the bed is poured", 'bed.start = "suspended"')
    if ends != "flow" and (case.bed.inlet_speed > 0.0):
        yield Finding(
            "amber", "bed.inlet_velocity", f"is not used, as column.ends = {ends!r}", 'set column.ends = "flow"'
        )
    if ends == "periodic" and math.hypot(*case.laws.gravity) > 0.0:
        yield Finding("amber", "column.ends", "periodic along gravity: all falls faster and faster", "set laws.gravity")
    if case.bed.fixed or bed.inlet <= 0.0 or ends != "flow" or case.laws.gravity[2] == 0.0:
        return
    if weight > 0.0:
        yield Finding(
            "amber", "material.density", "particles float, and the flow lifts them to the lid", "turn gravity"
        )
    elif bed.inlet > bed.terminal:
        yield Finding(
            "red" if isinstance(inlet, float) else "amber", "bed.inlet_velocity",
            f"{bed.inlet:.3g} m/s is above the terminal velocity {bed.terminal:.3g} m/s: the bed is carried to the lid",
            f"the bed is fluid from {bed.onset:.2g} m/s on; or set bed.fixed = true",
        )  # fmt: skip
    elif bed.inlet < bed.onset and case.bed.start == "poured":
        yield Finding(
            "amber", "bed.inlet_velocity", f"{bed.inlet:.3g} m/s is below minimum fluidisation, {bed.onset:.3g} m/s",
            "the bed will stay packed; fixed = true makes that much faster",
        )  # fmt: skip


def of_the_drag(case: Case, bed: Bed) -> Iterator[Finding]:
    """Is the drag law asked inside the range it was fitted to?"""
    law = case.laws.drag_law
    if law is None or case.fluid is None or case.fluid.viscosity == 0.0:
        return
    voidage = bed.voidage if bed.inlet > 0.0 or case.bed.start == "poured" else 1.0
    ratios = [each.sauter / case.bed.diameter for each in case.species.values()]
    values = [("reynolds", bed.reynolds), ("voidage", voidage), *(("diameter_ratio", each) for each in ratios)]
    for name, value in values:
        low, high = law.ranges.get(name, (-math.inf, math.inf))
        if not low <= value <= high:
            yield Finding(
                "amber", "laws.drag", f"{law.name} was fitted for {name} {low:g} to {high:g}; here it is {value:.3g}",
                "cfddem explain lists laws, and cfddem explain NAME says the range of one",
            )  # fmt: skip
    if max(ratios) > UNEQUAL * min(ratios) and case.laws.drag_function(2.0) is law.function:
        yield Finding(
            "amber", "laws.drag",
            f"{law.name} is for equal spheres; here species differ by {max(ratios) / min(ratios):.3g} in diameter",
            "beetstra_polydisperse knows of sizes, on which it hangs who sinks",
        )  # fmt: skip


def bubbles(case: Case, bed: Bed) -> bool:
    """Whether the bed bubbles, so that the laws of even expansion do not hold."""
    return case.fluid is not None and case.fluid.density < LIQUID and bed.inlet > bed.onset
