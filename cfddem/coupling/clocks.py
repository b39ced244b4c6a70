"""How long a fluid step may be beside the clocks of the fluid itself; nothing is compiled here."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

MOST_SUBSTEPS = 50
"""A fluid step lasts at most as long as a collision: fifty steps of 2 % of the Hertz time."""

COURANT = 0.5
"""Part of a cell that fluid or particles may cross in a fluid step."""


def crossing_rate(velocity: np.ndarray, spacing: Sequence[float]) -> float:
    """Cells that the fastest particle crosses in a second.

    velocity  of the particles (N, 3) [m/s]
    spacing   edges of a cell [m]

    >>> crossing_rate(np.array([[0.5, 0.0, -0.5], [0.0, 1.5, 0.0]]), (0.5, 0.5, 0.25))
    3.0
    """
    return max(float(np.abs(speed).max(initial=0.0)) / length for speed, length in zip(velocity.T, spacing))
