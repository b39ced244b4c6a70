"""Films that are solved together on a graphics processor.

The phases of :func:`cfddem.particles.interactions.joint_solution.film_kick`, by its functions of one film and of one
particle: one thread a film, one thread a particle, and all wait for one another where a phase reads what others have
written. Here each edge has its own row of the equations, also where its film is not solved with the others. The order
of the rows does not matter: sums over all films are sums of integers.
"""

from __future__ import annotations

import math

from cfddem.backend.gpu import greatest_of_all, helper, sum_of_all
from cfddem.particles.interactions.joint_equations import film_residual, greater, impulses_on, prepare_film
from cfddem.particles.interactions.joint_films import enter, is_due, leave
from cfddem.particles.interactions.joint_solution import (
    MOST_ITERATIONS,
    PASSES,
    best_factor,
    film_direction,
    film_follows,
    film_product,
    keep_film,
    particle_follows,
    scale_film,
    scale_of,
    scale_particle,
    settled,
    take_impulses,
    whole_units,
)
from cfddem.particles.interactions.slots import SLIDES
from cfddem.particles.vectors import put, times

LEFT, WHOLE, BY_WANTED, BY_RESIDUAL, PRODUCT, FOLLOWED, OUTDATED, COUNT = range(8)
"""Place of each sum in the memory of all blocks."""

PLACES = 8
"""Number of these."""


@helper
def solve_films(system, step, threads):
    """Give the particles the impulses of all films over the coming step."""
    edges, memory, particles, grid = system.edges, system.memory, system.particles, threads.grid
    mine, number, rows, bodies = threads.mine, threads.number, len(edges.first), len(particles.radius)
    listed = 0
    for e in range(mine, rows, number):
        if is_due(e, memory):
            enter(e, e, system)
            prepare_film(e, system, step)
            listed += 1
        else:
            leave(e, system)
    count = sum_of_all(listed, COUNT, threads)
    if count == 0:
        return
    _spread(False, system, threads)
    iterations, passes, tolerance = 0, 0, system.parameters.film_tolerance
    while passes < PASSES:
        grid.sync()
        left, whole, by_wanted, by_residual = _residual(True, count, system, step, threads)
        if by_wanted + by_residual < 0.0:  # these impulses could add energy; a part of them takes the most
            factor = best_factor(by_wanted, by_residual)
            for e in range(mine, rows, number):
                if is_due(e, memory):
                    scale_film(e, system, factor)
            for i in range(mine, bodies, number):
                scale_particle(i, particles, factor)
            grid.sync()
            left, whole, by_wanted, by_residual = _residual(False, count, system, step, threads)
        limit = tolerance * tolerance * whole
        if settled(left, whole, limit, passes):
            break
        passes += 1
        share, outdated = 0.0, 0.0
        for _ in range(MOST_ITERATIONS):
            if share > 0.0:
                for e in range(mine, rows, number):
                    if is_due(e, memory):
                        film_direction(e, system, share)
                grid.sync()
            _spread(True, system, threads)
            grid.sync()
            length = left / _product(count, system, threads)
            before = left
            left, outdated = _follow(length, count, system, step, threads)
            iterations += 1
            share = left / before
            if not left > limit:
                break
        if not _total(1, outdated, OUTDATED, count, system, threads) > limit:
            break
    for e in range(mine, rows, number):
        if is_due(e, memory):
            keep_film(e, system)
    for i in range(mine, bodies, number):
        take_impulses(i, particles)
    if mine == 0:
        system.film_counts[0] += 1.0
        system.film_counts[1] += iterations
        system.film_counts[2] += passes
        system.film_counts[3] += count


@helper
def _spread(direction, system, threads):
    """See `spread`."""
    particles, memory = system.particles, system.memory
    impulse = memory.joint_direction if direction else memory.joint_impulse
    change = particles.film_along if direction else particles.film_change
    shear_impulse, turn = impulse, change
    if SLIDES:
        shear_impulse = memory.joint_shear_direction if direction else memory.joint_shear_impulse
        turn = particles.film_turn_along if direction else particles.film_turn
    for i in range(threads.mine, len(particles.radius), threads.number):
        total, couple = impulses_on(i, impulse, shear_impulse, system)
        put(change, i, times(particles.inverse_mass[i], total))
        if SLIDES:
            put(turn, i, times(particles.inverse_inertia[i], couple))


@helper
def _residual(renew, count, system, step, threads):
    """Resistances, if they are to be found anew, residuals, and four sums; see `find_residual`."""
    left, whole, by_wanted, by_residual = 0.0, 0.0, 0.0, 0.0
    for e in range(threads.mine, len(system.edges.first), threads.number):
        if is_due(e, system.memory):
            sums = film_residual(e, system, step, renew)
            left, whole = greater(left, sums[0]), greater(whole, sums[1])
            by_wanted, by_residual = greater(by_wanted, sums[2]), greater(by_residual, sums[3])
    return (
        _total(0, left, LEFT, count, system, threads),
        _total(1, whole, WHOLE, count, system, threads),
        _total(2, by_wanted, BY_WANTED, count, system, threads),
        _total(3, by_residual, BY_RESIDUAL, count, system, threads),
    )


@helper
def _product(count, system, threads):
    """Product of the direction with the matrix and itself."""
    top = 0.0
    for e in range(threads.mine, len(system.edges.first), threads.number):
        if is_due(e, system.memory):
            top = greater(top, film_product(e, system))
    return _total(0, top, PRODUCT, count, system, threads)


@helper
def _follow(length, count, system, step, threads):
    """See `follow_direction`; returns the sum of squares of the residual, and this thread's largest outdated term."""
    left, outdated = 0.0, 0.0
    for e in range(threads.mine, len(system.edges.first), threads.number):
        if is_due(e, system.memory):
            sums = film_follows(e, system, length, step)
            left, outdated = greater(left, sums[0]), greater(outdated, sums[1])
    for i in range(threads.mine, len(system.particles.radius), threads.number):
        particle_follows(i, system.particles, length)
    return _total(0, left, FOLLOWED, count, system, threads), outdated


@helper
def _total(column, top, place, count, system, threads):
    """Sum of one of the four terms of all films; see `total_of`.

    top    largest absolute value of the terms of this thread
    place  of the sum in the memory of all blocks
    """
    largest = greatest_of_all(top, place, threads)
    if not 0.0 < largest < math.inf:
        return largest
    power, whole = scale_of(largest, count), 0
    rows, scale = len(system.edges.first), math.ldexp(1.0, power)
    for e in range(threads.mine, rows, threads.number):
        if is_due(e, system.memory):
            whole += whole_units(scale * system.memory.joint_terms[column * rows + e])
    return math.ldexp(float(sum_of_all(whole, place, threads)), -power)
