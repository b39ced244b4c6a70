"""Progress of a run: a live line on the terminal, and a log file if one is given.

Both show the time, the remaining wall time, the criterion that limits the step, and a few measures. If standard error
is not a terminal, one line says that loops are compiled, and nothing else is printed.
"""

from __future__ import annotations

import logging
import math
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from cfddem.backend.compile import announce_compilation, announced
from cfddem.backend.errors import CfddemError, InputError
from cfddem.backend.launch import TERMINAL

_log = logging.getLogger("cfddem.run.progress")

BAR = 10
"""Length of the bar [characters]."""


@dataclass(frozen=True)
class Status:
    """Progress of a run."""

    time: float  # simulated time [s]
    end: float  # of the run [s]
    remaining: float  # wall time, from the pace so far; NaN before the first step [s]
    criterion: str  # that limits the fluid step; empty before the first step
    steps: int  # particle steps so far
    row: Mapping[str, float]  # last row of the history

    def __str__(self) -> str:
        return "  ".join(self._parts())

    def within(self, columns: int) -> str:
        """The status without the parts at its end for which there is no room."""
        parts = self._parts()
        while len(parts) > 1 and len("  ".join(parts)) > columns:
            parts.pop()
        return "  ".join(parts)

    def _parts(self) -> list[str]:
        """Parts of the status, the most useful first."""
        row = self.row
        return [
            f"{self.time:.4g}/{self.end:g} s", f"{_duration(self.remaining)} left",
            f"bed {1e3 * row['bed_height']:.3g} mm", f"{row['largest_speed']:.2g} m/s",
            f"limit: {self.criterion or '-'}", f"{row['contact_count']:.0f} contacts", f"{self.steps} steps",
        ]  # fmt: skip


class ProgressLine:
    """The live line, and the log if there is one."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._task = bar.add_task("preparing", total=1.0, status="")
        self._logged = -math.inf

    def progress(self, text: str) -> None:
        """Show which part of the preparation is under way."""
        self._bar.update(self._task, description=text)
        _log.info(text)

    def compiling(self, text: str) -> None:
        """Show which loop is being compiled; an empty text when it is done."""
        self._bar.update(self._task, status=text, refresh=True)

    def update(self, status: Status) -> None:
        """Show the progress of the run; the log gets one line for each row of the history."""
        room = self._bar.console.width - BAR - 2  # and the spaces between the columns
        self._bar.update(self._task, description="", completed=status.time / status.end, status=status.within(room))
        if status.row["time"] > self._logged:
            self._logged = status.row["time"]
            _log.info(str(status))


def columns() -> tuple[TextColumn | BarColumn, ...]:
    """Columns of the live line: what is being done, how far, and the status."""
    return TextColumn("{task.description}"), BarColumn(bar_width=BAR), TextColumn("{task.fields[status]}")


@contextmanager
def live_line(log: Path | None = None, shown: bool = True) -> Iterator[ProgressLine]:
    """Show a progress line inside a `with` block.

    shown   whether this process shows and logs anything; of several ranks only one does
    log     file to which one line per row of history, and every warning, is appended
    errors  InputError if the log cannot be written
    """
    terminal = sys.stderr.isatty() or TERMINAL in os.environ
    width = min(Console(stderr=True).width, 120)
    console = Console(stderr=True, quiet=not (shown and terminal), force_terminal=terminal or None, width=width)
    bar = Progress(*columns(), console=console, transient=True)
    with _logged(log if shown else None), bar:
        line = ProgressLine(bar)
        before = announce_compilation(None if not shown else line.compiling if terminal else announced)
        try:
            yield line
        finally:
            announce_compilation(before)


@contextmanager
def _logged(path: Path | None) -> Iterator[None]:
    """Append the messages of the package to a file; warnings still go to the terminal."""
    if path is None:
        yield
        return
    try:
        handler = logging.FileHandler(path)
    except OSError as failure:
        raise InputError("log", str(path), "a writable file", (failure.strerror or "").lower()) from None
    handler.setFormatter(logging.Formatter("%(asctime)s  %(message)s", "%Y-%m-%d %H:%M:%S"))
    package = logging.getLogger("cfddem")
    before = package.level
    terminal = logging.StreamHandler()
    terminal.setLevel(logging.WARNING)
    terminal.setFormatter(logging.Formatter("cfddem: warning: %(message)s"))
    for target in (handler, terminal):
        package.addHandler(target)
    package.setLevel(logging.INFO)
    try:
        yield
    except CfddemError as failure:
        _log.info(failure)
        raise
    finally:
        package.setLevel(before)
        for target in (handler, terminal):
            package.removeHandler(target)
        handler.close()


def _duration(seconds: float) -> str:
    return "-" if math.isnan(seconds) else str(timedelta(seconds=round(seconds)))
