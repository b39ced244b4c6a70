"""Runs kept as folders: finished ones are read, interrupted ones are continued, missing ones are run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cfddem.case.schema import Case
from cfddem.io.reading import Run as Written
from cfddem.io.reading import open_run
from cfddem.run.runner import Run
from scenarios.validation.table import Progress


def finished(case: Case, folder: Path, name: str, progress: Progress, changes: dict[str, Any]) -> Written:
    """The finished run of a case with changes, in its folder; runs or continues it where needed."""
    home = folder / name

    def live(run: Run) -> None:
        progress(f"{name}: {run.simulation.time:.3g} of {run.end:g} s")

    if not (home / "run.json").exists():
        Run.begin(case.with_(**changes), home, report=live, progress=progress).go()
    elif open_run(home).status != "finished":
        Run.resume(home, report=live, progress=progress).go()
    return open_run(home)
