"""What one particle does in a step: sum the forces on it, take kicks and impulses, and move."""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, part, prange
from cfddem.particles.interactions.slots import BRIDGE, DRIFTING, FAR, FILM, ROLLING, SHEAR
from cfddem.particles.pair_graph import edge_role, is_far, places_of
from cfddem.particles.vectors import NOTHING, at, dot, minus, plus, put, times


@inline
def gather_forces(i, system, near, far):
    """Sum what the edges of particle i do to it, with weight and outside force.

    near  number of leading pairs that may touch
    far   far films have been found anew, see `far_films`
    """
    particles, edges, memory = system.particles, system.edges, system.memory
    force, couple, moment, resistance = at(particles.applied, i), NOTHING, NOTHING, 0.0
    load = shear_load = far_resistance = 0.0
    for place in places_of(i, edges):
        k, sign = edge_role(edges.incident[place])
        if FAR and is_far(k, edges):
            if not far:
                break  # far pairs come last
            far_resistance += memory.resistance[k]
            continue
        if BRIDGE:  # zero without a bridge, which costs less than to look
            load += memory.bridge_resistance[k]
            force = plus(force, times(sign, at(memory.bridge_force, k)))
        if FILM:
            resistance += memory.resistance[k]
        if SHEAR:
            shear_load += memory.shear_resistance[k]
        if (FILM or BRIDGE) and near <= k < edges.between_particles:
            continue
        force = plus(force, times(sign, at(memory.force, k)))
        couple = plus(couple, at(memory.couple, k))
        if ROLLING:
            moment = plus(moment, times(sign, at(memory.moment, k)))
    if particles.inverse_mass[i] > 0.0:
        force = plus(force, times(1.0 / particles.inverse_mass[i], system.parameters.gravity))
    put(particles.force, i, force)
    put(particles.torque, i, plus(times(particles.radius[i], couple), moment))
    if FILM:
        particles.film_rate[i] = particles.inverse_mass[i] * resistance
    if FAR and far:
        particles.far_rate[i] = particles.inverse_mass[i] * far_resistance
    if SHEAR:
        particles.slip_rate[i] = particles.inverse_mass[i] * shear_load
        particles.turn_rate[i] = particles.inverse_inertia[i] * shear_load
    if BRIDGE:
        particles.bridge_rate[i] = particles.inverse_mass[i] * load
        particles.bridge_turn_rate[i] = particles.radius[i] * particles.radius[i] * particles.inverse_inertia[i] * load


@inline
def kick(i, particles, step):
    """Half a kick by the forces of the last step."""
    gain = times(0.5 * step * particles.inverse_mass[i], at(particles.force, i))
    put(particles.velocity, i, plus(at(particles.velocity, i), gain))
    gain = times(0.5 * step * particles.inverse_inertia[i], at(particles.torque, i))
    put(particles.spin, i, plus(at(particles.spin, i), gain))


@inline
def apply_film_impulses(i, system, far):
    """Give particle i the impulses of its films: of the far ones (`far_films`), or of all others."""
    particles, edges, memory = system.particles, system.edges, system.memory
    impulse = NOTHING
    for place in places_of(i, edges):
        k, sign = edge_role(edges.incident[place])
        if FAR and is_far(k, edges) != far:
            if not far:
                break  # far pairs come last
            continue
        impulse = plus(impulse, times(sign, at(memory.impulse, k)))
    put(particles.velocity, i, plus(at(particles.velocity, i), times(particles.inverse_mass[i], impulse)))


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
        kick(i, particles, step)


@part
def apply_all_film_impulses(system, far):
    """Give every particle the impulses of its far films, or of all others, before what acts on the velocities left."""
    particles = system.particles
    for i in prange(particles.owned):
        apply_film_impulses(i, system, far)


@part
def drift_particles(system, step, origin):
    """Apply the impulses of films and move the particles; returns the largest squared distance from the origin."""
    particles = system.particles
    farthest, count = np.zeros(CHUNKS), particles.owned
    for chunk in prange(CHUNKS):
        far = 0.0
        for i in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            if DRIFTING and not BRIDGE:
                apply_film_impulses(i, system, False)
            far = larger(far, drift(i, particles, system.parameters.free, step, origin))
        farthest[chunk] = far
    largest = 0.0
    for chunk in range(CHUNKS):
        largest = larger(largest, farthest[chunk])
    return largest
