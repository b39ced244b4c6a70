"""What speaks against a run when it is over, a line each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cfddem.case import Case
from cfddem.record.reading import Run

WIDER = "compare one of a wider range (cfddem explain)"


def warnings_of(run: Run, case: Case, measures: dict[str, Any], laws: list[dict[str, Any]]) -> list[str]:
    """One line each: how the run ended, laws outside of their range, series that still move."""
    return [
        *_of_the_end(run),
        *_of_the_ranges(run, case),
        *(f"{row['law']}: {row['outside_range']}" for row in laws if row["outside_range"]),
        *_of_the_series(measures),
    ]


def counted(run: Run, name: str) -> int:
    """What a column of the history has counted up to its last row; 0 where there is none."""
    column = run.history.get(name, np.zeros(0))
    return int(column[-1]) if len(column) else 0


def _of_the_end(run: Run) -> Iterator[str]:
    """How the run ended, if not well."""
    if run.status == "stopped":
        yield f"the run was stopped: {run.message}"
    elif run.status == "failed":
        yield f"failed: {run.message}"
    elif run.status == "running":
        yield "the run is under way; if it was killed, cfddem resume goes on with it"
    if run.missing:
        yield f"{len(run.missing)} snapshots are missing"


def _of_the_ranges(run: Run, case: Case) -> Iterator[str]:
    """How often laws were asked outside of the ranges they were fitted to, and what to do."""
    outside = counted(run, "outside_range")
    if not outside:
        return
    own = list(case.laws.pair_laws.values())
    laws = [law for law in (case.laws.drag_law, *own) if law is not None]
    ranges = "; ".join(f"{law.name} {law.fitted_for}" for law in laws if law.ranges)
    asked = counted(run, "fluid_steps") * float(run.history["particle_count"].mean())
    if own or not asked:
        yield f"laws were asked outside of their ranges {outside} times: {ranges}; {WIDER}"
        return
    yield (
        f"the drag law {laws[0].name} was asked outside of its range {outside} times, "
        f"{100.0 * outside / asked:.2g} % of all: {laws[0].fitted_for}; {WIDER}"
    )


def _of_the_series(measures: dict[str, Any]) -> Iterator[str]:
    """Series that have no mean yet, or no error."""
    moving = [name.replace("_", " ") for name, each in measures.items() if each["stationary"] is False]
    if moving:
        yield f"not stationary in the window: {', '.join(moving)}; run longer, or set run.average_from later"
    short = [name.replace("_", " ") for name, each in measures.items() if each["stationary"] is None]
    if short:
        yield "the window holds too few rows for errors; run longer, or set run.history_every smaller"
