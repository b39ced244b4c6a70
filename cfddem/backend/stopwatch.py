"""Wall time of a run by parts of a step."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from cfddem.backend.compile import seconds_of_compilation

FIRST_CALLS = "first calls"
"""Name under which the first lap of every part is counted: compiled loops are loaded in it."""

COMPILATION = "compilation"
"""Name under which the compilation of loops is counted, in whatever part it happens."""


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
        self.start()

    def start(self) -> None:
        """Begin a lap; the time before it is not counted."""
        self._since, self._compiled = clock.perf_counter(), seconds_of_compilation()

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Count the time of a `with` block for a part."""
        self.start()
        yield
        self.lap(name)

    def lap(self, part: str) -> None:
        """Count the time since the last call for a part."""
        self.count(part if part in self._known else FIRST_CALLS)
        self._known.add(part)

    def count(self, part: str) -> None:
        """Count the time since the last call for a part, its first lap too."""
        now, compiled = clock.perf_counter(), seconds_of_compilation()
        compiling, seconds = compiled - self._compiled, self.seconds
        if compiling > 0.0:
            seconds[COMPILATION] = seconds.get(COMPILATION, 0.0) + compiling
        seconds[part] = seconds.get(part, 0.0) + now - self._since - compiling
        self._since, self._compiled = now, compiled
