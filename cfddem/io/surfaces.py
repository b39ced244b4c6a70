"""Copies of the surface files of a case in its run folder, so that the folder is enough to resume the run."""

from __future__ import annotations

from pathlib import Path

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.case.walls import copy_of, with_surfaces
from cfddem.io.files import reason, write_whole


def keep_surfaces(case: Case, folder: Path) -> None:
    """Copy the surface files of a case into a run folder, as `surfaces/wall_NUMBER.stl`.

    errors  InputError if a file cannot be read
    """
    for number, wall in enumerate(case.wall):
        if wall.file is None:
            continue
        try:
            content = Path(wall.file).read_bytes()
        except (OSError, ValueError) as failure:
            why = reason(failure) if isinstance(failure, OSError) else str(failure)
            raise InputError(f"wall.{number}.file", wall.file, "a readable STL file", why) from None
        path = copy_of(folder, number)
        path.parent.mkdir(exist_ok=True)
        write_whole(path, content)


def with_kept_surfaces(case: Case, folder: Path) -> Case:
    """The case with the copies of its surface files in a run folder."""
    files = {n: str(copy_of(folder.absolute(), n)) for n, wall in enumerate(case.wall) if wall.file is not None}
    return with_surfaces(case, files)
