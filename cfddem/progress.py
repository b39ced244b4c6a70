"""What a run says while it runs: one live line on a terminal, nothing where nobody watches."""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from cfddem.run import Run


class Line:
    """The live line."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._task = bar.add_task("preparing", total=1.0, status="")
        self._begun = clock.monotonic()

    def say(self, what: str) -> None:
        """What is being prepared."""
        self._bar.update(self._task, description=what)

    def update(self, run: Run) -> None:
        """How far the run is: simulated time, bed height, fastest particle, contacts, and the clock that binds."""
        row, simulation = run.row, run.simulation
        status = (
            f"{simulation.time:.3f}/{run.end:g} s  bed {1e3 * row['bed_height']:.0f} mm  "
            f"fastest {row['fastest']:.2g} m/s  {row['contact_count']:.0f} contacts  clock: {simulation.binding}"
        )
        self._bar.update(self._task, description="running", completed=simulation.time / run.end, status=status)


@contextmanager
def live_line() -> Iterator[Line]:
    """A line that lives as long as the block."""
    console = Console(stderr=True, quiet=not sys.stderr.isatty(), width=min(Console(stderr=True).width, 100))
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=12),
        TextColumn("{task.fields[status]}"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )
    with bar:
        yield Line(bar)
