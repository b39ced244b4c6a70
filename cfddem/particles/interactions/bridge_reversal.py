"""Films of bridges that have inertia: the impulses that reverse them with their bodies after contact."""

from __future__ import annotations

from cfddem.backend.compile import inline, part, prange, serial
from cfddem.particles.interactions.bridge import bridge_state
from cfddem.particles.interactions.bridge_solution import held_gap
from cfddem.particles.interactions.kinematics import pair_mass_and_radius, relative_velocity
from cfddem.particles.pair_graph import edge_role, geometry, places_of
from cfddem.particles.vectors import NOTHING, at, dot, plus, put, times
from closures.film_impact import pair_added_mass


@serial
def reverse_films(system, step):
    """Give the particles the impulses of films that are reversed with their bodies; ghosts have present velocities."""
    find_reversals(system, step)
    apply_reversals(system)


@part
def find_reversals(system, step):
    """Impulse of each bridge whose film is reversed; 0 of all others."""
    for k in prange(len(system.edges.first)):
        put(system.memory.bridge_reversal, k, NOTHING)
        if system.memory.bridge_resistance[k] > 0.0:
            find_reversal(k, system, step)


@inline
def find_reversal(k, system, step):
    """See `find_reversals`, for edge k."""
    memory = system.memory
    separation, distance, gap = geometry(k, system)
    normal = times(1.0 / distance, separation)
    reduced_radius, inverse_mass = pair_mass_and_radius(k, system)
    state = bridge_state(k, gap, reduced_radius, memory, system.parameters)
    rate = dot(relative_velocity(k, system), normal)
    change = reverse_film(k, state, step, rate, inverse_mass, system)
    if change != 0.0:
        impulse = times(change / inverse_mass, normal)
        put(memory.bridge_reversal, k, impulse)
        put(memory.bridge_impulse, k, plus(at(memory.bridge_impulse, k), impulse))


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


@part
def apply_reversals(system):
    """Give every particle the impulses of its films that are reversed."""
    for i in prange(system.particles.owned):
        apply_reversal(i, system)


@inline
def apply_reversal(i, system):
    """See `apply_reversals`, for particle i."""
    particles, edges, impulse = system.particles, system.edges, NOTHING
    for place in places_of(i, edges):
        k, sign = edge_role(edges.incident[place])
        impulse = plus(impulse, times(sign, at(system.memory.bridge_reversal, k)))
    put(particles.velocity, i, plus(at(particles.velocity, i), times(particles.inverse_mass[i], impulse)))
