"""Motion of a few bodies as ordinary differential equations, advanced by Dormand and Prince's pair of orders 5 and 4.

A study brings its rates of change; `stepper` makes the step that belongs to them, compiled once and kept.
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

import numpy as np

from cfddem.kernels import kernel

STAGES = 7
# Dormand & Prince, J. Comput. Appl. Math. 6 (1980) 19; rows of the lower triangle one after the other
_WEIGHTS = np.array(
    [
        1 / 5,
        3 / 40, 9 / 40,
        44 / 45, -56 / 15, 32 / 9,
        19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729,
        9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656,
        35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84,
    ]
)  # fmt: skip
_ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
RELATIVE, ABSOLUTE = 1e-9, 1e-11
"""Error allowed in a step: the sum of a part of the value and a fixed amount."""


def rates(state, modes, numbers, slopes, at):
    """What a study brings: slopes[at : at + len(state)] = d(state)/dt, with discrete modes and fixed numbers."""


def _step(state, modes, numbers, length, slopes, end):
    """Try a step; writes the state at its end, returns its error over what is allowed.

    slopes  room for the slopes of all stages, one after the other; those of the first, at the start, are given, and
            those of the last are at the end
    """
    count = len(state)
    weight = 0
    for stage in range(1, STAGES):
        for row in range(count):
            change = 0.0
            for earlier in range(stage):
                change += _WEIGHTS[weight + earlier] * slopes[earlier * count + row]
            end[row] = state[row] + length * change
        weight += stage
        rates(end, modes, numbers, slopes, stage * count)
    worst = 0.0
    for row in range(count):
        error = 0.0
        for stage in range(STAGES):
            error += _ERROR[stage] * slopes[stage * count + row]
        allowed = ABSOLUTE + RELATIVE * max(abs(state[row]), abs(end[row]))
        size = abs(length * error) / allowed
        if not size <= worst:  # a NaN is the worst
            worst = size
    return worst


def stepper(study: Callable[..., Any], name: str) -> Any:
    """The step of one study, compiled; `study` is its compiled rates, `name` tells it apart in the cache."""
    names = {**_step.__globals__, "rates": study}
    step = FunctionType(_step.__code__, names, f"step_of_{name}")
    step.__qualname__ = step.__name__
    step.__module__ = _step.__module__
    return kernel(step)


@kernel
def next_length(length, error):
    """Length of the next step from the error of the last."""
    if not error < 1e300:
        return 0.1 * length
    return length * min(5.0, max(0.2, 0.9 * max(error, 1e-10) ** -0.2))
