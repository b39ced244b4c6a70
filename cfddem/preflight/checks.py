"""All checks of a case before it runs: errors where the run will fail, warnings where its results may be wrong."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress

from cfddem.backend.errors import InputError
from cfddem.case.compare import Points, held, points_of, require_measured_unit, steps_of
from cfddem.case.schema import Case
from cfddem.preflight.bed_estimate import BedEstimate
from cfddem.preflight.bed_waves import check_waves
from cfddem.preflight.collision_estimate import CollisionEstimate, WetEstimate, check_wet
from cfddem.preflight.expansion import check_expansion
from cfddem.preflight.flow_checks import check_cells, check_drag, check_flow, check_kernel, check_wall_drag
from cfddem.preflight.geometry_checks import (
    bed_key,
    check_bed_size,
    check_length,
    check_particle_size,
    check_patches,
    check_positions,
    check_scales,
    check_start_box,
    check_units,
    check_vessel,
)
from cfddem.preflight.issue import ORDER, Issue, Severity, percent, plain, rounded_up
from cfddem.preflight.law_ranges import check_ranges
from cfddem.preflight.step_estimate import CostEstimate, StepEstimate, available_memory, estimate_cost, estimate_steps
from cfddem.preflight.wall_checks import check_walls_and_feeds

SOFT_OVERLAP, NOTED_OVERLAP, LARGEST_OVERLAP = 0.02, 0.04, 0.1
"""Overlap over the diameter: above the first a warning, above the last an error [-].

Between the first two it is a note where only the fastest collisions overlap so far, or the flow carries the bed.
Contacts four times stiffer change mean height and pressure drop of a slugging bed (gallery case `defluidisation`) by
+1.0 and -0.3 %, with errors of 2.2 and 0.5 %, and the deviation of the pressure by +16 %, with an error of 21 %
(`cfddem validate beds`).
"""

LONG_STEP = 2.0
"""Particle step over the recommended one above which there is a warning [-].

At 4 % of the Hertz time, the normal rebound of a pair with e = 0.9 differs by 0.002 of the approach speed from that of
a fine step, and its sliding by 0.005 of the first sliding speed. At 8 % they differ by 0.004 and 0.011.
"""

LONG_RUN, DAY, YEAR = 600.0, 86_400.0, 365.0 * 86_400.0
"""Estimated computing time above which a run may get a note, or gets a warning or an error [s]."""


def find_issues(
    case: Case,
    bed: BedEstimate,
    collision: CollisionEstimate,
    wet: WetEstimate | None,
    steps: StepEstimate,
    cost: CostEstimate,
) -> list[Issue]:
    """All errors and warnings of a case, errors first.

    A particle larger than the column, and a surface in mm that lies outside of it, hide all others.
    """
    too_large = list(check_particle_size(case))
    if too_large:
        return check_length(case, refused=True) or too_large
    scales = list(check_scales(case))
    if any(issue.severity == "error" for issue in scales):
        return scales
    issues = [
        *scales,
        *check_units(case),
        *check_bed_size(case, bed),
        *check_start_box(case),
        *check_positions(case),
        *check_overlap(case, bed, collision),
        *check_surface_laws(case),
        *check_gpu(case),
        *check_wall_drag(case),
        *check_wet(case, wet),
        *check_walls_and_feeds(case),
        *check_vessel(case),
        *check_patches(case),
        *check_steps(case, steps),
        *check_cost(case, cost),
        *check_stiffness(case, bed, collision, cost),
        *check_data(case),
        *(Issue(*fields) for table in case.feature_tables for fields in table.issues(case)),
        *(Issue(*fields) for table in case.feature_tables for fields in table.issues_of_bed(case, bed)),
    ]
    if case.has_fluid:
        issues += [*check_kernel(case, steps), *check_cells(case, bed, steps), *check_flow(case, bed)]
        issues += [*check_drag(case), *check_ranges(case, bed), *check_waves(case, bed)]
        issues += check_expansion(case, bed)
    elif (value := case.bed.fastest_inflow) > 0.0:  # patches are refused without a fluid
        key = "bed.jet.velocity" if value > case.bed.highest_inlet_velocity else "bed.inlet_velocity"
        fault = f"{value:g} m/s is unused, because the case has no table [fluid]"
        issues.append(Issue("warning", key, fault, "add that table, or leave the velocity out"))
    issues.sort(key=lambda issue: ORDER.index(issue.severity))
    return [*check_length(case, refused=any(issue.severity == "error" for issue in issues)), *issues]


def check_overlap(case: Case, bed: BedEstimate, collision: CollisionEstimate) -> Iterator[Issue]:
    """Check that contacts are stiff enough."""
    law, species = case.laws.contact_law, case.species[collision.species]
    if case.bed.fixed:
        return
    causes = {
        "collisions at the reference speed": collision.overlap / species.diameter,
        "the weight of the bed": collision.resting_overlap / species.diameter,
    }
    if case.stands_still:  # its contacts bear the weight of the start, and pass heat
        del causes["collisions at the reference speed"]
    cause, part = max(causes.items(), key=lambda cause_and_share: cause_and_share[1])
    if part <= SOFT_OVERLAP:
        return
    solid, carried = case.material_of(species), bed.inlet > bed.onset
    presses = causes["the weight of the bed"] > SOFT_OVERLAP and not carried
    severity: Severity = "error" if part > LARGEST_OVERLAP else "warning"
    effect = f"the limit is {percent(SOFT_OVERLAP)}"
    if case.is_one_sphere and severity == "warning":
        severity, effect = "note", "a single particle meets walls only"
    elif part <= NOTED_OVERLAP and not presses:
        severity, effect = "note", "overlaps of 2 to 4 % change mean heights by about 2 %, fluctuations by more"
        if cause == "the weight of the bed":
            effect = "the flow carries this weight"
    key, remedy = "laws.contact_parameters", f"choose stiffer parameters of the contact law {law.name}"
    if law.takes("contact_modulus"):
        key = f"material.{case.material_name_of(species)}.contact_modulus"
        remedy = "give all values in SI units: m, kg, s, Pa"
        if math.isfinite(needed := needed_modulus(case, collision)):
            beyond = ", and youngs_modulus, too" * (needed > solid.youngs_modulus)
            enough = " for less than 2 %" * (severity == "note")
            remedy = f"use at least {plain(rounded_up(needed))} Pa{enough}{beyond}"
            if severity != "note" and cause == "collisions at the reference speed" and case.run.reference_speed is None:
                remedy += f"; or set run.reference_speed, here {case.reference_speed:.3g} m/s, if collisions are slower"
    reason = f"overlap of {percent(part)} of a diameter under {cause}; {effect}"
    if math.isinf(part):
        reason = "the contacts are too soft: particles pass through each other"
    yield Issue(severity, key, reason, remedy)


def check_stiffness(case: Case, bed: BedEstimate, collision: CollisionEstimate, cost: CostEstimate) -> Iterator[Issue]:
    """Tell that a long run has contacts much stiffer than it needs."""
    species = case.species[collision.species]
    if case.stands_still or case.is_one_sphere or case.run.particle_step is not None or cost.seconds < LONG_RUN:
        return
    solid, needed = case.material_of(species), needed_modulus(case, collision)
    if not 0.0 < needed < 0.1 * (solid.contact_modulus or solid.youngs_modulus):
        return
    key, enough = f"material.{case.material_name_of(species)}.contact_modulus", rounded_up(needed)
    softer = case.with_(**{key: enough})
    seconds = estimate_cost(softer, bed, estimate_steps(softer, bed)).seconds
    if seconds < 0.2 * cost.seconds:
        yield Issue(
            "note", key,
            f"contacts are stiffer than most runs need; with {plain(enough)} Pa the largest overlap is "
            f"{percent(SOFT_OVERLAP)} of a diameter, and the run takes about {seconds / 60.0:.2g} min",
            "films keep the modulus of the solid", False,
        )  # fmt: skip


def needed_modulus(case: Case, collision: CollisionEstimate) -> float:
    """Contact modulus with which no overlap exceeds SOFT_OVERLAP [Pa]; 0 if the contact law has none.

    It scales with the overlap to the power -2.5 at a given speed, and -1.5 under a given load.
    """
    species = case.species[collision.species]
    if not case.laws.contact_law.takes("contact_modulus"):
        return 0.0
    solid = case.material_of(species)
    colliding = 0.0 if case.stands_still else collision.overlap
    parts = ((colliding, 2.5), (collision.resting_overlap, 1.5))
    if math.isinf(max(parts)[0]):
        return math.inf
    softer = solid.contact_modulus or solid.youngs_modulus
    return max(softer * (overlap / species.diameter / SOFT_OVERLAP) ** power for overlap, power in parts)


def check_surface_laws(case: Case) -> Iterator[Issue]:
    """Check that contact law and rolling resistance have material properties, and that no property is unused."""
    laws, contact = case.laws, case.laws.contact_law
    wetting = {"bridges": bool(case.liquid), "films": case.has_films}
    liquid = next((name for name, form in wetting.items() if form), "")
    if contact.adhesive and liquid:
        remedy = {"bridges": "leave out [liquid]", "films": 'set laws.lubrication = "none"'}[liquid]
        yield Issue(
            "error", "laws.contact", f"{contact.name} holds for dry solids, but {liquid} form between particles",
            f"{remedy}, or another contact law",
        )  # fmt: skip
    if case.run.energy_budget and contact.energy is None:
        yield Issue(
            "error", "run.energy_budget", f"the contact law {contact.name} does not give its energy",
            "set it to false, or use another contact law",
        )  # fmt: skip
    for key, law, used, needed in (
        ("rolling_resistance", laws.rolling_resistance, laws.rolling_resistance != "none", "rolling_friction"),
        ("contact", laws.contact, contact.takes("work_of_adhesion"), "surface_energy"),
    ):
        keys = [
            f"material.{name}.{needed}" for name, material in case.material.items() if getattr(material, needed) > 0.0
        ]
        of_pair = "work_of_adhesion" if needed == "surface_energy" else needed
        pairs = {f"pair.{a}.{b}.{of_pair}": properties for a, row in case.pair.items() for b, properties in row.items()}
        keys += [key for key, pair in pairs.items() if getattr(pair, of_pair)]
        if used and not keys:
            yield Issue(
                "warning", f"laws.{key}", f"the {needed} that {law} uses is 0 in every material",
                f"set material.NAME.{needed}",
            )  # fmt: skip
        if keys and not used:
            yield Issue("warning", keys[0], f'unused, because laws.{key} is "{law}"', f"set laws.{key}")


def check_gpu(case: Case) -> Iterator[Issue]:
    """Check that a case whose particles step on a graphics processor has nothing that these steps lack."""
    surfaces = [f"wall.{number}" for number, wall in enumerate(case.wall) if not wall.form.exact]
    others = {
        "liquid": bool(case.liquid),
        "run.energy_budget": case.run.energy_budget,
        "run.record_collisions": case.run.record_collisions,
        "vessel.shape": bool(case.vessel and case.vessel.shape == "surface"),
    } | dict.fromkeys(surfaces, True)
    keys = [key for key, is_there in others.items() if is_there]
    if case.run.gpu and keys:
        yield Issue(
            "error", "run.gpu", f"steps on a graphics processor do not support {', '.join(keys)}",
            "leave them out, or set run.gpu = false",
        )  # fmt: skip


def check_steps(case: Case, steps: StepEstimate) -> Iterator[Issue]:
    """Check that the time step is stable and resolves a collision, and that averages begin before the end."""
    step, scales = None if case.stands_still else case.run.particle_step, steps.time_scales
    remedy = f"use {scales.recommended:.2g} s, or leave it out"
    if step is not None and step > scales.limit:
        yield Issue(
            "error", "run.particle_step",
            f"{step:.3g} s is above the stability limit {scales.limit:.3g} s of the {scales.limiting} criterion",
            remedy,
        )  # fmt: skip
    elif step is not None and step > LONG_STEP * scales.recommended:
        yield Issue(
            "warning", "run.particle_step",
            f"{step:.3g} s is stable, but more than {LONG_STEP:g} times the recommended {scales.recommended:.2g} s, "
            "2 % of the Hertz time: rebounds are inaccurate by 0.5 % or more",
            remedy,
        )  # fmt: skip
    if case.run.history_every is not None and case.run.history_every > 0.5 * case.run.until:
        yield Issue(
            "warning", "run.history_every",
            f"{case.run.history_every:g} s leaves no means in a run of {case.run.until:g} s",
            "give a shorter time, in s",
        )  # fmt: skip
    if case.run.average_from is not None and case.run.average_from >= case.run.until:
        yield Issue(
            "warning", "run.average_from",
            f"{case.run.average_from:g} s is not before the end of the run, {case.run.until:g} s: "
            "averages hold the last value only",
            "start averages earlier",
        )  # fmt: skip


def check_cost(case: Case, cost: CostEstimate) -> Iterator[Issue]:
    """Check that the run fits into the memory of this machine and takes less than a day."""
    available = available_memory()
    if cost.memory > 0.5 * available:
        yield Issue(
            "error" if cost.memory > available else "warning",
            "column.cell" if cost.cells_dominate else bed_key(case, "count"),
            f"needs about {cost.memory / 1e9:.3g} GB of memory; this machine has {available / 1e9:.3g} GB",
            "use fewer particles, or larger cells", False,
        )  # fmt: skip
    if cost.seconds > DAY:
        yield Issue(
            "error" if cost.seconds > YEAR else "warning", "run.until",
            f"takes about {cost.seconds / DAY:.2g} days on one core",
            "lower material.NAME.contact_modulus, use fewer particles, or a shorter run", False,
        )  # fmt: skip
    if cost.disk > 50e9 or cost.snapshots > 100_000:
        yield Issue(
            "warning", "run.every", f"writes {cost.snapshots:.3g} snapshots, together about {cost.disk / 1e9:.2g} GB",
            "write snapshots less often", False,
        )  # fmt: skip


# ---------------------------------------------------------------- measured data


def check_data(case: Case) -> Iterator[Issue]:
    """Check that measured data can be read, and lie within the run."""
    for name, data in case.compare.items():
        key = f"compare.{name}"
        try:
            points = points_of(name, data)
        except InputError as failure:
            yield _error(key, failure)
            continue
        if points.against == "inlet_velocity":
            yield from _check_velocities(case, key, points)
            continue
        end, unit = (case.run.until, "s") if points.against == "time" else (case.column.height, "m")
        if points.against and not ((points.place >= 0.0) & (points.place <= end)).any():
            low, high = points.place.min(), points.place.max()
            reason = f"all points lie at {low:.3g} to {high:.3g} {unit}, outside of 0 to {end:.3g} {unit}"
            yield Issue("warning", key, reason, "check the unit of the column, or change the case")


def check_quantities(case: Case, units: Mapping[str, str]) -> Iterator[Issue]:
    """Check that the run will have the measured quantities, in the same units.

    units  of the columns of its history, by their names
    """
    for name, data in case.compare.items():
        with suppress(InputError):  # a file that cannot be read is reported above
            points = points_of(name, data)
            try:
                require_measured_unit(points, units)
            except InputError as failure:
                yield _error(f"compare.{name}", failure)


def _error(key: str, failure: InputError) -> Issue:
    value = "" if failure.value is None else f" = {failure.value!r}"
    field = failure.field.removeprefix(f"{key} ").removeprefix(f"{key}.")
    return Issue("error", key, f"{field}{value} must be {failure.limit}", failure.remedy or "correct the file")


def _check_velocities(case: Case, key: str, points: Points) -> Iterator[Issue]:
    """Check that the case holds the velocities of measured points."""
    are_held = held(case.bed.inlet_velocity, case.run.until, points.place)
    if not are_held.all():
        some = f"only {are_held.sum()} of" if are_held.any() else "none of"
        missing = [f"{velocity:.3g}" for velocity in points.place[~are_held]]
        listed = ", ".join(missing[:5]) + " ..." * (len(missing) > 5)
        values = ",".join(f"{velocity:.4g}" for velocity in sorted(set(points.place.tolist())))
        yield Issue(
            "note" if are_held.any() else "warning", key,
            f"the run is compared at {some} {len(are_held)} velocities; its inlet does not hold {listed} m/s",
            f"for all: cfddem sweep --over inlet_velocity={values}; or {steps_of(points.place, case.run.until)}",
            not are_held.any(),
        )  # fmt: skip
