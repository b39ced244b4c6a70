"""The rules of a run folder: what makes a folder a run, which formats are read, who may write it, its provenance."""

from __future__ import annotations

import json
import os
import platform
import re
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

import numpy as np

from cfddem import __version__
from cfddem.backend.errors import InputError
from cfddem.case import compare
from cfddem.case.schema import Case
from cfddem.case.walls import copy_of, with_surfaces
from cfddem.io.files import (
    damage_named,
    disk_error,
    lock_file,
    opened,
    reason,
    require_about,
    require_columns,
    require_format,
    require_no_links,
    write_whole,
)
from cfddem.io.index import POINTS, Layout, Snapshot

FORMAT = 2
"""Format of run folders. Folders of any other format are refused."""

RUN_FILES = ("run.json", "run.vtkhdf", "history.h5", "checkpoint")
"""A folder that holds one of these files holds a run."""

NUMBERED = re.compile(r"\d{8}\.h5")
"""Name of a snapshot."""

OWN_FILES = ("case.toml", "data", "surfaces", "measured")
"""What a run that was killed before it wrote any data leaves in its folder, beside hidden files."""

WRITTEN = (*RUN_FILES, *OWN_FILES, ".lock")
"""Everything that a run writes in its folder."""

MOST_NAMED = 6
"""Most files or runs that an error names."""

AVERAGES_FROM = "averages_from"
"""Entry of `run.json`: start of averages in a run that ended because its means were known [s]."""


def read_about(folder: Path) -> dict[str, Any]:
    """The content of `run.json`.

    errors  InputError if the folder holds no run or a run of another format; RunFailed if the file is damaged
    """
    path, remedy = folder / "run.json", "restore it, the snapshots are in data/"
    try:
        text = path.read_bytes()
    except NotADirectoryError:
        raise InputError("folder", str(folder), "a run folder", "it is a file") from None
    except FileNotFoundError:
        inside = [run.name for run in runs_inside(folder)]
        why = "it contains no run.json" if folder.exists() else "it does not exist"
        if inside:
            why += f", but the runs {', '.join(inside[:MOST_NAMED])}" + " ..." * (len(inside) > MOST_NAMED)
        raise InputError("folder", str(folder), "a run folder", why) from None
    except OSError as failure:
        raise disk_error("read", path, failure) from failure
    with damage_named(path, remedy):
        about: dict[str, Any] = json.loads(text)
        version_of_run = int(about["format"])
    require_format(path, version_of_run, FORMAT, folder)
    with damage_named(path, remedy):
        require_about(about)
    return about


def runs_inside(folder: Path) -> list[Path]:
    """Run folders inside a folder, such as that of a sweep, by name."""
    return sorted(path.parent for path in folder.glob("*/run.json"))


def scan(folder: Path) -> tuple[list[Snapshot], Layout | None]:
    """All snapshots of a run, read from the data files, and their layout."""
    snapshots: list[Snapshot] = []
    layout = None
    for path in sorted(file for file in (folder / "data").glob("*.h5") if NUMBERED.fullmatch(file.name)):
        snapshot, layout = read_snapshot_header(path)
        snapshots.append(snapshot)
    return snapshots, layout


def read_snapshot_header(path: Path) -> tuple[Snapshot, Layout]:
    """Time, step, particle count and layout of one snapshot file.

    errors  RunFailed if the file is damaged
    """
    with opened(path) as data:
        file = data.file
        fluid, particles = file.get("fluid", {}), file.get("particles", {})
        for dataset in (*fluid.values(), *particles.values()):
            data.require_own(dataset)
        count = len(particles[POINTS]) if POINTS in particles else 0
        snapshot = Snapshot(path.name, float(file.attrs["time"]), int(file.attrs["step"]), count)
        return snapshot, Layout.of(fluid, particles)


def read_columns(path: Path) -> dict[str, np.ndarray]:
    """The columns of a history file; empty if there is no such file.

    errors  RunFailed if the file is damaged
    """
    if not path.exists():
        return {}
    with opened(path) as data:
        columns = {name: data.read(dataset) for name, dataset in data.file.items()}
        require_columns(columns)
        if columns and "time" not in columns:
            raise ValueError("it has no column time")
        return columns


def require_free(folder: Path, case_text: str) -> None:
    """Refuse a folder that holds a run, or a file where the folder should be.

    A run that was killed before it wrote any data does not count: the same case may start there again.

    errors  InputError
    """
    if folder.exists() and not folder.is_dir():
        raise InputError("output", str(folder), "a folder", "a file of that name exists")
    taken = [name for name in RUN_FILES if (folder / name).exists()]
    if any((folder / "data").glob("*.h5")):
        taken.append("data")
    if (folder / "case.toml").exists() and (folder / "case.toml").read_bytes() != case_text.encode():
        taken.append("case.toml")
    if taken:
        raise InputError(
            "output",
            str(folder),
            f"a folder without a run ({', '.join(taken)} found)",
            f"continue that run with `cfddem resume {folder}`, or choose another folder",
        )


def require_no_foreign_files(folder: Path) -> None:
    """Refuse a folder for a new run that holds files of something else.

    errors  InputError
    """
    inside = [path.name for path in folder.iterdir()] if folder.is_dir() else []
    foreign = sorted(name for name in inside if name not in OWN_FILES and not name.startswith("."))
    if foreign:
        names = ", ".join(foreign[:MOST_NAMED]) + " ..." * (len(foreign) > MOST_NAMED)
        raise InputError("output", str(folder), f"a new or empty folder ({names} found)", "choose another folder")


def make_folder(folder: Path) -> None:
    """Create the folder of a run.

    errors  InputError with the reason if this is not possible, or for a link in it
    """
    require_no_links(folder, WRITTEN)
    try:
        (folder / "data").mkdir(parents=True, exist_ok=True)
    except OSError as failure:
        raise InputError("output", str(folder), "a writable folder", reason(failure)) from failure


def lock(folder: Path) -> Any:
    """Lock a run for this process; the lock ends with the process, however it ends.

    errors  InputError if another process holds the lock, or for a link in the folder
    """
    require_no_links(folder, WRITTEN)
    path = folder / ".lock"
    try:
        file = path.open("a", encoding="utf-8")
    except OSError as failure:
        raise disk_error("write", path, failure) from failure
    if not lock_file(file):
        file.close()
        raise InputError("folder", str(folder), "unused", "another process is writing this run")
    return file


# ---------------------------------------------------------------- provenance


def provenance(seed: int | None = None) -> dict[str, Any]:
    """Versions of cfddem and its dependencies, Python, platform, processors, command and start time.

    seed     of the random numbers of the run
    returns  dict of plain values
    """
    return {
        "cfddem": __version__,
        "dependencies": _dependencies(),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "processors": os.cpu_count(),
        "command": [os.path.basename(sys.argv[0]), *sys.argv[1:]] if sys.argv else [],
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "seed": seed,
    }


def _dependencies() -> dict[str, str]:
    """Installed version of each required package."""
    versions = {}
    try:
        needed = requires("cfddem") or []
    except PackageNotFoundError:  # cfddem is used without being installed
        needed = []
    for requirement in needed:
        if "extra ==" in requirement:
            continue
        name = requirement.split(";")[0].split(">")[0].split("=")[0].split("<")[0].strip()
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return versions


# ---------------------------------------------------------------- copies of the files of a case


def keep_files(case: Case, folder: Path) -> None:
    """Copy the surface files of a case into a run folder, as `surfaces/NAME`, and its measured data.

    errors  InputError if a file cannot be read
    """
    for name, key, file in _surfaces(case):
        _copy(key, file, copy_of(folder, name, file), "surface file")
    for name, data in case.compare.items():
        _copy(f"compare.{name}.file", data.file, compare.copy_of(folder, name), "CSV file")


def with_kept_files(case: Case, folder: Path) -> Case:
    """The case with the copies of its files in a run folder."""
    return _at_copies(case, folder.absolute())


def _at_copies(case: Case, folder: Path) -> Case:
    walls = with_surfaces(case.wall, lambda number, file: copy_of(folder, f"wall_{number}", file).as_posix())
    vessel = case.vessel and case.vessel.with_file(lambda file: copy_of(folder, "vessel", file).as_posix())
    data = compare.with_data(case.compare, lambda name, _: compare.copy_of(folder, name).as_posix())
    return case.model_copy(update={"wall": walls, "vessel": vessel, "compare": data})


def holds_surfaces_of(case: Case, folder: Path) -> bool:
    """Whether the copies of surface files in a run folder are those that the case names now."""
    copies = [(copy_of(folder, name, file), Path(file)) for name, _, file in _surfaces(case)]
    return all(copy.read_bytes() == file.read_bytes() for copy, file in copies)


def _surfaces(case: Case) -> list[tuple[str, str, str]]:
    """Name of the copy, key and place of each surface file of a case."""
    named = [(f"wall_{n}", f"wall.{n}.file", wall.file) for n, wall in enumerate(case.wall)]
    named += [("vessel", "vessel.file", case.vessel.file)] if case.vessel else []
    return [(name, key, file) for name, key, file in named if file is not None]


def text_with_kept_files(case: Case) -> str:
    """The case as TOML text with the places of the copies in its run folder, which may move."""
    return _at_copies(case, Path()).to_toml()


def _copy(key: str, file: str, path: Path, kind: str) -> None:
    try:
        content = Path(file).read_bytes()
    except (OSError, ValueError) as failure:
        why = reason(failure) if isinstance(failure, OSError) else str(failure)
        raise InputError(key, file, f"a readable {kind}", why) from None
    path.parent.mkdir(exist_ok=True)
    write_whole(path, content)


def prepare_folder(folder: Path, text: str, case: Case) -> None:
    """Make the folder of a new run, before its preparation, which may take long."""
    require_free(folder, text)
    require_no_foreign_files(folder)
    make_folder(folder)
    keep_files(case, folder)
