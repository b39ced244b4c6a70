"""Runs that are kept as folders: what is there is read, what was stopped goes on, what is missing is made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cfddem.case import Case
from cfddem.record.reading import Run as Written
from cfddem.record.reading import open_run
from cfddem.run import Run
from scenarios.validation import Tell


def finished(case: Case, folder: Path, name: str, tell: Tell, changes: dict[str, Any]) -> Written:
    """The run of a changed case in its folder: made, gone on with, or there already."""
    home = folder / name

    def live(run: Run) -> None:
        tell(f"{name}: {run.simulation.time:.3g} of {run.end:g} s")

    if not (home / "run.json").exists():
        Run.begin(case.with_(**changes), home, report=live, progress=tell).go()
    elif open_run(home).status != "finished":
        Run.resume(home, report=live, progress=tell).go()
    return open_run(home)
