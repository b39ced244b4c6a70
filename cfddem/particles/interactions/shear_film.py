"""Films that resist sliding, rolling and twisting: resistance, and impulses over a step.

Each body gives each of its films the part of its mass and inertia that the film has in the body's total resistance to
sliding. The pair so made is solved for a fixed gap. Slip s and rolling rate q of the pair obey y' = -B K y, where B is
the inverse inertia and K the resistance, both positive definite. The step takes exp(-X), X = B K dt, as
1/(1 + X + X^2/2): second order, and for any X no mode of motion grows or turns round. A sum over all films of
a body is a mean over parts of its mass, so the energy of all particles never grows.

Impulses act on the bodies before those of normal films, from the velocities after the kick.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline, part, prange, serial
from cfddem.data.fields import Field
from cfddem.particles.interactions.kinematics import relative_velocity
from cfddem.particles.interactions.slots import TWIST, shear_impulses
from cfddem.particles.pair_graph import edge_role, geometry, places_of
from cfddem.particles.vectors import LEAST, NOTHING, across, at, cross, dot, minus, plus, put, times
from cfddem.particles.walls.nearest_point import portion
from closures.tangential_lubrication import (
    roll_resistance,
    shear_resistance,
    shear_roll_resistance,
    twist_resistance,
)

PARTICLE_FIELDS = (
    Field("slip_rate", "1/s", halo=("shear",), meaning="resistance of all films to sliding over the mass"),
    Field("turn_rate", "1/(s m2)", halo=("shear",), meaning="resistance of all films to sliding over the inertia"),
)
"""Fields of particles whose films resist sliding."""

FIELDS = (
    Field("shear_resistance", "kg/s", role="memory", meaning="resistance of the film to sliding; 0 out of its reach"),
    Field(
        "shear_impulse",
        "1",
        9,
        "scratch",
        meaning="impulse of the film against sliding, on the first body [N s]; its angular impulses on the first and "
        "on the second body [N m s]",
    ),
)
"""What pairs remember of the films between them that resist sliding."""

_1, _2, _3 = np.uint64(1), np.uint64(2), np.uint64(3)

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
def renew_shear(k, gap, viscosity, reduced_radius, asymmetry, share, memory):
    """Resistance to sliding of the film of edge k, whose normal resistance is known.

    share  part of the film that belongs to this edge: below 1 where triangles of a mesh share one
    """
    # the smaller radius; at a wall, where the asymmetry is -1, that of the sphere
    smaller = 2.0 * reduced_radius / (1.0 + abs(asymmetry))
    minimum_gap = memory.minimum_gap[k]
    lever = min(max(gap, 0.0) / minimum_gap, 1.0)
    size = max(logarithm(smaller / max(gap, minimum_gap)), 0.0)
    resistance = share * lever * size * shear_resistance(viscosity, reduced_radius, asymmetry)
    memory.shear_resistance[k] = resistance if memory.resistance[k] > 0.0 else 0.0


@inline
def impulse_factors(rates, reduced_radius, asymmetry, step):
    """Impulses of one pair over a step, over its resistance to sliding: by slip, by both, and by roll.

    The impulse is slip times the first and roll times the second; the couple is slip times the second and roll times
    the third.

    rates  entries of B times the resistance: of slip by force, of slip by couple, of roll by couple; determinant
    """
    b_ss, b_sr, b_rr, b_det = rates
    per_slip = 1.0 / shear_resistance(1.0, reduced_radius, asymmetry)
    k_sr = per_slip * shear_roll_resistance(1.0, reduced_radius, asymmetry)
    k_rr = per_slip * roll_resistance(1.0, reduced_radius)
    k_det = step * (k_rr - k_sr * k_sr)
    # trace and determinant of X; by the theorem of Cayley and Hamilton, in terms that are all positive
    trace, product = step * (b_ss + 2.0 * b_sr * k_sr + b_rr * k_rr), step * b_det * k_det
    scale = -step / (1.0 + trace + 0.5 * trace * trace + product * (0.5 * trace + 0.25 * product))
    own, crossed = scale * (1.0 + 0.5 * trace), scale * k_det * (0.5 + 0.5 * trace + 0.25 * product)
    return own + crossed * b_rr, own * k_sr - crossed * b_sr, own * k_rr + crossed * b_ss


@inline
def damped(slip, roll, resistance, rates, reduced_radius, asymmetry, step):
    """Impulse against sliding, and angular impulse against rolling, of one pair over a step.

    slip, roll  of the surfaces [m/s], and difference of the angular velocities times the normal [rad/s]
    resistance  to sliding [kg/s]
    rates       as of `impulse_factors`
    """
    by_slip, by_both, by_roll = impulse_factors(rates, reduced_radius, asymmetry, step)
    impulse = plus(times(resistance * by_slip, slip), times(resistance * by_both, roll))
    return impulse, plus(times(resistance * by_both, slip), times(resistance * by_roll, roll))


@inline
def twisted(twist, gap, minimum_gap, resistance, viscosity, inertia_rate, reduced_radius, asymmetry, share, step):
    """Angular impulse against twisting of one pair over a step.

    twist         rate [rad/s]
    resistance    to sliding [kg/s]
    inertia_rate  sum of the inverse inertias that both bodies give to the film, times the resistance [1/(s m2)]
    """
    lever = share * min(max(gap, 0.0) / minimum_gap, 1.0)
    whole = resistance / (shear_resistance(viscosity, reduced_radius, asymmetry) * max(lever, LEAST))
    strength = step * lever * twist_resistance(viscosity, max(gap, minimum_gap), reduced_radius, whole)
    x = inertia_rate / max(resistance, LEAST) * strength
    return -strength * (1.0 + 0.5 * x) / (1.0 + x + 0.5 * x * x) * twist if resistance > 0.0 else 0.0


@inline
def write_impulse(k, memory, impulse, first, second):
    """Write what the film of edge k does in this step: impulse, and angular impulses on the first and second body."""
    row = _3 * np.uint64(k)
    put(memory.shear_impulse, row, impulse)
    put(memory.shear_impulse, row + _1, first)
    put(memory.shear_impulse, row + _2, second)


@inline
def impulses_of(k, memory):
    """What `write_impulse` has written."""
    row = _3 * np.uint64(k)
    return at(memory.shear_impulse, row), at(memory.shear_impulse, row + _1), at(memory.shear_impulse, row + _2)


@inline
def pair_shear(n, system, step):
    """Impulses of the film of one pair of particles that slides and rolls; zero out of its reach."""
    particles, edges, memory = system.particles, system.edges, system.memory
    k = np.uint64(n)
    i, j = edges.first[k], edges.second[k]
    radius, spin, resistance = particles.radius, at(particles.spin, i), memory.shear_resistance[k]
    normal, gap, radii = at(memory.film_normal, k), memory.film_gap[k], radius[i] + radius[j]
    distance, inverse_sum = radii + gap, 1.0 / radii
    lever = distance * inverse_sum
    reduced_radius = radius[i] * radius[j] * inverse_sum
    asymmetry = (radius[i] - radius[j]) * inverse_sum

    other = at(particles.spin, j)
    velocity = minus(at(particles.velocity, i), at(particles.velocity, j))
    turning = plus(times(radius[i], spin), times(radius[j], other))
    slip = minus(across(velocity, normal), times(lever, cross(turning, normal)))
    spin = minus(spin, other)

    rate = particles.slip_rate[i] + particles.slip_rate[j]
    turn_i, turn_j = particles.turn_rate[i], particles.turn_rate[j]
    arm_i, arm_j = lever * radius[i], lever * radius[j]
    rates = (
        rate + arm_i * arm_i * turn_i + arm_j * arm_j * turn_j,
        arm_i * turn_i - arm_j * turn_j,
        turn_i + turn_j,
        rate * (turn_i + turn_j) + distance * distance * turn_i * turn_j,
    )
    impulse, couple = damped(slip, cross(normal, spin), resistance, rates, reduced_radius, asymmetry, step)
    moment = cross(couple, normal)
    if TWIST:
        viscosity = 0.5 * (particles.viscosity[i] + particles.viscosity[j])
        size = twisted(
            dot(spin, normal), gap, memory.minimum_gap[k], resistance, viscosity, turn_i + turn_j, reduced_radius,
            asymmetry, 1.0, step,
        )  # fmt: skip
        moment = plus(moment, times(size, normal))
    couple = times(lever, cross(impulse, normal))
    first, second = plus(times(radius[i], couple), moment), minus(times(radius[j], couple), moment)
    write_impulse(k, memory, impulse, first, second)


@inline
def wall_shear(k, system, step):
    """Impulses of the film of particle-wall edge k, which slides and rolls."""
    particles, edges, memory, walls = system.particles, system.edges, system.memory, system.walls
    i = edges.first[k]
    resistance = memory.shear_resistance[k]
    if resistance == 0.0:
        write_impulse(k, memory, NOTHING, NOTHING, NOTHING)
        return
    radius, spin = particles.radius[i], at(particles.spin, i)
    separation, distance, gap = geometry(k, system)
    normal = times(1.0 / distance, separation)
    slip = minus(across(relative_velocity(k, system), normal), times(radius, cross(spin, normal)))
    spin = minus(spin, at(walls.spin, walls.wall[edges.second[k]]))
    rate, turn = particles.slip_rate[i], particles.turn_rate[i]
    rates = (rate + radius * radius * turn, radius * turn, turn, rate * turn)
    impulse, couple = damped(slip, cross(normal, spin), resistance, rates, radius, -1.0, step)
    moment = cross(couple, normal)
    if TWIST:
        size = twisted(
            dot(spin, normal), gap, memory.minimum_gap[k], resistance, particles.viscosity[i], turn, radius, -1.0,
            portion(edges, k), step,
        )  # fmt: skip
        moment = plus(moment, times(size, normal))
    first = plus(times(radius, cross(impulse, normal)), moment)
    write_impulse(k, memory, impulse, first, minus(NOTHING, moment))


@part
def find_wall_shear(system, step):
    """Impulses against sliding and rolling of all films at walls."""
    edges = system.edges
    for k in prange(edges.between_particles, len(edges.first)):
        wall_shear(k, system, step)


@part
def apply_shear_impulses(system):
    """Give every particle the impulses of its films against sliding and rolling."""
    particles, edges, memory = system.particles, system.edges, system.memory
    for i in prange(particles.owned):
        impulse, couple = NOTHING, NOTHING
        for place in places_of(i, edges):
            k, sign = edge_role(edges.incident[place])
            row = _3 * k
            impulse = plus(impulse, times(sign, at(memory.shear_impulse, row)))
            couple = plus(couple, at(memory.shear_impulse, row + (_1 if sign > 0.0 else _2)))
        gain = times(particles.inverse_mass[i], impulse)
        put(particles.velocity, i, plus(at(particles.velocity, i), gain))
        gain = times(particles.inverse_inertia[i], couple)
        put(particles.spin, i, plus(at(particles.spin, i), gain))


@serial
def shear_kick(system, step):
    """Give the particles the impulses of their films against sliding, rolling and twisting."""
    edges = system.edges
    shear_impulses(0, edges.between_particles, system, step)
    find_wall_shear(system, step)
    apply_shear_impulses(system)
