"""Results that are kept: finished ones are read, missing ones are computed.

A run is kept as its folder, and continued if it was interrupted; numbers are kept as a JSON file.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cfddem.case.schema import Case
from cfddem.io.files import lock_file
from cfddem.io.reading import RunData, open_run
from cfddem.run.progress import Status
from cfddem.run.runner import Run
from scenarios.validation.table import Progress, replacing


def finished(case: Case, folder: Path, name: str, progress: Progress, changes: dict[str, Any]) -> RunData:
    """The finished run of a case with changes, in its folder; runs or continues it where needed."""
    return _continued(case.with_(**changes), folder / name, progress)


def advanced(case: Case, folder: Path, name: str, progress: Progress, until: float) -> None:
    """Advance the run of a case in its folder to a time [s]; nothing if it is there. A later time continues it."""
    _continued(case.with_(**{"run.until": until}), folder / name, progress, until)


def _continued(case: Case, home: Path, progress: Progress, until: float = 0.0) -> RunData:
    """A run in its folder, finished, and gone on to a time [s]."""

    def live(status: Status) -> None:
        progress(f"{home.name}: {status.time:.3g} of {status.end:g} s")

    if not (home / "run.json").exists():
        Run.begin(case, home, report=live, progress=progress).go()
        return open_run(home)
    run = open_run(home)
    reached = max(run.times.tolist(), default=0.0)
    if run.status != "finished" or reached < until * (1.0 - 1e-9):
        end = max(until, reached) if until else None
        Run.resume(home, until=end, report=live, progress=progress).go()
    return open_run(home)


@contextmanager
def taken(folder: Path, name: str) -> Iterator[bool]:
    """Whether this process has got a run for itself; it keeps it inside of the `with` block."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f".{name}.lock").open("w", encoding="utf-8") as file:
        yield lock_file(file)


def kept(path: Path, compute: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Numbers by name from a file; computed and written where there is none.

    Delete the file to compute them again.
    """
    if not path.exists():
        numbers = compute()
        with replacing(path) as fresh:
            fresh.write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    runs: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return runs
