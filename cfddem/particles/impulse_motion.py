"""Motion of the particles while impulses act: between the two half kicks of a step.

The product of an impulse with the mean motion while it acts is its work, to round-off. Weak films act last, at the
positions after the drift.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cfddem.backend.compile import inline
from cfddem.particles.interactions.slots import DRIFTING
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
def half_motion(i, particles, kick, sign):
    """Distance and angle of particle i in a half kick (sign 1: after this instant, -1: before it)."""
    half = 0.5 * sign * kick
    velocity = plus(at(particles.velocity, i), times(half * particles.inverse_mass[i], at(particles.force, i)))
    spin = plus(at(particles.spin, i), times(half * particles.inverse_inertia[i], at(particles.torque, i)))
    return times(kick, velocity), times(kick, spin)


@inline
def drifted(i, particles, step):
    """Velocity and spin with which particle i has drifted in the step."""
    velocity = minus(at(particles.velocity, i), times(0.5 * step * particles.inverse_mass[i], at(particles.force, i)))
    spin = minus(at(particles.spin, i), times(0.5 * step * particles.inverse_inertia[i], at(particles.torque, i)))
    if DRIFTING:
        velocity, spin = minus(velocity, at(particles.film_gain, i)), minus(spin, at(particles.film_spin_gain, i))
    return velocity, spin


@inline
def mean_motion(i, particles, count, step):
    """Mean velocity and spin of particle i while impulses act that are solved, and those of bridges."""
    velocity, spin = drifted(i, particles, step)
    return times(0.5, plus(at(count.ahead, i), velocity)), times(0.5, plus(at(count.spin_ahead, i), spin))


@inline
def motion_of_weak(i, particles, step):
    """Mean velocity and spin of particle i while weak films act."""
    velocity, spin = drifted(i, particles, step)
    gain, turn = times(0.5, at(particles.film_gain, i)), times(0.5, at(particles.film_spin_gain, i))
    return plus(velocity, gain), plus(spin, turn)


@inline
def taken_by_impulses(i, particles, count, step):
    """Velocity and spin that the impulses before the drift have taken from particle i."""
    velocity, spin = drifted(i, particles, step)
    return minus(at(count.ahead, i), velocity), minus(at(count.spin_ahead, i), spin)
