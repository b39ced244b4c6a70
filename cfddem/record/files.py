"""Files that appear whole or not at all, whatever kills the writer, and one line where a disk refuses.

A file is made in memory, written under a temporary name, forced to the disk and only then given its name.
"""

from __future__ import annotations

import errno
import io
import os
from pathlib import Path
from typing import Any

from cfddem.errors import InputError, RunFailed

PARTIAL = ".partial"
"""Ending of a file that is still being written; what a kill leaves of it is never read."""

_REMEDY = {
    errno.ENOSPC: "free space on that disk; what was written before is whole",
    errno.EDQUOT: "free space within your quota; what was written before is whole",
    errno.EACCES: "choose a folder you may write to",
    errno.EPERM: "choose a folder you may write to",
    errno.EROFS: "choose a folder on a disk that can be written",
    errno.ENOENT: "its folder is not there; make it, or put it back where it was moved during a run",
}


def write_whole(path: Path, content: bytes | memoryview) -> None:
    """Write a file so that its name shows either the old content or the new one, never a part.

    path     of the file
    content  all of it
    errors   RunFailed with the reason of the disk; the old file is then still there
    """
    fresh = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    try:
        with fresh.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)
        _keep_names(path.parent)
    except OSError as refusal:
        fresh.unlink(missing_ok=True)
        raise cannot("write", path, refusal) from refusal


def cannot(verb: str, path: Path, refusal: OSError) -> RunFailed:
    """The one line for a disk that refuses: which file, why, what to do."""
    remedy = _REMEDY.get(refusal.errno or 0, "")
    reason = (refusal.strerror or str(refusal)).lower()
    return RunFailed(f"{path}: cannot {verb} it, {reason}" + (f"; {remedy}" if remedy else ""))


def must_have_folder(output: Path | None) -> None:
    """Say before the work is done that there is no folder for what it gives."""
    if output is not None and not output.parent.is_dir():
        raise InputError("output", str(output), "a file in a folder that is there", f"make {output.parent} first")


def remove_partial(folder: Path) -> None:
    """Remove what killed writers have left behind."""
    for left in folder.glob(f".*{PARTIAL}"):
        left.unlink(missing_ok=True)


def hdf5_in_memory(image: io.BytesIO, **options: Any) -> Any:
    """An HDF5 file whose bytes end up in `image`; to be used in a `with` statement."""
    import h5py

    return h5py.File(image, "w", **options)


def _keep_names(folder: Path) -> None:
    """Force the names in a folder to the disk, so that a power cut does not undo a rename."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError:  # some network file systems know no such thing; the file itself is safe
        pass
    finally:
        os.close(descriptor)
