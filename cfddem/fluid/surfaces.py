"""Smooth walls of the fluid: signed distances and velocities of surfaces, and unions of them.

    pipe = cylinder((0.05, 0.05, 0.0), radius=0.05)
    funnel = turned([(0.0, 0.01), (0.05, 0.05), (0.3, 0.05)], centre=(0.05, 0.05, 0.0))
    grid = within(Grid.of_size((0.1, 0.1, 0.3), 0.005), funnel)  # of cfddem.fluid.cut_cells

A distance is positive in the fluid, negative in the solid, and changes by no more than one metre in a metre. A wall
may slide along itself: it then has a velocity, which the fluid takes over where it sticks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError

Array = NDArray[np.float64]


class Surface(Protocol):
    """A wall of the fluid. Coordinates x, y, z [m] broadcast."""

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """Distance from the wall, positive in the fluid [m]."""
        ...

    def velocity(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        """Velocity of the nearest point of the wall [m/s]."""
        ...


@dataclass(frozen=True)
class Plane:
    """A flat wall.

    point     on the wall [m]
    normal    into the fluid, of any length
    sliding   velocity in its plane [m/s]
    """

    point: tuple[float, float, float]
    normal: tuple[float, float, float]
    sliding: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.normal))
        if not (np.isfinite(length) and length > 0.0):
            raise InputError("plane.normal", self.normal, "a vector that is not zero")
        if abs(float(np.dot(self.normal, self.sliding))) > 1e-9 * length * (1.0 + float(np.linalg.norm(self.sliding))):
            remedy = "the fluid knows walls that slide along themselves, none that move through it"
            raise InputError("plane.sliding", self.sliding, "a velocity in the plane of the wall", remedy)

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """See `Surface.distance`."""
        n = np.asarray(self.normal) / np.linalg.norm(self.normal)
        return (x - self.point[0]) * n[0] + (y - self.point[1]) * n[1] + (z - self.point[2]) * n[2]

    def velocity(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        """See `Surface.velocity`."""
        shape = np.broadcast_shapes(np.shape(x), np.shape(y), np.shape(z))
        u, v, w = (np.full(shape, speed) for speed in self.sliding)
        return u, v, w


@dataclass(frozen=True)
class Turned:
    """A line turned about an axis: a cylinder, a cone, a chain of them.

    line      points (place along the axis, radius) of the line, at least two [m]; its first and last pieces go on
              straight to infinity
    centre    a point on the axis, from which places count [m]
    axis      0, 1, 2 for x, y, z
    inside    whether the fluid is between the line and the axis, or else outside
    spin      the wall turns about the axis at this speed, counter-clockwise seen against the axis [rad/s]
    """

    line: tuple[tuple[float, float], ...]
    centre: tuple[float, float, float]
    axis: int = 2
    inside: bool = True
    spin: float = 0.0

    def __post_init__(self) -> None:
        points = np.asarray(self.line, dtype=float)
        if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] != 2 or not np.isfinite(points).all():
            raise InputError("turned.line", self.line, "at least two points (place along the axis, radius), in m")
        if (points[:, 1] < 0.0).any() or not (np.diff(points, axis=0) != 0.0).any(axis=1).all():
            raise InputError("turned.line", self.line, "radii of at least zero, and no point twice in a row")
        if (np.diff(points[:, 0]) < 0.0).any():
            remedy = "a line that turns back has its inside out; draw a rod with inside = False"
            raise InputError("turned.line", self.line, "places along the axis that do not fall", remedy)
        if self.axis not in (0, 1, 2):
            raise InputError("turned.axis", self.axis, "0, 1 or 2, for x, y, z")

    def _across(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        """Place along the axis, and the two coordinates across, in the order that turns counter-clockwise."""
        shifted = [coordinate - c for coordinate, c in zip((x, y, z), self.centre)]
        return shifted[self.axis], shifted[(self.axis + 1) % 3], shifted[(self.axis + 2) % 3]

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """See `Surface.distance`: that of the nearest piece of the line, with the side on which the point lies."""
        along, first, second = np.broadcast_arrays(*self._across(x, y, z))
        return self._nearest(along, np.hypot(first, second))[0]

    def velocity(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        """See `Surface.velocity`: spin times the radius of the nearest point of the wall."""
        along, first, second = np.broadcast_arrays(*self._across(x, y, z))
        components: list[Array] = [np.zeros(along.shape) for _ in range(3)]
        if self.spin != 0.0:
            radius = np.hypot(first, second)
            share = self.spin * self._nearest(along, radius)[1] / np.maximum(radius, 1e-300)
            components[(self.axis + 1) % 3], components[(self.axis + 2) % 3] = -share * second, share * first
        return components[0], components[1], components[2]

    def _nearest(self, along: Array, radius: Array) -> tuple[Array, Array]:
        """Signed distance from the line, and the radius of its nearest point [m]."""
        points, last = np.asarray(self.line, dtype=float), len(self.line) - 2
        nearest, side, at_wall = np.full(along.shape, np.inf), np.ones(along.shape), np.zeros(along.shape)
        for number, (a, b) in enumerate(pairwise(points)):
            step = b - a
            length = float(np.hypot(*step))
            share = ((along - a[0]) * step[0] + (radius - a[1]) * step[1]) / length**2
            share = np.clip(share, -np.inf if number == 0 else 0.0, np.inf if number == last else 1.0)
            away = np.hypot(along - a[0] - share * step[0], radius - a[1] - share * step[1])
            # signed across the straight line through the piece; at a corner the one farther across decides
            across = (step[1] * (along - a[0]) - step[0] * (radius - a[1])) / length
            tied = (np.abs(away - nearest) <= 1e-12 * nearest) & (np.abs(across) > np.abs(side))
            closer = (away < nearest * (1.0 - 1e-12)) | tied
            side, at_wall = np.where(closer, across, side), np.where(closer, a[1] + share * step[1], at_wall)
            nearest = np.minimum(nearest, away)
        signed = np.copysign(nearest, side)
        return signed if self.inside else -signed, at_wall


@dataclass(frozen=True)
class Together:
    """The fluid between several walls: where all distances are positive.

    walls  of any kind
    """

    walls: tuple[Surface, ...]

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """See `Surface.distance`."""
        return reduce(np.minimum, (wall.distance(x, y, z) for wall in self.walls))

    def velocity(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        """See `Surface.velocity`: that of the nearest wall."""
        return _of_first(self.walls, lambda wall: np.abs(wall.distance(x, y, z)), x, y, z)


@dataclass(frozen=True)
class Joined:
    """The fluid within several walls, which open into each other: where one distance is positive.

    walls  of any kind
    """

    walls: tuple[Surface, ...]

    def distance(self, x: Array, y: Array, z: Array) -> Array:
        """See `Surface.distance`; in the mouth between two of them it is that to the wall that is farther away."""
        return reduce(np.maximum, (wall.distance(x, y, z) for wall in self.walls))

    def velocity(self, x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        """See `Surface.velocity`: that of the wall whose distance counts."""
        return _of_first(self.walls, lambda wall: -wall.distance(x, y, z), x, y, z)


def _of_first(
    walls: Sequence[Surface], rank: Callable[[Surface], Array], x: Array, y: Array, z: Array
) -> tuple[Array, Array, Array]:
    """Velocity of the wall of the lowest rank at every place; of equal ranks, that of the first."""
    shape = np.broadcast_shapes(np.shape(x), np.shape(y), np.shape(z))
    velocities = [wall.velocity(x, y, z) for wall in walls]
    lowest, velocity = np.full(shape, np.inf), [np.zeros(shape) for _ in range(3)]
    moving = any(component.any() for components in velocities for component in components)
    for wall, components in zip(walls, velocities) if moving else ():  # at rest, it does not matter which is first
        ranked = rank(wall)
        for d, component in enumerate(components):
            velocity[d] = np.where(ranked < lowest, component, velocity[d])
        lowest = np.minimum(lowest, ranked)
    return velocity[0], velocity[1], velocity[2]


def cylinder(
    centre: Sequence[float], radius: float, axis: int = 2, *, inside: bool = True, spin: float = 0.0
) -> Turned:
    """A round wall around an axis, with the fluid inside or outside.

    centre  a point on the axis [m]
    radius  [m]
    axis    0, 1, 2 for x, y, z
    inside  whether the fluid is inside
    spin    about the axis [rad/s]
    """
    if not (np.isfinite(radius) and radius > 0.0):
        raise InputError("cylinder.radius", radius, "a positive length, in m")
    return turned([(0.0, radius), (radius, radius)], centre, axis, inside=inside, spin=spin)


def turned(
    line: Sequence[Sequence[float]], centre: Sequence[float], axis: int = 2, *, inside: bool = True, spin: float = 0.0
) -> Turned:
    """A line turned about an axis, as `Turned`; places along the axis rise from point to point.

    >>> cone = turned([(0.0, 0.0), (1.0, 1.0)], (0.0, 0.0, 0.0))
    >>> round(float(cone.distance(0.0, 0.0, 1.0)), 6)
    0.707107
    """
    points: Any = tuple((float(a), float(b)) for a, b in line)
    return Turned(points, tuple(float(c) for c in centre), axis, inside, float(spin))  # type: ignore[arg-type]


def together(*walls: Surface) -> Surface:
    """The fluid between all these walls."""
    return walls[0] if len(walls) == 1 else Together(tuple(walls))
