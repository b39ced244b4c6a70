"""Collisions: from the moment two particles come within reach of each other until they leave it again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cfddem.backend.compile import inline
from cfddem.model.fields import Field
from cfddem.particles.interactions.kinematics import (
    pair_mass_and_radius,
    pair_row,
    pair_viscosity,
    relative_velocity,
)
from cfddem.particles.interactions.slots import BRIDGE, FILM
from cfddem.particles.pair_graph import geometry
from cfddem.particles.vectors import across, at, dot, put, times
from cfddem.particles.walls.nearest_point import portion
from closures.friction import dry_or_lubricated
from closures.minimum_gap import elastohydrodynamic
from closures.numbers import stokes

COLLISION_FIELDS = (
    Field("first", dtype=np.int64, meaning="id of the first body"),
    Field("second", dtype=np.int64, meaning="id of the second body; -1 - w for wall w"),
    Field("begin", "s", meaning="time when the pair came within range"),
    Field("end", "s", meaning="time when the pair left the range"),
    Field("place", "m", 3, meaning="position of the first body at the end"),
    Field("stokes", meaning="Stokes number of the normal approach; infinite without a film"),
    Field("approach_speed", "m/s", meaning="normal speed when the pair came within range"),
    Field("minimum_gap", "m", meaning="minimum gap of the film"),
    Field("roughness_gap", "m", meaning="gap at which asperities touch"),
    Field("elastohydrodynamic_gap", "m", meaning="gap at which the film pressure deforms the solids"),
    Field("deformed", dtype=bool, meaning="1 if the film pressure, not the asperities, sets the minimum gap"),
    Field("friction", meaning="coefficient of friction that applies"),
    Field("restitution", meaning="normal speed after over before"),
    Field("restitution_tangential", meaning="tangential speed after over before; NaN for a head-on collision"),
    Field("closest_gap", "m", meaning="smallest gap of the pair; below the minimum gap the solids touched"),
    Field("lost_to_film", "J", meaning="energy dissipated by the film; NaN without an energy budget"),
    Field("lost_to_contact", "J", meaning="energy dissipated by contact damping"),
    Field("lost_to_friction", "J", meaning="energy dissipated by sliding"),
    Field("weight", meaning="number of collisions that the row represents"),
)
"""Columns of the record."""


def collision_row(fields: Sequence[Field]) -> np.dtype:
    """One row of a record with these columns."""
    return np.dtype([(field.name, field.dtype, field.shape) for field in fields], align=True)


COLLISION = collision_row(COLLISION_FIELDS)
"""One row of the record."""

WET_COLLISION_FIELDS = (
    *COLLISION_FIELDS,
    Field("wet", dtype=bool, meaning="1 if a liquid bridge joined the bodies"),
    Field("lost_to_bridge", "J", meaning="energy dissipated by the bridge; NaN without an energy budget"),
)
"""Columns of the record where particles carry liquid; a collision lasts as long as a bridge."""

FIELDS = (
    Field("begin", "s", role="memory", initial=np.nan, meaning="time at which the collision began; NaN outside one"),
    Field("begin_speed", "m/s", role="memory", meaning="normal speed at the start"),
    Field("begin_slip", "m/s", 3, "memory", meaning="tangential velocity at the start"),
    Field("closest_gap", "m", role="memory", meaning="smallest gap since the start"),
    Field("lost", "J", 3, "memory", initial=np.nan, meaning="energy lost to film, dashpot, friction since the start"),
)
"""Memory of pairs whose collisions are recorded; `lost` is NaN where energies are not counted."""

WET_FIELDS = (
    Field("wet", role="memory", dtype=bool, meaning="a bridge has joined the bodies since the start"),
    Field("lost_to_bridge", "J", role="memory", initial=np.nan, meaning="energy lost to the bridge since the start"),
)
"""Further memory where particles carry liquid."""

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
        if BRIDGE:
            memory.wet[to], memory.lost_to_bridge[to] = memory.wet[k], memory.lost_to_bridge[k]
    memory.begin[k] = np.nan


@inline
def record_event(k, system, time, rows, count):
    """Store the start of a collision, or write a row at its end; returns the number of rows."""
    particles, edges, memory, walls = system.particles, system.edges, system.memory, system.walls
    separation, distance, gap = geometry(k, system)
    reduced_radius, inverse_mass = pair_mass_and_radius(k, system)
    reach = system.parameters.cutoff_ratio * reduced_radius if FILM else 0.0
    recorded = not np.isnan(memory.begin[k])
    if recorded and gap < memory.closest_gap[k]:
        memory.closest_gap[k] = gap
    inside = gap <= reach
    if BRIDGE and memory.bridge_film[k] > 0.0:
        inside = memory.wet[k] = True
    if recorded == inside or portion(edges, k) == 0.0:
        return count
    normal = times(1.0 / distance, separation)
    velocity = relative_velocity(k, system)
    normal_speed, tangential = dot(velocity, normal), across(velocity, normal)
    if not recorded:
        memory.begin[k], memory.begin_speed[k], memory.closest_gap[k] = time, normal_speed, gap
        put(memory.begin_slip, k, tangential)
        put(memory.lost, k, NOT_COUNTED)
        if BRIDGE:
            memory.wet[k], memory.lost_to_bridge[k] = memory.bridge_film[k] > 0.0, np.nan
        return count

    row, materials = rows[count], pair_row(k, system)
    i, j = edges.first[k], edges.second[k]
    row.first, row.second = particles.id[i], particles.id[j] if k < edges.between_particles else -1 - walls.wall[j]
    row.begin, row.end = memory.begin[k], time
    for axis in range(3):
        row.place[axis] = at(particles.position, i)[axis]
    speed, before = -memory.begin_speed[k], at(memory.begin_slip, k)
    row.approach_speed = speed
    row.stokes = stokes(1.0 / inverse_mass, speed, pair_viscosity(k, system), reduced_radius) if FILM else np.inf
    row.minimum_gap = memory.minimum_gap[k]
    row.roughness_gap, row.elastohydrodynamic_gap = materials.roughness_gap, 0.0
    if FILM and speed > 0.0:
        viscosity = pair_viscosity(k, system)
        row.elastohydrodynamic_gap = elastohydrodynamic(viscosity, speed, materials.film_modulus, reduced_radius)
    row.deformed = row.minimum_gap > materials.roughness_gap
    row.friction = dry_or_lubricated(
        row.minimum_gap, materials.roughness_gap, materials.friction, materials.friction_lubricated
    )
    row.restitution = normal_speed / speed
    sideways = dot(before, before)
    row.restitution_tangential = dot(tangential, before) / sideways if sideways > 0.0 else np.nan
    row.lost_to_film, row.lost_to_contact, row.lost_to_friction = at(memory.lost, k)
    if BRIDGE:
        row.wet, row.lost_to_bridge = memory.wet[k], memory.lost_to_bridge[k]
    row.closest_gap, row.weight = memory.closest_gap[k], 1.0
    memory.begin[k] = np.nan
    return count + 1 if i < particles.owned else count  # the owner of the first body keeps the row
