"""Checks that particles, bed and patches fit into column and vessel, and that values are in SI units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.case.bed import POURED_SOLID_FRACTION
from cfddem.case.patches import ENDS, PLACES, CasePatch, along, on_the_side, open_share_of
from cfddem.case.schema import Case
from cfddem.case.vessel import on_the_wrong_side, start_behind_a_surface, vessel_of
from cfddem.case.vessel_shape import ROUND_OFF
from cfddem.preflight.bed_estimate import BedEstimate
from cfddem.preflight.issue import Issue, Severity, percent
from cfddem.preflight.wall_checks import enters

RANDOM_CLOSE_PACKING = 0.64
"""Highest solid fraction of a bed of equal spheres [-]."""

SUSPENDED_SOLID_FRACTION = math.pi / 6.0 / 1.02**3
"""Solid fraction of a cubic lattice with gaps of 2 % of the diameter, the densest suspended start [-]."""

LATTICE_SPACING = {"suspended": 1.02, "poured": 1.05}
"""Least distance of neighbouring places of a start over the largest diameter [-]."""

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
    volume = case.floor_area * column.height if vessel is None else float(vessel.volumes[-1])
    fraction = bed.solid_volume / volume
    limit = SUSPENDED_SOLID_FRACTION if start == "suspended" else POURED_SOLID_FRACTION
    remedy = f"at most {int(bed.count / fraction * limit)} of these particles fit; use fewer, or a higher column"
    count = bed_key(case, "count")
    if case.bed.height is not None and case.bed.height > column.height:
        yield Issue(
            "error", "bed.height", f"{case.bed.height:.3g} m is above the lid at {column.height:.3g} m",
            "give both in m, or a higher column",
        )  # fmt: skip
    elif start == "suspended" and fraction > SUSPENDED_SOLID_FRACTION:
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


def check_start_box(case: Case) -> Iterator[Issue]:
    """Check that a given box has places for the particles that start in it; walls in it may leave fewer."""
    bed = case.bed
    if bed.start_corner is None or bed.start_size is None or bed.species or bed.start not in LATTICE_SPACING:
        return
    pitch, edges = LATTICE_SPACING[bed.start] * bed.largest_diameter, list(bed.start_size)
    if bed.start == "poured":  # what the box does not hold starts above it
        if bed.smallest_diameter <= 0.5 * bed.largest_diameter:  # several small ones share a place
            return
        edges[2] = case.column.height - bed.start_corner[2]
    places = math.prod(math.floor(edge / pitch + 1e-9) for edge in edges)
    if places < case.particle_count:
        above = " up to the lid" if bed.start == "poured" else ""
        yield Issue(
            "error", "bed.start_size", f"{case.particle_count} particles start in it; it has room for {places}{above}",
            f"each takes a cube of {pitch:.3g} m; use fewer particles, or a larger box",
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
    outside |= case.beyond_the_side(positions) > 0.0
    if outside.any():
        row = int(np.argmax(outside))
        others = int(outside.sum()) - 1
        yield Issue(
            "error", f"bed.positions.{row}",
            f"{[float(f'{x:.4g}') for x in positions[row]]} lies outside the {'vessel' if case.vessel else 'column'}"
            + (f", and so do {others} more" if others else ""),
            f"the column extends from 0 to {case.column.size} m" + ", the vessel within it" * bool(case.vessel),
        )  # fmt: skip
    for number, wall in enumerate(case.wall):
        with suppress(InputError, OSError, ValueError):
            if (misplaced := on_the_wrong_side(case, number, positions)) is not None:
                row, why, remedy = misplaced
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
    from scipy.spatial import cKDTree

    if len(positions) < 2:
        return 0.0, (0, 0)
    distance, nearest = cKDTree(positions).query(positions, k=2)
    row = int(np.argmin(distance[:, 1]))
    other = next(neighbour for neighbour in nearest[row].tolist() if neighbour != row)
    return max(0.0, 1.0 - float(distance[row, 1]) / diameter), (row, other)


# ---------------------------------------------------------------- units


LIGHT_GAS, VISCOUS_GAS, THIN_LIQUID, LIGHT_SOLID, SOFT_SOLID = 5.0, 1e-4, 5e-5, 10.0, 1e4
"""Plausible values in SI units; others suggest a wrong unit.

Fluids lighter than the first [kg/m3] are less viscous than the second [Pa s]; liquids are more viscous than the third;
solids are denser than the fourth [kg/m3] and stiffer than the last [Pa].
"""

LARGE_TENSION, ROUGH = 3.0, 0.05
"""Surface tension above that of every liquid, molten metals included [N/m]; roughness over the diameter of a particle
above which the surface is no longer that of a sphere [-]."""

LARGE_SURFACE, FITTING = 30.0, 3.0
"""Size of a surface over that of the column above which its file may be in mm, if it is in mm below the second [-]."""

LARGE_PARTICLE, VISCOUS_LIQUID = 0.1, 0.1
"""Diameter [m] and viscosity [Pa s] from which values may have been given in mm and mPa s."""


def check_length(case: Case, refused: bool) -> list[Issue]:
    """Check that the particles are not so large that their diameter is in mm; an error in a case that is refused."""
    diameter, narrowest = case.bed.largest_diameter, min(case.column.size)
    if diameter < LARGE_PARTICLE:
        return []
    beyond = "" if fits(case) else f", more than the column, {narrowest:.3g} m"
    reason = f"{diameter:.3g} m{beyond}; did you mean {1e-3 * diameter:.3g} m ({diameter:.3g} mm)?"
    return [Issue("error" if refused else "warning", bed_key(case, "diameter"), reason, "give all lengths in m")]


def unit_of_velocity(case: Case, bed: BedEstimate) -> str:
    """The unit that an inlet velocity above the terminal velocity suggests, as a question; empty if none."""
    fluid = case.required_fluid
    viscosity = fluid.viscosity
    if fluid.is_liquid and viscosity >= VISCOUS_LIQUID:
        return f"viscosity {viscosity:g} Pa s is {viscosity / 1e-3:.0f} times that of water; is it in mPa s?"
    if bed.onset < 1e-3 * bed.inlet < bed.terminal:
        return f"is it in mm/s? {1e-3 * bed.inlet:.3g} m/s fluidises the bed"
    return ""


def check_scales(case: Case) -> Iterator[Issue]:
    """Check that no surface file is so large that it may be in mm; an error where none of it lies in the column."""
    size = np.array(case.column.size)
    for number, wall in enumerate(case.wall):
        if wall.file is None or wall.scale != 1.0:
            continue
        try:
            corners = wall.form.corners()
        except (InputError, OSError, ValueError):  # a surface that cannot be read is reported elsewhere
            continue
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        times = float((high - low).max() / size.max())
        if not LARGE_SURFACE < times < 1e3 * FITTING:
            continue
        near = enters(corners, size)
        ends = " to ".join(f"({', '.join(f'{coordinate:.4g}' for coordinate in corner)})" for corner in (low, high))
        where = "is" if near else "lies outside the column and is"
        yield Issue(
            "warning" if near else "error", f"wall.{number}.scale",
            f"the surface, from {ends} m, {where} {times:.3g} times as large; is the file in millimetres?",
            "scale = 0.001 reads it in mm",
        )  # fmt: skip


def check_units(case: Case) -> Iterator[Issue]:
    """Check that densities, viscosities and moduli are plausible in SI units."""
    fluid = case.around
    if fluid.density < LIGHT_GAS and fluid.viscosity > VISCOUS_GAS:
        yield Issue(
            "warning", "fluid.density",
            f"{fluid.density:.3g} kg/m3 is that of a gas, but {fluid.viscosity:.3g} Pa s is not",
            "water has 1000 kg/m3 and 1e-3 Pa s, air 1.2 kg/m3 and 1.8e-5 Pa s",
        )  # fmt: skip
    if fluid.is_liquid and 0.0 < fluid.viscosity < THIN_LIQUID:
        yield Issue(
            "warning", "fluid.viscosity", f"{fluid.viscosity:.3g} Pa s is below that of any common liquid",
            "give the dynamic viscosity, the kinematic one times the density; water has 1e-3 Pa s",
        )  # fmt: skip
    if case.liquid is not None and case.liquid.surface_tension > LARGE_TENSION:
        tension = case.liquid.surface_tension
        yield Issue(
            "error", "liquid.surface_tension", f"{tension:.3g} N/m is above that of any liquid; did you mean "
            f"{1e-3 * tension:.3g} N/m ({tension:.3g} mN/m)?", "water has 0.072 N/m",
        )  # fmt: skip
    smallest: dict[str, float] = {}
    for species in case.species.values():
        name = case.material_name_of(species)
        smallest[name] = min(species.diameter, smallest.get(name, species.diameter))
    for name, diameter in smallest.items():
        rough = case.material[name].roughness
        if rough > ROUGH * diameter:
            yield Issue(
                "error", f"material.{name}.roughness",
                f"{rough:.3g} m is {percent(rough / diameter)} of the diameter; the limit is {percent(ROUGH)}",
                "give it in m; smooth glass has about 1e-7",
            )  # fmt: skip
    for name, solid in case.material.items():
        if solid.density < LIGHT_SOLID:
            yield Issue(
                "warning", f"material.{name}.density",
                f"{solid.density:.3g} kg/m3 is below that of any common solid",
                "densities are in kg/m3; glass has 2500",
            )  # fmt: skip
        if solid.youngs_modulus < SOFT_SOLID:
            yield Issue(
                "warning", f"material.{name}.youngs_modulus",
                f"{solid.youngs_modulus:.3g} Pa is below that of any common solid",
                "moduli are in Pa, glass has 6e10; to soften contacts only, set contact_modulus",
            )  # fmt: skip


# ---------------------------------------------------------------- vessels and patches


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
    top = case.vessel.length or max((height for height, _ in case.vessel.line), default=0.0)
    if top > case.column.height * (1.0 + ROUND_OFF):
        in_mm = f"; did you mean {1e-3 * top:.3g} m ({top:.3g} mm)?" * (top > LARGE_SURFACE * case.column.height)
        yield Issue(
            "warning", f"vessel.{'length' if case.vessel.length else 'line'}",
            f"it reaches to {top:.3g} m, above the lid at {case.column.height:.3g} m, where its radius is "
            f"{case.line[-1][1]:.3g} m",
            f"end it at the lid, or raise column.height{in_mm}",
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
                "error", f"patch.{name}", f"it lies outside of the {patch.side} of the column{radius}"
                + f"; its diameter is {patch.diameter or 0.0:g} m" * bool(patch.diameter),
                "move its centre [x, y], in m from the corner of the column, and give its size in m",
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
