"""Warnings about a run, grouped by what to do: an early end, laws outside of their ranges, means that still drift."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cfddem.analysis.bed_laws import weight_over_floor
from cfddem.analysis.defluidisation import defluidisation
from cfddem.case.schema import Case
from cfddem.io.reading import Run
from cfddem.preflight import law_ranges
from cfddem.preflight.bed_estimate import estimate_bed
from closures.registry import Law

REMEDY = "choose a law with a wider range (cfddem explain)"

FINISH = "finish the run before you use its means"
LONGER = "run longer, or average over another window"
LAWS = "check the laws: they were used outside of their fitted ranges"
COMPARE = "treat these comparisons with care: the published law is outside of its range"
STATE = "check the state of the bed: it is not what the case intends"
"""What to do about a group of warnings, in the order in which to do it."""

Grouped = dict[str, list[str]]
"""Warnings by what to do about them."""

Found = Iterator[tuple[str, str]]
"""What to do, and the warning."""

LEAST_SHARE, AGITATION_SHARE = 0.01, 0.25
"""Share of the uses of a law outside of its range from which a warning is given; more for agitation, because surface
and floor of every bed are outside."""


def warnings_of(run: Run, case: Case, begin: float, measures: dict[str, Any], laws: list[dict[str, Any]]) -> Grouped:
    """All warnings, one line each, by what to do.

    begin           start of the averaging window [s]
    measures, laws  of the report
    """
    grouped: Grouped = {}
    for action, text in (
        *_status_warnings(run),
        *_defluidised(run, case),
        *_series_warnings(measures),
        *_range_warnings(run, case, begin),
        *((COMPARE, f"{row['law']}: {row['outside_range']}") for row in laws if row["outside_range"]),
    ):
        grouped.setdefault(action, []).append(text)
    return grouped


def _defluidised(run: Run, case: Case) -> Found:
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
        yield STATE, str(found)


def last_value(run: Run, name: str) -> int:
    """Last value of a counting column of the history; 0 if there is none."""
    column = run.history.get(name, np.zeros(0))
    return int(column[-1]) if len(column) else 0


def _status_warnings(run: Run) -> Found:
    """A run that did not finish, and missing snapshots."""
    if run.status == "stopped":
        yield FINISH, f"the run was stopped: {run.message}"
    elif run.status == "failed":
        yield FINISH, f"the run failed: {run.message}"
    elif run.status == "running":
        yield FINISH, "the run has not finished; if it was killed, continue it with cfddem resume"
    if run.missing:
        yield FINISH, f"{len(run.missing)} snapshots are missing"


def _range_warnings(run: Run, case: Case, begin: float) -> Found:
    """How often laws were evaluated outside of their fitted ranges after a time [s], if it is more than LEAST_SHARE."""
    steps = _gained(run, "fluid_steps", begin)
    evaluations = steps * float(run.history.get("particle_count", np.zeros(1)).mean())
    drag, agitation, pair_laws = case.laws.drag_law, case.agitation, list(case.laws.pair_laws.values())
    if pair_laws:
        if outside := _gained(run, "out_of_range_count", begin):
            laws = [law for law in (drag, *pair_laws) if law is not None and law.ranges]
            ranges = "; ".join(f"{law.name} {law.fitted_for}" for law in laws)
            text = f"laws were evaluated outside of their fitted ranges {outside} times: {ranges}"
            yield LAWS, f"{text}{_effect(case)}; {REMEDY}"
    elif drag is not None:
        outside = _gained(run, "out_of_range_count", begin)
        yield from _beyond("drag law", drag, outside, evaluations, effect=_effect(case))
    if isinstance(agitation, Law):
        outside = _gained(run, "agitation_out_of_range_count", begin)
        effect = f"; {law_ranges.AGITATED}"
        yield from _beyond("law of agitation", agitation, outside, evaluations, AGITATION_SHARE, effect)


def _gained(run: Run, name: str, begin: float) -> int:
    """Increase of a counting column of the history after a time [s]; 0 if there is none."""
    column = run.history.get(name, np.zeros(0))
    return int(column[-1] - column[np.searchsorted(run.history["time"], begin)]) if len(column) else 0


def _effect(case: Case) -> str:
    """What a drag law outside of its range changes in the mean state of the bed, as estimated before the run."""
    law = case.laws.drag_law
    if law is None or case.fluid is None or case.fluid.viscosity == 0.0:
        return ""
    try:
        bed = estimate_bed(case)
        if not law_ranges.outside(law, law_ranges.state_of(case, bed)):
            return f"; by estimate, the bed as a whole is inside the range of {law.name}"
        found = law_ranges.effect_of_drag(case, law, bed)
    except (ArithmeticError, ValueError):  # values beyond all correlations
        return ""
    return f"; {found}" if found else ""


def _beyond(
    kind: str, law: Law, outside: int, evaluations: float, share: float = LEAST_SHARE, effect: str = ""
) -> Found:
    """Warning that a law was used outside of its range in more than a share of its uses."""
    if evaluations and outside > share * evaluations:
        share_outside = f"{100.0 * outside / evaluations:.2g} % of its uses: {law.fitted_for}{effect}; {REMEDY}"
        yield LAWS, f"the {kind} {law.name} was evaluated outside of its fitted range in {share_outside}"


def _series_warnings(measures: dict[str, Any]) -> Found:
    """Series without a stationary mean, or without an error."""
    drifting = [name.replace("_", " ") for name, each in measures.items() if each["stationary"] is False]
    if drifting:
        remedy = "run longer, or increase run.average_from"
        yield LONGER, f"not stationary in the averaging window: {', '.join(drifting)}; {remedy}"
    if any(each["stationary"] is None for each in measures.values()):
        yield LONGER, "the averaging window has too few rows for errors; run longer, or decrease run.history_every"
