"""Wall time of a run by parts of a step."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

FIRST_CALLS = "first calls"
"""Name under which the first lap of every part is counted: loops are compiled or loaded in it."""


class Stopwatch:
    """Wall time by part, lap by lap; a lap costs less than a microsecond.

    seconds  name of a part -> wall time spent so far, that of the run before a restart included [s]

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
        """Begin a lap; the time before it is not counted."""
        self._since = clock.perf_counter()

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Count the time of a `with` block for a part."""
        self.start()
        yield
        self.lap(name)

    def lap(self, part: str) -> None:
        """Count the time since the last call for a part."""
        now = clock.perf_counter()
        name = part if part in self._known else FIRST_CALLS
        self._known.add(part)
        self.seconds[name] = self.seconds.get(name, 0.0) + now - self._since
        self._since = now
