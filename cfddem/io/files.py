"""Files of a run: written whole or not at all, and checked when they are read.

The content is written to a temporary file, flushed to the disk, and renamed. A failing disk is reported in one line. A
crash of the disk, another program or a user may have changed a file: it is then refused by name.
"""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np

from cfddem.backend.errors import CfddemError, InputError, RunFailed
from cfddem.backend.portions import Portions

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

try:
    import msvcrt as _windows
except ImportError:
    _windows = None  # type: ignore[assignment]

Values = np.ndarray | Portions
Finish = Callable[[IO[bytes]], None]

PARTIAL = ".partial"
"""Suffix of a file that is still being written. A killed process can leave one behind; it is never read."""

_REMEDY = {
    errno.ENOSPC: "free space on that disk; earlier files are intact",
    errno.EDQUOT: "free space within your quota; earlier files are intact",
    errno.EFBIG: "raise the limit of file sizes (ulimit -f), or choose another disk; earlier files are intact",
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
    with _appearing(path) as file:
        file.write(content)


def write_hdf5(path: Path, fill: Callable[[Any], None], finish: Finish = lambda _: None, **options: Any) -> None:
    """Write an HDF5 file atomically, without a copy of it in memory.

    path     of the file
    fill     writes the datasets of the open HDF5 file
    finish   completes its bytes
    options  of `h5py.File`
    errors   as of `write_whole`
    """
    import h5py

    with _appearing(path) as file:
        disk = _Disk(file)
        try:
            with h5py.File(disk, "w", **options) as data:
                fill(data)
        except (OSError, RuntimeError):
            disk.check()
            raise
        disk.check()
        finish(file)


def put(group: Any, name: str, values: Values, **options: Any) -> Any:
    """Write a dataset, in portions if it is given so; returns it."""
    if not isinstance(values, Portions):
        return group.create_dataset(name, data=values, **options)
    dataset = group.create_dataset(name, values.shape, values.dtype, **options)
    for index, part in values:
        dataset[index] = part
    return dataset


@contextmanager
def _appearing(path: Path) -> Iterator[IO[bytes]]:
    """A temporary file that is moved to its place when it is whole."""
    fresh = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    try:
        fresh.unlink(missing_ok=True)
        with fresh.open("x+b") as file:  # never through a link of that name
            yield file
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)
        _sync_folder(path.parent)
    except OSError as failure:
        fresh.unlink(missing_ok=True)
        raise disk_error("write", path, failure) from failure
    except BaseException:
        fresh.unlink(missing_ok=True)
        raise


class _Disk:
    """A file for h5py. It accepts all after its disk has failed, since HDF5 cannot close a file that does not."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file, self._failure = file, None
        self.tell, self.read = file.tell, file.read

    _failure: OSError | None

    def check(self) -> None:
        """Raise what the disk said first."""
        if self._failure is not None:
            raise self._failure

    def _tried(self, action: Callable[[], int], otherwise: int) -> int:
        try:
            return otherwise if self._failure is not None else action()
        except OSError as failure:
            self._failure = failure
            return otherwise

    def seek(self, place: int, whence: int = os.SEEK_SET) -> int:
        """See `io.RawIOBase`; a buffered file first writes what it holds, which may fail, too."""
        return self._tried(lambda: self._file.seek(place, whence), place)

    def write(self, content: Any) -> int:
        """See `io.RawIOBase`."""
        return self._tried(lambda: self._file.write(content), len(content))

    def readinto(self, into: Any) -> int:
        """See `io.RawIOBase`."""
        return self._tried(lambda: self._file.readinto(into), len(into))  # type: ignore[attr-defined]

    def truncate(self, size: int) -> int:
        """See `io.RawIOBase`."""
        return self._tried(lambda: self._file.truncate(size), size)

    def flush(self) -> None:
        """See `io.RawIOBase`."""
        self._tried(lambda: self._file.flush() or 0, 0)


def disk_error(verb: str, path: Path, failure: OSError) -> RunFailed:
    """The error for a failed disk operation: which file, why, and the remedy."""
    remedy = _REMEDY.get(failure.errno or 0, "")
    return RunFailed(f"{path}: cannot {verb} the file: {reason(failure)}" + (f"; {remedy}" if remedy else ""))


def reason(failure: OSError) -> str:
    """The message of the operating system in lower case."""
    return (failure.strerror or str(failure)).lower()


def require_format(path: Path, version: int, expected: int, run: Path) -> None:
    """Refuse a file of another format.

    version, expected  numbers of the formats
    run                folder of the run that the file belongs to
    """
    if version != expected:
        remedy = (
            "it was written by a newer version of cfddem; update cfddem"
            if version > expected
            else f"it was written by an earlier version of cfddem; run {run}/case.toml again in another folder"
        )
        raise InputError(f"{path}: format", version, str(expected), remedy)


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


# ---------------------------------------------------------------- damaged files


VECTORS = ("position", "velocity", "spin", "force")
"""Particle fields with three components."""

MOST_COMPRESSED = 1032
"""Most bytes that one byte of a file can stand for. It is the limit of deflate, by which snapshots are compressed
(zlib.net/zlib_tech.html, maximum compression factor)."""

_UNREADABLE = (
    OSError, KeyError, IndexError, RuntimeError, TypeError, ValueError, AttributeError, MemoryError, OverflowError,
)  # fmt: skip
"""What h5py and json raise for damaged files; the kind of the damage decides which."""


@contextmanager
def damage_named(path: Path, remedy: str = "move the file elsewhere and retry") -> Iterator[None]:
    """Report a file that cannot be read as damaged.

    errors  RunFailed, one line
    """
    try:
        yield
    except CfddemError:
        raise
    except _UNREADABLE as damage:
        reason = " ".join(str(damage).split())[:200]
        raise RunFailed(f"{path}: the file is damaged ({reason}); {remedy}") from damage


def memory() -> float:
    """Memory of this machine [byte]; infinite where the system does not say."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):  # Windows has no such call
        return float("inf")


class ArrayFile:
    """An open HDF5 file of a run.

    Arrays are read only if they lie in the file itself, and as long as their sizes fit the size of the file.
    """

    def __init__(self, path: Path, file: Any) -> None:
        self.file = file
        size, most = path.stat().st_size, memory()
        self._limit = min(MOST_COMPRESSED * size, most)
        self._why = f"a file of {size:.4g} bytes holds" if self._limit < most else "the memory of this machine holds"
        self._used = 0

    def require_own(self, dataset: Any) -> None:
        """Refuse an array of another file, or one that with all others that were read is larger than this can hold.

        errors  ValueError
        """
        if dataset.external or dataset.is_virtual or dataset.file.filename != self.file.filename:
            raise ValueError(f"{dataset.name.lstrip('/')} lies in another file")
        self._used += dataset.nbytes
        if self._used > self._limit:
            name, shape = dataset.name.lstrip("/"), " x ".join(map(str, dataset.shape))
            raise ValueError(
                f"{name} has {shape} values, {self._used:.3g} bytes; {self._why} at most {self._limit:.3g}"
            )

    def read(self, dataset: Any, rows: Any = ()) -> np.ndarray:
        """The values of an array, or some of its rows.

        errors  ValueError if it is too large
        """
        self.require_own(dataset)
        return np.asarray(dataset[rows])


@contextmanager
def opened(path: Path, remedy: str = "move the file elsewhere and retry") -> Iterator[ArrayFile]:
    """An open HDF5 file of a run; every read of such a file begins here.

    errors  RunFailed, one line, if it cannot be read
    """
    import h5py

    with damage_named(path, remedy), h5py.File(path, "r") as file:
        yield ArrayFile(path, file)


def require_about(about: Any) -> None:
    """Refuse a `run.json` whose values have other types than those that are written.

    errors  ValueError
    """
    if not isinstance(about, dict) or not isinstance(about["format"], int):
        raise ValueError("it is not a table with a format")
    for name, kind in {"status": str, "message": str, "provenance": dict, "quantities": dict}.items():
        if not isinstance(about[name], kind):
            raise ValueError(f"{name} is not a {'text' if kind is str else 'table'}")
    if about["precision"] not in ("single", "double"):
        raise ValueError("precision is neither single nor double")
    for names in about["quantities"].values():
        for quantity in names.values():
            if not 2 <= len(quantity) <= 3 or not all(isinstance(part, str) for part in quantity):
                raise ValueError("quantities are not pairs of unit and meaning")
    wall = about.get("wall_time", {})
    if not isinstance(wall, dict) or not all(_is_number(number) for number in wall.values()):
        raise ValueError("wall_time is not a table of numbers")
    if not _is_number(about.get("averages_from") or 0.0):
        raise ValueError("averages_from is not a time")
    _require_grid(about["grid"])


def _require_grid(grid: Any) -> None:
    if grid is None:
        return
    if not isinstance(grid, dict) or set(grid) != {"cells", "spacing", "origin"}:
        raise ValueError("grid is not a table of cells, spacing and origin")
    for name, values in grid.items():
        good = isinstance(values, list) and len(values) == 3 and all(_is_number(number) for number in values)
        whole = name != "cells" or (good and all(isinstance(number, int) for number in values))
        if not good or not whole or (name != "origin" and min(values) <= 0):
            raise ValueError(f"grid.{name} is not three numbers")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def require_columns(columns: Mapping[str, np.ndarray]) -> None:
    """Refuse columns of a table that are not numbers in equal number.

    errors  ValueError
    """
    for name, column in columns.items():
        if np.ndim(column) != 1 or column.dtype.kind not in "fiub":
            raise ValueError(f"{name} is not a column of numbers")
    if len({len(column) for column in columns.values()}) > 1:
        raise ValueError("its columns have different lengths")


def require_particles(fields: Mapping[str, np.ndarray]) -> None:
    """Refuse particle fields that are not numbers with one row for each particle.

    errors  ValueError
    """
    for name, values in fields.items():
        vector = np.ndim(values) == 2 and values.shape[1] == 3
        if np.ndim(values) not in (1, 2) or values.dtype.kind not in "fiub" or (name in VECTORS and not vector):
            raise ValueError(f"particles/{name} has the shape {np.shape(values)}")
    if len({len(values) for values in fields.values()}) > 1:
        raise ValueError("particle fields have different numbers of rows")


def require_cells(values: np.ndarray, name: str, shape: tuple[int, int, int]) -> None:
    """Refuse a fluid field that does not fit the grid.

    errors  ValueError
    """
    if values.shape not in (shape, (*shape, 3)) or values.dtype.kind not in "fiub":
        raise ValueError(f"fluid/{name} has the shape {values.shape}")
