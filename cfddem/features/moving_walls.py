"""The walls of a case beside those of its column, and their motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.case.wall_geometry import triangles
from cfddem.case.walls import CaseWall
from cfddem.features.case_feature import CaseFeature
from cfddem.particles.walls.motion import Motion, WallMotions
from cfddem.particles.walls.shapes import Cone, Cylinder, Mesh, Plane, Wall


class MovingWalls(CaseFeature):
    """Walls of a case that begin, end or oscillate."""

    name = "moving walls"

    def __init__(self, case: Case, simulation: Any) -> None:
        first = len(simulation.particle_solver.walls.sweep) - len(case.wall)  # the walls of the case are the last ones
        self._motions = WallMotions([
            Motion(
                first + number, wall.velocity, wall.spin, wall.amplitude, wall.frequency, wall.begin,
                math.inf if wall.end is None else wall.end,
            )
            for number, wall in enumerate(case.wall)
            if wall.has_schedule
        ])  # fmt: skip

    @classmethod
    def is_in(cls, case: Case) -> bool:
        """Whether a wall of the case has a schedule."""
        return any(wall.has_schedule for wall in case.wall)

    @property
    def step_limits(self) -> dict[str, float]:
        """Longest step in which an oscillating wall may have one velocity [s]."""
        longest = self._motions.largest_step
        return {"wall oscillation": longest} if math.isfinite(longest) else {}

    def before(self, simulation: Any, step: float) -> None:
        """Set the velocities of the walls for the coming step [s]; their places are in the state of the solver."""
        self._motions(simulation.particle_solver, step)


def case_walls(case: Case, default: int) -> list[Wall]:
    """The walls of a case beside those of the column.

    default  row of the pair table of walls without a material
    """
    names = list(case.material)
    return [
        wall_of(wall, default if wall.material is None else names.index(wall.material), f"wall.{number}")
        for number, wall in enumerate(case.wall)
    ]


def wall_of(wall: CaseWall, material: int, key: str) -> Wall:
    """A wall of a case as the solver takes it."""
    velocity = tuple(np.array(wall.velocity) + wall.swing)
    common: dict[str, Any] = {"velocity": velocity, "spin": wall.spin, "centre": wall.centre, "material": material}
    try:
        if wall.shape == "plane":
            return Plane(point=wall.point, normal=wall.normal, **common)
        if wall.shape == "plate":
            return Mesh.of_corners(triangles(wall), **common)
        if wall.shape == "cylinder":
            return Cylinder(
                point=wall.point, axis=wall.axis, radius=wall.radii[0], length=wall.length, caps=wall.caps,
                outside=wall.outside, **common,
            )  # fmt: skip
        if wall.shape == "cone":
            return Cone(
                point=wall.point, axis=wall.axis, radius=wall.radii[0], top_radius=wall.radii[1],
                length=wall.length or 0.0, **common,
            )  # fmt: skip
        return Mesh.from_stl(wall.file or "", scale=wall.scale, place=wall.point, **common)
    except InputError as failure:
        raise InputError(f"{key}.{failure.field}", failure.value, failure.limit, failure.remedy) from None
