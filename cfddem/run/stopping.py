"""When a run ends before its time: by SIGINT or SIGTERM, between two steps, or by the errors of its means."""

from __future__ import annotations

import signal
import threading
from collections.abc import Mapping
from types import TracebackType
from typing import Any

import numpy as np

from cfddem.analysis.series import block_average, stationarity
from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError, nearest
from cfddem.case.schema import Case
from cfddem.run.history import all_columns


class StopRequest:
    """Catches SIGINT and SIGTERM inside a `with` block; true after the first one.

    A second signal acts as usual, so that a second Ctrl-C ends the process at once. Outside of the main thread no
    signal is caught.
    """

    def __init__(self) -> None:
        self.signal = 0  # number of the signal that was received; 0 before
        self._before: dict[int, Any] = {}

    def __bool__(self) -> bool:
        return self.signal != 0

    @property
    def name(self) -> str:
        """Name of the signal."""
        return signal.Signals(self.signal).name

    def agreed(self, communicator: Communicator) -> bool:
        """Whether a rank has received a signal; then all ranks take it for theirs."""
        number = communicator.largest([self.signal])
        if number:  # a signal that came during the call is found by the next one
            self.signal = number
        return bool(number)

    def __enter__(self) -> StopRequest:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._receive) for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _receive(self, number: int, _: Any) -> None:
        self.signal = number
        signal.signal(number, self._before[number])


# ---------------------------------------------------------------- errors of means


FEWEST_INDEPENDENT = 16.0
"""Fewest uncorrelated values in a mean; with fewer, an error that is small by chance would end the run."""


def require_measures_of(case: Case) -> None:
    """Refuse names in `run.until_error` that are no measures of the case."""
    measures = sorted(name for name, quantity in all_columns(case).items() if quantity.group == "measure")
    for name in case.run.until_error:
        if name not in measures:
            raise InputError("run.until_error", name, nearest(name, measures))


def averages_from(history: Mapping[str, np.ndarray], limits: Mapping[str, float], earliest: float = 0.0) -> float:
    r"""Start of the averages once every mean is known; NaN while one is not.

    .. math:: \frac{s}{|\bar x|} \le \mathrm{limit}

    history   columns in time
    limits    largest standard error s of each mean over the mean [-]
    earliest  start of averages, if the start-up ends before it [s]
    returns   time at which the longest start-up ends [s]; NaN if a series is not stationary, its record too short for
              its correlation time, it has fewer than 16 uncorrelated values, or its error is above the limit

    Start-up and stationarity are those of :func:`cfddem.analysis.series.stationarity`, errors those of
    :func:`cfddem.analysis.series.block_average`.
    """
    series = [stationarity(history[name]) for name in limits]
    if not series or not all(one.stationary for one in series):
        return float("nan")
    start = max(int(np.searchsorted(history["time"], earliest)), *(one.start for one in series))
    all_known = all(_is_known(history[name][start:], limit) for name, limit in limits.items())
    return float(history["time"][start]) if all_known else float("nan")


def _is_known(values: np.ndarray, limit: float) -> bool:
    average = block_average(values)
    return average.enough and average.independent >= FEWEST_INDEPENDENT and average.error <= limit * abs(average.mean)
