"""What two bodies do to each other: contact and friction, and the film.

The contact of a pair is a function of numbers alone, without arrays and without branches, so that the loop
that calls it runs on several pairs at once. The film remembers its encounter and works on its edge.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from cfddem.kernels import inline
from cfddem.particles.pairs import geometry
from cfddem.particles.surfaces import SURFACE, portion, touched
from cfddem.particles.vectors import across, at, cross, dot, either, minus, plus, put, times
from closures.blend import contact_share
from closures.contact import (
    hertz_damping,
    hertz_force,
    hertz_stiffness,
    linear_damping,
    mindlin_stiffness,
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

NOTHING = (0.0, 0.0, 0.0)
_LEAST = 1e-300  # keeps divisions of pairs that do not touch finite; their results are dropped


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

    def without_the_absent(self) -> Laws:
        """The same laws with each choice that is not made as None, which a loop compiled for it leaves out."""
        choices = ("film", "integrator", "friction_onset", "contact", "spring")
        absent: dict[str, Any] = {name: None for name in choices if not getattr(self, name)}
        return self._replace(**absent)


class Meeting(NamedTuple):
    """Two bodies at one instant, seen from the first."""

    separation: tuple[float, float, float]  # from the second body to the first [m]
    distance: float  # of the centres, or from a wall [m]
    gap: float  # [m]
    velocity: tuple[float, float, float]  # of the first centre against the second [m/s]
    surface_spin: tuple[float, float, float]  # sum of spin times radius [m/s]
    reduced_radius: float  # R* [m]
    inverse_sum: float  # 1 / (R_i + R_j); 1 / R_i at a wall [1/m]
    inverse_mass: float  # 1 / m* [1/kg]
    turn: tuple[float, float, float]  # rate at which motion turns the normal [1/s]


@inline
def contact(meeting, rows, which, minimum_gap, spring, laws, step):
    """Force on the first body, couple per radius on both, and the tangential spring afterwards.

    Hertz and dashpot, Mindlin and Coulomb, times the share that the solids have in the load. The spring moves
    with the half-step velocity in the tangent plane of half a step ago, and is then turned into the present
    one, so that positions, velocities and history belong to the same instant.
    """
    row = rows[which]
    touching = meeting.gap < minimum_gap
    overlap = max(minimum_gap - meeting.gap, _LEAST)
    share = contact_share(meeting.gap, minimum_gap) if laws.film else 1.0
    normal = times(1.0 / meeting.distance, meeting.separation)
    normal_speed = dot(meeting.velocity, normal)

    reduced_mass = 1.0 / meeting.inverse_mass
    hertz = laws.contact != LINEAR
    stiffness = hertz_stiffness(row.contact_modulus, meeting.reduced_radius)
    elastic = hertz_force(stiffness, overlap) if hertz else laws.normal_stiffness * overlap
    damping = (
        hertz_damping(row.damping_ratio, reduced_mass, stiffness, overlap)
        if hertz
        else linear_damping(row.linear_damping_ratio, reduced_mass, laws.normal_stiffness)
    )
    tangential_stiffness = (
        mindlin_stiffness(row.shear_modulus, meeting.reduced_radius, overlap) if hertz else laws.tangential_stiffness
    )
    # in the steps in which the surfaces meet and part, the dashpot lasts for a part of the step only; there
    # Hertz' grows as the fourth root of the overlap, and its mean is 4/5 of its present value
    stride = max(abs(step * normal_speed), _LEAST)
    lasted = overlap / stride
    damping *= 0.5 + (0.8 if hertz else 1.0) * lasted if lasted < 1.0 else 1.0
    # a dashpot acts on the speed at the middle of the kick, which it changes itself
    kick = 0.5 * step * meeting.inverse_mass * share
    mid_speed = (normal_speed + kick * elastic) / (1.0 + kick * damping)
    normal_force = elastic - damping * mid_speed

    # levers add up to the distance of the centres
    stretch = meeting.distance * meeting.inverse_sum
    halfway = minus(normal, times(0.5 * step, meeting.turn))
    halfway = times(1.5 - 0.5 * dot(halfway, halfway), halfway)  # unit length, to second order of the turn
    slip = minus(across(meeting.velocity, halfway), times(stretch, cross(meeting.surface_spin, halfway)))
    before = max(overlap + step * normal_speed, 0.0)
    loading = laws.spring == RESCALED and before < overlap
    spring = times(math.sqrt(before / overlap) if loading else 1.0, spring)
    # in its first step a contact slides only from where friction sets in
    gripped = -meeting.gap / stride if laws.friction_onset == OVERLAP else lasted
    portion = min(max(gripped, 0.0), 1.0) if normal_speed < 0.0 else 1.0
    spring = across(plus(spring, times(portion * step, slip)), normal)
    slip = across(slip, normal)

    mid_slip = minus(slip, times(ROLLING * kick * tangential_stiffness, spring))
    mid_slip = times(1.0 / (1.0 + ROLLING * kick * damping), mid_slip)
    pull = plus(times(tangential_stiffness, spring), times(damping, mid_slip))
    friction = row.friction
    if laws.film:
        friction = dry_or_lubricated(minimum_gap, row.roughness_gap, row.friction, row.friction_lubricated)
    limit = coulomb_limit(friction, normal_force)
    size = math.sqrt(dot(pull, pull))
    sliding = size > limit
    pull = times(limit / max(size, _LEAST) if sliding else 1.0, pull)
    # a sliding spring carries what the dashpot leaves of Coulomb's limit, and never more than the limit
    carried = minus(pull, times(damping, slip))
    carried = either(dot(carried, carried) > limit * limit, pull, carried)
    spring = either(sliding, times(1.0 / max(tangential_stiffness, _LEAST), carried), spring)

    gripping = touching and (laws.friction_onset != OVERLAP or meeting.gap < 0.0)
    pull = either(gripping, pull, NOTHING)
    force = minus(times(normal_force, normal), pull)
    return (
        either(touching, times(share, force), NOTHING),
        times(share * stretch, cross(normal, pull)),
        either(gripping, spring, NOTHING),
    )


@inline
def pair_mass_and_radius(k, bodies, edges):
    """Reduced radius and inverse of the reduced mass; those of the particle itself against a wall."""
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        radius = bodies.radius[i] * bodies.radius[j] / (bodies.radius[i] + bodies.radius[j])
        return radius, bodies.inverse_mass[i] + bodies.inverse_mass[j]
    return bodies.radius[i], bodies.inverse_mass[i]


@inline
def relative_velocity(k, bodies, edges):
    """Velocity of the first body's centre against the second's, or against the surface of a wall."""
    i, j = edges.first[k], edges.second[k]
    other = at(bodies.velocity, j) if k < edges.between_particles else touched(edges, k, SURFACE)
    return minus(at(bodies.velocity, i), other)


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
def wet(k, bodies, edges, walls, shift, table, laws):
    """Find the resistance of the film of edge k; an encounter begins anew where the pair comes within its reach."""
    _, _, gap = geometry(k, bodies, edges, shift)
    reduced_radius, _ = pair_mass_and_radius(k, bodies, edges)
    row = pair_row(k, bodies, edges, walls, table)
    if gap > laws.cutoff_ratio * reduced_radius:
        if edges.accounted_gap[k] == np.inf:
            edges.minimum_gap[k] = row.roughness_gap
        edges.resistance[k] = 0.0
        edges.accounted_gap[k] = gap
        return
    if edges.resistance[k] == 0.0:
        edges.approach_speed[k] = 0.0
        edges.minimum_gap[k] = row.roughness_gap
        if edges.accounted_gap[k] == np.inf:
            edges.accounted_gap[k] = gap
    strength = film_strength(pair_viscosity(k, bodies, edges), reduced_radius)
    edges.resistance[k] = portion(edges, k) * strength / max(gap, edges.minimum_gap[k])


@inline
def film_force(k, bodies, edges, walls, shift, table, laws):
    """The film of edge k as an explicit force, for plain velocity Verlet."""
    separation, distance, gap = geometry(k, bodies, edges, shift)
    reduced_radius, _ = pair_mass_and_radius(k, bodies, edges)
    normal = times(1.0 / distance, separation)
    normal_speed = dot(relative_velocity(k, bodies, edges), normal)
    viscosity = pair_viscosity(k, bodies, edges)
    encounter(k, edges, normal_speed, gap, viscosity, reduced_radius, pair_row(k, bodies, edges, walls, table))
    strength = film_strength(viscosity, reduced_radius)
    resistance = film_resistance(strength, gap, edges.minimum_gap[k], laws.cutoff_ratio * reduced_radius)
    return times(-portion(edges, k) * resistance * normal_speed, normal)


@inline
def squeeze(k, bodies, edges, walls, shift, table, laws, step):
    """Impulse of the film of edge k over the coming step.

    Each body gives this film the part of its mass that the film has in the body's total resistance. The
    pair so made is solved exactly; the sum over all films conserves momentum and never raises energy.
    """
    if edges.resistance[k] == 0.0:
        return
    i, j = edges.first[k], edges.second[k]
    separation, distance, gap = geometry(k, bodies, edges, shift)
    normal = times(1.0 / distance, separation)
    normal_speed = dot(relative_velocity(k, bodies, edges), normal)
    reduced_radius, _ = pair_mass_and_radius(k, bodies, edges)
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
        portion(edges, k) * film_strength(viscosity, reduced_radius) * inverse_mass,
        edges.minimum_gap[k],
        laws.cutoff_ratio * reduced_radius,
    )
    # what other films left of an earlier step may be made up for, but never by speeding the pair up
    new_speed = max(new_speed, 0.0) if normal_speed > 0.0 else min(new_speed, 0.0)
    new_speed = min(new_speed, normal_speed) if normal_speed > 0.0 else max(new_speed, normal_speed)
    edges.accounted_gap[k] = gap + step * new_speed
    put(edges.impulse, k, times((new_speed - normal_speed) / inverse_mass, normal))
