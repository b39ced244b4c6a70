"""Checks of measured data before a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress

from cfddem.backend.errors import InputError
from cfddem.case.compare import Points, held, points_of, require_measured_unit, steps_of
from cfddem.case.schema import Case
from cfddem.preflight.issue import Issue


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
    found = held(case.bed.inlet_velocity, case.run.until, points.place)
    if not found.all():
        some = f"only {found.sum()} of" if found.any() else "none of"
        missing = [f"{each:.3g}" for each in points.place[~found]]
        listed = ", ".join(missing[:5]) + " ..." * (len(missing) > 5)
        values = ",".join(f"{each:.4g}" for each in sorted(set(points.place.tolist())))
        yield Issue(
            "note" if found.any() else "warning", key,
            f"the run is compared at {some} {len(found)} velocities; its inlet does not hold {listed} m/s",
            f"for all: cfddem sweep --over inlet_velocity={values}; or {steps_of(points.place, case.run.until)}",
            not found.any(),
        )  # fmt: skip
