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
                first + number, each.velocity, each.spin, each.amplitude, each.frequency, each.begin,
                math.inf if each.end is None else each.end,
            )
            for number, each in enumerate(case.wall)
            if each.has_schedule
        ])  # fmt: skip

    @classmethod
    def is_in(cls, case: Case) -> bool:
        """Whether a wall of the case has a schedule."""
        return any(each.has_schedule for each in case.wall)

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


def wall_of(given: CaseWall, material: int, key: str) -> Wall:
    """A wall of a case as the solver takes it."""
    velocity = tuple(np.array(given.velocity) + given.swing)
    common: dict[str, Any] = {"velocity": velocity, "spin": given.spin, "centre": given.centre, "material": material}
    try:
        if given.shape == "plane":
            return Plane(point=given.point, normal=given.normal, **common)
        if given.shape == "plate":
            return Mesh.of_corners(triangles(given), **common)
        if given.shape == "cylinder":
            return Cylinder(
                point=given.point, axis=given.axis, radius=given.radius or 0.0, length=given.length, caps=given.caps,
                outside=given.outside, **common,
            )  # fmt: skip
        if given.shape == "cone":
            return Cone(
                point=given.point, axis=given.axis, radius=given.radius or 0.0, top_radius=given.top_radius or 0.0,
                length=given.length or 0.0, **common,
            )  # fmt: skip
        return Mesh.from_stl(given.file or "", scale=given.scale, place=given.point, **common)
    except InputError as failure:
        raise InputError(f"{key}.{failure.field}", failure.value, failure.limit, failure.remedy) from None
