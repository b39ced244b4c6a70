"""The bridge of one pair of particles, without branches: for the loops that work on several pairs at once.

Most bridges of a bed are closed: their gap is below h_min, where resistances do not depend on it. Loops over single
edges treat the others, which are open (:mod:`~cfddem.particles.interactions.bridge_changes` and
:mod:`~cfddem.particles.interactions.bridge_impulse`).
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from cfddem.backend.compile import inline
from cfddem.particles.interactions.bridge import bridge_state
from cfddem.particles.interactions.bridge_solution import SMALLEST_GAP, clamp_speed, held_gap
from cfddem.particles.interactions.slots import BRIDGE_FILM, BRIDGE_PULL, BRIDGE_SLIDING, bridge_pull
from cfddem.particles.pair_graph import of_two_spheres
from cfddem.particles.vectors import NOTHING, across, at, cross, dot, either, minus, plus, put, times

WetParticles = namedtuple("WetParticles", "position velocity spin radius film_thickness bridge_rate bridge_turn_rate")
"""Arrays of the particles that loops over bridges read."""

LARGEST_DECAY = 0.25
"""Largest argument of `decayed`."""

_C2, _C3, _C4, _C5, _C6, _C7, _C8, _C9, _C10, _C11, _C12, _C13 = (1.0 / math.factorial(n) for n in range(2, 14))


@inline
def decayed(x):
    """(exp(-x) - 1) / x for x up to `LARGEST_DECAY`, to round-off, by its series."""
    tail = _C10 - x * (_C11 - x * (_C12 - x * _C13))
    middle = _C6 - x * (_C7 - x * (_C8 - x * (_C9 - x * tail)))
    return x * (_C2 - x * (_C3 - x * (_C4 - x * (_C5 - x * middle)))) - 1.0


@inline
def shared_inverse_masses(rate, turn_rate, lever, resistance):
    """Inverse masses that both bodies give a bridge, along and across the line of centres [1/kg].

    rate, turn_rate  of both bodies together, see `bridge_rate` and `bridge_turn_rate` [1/s]
    lever            arm of the impulse over the radius [-]
    """
    share = 1.0 / resistance
    along = rate * share
    return along, along + lever * lever * (turn_rate * share)


@inline
def kept_separation(k, system):
    """Separation of a pair at the present positions, its length, and the sum of the radii."""
    particles, edges, memory = system.particles, system.edges, system.memory
    radii = particles.radius[edges.first[k]] + particles.radius[edges.second[k]]
    return at(memory.bridge_separation, k), memory.bridge_distance[k], radii


@inline
def closed_speed(speed, resistance, given, step, inverse_mass):
    """Rate of the gap after a step in which the resistance does not depend on it [m/s].

    given         change of the gap for which the impulse has been given before [m]
    inverse_mass  of the mass that both bodies give the bridge [1/kg]
    """
    total = speed + inverse_mass * (resistance * given)
    return clamp_speed(total / (1.0 + step * inverse_mass * resistance), speed)


@inline
def pair_bridge(n, system):
    """Pull of the bridge of a pair, its resistance if it is closed, and whether one forms."""
    particles, edges, memory, shift, p = system.particles, system.edges, system.memory, system.shift, system.parameters
    k = np.uint64(n)
    i, j = edges.first[k], edges.second[k]
    separation, distance, radii = of_two_spheres(k, particles, edges, shift)
    put(memory.bridge_separation, k, separation)
    memory.bridge_distance[k] = distance
    gap, reduced_radius = distance - radii, particles.radius[i] * particles.radius[j] / radii
    state = bridge_state(k, gap, reduced_radius, memory, p)
    film = particles.film_thickness[i] + particles.film_thickness[j]
    bridged = memory.bridge_film[k] > 0.0
    closed = gap < held_gap(state)
    forms = (not bridged) & (film > SMALLEST_GAP) & (gap < film)  # dry solids overlap without a bridge
    memory.bridge_change[k] = 1 if forms else 0
    memory.bridge_open[k] = bridged & (not closed)
    memory.bridge_resistance[k] = memory.closed_along[k] + memory.closed_across[k] if bridged & closed else 0.0
    if BRIDGE_PULL:
        pull = bridge_pull(state)
        put(memory.bridge_force, k, times(-pull / distance if bridged else 0.0, separation))


@inline
def pair_bridge_impulse(n, system, step):
    """Impulse of the bridge of a pair that stays closed in this step; marks the others."""
    particles, edges, memory = system.particles, system.edges, system.memory
    k = np.uint64(n)
    i, j = edges.first[k], edges.second[k]
    separation, distance, radii = kept_separation(k, system)
    normal = times(1.0 / distance, separation)
    gap, lever = distance - radii, distance / radii
    resistance = memory.bridge_resistance[k]
    resists = resistance > 0.0
    velocity = minus(at(particles.velocity, i), at(particles.velocity, j))
    rate = particles.bridge_rate[i] + particles.bridge_rate[j]
    turn_rate = particles.bridge_turn_rate[i] + particles.bridge_turn_rate[j]
    along, sideways = shared_inverse_masses(rate, turn_rate, lever, resistance)

    speed = new_speed = dot(velocity, normal)
    accounted = memory.bridge_accounted[k]
    if BRIDGE_FILM:
        new_speed = closed_speed(speed, memory.closed_along[k], accounted - gap, step, along)
    end = gap + step * new_speed
    impulse = times((new_speed - speed) / along, normal)
    couple, short = NOTHING, True
    if BRIDGE_SLIDING:
        turning = plus(
            times(particles.radius[i], at(particles.spin, i)), times(particles.radius[j], at(particles.spin, j))
        )
        per_slip = step * memory.closed_across[k]
        short = per_slip * sideways < LARGEST_DECAY
        slip = minus(across(velocity, normal), times(lever, cross(turning, normal)))
        drag = times(per_slip * decayed(per_slip * sideways), slip)
        impulse = plus(impulse, drag)
        couple = times(-lever, cross(normal, drag))
    floor = max(memory.bridge_gap[k], SMALLEST_GAP)
    found = resists & short & (gap < floor) & (end < floor) & (accounted < floor)
    memory.bridge_open[k] = resists & (not found)
    memory.bridge_accounted[k] = end if found else accounted
    put(memory.bridge_impulse, k, either(found, impulse, NOTHING))
    put(memory.bridge_couple, k, either(found, couple, NOTHING))
