"""Triangles of surface files: STL, text or binary, and what pyvista reads, PLY and VTP."""

from __future__ import annotations

import os
import re
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.model.triangles import is_closed

HEADER, RECORD = 80, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""Bytes before the number of triangles of a binary file, and one triangle after it."""

_VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)[ \t]*\r?$", re.MULTILINE | re.IGNORECASE)


def stamp(owner: Any) -> tuple[int, int]:
    """Time and size of the file of a wall or vessel, which tell whether it has changed; 0 without a file."""
    try:
        status = os.stat(getattr(owner, "file", None) or "")
    except (OSError, ValueError):
        return 0, 0
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=8)
def kept_surface(path: str, _: tuple[int, int]) -> np.ndarray:
    """See `read_surface`; a file with the same `stamp` is read once."""
    return read_surface(path)


@lru_cache(maxsize=8)
def is_closed_surface(path: str, written: tuple[int, int]) -> bool:
    """Whether the surface of a file is closed; as `kept_surface`."""
    return is_closed(kept_surface(path, written))


def read_surface(path: str | Path) -> np.ndarray:
    """Corners of the triangles of a surface (T, 3, 3), in the unit of the file.

    path    STL, or another format that pyvista reads: PLY, VTP
    errors  InputError if the file is missing, or is not a whole file of one surface
    """
    if Path(path).suffix.lower() == ".stl":
        return read_stl(path)
    _content(Path(path))
    import pyvista  # takes a second to import, and few runs need it

    try:
        surface = pyvista.read(path)
    except Exception as failure:  # of many kinds, by the reader
        raise InputError("file", os.fspath(path), "a readable surface", str(failure).partition("\n")[0]) from None
    if not isinstance(surface, pyvista.PolyData) or surface.n_cells == 0:
        raise InputError("file", os.fspath(path), "a file of one surface, with triangles")
    surface = surface.triangulate()
    corners = np.asarray(surface.points, float)[np.asarray(surface.faces).reshape(-1, 4)[:, 1:]]
    if not np.isfinite(corners).all():
        raise InputError("file", os.fspath(path), "a surface of finite corners")
    return np.asarray(corners)


def read_stl(path: str | Path) -> np.ndarray:
    """Corners of the triangles of a surface (T, 3, 3), in the unit of the file.

    errors  InputError if the file is missing, or is not a whole STL file
    """
    content = _content(Path(path))
    count = triangles_in(path, content)
    if _is_binary(content):
        corners = np.frombuffer(content, RECORD, count, HEADER + 4)["corners"].astype(float)
    else:
        try:
            corners = np.array(_VERTEX.findall(content)).astype(float).reshape(-1, 3, 3)
        except ValueError:
            raise _not_stl(path, "a corner is not three numbers") from None
    if not np.isfinite(corners).all():
        raise _not_stl(path, "a corner is not finite")
    return corners


def write_stl(path: str | Path, corners: np.ndarray) -> None:
    """Write triangles (T, 3, 3) as a binary STL file, which holds seven digits."""
    corners = np.asarray(corners, float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    records = np.zeros(len(corners), RECORD)
    records["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    records["corners"] = corners
    Path(path).write_bytes(b"triangles".ljust(HEADER) + len(corners).to_bytes(4, "little") + records.tobytes())


def triangles_in(path: str | Path, content: bytes | None = None) -> int:
    """Number of triangles of an STL file.

    errors  InputError if the file is missing, or is not a whole STL file
    """
    content = _content(Path(path)) if content is None else content
    if _is_binary(content):
        return int.from_bytes(content[HEADER : HEADER + 4], "little")
    if not content.lstrip()[:5].lower() == b"solid":
        raise _not_stl(
            path, "its length does not fit its number of triangles, and it is not a text that begins with solid"
        )
    corners = len(_VERTEX.findall(content))
    if corners == 0 or corners % 3:
        raise _not_stl(path, f"it has {corners} corners")
    return corners // 3


def _is_binary(content: bytes) -> bool:
    """Whether a file has the length that a binary one states."""
    if len(content) < HEADER + 4:
        return False
    count = int.from_bytes(content[HEADER : HEADER + 4], "little")
    return count > 0 and len(content) == HEADER + 4 + count * RECORD.itemsize


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except (OSError, ValueError) as failure:
        reason = getattr(failure, "strerror", None) or str(failure)
        raise InputError("file", os.fspath(path), "a readable surface file", reason) from None


def _not_stl(path: str | Path, why: str) -> InputError:
    return InputError("file", os.fspath(path), "an STL file of triangles", why)
