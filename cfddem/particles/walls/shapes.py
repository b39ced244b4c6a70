"""Planes, boxes and round walls; those of triangles are in :mod:`cfddem.particles.walls.meshes`.

Each shape gives the simple pieces it is made of and the largest speed at which its surface moves; loops take the arrays
of :class:`cfddem.particles.walls.nearest_point.Walls`. Contact, friction and film treat every wall as flat (R* = R,
m* = m): the error is of the order of R over the wall's radius of curvature.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError
from cfddem.model.triangles import Array, circle, corners_of
from cfddem.particles.walls.wall import Sketch, SolidSide, Wall, unit

if TYPE_CHECKING:
    from cfddem.particles.vectors import Vector

SIDES, AROUND = 96, 72
"""Sides of an open cylinder or cone as a thin wall of the fluid, and of a round wall in a picture."""

BEHIND = SolidSide("behind", ("none",), "the side without particles is solid")


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
        from cfddem.particles.walls.nearest_point import PLANE  # loads the compiler, which checks of a case lack

        return [(PLANE, [*self.point, *unit(self.normal)])]

    def frame(self) -> tuple[np.ndarray, float]:
        """See `Wall.frame`."""
        return np.array([self.point], float), np.inf

    def repeats(self, periodic: np.ndarray) -> bool:
        """See `Wall.repeats`."""
        return not np.asarray(self.normal)[periodic].any()

    def sweep(self) -> float:
        """Speed along the normal [m/s]; the plane may spin about its normal only."""
        if not self._spins_along(self.normal):
            raise InputError(
                "spin",
                self.spin,
                "along the normal of a plane",
                "take a mesh or a surface for a plate that tilts",
            )
        return abs(float(np.dot(self.velocity, unit(self.normal))))

    @property
    def side(self) -> SolidSide:
        """See `Wall.side`."""
        return BEHIND

    def misplaced(self, column: Array) -> Iterator[tuple[Literal["warning", "error"], str, str, str]]:
        """See `Wall.misplaced`."""
        away = self.distance(corners_of(np.zeros(3), column))
        if away.max() <= 0.0:
            yield "error", "normal", "the whole column lies behind the plane", "reverse the normal"
        elif away.min() >= 0.0 and self.stays:
            yield "warning", "point", "the plane does not cut the column", "move it into the column"

    def distance(self, points: Array) -> Array:
        """See `Wall.distance`."""
        return np.asarray((points - np.array(self.point)) @ unit(self.normal))

    def speed_of_spin(self) -> float:
        """See `Wall.speed_of_spin`."""
        return 0.0

    def polygons(self, far: float) -> list[Array]:
        """See `Wall.polygons`."""
        return [np.array(self.point) + math.sqrt(0.5) * far * circle(unit(self.normal), 4)[None]]

    def sketch(self, far: float) -> Sketch:
        """See `Wall.sketch`."""
        along = np.array([-self.normal[2], self.normal[0]])
        reach = far * along / max(math.hypot(*along), 1e-300)
        return Sketch([np.array(self.point)[::2] + np.array([-reach, reach])] if along.any() else [], [])


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
        from cfddem.particles.walls.nearest_point import PLANE

        axes = np.eye(3)
        return [(PLANE, [*corner, *(sign * n)]) for corner, sign in ((self.low, 1), (self.high, -1)) for n in axes]

    def frame(self) -> tuple[np.ndarray, float]:
        """See `Wall.frame`."""
        return corners_of(np.array(self.low), np.array(self.high)), 0.0


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
class Tapered(Round):
    """A round wall between two circles, each with a radius, or without end.

    radius  of the lower end [m]
    length  along the axis; None without end [m]
    caps    whether it has flat ends
    """

    radius: float
    length: float | None
    caps = False

    @property
    def radii(self) -> tuple[float, float]:
        """Radii of the lower and upper end [m]."""
        return self.radius, self.radius

    @property
    def side(self) -> SolidSide:
        """See `Wall.side`."""
        return SolidSide(None)

    def frame(self) -> tuple[np.ndarray, float]:
        """See `Wall.frame`."""
        return np.array([self.point, np.add(self.point, (self.length or 0.0) * unit(self.axis))]), max(self.radii)

    def _ring(self, end: float, radius: float, count: int) -> Array:
        """Points on a circle about the axis, at a distance from its lower end (count, 3) [m]."""
        axis = unit(self.axis)
        return np.asarray(np.array(self.point) + end * axis + radius * circle(axis, count))

    def corners(self) -> Array:
        """See `Wall.corners`."""
        low, high = self._ring(0.0, self.radii[0], SIDES), self._ring(self.length or 0.0, self.radii[1], SIDES)
        after = [np.roll(corner, -1, axis=0) for corner in (low, high)]
        return np.concatenate([np.stack([low, after[0], after[1]], 1), np.stack([low, after[1], high], 1)])

    def extent(self) -> Array | None:
        """See `Wall.extent`."""
        if self.length is None:
            return None
        axis = unit(self.axis)
        ends = np.array([self.point, np.array(self.point) + self.length * axis])
        reach = np.outer(self.radii, np.sqrt(np.maximum(1.0 - axis**2, 0.0)))
        return np.array([(ends - reach).min(axis=0), (ends + reach).max(axis=0)])

    def _about_axis(self, points: Array) -> tuple[Array, Array]:
        """Height along the axis and distance from it (N,), (N,) [m]."""
        axis, away = unit(self.axis), points - np.array(self.point)
        height = away @ axis
        return height, np.linalg.norm(away - height[:, None] * axis, axis=1)

    def distance(self, points: Array) -> Array:
        """Of an open wall."""
        (height, radius), length = self._about_axis(points), self.length or 0.0
        own, top = self.radii
        slope = top - own
        along = np.clip(((radius - own) * slope + height * length) / (slope**2 + length**2), 0.0, 1.0)
        return np.hypot(radius - own - along * slope, height - along * length)

    def closes(self, points: Array, side: str | None = None) -> NDArray[np.bool_]:
        """See `Wall.closes`."""
        if not self.is_open:
            return super().closes(points)
        height, radius = self._about_axis(points)
        length, (own, top) = self.length or 0.0, self.radii
        there = own + (top - own) * height / length
        beside = (height >= 0.0) & (height <= length)
        return np.asarray(beside & ((radius > there) if side == "outside" else (radius < there)))

    def speed_of_spin(self) -> float:
        """See `Wall.speed_of_spin`."""
        reach, arm = max(self.radii), 0.0
        if not self._spins_along(self.axis, self.point):
            reach += self.length or 0.0
            arm = math.hypot(*np.subtract(self.point if self.centre is None else self.centre, self.point))
        return math.hypot(*self.spin) * (reach + arm)

    @property
    def opening(self) -> tuple[str, float] | None:
        """See `Wall.opening`."""
        own, top = self.radii
        return ("radius" if own <= top else "top_radius", 2.0 * min(own, top)) if self.is_open else None

    def circle_half_way_up(self) -> tuple[float, float, float] | None:
        """See `Wall.circle_half_way_up`."""
        upright = self.is_open and self.axis[:2] == (0.0, 0.0)
        return (*self.point[:2], 0.5 * sum(self.radii)) if upright else None

    def _ends(self, far: float) -> tuple[float, float]:
        return (-far, far) if self.length is None else (0.0, self.length)

    def polygons(self, far: float) -> list[Array]:
        """See `Wall.polygons`."""
        low, high = (self._ring(end, radius, AROUND) for end, radius in zip(self._ends(far), self.radii))
        side = np.stack([low, np.roll(low, -1, axis=0), np.roll(high, -1, axis=0), high], axis=1)
        return [side, np.stack([low, high])] if self.caps else [side]

    def sketch(self, far: float) -> Sketch:
        """See `Wall.sketch`."""
        axis, point = unit(self.axis)[::2], np.array(self.point)[::2]
        if math.hypot(*axis) < 0.5 and self.length is not None:
            angle = np.linspace(0.0, 2.0 * math.pi, 100)
            return Sketch([point + self.radii[0] * np.stack([np.cos(angle), np.sin(angle)], axis=1)], [])
        normal = np.array([-axis[1], axis[0]])
        left, right = (
            np.array([point + end * axis + side * radius * normal for end, radius in zip(self._ends(far), self.radii)])
            for side in (-1.0, 1.0)
        )
        return Sketch([left, right, *(np.array(ends) for ends in zip(left, right) if self.caps)], [])


@dataclass(frozen=True, kw_only=True)
class Cylinder(Tapered):
    """A round wall of one radius.

    An infinite cylinder, or one with caps, keeps particles on one side. A finite open one is a tube that particles
    touch from both sides and at the rims. Let a tube on a cone or a plane reach a little beyond it, so that no rim
    lies in the corner.

    radius   [m]
    length   [m]; infinite if not given
    caps     flat ends
    outside  particles are outside
    """

    length: float | None = None
    caps: bool = False
    outside: bool = False

    def __post_init__(self) -> None:
        _check_positive(self, "radius", "length")
        if self.caps and self.length is None:
            raise InputError("caps", True, "false where no length is given")
        if self.outside and self.is_open:
            raise InputError("outside", True, "false for an open cylinder", "particles touch it from both sides")
        super().__post_init__()

    @property
    def side(self) -> SolidSide:
        """See `Wall.side`."""
        return BEHIND if self.length is None or self.caps else SolidSide(None)

    def distance(self, points: Array) -> Array:
        """See `Wall.distance`."""
        if self.is_open:
            return super().distance(points)
        height, radius = self._about_axis(points)
        side = radius - self.radius
        if self.length is None:
            return side if self.outside else -side
        ends = np.maximum(-height, height - self.length)
        beyond = np.hypot(np.maximum(side, 0.0), np.maximum(ends, 0.0)) + np.minimum(np.maximum(side, ends), 0.0)
        return np.asarray(beyond if self.outside else -np.maximum(side, ends))

    def pieces(self) -> list[tuple[int, list[float]]]:
        """A surface of revolution, with caps two planes as well, or one solid cylinder."""
        from cfddem.particles.walls.nearest_point import PLANE, REVOLVED, SOLID_CYLINDER

        axis = unit(self.axis)
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

    def repeats(self, periodic: np.ndarray) -> bool:
        """See `Wall.repeats`."""
        across = np.asarray(self.axis)[~periodic].any()
        return self.length is None and not across and int(periodic.sum()) == 1

    def sweep(self) -> float:
        """As of all round walls; one without end may also move along its axis [m/s]."""
        if self.length is not None:
            return super().sweep()
        if not self._spins_along(self.axis, self.point):
            raise InputError("spin", self.spin, "about the axis of a cylinder without end", "give a length")
        return float(np.linalg.norm(np.cross(self.velocity, unit(self.axis))))


@dataclass(frozen=True, kw_only=True)
class Cone(Tapered):
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
        from cfddem.particles.walls.nearest_point import REVOLVED

        line = np.array([self.top_radius - self.radius, self.length])
        reach = float(np.linalg.norm(line))
        return [(REVOLVED, [*self.point, *unit(self.axis), self.radius, *(line / reach), 0.0, reach, 1.0])]

    @property
    def radii(self) -> tuple[float, float]:
        """See `Tapered.radii`."""
        return self.radius, self.top_radius


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
        from cfddem.particles.walls.nearest_point import REVOLVED

        points, axis = np.asarray(self.line, float), unit(self.axis)
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
        """See `Wall.frame`."""
        points, axis = np.asarray(self.line, float), unit(self.axis)
        return np.array([np.add(self.point, z * axis) for z in points[:, 0]]), float(points[:, 1].max())


def _check_positive(wall: Wall, *fields: str) -> None:
    for field in fields:
        value = getattr(wall, field)
        if value is not None and not 0.0 < value < np.inf:
            raise InputError(field, value, "above 0 and finite")
