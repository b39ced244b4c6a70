"""One warning or error of the pre-run check."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from typing import Literal

WIDTH = 100
"""Columns of printed text."""

Severity = Literal["warning", "error"]


@dataclass(frozen=True)
class Issue:
    """A reason why a run will fail (error) or may give wrong or useless results (warning)."""

    severity: Severity
    key: str  # of the case
    reason: str  # what is wrong, with number and limit
    remedy: str
    in_report: bool = True  # false: about time, memory or disk, or counted in the run itself

    def lines(self, opening: str = "") -> list[str]:
        """The issue as text, at most 100 columns wide."""
        return textwrap.wrap(f"{opening}{self.severity}: {self}", WIDTH, subsequent_indent="  ")

    def __str__(self) -> str:
        return f"{self.key}: {self.reason}; {self.remedy}"


def rounded_up(value: float) -> float:
    """A positive value with two digits, not below it.

    >>> rounded_up(2.527e6), rounded_up(0.0101), rounded_up(3.0)
    (2600000.0, 0.011, 3.0)
    """
    place = math.floor(math.log10(value)) - 1
    return float(f"{math.ceil(round(value / 10.0**place, 9))}e{place}")


def percent(part: float) -> str:
    """A part as per cent, without a power of ten.

    >>> percent(0.0204), percent(1.44)
    ('2.04 %', '144 %')
    """
    return f"{100.0 * part:.3g} %" if part < 1.0 else f"{100.0 * part:.0f} %"
