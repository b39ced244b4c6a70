"""What an iteration of films that are solved together does to each film.

See `cfddem.particles.interactions.joint_solution`.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, part, prange
from cfddem.particles.interactions.joint_bridges import keep_bridge
from cfddem.particles.interactions.joint_equations import greater, greatest, own, rates_of
from cfddem.particles.interactions.shear_film import (
    by_blocks,
    couples,
    four_of,
    put_impulses,
    put_slip_and_roll,
    slip_and_roll_of,
)
from cfddem.particles.interactions.slots import BRIDGE_RESISTS, DRIFTING, SHEAR, SLIDES
from cfddem.particles.vectors import LEAST, NOTHING, at, dot, minus, plus, put, times


@inline
def film_direction(e, system, share):
    """New direction of film e."""
    memory = system.memory
    steepest = memory.joint_residual[e] / (memory.joint_compliance[e] + memory.joint_weight[e])
    memory.joint_direction[e] = steepest + share * memory.joint_direction[e]
    if SLIDES:
        s, q = slip_and_roll_of(memory.joint_shear_residual, e)
        s, q = by_blocks(four_of(memory.joint_inverse, e), s, q, at(memory.joint_normal, e))
        a, b = slip_and_roll_of(memory.joint_shear_direction, e)
        put_slip_and_roll(memory.joint_shear_direction, e, plus(s, times(share, a)), plus(q, times(share, b)))


@part
def find_direction(system, count, share):
    """New direction: preconditioned residual, and a share of the last direction."""
    for e in prange(count):
        film_direction(e, system, share)


@inline
def film_product(e, system):
    """Matrix times direction of film e; returns its term of their product."""
    particles, memory = system.particles, system.memory
    product, slip, roll = rates_of(e, particles.film_along, particles.film_turn_along, False, system)
    direction = memory.joint_direction[e]
    product += memory.joint_compliance[e] * direction
    memory.joint_product[e] = product
    term = direction * product
    if SLIDES:
        push, couple = slip_and_roll_of(memory.joint_shear_direction, e)
        s, q = by_blocks(four_of(memory.joint_sliding, e), push, couple, at(memory.joint_normal, e))
        s, q = plus(slip, s), plus(roll, q)
        put_slip_and_roll(memory.joint_shear_product, e, s, q)
        term += dot(push, s) + dot(couple, q)
    term = term if own(e, system) else 0.0
    memory.joint_terms[e] = term
    return term


@part
def find_product(system, count):
    """Matrix times direction, and the terms of its product with the direction; returns the largest of these."""
    tops = np.zeros(CHUNKS)
    for chunk in prange(CHUNKS):
        top = 0.0
        for e in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            top = greater(top, film_product(e, system))
        tops[chunk] = top
    return greatest(tops)


@inline
def film_follows(e, system, length, step):
    """New impulse and residual of film e; returns its terms of two sums."""
    memory = system.memory
    direction, compliance = memory.joint_direction[e], memory.joint_compliance[e]
    memory.joint_impulse[e] += length * direction
    residual = memory.joint_residual[e] - length * memory.joint_product[e]
    memory.joint_residual[e] = residual
    inverse = 1.0 / (compliance + memory.joint_weight[e])
    term = inverse * residual * residual
    # the resistance holds for the rate of the gap before; it changes as the gap at the middle of the way
    shift = memory.joint_shift[e] + length * (memory.joint_product[e] - compliance * direction)
    memory.joint_shift[e] = shift
    gap = memory.joint_gap[e]
    end = gap + step * memory.joint_speed[e]
    farther = max(gap, end, LEAST)
    if BRIDGE_RESISTS:
        farther = max(farther, memory.joint_floor[e])
    stale = compliance * memory.joint_impulse[e] * 0.5 * step * shift / farther
    if BRIDGE_RESISTS and max(gap, end, end + step * shift) < memory.joint_floor[e]:
        stale = 0.0  # the resistance of a closed bridge stays
    outdated = inverse * stale * stale
    if SLIDES:
        push, couple = slip_and_roll_of(memory.joint_shear_impulse, e)
        s, q = slip_and_roll_of(memory.joint_shear_direction, e)
        put_slip_and_roll(memory.joint_shear_impulse, e, plus(push, times(length, s)), plus(couple, times(length, q)))
        a, b = slip_and_roll_of(memory.joint_shear_product, e)
        s, q = slip_and_roll_of(memory.joint_shear_residual, e)
        s, q = minus(s, times(length, a)), minus(q, times(length, b))
        put_slip_and_roll(memory.joint_shear_residual, e, s, q)
        a, b = by_blocks(four_of(memory.joint_inverse, e), s, q, at(memory.joint_normal, e))
        term += dot(a, s) + dot(b, q)
    if not own(e, system):
        term, outdated = 0.0, 0.0  # not a product: `outdated` is infinite where solids overlap
    memory.joint_terms[e], memory.joint_terms[len(system.edges.first) + e] = term, outdated
    return term, outdated


@part
def follow_direction(system, count, length, step):
    """New impulses at a length along the direction, and what they do to the particles; terms of two sums.

    The sums are the squares of the residual, and of its part due to resistances that should be found anew. Returns the
    largest term of each.
    """
    particles, tops = system.particles, np.zeros((2, CHUNKS))
    for chunk in prange(CHUNKS):
        left, outdated = 0.0, 0.0
        for e in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            made = film_follows(e, system, length, step)
            left, outdated = greater(left, made[0]), greater(outdated, made[1])
        tops[0, chunk], tops[1, chunk] = left, outdated
    for i in prange(len(particles.radius)):
        change, along = at(particles.film_change, i), at(particles.film_along, i)
        put(particles.film_change, i, plus(change, times(length, along)))
        if SLIDES:
            turn, along = at(particles.film_turn, i), at(particles.film_turn_along, i)
            put(particles.film_turn, i, plus(turn, times(length, along)))
    return greatest(tops[0]), greatest(tops[1])


@inline
def scale_film(e, system, factor):
    """Multiply the impulse of film e."""
    memory = system.memory
    memory.joint_impulse[e] *= factor
    if SLIDES:
        push, couple = slip_and_roll_of(memory.joint_shear_impulse, e)
        put_slip_and_roll(memory.joint_shear_impulse, e, times(factor, push), times(factor, couple))


@part
def scale_impulses(system, count, factor):
    """Multiply all impulses, and what they do to the particles."""
    particles = system.particles
    for e in prange(count):
        scale_film(e, system, factor)
    for i in prange(len(particles.radius)):
        put(particles.film_change, i, times(factor, at(particles.film_change, i)))
        if SLIDES:
            put(particles.film_turn, i, times(factor, at(particles.film_turn, i)))


@inline
def keep_film(e, system):
    """Keep the impulse of the film of row e, and that of its bridge."""
    memory = system.memory
    k, normal, along, by_bridge = memory.joint_edge[e], at(memory.joint_normal, e), memory.joint_impulse[e], NOTHING
    if BRIDGE_RESISTS:
        taken, by_bridge = keep_bridge(e, k, normal, memory)
        along = along - taken if memory.joint_share[e] > 0.0 else 0.0
    if DRIFTING:
        put(memory.impulse, k, times(along, normal))
    if SHEAR:
        push, roll = slip_and_roll_of(memory.joint_shear_impulse, e)
        if BRIDGE_RESISTS:
            push = minus(push, by_bridge)
        first, second = couples(push, roll, normal, (memory.joint_arms[2 * e], memory.joint_arms[2 * e + 1]))
        put_impulses(k, memory.shear_impulse, push, first, second)


@part
def give_joint(system, count):
    """Give the particles the impulses found, and keep these."""
    particles = system.particles
    for e in prange(count):
        keep_film(e, system)
    for i in prange(particles.owned):
        put(particles.velocity, i, plus(at(particles.velocity, i), at(particles.film_change, i)))
        if SLIDES:
            put(particles.spin, i, plus(at(particles.spin, i), at(particles.film_turn, i)))
