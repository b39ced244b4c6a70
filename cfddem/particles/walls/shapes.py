"""Walls: surfaces that particles touch; every wall has a material.

Each shape gives the simple pieces it is made of and the largest speed at which its surface moves; loops take the arrays
of :class:`cfddem.particles.walls.nearest_point.Walls`. Contact, friction and film treat every wall as flat (R* = R,
m* = m): the error is of the order of R over the wall's radius of curvature.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.particles.vectors import Vector
from cfddem.particles.walls.nearest_point import PLANE, REVOLVED, SOLID_CYLINDER, TRIANGLE
from cfddem.particles.walls.stl import read_surface, write_stl

ROUNDING = 1e-9
"""Relative difference below which directions and positions are equal."""


@dataclass(frozen=True, kw_only=True)
class Wall:
    """Properties of all walls.

    velocity  of the wall as a whole [m/s]
    spin      of the wall about its centre [rad/s]
    centre    of the spin, moves with the velocity; a point on the axis or in the middle if not given [m]
    material  row of the pair table
    """

    velocity: Vector = (0.0, 0.0, 0.0)
    spin: Vector = (0.0, 0.0, 0.0)
    centre: Vector | None = None
    material: int = 0

    def __post_init__(self) -> None:
        for field in ("velocity", "spin", "centre", "point", "low", "high", "axis", "normal"):
            value = getattr(self, field, None)
            if value is not None and (np.shape(value) != (3,) or not np.isfinite(value).all()):
                raise InputError(field, value, "three finite numbers")
        for field in ("axis", "normal"):
            if not np.linalg.norm(getattr(self, field, 1.0)) > 0.0:
                raise InputError(field, getattr(self, field), "a direction")
        if self.material < 0:
            raise InputError("material", self.material, "a row of the pair table, 0 or above")
        self.sweep()

    def pieces(self) -> list[tuple[int, list[float]]]:
        """Kind and numbers of each piece, as :func:`cfddem.particles.walls.nearest_point.nearest` takes them."""
        raise NotImplementedError

    def frame(self) -> tuple[np.ndarray, float]:
        """Points (n, 3) and a radius about them that enclose the wall [m]."""
        raise NotImplementedError

    def middle(self) -> np.ndarray:
        """Centre of the spin [m]."""
        return np.array(self.frame()[0].mean(axis=0) if self.centre is None else self.centre, float)

    def sweep(self) -> float:
        """Bound of the speed at which the surface leaves its present position [m/s]."""
        points, around = self.frame()
        turning = np.linalg.norm(np.cross(self.spin, points - self.middle()), axis=1).max()
        return float(np.linalg.norm(self.velocity) + turning + np.linalg.norm(self.spin) * around)

    def repeats(self, periodic: np.ndarray) -> bool:
        """Whether the wall is the same in every image of a box with these periodic axes (3,) bool."""
        return False

    def _spins_along(self, axis: Sequence[float], point: Sequence[float] | None = None) -> bool:
        """Whether the spin leaves a surface of revolution about this axis unchanged."""
        along = _unit(axis)
        aside = 0.0 if point is None else np.linalg.norm(np.cross(np.subtract(self.middle(), point), along))
        across = float(np.linalg.norm(np.cross(self.spin, along)))
        size = 0.0 if point is None else float(np.abs(point).max() + np.abs(self.middle()).max())
        return across <= ROUNDING * float(np.linalg.norm(self.spin)) and float(aside) <= ROUNDING * size


@dataclass(frozen=True, kw_only=True)
class Plane(Wall):
    """An infinite flat wall; a velocity along the wall moves its surface, not the wall.

    point   any point of it [m]
    normal  points to the side of the particles; need not be of unit length
    """

    point: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 0.0, 1.0)

    def pieces(self) -> list[tuple[int, list[float]]]:
        """One plane: its point and unit normal."""
        return [(PLANE, [*self.point, *_unit(self.normal)])]

    def frame(self) -> tuple[np.ndarray, float]:
        return np.array([self.point], float), np.inf

    def repeats(self, periodic: np.ndarray) -> bool:
        return not np.asarray(self.normal)[periodic].any()

    def sweep(self) -> float:
        """Speed along the normal [m/s]; the plane may spin about its normal only."""
        if not self._spins_along(self.normal):
            raise InputError("spin", self.spin, "along the normal of a plane", "take a mesh for a plate that tilts")
        return abs(float(np.dot(self.velocity, _unit(self.normal))))


@dataclass(frozen=True, kw_only=True)
class Box(Wall):
    """The six sides of a box with particles inside.

    low, high  opposite corners [m]

    >>> Box(low=(0.0, 0.0, 0.0), high=(0.02, 0.02, 0.1)).high
    (0.02, 0.02, 0.1)
    """

    low: Vector
    high: Vector

    def __post_init__(self) -> None:
        super().__post_init__()
        if not np.all(np.less(self.low, self.high)):
            raise InputError("high", self.high, f"above low = {self.low} along every axis")

    def pieces(self) -> list[tuple[int, list[float]]]:
        """Six planes whose normals point inwards."""
        axes = np.eye(3)
        return [(PLANE, [*corner, *(sign * n)]) for corner, sign in ((self.low, 1), (self.high, -1)) for n in axes]

    def frame(self) -> tuple[np.ndarray, float]:
        return np.array(list(itertools.product(*zip(self.low, self.high))), float), 0.0


@dataclass(frozen=True, kw_only=True)
class Round(Wall):
    """A wall that is turned about an axis.

    point  on the axis: centre of the lower end of a wall with ends [m]
    axis   direction, upward from there; need not be of unit length
    """

    point: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)

    def sweep(self) -> float:
        """Bound of the speed of the surface [m/s]; a spin about the axis leaves the surface in place."""
        return float(np.linalg.norm(self.velocity)) if self._spins_along(self.axis, self.point) else super().sweep()


@dataclass(frozen=True, kw_only=True)
class Cylinder(Round):
    """A round wall of one radius.

    An infinite cylinder, or one with caps, keeps particles on one side. A finite open one is a tube that particles
    touch from both sides and at the rims. Let a tube on a cone or a plane reach a little beyond it, so that no rim
    lies in the corner.

    radius   [m]
    length   [m]; infinite if not given
    caps     flat ends
    outside  particles are outside
    """

    radius: float
    length: float | None = None
    caps: bool = False
    outside: bool = False

    def __post_init__(self) -> None:
        _check_positive(self, "radius", "length")
        if self.caps and self.length is None:
            raise InputError("caps", True, "False where no length is given")
        super().__post_init__()

    def pieces(self) -> list[tuple[int, list[float]]]:
        """A surface of revolution, with caps two planes as well, or one solid cylinder."""
        axis = _unit(self.axis)
        head = [*self.point, *axis, self.radius]
        if self.length is None:
            return [(REVOLVED, [*head, 0.0, -1.0 if self.outside else 1.0, -np.inf, np.inf, 0.0])]
        if not self.caps:
            return [(REVOLVED, [*head, 0.0, 1.0, 0.0, self.length, 1.0])]
        if self.outside:
            return [(SOLID_CYLINDER, [*head, self.length])]
        top = np.add(self.point, self.length * axis)
        side = (REVOLVED, [*head, 0.0, 1.0, -np.inf, np.inf, 0.0])
        return [side, (PLANE, [*self.point, *axis]), (PLANE, [*top, *-axis])]

    def frame(self) -> tuple[np.ndarray, float]:
        return np.array([self.point, np.add(self.point, (self.length or 0.0) * _unit(self.axis))]), self.radius

    def repeats(self, periodic: np.ndarray) -> bool:
        across = np.asarray(self.axis)[~periodic].any()
        return self.length is None and not across and int(periodic.sum()) == 1

    def sweep(self) -> float:
        """As of all round walls; one without end may also move along its axis [m/s]."""
        if self.length is not None:
            return super().sweep()
        if not self._spins_along(self.axis, self.point):
            raise InputError("spin", self.spin, "about the axis of a cylinder without end", "give a length")
        return float(np.linalg.norm(np.cross(self.velocity, _unit(self.axis))))


@dataclass(frozen=True, kw_only=True)
class Cone(Round):
    """A round wall whose radius changes along its axis, open at both ends, with contacts on both sides: a hopper.

    radius      of the lower end, the outlet; may be 0 [m]
    top_radius  of the upper end [m]
    length      [m]

    >>> Cone(radius=0.01, top_radius=0.03, length=0.05).point
    (0.0, 0.0, 0.0)
    """

    radius: float = 0.0
    top_radius: float
    length: float

    def __post_init__(self) -> None:
        _check_positive(self, "top_radius", "length")
        if not 0.0 <= self.radius < np.inf:
            raise InputError("radius", self.radius, "at least 0")
        super().__post_init__()

    def pieces(self) -> list[tuple[int, list[float]]]:
        """A surface of revolution whose line runs from the lower to the upper end."""
        line = np.array([self.top_radius - self.radius, self.length])
        reach = float(np.linalg.norm(line))
        return [(REVOLVED, [*self.point, *_unit(self.axis), self.radius, *(line / reach), 0.0, reach, 1.0])]

    def frame(self) -> tuple[np.ndarray, float]:
        top = np.add(self.point, self.length * _unit(self.axis))
        return np.array([self.point, top]), max(self.radius, self.top_radius)


@dataclass(frozen=True, kw_only=True)
class Turned(Round):
    """A round vessel around the particles: a line turned about an axis, as `cfddem.fluid.surfaces.turned`.

    Where the vessel is hollow between two pieces, both go on straight behind each other, so that a sphere in the corner
    touches each once. Where an edge stands out into the vessel, the two pieces end there.

    line   heights along the axis from `point`, which rise, and radii, at least two; the first and the last piece go on
           straight [m]
    """

    line: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        points = np.asarray(self.line, float)
        if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] != 2 or not np.isfinite(points).all():
            raise InputError("line", self.line, "at least two points (height, radius), in m")
        if not (np.diff(points[:, 0]) > 0.0).all() or not (points[:, 1] >= 0.0).all():
            raise InputError("line", self.line, "of rising heights, and radii of at least 0")
        super().__post_init__()

    def pieces(self) -> list[tuple[int, list[float]]]:
        """One surface of revolution for each piece of the line."""
        points, axis = np.asarray(self.line, float), _unit(self.axis)
        steps = np.diff(points, axis=0)
        slopes = steps[:, 1] / steps[:, 0]
        stands_out = np.concatenate([[False], np.diff(slopes) > 0.0, [False]])  # an edge of the wall, not a corner
        turns_back = stands_out.any() and (slopes < 0.0).any()
        pieces = []
        for n, (begin, step) in enumerate(zip(points[:-1], steps)):
            along, length = step[::-1] / np.linalg.norm(step), float(np.linalg.norm(step))
            ends = [0.0 if stands_out[n] else -np.inf, length if stands_out[n + 1] else np.inf]
            # behind a piece with an end there may be another part of the vessel
            both = float(turns_back and bool(np.isfinite(ends).any()))
            place = np.add(self.point, begin[0] * axis)
            pieces.append((REVOLVED, [*place, *axis, begin[1], *along, *ends, both]))
        return pieces

    def frame(self) -> tuple[np.ndarray, float]:
        points, axis = np.asarray(self.line, float), _unit(self.axis)
        return np.array([np.add(self.point, z * axis) for z in points[:, 0]]), float(points[:, 1].max())


@dataclass(frozen=True, kw_only=True, eq=False)
class Mesh(Wall):
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
        write_stl(path, self.vertices[self.triangles])

    def pieces(self) -> list[tuple[int, list[float]]]:
        """Corners and unit normal of every triangle."""
        corners = self.vertices[self.triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        return [(TRIANGLE, [*abc, *n]) for abc, n in zip(corners.reshape(-1, 9), normal)]

    def frame(self) -> tuple[np.ndarray, float]:
        return self.vertices, 0.0

    def middle(self) -> np.ndarray:
        if self.centre is not None:
            return np.array(self.centre, float)
        return 0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0))


def _unit(direction: Sequence[float]) -> np.ndarray:
    return np.asarray(direction, float) / np.linalg.norm(direction)


def _check_positive(wall: Wall, *fields: str) -> None:
    for field in fields:
        value = getattr(wall, field)
        if value is not None and not 0.0 < value < np.inf:
            raise InputError(field, value, "above 0 and finite")
