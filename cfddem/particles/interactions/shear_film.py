"""Films that resist sliding, rolling and twisting: their resistance, and what they remember.

Slip s and rolling rate q of a pair meet the force K_ss s + K_sr q and the couple K_sr s + K_rr q. Their impulses follow
with those of the normal films (`cfddem.particles.interactions.joint_solution`).
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline
from cfddem.model.fields import Field
from cfddem.particles.interactions.kinematics import relative_velocity
from cfddem.particles.interactions.slots import SHEAR, TWIST, film_sliding
from cfddem.particles.vectors import LEAST, NOTHING, across, at, cross, dot, minus, plus, put, times
from closures.tangential_lubrication import (
    roll_resistance,
    shear_resistance,
    shear_roll_resistance,
    twist_resistance,
)

FIELDS = (
    Field("shear_resistance", "kg/s", role="memory", meaning="resistance of the film to sliding; 0 out of its reach"),
    Field("shear_couples", "N m s", 6, "scratch", meaning="angular impulses of a film by itself on both bodies"),
)
"""What pairs remember of the films between them that resist sliding."""

_1, _2, _3, _4 = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)

_MANTISSA = np.int64(52)
_ROOT_HALF = np.int64(0x3FE6A09E667F3BCD)
"""Bits of sqrt(1/2), where the mantissa of the logarithm begins."""


@inline
def logarithm(x):
    """ln x of a number above 0, to 1e-15, in arithmetic alone: loops work on several pairs at once."""
    bits = np.float64(x).view(np.int64)
    power = (bits - _ROOT_HALF) >> _MANTISSA
    mantissa = np.int64(bits - (power << _MANTISSA)).view(np.float64)
    t = (mantissa - 1.0) / (mantissa + 1.0)
    s = t * t
    series = 1.0 / 15.0 + s * (1.0 / 17.0 + s * (1.0 / 19.0 + s * (1.0 / 21.0)))
    series = 1.0 / 7.0 + s * (1.0 / 9.0 + s * (1.0 / 11.0 + s * (1.0 / 13.0 + s * series)))
    series = 1.0 + s * (1.0 / 3.0 + s * (1.0 / 5.0 + s * series))
    return power * 0.6931471805599453 + 2.0 * t * series


@inline
def edge_asymmetry(k, system):
    """Difference of the radii of edge k over their sum; -1 at a wall."""
    particles, edges = system.particles, system.edges
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        return (particles.radius[i] - particles.radius[j]) / (particles.radius[i] + particles.radius[j])
    return -1.0


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
    """Product of the symmetric matrix of an edge (of slip, of both, of roll, of twist) with slip and roll.

    Bridges alone resist neither rolling nor twisting: what rolls is nothing in their runs.
    """
    if not SHEAR:
        return times(blocks[0], slip), NOTHING
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
    if not SHEAR:
        return times(arms[0], turn), times(arms[1], turn)
    moment = cross(roll, normal)
    if TWIST:
        moment = plus(moment, times(dot(roll, normal), normal))
    return plus(times(arms[0], turn), moment), minus(times(arms[1], turn), moment)


@inline
def pair_arms(i, j, radius, gap):
    """Lever arms of slip of two spheres: they add up to the distance of the centres."""
    lever = (radius[i] + radius[j] + gap) / (radius[i] + radius[j])
    return lever * radius[i], lever * radius[j]


@inline
def motion_at_wall(k, normal, system):
    """Slip and roll of particle-wall edge k, and the lever arms of slip."""
    particles, edges, walls = system.particles, system.edges, system.walls
    i, arms = edges.first[k], (particles.radius[edges.first[k]], 0.0)
    slip, _ = slip_and_roll(relative_velocity(k, system), at(particles.spin, i), NOTHING, normal, arms)
    about = minus(at(particles.spin, i), at(walls.spin, walls.wall[edges.second[k]]))
    _, roll = slip_and_roll(NOTHING, about, NOTHING, normal, arms)
    return slip, roll, arms


@inline
def built_in_sliding(scale, gap, viscosity, reduced_radius, minimum_gap, asymmetry):
    """A share of the resistance to sliding by Jeffrey & Onishi; the gap is at least h_min."""
    # the smaller radius; at a wall, where the asymmetry is -1, that of the sphere
    smaller = 2.0 * reduced_radius / (1.0 + abs(asymmetry))
    return scale * max(logarithm(smaller / gap), 0.0) * shear_resistance(viscosity, reduced_radius, asymmetry)


@inline
def renew_shear(k, normal, film, motion, memory, step):
    """Resistance to sliding of the film of edge k, whose normal resistance is known, and what it does by itself.

    normal  direction from the second body to the first
    film    viscosity, R*, asymmetry, and the part that belongs to this edge: below 1 where triangles of a mesh share it
    motion  slip and roll, see `slip_and_roll`, and the lever arms of slip
    step    since the last positions; 0 if these are the same [s]
    """
    gap, minimum_gap = memory.film_gap[k], memory.minimum_gap[k]
    viscosity, reduced_radius, asymmetry, share = film
    lever = min(max(gap, 0.0) / minimum_gap, 1.0)
    before = memory.shear_resistance[k]
    resistance = film_sliding(share * lever, max(gap, minimum_gap), viscosity, reduced_radius, minimum_gap, asymmetry)
    resistance = resistance if memory.resistance[k] > 0.0 else 0.0
    memory.shear_resistance[k] = resistance
    # one that begins, or has been solved with the others, does nothing by itself
    resistance = resistance if before > 0.0 and not memory.film_solved[k] else 0.0
    both, rolling = sliding_ratios(reduced_radius, asymmetry)
    twist = twist_strength(gap, minimum_gap, resistance, viscosity, reduced_radius, asymmetry, share)
    factor = -step
    blocks = (factor * resistance, factor * resistance * both, factor * resistance * rolling, factor * twist)
    push, roll = by_blocks(blocks, motion[0], motion[1], normal)
    first, second = couples(push, roll, normal, motion[2])
    put(memory.film_push, k, plus(at(memory.film_push, k), push))
    put_two(memory.shear_couples, k, first, second)


@inline
def sliding_ratios(reduced_radius, asymmetry):
    """Resistances of slip and roll together, and to rolling, over the resistance to sliding [m, m2]."""
    per_slip = 1.0 / shear_resistance(1.0, reduced_radius, asymmetry)
    both = per_slip * shear_roll_resistance(1.0, reduced_radius, asymmetry)
    return both, per_slip * roll_resistance(1.0, reduced_radius)


@inline
def twist_strength(gap, minimum_gap, resistance, viscosity, reduced_radius, asymmetry, share):
    """Resistance to twisting; 0 where there is none to sliding.

    resistance  to sliding [kg/s]
    share       part of the film that belongs to this edge
    """
    lever = share * min(max(gap, 0.0) / minimum_gap, 1.0)
    whole = resistance / (shear_resistance(viscosity, reduced_radius, asymmetry) * max(lever, LEAST))
    strength = lever * twist_resistance(viscosity, max(gap, minimum_gap), reduced_radius, whole)
    return strength if resistance > 0.0 else 0.0


@inline
def slip_and_roll_of(array, e):
    """Slip and roll, or the impulses against them, in a row."""
    row = _2 * np.uint64(e)
    return at(array, row), at(array, row + _1) if SHEAR else NOTHING


@inline
def put_slip_and_roll(array, e, slip, roll):
    """Write what `slip_and_roll_of` reads."""
    row = _2 * np.uint64(e)
    put(array, row, slip)
    if SHEAR:
        put(array, row + _1, roll)


@inline
def four_of(array, e):
    """The four numbers of a row."""
    row = _4 * np.uint64(e)
    return array[row], array[row + _1], array[row + _2], array[row + _3]


@inline
def two(array, e):
    """The two vectors of a row."""
    row = _2 * np.uint64(e)
    return at(array, row), at(array, row + _1)


@inline
def put_two(array, e, a, b):
    """Write the two vectors of a row."""
    row = _2 * np.uint64(e)
    put(array, row, a)
    put(array, row + _1, b)


@inline
def put_impulses(k, array, impulse, first, second):
    """Write what the film of edge k does: impulse on the first body, angular impulses on the first and the second."""
    row = _3 * np.uint64(k)
    put(array, row, impulse)
    put(array, row + _1, first)
    put(array, row + _2, second)


@inline
def impulses_of(k, array):
    """What `put_impulses` has written."""
    row = _3 * np.uint64(k)
    return at(array, row), at(array, row + _1), at(array, row + _2)
