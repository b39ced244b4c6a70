"""What a run says while it runs: a live line on a terminal, nothing where nobody watches, and a log where one is asked.

Lines of the log and of the terminal say the same: how far, how fast, which clock binds, and how long it will take.
"""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from cfddem.errors import CfddemError, InputError
from cfddem.kernels import announce_compilation

if TYPE_CHECKING:
    from cfddem.run import Run

_log = logging.getLogger("cfddem.progress")


class Line:
    """The live line, and the log where there is one."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._task = bar.add_task("preparing", total=1.0, status="")
        self._logged = -math.inf

    def say(self, what: str) -> None:
        """What is being prepared."""
        self._bar.update(self._task, description=what)
        _log.info(what)

    def compiling(self, what: str) -> None:
        """Which loop is being compiled meanwhile; an empty text when it is done."""
        self._bar.update(self._task, status=what, refresh=True)

    def update(self, run: Run) -> None:
        """How far the run is; the log gets a line for every row of history."""
        status = status_of(run)
        self._bar.update(self._task, description="", completed=run.simulation.time / run.end, status=status)
        if run.row["time"] > self._logged:
            self._logged = run.row["time"]
            _log.info(status)


def status_of(run: Run) -> str:
    """Time, wall time left, the clock that binds, steps, bed height, fastest particle, contacts: first what matters."""
    row, simulation = run.row, run.simulation
    return (
        f"{simulation.time:.4g}/{run.end:g} s  {_duration(run.remaining)} left  clock: {simulation.binding or '-'}  "
        f"{simulation.particles.steps} steps  bed {1e3 * row['bed_height']:.3g} mm  {row['fastest']:.2g} m/s  "
        f"{row['contact_count']:.0f} contacts"
    )


def _duration(seconds: float) -> str:
    return "-" if math.isnan(seconds) else str(timedelta(seconds=round(seconds)))


@contextmanager
def live_line(log: Path | None = None) -> Iterator[Line]:
    """A line that lives as long as the block.

    log  file that gets a line for every row of history, and every warning; what stands in it is kept
    """
    console = Console(stderr=True, quiet=not sys.stderr.isatty(), width=min(Console(stderr=True).width, 120))
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=10),
        TextColumn("{task.fields[status]}"),
        console=console,
        transient=True,
    )
    with _logged(log), bar:
        line = Line(bar)
        announce_compilation(line.compiling)
        try:
            yield line
        finally:
            announce_compilation()


@contextmanager
def _logged(path: Path | None) -> Iterator[None]:
    """All that the package says goes to a file, too."""
    if path is None:
        yield
        return
    try:
        handler = logging.FileHandler(path)
    except OSError as refusal:
        raise InputError("log", str(path), "a file that can be written", (refusal.strerror or "").lower()) from None
    handler.setFormatter(logging.Formatter("%(asctime)s  %(message)s", "%Y-%m-%d %H:%M:%S"))
    package = logging.getLogger("cfddem")
    before = package.level
    terminal = logging.StreamHandler()  # warnings go there without a log, and still do
    terminal.setLevel(logging.WARNING)
    for each in (handler, terminal):
        package.addHandler(each)
    package.setLevel(logging.INFO)
    try:
        yield
    except CfddemError as failure:
        _log.info(failure)
        raise
    finally:
        package.setLevel(before)
        for each in (handler, terminal):
            package.removeHandler(each)
        handler.close()
