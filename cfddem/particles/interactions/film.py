"""Lubrication film between two bodies: its resistance, and what it remembers.

A film remembers its approach, from when the pair comes within reach until it leaves it. Functions of numbers without
branches work on several pairs at once; the others work on one edge.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline
from cfddem.data.fields import Field
from cfddem.particles.interactions.film_law import at_least
from cfddem.particles.interactions.kinematics import (
    pair_mass_and_radius,
    pair_row,
    pair_viscosity,
    relative_velocity,
)
from cfddem.particles.interactions.shear_film import edge_asymmetry, renew_shear
from cfddem.particles.interactions.slots import (
    COUNT_FILM,
    COUNT_GAP,
    SHEAR,
    USER_GAP,
    FilmState,
    GapState,
    explicit_resistance,
    film_outside,
    film_resistance,
    gap_outside,
    user_minimum_gap,
)
from cfddem.particles.pair_graph import THICKEST, geometry
from cfddem.particles.vectors import dot, times
from cfddem.particles.walls.nearest_point import portion
from closures.minimum_gap import elastohydrodynamic, elastohydrodynamic_speed

FIELDS = (
    Field("resistance", "kg/s", role="memory", meaning="resistance of the film without lever; 0 out of its reach"),
    Field("approach_speed", "m/s", role="memory", meaning="largest approach speed since the film began"),
    Field("accounted_gap", "m", role="memory", initial=np.inf, meaning="gap from which the film acts in this step"),
    Field("film_gap", "m", role="memory", meaning="gap of two particles at the present positions"),
    Field("film_normal", "1", 3, "memory", meaning="direction from the second particle to the first"),
    Field("impulse", "N s", 3, "memory", meaning="impulse of the film in the last step, on the first body"),
    Field("faster", role="scratch", dtype=bool, meaning="the bodies approach faster than before in this film"),
)

OUTSIDE = Field("outside", role="scratch", dtype=int, meaning="uses of a law outside of its range")
"""Of pairs with a user's law of the film or the minimum gap."""


@inline
def minimum_gap_of(approach_speed, viscosity, reduced_radius, row):
    """Minimum gap by the user's law, at least that of asperities, at most what neighbour lists allow; may be NaN."""
    gap = user_minimum_gap(GapState(row.roughness_gap, approach_speed, viscosity, row.film_modulus, reduced_radius))
    return max(row.roughness_gap, min(gap, THICKEST * reduced_radius)) if gap == gap else gap


@inline
def update_film(gap, viscosity, reduced_radius, memory, row, cutoff_ratio):
    """Resistance of a film, and its memory; the memory begins anew where the pair comes within reach.

    memory   resistance, approach speed, minimum gap and accounted gap of the step before
    row      of the pair table
    returns  the same four as they are now
    """
    resistance, approach_speed, minimum_gap, accounted_gap = memory
    roughness = row.roughness_gap
    within = gap <= cutoff_ratio * reduced_radius
    begins = within and resistance == 0.0
    unknown = accounted_gap == np.inf
    approach_speed = 0.0 if begins else approach_speed
    minimum_gap = roughness if begins or (unknown and not within) else minimum_gap
    if USER_GAP:
        minimum_gap = minimum_gap_of(0.0, viscosity, reduced_radius, row) if begins else minimum_gap
    accounted_gap = accounted_gap if begins and not unknown else gap  # a film begins where it was in the last step
    state = FilmState(max(gap, minimum_gap), viscosity, reduced_radius, minimum_gap, cutoff_ratio * reduced_radius)
    return film_resistance(state) if within else 0.0, approach_speed, minimum_gap, accounted_gap


@inline
def renew_film(k, gap, viscosity, reduced_radius, share, memory, row, cutoff_ratio):
    """Update resistance and memory of the film of edge k.

    share  part of the film that belongs to this edge: below 1 where triangles of a mesh share one
    """
    then = (memory.resistance[k], memory.approach_speed[k], memory.minimum_gap[k], memory.accounted_gap[k])
    resistance, approach_speed, minimum_gap, accounted_gap = update_film(
        gap, viscosity, reduced_radius, then, row, cutoff_ratio
    )
    memory.resistance[k], memory.approach_speed[k] = share * resistance, approach_speed
    memory.minimum_gap[k], memory.accounted_gap[k] = minimum_gap, accounted_gap


@inline
def update_edge_film(k, system):
    """Update the film of edge k."""
    edges, memory = system.edges, system.memory
    _, _, gap = geometry(k, system)
    reduced_radius, _ = pair_mass_and_radius(k, system)
    viscosity = pair_viscosity(k, system)
    row = pair_row(k, system)
    renew_film(k, gap, viscosity, reduced_radius, portion(edges, k), memory, row, system.parameters.cutoff_ratio)
    if SHEAR:
        asymmetry = edge_asymmetry(k, system)
        renew_shear(k, gap, viscosity, reduced_radius, asymmetry, portion(edges, k), memory)


@inline
def record_approach(k, memory, normal_speed, gap, viscosity, reduced_radius, row):
    """Remember the largest approach speed and the minimum gap that belongs to it."""
    if not (-normal_speed > memory.approach_speed[k] and gap > memory.minimum_gap[k]):
        return
    if USER_GAP:
        memory.approach_speed[k] = -normal_speed
        memory.minimum_gap[k] = minimum_gap_of(-normal_speed, viscosity, reduced_radius, row)
        if COUNT_GAP:
            memory.outside[k] += gap_outside(
                GapState(row.roughness_gap, -normal_speed, viscosity, row.film_modulus, reduced_radius)
            )
    else:
        # slower approaches end on asperities and need not be recorded
        slowest = elastohydrodynamic_speed(row.roughness_gap, viscosity, row.film_modulus, reduced_radius)
        memory.approach_speed[k] = max(-normal_speed, slowest)
        deformed = elastohydrodynamic(viscosity, -normal_speed, row.film_modulus, reduced_radius)
        memory.minimum_gap[k] = max(row.roughness_gap, min(deformed, THICKEST * reduced_radius))


@inline
def film_force(k, system):
    """The film of edge k as an explicit force, for plain velocity Verlet."""
    edges, memory = system.edges, system.memory
    separation, distance, gap = geometry(k, system)
    reduced_radius, _ = pair_mass_and_radius(k, system)
    normal = times(1.0 / distance, separation)
    normal_speed = dot(relative_velocity(k, system), normal)
    viscosity = pair_viscosity(k, system)
    row = pair_row(k, system)
    record_approach(k, memory, normal_speed, gap, viscosity, reduced_radius, row)
    cutoff_gap = system.parameters.cutoff_ratio * reduced_radius
    film = FilmState(gap, viscosity, reduced_radius, memory.minimum_gap[k], cutoff_gap)
    if COUNT_FILM and memory.resistance[k] > 0.0:
        memory.outside[k] += film_outside(at_least(film))
    return times(-portion(edges, k) * explicit_resistance(film) * normal_speed, normal)
