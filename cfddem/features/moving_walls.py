r"""The walls of a case beside those of its column, and their motion.

Walls move at a constant velocity over each call. That is chosen so that a wall ends each call exactly at

.. math:: x(t) = v\,\tau + a \sin(2\pi f \tau), \qquad \tau = \min(\max(t, t_0), t_1) - t_0

and has turned by its spin times :math:`\tau`, however long the steps are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.case.walls import CaseWall
from cfddem.features.case_feature import CaseFeature
from cfddem.particles.solver import ParticleSolver
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


# ---------------------------------------------------------------- velocities that change


STEPS_PER_PERIOD = 50
"""Fewest intervals of constant velocity in a period of an oscillation."""


@dataclass(frozen=True)
class Motion:
    """Motion of one wall. The wall must have been made with a velocity at least as high, which bounds its way.

    wall        its number
    velocity    v [m/s]
    spin        [rad/s]
    amplitude   a [m]
    frequency   f [Hz]
    begin, end  t_0, t_1 [s]
    """

    wall: int
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    amplitude: tuple[float, float, float] = (0.0, 0.0, 0.0)
    frequency: float = 0.0
    begin: float = 0.0
    end: float = math.inf

    def active(self, time: float) -> float:
        """Time for which the wall has moved [s]."""
        return min(max(time, self.begin), self.end) - self.begin

    def displacement(self, time: float) -> np.ndarray:
        """Displacement since the start (3,) [m].

        >>> Motion(0, amplitude=(0.0, 0.0, 1e-3), frequency=10.0, begin=1.0).displacement(1.025)
        array([0.   , 0.   , 0.001])
        """
        active = self.active(time)
        return np.array(self.velocity) * active + np.array(self.amplitude) * math.sin(
            2.0 * math.pi * self.frequency * active
        )


class WallMotions:
    """Sets the velocities of walls before every call of `ParticleSolver.advance`.

    motions  of the walls that begin, end or oscillate
    """

    def __init__(self, motions: Sequence[Motion]) -> None:
        self.motions = tuple(motions)

    @property
    def largest_step(self) -> float:
        """Longest time over which velocities may be constant [s]."""
        fastest = max((each.frequency for each in self.motions), default=0.0)
        return 1.0 / (STEPS_PER_PERIOD * fastest) if fastest > 0.0 else math.inf

    def __call__(self, run: ParticleSolver, step: float) -> None:
        """Set the velocities for the coming step [s]."""
        if not step > 0.0:
            raise InputError("step", step, "above 0")
        for each in self.motions:
            begin, end = run.time, run.time + step
            run.walls.velocity[each.wall] = (each.displacement(end) - each.displacement(begin)) / step
            run.walls.spin[each.wall] = np.array(each.spin) * ((each.active(end) - each.active(begin)) / step)
