"""Impulses of liquid bridges over a step: of one edge for any change of the gap, and of all edges in turn."""

from __future__ import annotations

import math

from cfddem.backend.compile import inline, part, prange, serial
from cfddem.particles.interactions.bridge import bridge_state, capillary_number_of, resistance_across
from cfddem.particles.interactions.bridge_loops import closed_speed, shared_inverse_masses
from cfddem.particles.interactions.bridge_solution import at_gap, clamp_speed, held_gap, speed_after_bridge
from cfddem.particles.interactions.kinematics import pair_mass_and_radius, relative_velocity
from cfddem.particles.interactions.slots import BRIDGE_FILM, BRIDGE_INERTIA, BRIDGE_SLIDING, WALLS, bridge_impulses
from cfddem.particles.pair_graph import edge_role, geometry, places_of
from cfddem.particles.vectors import NOTHING, across, at, cross, dot, minus, plus, put, times
from closures.film_impact import pair_added_mass


@serial
def find_bridge_impulses(system, step):
    """Impulses of all bridges over the coming step."""
    edges = system.edges
    bridge_impulses(0, edges.between_particles, system, step)
    open_impulses(system, step)
    if WALLS:
        wall_impulses(system, step)


@part
def open_impulses(system, step):
    """Impulses of the bridges between particles that the short solution leaves."""
    edges, memory = system.edges, system.memory
    for k in prange(edges.between_particles):
        if memory.bridge_open[k]:
            bridge_impulse(k, system, step)


@part
def wall_impulses(system, step):
    """Impulses of the bridges at walls."""
    edges, memory = system.edges, system.memory
    for k in prange(edges.between_particles, len(edges.first)):
        if memory.bridge_resistance[k] > 0.0:
            bridge_impulse(k, system, step)
        else:
            no_impulse(k, memory)


@inline
def no_impulse(k, memory):
    """The bridge of edge k gives no impulse in this step."""
    put(memory.bridge_impulse, k, NOTHING)
    put(memory.bridge_couple, k, NOTHING)


@inline
def _inverse_masses(k, system, lever):
    """Inverse masses that both bodies give the bridge of edge k, along and across the line of centres [1/kg].

    lever  arm of the impulse over the radius [-]
    """
    particles, edges, memory = system.particles, system.edges, system.memory
    i, j = edges.first[k], edges.second[k]
    rate, turn_rate = particles.bridge_rate[i], particles.bridge_turn_rate[i]
    if k < edges.between_particles:
        rate, turn_rate = rate + particles.bridge_rate[j], turn_rate + particles.bridge_turn_rate[j]
    return shared_inverse_masses(rate, turn_rate, lever, memory.bridge_resistance[k])


@inline
def reverse_film(k, state, step, rate, inverse_mass, system):
    """Change of the rate of the gap where the film is reversed with its bodies, as they part after contact [m/s].

    rate          of the gap after the resistance [m/s]
    inverse_mass  of the reduced mass [1/kg]
    """
    memory = system.memory
    floor, end = held_gap(state), state.gap + step * rate
    if state.gap > floor and end <= floor:
        memory.bridge_impact_speed[k] = -rate
    struck = memory.bridge_impact_speed[k]
    if not (struck > 0.0 and rate > 0.0 and end > floor):
        return 0.0
    memory.bridge_impact_speed[k] = 0.0
    added = pair_added_mass(system.parameters.bridge.film_density, state.film, state.reduced_radius) * inverse_mass
    return max((rate - added * struck) / (1.0 + added), 0.0) - rate


@inline
def bridge_impulse(k, system, step):
    """Impulse and couple of the bridge of edge k over the coming step.

    Lever arms add up to the distance of the centres, so that angular momentum is kept.
    """
    particles, edges, memory, p = system.particles, system.edges, system.memory, system.parameters
    i, j = edges.first[k], edges.second[k]
    separation, distance, gap = geometry(k, system)
    normal = times(1.0 / distance, separation)
    reduced_radius, _ = pair_mass_and_radius(k, system)
    velocity = relative_velocity(k, system)
    speed = new_speed = dot(velocity, normal)
    state = bridge_state(k, gap, reduced_radius, memory, p, capillary_number_of(speed, p))
    turning, radii = times(particles.radius[i], at(particles.spin, i)), particles.radius[i]
    if k < edges.between_particles:
        turning, radii = plus(turning, times(particles.radius[j], at(particles.spin, j))), radii + particles.radius[j]
    lever = distance / radii
    along, sideways = _inverse_masses(k, system, lever)

    floor, accounted = held_gap(state), memory.bridge_accounted[k]
    if BRIDGE_FILM:
        new_speed = closed_speed(speed, memory.closed_along[k], accounted - gap, step, along)
        if max(gap, gap + step * new_speed, accounted) >= floor:
            new_speed = clamp_speed(speed_after_bridge(speed, state, accounted, step, along), speed)
    by_film = (new_speed - speed) / along
    if BRIDGE_INERTIA:
        inverse_mass = pair_mass_and_radius(k, system)[1]
        turned = reverse_film(k, state, step, new_speed, inverse_mass, system)
        by_film += turned / inverse_mass
        new_speed += turned
    memory.bridge_accounted[k] = gap + step * new_speed
    impulse = times(by_film, normal)
    couple = NOTHING
    if BRIDGE_SLIDING:
        middle = gap + 0.5 * step * new_speed
        resistance = memory.closed_across[k] if middle < floor else resistance_across(at_gap(state, middle))
        slip = minus(across(velocity, normal), times(lever, cross(turning, normal)))
        drag = times(math.expm1(-step * resistance * sideways) / sideways, slip)
        impulse = plus(impulse, drag)
        couple = times(-lever, cross(normal, drag))
    put(memory.bridge_impulse, k, impulse)
    put(memory.bridge_couple, k, couple)


@part
def apply_bridge_impulses(system):
    """Give every particle the impulses of its bridges; edges whose bridge does not resist must hold zeros."""
    particles, edges, memory = system.particles, system.edges, system.memory
    for i in prange(particles.owned):
        impulse, couple = NOTHING, NOTHING
        for place in places_of(i, edges):
            k, sign = edge_role(edges.incident[place])
            impulse = plus(impulse, times(sign, at(memory.bridge_impulse, k)))
            couple = plus(couple, at(memory.bridge_couple, k))
        gain = times(particles.inverse_mass[i], impulse)
        put(particles.velocity, i, plus(at(particles.velocity, i), gain))
        gain = times(particles.inverse_inertia[i] * particles.radius[i], couple)
        put(particles.spin, i, plus(at(particles.spin, i), gain))
