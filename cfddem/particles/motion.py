"""What one particle does in a step: sum the forces on it, take kicks and impulses, and move."""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, part, prange
from cfddem.particles.interactions.joint_films import list_due
from cfddem.particles.interactions.slots import (
    BOND,
    BRIDGE,
    BRIDGE_APART,
    BRIDGE_SLIDING,
    DRIFTING,
    FILM,
    JOINT,
    ROLLING,
    SHEAR,
)
from cfddem.particles.pair_graph import edge_role, places_of
from cfddem.particles.vectors import NOTHING, at, dot, minus, plus, put, times

_0, _1, _2 = np.uint64(0), np.uint64(1), np.uint64(2)


@inline
def gather_forces(i, system, near):
    """Sum what the edges of particle i do to it, with weight and outside force; list those that are solved together.

    near  number of leading pairs that may touch
    """
    particles, edges, memory = system.particles, system.edges, system.memory
    force, couple, moment = at(particles.applied, i), NOTHING, NOTHING
    impulse, turn, end = NOTHING, NOTHING, edges.start[i]
    for place in places_of(i, edges):
        k, sign = edge_role(edges.incident[place])
        if JOINT:
            end = list_due(place, end, system)
        if DRIFTING:
            impulse = plus(impulse, times(sign, at(memory.film_push, k)))
        if SHEAR:
            turn = plus(turn, at(memory.shear_couples, _2 * k + (_0 if sign > 0.0 else _1)))
        if BRIDGE:  # zero without a bridge, which costs less than to look
            force = plus(force, times(sign, at(memory.bridge_force, k)))
        if BRIDGE_APART and BRIDGE_SLIDING:
            couple = plus(couple, at(memory.bridge_turn, k))
        if BOND and k < edges.between_particles:
            force = plus(force, times(sign, at(memory.bond_force, k)))
            couple = plus(couple, at(memory.bond_couple, k))
            moment = plus(moment, times(sign, at(memory.bond_moment, k)))
        if (FILM or BRIDGE) and near <= k < edges.between_particles:
            if BRIDGE or DRIFTING:
                continue
            break  # pairs that cannot touch come last
        force = plus(force, times(sign, at(memory.force, k)))
        couple = plus(couple, at(memory.couple, k))
        if ROLLING:
            moment = plus(moment, times(sign, at(memory.moment, k)))
    if particles.inverse_mass[i] > 0.0:
        force = plus(force, times(1.0 / particles.inverse_mass[i], system.parameters.gravity))
    put(particles.force, i, force)
    put(particles.torque, i, plus(times(particles.radius[i], couple), moment))
    if JOINT:
        particles.joint_end[i] = end
    if DRIFTING:
        put(particles.film_gain, i, times(particles.inverse_mass[i], impulse))
        if SHEAR:
            put(particles.film_spin_gain, i, times(particles.inverse_inertia[i], turn))


@inline
def kick(i, particles, step, with_films):
    """Half a kick by the forces of the last step, after what weak films have given in it."""
    if DRIFTING and with_films:
        put(particles.velocity, i, plus(at(particles.velocity, i), at(particles.film_gain, i)))
        if SHEAR:
            put(particles.spin, i, plus(at(particles.spin, i), at(particles.film_spin_gain, i)))
    gain = times(0.5 * step * particles.inverse_mass[i], at(particles.force, i))
    put(particles.velocity, i, plus(at(particles.velocity, i), gain))
    gain = times(0.5 * step * particles.inverse_inertia[i], at(particles.torque, i))
    put(particles.spin, i, plus(at(particles.spin, i), gain))


@inline
def larger(a, b):
    """The larger of two numbers; NaN if one of them is NaN."""
    return b if b > a or b != b else a


@inline
def drift(i, particles, free, step, origin):
    """Move particle i along the free directions; returns its squared distance from its origin."""
    velocity = at(particles.velocity, i)
    change = (step * free[0] * velocity[0], step * free[1] * velocity[1], step * free[2] * velocity[2])
    put(particles.position, i, plus(at(particles.position, i), change))
    moved = minus(at(particles.position, i), at(origin, i))
    return dot(moved, moved)


# ---------------------------------------------------------------- all particles


@part
def kick_particles(particles, step):
    """Half a kick of all particles."""
    for i in prange(particles.owned):
        kick(i, particles, step, False)


@part
def drift_particles(system, step, origin):
    """Move the particles; returns the largest squared distance from the origin."""
    particles = system.particles
    farthest, count = np.zeros(CHUNKS), particles.owned
    for chunk in prange(CHUNKS):
        far = 0.0
        for i in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            far = larger(far, drift(i, particles, system.parameters.free, step, origin))
        farthest[chunk] = far
    largest = 0.0
    for chunk in range(CHUNKS):
        largest = larger(largest, farthest[chunk])
    return largest
