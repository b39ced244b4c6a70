"""Where the wall time of a run goes, part by part of a step."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping

FIRST_CALLS = "first calls"
"""What the first lap of every part is counted as: loops are compiled or loaded in it."""


class Stopwatch:
    """Wall time by part, lap by lap; a lap costs less than a microsecond.

    seconds  name of a part -> wall time spent so far, also by the process before [s]

    >>> watch = Stopwatch({"fluid": 2.0})
    >>> watch.start()
    >>> watch.lap("fluid")
    >>> sorted(watch.seconds), watch.seconds["fluid"]
    (['first calls', 'fluid'], 2.0)
    """

    def __init__(self, seconds: Mapping[str, float] | None = None) -> None:
        self.seconds: dict[str, float] = dict(seconds or {})
        self._known: set[str] = set()
        self._since = clock.perf_counter()

    def start(self) -> None:
        """What has passed until now belongs to no part."""
        self._since = clock.perf_counter()

    def lap(self, part: str) -> None:
        """What has passed since the last call belongs to a part."""
        now = clock.perf_counter()
        name = part if part in self._known else FIRST_CALLS
        self._known.add(part)
        self.seconds[name] = self.seconds.get(name, 0.0) + now - self._since
        self._since = now
