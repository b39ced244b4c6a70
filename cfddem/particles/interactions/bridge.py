"""Liquid bridges of the edges: what bodies and pairs remember, resistance, impulse over a step, and pull.

Every particle carries liquid, the field `liquid`. A bridge joins two particles, or a particle and a wall, from where
their films touch until it is stretched too far (:mod:`~cfddem.particles.interactions.bridge_changes`).

The resistance of a bridge acts by impulses between the kick and the drift, as films do: each body gives each of its
bridges the part of its mass that the bridge has in the body's total resistance, and the pair so made is solved. Along
the line of centres the resistance is integrated over the gap, so that impulses add up to the potential between the
first gap and the last. Across it the solution is exact for a fixed gap. The pull is an ordinary force.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline, part, prange
from cfddem.backend.errors import InputError
from cfddem.data.fields import Field
from cfddem.particles.interactions.bridge_law import BridgeNumbers
from cfddem.particles.interactions.bridge_solution import at_gap, held_gap, speed_after_bridge
from cfddem.particles.interactions.film import clamp_speed
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
from cfddem.particles.pair_graph import edge_role, geometry
from cfddem.particles.state import Particles
from cfddem.particles.vectors import NOTHING, across, at, cross, dot, minus, plus, put, times

LIQUID = Field(
    "liquid", "m3", halo=("start",), snapshot=True, meaning="volume of the liquid film on the particle, without bridges"
)

PARTICLE_FIELDS = (
    LIQUID,
    Field("film_thickness", "m", role="scratch", halo=("motion",), meaning="thickness of the liquid on the particle"),
    Field("bridge_load", "kg/s", halo=("bridge",), meaning="resistance of all bridges of the particle"),
    Field("liquid_supply", "m3", role="scratch", halo=("liquid",), meaning="liquid of which new bridges take a share"),
    Field("bridges_formed", dtype=np.int64, meaning="bridges that have formed, counted by the lower id"),
    Field("bridges_broken", dtype=np.int64, meaning="bridges that have broken, counted by the lower id"),
)
"""Fields of particles that carry liquid."""

FIELDS = (
    Field("bridge_film", "m", role="memory", meaning="thickness of both films when the bridge formed; 0 without one"),
    Field("bridge_volume", "m3", role="memory", meaning="volume of the liquid in the bridge"),
    Field("bridge_gap", "m", role="memory", meaning="minimum gap of the bridge"),
    Field("bridge_accounted", "m", role="memory", meaning="gap up to which the impulse of the bridge has been given"),
    Field("bridge_resistance", "kg/s", role="memory", meaning="resistance of the bridge; 0 where it has none"),
    Field("bridge_force", "N", 3, "memory", meaning="pull of the bridge on the first body"),
    Field("bridge_impulse", "N s", 3, "scratch", meaning="impulse of the bridge in this step, on the first body"),
    Field("bridge_couple", "N s", 3, "scratch", meaning="angular impulse per radius, the same on both bodies"),
    Field(
        "bridge_change", role="scratch", dtype=np.int8, meaning="1 where a bridge forms, -1 where one breaks, else 0"
    ),
)
"""What pairs remember of their bridges."""

FLAT = 1e100
"""Radius of a wall, in the laws that share liquid [m]."""


def film_volume(radius: np.ndarray, thickness: np.ndarray | float) -> np.ndarray:
    """Volume of a layer of liquid all over a sphere (N,) [m3].

    radius     of the spheres (N,) [m]
    thickness  of the layer (N,), or one for all [m]
    """
    volume: np.ndarray = 4.0 / 3.0 * np.pi * thickness * (thickness**2 + 3.0 * radius * (thickness + radius))
    return volume


def film_thickness(radius: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """Thickness of a layer of liquid all over a sphere (N,) [m]; see `film_volume`."""
    thickness: np.ndarray = radius * np.expm1(np.log1p(3.0 * volume / (4.0 * np.pi * radius**3)) / 3.0)
    return thickness


def coat(particles: Particles, thickness: np.ndarray | float) -> None:
    """Give particles a film of liquid.

    thickness  of the film on each (N,), or one for all [m]
    """
    films = np.broadcast_to(np.asarray(thickness, float), (particles.count,))
    refused = np.flatnonzero(~((films >= 0.0) & np.isfinite(films)))
    if len(refused):
        row = int(refused[0])
        raise InputError(f"film of particle {particles.id[row]}", float(films[row]), "at least 0 and finite")
    particles.declare(LIQUID)
    particles.liquid = film_volume(particles.radius, films)


@inline
def numbers_of(p):
    """The numbers of the bridge laws, among those that loops take."""
    return BridgeNumbers(p[-9], p[-8], p[-7], p[-6], p[-5], p[-4], p[-3], p[-2])


@inline
def bridge_state(k, gap, reduced_radius, memory, p, capillary_number=0.0):
    """The bridge of edge k as its laws see it, at a gap."""
    n = numbers_of(p)
    return BridgeState(
        gap, memory.bridge_film[k], memory.bridge_volume[k], reduced_radius, memory.bridge_gap[k],
        n.viscosity, n.surface_tension, n.contact_angle, capillary_number, p,
    )  # fmt: skip


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
def renew_bridge(k, particles, edges, memory, shift, p):
    """Resistance and pull of the bridge of edge k at the present positions."""
    separation, distance, gap = geometry(k, particles, edges, shift)
    reduced_radius, _ = pair_mass_and_radius(k, particles, edges)
    state = bridge_state(k, gap, reduced_radius, memory, p)
    memory.bridge_resistance[k] = resistance_along(state) + resistance_across(state)
    if BRIDGE_PULL:
        put(memory.bridge_force, k, times(-bridge_pull(state) / distance, separation))


@part
def renew_bridges(particles, edges, memory, shift, p):
    """Resistance and pull of all bridges."""
    for k in prange(len(edges.first)):
        if memory.bridge_film[k] > 0.0:
            renew_bridge(k, particles, edges, memory, shift, p)


@inline
def no_impulse(k, memory):
    """The bridge of edge k gives no impulse in this step."""
    put(memory.bridge_impulse, k, NOTHING)
    put(memory.bridge_couple, k, NOTHING)


@part
def find_bridge_impulses(particles, edges, memory, shift, p, step):
    """Impulses of all bridges over the coming step."""
    for k in prange(len(edges.first)):
        if memory.bridge_resistance[k] > 0.0:
            bridge_impulse(k, particles, edges, memory, shift, p, step)
        elif memory.bridge_film[k] > 0.0:
            no_impulse(k, memory)


@inline
def _rates(k, particles, edges, memory, lever):
    """Inverse masses that both bodies give the bridge of edge k, along and across the line of centres [1/kg].

    lever  arm of the impulse over the radius [-]
    """
    i, j = edges.first[k], edges.second[k]
    load = particles.bridge_load[i] / memory.bridge_resistance[k]
    arm = lever * particles.radius[i]
    along = load * particles.inverse_mass[i]
    across_it = along + load * arm * arm * particles.inverse_inertia[i]
    if k < edges.between_particles:
        load = particles.bridge_load[j] / memory.bridge_resistance[k]
        arm = lever * particles.radius[j]
        along += load * particles.inverse_mass[j]
        across_it += load * (particles.inverse_mass[j] + arm * arm * particles.inverse_inertia[j])
    return along, across_it


@inline
def bridge_impulse(k, particles, edges, memory, shift, p, step):
    """Impulse and couple of the bridge of edge k over the coming step.

    Lever arms add up to the distance of the centres, so that angular momentum is kept.
    """
    i, j = edges.first[k], edges.second[k]
    separation, distance, gap = geometry(k, particles, edges, shift)
    normal = times(1.0 / distance, separation)
    reduced_radius, _ = pair_mass_and_radius(k, particles, edges)
    state = bridge_state(k, gap, reduced_radius, memory, p)
    velocity = relative_velocity(k, particles, edges)
    turning, radii = times(particles.radius[i], at(particles.spin, i)), particles.radius[i]
    if k < edges.between_particles:
        turning, radii = plus(turning, times(particles.radius[j], at(particles.spin, j))), radii + particles.radius[j]
    lever = distance / radii
    along, sideways = _rates(k, particles, edges, memory, lever)

    speed = new_speed = dot(velocity, normal)
    if BRIDGE_FILM:
        new_speed = speed_after_bridge(speed, state, memory.bridge_accounted[k], step, along)
        new_speed = clamp_speed(new_speed, speed)
    memory.bridge_accounted[k] = gap + step * new_speed
    impulse = times((new_speed - speed) / along, normal)
    couple = NOTHING
    if BRIDGE_SLIDING:
        resistance = resistance_across(at_gap(state, gap + 0.5 * step * new_speed))
        slip = minus(across(velocity, normal), times(lever, cross(turning, normal)))
        drag = times(math.expm1(-step * resistance * sideways) / sideways, slip)
        impulse = plus(impulse, drag)
        couple = times(-lever, cross(normal, drag))
    put(memory.bridge_impulse, k, impulse)
    put(memory.bridge_couple, k, couple)


@part
def apply_bridge_impulses(particles, edges, memory):
    """Give every particle the impulses of its bridges."""
    for i in prange(particles.owned):
        impulse, couple = NOTHING, NOTHING
        for place in range(edges.start[i], edges.start[i + 1]):
            k, sign = edge_role(edges.incident[place])
            if memory.bridge_resistance[k] > 0.0:
                impulse = plus(impulse, times(sign, at(memory.bridge_impulse, k)))
                couple = plus(couple, at(memory.bridge_couple, k))
        gain = times(particles.inverse_mass[i], impulse)
        put(particles.velocity, i, plus(at(particles.velocity, i), gain))
        gain = times(particles.inverse_inertia[i] * particles.radius[i], couple)
        put(particles.spin, i, plus(at(particles.spin, i), gain))
