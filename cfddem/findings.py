"""What speaks against a run before it begins: red where it cannot come out right, amber where it may not."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import Literal

import numpy as np

from cfddem.bed import POURED_SOLID_FRACTION
from cfddem.case import Case
from cfddem.expected import LIQUID, Bed, Cost, Encounter, Steps
from cfddem.finding import Finding
from cfddem.findings_flow import of_the_drag, of_the_flow, of_the_kernel

DENSEST = 0.64
"""Solid fraction of a random close packing: no bed of equal spheres is denser."""

SUSPENDED = math.pi / 6.0 / 1.02**3
"""Solid fraction that a cubic lattice holds with a fiftieth of a diameter between neighbours."""

DEEP, DEEPEST = 0.02, 0.1
"""Overlap over the diameter: from the first on contacts are soft, from the second spheres pass into each other."""

LIGHT_GAS, VISCOUS_GAS, THIN_LIQUID, LIGHT_SOLID, SOFT_SOLID = 5.0, 1e-4, 5e-5, 10.0, 1e4
"""Gases lighter than the first [kg/m3] are less viscous than the second [Pa s], common liquids more than the third,
common solids denser than the fourth [kg/m3] and stiffer than the last [Pa]; else the number may be in other units."""

LONG, ENDLESS = 86_400.0, 365.0 * 86_400.0
"""A run that takes longer than a day is worth a second thought; one of a year will not end [s]."""


def findings(case: Case, bed: Bed, pair: Encounter, steps: Steps, cost: Cost) -> list[Finding]:
    """All that speaks against a run, red first; a particle that is larger than the column makes all else idle."""
    too_large = list(_size(case))
    if too_large:
        return too_large
    found = [
        *_units(case),
        *_room(case, bed),
        *_particles(case),
        *_contacts(case, pair),
        *_surfaces(case),
        *_steps(case, steps),
        *_cost(case, cost),
    ]
    if case.fluid is not None:
        found += [*of_the_kernel(case, steps), *of_the_flow(case, bed), *of_the_drag(case, bed)]
    return sorted(found, key=lambda each: each.colour != "red")


def _size(case: Case) -> Iterator[Finding]:
    """Does one particle fit into the column?"""
    diameter, narrowest = case.bed.largest, min(case.column.size)
    if diameter > narrowest * (1.0 + 1e-9):
        yield Finding(
            "red", _key(case, "diameter"), f"{diameter:.3g} m is more than the column's {narrowest:.3g} m",
            "widen the column, or give both in metres",
        )  # fmt: skip


def _units(case: Case) -> Iterator[Finding]:
    """Are densities and viscosities of a size that fluids and solids have in SI units?"""
    fluid = case.fluid
    if fluid is not None and fluid.density < LIGHT_GAS and fluid.viscosity > VISCOUS_GAS:
        yield Finding(
            "amber", "fluid.density", f"{fluid.density:.3g} kg/m3 is that of a gas, {fluid.viscosity:.3g} Pa s is not",
            "water has 1000 kg/m3 and 1e-3 Pa s, air 1.2 and 1.8e-5",
        )  # fmt: skip
    if fluid is not None and fluid.density >= LIQUID and 0.0 < fluid.viscosity < THIN_LIQUID:
        yield Finding(
            "amber", "fluid.viscosity", f"{fluid.viscosity:.3g} Pa s is less than that of any common liquid",
            "give the dynamic viscosity, water has 1e-3 Pa s; the kinematic one times the density",
        )  # fmt: skip
    for name, solid in case.material.items():
        if solid.density < LIGHT_SOLID:
            yield Finding(
                "amber", f"material.{name}.density", f"{solid.density:.3g} kg/m3 is less than that of any common solid",
                "densities are in kg/m3: glass has 2500",
            )  # fmt: skip
        if solid.youngs_modulus < SOFT_SOLID:
            yield Finding(
                "amber", f"material.{name}.youngs_modulus",
                f"{solid.youngs_modulus:.3g} Pa is less than that of any common solid",
                "moduli are in Pa: glass has 6e10; contact_modulus softens contacts alone",
            )  # fmt: skip


def _room(case: Case, bed: Bed) -> Iterator[Finding]:
    """Do the particles fit into the column, and does the bed?"""
    column, diameter = case.column, case.bed.largest
    fraction = bed.solids / (column.floor_area * column.height)
    most = int(bed.count / fraction * (SUSPENDED if case.bed.start == "suspended" else POURED_SOLID_FRACTION))
    count = _key(case, "count")
    fits = f"at most {most} of these particles fit; take fewer, or a higher column"
    if case.bed.start == "suspended" and fraction > SUSPENDED:
        yield Finding("red", "bed.count", f"solid fraction {fraction:.2f}, above {SUSPENDED:.2f} of a lattice", fits)
    elif fraction > DENSEST:
        yield Finding("red", count, f"voidage {1 - fraction:.2f}, below {1 - DENSEST:.2f} of a packing", fits)
    elif case.bed.start == "poured" and bed.poured_height > column.height - 0.5 * diameter:
        yield Finding(
            "red", count, f"poured to {bed.poured_height:.3g} m, above the lid at {column.height:.3g} m", fits
        )
    elif bed.voidage < 1.0 and bed.height > 0.9 * column.height and case.bed.start == "poured":
        colour: Literal["amber", "red"] = "red" if bed.height > 1.2 * column.height else "amber"
        yield Finding(
            colour, "column.height",
            f"the bed expands to about {bed.height:.3g} m; the lid is at {column.height:.3g} m",
            f"take {1.3 * bed.height:.2g} m, or a slower inlet",
        )  # fmt: skip


def _key(case: Case, word: str) -> str:
    """Where a word about the particles stands in a case."""
    return f"bed.species.NAME.{word}" if case.bed.species else f"bed.{word}"


def _particles(case: Case) -> Iterator[Finding]:
    """Do particles that are placed one by one lie in the column, and apart from each other?"""
    places = np.array(case.bed.positions, float).reshape(-1, 3)
    if not len(places):
        return
    size, radius = np.array(case.column.size), 0.5 * case.bed.diameter
    outside = ~((places >= 0.0) & (places <= size)).all(axis=1)
    if case.column.shape == "cylinder":
        outside |= np.hypot(*(places[:, :2] - 0.5 * size[:2]).T) > 0.5 * size[0]
    if outside.any():
        row = int(np.argmax(outside))
        yield Finding(
            "red", f"bed.positions.{row}",
            f"{[float(f'{x:.4g}') for x in places[row]]} lies outside of the column"
            + (f", as do {int(outside.sum()) - 1} more" if outside.sum() > 1 else ""),
            f"it reaches from 0 to {case.column.size} m",
        )  # fmt: skip
    deepest, rows = 0.0, (0, 0)
    order = np.argsort(places[:, 2])
    for k, row in enumerate(order):
        above = order[k + 1 :]
        above = above[: np.searchsorted(places[above, 2], places[row, 2] + 2.0 * radius)]
        if len(above):
            overlap = 2.0 * radius - np.linalg.norm(places[above] - places[row], axis=1)
            if overlap.max() > deepest:
                deepest, rows = float(overlap.max()), (int(row), int(above[np.argmax(overlap)]))
    if deepest > DEEP * 2.0 * radius:
        yield Finding(
            "red", "bed.positions",
            f"particles {min(rows)} and {max(rows)} overlap by {50.0 * deepest / radius:.3g} % of their diameter",
            "move them apart",
        )  # fmt: skip


def _contacts(case: Case, pair: Encounter) -> Iterator[Finding]:
    """Are contacts stiff enough?"""
    laws, species = case.laws, case.species[pair.species]
    if laws.contact == "linear":
        if laws.normal_stiffness == 0.0:
            yield Finding("red", "laws.normal_stiffness", "0 N/m: nothing keeps particles apart", "give a stiffness")
        return
    if case.bed.fixed:
        return
    both = {
        "impacts at the reference speed press": (pair.overlap, 2.5),
        "the bed's weight presses": (pair.resting_overlap, 1.5),
    }
    what, (overlap, power) = max(both.items(), key=lambda each: each[1])
    part, solid = overlap / species.diameter, case.material_of(species)
    if part > DEEP:
        softer = solid.contact_modulus or solid.youngs_modulus
        yield Finding(
            "red" if part > DEEPEST else "amber", "material.contact_modulus",
            f"{what} spheres {100.0 * part:.2g} % of a diameter into each other; more than {100.0 * DEEP:g} % is soft",
            f"take {softer * (part / (0.5 * DEEP)) ** power:.1g} Pa",
        )  # fmt: skip


def _surfaces(case: Case) -> Iterator[Finding]:
    """Do the laws of rolling and of adhesion find what they need in the materials, and the materials their laws?"""
    laws, materials = case.laws, case.material.values()
    if laws.cohesion != "none" and case.has_films:
        yield Finding(
            "red", "laws.cohesion", f"{laws.cohesion} is the adhesion of dry solids, but there are films",
            'laws.lubrication = "none"',
        )  # fmt: skip
    if laws.cohesion != "none" and laws.contact != "hertz":
        yield Finding("red", "laws.cohesion", "linear springs do not adhere", 'laws.contact = "hertz"')
    for key, law, none, needed in (
        ("rolling", laws.rolling, "free", "rolling_friction"),
        ("cohesion", laws.cohesion, "none", "surface_energy"),
    ):
        found = max(getattr(each, needed) for each in materials) > 0.0
        if law != none and not found:
            yield Finding(
                "amber", f"laws.{key}", f"{law} without effect: no material has it", f"give material.{needed}"
            )
        if law == none and found:
            yield Finding("amber", f"material.{needed}", f'not used: laws.{key} is "{none}"', f"choose laws.{key}")


def _steps(case: Case, steps: Steps) -> Iterator[Finding]:
    """Can the physics follow the steps?"""
    given, read = case.run.step, steps.clocks
    if given is not None and given > read.limit and not case.bed.fixed:
        yield Finding(
            "red", "run.step",
            f"{given:.3g} s is above the stability limit {read.limit:.3g} s of the {read.binding} clock",
            f"take {read.recommended:.2g} s, or leave it out",
        )  # fmt: skip
    elif given is not None and given > 1.5 * read.recommended:
        yield Finding(
            "amber", "run.step",
            f"{given:.3g} s is stable, but long beside the {read.recommended:.2g} s of 2 % of a collision",
            f"take {read.recommended:.2g} s, or leave it out",
        )  # fmt: skip
    if case.run.average_from is not None and case.run.average_from >= case.run.until:
        yield Finding(
            "amber", "run.average_from", f"{case.run.average_from:g} s is not before the end, {case.run.until:g} s",
            "means will be of the last row alone; begin them earlier",
        )  # fmt: skip


def _cost(case: Case, cost: Cost) -> Iterator[Finding]:
    """Does it fit into this machine, and into a day?"""
    there = memory()
    if cost.memory > 0.5 * there:
        yield Finding(
            "red" if cost.memory > there else "amber", "column.cell" if cost.of_cells else "bed.count",
            f"needs about {cost.memory / 1e9:.3g} GB of memory; this machine has {there / 1e9:.3g} GB",
            "take fewer particles, or larger cells",
        )  # fmt: skip
    if cost.seconds > LONG:
        yield Finding(
            "red" if cost.seconds > ENDLESS else "amber", "run.until",
            f"takes about {cost.seconds / LONG:.2g} days on one core",
            "soften material.contact_modulus, take fewer particles, or a shorter run",
        )  # fmt: skip
    if cost.disk > 50e9 or cost.snapshots > 100_000:
        yield Finding(
            "amber", "run.every", f"writes {cost.snapshots:.3g} snapshots of together about {cost.disk / 1e9:.2g} GB",
            "write less often",
        )  # fmt: skip


def memory() -> float:
    """Memory of this machine [byte]; infinite where it cannot be known."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return math.inf
