"""A run compared with measured data: the value of the run at every measured point, and a score of their differences."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.layers import profiles_of
from cfddem.analysis.series import block_average
from cfddem.backend.errors import InputError, nearest
from cfddem.case.bed import at_times
from cfddem.case.compare import (
    HELD,
    PROFILES,
    Array,
    CaseData,
    Points,
    points_of,
    require_unit,
    unknown_quantity,
    value_columns,
)
from cfddem.case.schema import Case
from cfddem.io.reading import RunData

_ATTRIBUTES = {"voidage": "voidage", "granular_temperature": "temperature"}
"""Names of profiles in :class:`cfddem.analysis.layers.Profiles`."""


@dataclass(frozen=True)
class MeasuredComparison:
    """A run compared with measured points."""

    points: Points
    computed: Array  # (n,) of the run at each point; NaN where it has no value
    computed_error: float | Array  # standard errors of the run's means; 0 for points in time or height
    line: tuple[Array, Array]  # the run: time, height or velocity, and value; empty for means

    @property
    def inside(self) -> np.ndarray:
        """Points at which the run has a value (n,)."""
        return np.isfinite(self.computed)

    @property
    def error(self) -> Array:
        """Standard error of the difference (n,); NaN if that of the data is unknown."""
        return np.hypot(self.points.error, self.computed_error)

    def score(self) -> dict[str, Any]:
        r"""Differences as plain values.

        .. math:: \chi^2 = \frac1n \sum_i \left(\frac{x_i - m_i}{s_i}\right)^2

        returns  name, quantity, unit, against, points, outside (points without a value of the run), bias (mean
                 difference), rms, relative_rms (over the root mean square of the data), chi2, errors (its root),
                 holds (None if no error is known), verdict in words
        """
        with np.errstate(over="ignore", invalid="ignore"):  # values that no run can have
            return self._score()

    def _score(self) -> dict[str, Any]:
        points, off = self.points, (self.computed - self.points.value)[self.inside]
        count = len(off)
        size = math.sqrt(float(np.mean(points.value[self.inside] ** 2))) if count else math.nan
        rms = math.sqrt(float(np.mean(off**2))) if count else math.nan
        chi2 = float(np.mean((off / self.error[self.inside]) ** 2)) if count else math.nan
        is_finite = math.isfinite(chi2)
        holds = bool(chi2 <= largest_chi2(count)) if is_finite else None
        scores = {
            "name": points.name, "quantity": points.quantity, "unit": points.unit, "against": points.against or "mean",
            "points": count, "outside": len(points.value) - count, "bias": float(off.mean()) if count else math.nan,
            "rms": rms, "relative_rms": rms / size if size else math.nan, "chi2": chi2,
            "errors": math.sqrt(chi2) if is_finite else math.nan, "holds": holds,
        }  # fmt: skip
        return scores | {"verdict": _verdict(scores)}


def largest_chi2(count: int) -> float:
    """Largest mean square difference, in squared errors, that chance explains: two standard deviations above 1.

    At least 4, that is two errors, for a single point.
    """
    return max(1.0 + 2.0 * math.sqrt(2.0 / count), 4.0 if count == 1 else 0.0)


def compared_with_measured(run: RunData, case: Case, begin: float) -> list[MeasuredComparison]:
    """The run at the points of all measured data of its case.

    begin   of the averaging window [s]
    errors  InputError for data that cannot be read or have no counterpart in the run
    """
    return [compared_at(run, case, points_of(name, data), begin) for name, data in case.compare.items()]


def with_files(case: Case, files: Sequence[Path]) -> Case:
    """A case with measured data from further files, named after them and, of several, their columns of values."""
    data: dict[str, CaseData] = {}
    for path in files:
        columns = value_columns(path)
        for column in columns or [""]:
            name = re.sub(r"\W+", "_", path.stem)[:24] or "data"
            if len(columns) > 1:
                name = f"{name}_{column}"
            if name in case.compare or name in data:
                raise InputError("data", str(path), "a file with a name that no other data have", f"{name} is taken")
            data[name] = CaseData(file=str(path.absolute()), column=column or None)
    return case.model_copy(update={"compare": {**case.compare, **data}})


def compared_at(run: RunData, case: Case, points: Points, begin: float) -> MeasuredComparison:
    """The run at measured points.

    begin   of the averaging window [s]
    errors  InputError for a quantity that the run lacks, or of another unit
    """
    if points.against == "height":
        return _profile(run, case, points, begin)
    if points.quantity not in run.history:
        names = [name for name in run.history if name not in ("time", "step")]
        raise unknown_quantity(points.name, points.quantity, names)
    require_unit(points, run.unit(points.quantity))
    time, values = run.history["time"], run.history[points.quantity]
    usable = np.isfinite(values)
    time, values = time[usable], values[usable]
    if points.against == "time":
        if not len(time):
            return MeasuredComparison(points, np.full(len(points.value), np.nan), 0.0, (time, values))
        computed = np.interp(points.place, time, values, left=np.nan, right=np.nan)
        return MeasuredComparison(points, computed, 0.0, (time, values))
    if points.against == "inlet_velocity":
        return _at_velocities(case, points, time, values, begin)
    average = block_average(values[time >= begin])
    error = 0.0 if math.isnan(average.error) else average.error
    return MeasuredComparison(points, np.full(len(points.value), average.mean), error, (time[:0], values[:0]))


def _at_velocities(case: Case, points: Points, time: Array, values: Array, begin: float) -> MeasuredComparison:
    """Means of a run while its inlet has the measured velocities: over the second half of each time it is held."""
    steady, velocity = isinstance(case.bed.inlet_velocity, float), at_times(case.bed.inlet_velocity, time)
    computed, error = np.full((2, len(points.value)), np.nan)
    for place, wanted in enumerate(points.place):
        rows = np.flatnonzero(np.isclose(velocity, wanted, rtol=HELD, atol=0.0))
        if steady:
            rows = rows[time[rows] >= begin]
        else:
            parts = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
            rows = np.concatenate([part[len(part) // 2 :] for part in parts])
        if len(rows):
            average = block_average(values[rows])
            computed[place], error[place] = average.mean, 0.0 if math.isnan(average.error) else average.error
    order = np.argsort(points.place)
    return MeasuredComparison(points, computed, error, (points.place[order], computed[order]))


def _profile(run: RunData, case: Case, points: Points, begin: float) -> MeasuredComparison:
    """The profile of a run at measured heights."""
    if points.quantity not in PROFILES:
        limit = nearest(points.quantity, PROFILES)
        raise InputError(f"compare.{points.name}.quantity", points.quantity, f"{limit} for points against height")
    require_unit(points, PROFILES[points.quantity])
    profiles = profiles_of(run, case, begin)
    values = None if profiles is None else getattr(profiles, _ATTRIBUTES[points.quantity])
    if profiles is None or values is None:
        raise InputError(f"compare.{points.name}.quantity", points.quantity, "a quantity that the run has recorded")
    usable = np.isfinite(values)
    height, values = profiles.height[usable], values[usable]
    computed = np.interp(points.place, height, values, left=np.nan, right=np.nan)
    return MeasuredComparison(points, computed, 0.0, (height, values))


def _verdict(score: dict[str, Any]) -> str:
    if not score["points"]:
        return "the run has no value at any of the points"
    percent = f"rms difference {100.0 * score['relative_rms']:.2g} %"
    if score["holds"] is None:
        return f"{percent}; no errors of the data are given"
    word = "agrees within the errors" if score["holds"] else "differs by more than the errors"
    return f"{word}: {score['errors']:.2g} errors rms, {percent}"
