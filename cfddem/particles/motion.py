"""Particles in time: edges, then nodes, then one synchronised velocity Verlet step.

A step kicks by half, lets the films brake, drifts, finds the forces at the new places, and kicks by half
again. One loop over edges writes what each pair does, one loop over particles sums a particle's own edges
in a fixed order: no two threads write the same number, and the result does not depend on their count.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.kernels import CHUNKS, inline, prange, serial_and_threaded
from cfddem.particles.encounters import observe
from cfddem.particles.forces import NOTHING, VERLET, Meeting, contact, film_force, relative_velocity, squeeze, wet
from cfddem.particles.meshes import hand_over, meet_walls
from cfddem.particles.pairs import between, geometry
from cfddem.particles.surfaces import TURN, advance_walls, portion, touched
from cfddem.particles.vectors import at, dot, minus, plus, put, times


@inline
def sphere_meeting(i, j, image, position, velocity, spin, radius, inverse_mass, shift, free):
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
    )


@inline
def wall_meeting(k, bodies, edges, shift):
    """A sphere and a wall as they stand to each other."""
    i = edges.first[k]
    separation, distance, gap = geometry(k, bodies, edges, shift)
    radius = bodies.radius[i]
    return Meeting(
        separation,
        distance,
        gap,
        relative_velocity(k, bodies, edges),
        times(radius, at(bodies.spin, i)),
        radius,
        1.0 / radius,
        bodies.inverse_mass[i],
        touched(edges, k, TURN),
    )


@inline
def gather_forces(i, bodies, edges, gravity, films):
    """Sum what the edges of particle i do to it, with weight and outside force."""
    force, couple, resistance = at(bodies.applied, i), (0.0, 0.0, 0.0), 0.0
    for place in range(edges.start[i], edges.start[i + 1]):
        edge = edges.incident[place]
        if edge >= 0:
            k = np.uint64(edge)
            force = plus(force, at(edges.force, k))
        else:
            k = np.uint64(-1 - edge)
            force = minus(force, at(edges.force, k))
        couple = plus(couple, at(edges.couple, k))
        if films:
            resistance += edges.resistance[k]
    if bodies.inverse_mass[i] > 0.0:
        force = plus(force, times(1.0 / bodies.inverse_mass[i], gravity))
    put(bodies.force, i, force)
    put(bodies.torque, i, times(bodies.radius[i], couple))
    if films:
        bodies.resistance[i] = resistance


@inline
def kick(i, bodies, step):
    """Half a kick by the forces at hand."""
    gain = times(0.5 * step * bodies.inverse_mass[i], at(bodies.force, i))
    put(bodies.velocity, i, plus(at(bodies.velocity, i), gain))
    gain = times(0.5 * step * bodies.inverse_inertia[i], at(bodies.torque, i))
    put(bodies.spin, i, plus(at(bodies.spin, i), gain))


@inline
def brake(i, bodies, edges):
    """Give particle i the impulses of its films."""
    impulse = (0.0, 0.0, 0.0)
    for place in range(edges.start[i], edges.start[i + 1]):
        edge = edges.incident[place]
        k = edge if edge >= 0 else -1 - edge
        if edges.resistance[k] != 0.0:
            impulse = plus(impulse, at(edges.impulse, k)) if edge >= 0 else minus(impulse, at(edges.impulse, k))
    put(bodies.velocity, i, plus(at(bodies.velocity, i), times(bodies.inverse_mass[i], impulse)))


@inline
def drift(i, bodies, free, step, origin):
    """Move particle i along the free directions; returns how far it is from its origin, squared."""
    velocity = at(bodies.velocity, i)
    way = (step * free[0] * velocity[0], step * free[1] * velocity[1], step * free[2] * velocity[2])
    put(bodies.position, i, plus(at(bodies.position, i), way))
    moved = minus(at(bodies.position, i), at(origin, i))
    return dot(moved, moved)


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
    position,
    velocity,
    spin,
    radius,
    inverse_mass,
    material,
    shift,
    rows,
    kinds,
    laws,
    free,
    step,
):
    """Contact of one pair of particles."""
    k = np.uint64(edge)
    i, j = first[k], second[k]
    meeting = sphere_meeting(i, j, image[k], position, velocity, spin, radius, inverse_mass, shift, free)
    which = np.uint64(material[i]) * kinds + np.uint64(material[j])
    push, turn, memory = contact(meeting, rows, which, minimum_gap[k], at(spring, k), laws, step)
    put(force, k, push)
    put(couple, k, turn)
    put(spring, k, memory)


def _meet_pairs(
    pairs,
    first,
    second,
    image,
    minimum_gap,
    spring,
    force,
    couple,
    position,
    velocity,
    spin,
    radius,
    inverse_mass,
    material,
    shift,
    rows,
    kinds,
    laws,
    free,
    step,
):
    """Contact of every pair of particles.

    The arrays come one by one and the body is a single call: only so does the compiler see that no array
    overlaps another, and works on several pairs at once.
    """
    for edge in prange(pairs):
        _meet_pair(
            edge,
            first,
            second,
            image,
            minimum_gap,
            spring,
            force,
            couple,
            position,
            velocity,
            spin,
            radius,
            inverse_mass,
            material,
            shift,
            rows,
            kinds,
            laws,
            free,
            step,
        )


meet_pairs, meet_pairs_threaded = serial_and_threaded(_meet_pairs)


def _march(bodies, edges, walls, walled, shift, table, laws, free, gravity, step, steps, origin, reach, time, log):
    """Find the forces at the present places, then advance by up to `steps` steps.

    With `steps` = 0 nothing moves. With `steps` > 0 the forces at hand are taken as they are, and the march
    stops early when a particle has moved by `reach` from `origin`, or when `log`, the record of encounters
    ended since `time`, could overflow. Returns the number of steps made, the largest displacement squared
    (NaN if a position is no number) and the number of rows written. Where `walled` is None there are no walls,
    and nothing about them is compiled.
    """
    farthest = np.zeros(CHUNKS)
    largest = 0.0
    count, pairs, number = len(bodies.radius), edges.between_particles, len(edges.first)
    kinds, rows = np.uint64(len(table)), table.reshape(-1)
    meshes = pairs < number and len(walls.cell_member) > 0
    films = True if laws.film else False  # noqa: SIM210  a film that is None has no truth of type bool
    drifting = films and laws.integrator != VERLET
    moving = steps > 0
    half = step if moving else 0.0
    done, noted = 0, 0
    while True:
        if moving:
            for i in prange(count):
                kick(i, bodies, step)
            if drifting:
                for k in prange(number):
                    squeeze(k, bodies, edges, walls, shift, table, laws, step)
            for chunk in prange(CHUNKS):
                far = 0.0
                for i in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
                    if drifting:
                        brake(i, bodies, edges)
                    moved = drift(i, bodies, free, step, origin)
                    if not moved <= far:
                        far = moved
                farthest[chunk] = far
            done += 1
            if walled is not None:
                way = advance_walls(walls, step)
                largest = max(largest, way * way)
                if meshes:
                    hand_over(edges, walls)
        if walled is not None:
            meet_walls(bodies, edges, walls, free, laws.cutoff_ratio if films else 0.0)
        if films:
            for k in prange(number):
                wet(k, bodies, edges, walls, shift, table, laws)
        meet_pairs(
            pairs,
            edges.first,
            edges.second,
            edges.image,
            edges.minimum_gap,
            edges.spring,
            edges.force,
            edges.couple,
            bodies.position,
            bodies.velocity,
            bodies.spin,
            bodies.radius,
            bodies.inverse_mass,
            bodies.material,
            shift,
            rows,
            kinds,
            laws,
            free,
            half,
        )
        if walled is not None:
            for edge in range(pairs, number):
                k = np.uint64(edge)
                part = portion(edges, k)
                if part == 0.0:
                    put(edges.force, k, NOTHING)
                    put(edges.couple, k, NOTHING)
                    continue
                meeting = wall_meeting(k, bodies, edges, shift)
                which = np.uint64(bodies.material[edges.first[k]]) * kinds + np.uint64(walls.material[edges.second[k]])
                push, turn, memory = contact(
                    meeting, rows, which, edges.minimum_gap[k], at(edges.spring, k), laws, half
                )
                put(edges.force, k, times(part, push))
                put(edges.couple, k, times(part, turn))
                put(edges.spring, k, memory)
        if films and not drifting:
            for k in prange(number):
                film = film_force(k, bodies, edges, walls, shift, table, laws)
                put(edges.force, k, plus(at(edges.force, k), film))
        for i in prange(count):
            gather_forces(i, bodies, edges, gravity, films)
            if moving:
                kick(i, bodies, step)
        for chunk in range(CHUNKS):
            if not farthest[chunk] <= largest:
                largest = farthest[chunk]
        for k in range(len(edges.entry) // 5):
            noted = observe(k, bodies, edges, walls, shift, table, laws, time + done * step, log, noted)
        full = len(log) - noted < len(edges.entry) // 5
        if done >= steps or full or not largest < reach * reach:
            return done, largest, noted


march, march_threaded = serial_and_threaded(_march, meet_pairs=meet_pairs_threaded)
