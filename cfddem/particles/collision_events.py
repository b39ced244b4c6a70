"""Collisions: from the moment two particles come within reach of each other until they leave it again."""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline
from cfddem.data.fields import Field
from cfddem.particles.interactions.kinematics import (
    pair_mass_and_radius,
    pair_row,
    pair_viscosity,
    relative_velocity,
)
from cfddem.particles.interactions.slots import FILM
from cfddem.particles.pair_graph import geometry
from cfddem.particles.vectors import across, at, dot, put, times
from cfddem.particles.walls.nearest_point import portion
from closures.friction import dry_or_lubricated
from closures.minimum_gap import elastohydrodynamic
from closures.numbers import stokes

COLLISION = np.dtype(
    [
        ("first", "i8"),  # id of the first body
        ("second", "i8"),  # id of the second body; -1 - w for wall w
        ("begin", "f8"),  # time when the pair came within reach [s]
        ("end", "f8"),  # time when it left again [s]
        ("place", "f8", (3,)),  # where the first body was at the end [m]
        ("stokes", "f8"),  # of the approach, normal; infinite without a film [-]
        ("approach_speed", "f8"),  # normal speed at the start [m/s]
        ("minimum_gap", "f8"),  # h_min [m]
        ("roughness_gap", "f8"),  # h_sigma, the smallest that h_min can be [m]
        ("elastohydrodynamic_gap", "f8"),  # h_eps at the approach speed; above h_sigma it is h_min [m]
        ("deformed", "?"),  # the film's pressure, not the asperities, set h_min
        ("friction", "f8"),  # coefficient in force [-]
        ("restitution", "f8"),  # normal speed out over in [-]
        ("restitution_tangential", "f8"),  # tangential speed out over in; NaN for a head-on collision [-]
        ("closest_gap", "f8"),  # smallest gap of the collision; below h_min the solids touched [m]
        ("lost_to_film", "f8"),  # energy, NaN where energies are not counted [J]
        ("lost_to_contact", "f8"),  # energy, by the dashpot of the solids; likewise [J]
        ("lost_to_friction", "f8"),  # energy, by sliding; likewise [J]
        ("weight", "f8"),  # how many collisions the row stands for: 1 unless the record is sampled [-]
    ],
    align=True,
)


FIELDS = (
    Field("begin", "s", role="memory", initial=np.nan, meaning="time at which the collision began; NaN outside one"),
    Field("begin_speed", "m/s", role="memory", meaning="normal speed at the start"),
    Field("begin_slip", "m/s", 3, "memory", flips=True, meaning="tangential velocity at the start"),
    Field("closest_gap", "m", role="memory", meaning="smallest gap since the start"),
    Field("lost", "J", 3, "memory", initial=np.nan, meaning="energy lost to film, dashpot, friction since the start"),
)
"""Memory of pairs whose collisions are recorded; `lost` is NaN where energies are not counted."""

NOT_COUNTED = (np.nan, np.nan, np.nan)


@inline
def move_event(memory, k, to):
    """Let the collision of edge k continue at another edge, unless that one has an earlier collision."""
    if np.isnan(memory.begin[k]):
        return
    if np.isnan(memory.begin[to]) or memory.begin[k] < memory.begin[to]:
        memory.begin[to], memory.begin_speed[to] = memory.begin[k], memory.begin_speed[k]
        memory.closest_gap[to] = memory.closest_gap[k]
        put(memory.begin_slip, to, at(memory.begin_slip, k))
        put(memory.lost, to, at(memory.lost, k))
    memory.begin[k] = np.nan


@inline
def record_event(k, particles, edges, memory, walls, shift, table, cutoff_ratio, time, rows, count):
    """Store the start of a collision, or write a row at its end; returns the number of rows."""
    separation, distance, gap = geometry(k, particles, edges, shift)
    reduced_radius, inverse_mass = pair_mass_and_radius(k, particles, edges)
    reach = cutoff_ratio * reduced_radius if FILM else 0.0
    known = not np.isnan(memory.begin[k])
    if known and gap < memory.closest_gap[k]:
        memory.closest_gap[k] = gap
    if known == (gap <= reach) or portion(edges, k) == 0.0:
        return count
    normal = times(1.0 / distance, separation)
    velocity = relative_velocity(k, particles, edges)
    normal_speed, tangential = dot(velocity, normal), across(velocity, normal)
    if not known:
        memory.begin[k], memory.begin_speed[k], memory.closest_gap[k] = time, normal_speed, gap
        put(memory.begin_slip, k, tangential)
        put(memory.lost, k, NOT_COUNTED)
        return count

    row, materials = rows[count], pair_row(k, particles, edges, walls, table)
    i, j = edges.first[k], edges.second[k]
    row.first, row.second = particles.id[i], particles.id[j] if k < edges.between_particles else -1 - walls.wall[j]
    row.begin, row.end = memory.begin[k], time
    for axis in range(3):
        row.place[axis] = at(particles.position, i)[axis]
    speed, before = -memory.begin_speed[k], at(memory.begin_slip, k)
    row.approach_speed = speed
    row.stokes = (
        stokes(1.0 / inverse_mass, speed, pair_viscosity(k, particles, edges), reduced_radius) if FILM else np.inf
    )
    row.minimum_gap = memory.minimum_gap[k]
    row.roughness_gap, row.elastohydrodynamic_gap = materials.roughness_gap, 0.0
    if FILM and speed > 0.0:
        viscosity = pair_viscosity(k, particles, edges)
        row.elastohydrodynamic_gap = elastohydrodynamic(viscosity, speed, materials.film_modulus, reduced_radius)
    row.deformed = row.minimum_gap > materials.roughness_gap
    row.friction = dry_or_lubricated(
        row.minimum_gap, materials.roughness_gap, materials.friction, materials.friction_lubricated
    )
    row.restitution = normal_speed / speed
    sideways = dot(before, before)
    row.restitution_tangential = dot(tangential, before) / sideways if sideways > 0.0 else np.nan
    row.lost_to_film, row.lost_to_contact, row.lost_to_friction = at(memory.lost, k)
    row.closest_gap, row.weight = memory.closest_gap[k], 1.0
    memory.begin[k] = np.nan
    return count + 1
