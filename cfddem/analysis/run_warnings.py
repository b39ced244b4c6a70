"""Warnings about a run: an early end, laws outside of their fitted ranges, means that are not stationary."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cfddem.case.schema import Case
from cfddem.io.reading import Run

REMEDY = "choose a law with a wider range (cfddem explain)"


def warnings_of(run: Run, case: Case, measures: dict[str, Any], laws: list[dict[str, Any]]) -> list[str]:
    """All warnings, one line each.

    measures, laws  of the report
    """
    return [
        *_status_warnings(run),
        *_range_warnings(run, case),
        *(f"{row['law']}: {row['outside_range']}" for row in laws if row["outside_range"]),
        *_series_warnings(measures),
    ]


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


def _range_warnings(run: Run, case: Case) -> Iterator[str]:
    """How often laws were evaluated outside of their fitted ranges."""
    outside = last_value(run, "out_of_range_count")
    if not outside:
        return
    pair_laws = list(case.laws.pair_laws.values())
    laws = [law for law in (case.laws.drag_law, *pair_laws) if law is not None]
    ranges = "; ".join(f"{law.name} {law.fitted_for}" for law in laws if law.ranges)
    evaluations = last_value(run, "fluid_steps") * float(run.history["particle_count"].mean())
    if pair_laws or not evaluations:
        yield f"laws were evaluated outside of their fitted ranges {outside} times: {ranges}; {REMEDY}"
        return
    yield (
        f"the drag law {laws[0].name} was evaluated outside of its fitted range {outside} times, "
        f"{100.0 * outside / evaluations:.2g} % of all: {laws[0].fitted_for}; {REMEDY}"
    )


def _series_warnings(measures: dict[str, Any]) -> Iterator[str]:
    """Series without a stationary mean, or without an error."""
    drifting = [name.replace("_", " ") for name, each in measures.items() if each["stationary"] is False]
    if drifting:
        yield f"not stationary in the averaging window: {', '.join(drifting)}; run longer, or increase run.average_from"
    if any(each["stationary"] is None for each in measures.values()):
        yield "the averaging window has too few rows for errors; run longer, or decrease run.history_every"
