"""Work of contacts and films in a step, and the energy that their springs hold, counted edge by edge."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, prange, threaded
from cfddem.particles.integrate import may_touch
from cfddem.particles.interactions.contact import friction_coefficient
from cfddem.particles.interactions.joint_films import normal_of
from cfddem.particles.interactions.kinematics import pair_mass_and_radius, pair_row
from cfddem.particles.interactions.shear_film import impulses_of, two
from cfddem.particles.interactions.slots import (
    BRIDGE_RESISTS,
    DRIFTING,
    FILM,
    JOINT,
    RECORD,
    RESCALED,
    ROLLING,
    SHEAR,
    ContactState,
    contact_overlap,
    derive,
    elastic_force,
    lost_energy,
    read_memory,
    stored_energy,
    tangential_stiffness,
)
from cfddem.particles.pair_graph import geometry
from cfddem.particles.particle_feature import Engine
from cfddem.particles.state import Particles
from cfddem.particles.vectors import NOTHING, across, at, cross, dot, minus, plus, put, times
from cfddem.particles.walls.nearest_point import SURFACE, portion, touched
from closures.contact import contact_share
from closures.friction import coulomb_limit

FILMS, DAMPING, SLIDING, TURNING, WALLS, STIFFENING, FALL, HYSTERESIS = range(8)
CHANNELS = ("film", "contact_damping", "friction", "rolling", "walls", "stiffening", "fall", "hysteresis")
"""Energy lost to films, dashpots, sliding and rolling; energy gained from moving walls, from tangential springs whose
stiffness changes with the overlap, and from gravity; energy lost by the contact law itself, to plastic deformation."""

BY_IMPULSES, BY_SHEAR = len(CHANNELS), len(CHANNELS) + 1
"""Places after the channels: work of springs and gravity that the impulses of bridges have taken again, negative, and
energy lost to weak films that resist sliding."""

ALMOST = 1.0 - 1e-9
"""A contact slides if its tangential force is this share of Coulomb's limit or more."""


class Count(NamedTuple):
    """State of the count between two steps, as compiled loops take it."""

    ahead: np.ndarray  # (N, 3) velocity after the first half kick of the step [m/s]
    spin_ahead: np.ndarray  # (N, 3) likewise [rad/s]
    moved: np.ndarray  # (N, 3) distance moved during the half kicks around this instant [m]
    turned: np.ndarray  # (N, 3) angle turned meanwhile [rad]
    drifted: np.ndarray  # (N, 3) displacement of the particle in the step [m]
    spring: np.ndarray  # (n,) square of the tangential spring [m2]
    stiffness: np.ndarray  # (n,) tangential, times the share of the solids in the load [N/m]
    power: np.ndarray  # (n,) going into the tangential spring [W]
    spring_energy: np.ndarray  # (n,) energy of the normal spring [J]
    hysteresis_loss: np.ndarray  # (n,) energy that the contact has lost to hysteresis [J]
    push: np.ndarray  # (n, 3) force of the springs on the first body; of runs with films or bridges [N]
    twist: np.ndarray  # (n, 3) its moment over the radius, the same on both bodies [N]
    totals: np.ndarray  # (2, CHUNKS, channels + 2); the second half is of pairs that another rank adds [J]


def allocate_tally(engine: Engine) -> Count:
    """A count with all values 0, for the present particles and pairs."""
    number, count = len(engine.edges.first), engine.particles.count
    of_particles, of_pairs, vectors_of_pairs = np.zeros((5, count, 3)), np.zeros((5, number)), np.zeros((2, number, 3))
    totals = np.zeros((2, CHUNKS, len(CHANNELS) + 2))
    return Count._make([*of_particles, *of_pairs, *vectors_of_pairs, totals])


class EnergyAccount(NamedTuple):
    """Energy of one kind of interaction, counted edge by edge beside that of contacts and films.

    channels    names of its channels
    count_edge  (k, system, tally, step, before, after, totals) counts edge k at this instant. step: 0 where no time has
                passed since the last count; before, after: half kicks around this instant [s]. `totals` has a place
                for each channel, and one for what moving walls have put in [J]
    pairs_only  whether walls have none
    form        of the energy that it stores; none if empty
    begun       what contacts have counted that belongs to the first channel, a place of `Count.totals`, if any
    at_walls    (system, tally) passes what is held on to other pieces of a wall, where there are walls
    """

    channels: tuple[str, ...]
    count_edge: Callable[..., None]
    pairs_only: bool = False
    form: str = ""
    begun: int | None = None
    at_walls: Callable[..., None] | None = None


class Tally(NamedTuple):
    """State of an account between two steps, as compiled loops take it."""

    ahead: np.ndarray  # (N, 3) velocity after the first half kick of the step [m/s]
    spin_ahead: np.ndarray  # (N, 3) likewise [rad/s]
    stored: np.ndarray  # (n,) energy that each edge stores [J]
    pull_work: np.ndarray  # (n,) work of what stores it, in the half kick after the last count [J]
    totals: np.ndarray  # (2, CHUNKS, channels + 1); the second half is of pairs that another rank adds [J]


@threaded
def count_motion(particles, count, gravity, free, step, before, after):
    """Motion during the half kicks around this instant, in which forces act, and the work of gravity in the step."""
    number = len(particles.radius)
    for chunk in prange(CHUNKS):
        totals = count.totals[0, chunk]
        for i in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            gain = 0.5 * (after * after - before * before)
            force, torque = at(particles.force, i), at(particles.torque, i)
            moved = plus(
                times(before + after, at(particles.velocity, i)), times(gain * particles.inverse_mass[i], force)
            )
            put(count.moved, i, moved)
            turned = plus(
                times(before + after, at(particles.spin, i)), times(gain * particles.inverse_inertia[i], torque)
            )
            put(count.turned, i, turned)
            if step > 0.0 and particles.inverse_mass[i] > 0.0:
                velocity, _ = drifted(i, particles, step)
                velocity = (free[0] * velocity[0], free[1] * velocity[1], free[2] * velocity[2])
                put(count.drifted, i, times(step, velocity))
                if i < particles.owned:
                    weight = times(1.0 / particles.inverse_mass[i], gravity)
                    totals[FALL] += step * dot(weight, velocity)
                    if JOINT:
                        taken, _ = taken_by_impulses(i, particles, count, step)
                        if DRIFTING:
                            taken = plus(taken, at(particles.film_gain, i))
                        taken = (free[0] * taken[0], free[1] * taken[1], free[2] * taken[2])
                        work = 0.5 * step * dot(weight, taken)  # of gravity in the half kicks; impulses take it again
                        totals[FILMS if DRIFTING else BY_IMPULSES] -= work
            elif step > 0.0:
                put(count.ahead, i, at(particles.velocity, i))


@inline
def note_bridge_loss(k, memory, lost):
    """Add what the bridge of edge k has lost to its collision, where one is recorded."""
    if RECORD and not np.isnan(memory.begin[k]):
        before = memory.lost_to_bridge[k]
        memory.lost_to_bridge[k] = lost + (0.0 if np.isnan(before) else before)


@inline
def note_loss(k, memory, channel, lost):
    """Add what edge k has lost to its collision, where one is recorded; the columns are the first three channels."""
    if RECORD and not np.isnan(memory.begin[k]):
        if np.isnan(memory.lost[3 * k]):
            put(memory.lost, k, NOTHING)
        memory.lost[3 * k + channel] += lost


@inline
def _film_works(k, system, count, step):
    """Energy that the film of edge k has taken in the step, and that a moving wall has put in through it."""
    edges, memory, particles = system.edges, system.memory, system.particles
    i, j = edges.first[k], edges.second[k]
    normal, solved = normal_of(k, system), at(memory.impulse, k)
    weak = times(dot(at(memory.film_push, k), normal), normal)
    velocity, _ = mean_motion(i, particles, count, step)
    later, _ = motion_of_weak(i, particles, step)
    gained = dot(solved, velocity) + dot(weak, later)
    if k < edges.between_particles:
        velocity, _ = mean_motion(j, particles, count, step)
        later, _ = motion_of_weak(j, particles, step)
        return dot(solved, velocity) + dot(weak, later) - gained, 0.0
    by_wall = dot(plus(solved, weak), touched(edges, k, SURFACE))
    return by_wall - gained, by_wall


@inline
def _weak_shear_works(k, system, step):
    """The same of the resistance to sliding of a weak film."""
    edges, memory, particles, walls = system.edges, system.memory, system.particles, system.walls
    i, j = edges.first[k], edges.second[k]
    push = across(at(memory.film_push, k), normal_of(k, system))
    first, second = two(memory.shear_couples, k)
    velocity, spin = motion_of_weak(i, particles, step)
    gained = dot(push, velocity) + dot(first, spin)
    if k < edges.between_particles:
        velocity, spin = motion_of_weak(j, particles, step)
        return dot(push, velocity) - gained - dot(second, spin), 0.0
    by_wall = dot(push, touched(edges, k, SURFACE)) - dot(second, at(walls.spin, walls.wall[j]))
    return by_wall - gained, by_wall


@inline
def _outrun(k, system, count, step):
    """Work of the springs of edge k in the first half kick, at the speed that impulses took before the bodies moved.

    The springs give it, and the impulses of films and bridges take it again: none of it is stored.
    """
    particles, edges = system.particles, system.edges
    i, j = edges.first[k], edges.second[k]
    slowed, turned = taken_by_impulses(i, particles, count, step)
    turned = times(particles.radius[i], turned)
    if k < edges.between_particles:
        other, also = taken_by_impulses(j, particles, count, step)
        slowed, turned = minus(slowed, other), plus(turned, times(particles.radius[j], also))
    return _spring_work(k, slowed, turned, count, 0.5 * step)


@inline
def _taken_by_weak(k, system, count, step):
    """The same in the second half kick, at the speed that weak films have given after the bodies moved."""
    particles, edges = system.particles, system.edges
    i, j = edges.first[k], edges.second[k]
    gain, turned = at(particles.film_gain, i), times(particles.radius[i], at(particles.film_spin_gain, i))
    if k < edges.between_particles:
        gain = minus(gain, at(particles.film_gain, j))
        turned = plus(turned, times(particles.radius[j], at(particles.film_spin_gain, j)))
    return _spring_work(k, gain, turned, count, 0.5 * step)


@inline
def _spring_work(k, velocity, turning, count, duration):
    """Work of the springs of edge k.

    velocity, turning  relative velocity of the bodies, and sum of their spins times radius [m/s]
    """
    return duration * (dot(at(count.push, k), velocity) + dot(at(count.twist, k), turning))


@inline
def _take_again(k, work, memory, totals):
    """Count work of the springs of edge k that impulses have taken again as that of its film or bridge."""
    if DRIFTING and not (BRIDGE_RESISTS and memory.bridge_film[k] > 0.0):
        totals[FILMS] -= work
        note_loss(k, memory, FILMS, -work)
        return
    totals[BY_IMPULSES] -= work
    if BRIDGE_RESISTS and memory.bridge_film[k] > 0.0:
        note_bridge_loss(k, memory, -work)


@inline
def _forget(k, count, totals, step):
    """Clear the count of a contact that has ended; the energy of its tangential spring is lost."""
    totals[STIFFENING] -= 0.5 * count.stiffness[k] * count.spring[k] if step > 0.0 else 0.0
    count.spring[k] = 0.0
    count.stiffness[k] = 0.0
    count.power[k] = 0.0
    count.spring_energy[k] = 0.0
    count.hysteresis_loss[k] = 0.0
    put(count.push, k, NOTHING)
    put(count.twist, k, NOTHING)


@inline
def _moved(k, system, count, duration):
    """Relative motion of two bodies over the half kicks around this instant.

    returns  displacement, rotation times radius and rotation of the first body relative to the second; the rates of
             the first two; the sum of the radii; the displacement of a wall
    """
    particles, edges, walls = system.particles, system.edges, system.walls
    i, j = edges.first[k], edges.second[k]
    about = at(count.turned, i)
    moved, turned = at(count.moved, i), times(particles.radius[i], about)
    velocity, surface_spin = at(particles.velocity, i), times(particles.radius[i], at(particles.spin, i))
    if k < edges.between_particles:
        radius = particles.radius[j]
        other = at(count.turned, j)
        moved, turned = minus(moved, at(count.moved, j)), plus(turned, times(radius, other))
        velocity = minus(velocity, at(particles.velocity, j))
        surface_spin = plus(surface_spin, times(radius, at(particles.spin, j)))
        return moved, turned, minus(about, other), velocity, surface_spin, particles.radius[i] + radius, NOTHING
    surface = touched(edges, k, SURFACE)
    by_wall = times(duration, surface)
    about = minus(about, times(duration, at(walls.spin, walls.wall[j])))
    return minus(moved, by_wall), turned, about, minus(velocity, surface), surface_spin, particles.radius[i], by_wall


@inline
def _slides(row, minimum_gap, pressed, tangent):
    """Whether a contact is at Coulomb's limit."""
    limit = coulomb_limit(friction_coefficient(row, minimum_gap), pressed)
    return math.sqrt(dot(tangent, tangent)) >= ALMOST * limit


@inline
def _contact_works(k, system, count, step, duration, totals):
    """Count what the contact of edge k has done, and keep what its springs hold; nothing if the solids do not touch."""
    edges, memory, p = system.edges, system.memory, system.parameters
    if JOINT and step > 0.0:
        _take_again(k, _outrun(k, system, count, step), memory, totals)
    separation, distance, gap = geometry(k, system)
    minimum_gap = memory.minimum_gap[k]
    if not gap < minimum_gap:
        _forget(k, count, totals, step)
        return
    normal = times(1.0 / distance, separation)
    row = pair_row(k, system)
    reduced_radius, inverse_mass = pair_mass_and_radius(k, system)
    state = ContactState(minimum_gap - gap, gap, 0.0, step, minimum_gap, reduced_radius, 1.0 / inverse_mass)
    m = read_memory(memory, k)
    d = derive(state, row, p, m)
    share = portion(edges, k) * (contact_share(gap, minimum_gap) if FILM else 1.0)
    overlap = contact_overlap(state, row, p, m, d)
    equivalent = ContactState(overlap, gap, 0.0, step, minimum_gap, reduced_radius, 1.0 / inverse_mass)
    tangential = share * tangential_stiffness(equivalent, row, p, m, d)
    elastic = share * elastic_force(state, row, p, m, d)
    force, spring = at(memory.force, k), at(memory.spring, k)
    moved, turned, about, velocity, surface_spin, radii, by_wall = _moved(k, system, count, duration)
    stretch = distance / radii
    pressed, approach = dot(force, normal), dot(moved, normal)
    slip = minus(across(velocity, normal), times(stretch, cross(surface_spin, normal)))
    slid = minus(across(moved, normal), times(stretch, cross(turned, normal)))
    pulled = dot(force, moved) + dot(at(memory.couple, k), turned) - pressed * approach

    totals[WALLS] += dot(force, by_wall)
    damped = (elastic - pressed) * approach - pulled - tangential * dot(spring, slid)
    totals[DAMPING] += damped
    note_loss(k, memory, DAMPING, damped)
    if ROLLING:
        totals[TURNING] -= dot(at(memory.moment, k), about)
    square, rate = dot(spring, spring), tangential * dot(spring, slip)
    yielded = portion(edges, k) * lost_energy(state, row, p, m, d)
    if step > 0.0:
        totals[HYSTERESIS] += yielded - count.hysteresis_loss[k]
        note_loss(k, memory, DAMPING, yielded - count.hysteresis_loss[k])
        softer, was = count.stiffness[k], count.spring[k]
        kept = was * softer / tangential if RESCALED and tangential > softer else was
        taken = 0.25 * (softer + tangential) * (square - kept)
        totals[STIFFENING] += 0.5 * (tangential * square - softer * was) - taken
        if _slides(row, minimum_gap, pressed, minus(force, times(pressed, normal))):
            rubbed = 0.5 * step * (count.power[k] + rate) - taken
            totals[SLIDING] += rubbed
            note_loss(k, memory, SLIDING, rubbed)
    count.spring[k] = square
    count.stiffness[k] = tangential
    count.power[k] = rate
    count.spring_energy[k] = portion(edges, k) * stored_energy(state, row, p, m, d)
    count.hysteresis_loss[k] = yielded
    if JOINT:
        put(count.push, k, minus(times(elastic, normal), times(tangential, spring)))
        put(count.twist, k, times(tangential * stretch, cross(normal, spring)))
        if DRIFTING and step > 0.0:
            _take_again(k, _taken_by_weak(k, system, count, step), memory, totals)


@threaded
def count_work(system, count, step, before, after):
    """Count what films have done in the step, contacts in the half kicks around this instant, and what springs hold."""
    particles, edges, memory = system.particles, system.edges, system.memory
    number, pairs = len(edges.first), edges.between_particles
    near = may_touch(edges)
    for chunk in prange(CHUNKS):
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            totals = count.totals[0 if edges.first[k] < particles.owned else 1, chunk]
            if FILM and step > 0.0:
                lost, by_wall = _film_works(k, system, count, step)
                totals[FILMS] += lost
                note_loss(k, memory, FILMS, lost)
                totals[WALLS] += by_wall
            if SHEAR and step > 0.0:
                lost, by_wall = _weak_shear_works(k, system, step)
                totals[BY_SHEAR] += lost
                note_loss(k, memory, FILMS, lost)
                totals[WALLS] += by_wall
            if not near <= k < pairs:
                _contact_works(k, system, count, step, before + after, totals)


# ---------------------------------------------------------------- films that resist sliding


@inline
def _count_shear(k, system, tally, step, before, after, totals):
    """Energy that the film of edge k has taken in the step, and that a moving wall has put in through it.

    The work of an impulse is its product with the mean of the motion before and after all impulses of the step. So the
    work of all impulses adds up to the change of the kinetic energy to round-off.
    """
    if not step > 0.0:
        return
    particles, edges, memory, walls = system.particles, system.edges, system.memory, system.walls
    i, j = edges.first[k], edges.second[k]
    impulse, first, second = impulses_of(k, memory.shear_impulse)
    velocity, spin = mean_motion(i, particles, tally, step)
    gained, by_wall = dot(impulse, velocity) + dot(first, spin), 0.0
    if k < edges.between_particles:
        velocity, spin = mean_motion(j, particles, tally, step)
        gained += dot(second, spin) - dot(impulse, velocity)
    else:
        by_wall = dot(impulse, touched(edges, k, SURFACE)) - dot(second, at(walls.spin, walls.wall[j]))
    totals[0] += by_wall - gained
    totals[1] += by_wall
    note_loss(k, memory, FILMS, by_wall - gained)


SHEARED_FILMS = EnergyAccount(("film_shear",), _count_shear, begun=BY_SHEAR)
"""Energy lost to films that resist sliding, rolling and twisting."""


# ---------------------------------------------------------------- motion while impulses act
#
# Motion of the particles while impulses act: between the two half kicks of a step.
#
# The product of an impulse with the mean motion while it acts is its work, to round-off. Weak films act last, at the
# positions after the drift.


def keep_motion(count: Any, particles: Particles, step: float, ahead: np.ndarray) -> None:
    """Keep in `count.ahead` and `count.spin_ahead` what the impulses of a step act on.

    step   [s]
    ahead  velocity after the first half kick (N, 3) [m/s]
    """
    count.ahead[:] = ahead
    count.spin_ahead[:] = particles.spin + (0.5 * step * particles.inverse_inertia)[:, None] * particles.torque


@inline
def half_motion(i, particles, kick, sign):
    """Distance and angle of particle i in a half kick (sign 1: after this instant, -1: before it)."""
    half = 0.5 * sign * kick
    velocity = plus(at(particles.velocity, i), times(half * particles.inverse_mass[i], at(particles.force, i)))
    spin = plus(at(particles.spin, i), times(half * particles.inverse_inertia[i], at(particles.torque, i)))
    return times(kick, velocity), times(kick, spin)


@inline
def drifted(i, particles, step):
    """Velocity and spin with which particle i has drifted in the step."""
    velocity = minus(at(particles.velocity, i), times(0.5 * step * particles.inverse_mass[i], at(particles.force, i)))
    spin = minus(at(particles.spin, i), times(0.5 * step * particles.inverse_inertia[i], at(particles.torque, i)))
    if DRIFTING:
        velocity, spin = minus(velocity, at(particles.film_gain, i)), minus(spin, at(particles.film_spin_gain, i))
    return velocity, spin


@inline
def mean_motion(i, particles, count, step):
    """Mean velocity and spin of particle i while impulses act that are solved, and those of bridges."""
    velocity, spin = drifted(i, particles, step)
    return times(0.5, plus(at(count.ahead, i), velocity)), times(0.5, plus(at(count.spin_ahead, i), spin))


@inline
def motion_of_weak(i, particles, step):
    """Mean velocity and spin of particle i while weak films act."""
    velocity, spin = drifted(i, particles, step)
    gain, turn = times(0.5, at(particles.film_gain, i)), times(0.5, at(particles.film_spin_gain, i))
    return plus(velocity, gain), plus(spin, turn)


@inline
def taken_by_impulses(i, particles, count, step):
    """Velocity and spin that the impulses before the drift have taken from particle i."""
    velocity, spin = drifted(i, particles, step)
    return minus(at(count.ahead, i), velocity), minus(at(count.spin_ahead, i), spin)
