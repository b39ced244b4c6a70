"""Motion of the particles while impulses act: between the two half kicks of a step.

The product of an impulse with this mean motion is its work, to round-off.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cfddem.backend.compile import inline
from cfddem.particles.state import Particles
from cfddem.particles.vectors import at, minus, plus, times


def keep_motion(count: Any, particles: Particles, step: float, ahead: np.ndarray) -> None:
    """Keep in `count.ahead` and `count.spin_ahead` what the impulses of a step act on.

    step   [s]
    ahead  velocity after the first half kick (N, 3) [m/s]
    """
    count.ahead[:] = ahead
    count.spin_ahead[:] = particles.spin + (0.5 * step * particles.inverse_inertia)[:, None] * particles.torque


@inline
def mean_motion(i, particles, count, step):
    """Mean velocity and spin of particle i while impulses act: between the two half kicks of the step."""
    velocity = minus(at(particles.velocity, i), times(0.5 * step * particles.inverse_mass[i], at(particles.force, i)))
    spin = minus(at(particles.spin, i), times(0.5 * step * particles.inverse_inertia[i], at(particles.torque, i)))
    return times(0.5, plus(at(count.ahead, i), velocity)), times(0.5, plus(at(count.spin_ahead, i), spin))


@inline
def taken_by_impulses(i, particles, count, step):
    """Velocity and spin that all impulses of the step have taken from particle i."""
    velocity = minus(at(particles.velocity, i), times(0.5 * step * particles.inverse_mass[i], at(particles.force, i)))
    spin = minus(at(particles.spin, i), times(0.5 * step * particles.inverse_inertia[i], at(particles.torque, i)))
    return minus(at(count.ahead, i), velocity), minus(at(count.spin_ahead, i), spin)
