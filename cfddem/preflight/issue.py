"""One error, warning or note of the pre-run check."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from typing import Literal

from cfddem.backend.tables import line_width

Severity = Literal["note", "warning", "error"]
"""An error stops the run, a warning says what to change, a note needs no action."""

ORDER: tuple[Severity, ...] = ("error", "warning", "note")
"""Severities in the order in which they are printed."""


@dataclass(frozen=True)
class Issue:
    """Why a run will fail (error), why it may give wrong or useless results (warning), or what else to know (note)."""

    severity: Severity
    key: str  # of the case
    reason: str  # what is wrong, with number and limit
    remedy: str
    in_report: bool = True  # false: about time, memory or disk, or told by the report itself

    def lines(self, opening: str = "") -> list[str]:
        """The issue as text, at most 100 columns wide."""
        return textwrap.wrap(f"{opening}{self.severity}: {self}", line_width(), subsequent_indent="  ")

    def __str__(self) -> str:
        return f"{self.key}: {self.reason}; {self.remedy}"


def rounded_up(value: float) -> float:
    """A positive value with two digits, not below it.

    >>> rounded_up(2.527e6), rounded_up(0.0101), rounded_up(3.0)
    (2600000.0, 0.011, 3.0)
    """
    place = math.floor(math.log10(value)) - 1
    return float(f"{math.ceil(round(value / 10.0**place, 9))}e{place}")


def plain(value: float) -> str:
    """A number without a power of ten where it has few digits.

    >>> plain(1.5e6), plain(680000.0), plain(220.3), plain(1.7e-8), plain(2.6e9)
    ('1500000', '680000', '220', '1.7e-08', '2.6e+09')
    """
    return f"{value:.0f}" if 100.0 <= value < 1e8 else f"{value:.3g}"


def percent(part: float) -> str:
    """A part as per cent, without a power of ten below a million.

    >>> percent(0.0204), percent(1.44)
    ('2.04 %', '144 %')
    """
    return f"{100.0 * part:.3g} %" if part < 1.0 or part > 1e4 else f"{100.0 * part:.0f} %"
