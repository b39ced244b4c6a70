"""Warnings about a run, grouped by what to do: an early end, laws outside of their ranges, means that still drift.

A wet bed that no longer moves, or no longer carries its weight, is reported as defluidised, with time and reason.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cfddem.analysis.bed_laws import weight_over_floor
from cfddem.analysis.report_values import LawComparison, Measure
from cfddem.case.bed import at_times
from cfddem.case.schema import Case
from cfddem.io.reading import RunData
from cfddem.preflight import law_ranges
from cfddem.preflight.bed_estimate import estimate_bed, share_of_jet
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


# ---------------------------------------------------------------- defluidisation


Series = NDArray[np.float64]

CARRIED = 0.8
"""Pressure drop over weight below which gas passes the bed without carrying it [-]."""

STILL = 0.1
"""Granular temperature over its largest value so far, below which a bed has come to rest [-]."""

NEVER_MOVED = 1e-4
"""Granular temperature over the square of the inlet velocity above minimum fluidisation, below which a bed rests [-].

In bubbling beds it is a few thousandths."""

SMOOTHED = 0.05
"""Share of the series over which it is averaged before it is judged [-]."""

LASTING = 4
"""Averages that a bed must fail one after the other, up to the end."""

LASTING_STILL = 2
"""The same for a bed in which hardly anything moves: bubbling beds make no such pauses."""


@dataclass(frozen=True)
class Defluidisation:
    """When a bed stopped being fluidised, and what shows it."""

    time: float  # [s]
    rests: bool  # its particles hardly move relative to each other
    passed: bool  # gas passes it without carrying its weight
    largest_share: float  # of the particles in the largest agglomerate then [-]

    def __str__(self) -> str:
        signs = [
            f"the granular temperature is below {100.0 * STILL:g} % of its maximum, or that of a moving bed"
            * self.rests,
            f"the pressure drop is below {100.0 * CARRIED:g} % of the weight" * self.passed,
        ]
        reasons = " and ".join(filter(None, signs))
        largest = f"; the largest agglomerate holds {100.0 * self.largest_share:.0f} % of the particles"
        return f"defluidised from t = {self.time:.3g} s on: {reasons}{largest}"


def defluidisation_of(run: RunData, case: Case) -> Defluidisation | None:
    """Defluidisation of a wet bed at a velocity that fluidises it dry; None if it is fluidised at the end, or dry.

    A spout carries a part of the weight, and moves most as it breaks through: a bed with a jet is only found at rest.
    """
    weight, history = weight_over_floor(case), run.history
    if case.liquid is None or weight is None or "largest_agglomerate" not in history or "pressure_drop" not in history:
        return None
    inlet, jet, bed, time = case.bed.inlet_velocity, case.bed.jet, estimate_bed(case), history["time"]
    speed = at_times(inlet, time)
    if jet:
        speed = speed + share_of_jet(case, jet) * (jet.velocity - speed)
    joined = history["largest_agglomerate"] > 1.0  # before a spray begins, no liquid holds the particles
    largest_share = history["largest_agglomerate"] / np.maximum(history["particle_count"], 1.0)
    return defluidisation(
        time, history["pressure_drop"] / weight, history["granular_temperature"], largest_share,
        np.where(joined, speed - bed.onset, 0.0), spouts=bool(jet),
    )  # fmt: skip


def defluidisation(
    time: Series, carried: Series, temperature: Series, largest_share: Series, excess: Series, *, spouts: bool = False
) -> Defluidisation | None:
    """The time from which on a bed is not fluidised although it is blown; None if it is fluidised at the end.

    time           of the rows (n,) [s]
    carried        pressure drop over weight (n,)
    temperature    granular temperature (n,) [m2/s2]
    largest_share  of the particles in the largest agglomerate (n,)
    excess         inlet velocity above minimum fluidisation of the dry bed; rows without are left out (n,) [m/s]
    spouts         whether a jet enters: neither the load nor the largest motion of a spout says anything

    >>> time = np.linspace(0.0, 1.0, 101)
    >>> moving = np.where(time < 0.5, 1e-3, 1e-6)
    >>> print(defluidisation(time, np.ones(101), moving, 0.9 * np.ones(101), 0.5 * (time > 0.1)))
    defluidised from t = 0.53 s on: the granular temperature is below 10 % of its maximum, or that of a moving bed; the largest agglomerate holds 90 % of the particles
    """  # noqa: E501  the line is printed as one
    rows = np.flatnonzero((excess > 0.0) & np.isfinite(carried) & np.isfinite(temperature))
    width = max(1, round(SMOOTHED * len(rows)))
    if len(rows) < 4 * width or rows[-1] != len(time) - 1:
        return None
    load, motion, least = (_averaged(series[rows], width) for series in (carried, temperature, NEVER_MOVED * excess**2))
    still, passed = motion < least, (load < CARRIED) & (not spouts)
    rests = still | ((motion < STILL * np.maximum.accumulate(motion)) & (not spouts))
    failed = rests | passed
    if not (failed[-LASTING * width :].all() or still[-LASTING_STILL * width :].all()):
        return None
    first = len(failed) - int(np.argmin(failed[::-1])) if not failed.all() else 0
    row = rows[first]
    share = float(largest_share[row])
    return Defluidisation(float(time[row]), bool(rests[first:].mean() > 0.5), bool(passed[first:].mean() > 0.5), share)


def _averaged(series: Series, width: int) -> Series:
    """Mean over this and the `width` - 1 rows before, fewer at the start."""
    total = np.cumsum(np.concatenate([[0.0], series]))
    end = np.arange(1, len(series) + 1)
    begin = np.maximum(end - width, 0)
    return np.asarray((total[end] - total[begin]) / (end - begin))
