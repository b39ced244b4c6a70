"""The list of all golden runs; modules that declare runs add to it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

State = dict[str, np.ndarray]

FOLDER = Path(__file__).parents[1] / "data" / "golden"

RUNS: dict[str, Callable[[], State]] = {}
"""All runs by name."""


def golden(function: Callable[[], State]) -> Callable[[], State]:
    """Count a function among the runs."""
    RUNS[function.__name__] = function
    return function
