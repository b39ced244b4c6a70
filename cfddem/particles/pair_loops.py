"""The loops over all pairs of particles, which work on several pairs at once.

Their arrays come one by one and their body is a single call: only so does the compiler see that no array
overlaps another.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.kernels import inline, prange, serial_and_threaded
from cfddem.particles.films import moisten, squeeze_shortly
from cfddem.particles.forces import Meeting, contact, contact_reach, resist_rolling
from cfddem.particles.pairs import between
from cfddem.particles.vectors import at, dot, minus, plus, put, times


@inline
def _sphere_meeting(i, j, image, position, velocity, spin, radius, inverse_mass, shift, free):
    """Two spheres as they stand to each other."""
    separation = between(i, j, image, position, shift)
    distance = math.sqrt(dot(separation, separation))
    inverse_sum = 1.0 / (radius[i] + radius[j])
    relative = minus(at(velocity, i), at(velocity, j))
    rate = 1.0 / distance
    return Meeting(
        separation,
        distance,
        distance - radius[i] - radius[j],
        relative,
        plus(times(radius[i], at(spin, i)), times(radius[j], at(spin, j))),
        radius[i] * radius[j] * inverse_sum,
        inverse_sum,
        inverse_mass[i] + inverse_mass[j],
        (rate * free[0] * relative[0], rate * free[1] * relative[1], rate * free[2] * relative[2]),
        minus(at(spin, i), at(spin, j)),
        2.5 * (inverse_mass[i] / radius[i] ** 2 + inverse_mass[j] / radius[j] ** 2),
    )


@inline
def _meet_pair(
    edge,
    first,
    second,
    image,
    minimum_gap,
    spring,
    force,
    couple,
    roll,
    moment,
    resistance,
    approach_speed,
    accounted_gap,
    position,
    velocity,
    spin,
    radius,
    inverse_mass,
    material,
    viscosity,
    shift,
    rows,
    kinds,
    laws,
    free,
    step,
):
    """Film and contact of one pair of particles."""
    k = np.uint64(edge)
    i, j = first[k], second[k]
    meeting = _sphere_meeting(i, j, image[k], position, velocity, spin, radius, inverse_mass, shift, free)
    which = np.uint64(material[i]) * kinds + np.uint64(material[j])
    separated = minimum_gap[k]
    if laws.film:
        between_them = 0.5 * (viscosity[i] + viscosity[j])
        memory = (resistance[k], approach_speed[k], separated, accounted_gap[k])
        now = moisten(meeting.gap, between_them, meeting.reduced_radius, memory, rows[which], laws)
        resistance[k], approach_speed[k], minimum_gap[k], accounted_gap[k] = now
        separated = now[2]
    push, turn, memory = contact(meeting, rows, which, separated, at(spring, k), laws, step)
    if laws.cohesion:
        minimum_gap[k] = contact_reach(meeting, rows[which], separated)
    if laws.rolling:
        torque, rolled = resist_rolling(meeting, rows[which], separated, push, at(roll, k), laws, step)
        put(moment, k, torque)
        put(roll, k, rolled)
    put(force, k, push)
    put(couple, k, turn)
    put(spring, k, memory)


def _meet_pairs(
    near,
    first,
    second,
    image,
    minimum_gap,
    spring,
    force,
    couple,
    roll,
    moment,
    resistance,
    approach_speed,
    accounted_gap,
    position,
    velocity,
    spin,
    radius,
    inverse_mass,
    material,
    viscosity,
    shift,
    rows,
    kinds,
    laws,
    free,
    step,
):
    """Film and contact of every pair of particles that may touch."""
    for edge in prange(near):
        _meet_pair(
            edge,
            first,
            second,
            image,
            minimum_gap,
            spring,
            force,
            couple,
            roll,
            moment,
            resistance,
            approach_speed,
            accounted_gap,
            position,
            velocity,
            spin,
            radius,
            inverse_mass,
            material,
            viscosity,
            shift,
            rows,
            kinds,
            laws,
            free,
            step,
        )


@inline
def _wet_pair(
    edge,
    first,
    second,
    image,
    minimum_gap,
    resistance,
    approach_speed,
    accounted_gap,
    position,
    radius,
    material,
    viscosity,
    shift,
    rows,
    kinds,
    laws,
):
    """Film of one pair of particles."""
    k = np.uint64(edge)
    i, j = first[k], second[k]
    separation = between(i, j, image[k], position, shift)
    gap = math.sqrt(dot(separation, separation)) - radius[i] - radius[j]
    reduced_radius = radius[i] * radius[j] / (radius[i] + radius[j])
    which = np.uint64(material[i]) * kinds + np.uint64(material[j])
    between_them = 0.5 * (viscosity[i] + viscosity[j])
    memory = (resistance[k], approach_speed[k], minimum_gap[k], accounted_gap[k])
    now = moisten(gap, between_them, reduced_radius, memory, rows[which], laws)
    resistance[k], approach_speed[k], minimum_gap[k], accounted_gap[k] = now


def _wet_pairs(
    near,
    far,
    first,
    second,
    image,
    minimum_gap,
    resistance,
    approach_speed,
    accounted_gap,
    position,
    radius,
    material,
    viscosity,
    shift,
    rows,
    kinds,
    laws,
):
    """Film of every pair of particles that cannot touch."""
    for edge in prange(near, far):
        _wet_pair(
            edge,
            first,
            second,
            image,
            minimum_gap,
            resistance,
            approach_speed,
            accounted_gap,
            position,
            radius,
            material,
            viscosity,
            shift,
            rows,
            kinds,
            laws,
        )


@inline
def _squeeze_pair(
    edge,
    first,
    second,
    image,
    minimum_gap,
    resistance,
    approach_speed,
    accounted_gap,
    impulse,
    hard,
    position,
    velocity,
    radius,
    film_rate,
    shift,
    laws,
    step,
):
    """Impulse of the film of one pair of particles."""
    k = np.uint64(edge)
    i, j = first[k], second[k]
    separation = between(i, j, image[k], position, shift)
    distance = math.sqrt(dot(separation, separation))
    normal = times(1.0 / distance, separation)
    gap = distance - radius[i] - radius[j]
    reduced_radius = radius[i] * radius[j] / (radius[i] + radius[j])
    speed = dot(minus(at(velocity, i), at(velocity, j)), normal)
    memory = (resistance[k], approach_speed[k], minimum_gap[k], accounted_gap[k])
    size, given, left = squeeze_shortly(speed, gap, reduced_radius, film_rate[i] + film_rate[j], memory, laws, step)
    accounted_gap[k] = given
    hard[k] = left
    put(impulse, k, times(size, normal))


def _squeeze_pairs(
    pairs,
    first,
    second,
    image,
    minimum_gap,
    resistance,
    approach_speed,
    accounted_gap,
    impulse,
    hard,
    position,
    velocity,
    radius,
    film_rate,
    shift,
    laws,
    step,
):
    """Impulse of the film of every pair of particles, but where the gap changes too much for the short way."""
    for edge in prange(pairs):
        _squeeze_pair(
            edge,
            first,
            second,
            image,
            minimum_gap,
            resistance,
            approach_speed,
            accounted_gap,
            impulse,
            hard,
            position,
            velocity,
            radius,
            film_rate,
            shift,
            laws,
            step,
        )


meet_pairs, meet_pairs_threaded = serial_and_threaded(_meet_pairs)
wet_pairs, wet_pairs_threaded = serial_and_threaded(_wet_pairs)
squeeze_pairs, squeeze_pairs_threaded = serial_and_threaded(_squeeze_pairs)
