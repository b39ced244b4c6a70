"""Runs from a notebook or a script: one call that checks, runs with a progress bar, and opens the result."""

from __future__ import annotations

import html
import shutil
import sys
import time as clock
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cfddem.backend.compile import announce_compilation
from cfddem.backend.errors import CfddemError, InputError
from cfddem.case.schema import Case
from cfddem.io.folder import read_about
from cfddem.io.reading import RunData, open_run
from cfddem.model.feature import Feature, Function
from cfddem.model.fields import Field
from cfddem.preflight.summary import refuse_errors
from cfddem.run import runner
from cfddem.run.progress import Status, live_line
from cfddem.run.simulation import Callback
from cfddem.run.warmup import warmup

PAUSE = 0.2
"""Shortest wall time between two changes of the bar [s]."""


def run_case(
    case: Case,
    folder: str | Path,
    *,
    overwrite: bool = False,
    fields: Sequence[Field] = (),
    callbacks: Sequence[Callback] = (),
    features: Sequence[Feature | Function] = (),
) -> RunData:
    """Check a case, run it in a new folder with a progress bar, and open the result.

    overwrite          delete the run that the folder holds
    fields, callbacks, features  of the simulation
    returns            the run, to read its fields and history
    errors             PreflightError if the check finds errors; InputError if the folder holds a run,
                       or, with overwrite, a run.json that is not that of a run

    >>> from cfddem import gallery
    >>> run = run_case(gallery()["liquid-bed"], "bed")    # doctest: +SKIP
    """
    folder = Path(folder)
    for issue in refuse_errors(case).to_act_on:
        print("\n".join(issue.lines()), file=sys.stderr)
    if overwrite and (folder / "run.json").exists():
        _delete_run(folder)
    with notebook_line() if in_notebook() else live_line() as line:
        with warmup(case):
            prepared = runner.Run.begin(
                case, folder, report=line.update, progress=line.progress, fields=fields, callbacks=callbacks,
                features=features,
            )  # fmt: skip
        prepared.go()
    return open_run(folder)


def _delete_run(folder: Path) -> None:
    """Delete a run folder; a folder of something else is refused."""
    try:
        read_about(folder)
    except CfddemError as failure:
        remedy = "choose another folder, or delete this one yourself"
        raise InputError("folder", str(folder), "a run folder to be overwritten", remedy) from failure
    shutil.rmtree(folder)


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    ipython: Any = sys.modules.get("IPython")
    return ipython is not None and getattr(ipython.get_ipython(), "kernel", None) is not None


@contextmanager
def notebook_line() -> Iterator[NotebookLine]:
    """Show a progress bar below the cell inside a `with` block."""
    line = NotebookLine()
    before = announce_compilation(line.compiling)
    try:
        yield line
    finally:
        announce_compilation(before)
        line.end()


class NotebookLine:
    """A progress bar below a cell, with the methods of `ProgressLine`."""

    def __init__(self) -> None:
        from IPython.display import HTML, display

        self._make: Any = HTML
        self._handle: Any = display(HTML(""), display_id=True)  # type: ignore[no-untyped-call]
        self._part, self._status, self._shown_at = 0.0, "", 0.0

    def progress(self, text: str) -> None:
        """Show which part of the preparation is under way."""
        self._show(text)

    def compiling(self, text: str) -> None:
        """Show which loop is being compiled; an empty text when it is done."""
        self._show(text or self._status)

    def update(self, status: Status) -> None:
        """Show the progress of the run."""
        self._part, self._status = status.time / status.end, str(status)
        if clock.monotonic() - self._shown_at > PAUSE:
            self._show(self._status)

    def end(self) -> None:
        """Show the last status."""
        self._show(self._status)

    def _show(self, text: str) -> None:
        self._shown_at = clock.monotonic()
        bar = f'<progress value="{self._part:.3f}" max="1" style="width: 160px"></progress>'
        self._handle.update(self._make(f"{bar} <code>{html.escape(text)}</code>"))
