"""What is checked in the files of a run, which a crash of the disk, another program or a user may have changed."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import CfddemError, RunFailed

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
