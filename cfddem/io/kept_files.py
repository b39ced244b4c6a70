"""Copies of the files of a case in its run folder, so that the folder is enough to resume and report the run."""

from __future__ import annotations

from pathlib import Path

from cfddem.backend.errors import InputError
from cfddem.case import compare
from cfddem.case.schema import Case
from cfddem.case.walls import copy_of, with_surfaces
from cfddem.io.files import reason, write_whole
from cfddem.io.folder import make_folder, require_free, require_no_foreign_files


def keep_files(case: Case, folder: Path) -> None:
    """Copy the surface files of a case into a run folder, as `surfaces/wall_NUMBER.stl`, and its measured data.

    errors  InputError if a file cannot be read
    """
    for number, wall in enumerate(case.wall):
        if wall.file is not None:
            _copy(f"wall.{number}.file", wall.file, copy_of(folder, number), "STL file")
    for name, data in case.compare.items():
        _copy(f"compare.{name}.file", data.file, compare.copy_of(folder, name), "CSV file")


def with_kept_files(case: Case, folder: Path) -> Case:
    """The case with the copies of its files in a run folder."""
    return _at_copies(case, folder.absolute())


def _at_copies(case: Case, folder: Path) -> Case:
    walls = with_surfaces(case.wall, lambda number, _: copy_of(folder, number).as_posix())
    data = compare.with_data(case.compare, lambda name, _: compare.copy_of(folder, name).as_posix())
    return case.model_copy(update={"wall": walls, "compare": data})


def holds_surfaces_of(case: Case, folder: Path) -> bool:
    """Whether the copies of STL files in a run folder are those that the case names now."""
    files = {number: Path(wall.file) for number, wall in enumerate(case.wall) if wall.file is not None}
    return all(copy_of(folder, number).read_bytes() == file.read_bytes() for number, file in files.items())


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
