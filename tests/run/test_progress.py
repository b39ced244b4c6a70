"""The progress of a run: the status line, the log file, and the live line."""

from __future__ import annotations

import gc
import io
import logging
import math
import re
import sys
from pathlib import Path

import pytest
from numba import njit
from rich.console import Console
from rich.progress import Progress

from cfddem.backend import stopwatch
from cfddem.backend.compile import _compilation, announce_compilation, announced, seconds_of_compilation
from cfddem.backend.errors import InputError
from cfddem.run.progress import ProgressLine, Status, columns, live_line


def status(time: float, remaining: float = 3725.0) -> Status:
    row = {"time": time, "bed_height": 0.0456, "largest_speed": 0.123, "contact_count": 789.0}
    return Status(time, 2.0, remaining, "collision", 12345, row)


def test_progress_shows_time_remaining_wall_time_and_measures() -> None:
    expected = "0.5/2 s  1:02:05 left  bed 45.6 mm  0.12 m/s  limit: collision  789 contacts  12345 steps"
    assert str(status(0.5)) == expected
    assert "  - left  " in str(status(0.5, math.nan))


def test_the_live_line_keeps_to_one_line_of_a_narrow_terminal() -> None:
    """At 80 columns what is less useful is left out; at 40, too, and never cut within a word."""
    assert status(0.5).within(68) == "0.5/2 s  1:02:05 left  bed 45.6 mm  0.12 m/s  limit: collision"
    for width in (80, 40):
        console = Console(width=width, file=io.StringIO(), force_terminal=True, color_system=None)
        bar = Progress(*columns(), console=console)
        ProgressLine(bar).update(status(1.0))
        console.print(bar.get_renderable())
        shown = re.sub("\x1b.*?m", "", console.file.getvalue()).rstrip("\n")  # type: ignore[attr-defined]
        assert "\n" not in shown and len(shown) <= width and re.search(r"(s|left|collision)\s*$", shown), shown


def test_the_log_gets_one_line_per_row_and_a_pipe_gets_none(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for time in (0.25, 0.5):  # a second run appends to the same file
        with live_line(tmp_path / "log.txt") as line:
            line.progress("pouring 10 particles")
            for _ in range(3):  # repeated between two rows
                line.update(status(time))
            logging.getLogger("cfddem").warning("a checkpoint is damaged")
    rows = (tmp_path / "log.txt").read_text().splitlines()
    assert [row[21:28] for row in rows] == ["pouring", "0.25/2 ", "a check", "pouring", "0.5/2 s", "a check"]
    assert capfd.readouterr().err == 2 * "cfddem: warning: a checkpoint is damaged\n"
    with pytest.raises(InputError, match=r"log = .*: must be a writable file"), live_line(tmp_path):
        pass


def test_the_live_line_shows_preparation_and_compilation(monkeypatch: pytest.MonkeyPatch) -> None:
    bar = Progress(disable=True)
    line, seen, looking = ProgressLine(bar), [], []

    def compiling(what: str) -> None:
        line.compiling(what)
        seen.append((bar.tasks[0].description, bar.tasks[0].fields["status"]))
        looking.append(gc.isenabled())

    line.progress("pouring 10 particles")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    spent = seconds_of_compilation()
    before = announce_compilation(compiling)
    try:
        helper = njit(lambda x: 2.0 * x)
        njit(lambda x: helper(x) + 1.0)(1.0)
    finally:
        announce_compilation(before)
    assert seconds_of_compilation() > spent
    assert looking == [False, True] and gc.isenabled()  # Python looks for no garbage within a compilation
    (before, told), (after, nothing) = seen
    assert before == after == "pouring 10 particles"
    assert re.fullmatch(r"compiling loop \d+ \(kept for next time\) \.\.\.", told) and nothing == ""


def test_where_there_is_no_terminal_one_line_says_that_loops_are_compiled(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(_compilation, "compiled", 0)
    before = announce_compilation(announced)
    try:
        for factor in (2.0, 3.0):
            njit(lambda x, factor=factor: factor * x)(1.0)
    finally:
        announce_compilation(before)
    assert capfd.readouterr().err == "cfddem: compiling loops, up to two minutes the first time\n"


def test_compilation_is_counted_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    spent = iter((0.0, 4.0, 4.0))
    times = iter((10.0, 15.0, 17.0))
    monkeypatch.setattr(stopwatch, "seconds_of_compilation", lambda: next(spent))
    monkeypatch.setattr(stopwatch.clock, "perf_counter", lambda: next(times))
    watch = stopwatch.Stopwatch()
    watch.lap("fluid")
    watch.lap("fluid")
    assert watch.seconds == {"compilation": 4.0, "first calls": 1.0, "fluid": 2.0}
