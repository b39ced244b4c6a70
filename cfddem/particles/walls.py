"""Walls: surfaces that particles meet; a wall is a material like any other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cfddem.errors import InputError
from cfddem.kernels import inline
from cfddem.particles.vectors import at, dot, minus


@dataclass(frozen=True)
class Plane:
    """A flat wall.

    point     any point of it [m]
    normal    points to the side of the particles; need not be of unit length
    velocity  of the wall's surface [m/s]
    material  row of the pair table
    """

    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    material: int = 0

    def __post_init__(self) -> None:
        if not np.linalg.norm(self.normal) > 0:
            raise InputError("normal", self.normal, "a direction")


class Walls(NamedTuple):
    """The arrays of W walls, as compiled loops take them."""

    point: np.ndarray  # (W, 3) [m]
    normal: np.ndarray  # (W, 3) unit, towards the particles
    velocity: np.ndarray  # (W, 3) [m/s]
    material: np.ndarray  # (W,) int32


def walls(planes: Sequence[Plane] = ()) -> Walls:
    """Arrays of the given walls."""
    normal = np.array([plane.normal for plane in planes], float).reshape(-1, 3)
    return Walls(
        np.array([plane.point for plane in planes], float).reshape(-1, 3),
        normal / np.linalg.norm(normal, axis=1, keepdims=True),
        np.array([plane.velocity for plane in planes], float).reshape(-1, 3),
        np.array([plane.material for plane in planes], np.int32),
    )


@inline
def height(walls, w, place):
    """Distance of a place from wall w, negative behind it."""
    return dot(minus(place, at(walls.point, w)), at(walls.normal, w))
