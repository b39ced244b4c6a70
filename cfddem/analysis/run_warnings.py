"""Warnings about a run: an early end, laws outside of their fitted ranges, means that are not stationary."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cfddem.analysis.bed_laws import weight_over_floor
from cfddem.analysis.defluidisation import defluidisation
from cfddem.case.schema import Case
from cfddem.io.reading import Run
from cfddem.preflight.bed_estimate import estimate_bed
from closures.registry import Law

REMEDY = "choose a law with a wider range (cfddem explain)"


LEAST_SHARE, AGITATION_SHARE = 0.01, 0.25
"""Share of the uses of a law outside of its range from which a warning is given; more for agitation, because surface
and floor of every bed are outside."""


def warnings_of(run: Run, case: Case, begin: float, measures: dict[str, Any], laws: list[dict[str, Any]]) -> list[str]:
    """All warnings, one line each.

    begin           start of the averaging window [s]
    measures, laws  of the report
    """
    return [
        *_status_warnings(run),
        *_range_warnings(run, case, begin),
        *(f"{row['law']}: {row['outside_range']}" for row in laws if row["outside_range"]),
        *_series_warnings(measures),
        *_defluidised(run, case),
    ]


def _defluidised(run: Run, case: Case) -> Iterator[str]:
    """A wet bed that has come to rest, or lets the gas pass, at a velocity that fluidises the dry bed."""
    weight, history = weight_over_floor(case), run.history
    if case.liquid is None or weight is None or "largest_agglomerate" not in history or "pressure_drop" not in history:
        return
    inlet, time = case.bed.inlet_velocity, history["time"]
    speed = np.full(len(time), inlet) if isinstance(inlet, float) else np.interp(time, *np.array(inlet).T)
    largest_share = history["largest_agglomerate"] / np.maximum(history["particle_count"], 1.0)
    found = defluidisation(
        time, history["pressure_drop"] / weight, history["granular_temperature"], largest_share,
        speed - estimate_bed(case).onset,
    )  # fmt: skip
    if found is not None:
        yield str(found)


def last_value(run: Run, name: str) -> int:
    """Last value of a counting column of the history; 0 if there is none."""
    column = run.history.get(name, np.zeros(0))
    return int(column[-1]) if len(column) else 0


def _status_warnings(run: Run) -> Iterator[str]:
    """A run that did not finish, and missing snapshots."""
    if run.status == "stopped":
        yield f"the run was stopped: {run.message}"
    elif run.status == "failed":
        yield f"the run failed: {run.message}"
    elif run.status == "running":
        yield "the run has not finished; if it was killed, continue it with cfddem resume"
    if run.missing:
        yield f"{len(run.missing)} snapshots are missing"


def _range_warnings(run: Run, case: Case, begin: float) -> Iterator[str]:
    """How often laws were evaluated outside of their fitted ranges after a time [s], if it is more than LEAST_SHARE."""
    steps = _gained(run, "fluid_steps", begin)
    evaluations = steps * float(run.history["particle_count"].mean())
    drag, agitation, pair_laws = case.laws.drag_law, case.agitation, list(case.laws.pair_laws.values())
    if pair_laws:
        if outside := _gained(run, "out_of_range_count", begin):
            laws = [law for law in (drag, *pair_laws) if law is not None and law.ranges]
            ranges = "; ".join(f"{law.name} {law.fitted_for}" for law in laws)
            yield f"laws were evaluated outside of their fitted ranges {outside} times: {ranges}; {REMEDY}"
    elif drag is not None:
        yield from _beyond("drag law", drag, _gained(run, "out_of_range_count", begin), evaluations)
    if isinstance(agitation, Law):
        outside = _gained(run, "agitation_out_of_range_count", begin)
        yield from _beyond("law of agitation", agitation, outside, evaluations, AGITATION_SHARE)


def _gained(run: Run, name: str, begin: float) -> int:
    """Increase of a counting column of the history after a time [s]; 0 if there is none."""
    column = run.history.get(name, np.zeros(0))
    return int(column[-1] - column[np.searchsorted(run.history["time"], begin)]) if len(column) else 0


def _beyond(kind: str, law: Law, outside: int, evaluations: float, share: float = LEAST_SHARE) -> Iterator[str]:
    """Warning that a law was used outside of its range in more than a share of its uses."""
    if evaluations and outside > share * evaluations:
        yield (
            f"the {kind} {law.name} was evaluated outside of its fitted range in {100.0 * outside / evaluations:.2g} % "
            f"of its uses: {law.fitted_for}; {REMEDY}"
        )


def _series_warnings(measures: dict[str, Any]) -> Iterator[str]:
    """Series without a stationary mean, or without an error."""
    drifting = [name.replace("_", " ") for name, each in measures.items() if each["stationary"] is False]
    if drifting:
        yield f"not stationary in the averaging window: {', '.join(drifting)}; run longer, or increase run.average_from"
    if any(each["stationary"] is None for each in measures.values()):
        yield "the averaging window has too few rows for errors; run longer, or decrease run.history_every"
