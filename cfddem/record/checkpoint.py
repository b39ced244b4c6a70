"""Checkpoints: the full state of a run, to the last bit, so that it can go on as if it had never stopped.

Each is an HDF5 file whose first 512 bytes, the block that HDF5 leaves to the user, are one line of text with the
format and the checksum of all that follows. Two are kept: if the newest is damaged, the one before it is there.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.errors import InputError, RunFailed
from cfddem.record.files import cannot, hdf5_in_memory, write_whole

FORMAT = 2
"""Of a checkpoint; a reader refuses any other."""

KEPT = 2

_HEAD = 512
_WORDS = "cfddem checkpoint, format {}, sha256 of this number, a line end and all beyond byte 512: {}\n"
_log = logging.getLogger("cfddem")


def write(folder: Path, state: Mapping[str, Any]) -> Path:
    """Write a state beside the run's snapshots and remove the oldest.

    folder   of the run
    state    nested dict of arrays (any type but object), numbers, texts, flags, None and lists of these
    returns  the file
    errors   InputError for what cannot be kept; RunFailed where the disk refuses, the old ones are then still there
    """
    home = Path(folder) / "checkpoint"
    try:
        home.mkdir(exist_ok=True)
    except OSError as refusal:
        raise cannot("make", home, refusal) from refusal
    image = io.BytesIO()
    with hdf5_in_memory(image, userblock_size=_HEAD, track_order=True) as file:
        _put(file, state, "state")
    content = image.getbuffer()
    content[:_HEAD] = _words(FORMAT, content).encode().ljust(_HEAD, b"\0")

    earlier = _files(home)
    number = 1 + int(earlier[0].stem) if earlier else 0
    path = home / f"{number:08d}.h5"
    write_whole(path, content)
    whole = [each for each in earlier if _fault(each) is None][: KEPT - 1]
    for each in earlier:
        if each not in whole:
            each.unlink(missing_ok=True)
    return path


def exists(folder: Path) -> bool:
    """Whether a run has ever written a checkpoint, whole or damaged."""
    return bool(_files(Path(folder) / "checkpoint"))


def newest(folder: Path) -> dict[str, Any]:
    """The newest state of a run that is whole; a damaged one is named in a warning and passed over.

    folder   of the run
    returns  what was given to `write`, with the same bits
    errors   InputError where there is none, or one of another format; RunFailed where all are damaged
    """
    home = Path(folder) / "checkpoint"
    found = _files(home)
    if not found:
        raise InputError(
            "folder", str(folder), "one with a checkpoint", "remove the folder and run the case from its start"
        )
    for path in found:
        fault = _fault(path)
        if fault is None:
            _refuse_another_format(path)
            return _get_all(path)
        _log.warning("%s: %s; the checkpoint before it is used", path, fault)
    raise RunFailed(
        f"{home}: no checkpoint is whole ({len(found)} damaged); remove the folder and run the case from its start"
    )


def _files(home: Path) -> list[Path]:
    """Checkpoints, the newest first."""
    return sorted((each for each in home.glob("*.h5") if each.stem.isdigit()), reverse=True)


def _fault(path: Path) -> str | None:
    """What is wrong with a checkpoint, or None."""
    try:
        content = path.read_bytes()
    except OSError as refusal:
        return (refusal.strerror or str(refusal)).lower()
    words = content[:_HEAD].rstrip(b"\0").decode("ascii", "replace")
    number = _format(words)
    if not number.isdecimal() or words != _words(int(number), memoryview(content)):
        return "is damaged, its checksum does not hold"
    return None


def _format(words: str) -> str:
    """The format that the words at the head of a checkpoint name."""
    return words.removeprefix(_WORDS.split("{")[0]).split(",")[0]


def _refuse_another_format(path: Path) -> None:
    """Such a checkpoint is not damaged, so that the one before it is no substitute."""
    with path.open("rb") as file:
        number = int(_format(file.read(_HEAD).decode("ascii", "replace")))
    if number > FORMAT:
        raise InputError(
            f"{path}: format", number, f"at most {FORMAT}", "it was written by a newer cfddem; update this one"
        )
    if number < FORMAT:
        remedy = f"it was written by an earlier cfddem; run {path.parent.parent}/case.toml anew into another folder"
        raise InputError(f"{path}: format", number, f"at least {FORMAT}", remedy)


def _words(number: int, content: memoryview) -> str:
    """The line at the head of a checkpoint: its format, and the checksum of that and of all that follows."""
    checksum = hashlib.sha256(f"{number}\n".encode())
    checksum.update(content[_HEAD:])
    return _WORDS.format(number, checksum.hexdigest())


def _put(group: Any, values: Mapping[str, Any], where: str) -> None:
    """Arrays become datasets, dicts become groups, the rest text in JSON, which keeps every bit of a number."""
    for name, value in values.items():
        here = f"{where}.{name}"
        if not isinstance(name, str) or not name or "/" in name or name == ".":
            raise InputError(here, None, "named by a text without '/'")
        if isinstance(value, Mapping):
            _put(group.create_group(name, track_order=True), value, here)
        elif isinstance(value, np.ndarray | np.generic):
            if value.dtype.hasobject or value.dtype.kind in "USMm":
                raise InputError(here, str(value.dtype), "an array of numbers, flags or records of these")
            group.create_dataset(name, data=value)
        else:
            try:
                group.create_dataset(name, data=json.dumps(value)).attrs["json"] = True
            except TypeError:
                raise InputError(here, type(value).__name__, "an array, number, text, flag, list or dict") from None


def _get_all(path: Path) -> dict[str, Any]:
    import h5py

    with h5py.File(path, "r") as file:
        return _get(file)


def _get(group: Any) -> dict[str, Any]:
    import h5py

    values: dict[str, Any] = {}
    for name, each in group.items():
        if isinstance(each, h5py.Group):
            values[name] = _get(each)
        elif "json" in each.attrs:
            values[name] = json.loads(each[()])
        else:
            values[name] = each[()]
    return values
