"""Walls of triangles: plates, surfaces from files, and meshes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cfddem.backend.errors import InputError, shown
from cfddem.model.triangles import Array
from cfddem.particles.walls.stl import is_closed_surface, kept_surface, read_surface, stamp, write_stl
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
