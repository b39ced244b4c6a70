"""Particles in time: one synchronised velocity Verlet step after the other.

A step consists of these phases:

    kick                 half a step by the forces of the last step
    [halo: velocity, spin]
    impulses             of all films that are not weak and all stiff bridges together, see `joint_solution`
    [halo: velocity, spin]
    reversals            impulses of the films of bridges that have inertia
    drift                new positions; walls move
    [halo: position, velocity, spin, thickness of the liquid]
    walls                geometry of every particle and wall
    [halo: liquid for new bridges]
    bridges              those that form and break, the pull of all, and the resistance of those that are not stiff
    pairs                films, contacts, rolling and bonds of every edge
    sum                  force, torque and impulses of weak films of every particle over its own edges, in a fixed order
    kick                 the other half

A loop over edges writes what each pair does, a loop over particles sums its edges: no two threads write the same
number, and the result does not depend on their number. In one process `integrate` makes all phases of many steps in
one compiled loop. Where processes share the particles, :class:`cfddem.particles.ghosts.StepsWithGhosts` makes the same
phases one by one, and ghosts receive the values of their owners in between.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, part, prange, serial
from cfddem.particles.collision_events import record_event
from cfddem.particles.interactions.bond import bond_forces
from cfddem.particles.interactions.bridge import renew_wall_bridges, reverse_films
from cfddem.particles.interactions.bridge_apart import end_release, find_loads, release_stiff, released
from cfddem.particles.interactions.bridge_changes import exchange_liquid, find_changes, renew_thickness
from cfddem.particles.interactions.film import film_force, update_edge_film
from cfddem.particles.interactions.joint_films import find_due, list_due
from cfddem.particles.interactions.joint_solution import film_kick
from cfddem.particles.interactions.kinematics import wall_kinematics
from cfddem.particles.interactions.pair_loops import FEW, PIECE, REST, edge_contact
from cfddem.particles.interactions.slots import (
    ADHESIVE,
    BOND,
    BRIDGE,
    BRIDGE_APART,
    BRIDGE_INERTIA,
    BRIDGE_SLIDING,
    DRIFTING,
    FILM,
    JOINT,
    RECORD,
    ROLLING,
    SHEAR,
    TRIANGLES,
    clear_contact,
    find_touching,
    pack_contacts,
    packed_forces,
    pair_forces,
    unpack_contacts,
    update_films,
)
from cfddem.particles.pair_graph import edge_role, places_of
from cfddem.particles.vectors import NOTHING, at, dot, minus, plus, put, times
from cfddem.particles.walls.mesh_contacts import pairs_at_walls, share_memory, wall_contacts
from cfddem.particles.walls.nearest_point import advance_walls, portion, touched_distance

# ---------------------------------------------------------------- phases


@inline
def wall_contact(k, system, step):
    """Contact of particle-wall edge k."""
    particles, edges, memory, walls, table, p = (
        system.particles,
        system.edges,
        system.memory,
        system.walls,
        system.table,
        system.parameters,
    )
    part = portion(edges, k)
    i, j = edges.first[k], edges.second[k]
    apart = not touched_distance(edges, k) - particles.radius[i] < memory.minimum_gap[k]
    if part == 0.0 or apart:
        put(memory.force, k, NOTHING)
        put(memory.couple, k, NOTHING)
        if ROLLING:
            put(memory.moment, k, NOTHING)
        if part != 0.0:
            clear_contact(memory, k)
        return
    kinematics = wall_kinematics(k, system)
    row = table[particles.material[i], walls.material[j]]
    edge_contact(k, kinematics, row, part, memory, p, step)


@part
def contacts_of_pairs(system, step):
    """Contacts of all pairs of particles: where few of a piece touch, of those that do, or did at the last step."""
    pairs, packed, wait = may_touch(system.edges), system.packed, system.packed.wait
    room, pieces = len(packed.row) // CHUNKS, -(-pairs // PIECE)
    for chunk in prange(CHUNKS):
        to = chunk * room
        for piece in range(chunk * pieces // CHUNKS, (chunk + 1) * pieces // CHUNKS):
            begin, end = piece * PIECE, min((piece + 1) * PIECE, pairs)
            if wait[piece] > 1:
                wait[piece] -= 1
                pair_forces(begin, end, system, step)
                continue
            find_touching(begin, end, system)
            touching = 0
            for k in range(begin, end):
                touching += system.memory.touching[k] & 1
            few = touching < FEW * (end - begin)
            if few and wait[piece] == 0:
                last = pack_contacts(begin, end, to, system)
                packed_forces(to, last, system, step)
                unpack_contacts(to, last, system)
            else:
                pair_forces(begin, end, system, step)
            wait[piece] = 0 if few else REST


@part
def wall_forces(system, step):
    """Films and contacts of all edges between particles and walls."""
    edges = system.edges
    for n in prange(edges.between_particles, len(edges.first)):
        k = np.uint64(n)
        if FILM:
            update_edge_film(k, system, step)
        wall_contact(k, system, step)


@part
def add_film_forces(system):
    """Add the forces of films that act as explicit forces."""
    edges, memory = system.edges, system.memory
    for k in prange(len(edges.first)):
        film = film_force(k, system)
        put(memory.force, k, plus(at(memory.force, k), film))


@inline
def may_touch(edges):
    """Number of leading edges between particles that may touch; those after them have films and bridges alone."""
    if DRIFTING or (BRIDGE and not FILM and not ADHESIVE):
        return edges.near
    return edges.between_particles


@inline
def find_forces(system, step):
    """Films, contacts and rolling of all edges at the present positions.

    step  by which springs have moved since the last forces; 0 at the start [s]
    """
    edges = system.edges
    if FILM:
        update_films(0, edges.between_particles, system, step)
    contacts_of_pairs(system, step)
    wall_forces(system, step)
    if FILM and not DRIFTING:
        add_film_forces(system)
    if BOND:
        bond_forces(system, step)


@part
def sum_forces(system, step):
    """Sum the forces on the particles, and let weak films and half a kick act on them."""
    particles, edges = system.particles, system.edges
    near = may_touch(edges)
    for i in prange(particles.owned):
        gather_forces(i, system, near)
        if step > 0.0:
            kick(i, particles, step, True)


# ---------------------------------------------------------------- between the halos


@serial
def move(system, step, origin):
    """Reversals and drift, and the motion of walls; returns the square of the largest displacement."""
    walls = system.walls
    if BRIDGE_INERTIA:
        reverse_films(system, step)
    largest = drift_particles(system, step, origin)
    largest = larger(largest, advance_walls(walls, step) ** 2)
    if TRIANGLES:
        share_memory(system)
    return largest


@serial
def find_bridge_changes(system, step):
    """Walls at the present positions, and where bridges form and break; returns the number of these changes.

    step  since the last positions; 0 if these are the same [s]
    """
    wall_contacts(pairs_at_walls(system), system.parameters.cutoff_ratio)
    return find_changes(system, step) if BRIDGE else 0


@serial
def act_bridges(changes, system):
    """Form and break bridges, of which `find_bridge_changes` has found the number, and find the pull at walls."""
    if changes > 0:
        exchange_liquid(system)
    renew_wall_bridges(system)


@inline
def act(system, step):
    """Pairs and sums at the present positions, and the second half of the kick."""
    find_forces(system, step)
    sum_forces(system, step)


@inline
def record(system, time, log, noted):
    """Write the collisions that have ended to `log`, after the rows there are; returns their number."""
    edges = system.edges
    for k in range(len(edges.first)):
        noted = record_event(k, system, time, log, noted)
    return noted


# ---------------------------------------------------------------- all phases of many steps


@part
def renew_released(system):
    """Sum the forces on the particles anew some of whose bridges are stiff at the step that begins."""
    for i in prange(system.particles.owned):
        if released(i, system):
            gather_forces(i, system, may_touch(system.edges))


@serial
def start_steps(system, step):
    """What steps need before the first: liquid from outside, and which films and bridges are solved together."""
    if BRIDGE:
        renew_thickness(system.particles)
    if BRIDGE_APART:
        find_loads(system, False)
        if step > 0.0 and release_stiff(system, step) > 0:
            renew_released(system)
            end_release(system.memory)
    if JOINT and step > 0.0:
        find_due(system, step)


@serial
def integrate(system, step, steps, origin, reach, time, log):
    """Find the forces at the present positions, then advance by up to `steps` steps.

    With `steps` = 0 nothing moves. With `steps` > 0 the first kick uses the forces of the last step. The loop stops
    early when a particle has moved by `reach` from `origin`, or when `log`, the record of collisions ended since
    `time`, could overflow. Returns the number of steps made, the largest squared displacement (NaN if a position is
    NaN) and the number of rows written.
    """
    particles, edges = system.particles, system.edges
    largest, done, noted, full = 0.0, 0, 0, False
    half = step if steps > 0 else 0.0
    start_steps(system, half)
    while True:
        if steps > 0:
            kick_particles(particles, step)
            if JOINT:
                film_kick(system, step)
            moved = move(system, step, origin)
            largest = larger(largest, moved)
            done += 1
        changes = find_bridge_changes(system, half)
        if BRIDGE:
            act_bridges(changes, system)
        act(system, half)
        if RECORD:
            now = time + done * step
            noted = record(system, now, log, noted)
            full = len(log) - noted < len(edges.first)
        if done >= steps or full or not largest < reach * reach:
            return done, largest, noted


# ---------------------------------------------------------------- one phase after the other


@serial
def start_step(particles, step):
    """The first half of the kick."""
    kick_particles(particles, step)


@serial
def finish_step(changes, system, step, time, log, noted):
    """Find and act on bridges, unless found (`changes`); act, and record; returns the number of rows written."""
    if changes < 0:
        changes = find_bridge_changes(system, step)
    if BRIDGE:
        act_bridges(changes, system)
    act(system, step)
    if RECORD:
        noted = record(system, time, log, noted)
    return noted


# ---------------------------------------------------------------- particles in a step
#
# What one particle does in a step: sum the forces on it, take kicks and impulses, and move.


_0, _1, _2 = np.uint64(0), np.uint64(1), np.uint64(2)


@inline
def gather_forces(i, system, near):
    """Sum what the edges of particle i do to it, with weight and outside force; list those that are solved together.

    near  number of leading pairs that may touch
    """
    particles, edges, memory = system.particles, system.edges, system.memory
    force, couple, moment = at(particles.applied, i), NOTHING, NOTHING
    impulse, turn, end = NOTHING, NOTHING, np.uint64(edges.start[i])
    far, walls = np.uint64(near), np.uint64(edges.between_particles)
    for place in places_of(i, edges):
        k, sign = edge_role(edges.incident[place])
        if JOINT:
            end = list_due(k, place, end, system)
        if DRIFTING:
            impulse = plus(impulse, times(sign, at(memory.film_push, k)))
        if SHEAR:
            turn = plus(turn, at(memory.shear_couples, _2 * k + (_0 if sign > 0.0 else _1)))
        if BRIDGE:  # zero without a bridge, which costs less than to look
            force = plus(force, times(sign, at(memory.bridge_force, k)))
        if BRIDGE_APART and BRIDGE_SLIDING:
            couple = plus(couple, at(memory.bridge_turn, k))
        if BOND and k < walls:
            force = plus(force, times(sign, at(memory.bond_force, k)))
            couple = plus(couple, at(memory.bond_couple, k))
            moment = plus(moment, times(sign, at(memory.bond_moment, k)))
        if (FILM or BRIDGE) and far <= k < walls:
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
