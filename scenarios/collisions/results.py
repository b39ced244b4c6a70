"""Results of collisions as plain values for JSON."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """The value with lists for tuples, floats for numpy's, and None for NaN and infinity.

    >>> plain({"spin": (1.0, float("nan")), "outcome": "stick"})
    {'spin': [1.0, None], 'outcome': 'stick'}
    """
    if isinstance(value, dict):
        return {name: plain(each) for name, each in value.items()}
    if isinstance(value, tuple):
        return [plain(each) for each in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value
