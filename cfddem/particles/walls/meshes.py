"""Walls of triangles: plates, surfaces from files, and meshes."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cfddem.backend.errors import InputError, shown
from cfddem.model.triangles import Array, is_closed
from cfddem.particles.walls.wall import ROUNDING, SolidSide, Wall

if TYPE_CHECKING:
    from cfddem.particles.vectors import Vector


@dataclass(frozen=True, kw_only=True)
class Triangles(Wall):
    """A wall of a case that particles meet as a mesh."""

    exact = False

    def for_particles(self) -> Wall:
        """See `Wall.for_particles`."""
        return Mesh.of_corners(
            self.corners(), velocity=self.velocity, spin=self.spin, centre=self.centre, material=self.material
        )

    def frame(self) -> tuple[np.ndarray, float]:
        """See `Wall.frame`."""
        return self.corners().reshape(-1, 3), 0.0

    def middle(self) -> np.ndarray:
        """See `Wall.middle`."""
        if self.centre is not None:
            return np.array(self.centre, float)
        points, _ = self.frame()
        return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))

    def sweep(self) -> float:
        """Speed of a wall that does not spin; NaN of another, whose file is not read [m/s]."""
        return math.nan if any(self.spin) else float(np.linalg.norm(self.velocity))


@dataclass(frozen=True, kw_only=True)
class Plate(Triangles):
    """A flat parallelogram, with contacts on both sides.

    point  a corner [m]
    edges  two edges from there [m]
    """

    point: Vector = (0.0, 0.0, 0.0)
    edges: tuple[Vector, Vector]

    def __post_init__(self) -> None:
        first, second = np.array(self.edges)
        if not math.hypot(*np.cross(first, second)) > ROUNDING * math.hypot(*first) * math.hypot(*second):
            raise InputError("edges", shown(self.edges), "two edges in different directions, in m")
        super().__post_init__()

    @property
    def side(self) -> SolidSide:
        """See `Wall.side`."""
        return SolidSide("thin", ("thin", "none"), "a plate has no inside")

    def corners(self) -> Array:
        """See `Wall.corners`."""
        first, second = np.array(self.edges)
        quad = np.array(self.point) + np.array([0.0 * first, first, first + second, second])
        return np.asarray(quad[[[0, 1, 2], [0, 2, 3]]])


@dataclass(frozen=True, kw_only=True)
class Surface(Triangles):
    """A surface from a file, with contacts on both sides.

    file   STL, PLY or VTP
    scale  length of the file's unit [m]
    point  where the file's origin lies [m]
    """

    file: str
    scale: float = 1.0
    point: Vector = (0.0, 0.0, 0.0)

    def corners(self) -> Array:
        """See `Wall.corners`."""
        return np.asarray(np.array(self.point) + self.scale * kept_surface(self.file, stamp(self)))

    @property
    def encloses(self) -> bool:
        """See `Wall.encloses`."""
        return is_closed_surface(self.file, stamp(self))


@dataclass(frozen=True, kw_only=True, eq=False)
class Mesh(Triangles):
    """A surface of triangles, with contacts on both sides.

    Triangles are neighbours if they have corners in common, bit by bit. Surfaces that join smoothly must be in one
    mesh. A plate that is thinner than the reach of a film gives the films of both its faces.

    vertices   (V, 3) [m]
    triangles  (T, 3) int, rows of `vertices`
    """

    vertices: np.ndarray
    triangles: np.ndarray

    def __post_init__(self) -> None:
        vertices, triangles = np.asarray(self.vertices, float), np.asarray(self.triangles, np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
            raise InputError("vertices", vertices.shape, "a table (V, 3) of finite numbers")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.min(initial=0) < 0:
            raise InputError("triangles", triangles.shape, "a table (T, 3) of rows of `vertices`")
        if triangles.max(initial=0) >= len(vertices):
            raise InputError("triangles", int(triangles.max()), f"below the number of vertices, {len(vertices)}")
        vertices, names = np.unique(vertices, axis=0, return_inverse=True)
        triangles = names.reshape(-1)[triangles]
        a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
        longest = np.maximum(np.linalg.norm(b - a, axis=1), np.linalg.norm(c - a, axis=1))
        triangles = triangles[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12 * longest**2]
        if len(triangles) == 0:
            raise InputError("triangles", 0, "at least one with an area")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "triangles", triangles)
        super().__post_init__()

    @classmethod
    def from_stl(cls, path: str | Path, *, scale: float = 1.0, place: Vector = (0.0, 0.0, 0.0), **options: Any) -> Mesh:
        """Read a surface from a file.

        path     STL, or another surface format that pyvista reads
        scale    length of the file's unit [m]
        place    of the file's origin [m]
        options  as of :class:`Wall`
        """
        return cls.of_corners(np.array(place) + scale * read_surface(path), **options)

    @classmethod
    def of_corners(cls, corners: np.ndarray, **options: Any) -> Mesh:
        """A surface from the corners of its triangles (T, 3, 3) [m]; options as of :class:`Wall`."""
        return cls(vertices=corners.reshape(-1, 3), triangles=np.arange(3 * len(corners)).reshape(-1, 3), **options)

    def to_stl(self, path: str | Path) -> None:
        """Write the surface as an STL file in metres, for a wall of a case."""
        write_stl(path, self.corners())

    def pieces(self) -> list[tuple[int, list[float]]]:
        """Corners and unit normal of every triangle."""
        from cfddem.particles.walls.nearest_point import TRIANGLE

        corners = self.corners()
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        return [(TRIANGLE, [*abc, *n]) for abc, n in zip(corners.reshape(-1, 9), normal)]

    def for_particles(self) -> Wall:
        """See `Wall.for_particles`."""
        return self

    def corners(self) -> Array:
        """See `Wall.corners`."""
        return np.asarray(self.vertices[self.triangles])

    def frame(self) -> tuple[np.ndarray, float]:
        """See `Wall.frame`."""
        return self.vertices, 0.0

    def sweep(self) -> float:
        """Bound of the speed of the surface [m/s]."""
        return Wall.sweep(self)


# ---------------------------------------------------------------- surface files: STL, and PLY and VTP by pyvista


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
