"""One warning or error of the pre-run check."""

from __future__ import annotations

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

    def lines(self, opening: str = "") -> list[str]:
        """The issue as text, at most 100 columns wide."""
        return textwrap.wrap(f"{opening}{self.severity}: {self}", WIDTH, subsequent_indent="  ")

    def __str__(self) -> str:
        return f"{self.key}: {self.reason}; {self.remedy}"


def percent(part: float) -> str:
    """A part as per cent, without a power of ten.

    >>> percent(0.0204), percent(1.44)
    ('2.04 %', '144 %')
    """
    return f"{100.0 * part:.3g} %" if part < 1.0 else f"{100.0 * part:.0f} %"
