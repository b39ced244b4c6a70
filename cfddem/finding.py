"""One thing that speaks against a run, or for a second look at it."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import Literal

WIDTH = 100
"""Columns of a terminal."""


@dataclass(frozen=True)
class Finding:
    """One thing that speaks against a run."""

    colour: Literal["amber", "red"]
    key: str  # of the case
    reason: str  # what, with number and limit
    remedy: str

    def lines(self, opening: str = "") -> list[str]:
        """The finding as text, at most 100 columns wide."""
        return textwrap.wrap(f"{opening}{self.colour}: {self}", WIDTH, subsequent_indent="  ")

    def __str__(self) -> str:
        return f"{self.key}: {self.reason}; {self.remedy}"
