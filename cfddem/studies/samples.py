"""Values of several keys at once: ranges, and samples that fill them evenly."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError, nearest
from cfddem.case.gallery import full_key
from cfddem.studies.sweep import Over, ranges

Array = NDArray[np.float64]

KINDS = ("latin", "sobol")
"""Samples: Latin hypercube, and the sequence of Sobol."""

MOST_VARIABLES, MOST_SAMPLES = 20, 10_000

DIGITS = 6
"""Significant digits of a sampled value, so that it can be read and typed."""


class Variable(NamedTuple):
    """A key and the range of its values."""

    key: str
    low: float
    high: float
    logarithmic: bool = False

    def value(self, share: float) -> float:
        """The value at a share of the range, 0 at the lower end.

        >>> Variable("a", 1.0, 3.0).value(0.5), Variable("a", 1.0, 100.0, True).value(0.5)
        (2.0, 10.0)
        """
        if self.logarithmic:
            number = math.exp((1.0 - share) * math.log(self.low) + share * math.log(self.high))
        else:
            number = (1.0 - share) * self.low + share * self.high
        return min(max(float(f"{number:.{DIGITS}g}"), self.low), self.high)

    def share(self, value: float) -> float:
        """The share of the range at a value."""
        if self.logarithmic:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


def variables(texts: Sequence[str], key_of: Callable[[str], str] = full_key) -> list[Variable]:
    """Keys and ranges from texts such as `friction=0.1..0.5` and `viscosity=1e-4..1e-2 log`.

    key_of  gives the whole name of a key
    errors  InputError for an unknown key or a range that is none

    >>> variables(["inlet_velocity=0.02..0.05", "fluid.viscosity=1e-4..1e-2 log"])[1]
    Variable(key='fluid.viscosity', low=0.0001, high=0.01, logarithmic=True)
    """
    varied: list[Variable] = []
    for text_of_key in texts:
        key, _, text = text_of_key.partition("=")
        span = re.fullmatch(r"\s*([-+.\deE]{1,30}?)\s*\.\.\s*([-+.\deE]{1,30})(\s+log)?\s*", text)
        try:
            low, high = (float(span[1]), float(span[2])) if span else (math.nan, math.nan)
        except ValueError:
            low = high = math.nan
        if not low < high < math.inf:
            raise InputError(
                "--vary", text_of_key, "key=low..high, such as friction=0.1..0.5; for a log scale, add ' log'"
            )
        name, logarithmic = key_of(key.strip()), bool(span and span[3])
        if logarithmic and low <= 0.0:
            raise InputError("--vary", text_of_key, "a range above 0 for a log scale")
        if name in [variable.key for variable in varied]:
            raise InputError("--vary", name, "given once")
        varied.append(Variable(name, low, high, logarithmic))
    if not 1 <= len(varied) <= MOST_VARIABLES:
        raise InputError("--vary", len(varied), f"given 1 to {MOST_VARIABLES} times")
    return varied


def chosen_values(over: Sequence[str], vary: Sequence[str], kind: str, count: int) -> Over:
    """Values of a sweep: all combinations of listed values, or samples of ranges.

    errors  InputError unless one of the two is given
    """
    if bool(over) == bool(vary):
        raise InputError("--over", None, "given, or --vary, and only one of them")
    return ranges(over) if over else samples(variables(vary), count, kind)


def samples(varied: Sequence[Variable], count: int, kind: str, seed: int = 1) -> list[dict[str, Any]]:
    """Values of all keys that fill their ranges evenly, one set for each run.

    count    of sets
    kind     one of KINDS
    errors   InputError for an unknown kind or a wrong count
    """
    if not 1 <= count <= MOST_SAMPLES:
        raise InputError("--runs", count, f"1 to {MOST_SAMPLES}")
    return [{variable.key: variable.value(share) for variable, share in zip(varied, row)} for row in unit_samples(
        len(varied), count, kind, seed)]  # fmt: skip


def unit_samples(dimensions: int, count: int, kind: str, seed: int = 1) -> Array:
    """Points in the unit cube (count, dimensions), by :mod:`scipy.stats.qmc`."""
    from scipy.stats import qmc

    if kind not in KINDS:
        raise InputError("--sample", kind, nearest(kind, KINDS))
    if kind == "latin":
        return np.asarray(qmc.LatinHypercube(dimensions, seed=seed).random(count))
    drawn = qmc.Sobol(dimensions, scramble=True, seed=seed).random_base2(max(0, math.ceil(math.log2(count))))
    return np.asarray(drawn[:count])
