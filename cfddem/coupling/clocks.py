"""How long a fluid step may be beside the clocks of the fluid itself; nothing is compiled here."""

from __future__ import annotations

MOST_SUBSTEPS = 50
"""A fluid step lasts at most as long as a collision: fifty steps of 2 % of the Hertz time."""

COURANT = 0.5
"""Part of a cell that fluid or particles may cross in a fluid step."""
