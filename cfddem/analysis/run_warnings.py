"""Warnings about a run, grouped by what to do: an early end, laws outside of their ranges, means that still drift."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cfddem.analysis.defluidisation import defluidisation_of
from cfddem.analysis.report_values import LawComparison, Measure
from cfddem.case.schema import Case
from cfddem.io.reading import RunData
from cfddem.preflight import law_ranges
from cfddem.preflight.bed_estimate import estimate_bed
from cfddem.preflight.issue import Issue, percent
from closures.registry import Law

REMEDY = "choose a law with a wider range (cfddem explain)"

INSTALL = "install what the run has used, or keep to what was measured in it"
FINISH = "finish the run before you use its means"
LONGER = "run longer, or average over another window"
LAWS = "check the laws: they were used outside of their ranges"
COMPARE = "treat these comparisons with care: the published law is outside of its range"
CASE = "check the case: before the run, it had these warnings"
NOTE = "for information: no action is needed"
STATE = "check the state of the bed: it is not what the case intends"
"""What to do about a group of warnings, in the order in which to do it."""

Grouped = dict[str, list[str]]
"""Warnings by what to do about them."""

Found = Iterator[tuple[str, str]]
"""What to do, and the warning."""

INSIDE = "; by estimate, the bed as a whole is inside the range of {}"
"""Effect of a drag law that is outside of its range in some places only."""

CURVES = "of a process that never becomes steady, read the curves over time (cfddem view --history) instead of means"
"""Remedy for a run without a steady state, such as a batch that settles."""

MISSED = 0.1
"""Share of the spray that may miss the particles without a warning."""

AGITATION_SHARE, LOCAL_SHARE, ALL = 0.25, 0.25, 0.995
"""Shares of the uses of a law outside of its range.

Above the first, a law of agitation gives a warning: surface and floor of every bed are outside. Above the second, a
drag law does if the bed as a whole is inside: dense and loose places are outside. From the third on, the words say
`all`.
"""


def warnings_of(
    run: RunData, case: Case, measures: Mapping[str, Measure], laws: Sequence[LawComparison], issues: Sequence[Issue]
) -> Grouped:
    """All warnings, one line each, by what to do.

    measures, laws  of the report
    issues          of the check before the run
    """
    grouped: Grouped = {}
    for action, text in (
        *_status_warnings(run),
        *_defluidised(run, case),
        *_spray_missed(run, case),
        *_series_warnings(case, measures),
        *_missing_laws(case),
        *(
            (NOTE if issue.severity == "note" else CASE, str(issue))
            for issue in issues
            if issue.in_report and not case.laws.missing
        ),
        *_range_warnings(run, case),
        *((COMPARE, f"{row.law}: {row.outside_range}") for row in laws if row.outside_range),
    ):
        grouped.setdefault(action, []).append(text)
    if NOTE in grouped:
        grouped[NOTE] = grouped.pop(NOTE)
    return grouped


def _defluidised(run: RunData, case: Case) -> Found:
    """A wet bed that has come to rest, or lets the gas pass, at a velocity that fluidises the dry bed."""
    defluidised = defluidisation_of(run, case)
    if defluidised is not None:
        yield STATE, str(defluidised)


def _spray_missed(run: RunData, case: Case) -> Found:
    """A spray that finds few particles in its zone."""
    history, none = run.history, np.zeros(1)
    missed, landed = (history.get(name, none)[-1] for name in ("liquid_missed", "liquid_sprayed"))
    if missed > MISSED * (missed + landed):
        share = percent(missed / (missed + landed))
        box = case.spray is not None and case.spray.zone == "box"
        remedy = "move spray.corner to the bed" if box else "move spray.nozzle nearer to the bed"
        yield STATE, f"{share} of the spray found no particle in its zone: {remedy}, or give a larger zone"


def last_value(run: RunData, name: str) -> int:
    """Last value of a counting column of the history; 0 if there is none."""
    column = run.history.get(name, np.zeros(0))
    return int(column[-1]) if len(column) else 0


def _status_warnings(run: RunData) -> Found:
    """A run that did not finish, and missing snapshots."""
    if run.status == "stopped":
        yield FINISH, f"the run was stopped: {run.message}; continue it with cfddem resume {run.folder}"
    elif run.status == "failed":
        yield FINISH, f"the run failed: {run.message}"
    elif run.status == "running":
        yield FINISH, f"the run has not finished; if it was killed, continue it with cfddem resume {run.folder}"
    if run.missing:
        yield FINISH, f"{len(run.missing)} snapshots are missing"


def _missing_laws(case: Case) -> Found:
    """Laws of the run that this machine does not have."""
    for kind, name in case.laws.missing.items():
        onset = "; minimum fluidisation is that of Ergun's law" if kind == "drag" else ""
        yield INSTALL, f"law {name} (laws.{kind}) is not installed here: no prediction{onset}"


def _range_warnings(run: RunData, case: Case) -> Found:
    """How often laws were evaluated outside of their ranges in the whole run."""
    evaluations = last_value(run, "fluid_steps") * float(run.history.get("particle_count", np.zeros(1)).mean())
    drag, agitation, pair_laws = case.laws.drag_law, case.agitation, list(case.laws.pair_laws.values())
    if pair_laws:
        if outside := last_value(run, "out_of_range_count"):
            laws = [law for law in (drag, *pair_laws) if law is not None and law.ranges]
            ranges = "; ".join(f"{law.name} {law.range_in_words}" for law in laws)
            text = f"laws were evaluated outside of their ranges {outside} times: {ranges}"
            yield LAWS, f"{text}{_effect(case)}; {REMEDY}"
    elif drag is not None:
        outside = last_value(run, "out_of_range_count")
        effect = _effect(case)
        local = effect == INSIDE.format(drag.name) and outside <= LOCAL_SHARE * evaluations
        for action, text in _beyond("drag law", drag, outside, evaluations, effect=effect):
            yield (NOTE, text.removesuffix(f"; {REMEDY}")) if local else (action, text)
    if isinstance(agitation, Law):
        outside = last_value(run, "agitation_out_of_range_count")
        effect, default = f"; {law_ranges.AGITATED}", law_ranges.by_default(case)
        for action, text in _beyond("law of agitation", agitation, outside, evaluations, AGITATION_SHARE, effect):
            words = "; ".join([text.removesuffix(f"; {REMEDY}"), *default])
            yield (action if default else NOTE), words


def _effect(case: Case) -> str:
    """What a drag law outside of its range changes in the mean state of the bed, as estimated before the run."""
    law = case.laws.drag_law
    if law is None or not case.resists:
        return ""
    try:
        bed = estimate_bed(case)
        if not law_ranges.outside(law, law_ranges.state_of(case, bed)):
            return INSIDE.format(law.name)
        effect = law_ranges.effect_of_drag(case, law, bed)
    except (ArithmeticError, ValueError):  # values beyond all correlations
        return ""
    return f"; {effect}" if effect else ""


def _beyond(kind: str, law: Law, outside: int, evaluations: float, share: float = 0.0, effect: str = "") -> Found:
    """Warning that a law was used outside of its range in more than a share of its uses."""
    if evaluations and outside > share * evaluations:
        part = outside / evaluations
        uses = f"{percent(part)} of its uses" if part < ALL else "all of its uses"
        warning = (
            f"was evaluated outside of its range in {uses} ({outside} times): {law.range_in_words}{effect}; {REMEDY}"
        )
        yield LAWS, f"the {kind} {law.name} {warning}"


def _series_warnings(case: Case, measures: Mapping[str, Measure]) -> Found:
    """Series without a stationary mean, or without an error."""
    left_out = ("bed_height",) if case.is_one_sphere else ()  # a sphere that falls is no bed
    unsteady = [name for name, measure in measures.items() if measure.stationary is False and name not in left_out]
    drifting = [name.replace("_", " ") for name in unsteady]
    if drifting:
        changes = next(iter(measures.values())).inlet_changes
        remedy = f"run longer, or increase run.average_from; {CURVES}"
        if changes:
            remedy = f"{changes}: set run.average_from to the start of its last value, or compare with data by velocity"
        yield LONGER, f"not stationary in the averaging window: {', '.join(drifting)}; {remedy}"
    if any(measure.stationary is None for measure in measures.values()):
        yield LONGER, "the averaging window has too few rows for errors; run longer, or decrease run.history_every"
