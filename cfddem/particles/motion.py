"""Particles in time: edges, then nodes, then one synchronised velocity Verlet step.

A step kicks by half, lets the films brake, drifts, finds the forces at the new places, and kicks by half
again. One loop over edges writes what each pair does, one loop over particles sums a particle's own edges
in a fixed order: no two threads write the same number, and the result does not depend on their count.
"""

from __future__ import annotations

import numpy as np

from cfddem.kernels import CHUNKS, inline, prange, serial_and_threaded
from cfddem.particles.encounters import observe
from cfddem.particles.films import film_force, squeeze, wet
from cfddem.particles.forces import NOTHING, VERLET, Meeting, contact, contact_reach, relative_velocity, resist_rolling
from cfddem.particles.meshes import hand_over, meet_walls
from cfddem.particles.pair_loops import (
    meet_pairs,
    meet_pairs_threaded,
    squeeze_pairs,
    squeeze_pairs_threaded,
    wet_pairs,
    wet_pairs_threaded,
)
from cfddem.particles.pairs import ENTRY, geometry
from cfddem.particles.surfaces import TURN, advance_walls, portion, touched, touched_distance
from cfddem.particles.vectors import at, dot, minus, plus, put, times


@inline
def wall_meeting(k, bodies, edges, walls, shift):
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
        minus(at(bodies.spin, i), at(walls.spin, walls.wall[edges.second[k]])),
        2.5 * bodies.inverse_mass[i] / radius**2,
    )


@inline
def forget(k, edges, laws, rolling):
    """A contact has ended, or has not begun."""
    put(edges.spring, k, NOTHING)
    if rolling:
        put(edges.roll, k, NOTHING)
    if laws.cohesion:
        edges.minimum_gap[k] = 0.0  # it lasts beyond geometric touch only where it has been


@inline
def _role(edge):
    """Row of an incident edge, and 1 where the particle is its first body, -1 where it is its second."""
    second = np.int64(edge) >> 63
    return np.uint64(np.int64(edge) ^ second), 1.0 + 2.0 * second


@inline
def gather_forces(i, bodies, edges, gravity, films, rolling, near):
    """Sum what the edges of particle i do to it, with weight and outside force; pairs from `near` on do not touch."""
    force, couple, moment, resistance = at(bodies.applied, i), NOTHING, NOTHING, 0.0
    for place in range(edges.start[i], edges.start[i + 1]):
        k, sign = _role(edges.incident[place])
        if films:
            resistance += edges.resistance[k]
            if near <= k < edges.between_particles:
                continue
        force = plus(force, times(sign, at(edges.force, k)))
        couple = plus(couple, at(edges.couple, k))
        if rolling:
            moment = plus(moment, times(sign, at(edges.moment, k)))
    if bodies.inverse_mass[i] > 0.0:
        force = plus(force, times(1.0 / bodies.inverse_mass[i], gravity))
    put(bodies.force, i, force)
    put(bodies.torque, i, plus(times(bodies.radius[i], couple), moment))
    if films:
        bodies.film_rate[i] = bodies.inverse_mass[i] * resistance


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
        k, sign = _role(edges.incident[place])
        impulse = plus(impulse, times(sign, at(edges.impulse, k)))
    put(bodies.velocity, i, plus(at(bodies.velocity, i), times(bodies.inverse_mass[i], impulse)))


@inline
def drift(i, bodies, free, step, origin):
    """Move particle i along the free directions; returns how far it is from its origin, squared."""
    velocity = at(bodies.velocity, i)
    way = (step * free[0] * velocity[0], step * free[1] * velocity[1], step * free[2] * velocity[2])
    put(bodies.position, i, plus(at(bodies.position, i), way))
    moved = minus(at(bodies.position, i), at(origin, i))
    return dot(moved, moved)


def _march(
    bodies, edges, walls, walled, filmed, explicit, recorded, shift, table, laws, free, gravity, step, steps,
    origin, reach, time, log,
):  # fmt: skip
    """Find the forces at the present places, then advance by up to `steps` steps.

    With `steps` = 0 nothing moves. With `steps` > 0 the forces at hand are taken as they are, and the march
    stops early when a particle has moved by `reach` from `origin`, or when `log`, the record of encounters
    ended since `time`, could overflow. Returns the number of steps made, the largest displacement squared
    (NaN if a position is no number) and the number of rows written. Where `walled`, `filmed`, `explicit` or
    `recorded` is None, there are no walls, no films, none as forces of plain Verlet, or no record, and nothing
    about them is compiled.
    """
    farthest = np.zeros(CHUNKS)
    largest = 0.0
    count, pairs, number = len(bodies.radius), edges.between_particles, len(edges.first)
    kinds, rows = np.uint64(len(table)), table.reshape(-1)
    meshes = pairs < number and len(walls.cell_member) > 0
    films = True if laws.film else False  # noqa: SIM210  a film that is None has no truth of type bool
    rolling = True if laws.rolling else False  # noqa: SIM210
    drifting = films and laws.integrator != VERLET
    near = edges.near if drifting else pairs
    moving = steps > 0
    half = step if moving else 0.0
    done, noted = 0, 0
    while True:
        if moving:
            for i in prange(count):
                kick(i, bodies, step)
            if filmed is not None and drifting:
                squeeze_pairs(
                    pairs,
                    edges.first,
                    edges.second,
                    edges.image,
                    edges.minimum_gap,
                    edges.resistance,
                    edges.approach_speed,
                    edges.accounted_gap,
                    edges.impulse,
                    edges.hard,
                    bodies.position,
                    bodies.velocity,
                    bodies.radius,
                    bodies.film_rate,
                    shift,
                    laws,
                    step,
                )
                for k in prange(number):
                    if k >= pairs or edges.hard[k]:
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
        if filmed is not None and films:
            wet_pairs(
                near,
                pairs,
                edges.first,
                edges.second,
                edges.image,
                edges.minimum_gap,
                edges.resistance,
                edges.approach_speed,
                edges.accounted_gap,
                bodies.position,
                bodies.radius,
                bodies.material,
                bodies.viscosity,
                shift,
                rows,
                kinds,
                laws,
            )
            for k in range(pairs, number):
                wet(k, bodies, edges, walls, shift, table, laws)
        meet_pairs(
            near,
            edges.first,
            edges.second,
            edges.image,
            edges.minimum_gap,
            edges.spring,
            edges.force,
            edges.couple,
            edges.roll,
            edges.moment,
            edges.resistance,
            edges.approach_speed,
            edges.accounted_gap,
            bodies.position,
            bodies.velocity,
            bodies.spin,
            bodies.radius,
            bodies.inverse_mass,
            bodies.material,
            bodies.viscosity,
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
                apart = not touched_distance(edges, k) - bodies.radius[edges.first[k]] < edges.minimum_gap[k]
                if part == 0.0 or apart:
                    put(edges.force, k, NOTHING)
                    put(edges.couple, k, NOTHING)
                    if rolling:
                        put(edges.moment, k, NOTHING)
                    if part != 0.0:
                        forget(k, edges, laws, rolling)
                    continue
                meeting = wall_meeting(k, bodies, edges, walls, shift)
                which = np.uint64(bodies.material[edges.first[k]]) * kinds + np.uint64(walls.material[edges.second[k]])
                push, turn, memory = contact(
                    meeting, rows, which, edges.minimum_gap[k], at(edges.spring, k), laws, half
                )
                if laws.cohesion:
                    edges.minimum_gap[k] = contact_reach(meeting, rows[which], edges.minimum_gap[k])
                if rolling:
                    held = edges.minimum_gap[k]
                    torque, rolled = resist_rolling(meeting, rows[which], held, push, at(edges.roll, k), laws, half)
                    put(edges.moment, k, times(part, torque))
                    put(edges.roll, k, rolled)
                put(edges.force, k, times(part, push))
                put(edges.couple, k, times(part, turn))
                put(edges.spring, k, memory)
        if explicit is not None and films and not drifting:
            for k in prange(number):
                film = film_force(k, bodies, edges, walls, shift, table, laws)
                put(edges.force, k, plus(at(edges.force, k), film))
        for i in prange(count):
            gather_forces(i, bodies, edges, gravity, films, rolling, near)
            if moving:
                kick(i, bodies, step)
        for chunk in range(CHUNKS):
            if not farthest[chunk] <= largest:
                largest = farthest[chunk]
        if recorded is not None:
            for k in range(len(edges.entry) // ENTRY):
                noted = observe(k, bodies, edges, walls, shift, table, laws, time + done * step, log, noted)
        full = len(log) - noted < len(edges.entry) // ENTRY
        if done >= steps or full or not largest < reach * reach:
            return done, largest, noted


march, march_threaded = serial_and_threaded(
    _march, meet_pairs=meet_pairs_threaded, wet_pairs=wet_pairs_threaded, squeeze_pairs=squeeze_pairs_threaded
)
