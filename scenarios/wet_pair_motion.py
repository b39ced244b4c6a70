"""Equations of motion of two equal wet spheres in a plane, in polar coordinates, with a soft contact.

The state counts lengths in the film and speeds in the normal speed of impact; forces are those of the laws, in SI.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cfddem.kernels import kernel
from cfddem.particles.bridge_loops import BridgeLaws, pull_of, resistances
from closures.contact import hertz_damping, hertz_force, hertz_stiffness, mindlin_stiffness
from closures.friction import coulomb_limit
from scenarios.adaptive import STAGES, next_length, stepper

GAP, ANGLE, APPROACH, TURNING, SPIN, SPRING, STATE = 0, 1, 2, 3, 4, 5, 6

PARTED, ENDED, FULL, STUCK = 0, 1, 2, 3
"""Why the march returns."""

MOST_STEPS = 5_000_000


class Numbers(NamedTuple):
    """Everything about a pair that does not change."""

    speed: float  # v_n0 [m/s]
    film: float  # h_max [m]
    minimum_gap: float  # h_min [m]
    radius: float  # [m]
    mass: float  # of one sphere [kg]
    modulus: float  # E* [Pa]
    shear_modulus: float  # G* [Pa]
    damping_ratio: float  # of Tsuji's dashpot [-]
    friction: float  # [-]
    liquid: BridgeLaws


@kernel
def solid(overlap, approach, sliding, spring, numbers):
    """Force of the solids along and across, and what Coulomb's limit leaves of the tangential spring.

    The spring is held to the limit of the elastic force, the sum of spring and dashpot to that of the whole: the
    dashpot alone would stretch the spring without end where the solids first touch and have no stiffness yet.
    """
    reduced_radius, reduced_mass = 0.5 * numbers.radius, 0.5 * numbers.mass
    stiffness = hertz_stiffness(numbers.modulus, reduced_radius)
    damping = hertz_damping(numbers.damping_ratio, reduced_mass, stiffness, overlap)
    elastic = hertz_force(stiffness, overlap)
    along = elastic + damping * approach
    tangential_stiffness = mindlin_stiffness(numbers.shear_modulus, reduced_radius, overlap)
    longest = coulomb_limit(numbers.friction, elastic) / tangential_stiffness
    spring = min(longest, max(-longest, spring))
    limit = coulomb_limit(numbers.friction, along)
    across = min(limit, max(-limit, tangential_stiffness * spring + damping * sliding))
    return along, across, spring


@kernel
def rates(state, modes, numbers, slopes, at):
    """Slopes of the state; `modes` is not used, all that changes with the gap is in the laws."""
    film, speed = numbers.film, numbers.speed
    gap, approach, sliding = film * state[GAP], speed * state[APPROACH], slip(state, numbers)
    push, drag = resistances(gap, film, numbers.minimum_gap, 0.5 * numbers.radius, numbers.liquid)
    push = push * approach - pull_of(gap, film, 0.0, 0.5 * numbers.radius, numbers.liquid)
    drag *= sliding
    slopes[at + SPRING] = 0.0
    if gap < 0.0:
        along, across, _ = solid(-gap, approach, sliding, film * state[SPRING], numbers)
        push += along
        drag += across
        slopes[at + SPRING] = sliding / speed
    scale = film / speed**2  # of an acceleration
    reduced_mass, distance, turning = 0.5 * numbers.mass, 2.0 * numbers.radius / film + state[GAP], state[TURNING]
    slopes[at + GAP] = -state[APPROACH]
    slopes[at + ANGLE] = turning
    slopes[at + APPROACH] = -scale * push / reduced_mass - distance * turning**2
    slopes[at + TURNING] = (scale * drag / reduced_mass + 2.0 * state[APPROACH] * turning) / distance
    slopes[at + SPIN] = -scale * drag / (0.4 * numbers.mass * numbers.radius / film)


@kernel
def slip(state, numbers):
    """Speed of the surface of the first sphere against that of the second [m/s]."""
    diameter = 2.0 * numbers.radius / numbers.film
    return numbers.speed * (diameter * state[SPIN] - (diameter + state[GAP]) * state[TURNING])


step = stepper(rates, "wet_pair")


@kernel
def follow(clock, state, numbers, until, samples, counts):
    """March until the films part, the pair has turned a full circle, the time is over or the record is full.

    clock    time and length of the next step
    samples  rows of time and state, one a step; none are kept where it has no rows
    counts   rows filled
    """
    slopes, end, modes = np.empty(STAGES * STATE), np.empty(STATE), np.empty(0)
    begin = state[ANGLE]
    rates(state, modes, numbers, slopes, 0)
    for _ in range(MOST_STEPS):
        if clock[0] >= until or abs(clock[2] + state[ANGLE] - begin) > 2.0 * math.pi:
            return ENDED
        if 0 < len(samples) <= counts[0]:
            clock[2] += state[ANGLE] - begin
            return FULL
        length = min(clock[1], until - clock[0])
        error = step(state, modes, numbers, length, slopes, end)
        if not error <= 1.0:
            clock[1] = next_length(length, error)
            if clock[1] < 1e-18:
                return STUCK
            continue
        parted = end[GAP] > 1.0 and end[APPROACH] < 0.0
        if parted:
            low, high = 0.0, length
            for _ in range(60):
                middle = 0.5 * (low + high)
                step(state, modes, numbers, middle, slopes, end)
                if end[GAP] > 1.0:
                    high = middle
                else:
                    low = middle
            length = high
        else:
            clock[1] = next_length(length, error)
        clock[0] += length
        for row in range(STATE):
            state[row] = end[row]
            slopes[row] = slopes[(STAGES - 1) * STATE + row]
        relax(state, numbers)
        if counts[0] < len(samples):
            samples[counts[0], 0] = clock[0]
            for column in range(STATE):
                samples[counts[0], 1 + column] = state[column]
            counts[0] += 1
        if parted:
            return PARTED
    return STUCK


@kernel
def relax(state, numbers):
    """A sliding spring keeps what Coulomb's limit lets it carry; solids apart have none."""
    gap = numbers.film * state[GAP]
    if gap >= 0.0:
        state[SPRING] = 0.0
        return
    approach, sliding = numbers.speed * state[APPROACH], slip(state, numbers)
    state[SPRING] = solid(-gap, approach, sliding, numbers.film * state[SPRING], numbers)[2] / numbers.film
