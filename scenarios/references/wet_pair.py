"""Equations of motion of two equal wet spheres in a plane, in polar coordinates, with a soft contact.

In the state, lengths are scaled with the film and speeds with the normal speed of impact. Forces follow from the laws,
in SI units.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from cfddem.backend.compile import serial
from cfddem.backend.errors import RunFailed
from cfddem.backend.law_set import specialise
from cfddem.particles.interactions.bridge import resistance_across, resistance_along
from cfddem.particles.interactions.bridge_law import BridgeLaws, BridgeNumbers
from cfddem.particles.interactions.slots import BRIDGE_PULL, BridgeState, bridge_pull
from closures.contact import hertz_damping, hertz_force, hertz_stiffness, mindlin_stiffness
from closures.friction import coulomb_limit
from scenarios.references.ode import ABSOLUTE, METHOD, RELATIVE, event

STILL = 1e-10
"""A pair whose speeds and accelerations all fall below this has come to rest; in the units of the state."""

GAP, ANGLE, APPROACH, TURNING, SPIN, SPRING, STATE = 0, 1, 2, 3, 4, 5, 6


class Pair(NamedTuple):
    """Constants of a pair."""

    speed: float  # v_n0 [m/s]
    film: float  # h_max [m]
    minimum_gap: float  # h_min [m]
    radius: float  # [m]
    mass: float  # of one sphere [kg]
    modulus: float  # E* [Pa]
    shear_modulus: float  # G* [Pa]
    damping_ratio: float  # of Tsuji's dashpot [-]
    friction: float  # [-]
    liquid: BridgeNumbers


class Motion(NamedTuple):
    """The motion of a pair from the meeting of the films to their separation, or to the end of the run."""

    separated: bool
    time: np.ndarray  # (n,) [s]
    gap: np.ndarray  # [m]
    angle: np.ndarray  # turned by the line of centres [rad]
    approach: np.ndarray  # speed along the line of centres [m/s]
    turning: np.ndarray  # rate of turning of the line of centres [rad/s]
    spin: np.ndarray  # of the first sphere [rad/s]


def integrate(pair: Pair, laws: BridgeLaws, angle: float, duration: float) -> Motion:
    """Integrate until the films separate, the pair has turned a full circle or come to rest, or the time is over.

    laws      of the bridge
    angle     between velocity and line of centres at impact [deg]
    duration  [s]
    """
    state = np.zeros(STATE)
    state[GAP] = state[APPROACH] = 1.0
    state[TURNING] = math.tan(math.radians(angle)) / (2.0 * pair.radius / pair.film + 1.0)
    unit = pair.film / pair.speed
    choices = laws.choices()
    slopes, active = specialise(rates, choices), specialise(activity, choices)
    # a pair almost at rest is tried with ever longer steps; one whose end is not a number is made again, shorter
    with np.errstate(invalid="ignore", over="ignore"):
        solution = solve_ivp(
            lambda _, state: slopes(state, pair),
            (0.0, duration / unit),
            state,
            METHOD,
            events=[
                event(lambda _, state: state[GAP] - 1.0, 1),
                event(lambda _, state: abs(state[ANGLE]) - 2.0 * math.pi, 1),
                event(lambda _, state: active(state, pair) - STILL, -1),
            ],
            rtol=RELATIVE,
            atol=ABSOLUTE,
            first_step=min(1e-3, duration / unit),
        )
    if solution.status < 0:
        raise RunFailed(f"the pair cannot be followed beyond t = {solution.t[-1] * unit:.6g} s: {solution.message}")
    gap, turned, approach, turning, spin, _ = solution.y
    return Motion(
        separated=len(solution.t_events[0]) > 0,
        time=solution.t * unit,
        gap=gap * pair.film,
        angle=turned,
        approach=approach * pair.speed,
        turning=turning / unit,
        spin=spin / unit,
    )


@serial
def rates(state, pair):
    """Rates of change of the state (6,)."""
    film, speed = pair.film, pair.speed
    gap, approach, sliding = film * state[GAP], speed * state[APPROACH], slip(state, pair)
    reduced_radius, reduced_mass = 0.5 * pair.radius, 0.5 * pair.mass
    wetted = min(gap, film)  # only trial steps reach beyond the film
    liquid = pair.liquid
    bridge = BridgeState(
        wetted, film, 0.0, reduced_radius, pair.minimum_gap,
        liquid.viscosity, liquid.surface_tension, liquid.contact_angle, 0.0, (),
    )  # fmt: skip
    push = resistance_along(bridge) * approach - (bridge_pull(bridge) if BRIDGE_PULL else 0.0)
    drag = resistance_across(bridge) * sliding
    stretching = 0.0
    if gap < 0.0:
        along, across, stretching = solid(-gap, approach, sliding, film * state[SPRING], pair)
        push += along
        drag += across
    scale = film / speed**2  # of an acceleration
    distance, turning = 2.0 * pair.radius / film + state[GAP], state[TURNING]
    slopes = np.empty(STATE)
    slopes[GAP] = -state[APPROACH]
    slopes[ANGLE] = turning
    slopes[APPROACH] = -scale * push / reduced_mass - distance * turning**2
    slopes[TURNING] = (scale * drag / reduced_mass + 2.0 * state[APPROACH] * turning) / distance
    slopes[SPIN] = -scale * drag / (0.4 * pair.mass * pair.radius / film)
    slopes[SPRING] = stretching / speed
    return slopes


@serial
def activity(state, pair):
    """Largest of the speeds and accelerations along and across the line of centres."""
    slopes, distance = rates(state, pair), 2.0 * pair.radius / pair.film + state[GAP]
    along, across = max(abs(state[APPROACH]), abs(slopes[APPROACH])), max(abs(state[TURNING]), abs(slopes[TURNING]))
    return max(along, distance * across)


@serial
def slip(state, pair):
    """Sliding speed of the surface of the first sphere relative to the second [m/s]."""
    diameter = 2.0 * pair.radius / pair.film
    return pair.speed * (diameter * state[SPIN] - (diameter + state[GAP]) * state[TURNING])


@serial
def solid(overlap, approach, sliding, spring, pair):
    """Contact force along and across the line of centres, and the rate of the tangential spring.

    The spring never exceeds the length at which the elastic force reaches Coulomb's limit; while the contact slides, it
    follows that length. The sum of spring and dashpot is limited by the friction of the total normal force.
    """
    reduced_radius, reduced_mass = 0.5 * pair.radius, 0.5 * pair.mass
    stiffness = hertz_stiffness(pair.modulus, reduced_radius)
    damping = hertz_damping(pair.damping_ratio, reduced_mass, stiffness, overlap)
    elastic = hertz_force(stiffness, overlap)
    along = elastic + damping * approach
    tangential_stiffness = mindlin_stiffness(pair.shear_modulus, reduced_radius, overlap)
    longest = coulomb_limit(pair.friction, elastic) / tangential_stiffness
    growth = longest / overlap * approach  # the limit is proportional to the overlap
    stretching = sliding
    if spring >= longest:
        spring, stretching = longest, min(sliding, growth)
    elif spring <= -longest:
        spring, stretching = -longest, max(sliding, -growth)
    limit = coulomb_limit(pair.friction, along)
    across = min(limit, max(-limit, tangential_stiffness * spring + damping * sliding))
    return along, across, stretching
