"""The key results of a run in a few lines: bed height, voidage, pressure drop, regime; each with error and verdict.

A verdict compares a mean with what it should be, in units of its standard error.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from cfddem.analysis.bed_laws import FROM_HEIGHT, FROM_PRESSURE, weight_over_floor
from cfddem.analysis.measures import OF_THE_BED
from cfddem.analysis.report_values import KeyResult, LawComparison, Measure
from cfddem.case.bed import at_times
from cfddem.case.schema import Case
from cfddem.fluid.cell_counts import cell_counts
from cfddem.io.reading import RunData
from cfddem.preflight.bed_estimate import BedEstimate, estimate_bed
from cfddem.preflight.expansion import SCATTER, expansions, spread_in_words
from cfddem.preflight.issue import percent

AGREES = 2.0
"""A mean agrees with a number if it differs by at most this many standard errors."""

CLOSE = 5e-3
"""Relative difference up to which a mean equals a number for all practical purposes, whatever its error."""

STEADY = 1e-9
"""Standard error over the mean up to which a series does not fluctuate."""

CARRIED = 0.9
"""Share of the buoyant weight that the flow carries at least in a fluidised bed."""

DRIFTING = 0.02
"""Largest drift over the averaged rows, over their mean, with which a mean can be used."""

STILL, LYING = 0.01, 0.01
"""Largest speed of particles at rest, over the speed after a fall of one diameter; and the least share of the weight
that the floor carries under a bed at rest."""

SHALLOW = 8.0
"""Height of a packed bed below which its pressure drop is several per cent too low [cells]."""

LOOSE = 0.5
"""Voidage from which a bed below minimum fluidisation is not packed, as it has not settled yet."""

COUNTED = 1000.0
"""Most standard errors that are written as a number."""


def key_results(
    run: RunData, case: Case, measures: Mapping[str, Measure], laws: Sequence[LawComparison], defluidised: bool = False
) -> list[KeyResult]:
    """The key results of a run, most important first.

    measures, laws  of :func:`cfddem.analysis.report.report`
    defluidised     a wet bed has come to rest although it is blown
    """
    results = [
        *_speed(laws),
        *_height(case, measures, laws),
        *_voidage(case, measures, laws),
        *_drop(case, measures, laws),
    ]
    results += _particles(run)
    regime, reason, holds = _classified(run, case, measures)
    if defluidised:
        regime, holds = "defluidised", False
    return [*results, KeyResult("regime", regime, math.nan, "", reason, holds)]


def agreement(computed: float, error: float, expected: float, name: str) -> tuple[str, bool | None]:
    """Whether a mean agrees with a number, in words and as a truth value; None without an error, or for a constant.

    computed, error, expected  same unit; the error is NaN if it is unknown
    name                       of the number, in the sentence

    >>> agreement(0.98, 0.02, 1.0, "the weight")
    ('agrees with the weight: 2.0 % below it, 1.0 standard errors', True)
    >>> agreement(0.98, 0.002, 1.0, "the weight")
    ('differs from the weight: 2.0 % below it, 10.0 standard errors', False)
    """
    off = computed - expected
    percent = 100.0 * abs(off) / abs(expected) if expected else math.inf
    side = f"{percent:.1f} % {'below' if off < 0.0 else 'above'} it"
    if percent <= 100.0 * CLOSE:
        return f"equals {name} to {max(percent, 0.01):.2g} %", True
    if not error > STEADY * abs(computed):
        why = "no error is known" if math.isnan(error) else "it does not fluctuate"
        return f"{side.removesuffix(' it')} {name}; {why}", None
    errors = abs(off) / error
    word = "agrees with" if errors <= AGREES else "differs from"
    count = f", {errors:.1f} standard errors" if errors < COUNTED else ""
    return f"{word} {name}: {side}{count}", errors <= AGREES


def _speed(laws: Sequence[LawComparison]) -> Iterator[KeyResult]:
    """Last speed of a single sphere against its terminal velocity."""
    for row in laws:
        if row.law.startswith("terminal velocity"):
            words, holds = agreement(row.computed, math.nan, row.expected, f"the {row.law}")
            yield KeyResult("settling speed", row.computed, math.nan, "m/s", words, holds)


def _usable(measure: Measure) -> bool:
    """Whether a mean can be used: it is steady, or drifts little."""
    drift = measure.drift  # NaN with too few rows
    return bool(measure.stationary) or abs(drift) <= DRIFTING * abs(measure.mean)


def _mean(name: str, measure: Measure, verdict: str, holds: bool | None) -> KeyResult:
    """A key result from a measure, with how steady it is; a mean that drifts much is not to be used."""
    drift, mean = measure.drift, measure.mean
    if measure.stationary or drift == 0.0:
        steady = "steady"
    elif math.isnan(drift):
        steady = "too few rows to say whether it is steady"
    else:
        share = abs(drift) / abs(mean) if mean else math.inf
        begin, end = measure.drift_times
        steady = f"still drifts by {percent(float(f'{share:.2g}'))} from {begin:g} to {end:g} s"
        steady += ", in which the inlet velocity changes" * bool(measure.inlet_changes)
        if share > DRIFTING:
            steady, holds = f"{steady}, do not use the mean", False
    verdict = f"{steady}; {verdict}" if verdict else steady
    bound = measure.error_is_lower_bound
    return KeyResult(name, measure.mean, measure.error, measure.unit, verdict, holds, bound)


def _height(case: Case, measures: Mapping[str, Measure], laws: Sequence[LawComparison]) -> Iterator[KeyResult]:
    """Bed height, and the heights that published expansion laws give for the same particles."""
    if "bed_height" not in measures or case.is_one_sphere:
        return
    height = measures["bed_height"]
    verdict = ""
    published = _published(laws)
    if published:
        solids = OF_THE_BED * estimate_bed(case).solid_volume / case.floor_area  # as the bed height is defined
        low, high = (solids / (1.0 - voidage) for voidage in (min(published), max(published)))
        verdict = f"published laws give {low:.3g} to {high:.3g} m"
    yield _mean("bed height", height, verdict, None)


def _published(laws: Sequence[LawComparison]) -> list[float]:
    """Voidages by published expansion laws."""
    return [row.expected for row in laws if row.law.startswith("voidage by ")]


def _voidage(case: Case, measures: Mapping[str, Measure], laws: Sequence[LawComparison]) -> Iterator[KeyResult]:
    """The voidage to believe: that from the bed height, which published laws were fitted to."""
    if FROM_HEIGHT not in measures:
        return
    voidage, published = measures[FROM_HEIGHT], _published(laws)
    verdict, holds = "", None
    if published:
        low, high, mean = min(published), max(published), voidage.mean
        margin = AGREES * (0.0 if math.isnan(voidage.error) else voidage.error)
        holds = low - margin <= mean <= high + margin
        off = max(low - mean, mean - high)
        where = "within" if off <= 0.0 else f"{off:.3f} {'below' if mean < low else 'above'}"
        verdict = f"{where} the published laws, {low:.3f} to {high:.3f}"
        scatter = spread_in_words(expansions(case))
        if scatter and not holds and off <= SCATTER[1]:
            holds, verdict = None, f"{verdict}; {scatter}"
    has_surface = case.stands_still or weight_over_floor(case) is not None
    if FROM_PRESSURE in measures and _usable(voidage) and has_surface:
        verdict += f"; use this value, from the height; the pressure gives {measures[FROM_PRESSURE].mean:.3f}"
    yield _mean("bed voidage", voidage, verdict.removeprefix("; "), holds)


def _drop(case: Case, measures: Mapping[str, Measure], laws: Sequence[LawComparison]) -> Iterator[KeyResult]:
    """Pressure drop against the weight of the bed, or against the drag law for a fixed one."""
    if "pressure_drop" not in measures:
        return
    drop, opening = measures["pressure_drop"], "pressure drop by "
    for row in laws:
        if row.law.startswith(opening):
            expected = row.law.removeprefix(opening)
            words, holds = agreement(drop.mean, drop.error, row.expected, expected)
            above, more = holds is False and drop.mean > row.expected, ""
            if above and case.has_sticky_sides:
                more = "friction of the fluid at the sides adds to it"
            elif above and case.stands_still and case.bed.start == "poured":
                more = "a poured bed is denser inside than its mean, which counts the loose layers at floor and surface"
            yield _mean("pressure drop", drop, "; ".join(filter(None, (words, more, _shallow(case, measures)))), holds)
            return
    yield _mean("pressure drop", drop, _shallow(case, measures), None)


def _shallow(case: Case, measures: Mapping[str, Measure]) -> str:
    """What a smeared surface does to the pressure drop of a packed bed of few cells, in words; empty for others."""
    if case.surface == "sharp" or "bed_height" not in measures or case.bed.start == "packed":
        return ""
    bed, count = _bed_at_end(case, measures["bed_height"]), cell_counts(case.column.size, case.column.cell)[2]
    cells = measures["bed_height"].mean / case.column.height * count
    packed = 0.0 < bed.inlet <= bed.onset and FROM_HEIGHT in measures and measures[FROM_HEIGHT].mean < LOOSE
    if cells >= SHALLOW or not (case.stands_still or packed):
        return ""
    return (
        f"too low, as the bed is only {cells:.2g} cells high and the kernel blurs its ends: packed beds of 2, 4 and 8 "
        "cells have 0.69, 0.89 and 0.94 of the pressure drop of their law"
    )


def _particles(run: RunData) -> Iterator[KeyResult]:
    """Particles at the end of a run with feeds or outlets, and how many have entered and left since it began."""
    history = run.history

    def since(name: str) -> float:
        """Change of a column over the run, which may go on from another."""
        return float(history[name][-1] - history[name][0])

    if not {"fed_count", "removed_count"} & history.keys():
        return
    count = history["particle_count"]
    sentences = [f"{count[0]:.0f} at the start"]
    if "fed_count" in history:
        waiting = history.get("waiting_count", np.zeros(1))[-1]
        sentences.append(f"{since('fed_count'):.0f} fed" + f", {waiting:.0f} wait for a place" * bool(waiting))
    if "removed_count" in history:
        sentences.append(f"{since('removed_count'):.0f} removed, {since('removed_mass'):.3g} kg")
    yield KeyResult("particles", f"{count[-1]:.0f}", math.nan, "1", "; ".join(sentences), None)
    if "residence_time" in history and math.isfinite(history["residence_time"][-1]):
        few, half, most = (float(history[f"residence_time_{share}"][-1]) for share in (10, 50, 90))
        spread = (
            f"deviation {history['residence_time_deviation'][-1]:.3g} s; 10, 50 and 90 % of those that left stayed "
        )
        spread += f"at most {few:.3g}, {half:.3g} and {most:.3g} s"
        yield KeyResult("residence time", float(history["residence_time"][-1]), math.nan, "s", spread, None)


# ---------------------------------------------------------------- regime


def _classified(run: RunData, case: Case, measures: Mapping[str, Measure]) -> tuple[str, str, bool | None]:
    """The state of the particles in words, what it was concluded from, and whether it is as expected."""
    fastest = run.history.get("largest_speed", np.zeros(1))[-1]
    moving = f"the fastest particle moves at {fastest:.2g} m/s"
    fall = math.sqrt(math.hypot(*case.laws.gravity) * case.bed.largest_diameter)
    at_rest = bool(fastest <= STILL * fall)
    if case.stands_still:
        return "fixed bed", "the particles do not move", None
    weight = weight_over_floor(case)
    flows = case.has_fluid and case.column.ends == "flow" and case.fastest_inflow > 0.0
    if case.is_one_sphere:
        return ("sphere at rest", moving, None) if at_rest and not flows else ("sphere in motion", moving, None)
    drop = measures.get("pressure_drop")
    bed = estimate_bed(case) if drop is None else _bed_at_end(case, drop)
    if not flows or drop is None or weight is None or not weight > 0.0 or not bed.onset > 0.0:
        return ("particles at rest", moving, None) if at_rest else ("particles in motion", moving, None)
    share, error = drop.mean / weight, 100.0 * drop.error / weight
    spread = f" +- {error:.1f}" if error >= 0.05 else ""
    changes = bool(drop.inlet_changes)
    carried = f"the flow carries {100.0 * share:.1f}{spread} % of the buoyant weight" + " on average" * changes
    when = " at the end" * changes
    ratio = f"the inlet velocity{when} is {bed.inlet / bed.onset:.2g} times that of minimum fluidisation"
    lying = measures["wall_load"].mean > LYING * weight if "wall_load" in measures else share < 1.0 - LYING
    if at_rest and lying and bed.inlet > bed.onset:
        return "at rest, not fluidised", f"{carried}, although {ratio}; {moving}", False
    regime, reason = _of_a_bed(case, bed, share), f"{carried}; {ratio}"
    if not _usable(drop):
        return f"so far: {regime}", f"{reason}; the pressure drop is not known to be steady", None
    return regime, reason, (share >= CARRIED) == (bed.inlet > bed.onset)


def _bed_at_end(case: Case, measure: Measure) -> BedEstimate:
    """The bed of a case at the inlet velocity with which the averaging window of a measure ends."""
    bed, highest = estimate_bed(case), case.bed.highest_inlet_velocity
    last = float(at_times(case.bed.inlet_velocity, measure.drift_times[1]))
    return bed if last == highest else replace(bed, inlet=bed.inlet * last / highest)


def _of_a_bed(case: Case, bed: BedEstimate, carried: float) -> str:
    """The regime of a bed whose flow carries a share of its weight."""
    if carried < CARRIED:
        return "packed" if bed.inlet <= bed.onset else "not fully fluidised"
    if case.bed.jets:
        return "fluidised with a jet"
    return "fluidised, expanded" if case.in_liquid else "fluidised, bubbling"
