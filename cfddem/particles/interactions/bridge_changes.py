"""Bridges form where films touch and break where they are stretched too far.

All bridges that form in one step draw at once from the liquid at the beginning of the step, and what broken bridges
return comes after that, so that the order of pairs does not matter. Edges write where bridges form and break,
particles sum over their own edges in a fixed order.

Loops over `prange` write through functions: the compiler for threads loses what they write into a structure themselves.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, part, prange, serial
from cfddem.particles.collision_events import move_event
from cfddem.particles.interactions.bond import SMALLEST_GAP, dried, form_bonds, forms_bond, thinnest_film
from cfddem.particles.interactions.bridge import (
    FLAT,
    bridge_state,
    capillary_number_of,
    find_closed,
    renew_bridge,
    renew_resistance,
)
from cfddem.particles.interactions.bridge_apart import find_loads
from cfddem.particles.interactions.kinematics import pair_mass_and_radius, relative_velocity
from cfddem.particles.interactions.slots import (
    BOND,
    BRIDGE_APART,
    BRIDGE_INERTIA,
    DRYING,
    RECORD,
    WALL_LIQUID,
    bridge_rupture,
    drawn_share,
    pair_bridges,
    returned_share,
)
from cfddem.particles.interactions.wall_liquid import (
    settle_wall_liquid,
    share_left_by_wall,
    thickest_wall,
    wall_requests,
    wall_thickness,
)
from cfddem.particles.pair_graph import edge_role, geometry
from cfddem.particles.vectors import NOTHING, at, dot, put
from cfddem.particles.walls.nearest_point import touched_distance
from closures.liquid_film import film_thickness
from closures.minimum_gap import glass_transition


@part
def renew_thickness(particles):
    """Thickness of the film on every particle, ghosts included."""
    for i in prange(len(particles.radius)):
        find_thickness(i, particles)


@inline
def find_thickness(i, particles):
    """Thickness of the layer of liquid all over particle i."""
    particles.film_thickness[i] = film_thickness(particles.radius[i], particles.liquid[i])


@inline
def longest_gap(k, system):
    """Gap at which the bridge of edge k breaks; it grows with the speed at which the bodies part."""
    memory, p = system.memory, system.parameters
    separation, distance, gap = geometry(k, system)
    reduced_radius, _ = pair_mass_and_radius(k, system)
    parting = max(dot(relative_velocity(k, system), separation) / distance, 0.0)
    state = bridge_state(k, gap, reduced_radius, memory, p, capillary_number_of(parting, p))
    return max(state.film, bridge_rupture(state))


@serial
def find_changes(system, step):
    """Mark where bridges form or break, and what each body has for new ones; returns the number of changes.

    Bridges between particles that neither form nor break are renewed on the way.

    step  since the last positions; 0 if these are the same [s]
    """
    edges = system.edges
    pair_bridges(0, edges.between_particles, system, step)
    changes = _open_changes(system) + wall_changes(system)
    if changes > 0:
        mark_bodies(system)
        limit_shares(system)
    return changes


@serial
def mark_bodies(system):
    """Mark the particles whose bridges form or break."""
    particles, edges, memory = system.particles, system.edges, system.memory
    particles.bridges_change[:] = False
    for k in range(len(edges.first)):
        if memory.bridge_change[k] != 0:
            particles.bridges_change[edges.first[k]] = True
            if k < edges.between_particles:
                particles.bridges_change[edges.second[k]] = True


@serial
def exchange_liquid(system):
    """Let bridges form and break where they are marked; liquid goes from bodies to bridges and back."""
    fill_bridges(system)
    return_liquid(system)


@serial
def return_liquid(system):
    """Give the liquid of marked bridges to their bodies and back, and forget the broken ones."""
    if WALL_LIQUID:
        requesting, names, amounts = wall_requests(system)
        settle_wall_liquid(system, requesting, names, amounts)
    _give_liquid(system)


@serial
def share_wall_liquid(system, requesting, names, amounts):
    """As `exchange_liquid`, with the requests of all ranks; see `settle_wall_liquid`."""
    fill_bridges(system)
    settle_wall_liquid(system, requesting, names, amounts)
    _give_liquid(system)


@serial
def _give_liquid(system):
    """Let particles have what broken bridges return, and new ones draw, and forget the broken ones."""
    transfer_liquid(system)
    if BOND:
        form_bonds(system)
    clear_bridges(system.edges, system.memory)
    if BRIDGE_APART:
        find_loads(system, True)


@inline
def _change(k, gap, film, system):
    """1 where a bridge forms on edge k, -1 where one breaks, else 0.

    film  thickness of the liquid on both bodies [m]
    """
    memory = system.memory
    thinnest, reduced_radius = SMALLEST_GAP, 1.0
    if DRYING:
        reduced_radius, _ = pair_mass_and_radius(k, system)
        thinnest = max(thinnest, thinnest_film(reduced_radius, system.parameters.bridge.minimum_gap))
    if memory.bridge_film[k] > 0.0:
        parted = gap > memory.bridge_film[k] and gap > longest_gap(k, system)
        if DRYING:
            parted = parted or dried(k, reduced_radius, memory)
        return -1 if parted else 0
    return 1 if film > thinnest and gap < film else 0  # dry solids overlap without a bridge


@part
def _open_changes(system):
    """Resistance of open bridges between particles, and those that break; returns how many pairs change."""
    edges, memory = system.edges, system.memory
    counts, number = np.zeros(CHUNKS, np.int64), edges.between_particles
    for chunk in prange(CHUNKS):
        count = 0
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            if memory.bridge_open[k]:
                _open_change(k, system)
            count += memory.bridge_change[k] * memory.bridge_change[k]
        counts[chunk] = count
    return counts.sum()  # local: pairs of this rank


@inline
def _open_change(k, system):
    """See `_open_changes`, for edge k."""
    memory, p = system.memory, system.parameters
    _, _, gap = geometry(k, system)
    reduced_radius, _ = pair_mass_and_radius(k, system)
    renew_resistance(k, bridge_state(k, gap, reduced_radius, memory, p), memory)
    memory.bridge_change[k] = _change(k, gap, 0.0, system)


@serial
def wall_changes(system):
    """Mark where bridges at walls form or break, and move bridges to the nearest piece; returns their number.

    A particle has at most one bridge with a wall, at the nearest of its pieces: it does not matter how many pieces
    there are.
    """
    particles, edges, memory, walls, p = system.particles, system.edges, system.memory, system.walls, system.parameters
    number, begin, count = len(edges.first), edges.between_particles, 0
    while begin < number:
        end, nearest, holder = begin, begin, -1
        while end < number and of_same_wall(begin, end, edges, walls):
            if touched_distance(edges, end) < touched_distance(edges, nearest):
                nearest = end
            if memory.bridge_film[end] > 0.0:
                holder = end
            memory.bridge_change[end] = 0
            end += 1
        if holder >= 0 and holder != nearest:
            _move_bridge(memory, holder, nearest)
            if RECORD:
                move_event(memory, holder, nearest)
        gap = touched_distance(edges, nearest) - particles.radius[edges.first[nearest]]
        film = particles.film_thickness[edges.first[nearest]]
        if gap < film + thickest_wall(walls, p):
            film += wall_thickness(nearest, system)
        change = _change(nearest, gap, film, system)
        memory.bridge_change[nearest] = change
        count += change * change
        begin = end
    return count


@inline
def of_same_wall(k, other, edges, walls):
    """Whether two edges at walls are of the same particle and wall."""
    same = edges.first[k] == edges.first[other]
    return same and walls.wall[edges.second[k]] == walls.wall[edges.second[other]]


@inline
def _move_bridge(memory, k, to):
    """Let the bridge of edge k continue at another piece of the same wall."""
    memory.bridge_film[to], memory.bridge_volume[to] = memory.bridge_film[k], memory.bridge_volume[k]
    memory.bridge_gap[to], memory.bridge_solved[to] = memory.bridge_gap[k], memory.bridge_solved[k]
    memory.closed_along[to], memory.closed_across[to] = memory.closed_along[k], memory.closed_across[k]
    if BOND:
        memory.bridge_solid[to] = memory.bridge_solid[k]
    if BRIDGE_INERTIA:
        memory.bridge_impact_speed[to] = memory.bridge_impact_speed[k]
    put(memory.bridge_impulse, to, at(memory.bridge_impulse, k))
    put(memory.bridge_couple, to, at(memory.bridge_couple, k))
    put(memory.bridge_impulse, k, NOTHING)
    put(memory.bridge_couple, k, NOTHING)
    memory.bridge_solved[k] = False
    clear_bridge(k, memory)


@inline
def _other_radius(k, i, particles, edges):
    """Radius of the other body of edge k; that of a wall has no limit."""
    if k >= edges.between_particles:
        return FLAT
    j = edges.second[k] if edges.first[k] == i else edges.first[k]
    return particles.radius[j]


@inline
def _shares(i, system):
    """Sum of the shares of its liquid that the new bridges of particle i ask for."""
    particles, edges, memory = system.particles, system.edges, system.memory
    asked = 0.0
    for place in range(edges.start[i], edges.start[i + 1]):
        k, _ = edge_role(edges.incident[place])
        if memory.bridge_change[k] > 0:
            asked += drawn_share(particles.radius[i], _other_radius(k, i, particles, edges))
    return asked


@inline
def _limit_share(i, system):
    particles = system.particles
    particles.liquid_supply[i] = particles.liquid[i] / max(1.0, _shares(i, system))


@part
def limit_shares(system):
    """Liquid of which each new bridge takes its share: less than there is where the shares add up to more than 1."""
    particles = system.particles
    for i in prange(particles.owned):
        if particles.bridges_change[i]:
            _limit_share(i, system)


@part
def fill_bridges(system):
    """Volume, film and minimum gap of new bridges."""
    edges, memory = system.edges, system.memory
    for k in prange(len(edges.first)):
        if memory.bridge_change[k] > 0:
            _fill(k, system)


@inline
def _fill(k, system):
    particles, edges, memory, p = system.particles, system.edges, system.memory, system.parameters
    i, j = edges.first[k], edges.second[k]
    separation, distance, _ = geometry(k, system)
    volume = particles.liquid_supply[i] * drawn_share(particles.radius[i], _other_radius(k, i, particles, edges))
    film = particles.film_thickness[i]
    if k < edges.between_particles:
        volume += particles.liquid_supply[j] * drawn_share(particles.radius[j], particles.radius[i])
        film += particles.film_thickness[j]
    else:
        film += wall_thickness(k, system)
    approach = max(-dot(relative_velocity(k, system), separation) / distance, 0.0)
    reduced_radius, _ = pair_mass_and_radius(k, system)
    n = p.bridge
    glass = glass_transition(n.viscosity, approach, n.transition_pressure, reduced_radius, film)
    memory.bridge_volume[k], memory.bridge_film[k] = volume, film
    memory.bridge_gap[k] = max(glass, n.minimum_gap)
    if BOND:
        memory.bridge_solid[k] = p.bond.solid_fraction * volume
    find_closed(k, reduced_radius, memory, p)
    if k < edges.between_particles:
        renew_bridge(k, system)


@part
def transfer_liquid(system):
    """Take what new bridges have drawn from the liquid of every particle, and add what broken ones return."""
    particles = system.particles
    for i in prange(particles.owned):
        if particles.bridges_change[i]:
            _transfer(i, system)


@inline
def _transfer(i, system):
    """See `transfer_liquid`, for particle i."""
    particles, edges, memory = system.particles, system.edges, system.memory
    drawn, returned, formed, broken, bonds = 0.0, 0.0, 0, 0, 0
    for place in range(edges.start[i], edges.start[i + 1]):
        k, sign = edge_role(edges.incident[place])
        change = memory.bridge_change[k]
        if change > 0:
            drawn += drawn_share(particles.radius[i], _other_radius(k, i, particles, edges))
            formed += 1 if sign > 0.0 else 0
        elif change < 0:
            returned += _part_returned(k, sign, system)
            broken += 1 if sign > 0.0 else 0
            if BOND:
                bonds += 1 if sign > 0.0 and forms_bond(k, system) else 0
    if drawn > 0.0 or returned > 0.0:
        particles.liquid[i] = max(particles.liquid[i] - particles.liquid_supply[i] * drawn, 0.0) + returned
        find_thickness(i, particles)
    particles.bridges_formed[i] += formed
    particles.bridges_broken[i] += broken
    if BOND:
        particles.bonds_formed[i] += bonds


@inline
def _part_returned(k, sign, system):
    """Liquid of the broken bridge of edge k that its first (sign 1) or second body gets [m3]."""
    particles, edges, memory, p = system.particles, system.edges, system.memory, system.parameters
    i, j = edges.first[k], edges.second[k]
    volume = memory.bridge_volume[k]
    if k >= edges.between_particles:
        return share_left_by_wall(particles.radius[i], p) * volume if WALL_LIQUID else volume
    angle = p.bridge.contact_angle
    to_first = returned_share(particles.radius[i], particles.radius[j], angle, angle) * volume
    return to_first if sign > 0.0 else volume - to_first


@part
def clear_bridges(edges, memory):
    """Forget bridges that have broken."""
    for k in prange(len(edges.first)):
        if memory.bridge_change[k] < 0:
            clear_bridge(k, memory)


@inline
def clear_bridge(k, memory):
    """Forget the bridge of edge k."""
    memory.bridge_film[k] = 0.0
    memory.bridge_volume[k] = 0.0
    memory.bridge_resistance[k] = 0.0
    if BRIDGE_INERTIA:
        memory.bridge_impact_speed[k] = 0.0
    put(memory.bridge_force, k, NOTHING)
    if BRIDGE_APART:
        memory.bridge_apart[k] = 0.0
        put(memory.bridge_turn, k, NOTHING)
