"""The walls of a case beside those of its column, and their motion."""

from __future__ import annotations

import math
from typing import Any

from cfddem.case.schema import Case
from cfddem.features.case_feature import CaseFeature
from cfddem.particles.walls.motion import WallMotions
from cfddem.particles.walls.wall import Wall


class MovingWalls(CaseFeature):
    """Walls of a case that begin, end or oscillate."""

    name = "moving walls"

    def __init__(self, case: Case, simulation: Any) -> None:
        first = len(simulation.particle_solver.walls.sweep) - len(case.wall)  # the walls of the case are the last ones
        moving = [wall.motion(first + number) for number, wall in enumerate(case.wall) if wall.has_schedule]
        self._motions = WallMotions(moving)

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
        wall.particle_wall(default if wall.material is None else names.index(wall.material), f"wall.{number}")
        for number, wall in enumerate(case.wall)
    ]
