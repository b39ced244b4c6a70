"""Films whose impulses act over a step: their fields, the weak ones, and the list of all others.

Weak films act explicitly; all others are solved together (`cfddem.particles.interactions.joint_solution`).
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, part, prange
from cfddem.data.fields import Field
from cfddem.particles.interactions.film import record_approach
from cfddem.particles.interactions.film_law import at_gap, at_least
from cfddem.particles.interactions.kinematics import (
    pair_mass_and_radius,
    pair_row,
    pair_viscosity,
    relative_velocity,
)
from cfddem.particles.interactions.shear_film import (
    impulses_of,
    sliding_ratios,
    twist_strength,
    write_impulse,
)
from cfddem.particles.interactions.slots import (
    COUNT_FILM,
    SHEAR,
    TWIST,
    FilmState,
    film_outside,
    film_resistance,
)
from cfddem.particles.pair_graph import edge_role, geometry, places_of
from cfddem.particles.vectors import NOTHING, across, at, cross, dot, either, minus, plus, put, times
from cfddem.particles.walls.nearest_point import portion

WEAK = 1e-3
"""Damping number X below which a film acts explicitly. Ten times as much costs 2 % of the viscosity of a suspension."""

FIELDS = (
    Field("joint_row", role="scratch", dtype=np.int32, meaning="place of the film among those solved together, from 1"),
    Field("joint_edge", role="scratch", dtype=np.int32, meaning="pair of each film solved together"),
    Field("joint_incident", "1", 2, "scratch", dtype=np.int32, meaning="films solved together of each particle"),
    Field("joint_normal", "1", 3, "scratch", meaning="direction from the second body to the first"),
    Field("joint_weight", "1/kg", role="scratch", meaning="sum of the inverse masses"),
    Field("joint_passing", "m/s", role="scratch", meaning="rate at which bodies that pass each other part"),
    Field("joint_gap", "m", role="scratch", meaning="gap at the beginning of the step"),
    Field("joint_least", "kg/s", role="scratch", meaning="least resistance of the film"),
    Field("joint_compliance", "1/kg", role="scratch", meaning="1/(resistance times step)"),
    Field("joint_debt", "N s", role="scratch", meaning="impulse that a film which begins has missed"),
    Field("joint_impulse", "N s", role="scratch", meaning="normal impulse"),
    Field("joint_residual", "m/s", role="scratch", meaning="of the equation of the normal impulse"),
    Field("joint_direction", "N s", role="scratch", meaning="of conjugate gradients"),
    Field("joint_product", "m/s", role="scratch", meaning="matrix times direction"),
    Field("joint_terms", "1", 5, "scratch", meaning="terms of sums over all films"),
)
"""Of pairs whose films act by impulses. Those named joint_, but the first, hold one row for each film solved."""

SHEAR_FIELDS = (
    Field("joint_arms", "m", 2, "scratch", meaning="lever arms of slip on the first and the second body"),
    Field("joint_sliding", "1", 4, "scratch", meaning="compliances of slip, of both, of roll and of twist"),
    Field("joint_inverse", "1", 4, "scratch", meaning="preconditioner of slip, of both, of roll and of twist"),
    Field("joint_shear_impulse", "1", 6, "scratch", meaning="impulses against slip [N s], and roll and twist [N m s]"),
    Field("joint_shear_residual", "1", 6, "scratch", meaning="residuals of slip [m/s], and of roll and twist [rad/s]"),
    Field("joint_shear_direction", "1", 6, "scratch", meaning="directions of conjugate gradients"),
    Field("joint_shear_product", "1", 6, "scratch", meaning="matrix times direction"),
)
"""The same of films that resist sliding."""

PARTICLE_FIELDS = (
    Field("film_change", "m/s", 3, "scratch", halo=("film_change",), meaning="change of velocity by films"),
    Field("film_turn", "rad/s", 3, "scratch", halo=("film_change",), meaning="change of spin by films"),
    Field("joint_end", role="scratch", dtype=np.int64, meaning="end of the films of the particle in joint_incident"),
)
"""Fields of particles whose films act by impulses."""

# ---------------------------------------------------------------- weak films, and which are solved together


@inline
def apart(speed, film, weight, share, memory, step):
    """Explicit impulse of a film if it is weak.

    weight   sum of the inverse masses [1/kg]
    share    part of the film that belongs to this edge
    memory   resistance, approach speed and accounted gap
    returns  impulse [N s], whether the film is solved with the others instead, and whether the approach is the fastest
    """
    resistance, approach_speed, accounted_gap = memory
    within = resistance > 0.0 and weight > 0.0
    end = film.gap + step * speed
    # the lever is 0 for solids that overlap, and 1 above the minimum gap
    lever = min(max(film.gap, end, 0.0) / film.minimum_gap, 1.0)
    above = film.gap > film.minimum_gap
    strong = within and (step * resistance * weight * lever >= WEAK or (above and abs(end - film.gap) > 0.5 * film.gap))
    begin, end = min(accounted_gap, film.cutoff_gap), min(end, film.cutoff_gap)
    middle = 0.5 * (begin + end)
    lever = min(max(middle, 0.0) / film.minimum_gap, 1.0)
    # where the film is solved with the others, the value is not used, but must be finite
    impulse = -share * lever * film_resistance(at_gap(film, max(middle, film.minimum_gap))) * (end - begin)
    faster = within and -speed > approach_speed and film.gap > film.minimum_gap
    return impulse if within and not strong else 0.0, strong, faster


@inline
def slip_and_roll(velocity, spin, other, normal, arms):
    """Slip of the surfaces, and difference of the spins times the normal with the rate of twist along the normal.

    velocity     of the first centre relative to the second, or to the surface of a wall
    spin, other  of the first and the second body
    arms         lever arms of both
    """
    turning = plus(times(arms[0], spin), times(arms[1], other))
    slip, about = minus(across(velocity, normal), cross(turning, normal)), minus(spin, other)
    roll = cross(normal, about)
    return slip, plus(roll, times(dot(about, normal), normal)) if TWIST else roll


@inline
def by_blocks(blocks, slip, roll, normal):
    """Product of the symmetric matrix of an edge (of slip, of both, of roll, of twist) with slip and roll."""
    first = plus(times(blocks[0], slip), times(blocks[1], roll))
    second = plus(times(blocks[1], slip), times(blocks[2], roll))
    if TWIST:
        twist = dot(roll, normal)
        first = minus(first, times(blocks[1] * twist, normal))
        second = plus(second, times((blocks[3] - blocks[2]) * twist, normal))
    return first, second


@inline
def couples(push, roll, normal, arms):
    """Angular impulses on the first and the second body, from impulses against slip and against roll and twist."""
    turn = cross(push, normal)
    moment = cross(roll, normal)
    if TWIST:
        moment = plus(moment, times(dot(roll, normal), normal))
    return plus(times(arms[0], turn), moment), minus(times(arms[1], turn), moment)


@inline
def explicit_sliding(k, resistance, twist, motion, normal, arms, reduced_radius, asymmetry, strong, memory, step):
    """Explicit impulses of a weak film against sliding and rolling; the last ones are kept of a film that is solved."""
    both, rolling = sliding_ratios(reduced_radius, asymmetry)
    blocks = (-step * resistance, -step * resistance * both, -step * resistance * rolling, -step * twist)
    push, roll = by_blocks(blocks, motion[0], motion[1], normal)
    first, second = couples(push, roll, normal, arms)
    kept, kept_first, kept_second = impulses_of(k, memory)
    write_impulse(
        k, memory, either(strong, kept, push), either(strong, kept_first, first), either(strong, kept_second, second)
    )


@inline
def pair_arms(i, j, radius, gap):
    """Lever arms of slip of two spheres: they add up to the distance of the centres."""
    lever = (radius[i] + radius[j] + gap) / (radius[i] + radius[j])
    return lever * radius[i], lever * radius[j]


@inline
def passing_rate(normal, distance, velocity, free, step):
    """Mean rate at which two spheres that pass each other part in a step beyond the speed along their normal.

    At most that speed: so a film takes what its gap changes, and gives no energy to a pair that turns as a whole.

    velocity  of the first centre relative to the second
    """
    moving = (free[0] * velocity[0], free[1] * velocity[1], free[2] * velocity[2])
    aside = across(moving, normal)
    return min(0.5 * step * dot(aside, aside) / distance, abs(dot(velocity, normal)))


@inline
def weak_pair(n, system, step):
    """Film of one pair of particles: its explicit impulse, or that it is solved with the others."""
    particles, edges, memory = system.particles, system.edges, system.memory
    k = np.uint64(n)
    i, j = edges.first[k], edges.second[k]
    normal, gap, radius = at(memory.film_normal, k), memory.film_gap[k], particles.radius
    inverse_sum = 1.0 / (radius[i] + radius[j])
    reduced_radius = radius[i] * radius[j] * inverse_sum
    velocity = minus(at(particles.velocity, i), at(particles.velocity, j))
    passing = passing_rate(normal, radius[i] + radius[j] + gap, velocity, system.parameters.free, step)
    viscosity = 0.5 * (particles.viscosity[i] + particles.viscosity[j])
    cutoff_gap = system.parameters.cutoff_ratio * reduced_radius
    film = FilmState(gap, viscosity, reduced_radius, memory.minimum_gap[k], cutoff_gap)
    weight = particles.inverse_mass[i] + particles.inverse_mass[j]
    within = memory.resistance[k]
    then = (within, memory.approach_speed[k], memory.accounted_gap[k])
    impulse, strong, faster = apart(dot(velocity, normal) + passing, film, weight, 1.0, then, step)
    if COUNT_FILM:
        memory.outside[k] += film_outside(at_least(film)) if within > 0.0 else 0
    memory.joint_row[k] = 1 if strong else 0
    memory.faster[k] = faster
    put(memory.impulse, k, either(strong, at(memory.impulse, k), times(impulse, normal)))
    if SHEAR:
        asymmetry = (radius[i] - radius[j]) * inverse_sum
        arms = pair_arms(i, j, radius, gap)
        motion = slip_and_roll(velocity, at(particles.spin, i), at(particles.spin, j), normal, arms)
        resistance = memory.shear_resistance[k] if weight > 0.0 else 0.0
        twist = twist_strength(gap, film.minimum_gap, resistance, viscosity, reduced_radius, asymmetry, 1.0)
        explicit_sliding(k, resistance, twist, motion, normal, arms, reduced_radius, asymmetry, strong, memory, step)


@inline
def normal_and_gap(k, system):
    """Direction from the second body of edge k to the first, and the gap."""
    separation, distance, gap = geometry(k, system)
    return times(1.0 / distance, separation), gap


@inline
def film_at(k, gap, system):
    """The film of edge k."""
    reduced_radius, _ = pair_mass_and_radius(k, system)
    cutoff_gap = system.parameters.cutoff_ratio * reduced_radius
    return FilmState(gap, pair_viscosity(k, system), reduced_radius, system.memory.minimum_gap[k], cutoff_gap)


@inline
def motion_at_wall(k, normal, system):
    """Slip and roll of particle-wall edge k."""
    particles, edges, walls = system.particles, system.edges, system.walls
    i, arms = edges.first[k], (particles.radius[edges.first[k]], 0.0)
    slip, _ = slip_and_roll(relative_velocity(k, system), at(particles.spin, i), NOTHING, normal, arms)
    about = minus(at(particles.spin, i), at(walls.spin, walls.wall[edges.second[k]]))
    _, roll = slip_and_roll(NOTHING, about, NOTHING, normal, arms)
    return slip, roll


@inline
def weak_wall(k, system, step):
    """Film of one particle at a wall: its explicit impulse, or that it is solved with the others."""
    particles, edges, memory = system.particles, system.edges, system.memory
    i = edges.first[k]
    memory.joint_row[k], memory.faster[k] = 0, False
    if memory.resistance[k] == 0.0:
        put(memory.impulse, k, NOTHING)
        if SHEAR:
            write_impulse(k, memory, NOTHING, NOTHING, NOTHING)
        return
    normal, gap = normal_and_gap(k, system)
    film, weight, share = film_at(k, gap, system), particles.inverse_mass[i], portion(edges, k)
    then = (memory.resistance[k], memory.approach_speed[k], memory.accounted_gap[k])
    impulse, strong, faster = apart(dot(relative_velocity(k, system), normal), film, weight, share, then, step)
    if COUNT_FILM:
        memory.outside[k] += film_outside(at_least(film))
    memory.joint_row[k] = 1 if strong else 0
    memory.faster[k] = faster
    if not strong:
        put(memory.impulse, k, times(impulse, normal))
    if SHEAR:
        arms, resistance = (particles.radius[i], 0.0), memory.shear_resistance[k] if weight > 0.0 else 0.0
        motion = motion_at_wall(k, normal, system)
        twist = twist_strength(gap, film.minimum_gap, resistance, film.viscosity, film.reduced_radius, -1.0, share)
        explicit_sliding(k, resistance, twist, motion, normal, arms, film.reduced_radius, -1.0, strong, memory, step)


@inline
def note_approach(k, system):
    """Remember the speed of approach of edge k, the fastest since its film began."""
    normal, gap = normal_and_gap(k, system)
    film = film_at(k, gap, system)
    speed, row = dot(relative_velocity(k, system), normal), pair_row(k, system)
    record_approach(k, system.memory, speed, gap, film.viscosity, film.reduced_radius, row)


@inline
def enter(k, row, memory):
    """List the film of edge k at a row."""
    memory.joint_edge[row] = k
    memory.joint_row[k] = row + 1


@part
def collect(system, step):
    """Films at walls; and list the films that are solved together. Returns their number."""
    edges, memory = system.edges, system.memory
    number, pairs = len(edges.first), edges.between_particles
    counts = np.zeros(CHUNKS + 1, np.int64)
    for chunk in prange(CHUNKS):
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            if k >= pairs:
                weak_wall(k, system, step)
            if memory.joint_row[k] > 0:
                counts[chunk + 1] += 1
            elif memory.faster[k]:
                note_approach(k, system)
    for chunk in range(CHUNKS):
        counts[chunk + 1] += counts[chunk]
    for chunk in prange(CHUNKS):
        row = counts[chunk]
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            if memory.joint_row[k] > 0:
                enter(k, row, memory)
                row += 1
    return counts[CHUNKS]


@inline
def take_weak(i, system):
    """Give particle i the impulses of its weak films, and list its films that are solved together."""
    particles, edges, memory = system.particles, system.edges, system.memory
    impulse, couple, end = NOTHING, NOTHING, edges.start[i]
    for place in places_of(i, edges):
        k, sign = edge_role(edges.incident[place])
        row = memory.joint_row[k]
        if row > 0:
            memory.joint_incident[end] = row - 1 if sign > 0.0 else -row
            end += 1
            continue
        impulse = plus(impulse, times(sign, at(memory.impulse, k)))
        if SHEAR:
            push, first, second = impulses_of(k, memory)
            impulse = plus(impulse, times(sign, push))
            couple = plus(couple, either(sign > 0.0, first, second))
    particles.joint_end[i] = end
    gain = times(particles.inverse_mass[i], impulse)
    put(particles.velocity, i, plus(at(particles.velocity, i), gain))
    if SHEAR:
        gain = times(particles.inverse_inertia[i], couple)
        put(particles.spin, i, plus(at(particles.spin, i), gain))


@part
def give_weak(system):
    """Give the particles the impulses of weak films, and list their films that are solved together."""
    for i in prange(system.particles.owned):
        take_weak(i, system)
