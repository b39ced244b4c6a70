r"""Motion of walls that changes in time: it begins, ends or oscillates.

Walls move at a constant velocity over each call. That is chosen so that a wall ends each call exactly at

.. math:: x(t) = v\,\tau + a \sin(2\pi f \tau), \qquad \tau = \min(\max(t, t_0), t_1) - t_0

and has turned by its spin times :math:`\tau`, however long the steps are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.particles.solver import ParticleSolver

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
        fastest = max((motion.frequency for motion in self.motions), default=0.0)
        return 1.0 / (STEPS_PER_PERIOD * fastest) if fastest > 0.0 else math.inf

    def __call__(self, run: ParticleSolver, step: float) -> None:
        """Set the velocities for the coming step [s]."""
        if not step > 0.0:
            raise InputError("step", step, "above 0")
        for motion in self.motions:
            begin, end = run.time, run.time + step
            run.walls.velocity[motion.wall] = (motion.displacement(end) - motion.displacement(begin)) / step
            run.walls.spin[motion.wall] = np.array(motion.spin) * ((motion.active(end) - motion.active(begin)) / step)
