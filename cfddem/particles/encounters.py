"""Encounters: from the moment two bodies come within reach of each other until they leave it again."""

from __future__ import annotations

import numpy as np

from cfddem.kernels import inline
from cfddem.particles.forces import pair_mass_and_radius, pair_row, pair_viscosity, relative_velocity
from cfddem.particles.pairs import CLOSEST, ENTRY, LOST, geometry
from cfddem.particles.surfaces import portion
from cfddem.particles.vectors import across, at, dot, times
from closures.friction import dry_or_lubricated
from closures.minimum_gap import elastohydrodynamic
from closures.numbers import stokes

ENCOUNTER = np.dtype(
    [
        ("first", "i8"),  # id of the first body
        ("second", "i8"),  # id of the second body; -1 - w for wall w
        ("begin", "f8"),  # time when the pair came within reach [s]
        ("end", "f8"),  # time when it left again [s]
        ("place", "f8", (3,)),  # where the first body was at the end [m]
        ("stokes", "f8"),  # of the approach, normal; infinite without a film [-]
        ("approach_speed", "f8"),  # normal speed at the begin [m/s]
        ("minimum_gap", "f8"),  # h_min [m]
        ("roughness_gap", "f8"),  # h_sigma, the smallest that h_min can be [m]
        ("elastohydrodynamic_gap", "f8"),  # h_eps at the approach speed; above h_sigma it is h_min [m]
        ("deformed", "?"),  # the film's pressure, not the asperities, set h_min
        ("friction", "f8"),  # coefficient in force [-]
        ("restitution", "f8"),  # normal speed out over in [-]
        ("restitution_tangential", "f8"),  # tangential speed out over in; NaN for a head-on meeting [-]
        ("closest_gap", "f8"),  # smallest gap that the pair came to; below h_min the solids met [m]
        ("lost_to_film", "f8"),  # energy, NaN where energies are not counted [J]
        ("lost_to_contact", "f8"),  # energy, by the dashpot of the solids; likewise [J]
        ("lost_to_friction", "f8"),  # energy, by sliding; likewise [J]
        ("weight", "f8"),  # how many encounters the row stands for: 1 unless the record is sampled [-]
    ],
    align=True,
)


@inline
def observe(k, bodies, edges, walls, shift, table, laws, time, rows, count):
    """Note the begin of an encounter, or write a row at its end; returns the number of rows.

    What an edge keeps meanwhile stands in `Edges.entry`.
    """
    separation, distance, gap = geometry(k, bodies, edges, shift)
    reduced_radius, inverse_mass = pair_mass_and_radius(k, bodies, edges)
    reach = laws.cutoff_ratio * reduced_radius if laws.film else 0.0
    entry = ENTRY * k
    known = not np.isnan(edges.entry[entry])
    if known and gap < edges.entry[entry + CLOSEST]:
        edges.entry[entry + CLOSEST] = gap
    if known == (gap <= reach) or portion(edges, k) == 0.0:
        return count
    normal = times(1.0 / distance, separation)
    velocity = relative_velocity(k, bodies, edges)
    normal_speed, tangential = dot(velocity, normal), across(velocity, normal)
    if not known:
        edges.entry[entry], edges.entry[entry + 1] = time, normal_speed
        edges.entry[entry + 2], edges.entry[entry + 3], edges.entry[entry + 4] = tangential
        edges.entry[entry + CLOSEST] = gap
        for channel in range(3):
            edges.entry[entry + LOST + channel] = np.nan
        return count

    row, materials = rows[count], pair_row(k, bodies, edges, walls, table)
    i, j = edges.first[k], edges.second[k]
    row.first, row.second = bodies.id[i], bodies.id[j] if k < edges.between_particles else -1 - walls.wall[j]
    row.begin, row.end = edges.entry[entry], time
    for axis in range(3):
        row.place[axis] = at(bodies.position, i)[axis]
    speed = -edges.entry[entry + 1]
    before = (edges.entry[entry + 2], edges.entry[entry + 3], edges.entry[entry + 4])
    row.approach_speed = speed
    row.stokes = (
        stokes(1.0 / inverse_mass, speed, pair_viscosity(k, bodies, edges), reduced_radius) if laws.film else np.inf
    )
    row.minimum_gap = edges.minimum_gap[k]
    row.roughness_gap, row.elastohydrodynamic_gap = materials.roughness_gap, 0.0
    if laws.film and speed > 0.0:
        viscosity = pair_viscosity(k, bodies, edges)
        row.elastohydrodynamic_gap = elastohydrodynamic(viscosity, speed, materials.film_modulus, reduced_radius)
    row.deformed = row.minimum_gap > materials.roughness_gap
    row.friction = dry_or_lubricated(
        row.minimum_gap, materials.roughness_gap, materials.friction, materials.friction_lubricated
    )
    row.restitution = normal_speed / speed
    sideways = dot(before, before)
    row.restitution_tangential = dot(tangential, before) / sideways if sideways > 0.0 else np.nan
    row.lost_to_film, row.lost_to_contact = edges.entry[entry + LOST], edges.entry[entry + LOST + 1]
    row.lost_to_friction = edges.entry[entry + LOST + 2]
    row.closest_gap, row.weight = edges.entry[entry + CLOSEST], 1.0
    edges.entry[entry] = np.nan
    return count + 1
