"""Particles in time: edges, then nodes, then one synchronised velocity Verlet step.

A step kicks by half, lets the films brake, drifts, finds the forces at the new places, and kicks by half
again. One loop over edges writes what each pair does, one loop over particles sums a particle's own edges
in a fixed order: no two threads write the same number, and the result does not depend on their count.
"""

from __future__ import annotations

import numpy as np

from cfddem.kernels import CHUNKS, inline, prange, serial_and_threaded
from cfddem.particles.encounters import observe
from cfddem.particles.forces import VERLET, meet, squeeze
from cfddem.particles.vectors import at, plus, put, times


@inline
def gather_forces(i, bodies, edges, gravity):
    """Sum what the edges of particle i do to it, with weight and outside force."""
    force, couple, resistance = at(bodies.applied, i), (0.0, 0.0, 0.0), 0.0
    for place in range(edges.start[i], edges.start[i + 1]):
        k = edges.incident[place]
        if k >= 0:
            force = plus(force, at(edges.force, k))
        else:
            k = -1 - k
            force = plus(force, times(-1.0, at(edges.force, k)))
        couple = plus(couple, at(edges.couple, k))
        resistance += edges.resistance[k]
    if bodies.inverse_mass[i] > 0.0:
        force = plus(force, times(1.0 / bodies.inverse_mass[i], gravity))
    put(bodies.force, i, force)
    put(bodies.torque, i, times(bodies.radius[i], couple))
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
        k = edges.incident[place]
        if k >= 0:
            impulse = plus(impulse, at(edges.impulse, k))
        else:
            impulse = plus(impulse, times(-1.0, at(edges.impulse, -1 - k)))
    put(bodies.velocity, i, plus(at(bodies.velocity, i), times(bodies.inverse_mass[i], impulse)))


@inline
def drift(i, bodies, free, step, origin):
    """Move particle i along the free directions; returns how far it is from its origin, squared."""
    moved = 0.0
    for axis in range(3):
        bodies.position[i, axis] += step * free[axis] * bodies.velocity[i, axis]
        moved += (bodies.position[i, axis] - origin[i, axis]) ** 2
    return moved


def _march(bodies, edges, walls, table, laws, free, gravity, step, steps, origin, reach, time, rows):
    """Find the forces at the present places, then advance by up to `steps` steps.

    With `steps` = 0 nothing moves. With `steps` > 0 the forces at hand are taken as they are, and the march
    stops early when a particle has moved by `reach` from `origin`, or when `rows`, the record of encounters
    ended since `time`, could overflow. Returns the number of steps made, the largest displacement squared
    (NaN if a position is no number) and the number of rows written.
    """
    farthest = np.zeros(CHUNKS)
    largest = 0.0
    count = len(bodies.radius)
    films = laws.film and laws.integrator != VERLET
    moving = steps > 0
    done, noted = 0, 0
    while True:
        if moving:
            for i in prange(count):
                kick(i, bodies, step)
            if films:
                for k in prange(len(edges.first)):
                    squeeze(k, bodies, edges, walls, table, laws, step)
            for chunk in prange(CHUNKS):
                far = 0.0
                for i in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
                    if films:
                        brake(i, bodies, edges)
                    moved = drift(i, bodies, free, step, origin)
                    if not moved <= far:
                        far = moved
                farthest[chunk] = far
            done += 1
        for k in prange(len(edges.first)):
            meet(k, bodies, edges, walls, table, laws, free, step if moving else 0.0)
        for i in prange(count):
            gather_forces(i, bodies, edges, gravity)
            if moving:
                kick(i, bodies, step)
        for chunk in range(CHUNKS):
            if not farthest[chunk] <= largest:
                largest = farthest[chunk]
        for k in range(len(edges.entry)):
            noted = observe(k, bodies, edges, walls, table, laws, time + done * step, rows, noted)
        full = len(rows) - noted < len(edges.entry)
        if done >= steps or full or not largest < reach * reach:
            return done, largest, noted


march, march_threaded = serial_and_threaded(_march)
