"""The equations of films that are solved together: what they need of each film, and their residual.

See `cfddem.particles.interactions.joint_solution`.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline, part, prange
from cfddem.particles.interactions.film import record_approach
from cfddem.particles.interactions.film_law import at_gap, at_least
from cfddem.particles.interactions.joint_films import film_at, passing_rate
from cfddem.particles.interactions.kinematics import pair_mass_and_radius, pair_row, relative_velocity
from cfddem.particles.interactions.shear_film import (
    by_blocks,
    couples,
    edge_asymmetry,
    impulses_of,
    pair_arms,
    put_two,
    sliding_ratios,
    slip_and_roll,
    twist_strength,
    two,
)
from cfddem.particles.interactions.slots import (
    SHEAR,
    TWIST,
    FilmState,
    explicit_resistance,
    film_resistance,
    speed_after_film,
    speed_after_short_film,
)
from cfddem.particles.pair_graph import edge_role
from cfddem.particles.vectors import NOTHING, across, at, cross, dot, either, minus, plus, put, times
from cfddem.particles.walls.nearest_point import SURFACE, portion, touched

SLIGHT = 1e-3
"""Change of the gap over the gap below which the resistance at the middle is the mean to 1e-7."""

_ROUNDING = 1e-7
_LITTLE = 1e-15
"""Least resistance to sliding in the solution, over that of the normal film."""

_NONE = 1e-6
"""Least damping number of a film in the solution: solids that overlap have no film."""

_1, _2, _4 = np.uint64(1), np.uint64(2), np.uint64(4)


# ---------------------------------------------------------------- the system of equations


@inline
def prepare_film(e, system, step):
    """What the equations need of film e, and its impulse of the last step."""
    edges, memory, radius = system.edges, system.memory, system.particles.radius
    k = memory.joint_edge[e]
    normal, gap, velocity = at(memory.film_normal, k), memory.film_gap[k], relative_velocity(k, system)
    passing = 0.0
    if k < edges.between_particles:
        distance = radius[edges.first[k]] + radius[edges.second[k]] + gap
        passing = passing_rate(normal, distance, velocity, system.parameters.free, step)
    memory.joint_passing[e] = passing
    _, weight = pair_mass_and_radius(k, system)
    share = portion(edges, k)
    memory.joint_least[e] = _NONE / (step * weight)
    film = film_at(k, gap, system)
    speed = dot(velocity, normal)
    record_approach(k, memory, speed, gap, film.viscosity, film.reduced_radius, pair_row(k, system))
    memory.joint_first[e] = edges.first[k]
    memory.joint_second[e] = edges.second[k] if k < edges.between_particles else -1
    memory.joint_share[e], memory.joint_viscosity[e] = share, film.viscosity
    memory.joint_reduced_radius[e], memory.joint_minimum_gap[e] = film.reduced_radius, memory.minimum_gap[k]
    memory.joint_debt[e] = memory.film_owed[k]
    memory.joint_gap[e], memory.joint_weight[e] = gap, weight
    put(memory.joint_normal, e, normal)
    memory.joint_impulse[e] = dot(at(memory.impulse, k), normal)
    if SHEAR:
        prepare_sliding(e, k, film, weight, share, normal, system, step)


@part
def prepare(system, count, step):
    """What the equations need of each film, and its impulse of the last step."""
    for e in prange(count):
        prepare_film(e, system, step)


@inline
def prepare_sliding(e, k, film, weight, share, normal, system, step):
    """The same for sliding, rolling and twisting."""
    particles, edges, memory = system.particles, system.edges, system.memory
    i, j = edges.first[k], edges.second[k]
    asymmetry = edge_asymmetry(k, system)
    if k < edges.between_particles:
        arms, turn_j = pair_arms(i, j, particles.radius, film.gap), particles.inverse_inertia[j]
    else:
        arms, turn_j = (particles.radius[i], 0.0), 0.0
    turn_i = particles.inverse_inertia[i]
    least = _LITTLE * memory.resistance[k]
    resistance = max(memory.shear_resistance[k], least)
    both, rolling = sliding_ratios(film.reduced_radius, asymmetry)
    scale = 1.0 / (step * resistance * (rolling - both * both))
    twist = twist_strength(
        film.gap, film.minimum_gap, memory.shear_resistance[k], film.viscosity, film.reduced_radius, asymmetry, share
    )
    twist = 1.0 / (step * max(twist, least * film.reduced_radius * film.reduced_radius))
    own, crossed, roll = scale * rolling, -scale * both, scale
    row = _4 * np.uint64(e)
    four = memory.joint_sliding
    four[row], four[row + _1], four[row + _2], four[row + _2 + _1] = own, crossed, roll, twist
    own += weight + arms[0] * arms[0] * turn_i + arms[1] * arms[1] * turn_j
    crossed += arms[0] * turn_i - arms[1] * turn_j
    roll += turn_i + turn_j
    inverse = 1.0 / (own * roll - crossed * crossed)
    four = memory.joint_inverse
    four[row], four[row + _1], four[row + _2] = inverse * roll, -inverse * crossed, inverse * own
    four[row + _2 + _1] = 1.0 / (twist + turn_i + turn_j)
    memory.joint_arms[2 * e], memory.joint_arms[2 * e + 1] = arms
    push, first, _ = impulses_of(k, memory.shear_impulse)
    push = across(push, normal)
    moment = minus(first, times(arms[0], cross(push, normal)))
    put_two(memory.joint_shear_impulse, e, push, cross(normal, moment))
    if TWIST:
        put_two(memory.joint_shear_impulse, e, push, plus(cross(normal, moment), times(dot(moment, normal), normal)))


@inline
def four_of(array, e):
    """The four numbers of a row."""
    row = _4 * np.uint64(e)
    return array[row], array[row + _1], array[row + _2], array[row + _2 + _1]


@inline
def rates_of(e, velocity, spin, with_walls, system):
    """Normal speed, slip and roll of film e at given velocities and spins of the particles.

    with_walls  walls move, too; else they are at rest
    """
    edges, memory = system.edges, system.memory
    i, j = memory.joint_first[e], memory.joint_second[e]
    normal, difference = at(memory.joint_normal, e), at(velocity, i)
    between = j >= 0
    if between:
        difference = minus(difference, at(velocity, j))
    elif with_walls:
        difference = minus(difference, touched(edges, memory.joint_edge[e], SURFACE))
    slip, roll = NOTHING, NOTHING
    if SHEAR:
        arms = (memory.joint_arms[2 * e], memory.joint_arms[2 * e + 1])
        first, second = at(spin, i), NOTHING
        if between:
            second = at(spin, j)
        slip, roll = slip_and_roll(difference, first, second, normal, arms)
        if with_walls and not between:
            wall = system.walls.wall[edges.second[memory.joint_edge[e]]]
            about = minus(first, at(system.walls.spin, wall))
            _, roll = slip_and_roll(NOTHING, about, NOTHING, normal, arms)
    return dot(difference, normal), slip, roll


@part
def spread(system, direction):
    """What the impulses of the films solved together do to every particle; or what their `direction` does."""
    particles, edges, memory = system.particles, system.edges, system.memory
    impulse = memory.joint_direction if direction else memory.joint_impulse
    change = particles.film_along if direction else particles.film_change
    if SHEAR:
        shear_impulse = memory.joint_shear_direction if direction else memory.joint_shear_impulse
        turn = particles.film_turn_along if direction else particles.film_turn
    for i in prange(particles.owned):
        total, couple = NOTHING, NOTHING
        for place in range(edges.start[i], particles.joint_end[i]):
            k, sign = edge_role(memory.joint_incident[place])
            e = memory.joint_row[k]
            normal = at(memory.joint_normal, e)
            total = plus(total, times(sign * impulse[e], normal))
            if SHEAR:
                push, roll = two(shear_impulse, e)
                first, second = couples(push, roll, normal, (memory.joint_arms[2 * e], memory.joint_arms[2 * e + 1]))
                total = plus(total, times(sign, push))
                couple = plus(couple, either(sign > 0.0, first, second))
        put(change, i, times(particles.inverse_mass[i], total))
        if SHEAR:
            put(turn, i, times(particles.inverse_inertia[i], couple))


@inline
def mean_resistance(speed, e, system, step):
    """Resistance of the normal film e over its way in this step.

    speed  of the pair with all films, as found so far [m/s]
    """
    memory = system.memory
    gap, weight, share = memory.joint_gap[e], memory.joint_weight[e], memory.joint_share[e]
    radius = memory.joint_reduced_radius[e]
    cutoff_gap = system.parameters.cutoff_ratio * radius
    film = FilmState(gap, memory.joint_viscosity[e], radius, memory.joint_minimum_gap[e], cutoff_gap)
    if abs(step * speed) < SLIGHT * gap:
        return share * explicit_resistance(at_gap(film, gap + 0.5 * step * speed))
    free = speed - weight * (memory.joint_impulse[e] - memory.joint_debt[e])
    inverse_mass = weight * share
    strength = inverse_mass * film_resistance(at_least(film)) * max(gap, film.minimum_gap)
    after = speed_after_short_film(free, film, gap, step, strength, inverse_mass)
    if after != after:
        after = speed_after_film(free, film, gap, step, strength, inverse_mass)
    if abs(step * after) <= _ROUNDING * abs(gap) or after == 0.0:
        return share * explicit_resistance(film)
    return (free - after) / (weight * step * after)


@inline
def own(e, system):
    """Whether film e is counted here: its first body is not a ghost."""
    return system.memory.joint_first[e] < system.particles.owned


@inline
def film_residual(e, system, step, renew):
    """Resistance of film e, if it is to be found anew, its residual, and its terms of four sums."""
    particles, memory = system.particles, system.memory
    before, slip, roll = rates_of(e, particles.velocity, particles.spin, True, system)
    before += memory.joint_passing[e]
    given, slipped, rolled = rates_of(e, particles.film_change, particles.film_turn, False, system)
    if renew:
        memory.joint_speed[e], memory.joint_shift[e] = before + given, 0.0
        resistance = mean_resistance(before + given, e, system, step)
        memory.joint_compliance[e] = 1.0 / (step * max(resistance, memory.joint_least[e]))
    compliance, impulse = memory.joint_compliance[e], memory.joint_impulse[e]
    wanted = compliance * memory.joint_debt[e] - before
    residual = wanted - given - compliance * impulse
    inverse = 1.0 / (compliance + memory.joint_weight[e])
    memory.joint_residual[e] = residual
    left, whole = inverse * residual * residual, inverse * wanted * wanted
    by_wanted, by_residual = impulse * wanted, impulse * residual
    if SHEAR:
        normal, inverses = at(memory.joint_normal, e), four_of(memory.joint_inverse, e)
        push, couple = two(memory.joint_shear_impulse, e)
        s, q = by_blocks(four_of(memory.joint_sliding, e), push, couple, normal)
        s, q = minus(NOTHING, plus(plus(slip, slipped), s)), minus(NOTHING, plus(plus(roll, rolled), q))
        put_two(memory.joint_shear_residual, e, s, q)
        a, b = by_blocks(inverses, s, q, normal)
        left += dot(a, s) + dot(b, q)
        a, b = by_blocks(inverses, slip, roll, normal)
        whole += dot(a, slip) + dot(b, roll)
        by_wanted -= dot(push, slip) + dot(couple, roll)
        by_residual += dot(push, s) + dot(couple, q)
    mine = 1.0 if own(e, system) else 0.0
    terms, rows = memory.joint_terms, len(system.edges.first)
    terms[e], terms[rows + e] = mine * left, mine * whole
    terms[2 * rows + e], terms[3 * rows + e] = mine * by_wanted, mine * by_residual


@part
def find_residual(system, count, step, renew):
    """Resistances, if they are to be found anew, residuals, and the terms of four sums.

    The sums are: the square of the residual, and of what it would be without impulses, both in the preconditioner; and
    impulses times the right-hand side, and times the residual.
    """
    for e in prange(count):
        film_residual(e, system, step, renew)
