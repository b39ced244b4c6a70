"""What every wall has: its motion and material, what particles touch, its side in a fluid, and how it is drawn."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError
from cfddem.model.triangles import Array, inside_surface, is_closed

if TYPE_CHECKING:
    from cfddem.particles.vectors import Vector

ROUNDING = 1e-9
"""Relative difference below which directions and positions are equal."""


class SolidSide(NamedTuple):
    """Side of a wall whose cells are solid to a fluid.

    default  where a case says nothing: "behind", "inside", "thin" or "none"; None if the case has to say it
    allowed  what the case may say
    why      it may not say more
    """

    default: str | None
    allowed: tuple[str, ...] = ("inside", "outside", "thin", "none")
    why: str = ""


class Sketch(NamedTuple):
    """A wall as seen along y: x and z of lines and of areas, each (n, 2) [m]."""

    lines: list[Array]
    areas: list[Array]


@dataclass(frozen=True, kw_only=True)
class Wall:
    """Properties of all walls.

    velocity  of the wall as a whole [m/s]
    spin      of the wall about its centre [rad/s]
    centre    of the spin, moves with the velocity; a point on the axis or in the middle if not given [m]
    material  row of the pair table
    """

    exact: ClassVar[bool] = True
    """Whether particles touch exact pieces of it, else triangles."""

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
                raise InputError(field, getattr(self, field), "a direction other than zero")
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

    @property
    def stays(self) -> bool:
        """Whether it stays in its place while it moves, along itself."""
        return self.sweep() <= ROUNDING * float(np.linalg.norm(self.velocity))

    def repeats(self, periodic: np.ndarray) -> bool:
        """Whether the wall is the same in every image of a box with these periodic axes (3,) bool."""
        return False

    # ------------------------------------------------------------ in a case, of a wall at the start

    def for_particles(self) -> Wall:
        """The wall that particles touch."""
        return self

    @property
    def side(self) -> SolidSide:
        """Side whose cells are solid to a fluid."""
        return SolidSide("inside")

    @property
    def is_open(self) -> bool:
        """Whether particles touch it from both sides, and it has no inside."""
        return self.side.default is None

    def corners(self) -> Array:
        """Corners of its triangles (T, 3, 3) [m], for pictures, and as a thin wall of the fluid.

        errors  InputError if a file cannot be read
        """
        raise InputError("shape", type(self).__name__, "one of triangles", "write its method `corners`")

    @property
    def encloses(self) -> bool:
        """Whether it is a closed surface of triangles.

        errors  InputError if a file cannot be read
        """
        return not self.exact and is_closed(self.corners())

    def extent(self) -> Array | None:
        """Lower and upper corner of a box around it (2, 3) [m]; None if it has no end."""
        points, around = self.frame()
        return np.array([points.min(axis=0) - around, points.max(axis=0) + around]) if np.isfinite(around) else None

    def misplaced(self, column: Array) -> Iterator[tuple[Literal["warning", "error"], str, str, str]]:
        """What is wrong with its place in a column of a size (3,) [m]: severity, key, reason and remedy."""
        box = self.extent()
        if box is not None and ((box[0] > column).any() or (box[1] < 0.0).any()):
            low, high = (", ".join(f"{coordinate:.4g}" for coordinate in corner) for corner in box)
            where = f"the column extends from 0 to {tuple(column.tolist())} m"
            yield "error", "point", f"the wall, from ({low}) to ({high}) m, lies outside the column", where

    def distance(self, points: Array) -> Array:
        """Distance of points (N, 3) [m] (N,) [m], negative behind a wall with one side; NaN if it is not exact."""
        return np.full(len(points), np.nan)

    def closes(self, points: Array, side: str | None = None) -> NDArray[np.bool_]:
        """Which points (N, 3) [m] lie on a side of it: "inside", also if None, "outside", or "behind" (N,)."""
        if self.side.default == "behind":
            return np.asarray(self.distance(points) < 0.0)
        inside = inside_surface(self.corners(), points)
        return ~inside if side == "outside" else inside

    def speed_of_spin(self) -> float:
        """Bound of the speed that the spin gives its surface; NaN if it is not known without reading a file [m/s]."""
        return math.nan if any(self.spin) else 0.0

    @property
    def opening(self) -> tuple[str, float] | None:
        """Key and width of the narrowest part of an open wall [m]; None for others."""
        return None

    def circle_half_way_up(self) -> tuple[float, float, float] | None:
        """Centre and radius of an upright round open wall [m]; None for others."""
        return None

    def polygons(self, far: float) -> list[Array]:
        """Its surface for pictures: polygons (P, K, 3), by their number of corners K [m].

        far  how far a wall without an end is drawn [m]
        """
        return [self.corners()]

    def sketch(self, far: float) -> Sketch:
        """The wall as seen along y; far as of `polygons`."""
        return Sketch([], list(self.corners()[:, :, ::2]))

    def _spins_along(self, axis: Sequence[float], point: Sequence[float] | None = None) -> bool:
        """Whether the spin leaves a surface of revolution about this axis unchanged."""
        along = unit(axis)
        aside = 0.0 if point is None else np.linalg.norm(np.cross(np.subtract(self.middle(), point), along))
        across = float(np.linalg.norm(np.cross(self.spin, along)))
        size = 0.0 if point is None else float(np.abs(point).max() + np.abs(self.middle()).max())
        return across <= ROUNDING * float(np.linalg.norm(self.spin)) and float(aside) <= ROUNDING * size


def unit(direction: Sequence[float]) -> Array:
    """A direction of unit length (3,)."""
    return np.asarray(np.asarray(direction, float) / np.linalg.norm(direction))
