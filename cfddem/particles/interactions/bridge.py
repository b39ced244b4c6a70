"""Liquid bridges of the edges: what bodies and pairs remember, resistance, impulse over a step, and pull.

Every particle carries liquid, the field `liquid`. A bridge joins two particles, or a particle and a wall, from where
their films touch until it is stretched too far (:mod:`~cfddem.particles.interactions.bridge_changes`).

The resistance of a bridge acts by impulses between the kick and the drift, which are solved together with those of all
other bridges and films (:mod:`~cfddem.particles.interactions.joint_solution`). Along the line of centres the resistance
is integrated over the gap, so that impulses add up to the potential between the first gap and the last. The pull is an
ordinary force, and so is the resistance of closed bridges that are not stiff
(:mod:`~cfddem.particles.interactions.bridge_apart`).
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline, part, prange, serial
from cfddem.backend.errors import InputError
from cfddem.model.fields import Field
from cfddem.particles.interactions.bridge_solution import at_gap, held_gap
from cfddem.particles.interactions.kinematics import pair_mass_and_radius, relative_velocity
from cfddem.particles.interactions.slots import (
    BRIDGE_FILM,
    BRIDGE_PULL,
    BRIDGE_SLIDING,
    CUT_CONSTANT,
    BridgeState,
    bridge_pull,
    bridge_resistance,
    sliding_resistance,
)
from cfddem.particles.pair_graph import edge_role, geometry, places_of
from cfddem.particles.state import Particles
from cfddem.particles.vectors import NOTHING, at, dot, plus, put, times
from closures.film_impact import pair_added_mass
from closures.liquid_film import film_thickness, film_volume
from closures.numbers import capillary

LIQUID = Field(
    "liquid", "m3", halo=("start",), snapshot=True, meaning="volume of the liquid film on the particle, without bridges"
)

PARTICLE_FIELDS = (
    LIQUID,
    Field("film_thickness", "m", role="scratch", halo=("motion",), meaning="thickness of the liquid on the particle"),
    Field("liquid_supply", "m3", role="scratch", halo=("liquid",), meaning="liquid of which new bridges take a share"),
    Field("bridge_load", "1/s", role="scratch", halo=("motion",), meaning="sum of damping rates of all its bridges"),
    Field("bridges_change", role="scratch", dtype=bool, meaning="bridges of the particle form or break in this step"),
    Field("bridges_formed", dtype=np.int64, meaning="bridges that have formed, counted by the lower id"),
    Field("bridges_broken", dtype=np.int64, meaning="bridges that have broken, counted by the lower id"),
)
"""Fields of particles that carry liquid."""

FIELDS = (
    Field("bridge_film", "m", role="memory", meaning="thickness of both films when the bridge formed; 0 without one"),
    Field("bridge_volume", "m3", role="memory", meaning="volume of the liquid in the bridge"),
    Field("bridge_gap", "m", role="memory", meaning="minimum gap of the bridge"),
    Field("bridge_resistance", "kg/s", role="memory", meaning="resistance of the bridge; 0 where it has none"),
    Field("bridge_separation", "m", 3, "memory", meaning="separation from the second particle to the first at present"),
    Field("bridge_distance", "m", role="memory", meaning="distance of the centres at present"),
    Field("closed_along", "kg/s", role="memory", meaning="resistance along the line of centres below h_min"),
    Field("closed_across", "kg/s", role="memory", meaning="resistance of the bridge to sliding below h_min"),
    Field("bridge_force", "N", 3, "memory", meaning="on the first body: pull, and resistance as a force"),
    Field("bridge_impulse", "N s", 3, "memory", meaning="impulse of the bridge in the last step, on the first body"),
    Field("bridge_couple", "N s", 3, "scratch", meaning="angular impulse per radius, the same on both bodies"),
    Field("bridge_solved", role="memory", dtype=bool, meaning="the bridge has resisted in the last step"),
    Field("bridge_across", "kg", role="scratch", meaning="resistance of the bridge to sliding, times the step"),
    Field("bridge_lever", role="scratch", meaning="arm of the bridge over the radius of the first body"),
    Field(
        "bridge_change", role="scratch", dtype=np.int8, meaning="1 where a bridge forms, -1 where one breaks, else 0"
    ),
    Field("bridge_open", role="scratch", dtype=bool, meaning="the gap of the bridge exceeds h_min"),
)
"""What pairs remember of their bridges."""

INERTIA_FIELDS = (
    Field("bridge_impact_speed", "m/s", role="memory", meaning="speed at which the bodies have met; 0 once parted"),
    Field("bridge_reversal", "N s", 3, "scratch", meaning="impulse that reverses the film with the bodies"),
)
"""The same, of films with inertia."""

FLAT = 1e100
"""Radius of a wall, in the laws that share liquid [m]."""

BELOW = -1.0
"""A gap below any h_min [m]."""


def thickness_of_films(radius: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """Thickness of a layer of liquid all over each sphere (N,) [m].

    radius  of the spheres (N,) [m]
    volume  of the liquid on each (N,) [m3]
    """
    thickness = np.empty(len(radius))
    _thickness_of_films(radius, volume, thickness)
    return thickness


@serial
def _thickness_of_films(radius, volume, thickness):
    for i in range(len(thickness)):
        thickness[i] = film_thickness(radius[i], volume[i])


def coat(particles: Particles, thickness: np.ndarray | float) -> None:
    """Give particles a film of liquid.

    thickness  of the film on each (N,), or one for all [m]

    >>> from cfddem import make_particles
    >>> beads = make_particles([[0.0, 0.0, 0.01]], radius=1e-3, density=2500.0)
    >>> coat(beads, 1e-5)
    >>> round(float(beads.liquid[0]) * 1e9, 3)
    0.127
    """
    films = np.broadcast_to(np.asarray(thickness, float), (particles.count,))
    refused = np.flatnonzero(~((films >= 0.0) & np.isfinite(films)))
    if len(refused):
        row = int(refused[0])
        raise InputError(f"film of particle {particles.id[row]}", float(films[row]), "at least 0 and finite")
    particles.declare(LIQUID)
    particles.liquid = np.asarray(film_volume(particles.radius, films))  # type: ignore[arg-type]  # of every sphere


@inline
def bridge_state(k, gap, reduced_radius, memory, p, capillary_number=0.0):
    """The bridge of edge k as its laws see it, at a gap."""
    n = p.bridge
    return BridgeState(
        gap, memory.bridge_film[k], memory.bridge_volume[k], reduced_radius, memory.bridge_gap[k],
        n.viscosity, n.surface_tension, n.contact_angle, capillary_number, p.bridge_functions,
    )  # fmt: skip


@inline
def capillary_number_of(speed, p):
    """Capillary number of bodies that part or meet at this speed; 0 without surface tension."""
    n = p.bridge
    return capillary(n.viscosity, abs(speed), n.surface_tension) if n.surface_tension > 0.0 else 0.0


@inline
def resistance_across(state):
    """Resistance to sliding, cut below h_min as the film is."""
    floor = held_gap(state)
    if not BRIDGE_SLIDING or (state.gap < floor and not CUT_CONSTANT):
        return 0.0
    return sliding_resistance(at_gap(state, max(state.gap, floor)))


@inline
def resistance_along(state):
    """Resistance along the line of centres, cut below h_min."""
    floor = held_gap(state)
    if not BRIDGE_FILM or (state.gap < floor and not CUT_CONSTANT):
        return 0.0
    return bridge_resistance(at_gap(state, max(state.gap, floor)))


@inline
def renew_bridge(k, system):
    """Resistance and pull of the bridge of edge k at the present positions."""
    memory, p = system.memory, system.parameters
    separation, distance, gap = geometry(k, system)
    reduced_radius, _ = pair_mass_and_radius(k, system)
    state = bridge_state(k, gap, reduced_radius, memory, p)
    renew_resistance(k, state, memory)
    if BRIDGE_PULL:
        put(memory.bridge_force, k, times(-bridge_pull(state) / distance, separation))


@inline
def renew_resistance(k, state, memory):
    """Resistance of the bridge of edge k at the gap of `state`."""
    if state.gap < held_gap(state):
        memory.bridge_resistance[k] = memory.closed_along[k] + memory.closed_across[k]
    else:
        memory.bridge_resistance[k] = resistance_along(state) + resistance_across(state)


@inline
def find_closed(k, reduced_radius, memory, p):
    """Resistances of the bridge of edge k below h_min, where they do not depend on the gap."""
    state = bridge_state(k, BELOW, reduced_radius, memory, p)
    memory.closed_along[k], memory.closed_across[k] = resistance_along(state), resistance_across(state)


@part
def renew_wall_bridges(system):
    """Resistance and pull of the bridges at walls; those of pairs are renewed as changes are found."""
    edges, memory = system.edges, system.memory
    for k in prange(edges.between_particles, len(edges.first)):
        if memory.bridge_film[k] > 0.0:
            renew_bridge(k, system)


# ---------------------------------------------------------------- reversal of films with inertia
#
# Films of bridges that have inertia: the impulses that reverse them with their bodies after contact.


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
