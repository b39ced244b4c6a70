"""Checkpoints: the full state of a run, bit for bit, so that a resumed run continues exactly.

A checkpoint is an HDF5 file. Its first 512 bytes, the HDF5 user block, hold one line of text with the format and the
checksum of the rest. Two checkpoints are kept, so that a damaged one can be replaced by the previous one.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from cfddem.backend.errors import InputError, RunFailed
from cfddem.backend.portions import Portions
from cfddem.io.files import ArrayFile, disk_error, memory, opened, put, reason, require_format, write_hdf5

FORMAT = 5
"""Format of checkpoints. Checkpoints of any other format are refused."""

KEPT = 2

_HEAD, _BLOCK = 512, 1 << 20
_WORDS = "cfddem checkpoint, format {}, sha256 of this number, a line end and all beyond byte 512: {}\n"
_log = logging.getLogger("cfddem")


def write(folder: Path, state: Mapping[str, Any]) -> Path:
    """Write a checkpoint and remove the oldest.

    folder   of the run
    state    nested dict of arrays (of numbers, flags or records; or `Portions` of them), numbers, texts, flags, None
             and lists of these
    returns  the file
    errors   InputError for a value that cannot be stored; RunFailed if the disk fails, older ones are then kept
    """
    home = Path(folder) / "checkpoint"
    try:
        home.mkdir(exist_ok=True)
    except OSError as failure:
        raise disk_error("create", home, failure) from failure
    earlier = _files(home)
    number = 1 + int(earlier[0].stem) if earlier else 0
    path = home / f"{number:08d}.h5"

    def finish(file: IO[bytes]) -> None:
        words = _words(FORMAT, file)
        file.seek(0)
        file.write(words.encode().ljust(_HEAD, b"\0"))

    write_hdf5(path, lambda file: _put(file, state, "state"), finish, userblock_size=_HEAD, track_order=True)
    whole = [kept for kept in earlier if _fault(kept) is None][: KEPT - 1]
    for kept in earlier:
        if kept not in whole:
            kept.unlink(missing_ok=True)
    return path


def exists(folder: Path) -> bool:
    """Whether a run has written a checkpoint, whole or damaged."""
    return bool(_files(Path(folder) / "checkpoint"))


class Stored:
    """An array of a checkpoint that is read where it is indexed.

    path   of the checkpoint
    array  in the open file
    """

    def __init__(self, path: Path, array: Any) -> None:
        self.path, self.name, self.shape, self.dtype = path, array.name, array.shape, array.dtype

    def __len__(self) -> int:
        return int(self.shape[0])

    def __getitem__(self, rows: Any) -> np.ndarray:
        with opened(self.path) as data:
            return data.read(data.file[self.name], rows)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self[()], dtype)


def newest(folder: Path, later: Sequence[str] = ()) -> dict[str, Any]:
    """The newest undamaged state of a run. Damaged checkpoints are skipped with a warning.

    folder   of the run
    later    entries, with / between levels, whose arrays are `Stored`: read where they are indexed
    returns  the state given to `write`, bit for bit
    errors   InputError if there is none, or one of another format; RunFailed if all are damaged
    """
    home = Path(folder) / "checkpoint"
    paths = _files(home)
    if not paths:
        raise InputError("folder", str(folder), "a run with a checkpoint", "delete the folder and run the case again")
    for path in paths:
        fault = _fault(path)
        if fault is None:
            _require_format(path)
            with opened(path, "delete it; the previous one is used then") as data:
                return _get(data.file, data, tuple(f"/{group}/" for group in later))
        _log.warning("%s: %s; using the previous checkpoint", path, fault)
    raise RunFailed(f"{home}: all checkpoints are damaged ({len(paths)}); delete the folder and run the case again")


def _files(home: Path) -> list[Path]:
    """Checkpoint files, newest first."""
    return sorted((checkpoint for checkpoint in home.glob("*.h5") if checkpoint.stem.isdigit()), reverse=True)


def _fault(path: Path) -> str | None:
    """Why a checkpoint is damaged; None if it is not."""
    try:
        if path.stat().st_size > memory():
            return "damaged, larger than the memory of this machine"
        with path.open("rb") as file:
            words = file.read(_HEAD).rstrip(b"\0").decode("ascii", "replace")
            number = _format(words)
            if not number.isdecimal() or words != _words(int(number), file):
                return "damaged, wrong checksum"
    except OSError as failure:
        return reason(failure)
    return None


def _format(words: str) -> str:
    """The format number in the head of a checkpoint."""
    return words.removeprefix(_WORDS.split("{")[0]).split(",")[0]


def _require_format(path: Path) -> None:
    """Refuse another format. Such a checkpoint is not damaged, so the previous one is no substitute."""
    with path.open("rb") as file:
        number = int(_format(file.read(_HEAD).decode("ascii", "replace")))
    require_format(path, number, FORMAT, path.parent.parent)


def _words(number: int, file: IO[bytes]) -> str:
    """The head of a checkpoint: its format, and a checksum of the format and the content."""
    checksum = hashlib.sha256(f"{number}\n".encode())
    file.seek(_HEAD)
    while content := file.read(_BLOCK):
        checksum.update(content)
    return _WORDS.format(number, checksum.hexdigest())


def _put(group: Any, values: Mapping[str, Any], where: str) -> None:
    """Arrays become datasets, dicts become groups, other values become JSON text, which keeps every bit of a number."""
    for name, value in values.items():
        here = f"{where}.{name}"
        if not isinstance(name, str) or not name or "/" in name or name == ".":
            raise InputError(here, None, "named by a non-empty text without '/'")
        if isinstance(value, Mapping):
            _put(group.create_group(name, track_order=True), value, here)
        elif isinstance(value, np.ndarray | np.generic | Portions):
            if value.dtype.hasobject or value.dtype.kind in "USMm":
                raise InputError(here, str(value.dtype), "an array of numbers, flags or records of these")
            put(group, name, np.asarray(value) if isinstance(value, np.generic) else value)
        else:
            try:
                group.create_dataset(name, data=json.dumps(value)).attrs["json"] = True
            except TypeError:
                raise InputError(here, type(value).__name__, "an array, number, text, flag, list or dict") from None


def _get(group: Any, data: ArrayFile, later: tuple[str, ...]) -> dict[str, Any]:
    import h5py

    values: dict[str, Any] = {}
    for name, node in group.items():
        if isinstance(node, h5py.Group):
            values[name] = _get(node, data, later)
            continue
        data.require_own(node)
        if node.shape and later and f"{node.name}/".startswith(later):
            values[name] = Stored(Path(node.file.filename), node)
        else:
            values[name] = json.loads(node[()]) if "json" in node.attrs else node[()]
    return values
