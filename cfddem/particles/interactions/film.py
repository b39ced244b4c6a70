"""Lubrication film between two bodies: its resistance, what it remembers, and what it does if it is weak.

A film remembers its approach, from when the pair comes within reach until it leaves it. A weak film acts by itself at
the end of each step: its impulse is its resistance times the change of the gap in the step. All others are solved
together (`cfddem.particles.interactions.joint_solution`). Functions of numbers without branches work on several pairs
at once; the others work on one edge.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline
from cfddem.model.fields import Field
from cfddem.particles.interactions.film_law import at_gap, at_least
from cfddem.particles.interactions.kinematics import (
    pair_mass_and_radius,
    pair_row,
    pair_viscosity,
    relative_velocity,
)
from cfddem.particles.interactions.shear_film import motion_at_wall, renew_shear
from cfddem.particles.interactions.slots import (
    COUNT_FILM,
    COUNT_GAP,
    DRIFTING,
    SHEAR,
    TRIANGLES,
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
from cfddem.particles.vectors import NOTHING, dot, put, times
from cfddem.particles.walls.nearest_point import portion
from closures.minimum_gap import elastohydrodynamic, elastohydrodynamic_speed

FIELDS = (
    Field("resistance", "kg/s", role="memory", meaning="resistance of the film without lever; 0 out of its reach"),
    Field("approach_speed", "m/s", role="memory", meaning="largest approach speed since the film began"),
    Field("film_gap", "m", role="memory", initial=np.inf, meaning="gap at the present positions"),
)

WEAK = 1e-2
"""Damping number X below which a film acts by itself. The viscosity of a suspension at a solid fraction of 0.5 is the
same to 1e-5 with a tenth of it, and to 1e-4 with three times as much."""

STIFF = 0.1
"""Damping number above which a film that has begun or was weak gives the impulse for its way so far with the others."""

LEAP = 0.1
"""Change of the gap in a step, over the gap, above which a film is not weak: the resistance at the middle of the way is
the mean to a thousandth."""

WEAK_FIELDS = (
    Field("film_push", "N s", 3, "scratch", meaning="impulse of a film by itself in the last step, on the first body"),
    Field("film_owed", "N s", role="memory", meaning="impulse that a stiff film gives with the others"),
    Field("film_due", role="memory", dtype=bool, meaning="the film is solved with the others in the next step"),
    Field("film_solved", role="memory", dtype=bool, meaning="the film was solved with the others in the last step"),
    Field("film_unmoved", role="memory", dtype=bool, meaning="of a film whose change of the gap is not known yet"),
    Field("faster", role="memory", dtype=bool, meaning="the bodies approach faster than before in this film"),
)
"""What pairs remember of the films that act by themselves, and of which do."""

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

    memory   gap, resistance, approach speed and minimum gap of the step before
    row      of the pair table
    returns  the last three as they are now
    """
    before, resistance, approach_speed, minimum_gap = memory
    roughness = row.roughness_gap
    within = gap <= cutoff_ratio * reduced_radius
    begins = within and resistance == 0.0
    unknown = before == np.inf
    approach_speed = 0.0 if begins else approach_speed
    minimum_gap = roughness if begins or (unknown and not within) else minimum_gap
    if USER_GAP:
        minimum_gap = minimum_gap_of(0.0, viscosity, reduced_radius, row) if begins else minimum_gap
    state = FilmState(max(gap, minimum_gap), viscosity, reduced_radius, minimum_gap, cutoff_ratio * reduced_radius)
    return film_resistance(state) if within else 0.0, approach_speed, minimum_gap


@inline
def act_alone(k, film, normal, resistance, weight, share, memory, step):
    """What the film of edge k does by itself for the change of its gap, and whether it is weak.

    A film that has begun and is stiff owes this impulse: it gives it with the others.

    normal      direction from the second body to the first
    resistance  [kg/s]
    weight      sum of the inverse masses [1/kg]
    share       part of the film that belongs to this edge
    step        since the last positions; 0 if these are the same [s]
    """
    gap, before, minimum_gap = film.gap, memory.film_gap[k], film.minimum_gap
    # read and written in any case: stores under conditions take longer where a loop works on several pairs at once
    was_due, was_faster, owed = memory.film_due[k], memory.faster[k], memory.film_owed[k]
    solved, fastest = memory.film_solved[k], memory.approach_speed[k]
    moved = step > 0.0 and before < np.inf
    # the film acts down to gap 0; below the minimum gap its resistance is linear in the gap
    begin, end = min(max(before, 0.0), film.cutoff_gap), min(max(gap, 0.0), film.cutoff_gap)
    low, high = min(begin, minimum_gap), min(end, minimum_gap)
    below = film_resistance(at_gap(film, minimum_gap)) * 0.5 * (low + high) / minimum_gap
    middle = 0.5 * (max(begin, minimum_gap) + max(end, minimum_gap))
    above = film_resistance(at_gap(film, middle))
    taken = below * (high - low) + above * ((end - high) - (begin - low))
    impulse = -share * taken if moved and weight > 0.0 and not solved else 0.0
    # the lever is 0 for solids that overlap, and 1 above the minimum gap
    change = gap - before if moved else 0.0
    lever = min(max(gap, gap + change, 0.0) / minimum_gap, 1.0)
    leaps = gap > minimum_gap and abs(change) > LEAP * gap
    within = resistance > 0.0 and weight > 0.0
    rate = (np.inf if leaps else resistance * weight * lever) if within else 0.0
    due = step * rate >= WEAK if moved else was_due
    owes = due and step * above * weight > STIFF
    faster = within and gap > minimum_gap and begin - end > step * fastest
    memory.film_due[k], memory.film_unmoved[k] = due, not moved
    memory.faster[k] = faster if moved else was_faster
    memory.film_owed[k] = (impulse if owes else 0.0) if due and moved else owed
    put(memory.film_push, k, times(0.0 if owes else impulse, normal))
    if COUNT_FILM:
        memory.outside[k] += film_outside(at_least(film)) if within and moved else 0


@inline
def renew_film(k, between, viscosity, size, share, system, row, step):
    """Update the film of edge k: its resistance, and what it does if it acts by itself.

    between  separation from the second body to the first, distance and gap
    size     reduced radius [m], and sum of the inverse masses [1/kg]
    share    part of the film that belongs to this edge: below 1 where triangles of a mesh share one
    row      of the pair table
    step     since the last positions; 0 if these are the same [s]
    returns  direction from the second body to the first
    """
    memory, cutoff_ratio = system.memory, system.parameters.cutoff_ratio
    separation, distance, gap = between
    reduced_radius, weight = size
    fastest, least = memory.approach_speed[k], memory.minimum_gap[k]
    then = (memory.film_gap[k], memory.resistance[k], fastest, least)
    resistance, approach_speed, minimum_gap = update_film(gap, viscosity, reduced_radius, then, row, cutoff_ratio)
    memory.resistance[k] = share * resistance
    memory.approach_speed[k], memory.minimum_gap[k] = approach_speed, minimum_gap
    normal = times(1.0 / distance, separation)
    if DRIFTING:
        film = FilmState(gap, viscosity, reduced_radius, minimum_gap, cutoff_ratio * reduced_radius)
        act_alone(k, film, normal, share * resistance, weight, share, memory, step)
    memory.film_gap[k] = gap
    return normal


@inline
def update_edge_film(k, system, step):
    """Update the film of edge k."""
    between = geometry(k, system)
    size, viscosity = pair_mass_and_radius(k, system), pair_viscosity(k, system)
    share, row, memory = portion(system.edges, k), pair_row(k, system), system.memory
    normal = renew_film(k, between, viscosity, size, share, system, row, step)
    if TRIANGLES and DRIFTING and memory.resistance[k] == 0.0:  # its last gap may be that of the triangle beside it
        put(memory.film_push, k, NOTHING)
    if SHEAR:
        motion = motion_at_wall(k, normal, system)
        renew_shear(k, normal, (viscosity, size[0], -1.0, share), motion, memory, step)


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
