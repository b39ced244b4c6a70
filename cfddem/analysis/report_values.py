"""The values of a report: means of measures, key results, and published laws beside them."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Measure:
    """Mean of a measure over the averaging window, with its standard error, and its drift over the averaged rows."""

    mean: float
    error: float  # NaN if unknown
    error_is_lower_bound: bool
    unit: str
    meaning: str
    drift: float
    drift_error: float
    drift_times: tuple[float, float]  # [s]
    stationary: bool | None  # None: too few rows to say
    inlet_changes: str  # how the inlet velocity changes within the window, in words


@dataclass(frozen=True)
class KeyResult:
    """One quantity that a reader asks for first."""

    name: str
    value: float | str  # a number, or a regime in words
    error: float  # standard error of a number; NaN if unknown
    unit: str
    verdict: str  # in words
    holds: bool | None  # true: as expected; false: not as expected, or not to be used; None: nothing to compare with
    error_is_lower_bound: bool = False


@dataclass(frozen=True)
class LawComparison:
    """A value of the run beside that of a published law."""

    law: str
    computed: float
    expected: float
    ratio: float  # computed over expected
    unit: str
    outside_range: str  # arguments that lie outside of the range of the law, in words


@dataclass(frozen=True)
class EnergyLine:
    """A line of the energy budget at the end of a run."""

    group: str
    name: str
    energy: float  # [J]
    fraction: float  # of the input


@dataclass(frozen=True)
class Citation:
    """A law that a run has used, and where it was published."""

    kind: str
    name: str
    reference: str


def comparison(law: str, computed: float, expected: float, unit: str, outside_range: str = "") -> LawComparison:
    """Value of the run beside that of a law.

    >>> comparison("Ergun", 110.0, 100.0, "Pa").ratio
    1.1
    """
    return LawComparison(law, computed, expected, computed / expected if expected else math.nan, unit, outside_range)
