"""What two bodies do to each other: contact, friction and film, one edge at a time.

Each function reads as the physics of one pair, from geometry to force. The loops over all edges stand in
:mod:`cfddem.particles.motion`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cfddem.kernels import inline
from cfddem.particles.vectors import across, at, cross, dot, minus, plus, put, times
from closures.blend import contact_share
from closures.contact import (
    hertz_damping,
    hertz_force,
    hertz_stiffness,
    linear_damping,
    mindlin_stiffness,
    reduced,
)
from closures.friction import coulomb_limit, dry_or_lubricated
from closures.lubrication import film_resistance, film_strength, speed_after_film
from closures.minimum_gap import elastohydrodynamic

DRIFT, VERLET = 0, 1
FILM, OVERLAP = 0, 1
HERTZ, LINEAR = 0, 1
TOTAL, RESCALED = 0, 1
ROLLING = 3.5
"""How much easier the contact point of two solid spheres is moved along the surface than their centres apart."""

INTEGRATORS = {"drift": DRIFT, "verlet": VERLET}
FRICTION_ONSETS = {"film": FILM, "overlap": OVERLAP}
CONTACTS = {"hertz": HERTZ, "linear": LINEAR}
SPRINGS = {"total": TOTAL, "rescaled": RESCALED}


class Laws(NamedTuple):
    """Which laws hold between two bodies."""

    film: bool = False  # is there a film at all
    integrator: int = DRIFT  # how the film enters the motion
    friction_onset: int = FILM  # where friction starts: at h_min, or at geometric overlap
    contact: int = HERTZ
    spring: int = TOTAL  # tangential force from the total displacement, or rescaled while loading
    cutoff_ratio: float = 1.0  # h_co / R*
    normal_stiffness: float = 0.0  # of the linear contact [N/m]
    tangential_stiffness: float = 0.0  # of the linear contact [N/m]


@inline
def geometry(k, bodies, edges, walls):
    """Separation from the second body to the first, its length, and the gap."""
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        separation = minus(at(bodies.position, i), at(bodies.position, j))
        distance = math.sqrt(dot(separation, separation))
        return separation, distance, distance - bodies.radius[i] - bodies.radius[j]
    normal = at(walls.normal, j)
    distance = dot(minus(at(bodies.position, i), at(walls.point, j)), normal)
    return times(distance, normal), distance, distance - bodies.radius[i]


@inline
def reduced_properties(k, bodies, edges):
    """Reduced radius and mass of the pair; those of the particle itself against a wall."""
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        mass = 1.0 / (bodies.inverse_mass[i] + bodies.inverse_mass[j])
        return reduced(bodies.radius[i], bodies.radius[j]), mass
    return bodies.radius[i], 1.0 / bodies.inverse_mass[i]


@inline
def relative_velocity(k, bodies, edges, walls):
    """Velocity of the first body's centre against the second's."""
    i, j = edges.first[k], edges.second[k]
    other = at(bodies.velocity, j) if k < edges.between_particles else at(walls.velocity, j)
    return minus(at(bodies.velocity, i), other)


@inline
def swirl(k, bodies, edges, distance):
    """Sum of spin times lever arm; the levers of both bodies add up to the distance of the centres."""
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        stretch = distance / (bodies.radius[i] + bodies.radius[j])
        own = times(stretch * bodies.radius[i], at(bodies.spin, i))
        return plus(own, times(stretch * bodies.radius[j], at(bodies.spin, j))), stretch
    return times(distance, at(bodies.spin, i)), distance / bodies.radius[i]


@inline
def pair_row(k, bodies, edges, walls, table):
    """What the materials of this pair do to each other."""
    i, j = edges.first[k], edges.second[k]
    other = bodies.material[j] if k < edges.between_particles else walls.material[j]
    return table[bodies.material[i], other]


@inline
def pair_viscosity(k, bodies, edges):
    """Viscosity of the fluid in the gap."""
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        return 0.5 * (bodies.viscosity[i] + bodies.viscosity[j])
    return bodies.viscosity[i]


@inline
def encounter(k, edges, normal_speed, gap, viscosity, reduced_radius, row):
    """Remember the largest approach speed, and the minimum gap that belongs to it."""
    if -normal_speed > edges.approach_speed[k] and gap > edges.minimum_gap[k]:
        edges.approach_speed[k] = -normal_speed
        deformed = elastohydrodynamic(viscosity, -normal_speed, row.film_modulus, reduced_radius)
        edges.minimum_gap[k] = max(row.roughness_gap, deformed)


@inline
def meet(k, bodies, edges, walls, table, laws, free, step):
    """Force of edge k at the present positions: contact, friction, and the film if it acts as a force.

    The tangential spring moves with the half-step velocity in the tangent plane of half a step ago, and is
    then turned into the present one, so that positions, velocities and history belong to the same instant.
    """
    separation, distance, gap = geometry(k, bodies, edges, walls)
    put(edges.force, k, (0.0, 0.0, 0.0))
    put(edges.couple, k, (0.0, 0.0, 0.0))
    row = pair_row(k, bodies, edges, walls, table)
    if laws.film:
        reduced_radius, _ = reduced_properties(k, bodies, edges)
        cutoff_gap = laws.cutoff_ratio * reduced_radius
        if gap > cutoff_gap:
            edges.resistance[k] = 0.0
            edges.approach_speed[k] = 0.0
            edges.minimum_gap[k] = row.roughness_gap
            edges.accounted_gap[k] = gap
            return
        viscosity = pair_viscosity(k, bodies, edges)
        strength = film_strength(viscosity, reduced_radius)
        if laws.integrator == VERLET:
            normal = times(1.0 / distance, separation)
            normal_speed = dot(relative_velocity(k, bodies, edges, walls), normal)
            encounter(k, edges, normal_speed, gap, viscosity, reduced_radius, row)
            resistance = film_resistance(strength, gap, edges.minimum_gap[k], cutoff_gap)
            put(edges.force, k, times(-resistance * normal_speed, normal))
        elif edges.accounted_gap[k] == np.inf:
            edges.accounted_gap[k] = gap
            edges.minimum_gap[k] = max(row.roughness_gap, edges.minimum_gap[k])
        edges.resistance[k] = strength / max(gap, edges.minimum_gap[k])
    if gap < edges.minimum_gap[k]:
        touch(k, bodies, edges, walls, row, laws, free, step, separation, distance, gap)
    else:
        put(edges.spring, k, (0.0, 0.0, 0.0))


@inline
def touch(k, bodies, edges, walls, row, laws, free, step, separation, distance, gap):
    """Add the solid contact of edge k to its force: Hertz and dashpot, Mindlin and Coulomb, times its lever."""
    reduced_radius, reduced_mass = reduced_properties(k, bodies, edges)
    overlap = edges.minimum_gap[k] - gap
    share = contact_share(gap, edges.minimum_gap[k])
    normal = times(1.0 / distance, separation)
    velocity = relative_velocity(k, bodies, edges, walls)
    normal_speed = dot(velocity, normal)

    if laws.contact == HERTZ:
        stiffness = hertz_stiffness(row.contact_modulus, reduced_radius)
        elastic = hertz_force(stiffness, overlap)
        damping = hertz_damping(row.damping_ratio, reduced_mass, stiffness, overlap)
        tangential_stiffness = mindlin_stiffness(row.shear_modulus, reduced_radius, overlap)
    else:
        elastic = laws.normal_stiffness * overlap
        damping = linear_damping(row.restitution, reduced_mass, laws.normal_stiffness)
        tangential_stiffness = laws.tangential_stiffness
    # the dashpot acts on the speed at the middle of the kick, which it changes itself
    kick = 0.5 * step / reduced_mass * share
    mid_speed = (normal_speed + kick * elastic) / (1.0 + kick * damping)
    normal_force = elastic - damping * mid_speed
    force = times(share * normal_force, normal)

    if laws.friction_onset == FILM or gap < 0.0:
        swirling, stretch = swirl(k, bodies, edges, distance)
        friction = dry_or_lubricated(edges.minimum_gap[k], row.roughness_gap, row.friction, row.friction_lubricated)
        moved = (free[0] * velocity[0], free[1] * velocity[1], free[2] * velocity[2])
        halfway = minus(separation, times(0.5 * step, moved)) if k < edges.between_particles else separation
        halfway = times(1.0 / math.sqrt(dot(halfway, halfway)), halfway)
        slip = minus(across(velocity, halfway), cross(swirling, halfway))
        spring = at(edges.spring, k)
        before = overlap + step * normal_speed
        if laws.spring == RESCALED and before < overlap:
            spring = times(math.sqrt(max(before, 0.0) / overlap), spring)
        # in its first step a contact slides only from where friction sets in
        since = gap if laws.friction_onset == OVERLAP else -overlap
        portion = min(1.0, since / (step * normal_speed)) if step * normal_speed < since else 1.0
        spring = across(plus(spring, times(portion * step, slip)), normal)
        slip = across(slip, normal)
        mid_slip = minus(slip, times(ROLLING * kick * tangential_stiffness, spring))
        mid_slip = times(1.0 / (1.0 + ROLLING * kick * damping), mid_slip)
        pull = plus(times(tangential_stiffness, spring), times(damping, mid_slip))
        size = math.sqrt(dot(pull, pull))
        limit = coulomb_limit(friction, normal_force)
        if size > limit:
            pull = times(limit / size, pull)
            spring = times(1.0 / tangential_stiffness, minus(pull, times(damping, slip)))
        put(edges.spring, k, spring)
        force = minus(force, times(share, pull))
        put(edges.couple, k, times(share * stretch, cross(normal, pull)))
    else:
        put(edges.spring, k, (0.0, 0.0, 0.0))
    put(edges.force, k, plus(at(edges.force, k), force))


@inline
def squeeze(k, bodies, edges, walls, table, laws, step):
    """Impulse of the film of edge k over the coming step.

    Each body gives this film the part of its mass that the film has in the body's total resistance. The
    pair so made is solved exactly; the sum over all films conserves momentum and never raises energy.
    """
    if edges.resistance[k] == 0.0:
        put(edges.impulse, k, (0.0, 0.0, 0.0))
        return
    i, j = edges.first[k], edges.second[k]
    separation, distance, gap = geometry(k, bodies, edges, walls)
    normal = times(1.0 / distance, separation)
    normal_speed = dot(relative_velocity(k, bodies, edges, walls), normal)
    reduced_radius, _ = reduced_properties(k, bodies, edges)
    viscosity = pair_viscosity(k, bodies, edges)
    row = pair_row(k, bodies, edges, walls, table)
    encounter(k, edges, normal_speed, gap, viscosity, reduced_radius, row)

    inverse_mass = bodies.inverse_mass[i] * bodies.resistance[i] / edges.resistance[k]
    if k < edges.between_particles:
        inverse_mass += bodies.inverse_mass[j] * bodies.resistance[j] / edges.resistance[k]
    new_speed = speed_after_film(
        normal_speed,
        gap,
        edges.accounted_gap[k],
        step,
        film_strength(viscosity, reduced_radius) * inverse_mass,
        edges.minimum_gap[k],
        laws.cutoff_ratio * reduced_radius,
    )
    edges.accounted_gap[k] = gap + step * new_speed
    put(edges.impulse, k, times((new_speed - normal_speed) / inverse_mass, normal))
