"""Write files that appear whole or not at all, report a failing disk in one line, and lock files.

The content is assembled in memory, written to a temporary file, flushed to the disk, and renamed.
"""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

from cfddem.backend.errors import InputError, RunFailed

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

try:
    import msvcrt as _windows
except ImportError:
    _windows = None  # type: ignore[assignment]

PARTIAL = ".partial"
"""Suffix of a file that is still being written. A killed process can leave one behind; it is never read."""

_REMEDY = {
    errno.ENOSPC: "free space on that disk; earlier files are intact",
    errno.EDQUOT: "free space within your quota; earlier files are intact",
    errno.EACCES: "choose a folder with write permission",
    errno.EPERM: "choose a folder with write permission",
    errno.EROFS: "choose a folder on a writable disk",
    errno.ENOENT: "its folder is missing; create it, or move it back if it was moved during the run",
}


def write_whole(path: Path, content: bytes | memoryview) -> None:
    """Write a file atomically: its name always refers to the old content or to the new one.

    path     of the file
    content  all of it
    errors   RunFailed with the reason of the disk; the old file is then unchanged
    """
    fresh = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    try:
        fresh.unlink(missing_ok=True)
        with fresh.open("xb") as file:  # never through a link of that name
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)
        _sync_folder(path.parent)
    except OSError as failure:
        fresh.unlink(missing_ok=True)
        raise disk_error("write", path, failure) from failure


def disk_error(verb: str, path: Path, failure: OSError) -> RunFailed:
    """The error for a failed disk operation: which file, why, and the remedy."""
    remedy = _REMEDY.get(failure.errno or 0, "")
    return RunFailed(f"{path}: cannot {verb} the file: {reason(failure)}" + (f"; {remedy}" if remedy else ""))


def reason(failure: OSError) -> str:
    """The message of the operating system in lower case."""
    return (failure.strerror or str(failure)).lower()


def require_format(path: Path, found: int, expected: int, run: Path) -> None:
    """Refuse a file of another format.

    found, expected  numbers of the formats
    run              folder of the run that the file belongs to
    """
    if found != expected:
        remedy = (
            "it was written by a newer version of cfddem; update cfddem"
            if found > expected
            else f"it was written by an earlier version of cfddem; run {run}/case.toml again in another folder"
        )
        raise InputError(f"{path}: format", found, str(expected), remedy)


def require_folder(output: Path | None) -> None:
    """Refuse an output file whose folder does not exist, before any work is done.

    errors  InputError
    """
    if output is not None and not output.parent.is_dir():
        raise InputError("output", str(output), "a file in an existing folder", f"create {output.parent} first")


def require_no_links(folder: Path, names: Iterable[str] | None = None) -> None:
    """Refuse links in a folder that is to be written: what is written or deleted there would be so elsewhere.

    names   of the members that are written; all if None
    errors  InputError
    """
    members = (folder / name for name in names) if names is not None else folder.glob("*")
    for path in members:
        if path.is_symlink():
            raise InputError(f"{path}", None, "no link", f"it leads to {os.readlink(path)!r}; put a copy in its place")


def remove_partial(folder: Path) -> None:
    """Remove the temporary files of killed processes."""
    for left in folder.glob(f".*{PARTIAL}"):
        left.unlink(missing_ok=True)


def hdf5_in_memory(image: io.BytesIO, **options: Any) -> Any:
    """An open HDF5 file whose bytes go to `image`; use it in a `with` statement."""
    import h5py

    return h5py.File(image, "w", **options)


def _sync_folder(folder: Path) -> None:
    """Flush the file names of a folder to the disk, so that a power cut does not undo a rename.

    Windows has no such call; its file system keeps a journal of names.
    """
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError:  # some network file systems do not support this; the file itself is on the disk
        pass
    finally:
        os.close(descriptor)


# ---------------------------------------------------------------- locks: fcntl on Linux and macOS, msvcrt on Windows


msvcrt: Any = _windows


def lock_file(file: IO[Any]) -> bool:
    """Lock an open file; False if another process holds the lock.

    A file system or machine without locks counts as free.
    """
    try:
        if fcntl is not None:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        elif msvcrt is not None:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        return True
    return True
