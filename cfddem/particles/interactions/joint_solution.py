"""The impulses of all films and bridges over a step, solved together.

Films and bridges of a body act on each other through its motion. Their impulses J follow from one system of equations,

    (C^-1/dt + G M^-1 G^T) J = -G v + C^-1/dt J_d,        v' = v + M^-1 G^T J

with the velocities v after the half kick and v' after the films; G, which takes velocities to the rates at which the
bodies of a film approach, slide and roll; the inverse masses M^-1, zero for walls and bodies that are held; and the
resistances C. The normal film is nonlinear: its resistance is the mean over its way in this step, which its closed
form gives for the motion that all other films leave to the pair. J_d is what a film that begins has missed on its way
from its cut-off gap.

Preconditioned conjugate gradients start from the impulses of the last step. Each iterate consists of impulses of
pairs, so momentum stays to round-off, and energy falls with every iterate, however early the iteration ends. Where
spheres pass each other, the rate at which they part in the step adds a term of second order in the step, which can
raise the energy of a row of spheres by that order. Films with a damping number X = c dt (1/m1 + 1/m2) below `WEAK`
stay outside: they act by themselves, at the end of the step. So do closed bridges that are not stiff, as forces
(`cfddem.particles.interactions.bridge_apart`).

A loop over particles sums what the films of each do to it, in a fixed order, and a loop over films finds the rates.
Sums over all films are sums of integers (`scale_of`): they have the same bits in any order, on any number of threads.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, part, prange, serial
from cfddem.particles.interactions.joint_equations import (
    find_residual,
    greater,
    greatest,
    keep_bridge,
    own,
    prepare,
    rates_of,
    spread,
)
from cfddem.particles.interactions.joint_films import collect
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

PASSES = 3
"""Most times that the resistances of a step are found anew."""

MOST_ITERATIONS = 400
"""Of one pass; energy falls also where the iteration ends here."""

SETTLED = 1e-14
"""Square of the first residual over that without impulses below which the impulses of the last step stay. It is small
because what a step leaves is left in the same direction by the next: a pair that slows down would stop too late."""

RENEWED = 4.0
"""Square of the residual with resistances found anew, over that of the tolerance, below which no pass is needed."""

LOST = 1e-9
"""Part of one sum of two below which their difference is lost in rounding."""


# ---------------------------------------------------------------- sums with the same bits in any order


@inline
def scale_of(largest, number):
    """Number of units of a sum of `number` terms in 1, a power of two: no sum of so many integers is too large.

    largest  absolute value of all terms, above 0
    """
    _, power = math.frexp(largest)
    _, digits = math.frexp(float(number))
    return min(61 - digits - power, 1000)


@inline
def whole_units(term):
    """A term of a sum, in units, as an integer."""
    return np.int64(round(term))


@inline
def best_factor(by_wanted, by_residual):
    """Factor at which the impulses of the last step take the most energy; 0 where rounding hides it.

    by_wanted, by_residual  impulses times the right-hand side, and times the residual
    """
    square = by_wanted - by_residual
    return by_wanted / square if square > LOST * abs(by_wanted) else 0.0


@inline
def settled(left, whole, limit, passes):
    """Whether impulses need no iterations with the resistances as they are.

    left, whole  squares of the residual, and of that without impulses
    limit        square of the tolerance times `whole`
    passes       made so far
    """
    return not left > (RENEWED * limit if passes > 0 else min(limit, SETTLED * whole))


@part
def sum_of_terms(system, count, column, power):
    """Sum of one of the four terms of all films, in units of 2^-power, each rounded to a whole number of them."""
    terms, sums, total, begin = (
        system.memory.joint_terms,
        np.zeros(CHUNKS, np.int64),
        0,
        column * len(system.edges.first),
    )
    scale = math.ldexp(1.0, power)
    for chunk in prange(CHUNKS):
        whole = 0
        for e in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            whole += whole_units(scale * terms[begin + e])
        sums[chunk] = whole
    for chunk in range(CHUNKS):
        total += sums[chunk]
    return total


# ---------------------------------------------------------------- phases of the solution, each before a halo or a sum


@serial
def start_films(system):
    """List the films that are solved; returns their number, and that of those that are counted here."""
    count, owned = collect(system), 0
    for e in range(count):  # the rows of the equations are not made yet
        owned += 1 if system.edges.first[system.memory.joint_edge[e]] < system.particles.owned else 0
    return count, owned


@serial
def begin_solution(system, count, step):
    """The equations, and what the impulses of the last step do to the particles."""
    prepare(system, count, step)
    spread(system, False)


@serial
def new_residual(system, count, step, renew):
    """See `find_residual`."""
    return find_residual(system, count, step, renew)


@serial
def new_scale(system, count, factor):
    """See `scale_impulses`."""
    scale_impulses(system, count, factor)


@serial
def new_direction(system, count, share):
    """A new direction, and what it does to the particles.

    share  of the last direction; 0 for the preconditioned residual, which is there
    """
    if share > 0.0:
        find_direction(system, count, share)
    spread(system, True)


@serial
def new_product(system, count):
    """See `find_product`."""
    return find_product(system, count)


@serial
def along_direction(system, count, length, step):
    """See `follow_direction`."""
    return follow_direction(system, count, length, step)


@serial
def finish_solution(system, count):
    """See `give_joint`."""
    give_joint(system, count)


@serial
def units_of(system, count, column, power):
    """See `sum_of_terms`."""
    return sum_of_terms(system, count, column, power)


@serial
def total_of(system, count, number, column, largest):
    """Sum of one of the four terms of all films.

    number   of the films of all ranks
    largest  absolute value of these terms
    """
    if not 0.0 < largest < math.inf:
        return largest
    power = scale_of(largest, number)
    return math.ldexp(float(units_of(system, count, column, power)), -power)


@inline
def of_all_ranks(number):
    """Sum of a number over the ranks that share the particles; one process has all."""
    return number


@serial
def film_kick(system, step):
    """Give the particles the impulses of all films over the coming step.

    Where several ranks share the particles, :func:`cfddem.particles.ghosts.films_with_ghosts` gives this loop other
    functions of the same names.
    """
    count, owned = start_films(system)
    number = of_all_ranks(owned)
    if number == 0:
        return
    tolerance = system.parameters.film_tolerance
    begin_solution(system, count, step)
    iterations, passes = 0, 0
    while passes < PASSES:
        largest = new_residual(system, count, step, True)
        by_wanted = total_of(system, count, number, 2, largest[2])
        by_residual = total_of(system, count, number, 3, largest[3])
        if by_wanted + by_residual < 0.0:  # these impulses could add energy; a part of them takes the most
            new_scale(system, count, best_factor(by_wanted, by_residual))
            largest = new_residual(system, count, step, False)
        left = total_of(system, count, number, 0, largest[0])
        whole = total_of(system, count, number, 1, largest[1])
        limit = tolerance * tolerance * whole
        if settled(left, whole, limit, passes):
            break
        passes += 1
        share, top = 0.0, (0.0, 0.0)
        for _ in range(MOST_ITERATIONS):
            new_direction(system, count, share)
            product = total_of(system, count, number, 0, new_product(system, count))
            top = along_direction(system, count, left / product, step)
            before, left = left, total_of(system, count, number, 0, top[0])
            iterations += 1
            share = left / before
            if not left > limit:
                break
        if not total_of(system, count, number, 1, top[1]) > limit:
            break
    finish_solution(system, count)
    counts = system.film_counts
    counts[0] += 1.0
    counts[1] += iterations
    counts[2] += passes
    counts[3] += owned


# ---------------------------------------------------------------- an iteration
#
# What an iteration of films that are solved together does to each film.
#
# See `cfddem.particles.interactions.joint_solution`.


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


@inline
def particle_follows(i, particles, length):
    """What the new impulses do to particle i."""
    change, along = at(particles.film_change, i), at(particles.film_along, i)
    put(particles.film_change, i, plus(change, times(length, along)))
    if SLIDES:
        turn, along = at(particles.film_turn, i), at(particles.film_turn_along, i)
        put(particles.film_turn, i, plus(turn, times(length, along)))


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
            sums = film_follows(e, system, length, step)
            left, outdated = greater(left, sums[0]), greater(outdated, sums[1])
        tops[0, chunk], tops[1, chunk] = left, outdated
    for i in prange(len(particles.radius)):
        particle_follows(i, particles, length)
    return greatest(tops[0]), greatest(tops[1])


@inline
def scale_film(e, system, factor):
    """Multiply the impulse of film e."""
    memory = system.memory
    memory.joint_impulse[e] *= factor
    if SLIDES:
        push, couple = slip_and_roll_of(memory.joint_shear_impulse, e)
        put_slip_and_roll(memory.joint_shear_impulse, e, times(factor, push), times(factor, couple))


@inline
def scale_particle(i, particles, factor):
    """Multiply what the impulses do to particle i."""
    put(particles.film_change, i, times(factor, at(particles.film_change, i)))
    if SLIDES:
        put(particles.film_turn, i, times(factor, at(particles.film_turn, i)))


@part
def scale_impulses(system, count, factor):
    """Multiply all impulses, and what they do to the particles."""
    particles = system.particles
    for e in prange(count):
        scale_film(e, system, factor)
    for i in prange(len(particles.radius)):
        scale_particle(i, particles, factor)


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


@inline
def take_impulses(i, particles):
    """Give particle i the impulses found."""
    put(particles.velocity, i, plus(at(particles.velocity, i), at(particles.film_change, i)))
    if SLIDES:
        put(particles.spin, i, plus(at(particles.spin, i), at(particles.film_turn, i)))


@part
def give_joint(system, count):
    """Give the particles the impulses found, and keep these."""
    particles = system.particles
    for e in prange(count):
        keep_film(e, system)
    for i in prange(particles.owned):
        take_impulses(i, particles)
