"""The numbers of the pre-run check, group by group."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.backend.tables import line_width
from cfddem.case.feeds import fed_count, feed_rate
from cfddem.case.schema import Case
from cfddem.case.vessel import vessel_of
from cfddem.case.walls import CaseWall
from cfddem.fluid.cell_counts import cell_counts
from cfddem.model.triangles import is_closed
from cfddem.preflight.accuracy import accuracy
from cfddem.preflight.bed_estimate import BedEstimate, bed_drag, bubbles, net_downward_forces
from cfddem.preflight.collision_estimate import CollisionEstimate, WetEstimate
from cfddem.preflight.step_estimate import CostEstimate, StepEstimate
from cfddem.preflight.wall_checks import MOST_CELLS, area_by_cells, closed_cells, largest_rate
from closures import timescales
from closures.bed import ergun_gradient

MOST_CUT = 100_000
"""Cells above which the check does not look for those that a vessel cuts."""


@dataclass(frozen=True)
class Row:
    """One number of the overview."""

    group: str
    name: str
    value: float
    unit: str = ""
    note: str = ""

    def lines(self) -> list[str]:
        """The number as text, at most 100 columns wide; a long note goes on below."""
        opening = f"  {self.name:<34} {_number(self.value):>10} {self.unit:<5} "
        return textwrap.wrap(
            opening + self.note, line_width(), subsequent_indent=" " * len(opening), break_long_words=False
        )


def overview(
    case: Case,
    bed: BedEstimate,
    collision: CollisionEstimate,
    wet: WetEstimate | None,
    steps: StepEstimate,
    cost: CostEstimate,
) -> tuple[Row, ...]:
    """All rows of the overview in order."""
    return (
        *_particles_and_flow(case, bed),
        *_species(case, bed),
        *_contacts(case, collision, steps.particle),
        *_bridges(wet),
        *(Row(*fields) for table in case.feature_tables for fields in table.numbers(case, bed)),
        *_equipment(case, bed),
        *_time_scales(case, bed, steps),
        *_expected(case, bed),
        *(Row("accuracy, where it was measured", *fields) for fields in accuracy(case, bed, steps)),
        *_cost(cost),
    )


def _particles_and_flow(case: Case, bed: BedEstimate) -> Iterator[Row]:
    group = "particles and flow"
    yield Row(group, "particles", bed.count)
    if not case.has_fluid:
        return
    cell = case.column.cell if isinstance(case.column.cell, float) else min(case.column.cell)
    several = bool(case.bed.species)
    largest, mean = case.bed.largest_diameter, case.bed.diameter
    note = f"of the largest spheres; {cell / mean:.3g} by the Sauter mean" if largest > 1.001 * mean else ""
    yield Row(group, "cell / diameter", cell / largest, "", "of the largest species" if several else note)
    yield Row(group, "density ratio", case.solid_density / case.around.density, "", "solid over fluid")
    if math.isnan(bed.archimedes):
        return
    yield Row(group, "Re_p", bed.reynolds, "", f"Reynolds number at {'inlet' if bed.inlet else 'terminal'} velocity")
    yield Row(group, "Ar", bed.archimedes, "", "Archimedes number")
    if surface := case.surface_in_words:
        yield Row(group, "surface of the bed", math.nan, "", surface)
    if case.stands_still:
        return
    law = bed_drag(case).__name__
    yield Row(group, "u_mf", bed.onset, "m/s", f"minimum fluidisation by {law}")
    single = "slowest species alone" if several else "single particle"
    yield Row(group, "u_t", bed.terminal, "m/s", f"{single}, Brown and Lawler")
    if math.isfinite(bed.terminal_by_law):
        yield Row(group, "u_t, drag law", bed.terminal_by_law, "m/s", f"{single}, {law}")
    if bed.inlet and bed.onset and bed.terminal:
        yield Row(group, "u / u_mf", bed.inlet / bed.onset)
        yield Row(group, "u / u_t", bed.inlet / bed.terminal)


def _species(case: Case, bed: BedEstimate) -> Iterator[Row]:
    if not case.bed.species:
        return
    group, total = "species", sum(case.volumes.values())
    forces = net_downward_forces(case, bed.inlet, bed.voidage) if bed.inlet > bed.onset else {}
    for name, species in case.species.items():
        yield Row(group, f"{name}: particles", case.counts[name])
        yield Row(group, f"{name}: volume share", case.volumes[name] / total)
        yield Row(group, f"{name}: diameter / mean", species.sauter_diameter / case.bed.diameter, "", "Sauter means")
        if name in forces:
            note = f"{'sinks' if forces[name] > 0.0 else 'rises'} in the homogeneous mixture"
            yield Row(group, f"{name}: net force / weight", forces[name], "", note)


COLLISIONS = "collisions and film"


def _contacts(case: Case, collision: CollisionEstimate, step: float) -> Iterator[Row]:
    """Numbers of contacts, without those of collisions and films where no particle moves."""
    if case.bed.fixed:
        return
    group, diameter = COLLISIONS, case.species[collision.species].diameter
    if not case.stands_still:
        yield from _collisions_and_film(case, collision, step)
    if case.laws.contact_law.takes("contact_modulus"):
        yield Row(group, "contact modulus / real", collision.softening)
    if not case.stands_still:
        yield Row(group, "overlap / diameter", collision.overlap / diameter, "", "largest, dry collision")
        if collision.softening < 1.0:
            yield Row(group, "overlap / diameter, real", collision.real_overlap / diameter, "", "with the real modulus")
    resting = collision.resting_overlap / diameter
    yield Row(group, "overlap / diameter, at rest", resting, "", "under the weight of the bed")


def _collisions_and_film(case: Case, collision: CollisionEstimate, step: float) -> Iterator[Row]:
    group = COLLISIONS
    note = f"between particles of {collision.species}" if case.bed.species else ""
    yield Row(group, "collision speed", collision.speed, "m/s", note)
    if films := case.laws.film_in_words(case.around):
        yield Row(group, "lubrication films", math.nan, "", films)
    if collision.gap > 0.0:
        law = case.laws.pair_laws.get("minimum_gap")
        film = "elastic deformation of the solids" if law is None else law.name
        source = film if collision.film_gap > collision.roughness_gap else "roughness"
        yield Row(group, "St", collision.stokes, "", "Stokes number, inertia over film resistance")
        yield Row(group, "minimum gap", collision.gap, "m", f"set by {source}")
        yield Row(group, "minimum gap / roughness", collision.gap / collision.roughness_gap)
        if collision.softening < 1.0:
            note = "if films used the contact modulus"
            yield Row(group, "minimum gap, softened", collision.softened_gap, "m", note)
    if collision.film_damping_rate > 0.0:
        note = "of the smallest particles at the smallest gap; films limit no step"
        yield Row(group, "damping number X, largest", collision.film_damping_rate * step, "", note)


def _bridges(wet: WetEstimate | None) -> Iterator[Row]:
    if wet is None:
        return
    group = "liquid bridges"
    yield Row(group, "liquid / particle volume", wet.content, "", "at the start, all particles")
    yield Row(group, "film thickness", wet.film, "m", "on a wet particle")
    yield Row(group, "bridge volume / R^3", wet.volume_ratio, "", "between two wet particles")
    carried = "; bridges carry particles" * (wet.bond > 1.0)
    yield Row(group, "Bo_g", wet.bond, "", f"granular Bond number{carried}")
    yield Row(group, "Ca", wet.capillary, "", "capillary number at the collision speed")
    yield Row(group, "St, liquid", wet.stokes, "", "Stokes number at the collision speed")
    yield Row(group, "critical St, Ennis", wet.ennis, "", "(1 + 1/e) ln(film / minimum gap)")
    yield Row(group, "critical St, film of the case", wet.critical, "", wet.regime)
    yield Row(group, "rupture gap", wet.rupture, "m", "slow separation")
    yield Row(group, "capillary time", wet.capillary_time, "s", "period of a pair held by its bridge")
    yield Row(group, "film crossing time", wet.crossing_time, "s", "resistance does not limit the step")
    yield Row(group, "viscous time", wet.relaxation_time, "s", "of a pair at the minimum gap")


def _equipment(case: Case, bed: BedEstimate) -> Iterator[Row]:
    group, counts = "walls and feeds", cell_counts(case.column.size, case.column.cell)
    for number, wall in enumerate(case.wall):
        if wall.file is not None:
            yield Row(group, f"wall {number}: triangles", *_surface(wall))
        circle = wall.form.circle_half_way_up()
        if circle and wall in case.thin_walls and counts[0] * counts[1] <= MOST_CELLS:
            note = "over the true one, half way up: the fluid sees steps; choose a radius that has it near 1"
            yield Row(group, f"wall {number}: area by its cells", area_by_cells(case, *circle), "", note)
        if wall.moves and math.isfinite(wall.fastest):
            yield Row(group, f"wall {number}: largest speed", wall.fastest, "m/s", wall.shape)
    for number, feed in enumerate(case.feed):
        note = f"about {largest_rate(case, feed):.2g} fit through its box"
        yield Row(group, f"feed {number}: particles per second", feed_rate(case, feed), "1/s", note)
    for number, mask in closed_cells(case).items():
        yield Row(group, f"wall {number}: solid cells", int(mask.sum()), "", f"of {mask.size}; stepped for the fluid")
    if case.has_fluid and case.vessel and math.prod(counts) <= MOST_CUT:
        yield from _cut_cells(case, group)
    if (vessel := vessel_of(case)) is not None:
        yield Row(group, "cross-section at the floor", vessel.floor, "m2", "that walls leave open")
        yield Row(group, "cross-section at the bed surface", vessel.area_at(bed.height), "m2")
    if case.feed:
        yield Row(group, "particles at the end, at most", case.particle_count + fed_count(case))


def _cut_cells(case: Case, group: str) -> Iterator[Row]:
    """Cells that the vessel cuts, and how small their parts are."""
    from cfddem.case.column_grid import grid_of  # loads the compiler, which other checks lack
    from cfddem.fluid.cut_cells import open_share

    share = np.asarray(open_share(grid_of(case)), float)
    cut = share[(share > 0.0) & (share < 1.0)]
    half = int((cut < 0.5).sum())
    yield Row(group, "cells cut by the vessel", len(cut), "", f"of {share.size}; smooth for the fluid")
    yield Row(
        group,
        "smallest cut cell / cell",
        float(cut.min(initial=1.0)),
        "",
        f"{half} are less than half open, and merged",
    )


def _surface(wall: CaseWall) -> tuple[float, str, str]:
    """Number of triangles, unit, and whether they enclose a volume."""
    try:
        corners = wall.form.corners()
    except (InputError, OSError, ValueError):  # reported as an error
        return math.nan, "", ""
    closed = is_closed(corners)
    return len(corners), "", "closed" if closed else "open: particles may start on both sides, and pass its edges"


def _time_scales(case: Case, bed: BedEstimate, steps: StepEstimate) -> Iterator[Row]:
    group, scales = "time scales", steps.time_scales
    if not case.stands_still:
        chosen = "given" if case.run.particle_step else "2 % of the Hertz time, at most half the limit"
        yield Row(group, "particle step", steps.particle, "s", chosen)
        yield Row(group, "2 % of the Hertz time", scales.hertz, "s")
        for name, limit in (("impact", scales.impact), ("crossing", scales.crossing)):
            yield Row(group, f"{name} criterion", limit, "s", "stability limit" * (name == scales.limiting))
    if steps.cells is None or math.isinf(steps.fluid):
        return
    yield Row(group, "fluid step", steps.fluid, "s", f"set by the {steps.limiting} criterion")
    for name, limit in sorted(steps.limits.items(), key=lambda name_and_limit: name_and_limit[1]):
        yield Row(group, f"{name} criterion", limit, "s", "limits the fluid step" * (name == steps.limiting))
    if not case.stands_still:
        yield Row(group, "particle steps per fluid step", steps.substeps)
    if not math.isnan(bed.drag_factor) and 0.0 < bed.voidage < 1.0:
        fluid, density = case.required_fluid, case.solid_density
        relaxation = timescales.drag_time(case.bed.diameter, density, fluid.viscosity, bed.voidage, bed.drag_factor)
        load = (1.0 - bed.voidage) * density / (bed.voidage * fluid.density)
        stiffness = load * steps.fluid / relaxation
        yield Row(group, "beta dt / (eps rho)", stiffness, "", "stiffness of the drag, which is implicit")


def _expected(case: Case, bed: BedEstimate) -> Iterator[Row]:
    group = "expected result"
    if not math.isnan(bed.archimedes) and (case.bed.start == "poured" or bed.inlet):
        note = ""
        if case.stands_still:
            note = "fixed bed"
        elif bubbles(case, bed):
            note = "at least; the bed bubbles"
        elif bed.inlet > bed.onset:
            note = "by the balance of weight and drag"
        elif case.outlet or case.drains:
            note = "at the start, before particles leave"
        yield Row(group, "bed height", bed.height, "m", note)
        yield Row(group, "bed voidage", bed.voidage)
        if bed.inlet:
            packed, law = case.stands_still or bed.inlet < bed.onset, bed_drag(case).__name__
            area = "the floor area" if vessel_of(case) is None else "its mean cross-section"
            yield Row(group, "pressure drop", bed.pressure_drop, "Pa", law if packed else f"buoyant weight over {area}")
            if packed and vessel_of(case) is None and law != "ergun":
                fluid = case.required_fluid
                flow = bed.inlet, case.bed.diameter, fluid.density, fluid.viscosity, bed.voidage
                yield Row(group, "pressure drop, Ergun", ergun_gradient(*flow) * bed.height, "Pa")
    elif case.bed.start == "poured" and (not case.wall or vessel_of(case) is not None):
        yield Row(group, "bed height", bed.height, "m", "poured")
    if case.fastest_by_pressure > 0.0:
        yield Row(group, "free flow by the pressures", case.fastest_by_pressure, "m/s", "at most, without particles")


def _cost(cost: CostEstimate) -> Iterator[Row]:
    group = "cost"
    amount, unit = _duration(cost.seconds)
    yield Row(group, "time on one core", amount, unit, "within a factor of three, without compilation")
    yield Row(group, "memory", cost.memory / 1e9, "GB")
    yield Row(group, "snapshots", cost.snapshots, "", f"{cost.disk / 1e6:.3g} MB on disk")


def _duration(seconds: float) -> tuple[float, str]:
    for length, unit in ((86_400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if seconds > 2.0 * length:
            return seconds / length, unit
    return seconds, "s"


def _number(value: float) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:.0f}" if float(value).is_integer() and abs(value) < 1e7 else f"{value:.4g}"
