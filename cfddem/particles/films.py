"""What the film between two bodies does: its resistance, and its impulse over a step.

A film remembers its encounter, from when the pair comes within its reach until it leaves it. What is a
function of numbers alone and without branches runs on several pairs at once; the rest works on its edge.
"""

from __future__ import annotations

import numpy as np

from cfddem.kernels import inline
from cfddem.particles.forces import LEAST, pair_mass_and_radius, pair_row, pair_viscosity, relative_velocity
from cfddem.particles.own_laws import (
    film_is_outside,
    gap_is_outside,
    own_film,
    own_minimum_gap,
    own_resistance,
    speed_after_own_film,
)
from cfddem.particles.pairs import THICKEST, geometry
from cfddem.particles.surfaces import portion
from cfddem.particles.vectors import dot, put, times
from closures.lubrication import film_resistance, film_strength, speed_after_film, speed_after_short_step
from closures.minimum_gap import elastohydrodynamic, elastohydrodynamic_speed


@inline
def moisten(gap, viscosity, reduced_radius, memory, row, laws):
    """Resistance of a film, and what it remembers; an encounter begins anew where the pair comes within reach.

    memory   resistance, approach speed, minimum gap and accounted gap of the step before
    row      what the two materials do to each other
    returns  the same four as they are now
    """
    resistance, approach_speed, minimum_gap, accounted_gap = memory
    roughness = row.roughness_gap
    within = gap <= laws.cutoff_ratio * reduced_radius
    begins = within and resistance == 0.0
    unknown = accounted_gap == np.inf
    approach_speed = 0.0 if begins else approach_speed
    minimum_gap = roughness if begins or (unknown and not within) else minimum_gap
    if laws.minimum_gap is not None and begins:
        minimum_gap = own_minimum_gap(roughness, 0.0, viscosity, row.film_modulus, reduced_radius, laws)
    accounted_gap = gap if not within or (begins and unknown) else accounted_gap
    if laws.lubrication is None:
        resistance = film_strength(viscosity, reduced_radius) / max(gap, minimum_gap)
    else:
        resistance = own_film(gap, viscosity, reduced_radius, minimum_gap, laws)
        resistance = (
            LEAST if resistance < LEAST else resistance
        )  # an encounter lasts where a film of finite extent ends
    return resistance if within else 0.0, approach_speed, minimum_gap, accounted_gap


@inline
def wet(k, bodies, edges, walls, shift, table, laws):
    """Find the resistance of the film of edge k."""
    _, _, gap = geometry(k, bodies, edges, shift)
    reduced_radius, _ = pair_mass_and_radius(k, bodies, edges)
    viscosity = pair_viscosity(k, bodies, edges)
    row = pair_row(k, bodies, edges, walls, table)
    memory = (edges.resistance[k], edges.approach_speed[k], edges.minimum_gap[k], edges.accounted_gap[k])
    now = moisten(gap, viscosity, reduced_radius, memory, row, laws)
    edges.resistance[k] = portion(edges, k) * now[0]
    edges.approach_speed[k], edges.minimum_gap[k], edges.accounted_gap[k] = now[1], now[2], now[3]


@inline
def encounter(k, edges, normal_speed, gap, viscosity, reduced_radius, row, laws):
    """Remember the largest approach speed, and the minimum gap that belongs to it."""
    if not (-normal_speed > edges.approach_speed[k] and gap > edges.minimum_gap[k]):
        return
    if laws.minimum_gap is not None:
        asked = (row.roughness_gap, -normal_speed, viscosity, row.film_modulus, reduced_radius, laws)
        edges.approach_speed[k] = -normal_speed
        edges.minimum_gap[k] = own_minimum_gap(*asked)
        edges.outside[k] += gap_is_outside(*asked)
        return
    # slower approaches end on asperities, and need not be noted
    slowest = elastohydrodynamic_speed(row.roughness_gap, viscosity, row.film_modulus, reduced_radius)
    edges.approach_speed[k] = max(-normal_speed, slowest)
    deformed = elastohydrodynamic(viscosity, -normal_speed, row.film_modulus, reduced_radius)
    edges.minimum_gap[k] = max(row.roughness_gap, min(deformed, THICKEST * reduced_radius))


@inline
def film_force(k, bodies, edges, walls, shift, table, laws):
    """The film of edge k as an explicit force, for plain velocity Verlet."""
    separation, distance, gap = geometry(k, bodies, edges, shift)
    reduced_radius, _ = pair_mass_and_radius(k, bodies, edges)
    normal = times(1.0 / distance, separation)
    normal_speed = dot(relative_velocity(k, bodies, edges), normal)
    viscosity = pair_viscosity(k, bodies, edges)
    row = pair_row(k, bodies, edges, walls, table)
    encounter(k, edges, normal_speed, gap, viscosity, reduced_radius, row, laws)
    if laws.lubrication is None:
        strength = film_strength(viscosity, reduced_radius)
        resistance = film_resistance(strength, gap, edges.minimum_gap[k], laws.cutoff_ratio * reduced_radius)
    else:
        resistance = own_resistance(gap, viscosity, reduced_radius, edges.minimum_gap[k], laws)
        if edges.resistance[k] > 0.0:
            edges.outside[k] += film_is_outside(gap, viscosity, reduced_radius, edges.minimum_gap[k], laws)
    return times(-portion(edges, k) * resistance * normal_speed, normal)


@inline
def never_faster(new_speed, speed):
    """What other films left of an earlier step may be made up for, but never by speeding the pair up."""
    return min(max(new_speed, 0.0), speed) if speed > 0.0 else max(min(new_speed, 0.0), speed)


@inline
def squeeze_shortly(speed, gap, reduced_radius, rate, memory, laws, step):
    """Impulse of a film over the coming step and the gap up to which it has been given, where the gap hardly changes.

    rate     sum over both bodies of what all their films are to each, resistance over mass [1/s]
    memory   as in `moisten`
    returns  impulse [N s], accounted gap [m], and whether `squeeze` must find them instead
    """
    resistance, approach_speed, minimum_gap, accounted_gap = memory
    wetted = resistance > 0.0
    strength_per_mass = rate * max(gap, minimum_gap)
    cutoff = laws.cutoff_ratio * reduced_radius
    new_speed = speed_after_short_step(speed, gap, accounted_gap, step, strength_per_mass, minimum_gap, cutoff)
    faster = -speed > approach_speed and gap > minimum_gap
    found = new_speed == new_speed and not faster and laws.lubrication is None
    new_speed = never_faster(new_speed, speed)
    impulse = (new_speed - speed) * resistance / max(rate, LEAST)
    return (
        impulse if wetted and found else 0.0,
        gap + step * new_speed if wetted and found else accounted_gap,
        wetted and not found,
    )


@inline
def squeeze(k, bodies, edges, walls, shift, table, laws, step):
    """Impulse of the film of edge k over the coming step.

    Each body gives this film the part of its mass that the film has in the body's total resistance. The
    pair so made is solved exactly; the sum over all films conserves momentum and never raises energy.
    """
    i, j = edges.first[k], edges.second[k]
    separation, distance, gap = geometry(k, bodies, edges, shift)
    normal = times(1.0 / distance, separation)
    if edges.resistance[k] == 0.0:
        put(edges.impulse, k, times(0.0, normal))
        return
    normal_speed = dot(relative_velocity(k, bodies, edges), normal)
    reduced_radius, _ = pair_mass_and_radius(k, bodies, edges)
    rate = bodies.film_rate[i]
    if k < edges.between_particles:
        rate += bodies.film_rate[j]
    strength_per_mass = rate * max(gap, edges.minimum_gap[k])
    viscosity, row = pair_viscosity(k, bodies, edges), pair_row(k, bodies, edges, walls, table)
    encounter(k, edges, normal_speed, gap, viscosity, reduced_radius, row, laws)
    minimum_gap, given = edges.minimum_gap[k], edges.accounted_gap[k]
    if laws.lubrication is None:
        cutoff = laws.cutoff_ratio * reduced_radius
        new_speed = speed_after_film(normal_speed, gap, given, step, strength_per_mass, minimum_gap, cutoff)
    else:
        film = (viscosity, reduced_radius, minimum_gap, laws)
        inverse_mass = rate * portion(edges, k) / edges.resistance[k]
        new_speed = speed_after_own_film(normal_speed, gap, given, step, inverse_mass, *film)
        edges.outside[k] += film_is_outside(gap, *film)
    new_speed = never_faster(new_speed, normal_speed)
    edges.accounted_gap[k] = gap + step * new_speed
    put(edges.impulse, k, times((new_speed - normal_speed) * edges.resistance[k] / rate, normal))
