"""The equations of films and bridges that are solved together: what they need of each row, and their residual.

See `cfddem.particles.interactions.joint_solution`.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, part, prange
from cfddem.particles.interactions.bridge import bridge_state, capillary_number_of, resistance_across
from cfddem.particles.interactions.bridge_solution import SMALLEST_GAP, cut_resistance, speed_after_bridge
from cfddem.particles.interactions.film import record_approach
from cfddem.particles.interactions.film_law import at_gap, at_least
from cfddem.particles.interactions.joint_films import film_at, passing_rate
from cfddem.particles.interactions.kinematics import pair_mass_and_radius, pair_row, relative_velocity
from cfddem.particles.interactions.shear_film import (
    by_blocks,
    couples,
    edge_asymmetry,
    four_of,
    impulses_of,
    pair_arms,
    put_slip_and_roll,
    sliding_ratios,
    slip_and_roll,
    slip_and_roll_of,
    twist_strength,
)
from cfddem.particles.interactions.slots import (
    BRIDGE_FILM,
    BRIDGE_RESISTS,
    BRIDGE_SLIDING,
    DRIFTING,
    SHEAR,
    SLIDES,
    TWIST,
    FilmState,
    explicit_resistance,
    film_resistance,
    speed_after_film,
    speed_after_short_film,
)
from cfddem.particles.pair_graph import edge_role, geometry
from cfddem.particles.vectors import NOTHING, across, at, cross, dot, minus, plus, put, select, times
from cfddem.particles.walls.nearest_point import SURFACE, portion, touched

SLIGHT = 1e-3
"""Change of the gap over the gap below which the resistance at the middle is the mean to 1e-7."""

_ROUNDING = 1e-7
_LITTLE = 1e-15
"""Least resistance to sliding in the solution, over that of the normal film."""

_NONE, _NO_BRIDGE = 1e-6, 1e-18
"""Least damping number of a film in the solution: solids that overlap have no film. And that of a bridge."""

_1, _2, _4 = np.uint64(1), np.uint64(2), np.uint64(4)


# ---------------------------------------------------------------- the system of equations


@inline
def has_film(k, memory):
    """Whether edge k has a film that is solved with the others."""
    if DRIFTING and BRIDGE_RESISTS:
        return memory.film_due[k]
    return DRIFTING


@inline
def prepare_film(e, system, step):
    """What the equations need of the film and the bridge of row e, and their impulse of the last step."""
    edges, memory, radius = system.edges, system.memory, system.particles.radius
    k = memory.joint_edge[e]
    separation, distance, gap = geometry(k, system)
    normal = times(1.0 / distance, separation)
    velocity = relative_velocity(k, system)
    passing, speed = 0.0, dot(velocity, normal)
    if k < edges.between_particles:
        distance = radius[edges.first[k]] + radius[edges.second[k]] + gap
        passing = passing_rate(normal, distance, velocity, system.parameters.free, step)
    memory.joint_before[e] = speed + passing
    reduced_radius, weight = pair_mass_and_radius(k, system)
    memory.joint_least[e] = (_NONE if DRIFTING else _NO_BRIDGE) / (step * weight)
    memory.joint_first[e] = edges.first[k]
    memory.joint_second[e] = edges.second[k] if k < edges.between_particles else -1
    memory.joint_gap[e], memory.joint_weight[e], memory.joint_reduced_radius[e] = gap, weight, reduced_radius
    put(memory.joint_normal, e, normal)
    share, debt, impulse = 0.0, 0.0, 0.0
    if DRIFTING and has_film(k, memory):
        share, debt, impulse = prepare_own_film(e, k, speed, gap, normal, system)
    memory.joint_share[e], memory.joint_debt[e] = share, debt
    if BRIDGE_RESISTS:
        impulse += begin_bridge(e, k, normal, impulse - debt, memory)
    memory.joint_impulse[e] = impulse
    if SLIDES:
        prepare_sliding(e, k, (normal, gap, speed), share, system, step)


@inline
def prepare_own_film(e, k, speed, gap, normal, system):
    """The same of the film alone: the part of it that belongs to edge k, what it owes, and its last impulse."""
    memory = system.memory
    film = film_at(k, gap, system)
    record_approach(k, memory, speed, gap, film.viscosity, film.reduced_radius, pair_row(k, system))
    memory.joint_viscosity[e], memory.joint_minimum_gap[e] = film.viscosity, memory.minimum_gap[k]
    return portion(system.edges, k), memory.film_owed[k], dot(at(memory.impulse, k), normal)


@part
def prepare(system, count, step):
    """What the equations need of each row, and its impulse of the last step."""
    for e in prange(count):
        prepare_film(e, system, step)


@inline
def prepare_sliding(e, k, place, share, system, step):
    """The same for sliding, rolling and twisting.

    place  normal, gap, and rate of the gap
    share  part of the film that belongs to the edge; 0 without one
    """
    particles, edges, memory = system.particles, system.edges, system.memory
    i, j = edges.first[k], edges.second[k]
    normal, gap, speed = place
    weight, turn_i, turn_j = memory.joint_weight[e], particles.inverse_inertia[i], 0.0
    if k < edges.between_particles:
        arms, turn_j = pair_arms(i, j, particles.radius, gap), particles.inverse_inertia[j]
    elif SHEAR:
        arms = (particles.radius[i], 0.0)
    else:
        arms = (particles.radius[i] + gap, 0.0)
    by_bridge = 0.0
    if BRIDGE_SLIDING:
        by_bridge = across_of(k, gap, speed, system)
        memory.bridge_across[k], memory.bridge_lever[k] = step * by_bridge, arms[0] / particles.radius[i]
    memory.joint_arms[2 * e], memory.joint_arms[2 * e + 1] = arms
    push, roll = NOTHING, NOTHING
    if SHEAR:
        own, crossed, roll_own, twist = sliding_compliances(e, k, gap, by_bridge, system, step)
        put_four(memory.joint_sliding, e, (own, crossed, roll_own, twist))
        own += weight + arms[0] * arms[0] * turn_i + arms[1] * arms[1] * turn_j
        crossed += arms[0] * turn_i - arms[1] * turn_j
        roll_own += turn_i + turn_j
        inverse = 1.0 / (own * roll_own - crossed * crossed)
        inverses = (inverse * roll_own, -inverse * crossed, inverse * own, 1.0 / (twist + turn_i + turn_j))
        push, roll = last_sliding(k, normal, arms, memory)
    else:
        own = 1.0 / max(step * by_bridge, _NO_BRIDGE / weight)
        put_four(memory.joint_sliding, e, (own, 0.0, 0.0, 0.0))
        own += weight + arms[0] * arms[0] * turn_i + arms[1] * arms[1] * turn_j
        inverses = (1.0 / own, 0.0, 0.0, 0.0)
    put_four(memory.joint_inverse, e, inverses)
    if BRIDGE_SLIDING:
        push = plus(push, push_of_last_step(k, normal, memory))
    put_slip_and_roll(memory.joint_shear_impulse, e, push, roll)


@inline
def put_four(array, e, values):
    """Write the four numbers of a row."""
    row = _4 * np.uint64(e)
    array[row], array[row + _1], array[row + _2], array[row + _2 + _1] = values


@inline
def last_sliding(k, normal, arms, memory):
    """Impulses of the film of edge k against slip, and against roll and twist, in the last step."""
    push, first, _ = impulses_of(k, memory.shear_impulse)
    push = across(push, normal)
    moment = minus(first, times(arms[0], cross(push, normal)))
    roll = cross(normal, moment)
    return push, plus(roll, times(dot(moment, normal), normal)) if TWIST else roll


@inline
def sliding_compliances(e, k, gap, by_bridge, system, step):
    """Compliances of slip, of both, of roll and of twist of the film and the bridge of edge k.

    by_bridge  resistance of the bridge to sliding [kg/s]
    """
    memory, share = system.memory, system.memory.joint_share[e]
    film, asymmetry = film_at(k, gap, system), edge_asymmetry(k, system)
    normal_resistance, of_film = memory.resistance[k], memory.shear_resistance[k]
    if BRIDGE_RESISTS:
        normal_resistance = max(normal_resistance, memory.bridge_resistance[k], memory.joint_least[e])
        of_film = of_film if share > 0.0 else 0.0
    least = _LITTLE * normal_resistance
    resistance = max(of_film, least)
    both, rolling = sliding_ratios(film.reduced_radius, asymmetry)
    scale = 1.0 / (step * resistance * (rolling - both * both))
    own, crossed, roll = scale * rolling, -scale * both, scale
    if BRIDGE_SLIDING:
        slip = resistance + by_bridge
        scale = 1.0 / (step * (slip * rolling - resistance * both * both))
        own, crossed, roll = scale * rolling, -scale * both, scale * slip / resistance
    twist = twist_strength(film.gap, film.minimum_gap, of_film, film.viscosity, film.reduced_radius, asymmetry, share)
    twist = 1.0 / (step * max(twist, least * film.reduced_radius * film.reduced_radius))
    return own, crossed, roll, twist


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
    if SLIDES:
        arms = (memory.joint_arms[2 * e], memory.joint_arms[2 * e + 1])
        first, second = at(spin, i), NOTHING
        if between:
            second = at(spin, j)
        slip, roll = slip_and_roll(difference, first, second, normal, arms)
        if SHEAR and with_walls and not between:
            wall = system.walls.wall[edges.second[memory.joint_edge[e]]]
            about = minus(first, at(system.walls.spin, wall))
            _, roll = slip_and_roll(NOTHING, about, NOTHING, normal, arms)
    return dot(difference, normal), slip, roll


@inline
def impulses_on(i, impulse, shear_impulse, system):
    """Sum of the impulses of the films of particle i that are solved together, and of their angular impulses.

    impulse        of each row along the line of centres
    shear_impulse  against slip, and against roll and twist; not read where films do not slide
    """
    edges, memory = system.edges, system.memory
    total, couple = NOTHING, NOTHING
    for place in range(edges.start[i], system.particles.joint_end[i]):
        k, sign = edge_role(memory.joint_incident[place])
        e = memory.joint_row[k]
        normal = at(memory.joint_normal, e)
        total = plus(total, times(sign * impulse[e], normal))
        if SLIDES:
            push, roll = slip_and_roll_of(shear_impulse, e)
            first, second = couples(push, roll, normal, (memory.joint_arms[2 * e], memory.joint_arms[2 * e + 1]))
            total = plus(total, times(sign, push))
            couple = plus(couple, select(sign > 0.0, first, second))
    return total, couple


@inline
def change_by(i, impulse, shear_impulse, change, turn, system):
    """Write what impulses do to particle i: the change of its velocity and the turn of its spin; see `impulses_on`."""
    particles = system.particles
    total, couple = impulses_on(i, impulse, shear_impulse, system)
    put(change, i, times(particles.inverse_mass[i], total))
    if SLIDES:
        put(turn, i, times(particles.inverse_inertia[i], couple))


@part
def spread(system, direction):
    """What the impulses of the films solved together do to every particle; or what their `direction` does."""
    particles, memory = system.particles, system.memory
    impulse = memory.joint_direction if direction else memory.joint_impulse
    change = particles.film_along if direction else particles.film_change
    shear_impulse, turn = impulse, change
    if SLIDES:
        shear_impulse = memory.joint_shear_direction if direction else memory.joint_shear_impulse
        turn = particles.film_turn_along if direction else particles.film_turn
    for i in prange(particles.owned):
        change_by(i, impulse, shear_impulse, change, turn, system)


@inline
def mean_resistance(rate, speed, e, system, step):
    """Resistance of row e along the line of centres, over its way in this step.

    rate   of the gap before all impulses [m/s]
    speed  rate of the gap with all impulses, as found so far [m/s]
    """
    memory = system.memory
    if not BRIDGE_RESISTS:
        return film_mean(speed, memory.joint_impulse[e] - memory.joint_debt[e], e, system, step)
    by_bridge = memory.joint_bridge[e] * (memory.joint_impulse[e] - memory.joint_debt[e])
    bridge, film = mean_along(e, rate, speed, by_bridge, system, step), 0.0
    if DRIFTING and memory.joint_share[e] > 0.0:
        film = film_mean(speed, memory.joint_impulse[e] - memory.joint_debt[e] - by_bridge, e, system, step)
        memory.joint_bridge[e] = bridge / (bridge + film) if bridge > 0.0 else 0.0
    return bridge + film


@inline
def film_mean(speed, impulse, e, system, step):
    """Resistance of the normal film of row e over its way in this step.

    speed    of the pair with all impulses, as found so far [m/s]
    impulse  of the film, as found so far, without what it owes [N s]
    """
    memory = system.memory
    gap, weight, share = memory.joint_gap[e], memory.joint_weight[e], memory.joint_share[e]
    radius = memory.joint_reduced_radius[e]
    cutoff_gap = system.parameters.cutoff_ratio * radius
    film = FilmState(gap, memory.joint_viscosity[e], radius, memory.joint_minimum_gap[e], cutoff_gap)
    if abs(step * speed) < SLIGHT * gap:
        return share * explicit_resistance(at_gap(film, gap + 0.5 * step * speed))
    free = speed - weight * impulse
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
    """Resistance of film e, if it is to be found anew, its residual and first direction; returns terms of four sums."""
    particles, memory = system.particles, system.memory
    _, slip, roll = rates_of(e, particles.velocity, particles.spin, True, system)
    before = memory.joint_before[e]
    change, slipped, rolled = rates_of(e, particles.film_change, particles.film_turn, False, system)
    if renew:
        memory.joint_speed[e], memory.joint_shift[e] = before + change, 0.0
        resistance = mean_resistance(before, before + change, e, system, step)
        memory.joint_compliance[e] = 1.0 / (step * max(resistance, memory.joint_least[e]))
    compliance, impulse = memory.joint_compliance[e], memory.joint_impulse[e]
    wanted = compliance * memory.joint_debt[e] - before
    residual = wanted - change - compliance * impulse
    inverse = 1.0 / (compliance + memory.joint_weight[e])
    memory.joint_residual[e], memory.joint_direction[e] = residual, inverse * residual
    left, whole = inverse * residual * residual, inverse * wanted * wanted
    by_wanted, by_residual = impulse * wanted, impulse * residual
    if SLIDES:
        normal, inverses = at(memory.joint_normal, e), four_of(memory.joint_inverse, e)
        push, couple = slip_and_roll_of(memory.joint_shear_impulse, e)
        s, q = by_blocks(four_of(memory.joint_sliding, e), push, couple, normal)
        s, q = minus(NOTHING, plus(plus(slip, slipped), s)), minus(NOTHING, plus(plus(roll, rolled), q))
        put_slip_and_roll(memory.joint_shear_residual, e, s, q)
        a, b = by_blocks(inverses, s, q, normal)
        put_slip_and_roll(memory.joint_shear_direction, e, a, b)
        left += dot(a, s) + dot(b, q)
        a, b = by_blocks(inverses, slip, roll, normal)
        whole += dot(a, slip) + dot(b, roll)
        by_wanted -= dot(push, slip) + dot(couple, roll)
        by_residual += dot(push, s) + dot(couple, q)
    sums = (left, whole, by_wanted, by_residual) if own(e, system) else (0.0, 0.0, 0.0, 0.0)
    terms, rows = memory.joint_terms, len(system.edges.first)
    terms[e], terms[rows + e], terms[2 * rows + e], terms[3 * rows + e] = sums
    return sums


@inline
def greater(top, term):
    """The larger of a number and the absolute value of another; NaN if one of them is NaN."""
    size = abs(term)
    return size if size > top or size != size else top


@inline
def greatest(tops):
    """The largest of some numbers; NaN if one of them is NaN."""
    largest = 0.0
    for top in tops:
        largest = greater(largest, top)
    return largest


@part
def find_residual(system, count, step, renew):
    """Resistances, if they are to be found anew, residuals, and the terms of four sums; returns the largest of each.

    The sums are: the square of the residual, and of what it would be without impulses, both in the preconditioner; and
    impulses times the right-hand side, and times the residual.
    """
    tops = np.zeros((4, CHUNKS))
    for chunk in prange(CHUNKS):
        left, whole, by_wanted, by_residual = 0.0, 0.0, 0.0, 0.0
        for e in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            sums = film_residual(e, system, step, renew)
            left, whole = greater(left, sums[0]), greater(whole, sums[1])
            by_wanted, by_residual = greater(by_wanted, sums[2]), greater(by_residual, sums[3])
        tops[0, chunk], tops[1, chunk], tops[2, chunk], tops[3, chunk] = left, whole, by_wanted, by_residual
    return greatest(tops[0]), greatest(tops[1]), greatest(tops[2]), greatest(tops[3])


# ---------------------------------------------------------------- bridges
#
# What a liquid bridge adds to the equations of all films and bridges.
#
# See `cfddem.particles.interactions.joint_solution`. A bridge resists along the line of centres by the mean of its
# resistance over the way of the gap in the step, and across it by its resistance at the beginning of the step. A film
# and a bridge of the same pair are one row of the equations; the impulses found are shared by their resistances.


STILL = 1e-7
"""Change of the gap in a step, over the gap or h_min, below which the mean resistance is that at the gap."""


@inline
def floor_of(k, memory):
    """Gap below which the resistance of the bridge of edge k does not depend on it."""
    return max(memory.bridge_gap[k], SMALLEST_GAP)


@inline
def mean_along(e, rate, speed, impulse, system, step):
    """Resistance of the bridge of row e along the line of centres, over its way in this step; 0 without one.

    rate     of the gap before all impulses [m/s]
    speed    rate of the gap with all impulses, as found so far [m/s]
    impulse  of the bridge, as found so far [N s]
    """
    memory, p, k = system.memory, system.parameters, system.memory.joint_edge[e]
    if not BRIDGE_FILM or not memory.bridge_film[k] > 0.0:
        return 0.0
    gap, weight, floor = memory.joint_gap[e], memory.joint_weight[e], floor_of(k, memory)
    if max(gap, gap + step * speed) < floor:
        return memory.closed_along[k]
    state = bridge_state(k, gap, memory.joint_reduced_radius[e], memory, p, capillary_number_of(rate, p))
    free = speed - weight * impulse
    after = speed_after_bridge(free, state, gap, step, weight)
    if abs(step * after) <= STILL * max(abs(gap), floor):
        return cut_resistance(state, gap, floor)
    return (free - after) / (weight * step * after)


@inline
def across_of(k, gap, rate, system):
    """Resistance of the bridge of edge k to sliding; 0 without one."""
    memory, p = system.memory, system.parameters
    if not BRIDGE_SLIDING or not memory.bridge_film[k] > 0.0:
        return 0.0
    if gap < floor_of(k, memory):
        return memory.closed_across[k]
    reduced_radius, _ = pair_mass_and_radius(k, system)
    return resistance_across(bridge_state(k, gap, reduced_radius, memory, p, capillary_number_of(rate, p)))


@inline
def begin_bridge(e, k, normal, by_film, memory):
    """Normal impulse of the bridge of edge k in the last step, and its part in that of both.

    by_film  impulse of the film in the last step, without what it owed [N s]
    """
    impulse = dot(at(memory.bridge_impulse, k), normal) if memory.bridge_solved[k] else 0.0
    memory.bridge_solved[k] = memory.bridge_film[k] > 0.0
    part = 1.0
    if DRIFTING:
        both = by_film + impulse
        part = impulse / both if impulse * by_film > 0.0 else (0.5 if memory.bridge_solved[k] else 0.0)
    memory.joint_bridge[e] = part
    memory.joint_floor[e] = 0.0 if memory.joint_share[e] > 0.0 else floor_of(k, memory)
    return impulse


@inline
def keep_bridge(e, k, normal, memory):
    """Keep the impulse of the bridge of row e; returns it, its normal part first."""
    along = memory.joint_bridge[e] * (memory.joint_impulse[e] - memory.joint_debt[e])
    push = NOTHING
    if BRIDGE_SLIDING:
        push, roll = slip_and_roll_of(memory.joint_shear_impulse, e)
        if SHEAR and memory.joint_share[e] > 0.0:
            slip, _ = by_blocks(four_of(memory.joint_sliding, e), push, roll, normal)
            push = times(memory.bridge_across[k], slip)
        put(memory.bridge_couple, k, times(memory.bridge_lever[k], cross(push, normal)))
    put(memory.bridge_impulse, k, plus(times(along, normal), push))
    return along, push


@inline
def push_of_last_step(k, normal, memory):
    """Impulse of the bridge of edge k against sliding in the last step."""
    return across(at(memory.bridge_impulse, k), normal)
