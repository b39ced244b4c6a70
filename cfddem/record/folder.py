"""What a folder must look like to be a run, and what stands in it before any field is read."""

from __future__ import annotations

import fcntl
import json
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.errors import InputError, RunFailed
from cfddem.record.files import cannot
from cfddem.record.index import POINTS, Layout, Snapshot

FORMAT = 1
"""Of the run folder; a reader refuses a newer one."""

OWN = ("run.json", "run.vtkhdf", "history.h5", "checkpoint")
"""Names that make a folder a run."""


def read_about(folder: Path) -> dict[str, Any]:
    """What `run.json` says.

    errors  InputError where the folder holds no run, or one of a newer format
    """
    path = folder / "run.json"
    try:
        about: dict[str, Any] = json.loads(path.read_text())
        found = int(about["format"])
    except FileNotFoundError:
        raise InputError("folder", str(folder), "the folder of a run", "run.json is not in it") from None
    except OSError as refusal:
        raise cannot("read", path, refusal) from refusal
    except (ValueError, KeyError, TypeError) as damage:
        raise RunFailed(f"{path}: is damaged ({damage}); put back a copy of it, the snapshots are in data/") from damage
    if found > FORMAT:
        raise InputError(
            f"{path}: format", found, f"at most {FORMAT}", "the run was written by a newer cfddem; update this one"
        )
    return about


def scan(folder: Path) -> tuple[list[Snapshot], Layout | None]:
    """All snapshots of a run by looking into each, and their layout."""
    found: list[Snapshot] = []
    layout = None
    for path in sorted((folder / "data").glob("*.h5")):
        snapshot, layout = look(path)
        found.append(snapshot)
    return found, layout


def look(path: Path) -> tuple[Snapshot, Layout]:
    """What one snapshot holds.

    errors  RunFailed where the file is damaged
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            particles = file.get("particles", {})
            count = len(particles[POINTS]) if POINTS in particles else 0
            snapshot = Snapshot(path.name, float(file.attrs["time"]), int(file.attrs["step"]), count)
            return snapshot, Layout.of(file.get("fluid", {}), particles)
    except (OSError, KeyError) as damage:
        raise RunFailed(f"{path}: is no whole snapshot ({damage}); move it out of the folder and go on") from damage


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """The columns of a history, or nothing where none was written."""
    import h5py

    if not path.exists():
        return {}
    try:
        with h5py.File(path, "r") as file:
            return {name: each[:] for name, each in file.items()}
    except OSError as damage:
        raise RunFailed(f"{path}: is no whole history ({damage}); move it out of the folder and go on") from damage


def refuse_taken(folder: Path, case_text: str) -> None:
    """Never write into a folder that holds a run, or a file where the folder should be.

    A run that was killed before its first byte of data is no run: the same case may begin there again.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError("output", str(folder), "a folder", "a file of that name is there")
    taken = [name for name in OWN if (folder / name).exists()]
    if any((folder / "data").glob("*.h5")):
        taken.append("data")
    if (folder / "case.toml").exists() and (folder / "case.toml").read_text() != case_text:
        taken.append("case.toml")
    if taken:
        raise InputError(
            "output",
            str(folder),
            f"a folder that holds no run yet ({', '.join(taken)} found)",
            f"go on with `cfddem resume {folder}`, or give another folder",
        )


def make_room(folder: Path) -> None:
    """Make the folder of a run, or say why it cannot be; before any work is done for it."""
    try:
        (folder / "data").mkdir(parents=True, exist_ok=True)
    except OSError as refusal:
        reason = (refusal.strerror or str(refusal)).lower()
        raise InputError("output", str(folder), "a folder that can be written to", reason) from refusal


def lock(folder: Path) -> Any:
    """Hold a run for this process alone; the lock ends with the process, however it ends."""
    path = folder / ".lock"
    try:
        file = path.open("w")
    except OSError as refusal:
        raise cannot("write", path, refusal) from refusal
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        raise InputError("folder", str(folder), "free", "another process is writing this run now") from None
    except OSError:  # a file system without locks: nothing to hold
        pass
    return file
