"""Films and bridges whose impulses act over a step: their fields, and the list of those that are solved together.

Weak films act by themselves (`cfddem.particles.interactions.film`), and so do closed bridges that are not stiff
(`cfddem.particles.interactions.bridge_apart`). All other films and bridges that resist are solved together
(`cfddem.particles.interactions.joint_solution`), a film and a bridge of one pair as one.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, part, prange
from cfddem.model.fields import Field
from cfddem.particles.interactions.film import LEAP, WEAK, WEAK_FIELDS, record_approach
from cfddem.particles.interactions.kinematics import (
    pair_mass_and_radius,
    pair_row,
    pair_viscosity,
    relative_velocity,
)
from cfddem.particles.interactions.shear_film import put_impulses
from cfddem.particles.interactions.slots import BRIDGE_APART, BRIDGE_RESISTS, DRIFTING, SHEAR, FilmState
from cfddem.particles.pair_graph import edge_role, geometry, places_of
from cfddem.particles.vectors import NOTHING, across, dot, put, times

FIELDS = (
    *WEAK_FIELDS,
    Field("impulse", "N s", 3, "memory", meaning="impulse of a film solved with others in the last step, on the first"),
)
"""Of pairs whose films act by impulses."""

JOINT_FIELDS = (
    Field("joint_row", role="scratch", dtype=np.int32, meaning="place of the film among those solved together"),
    Field("joint_edge", role="scratch", dtype=np.int32, meaning="pair of each film solved together"),
    Field("joint_first", role="scratch", dtype=np.int32, meaning="its first body"),
    Field("joint_second", role="scratch", dtype=np.int32, meaning="its second body; below 0 at a wall"),
    Field("joint_share", role="scratch", meaning="part of the film that belongs to the edge; 0 without one"),
    Field("joint_viscosity", "Pa s", role="scratch", meaning="of the film"),
    Field("joint_reduced_radius", "m", role="scratch", meaning="R*"),
    Field("joint_minimum_gap", "m", role="scratch", meaning="h_min"),
    Field(
        "joint_incident", "1", 2, "scratch", dtype=np.int32, meaning="of each particle, edges whose films are solved"
    ),
    Field("joint_normal", "1", 3, "scratch", meaning="direction from the second body to the first"),
    Field("joint_weight", "1/kg", role="scratch", meaning="sum of the inverse masses"),
    Field("joint_before", "m/s", role="scratch", meaning="rate of the gap before all impulses, with that of passing"),
    Field("joint_gap", "m", role="scratch", meaning="gap at the beginning of the step"),
    Field("joint_speed", "m/s", role="scratch", meaning="rate of the gap for which the resistance holds"),
    Field("joint_shift", "m/s", role="scratch", meaning="change of that rate since"),
    Field("joint_least", "kg/s", role="scratch", meaning="least resistance of the film"),
    Field("joint_compliance", "1/kg", role="scratch", meaning="1/(resistance times step)"),
    Field("joint_debt", "N s", role="scratch", meaning="impulse that a film owes for its way before the step"),
    Field("joint_impulse", "N s", role="scratch", meaning="normal impulse"),
    Field("joint_residual", "m/s", role="scratch", meaning="of the equation of the normal impulse"),
    Field("joint_direction", "N s", role="scratch", meaning="of conjugate gradients"),
    Field("joint_product", "m/s", role="scratch", meaning="matrix times direction"),
    Field("joint_terms", "1", 4, "scratch", meaning="terms of sums over all films"),
)
"""Of pairs whose films or bridges are solved together. All but `joint_row` hold one row for each of these."""

_0, _1 = np.uint64(0), np.uint64(1)

LARGE_TURN = 0.1
"""Angle by which the normal turns in a step, above which terms of second order in the step say nothing [rad]."""

BRIDGE_FIELDS = (
    Field("joint_bridge", role="scratch", meaning="part of the bridge in the impulse without the debt"),
    Field("joint_floor", "m", role="scratch", meaning="gap below which a bridge without a film resists evenly"),
)
"""The same of bridges."""

SHEAR_FIELDS = (
    Field("shear_impulse", "1", 9, "memory", meaning="the same against sliding, see `put_impulses` [N s, N m s]"),
)
"""Of pairs whose films resist sliding."""

SLIDING_FIELDS = (
    Field("joint_arms", "m", 2, "scratch", meaning="lever arms of slip on the first and the second body"),
    Field("joint_sliding", "1", 4, "scratch", meaning="compliances of slip, of both, of roll and of twist"),
    Field("joint_inverse", "1", 4, "scratch", meaning="preconditioner of slip, of both, of roll and of twist"),
    Field("joint_shear_impulse", "1", 6, "scratch", meaning="impulses against slip [N s], and roll and twist [N m s]"),
    Field("joint_shear_residual", "1", 6, "scratch", meaning="residuals of slip [m/s], and of roll and twist [rad/s]"),
    Field("joint_shear_direction", "1", 6, "scratch", meaning="directions of conjugate gradients"),
    Field("joint_shear_product", "1", 6, "scratch", meaning="matrix times direction"),
)
"""Rows of films and bridges that are solved together, where these resist sliding."""

WEAK_PARTICLE_FIELDS = (
    Field("film_gain", "m/s", 3, "scratch", halo=("work",), meaning="velocity given by weak films in the last step"),
    Field("film_spin_gain", "rad/s", 3, "scratch", halo=("work",), meaning="spin given by weak films in the last step"),
)
"""Fields of particles whose films act by impulses."""

PARTICLE_FIELDS = (
    Field("film_change", "m/s", 3, "scratch", halo=("film_change",), meaning="change of velocity by films"),
    Field("film_turn", "rad/s", 3, "scratch", halo=("film_change",), meaning="change of spin by films"),
    Field("film_along", "m/s", 3, "scratch", halo=("film_direction",), meaning="the same along the direction"),
    Field("film_turn_along", "rad/s", 3, "scratch", halo=("film_direction",), meaning="the same along the direction"),
    Field("joint_end", role="scratch", dtype=np.int64, meaning="end of the films of the particle in joint_incident"),
)
"""Fields of particles whose films or bridges are solved together."""

# ---------------------------------------------------------------- which films are solved together


@inline
def passing_rate(normal, distance, velocity, free, step):
    """Mean rate at which two spheres that pass each other part in a step beyond the speed along their normal.

    At most that speed: so a film takes what its gap changes, and gives no energy to a pair that turns as a whole.
    Nothing where the pair turns by more than `LARGE_TURN` in the step.

    velocity  of the first centre relative to the second
    """
    moving = (free[0] * velocity[0], free[1] * velocity[1], free[2] * velocity[2])
    aside = across(moving, normal)
    square = dot(aside, aside)
    if step * step * square > LARGE_TURN * LARGE_TURN * distance * distance:
        return 0.0
    return min(0.5 * step * square / distance, abs(dot(velocity, normal)))


@inline
def normal_of(k, system):
    """Direction from the second body of edge k to the first, as `renew_film` has it."""
    separation, distance, _ = geometry(k, system)
    return times(1.0 / distance, separation)


@inline
def film_at(k, gap, system):
    """The film of edge k."""
    reduced_radius, _ = pair_mass_and_radius(k, system)
    cutoff_gap = system.parameters.cutoff_ratio * reduced_radius
    return FilmState(gap, pair_viscosity(k, system), reduced_radius, system.memory.minimum_gap[k], cutoff_gap)


@inline
def note_approach(k, system):
    """Remember the speed of approach of edge k, the fastest since its film began."""
    memory = system.memory
    film = film_at(k, memory.film_gap[k], system)
    speed, row = dot(relative_velocity(k, system), normal_of(k, system)), pair_row(k, system)
    record_approach(k, memory, speed, film.gap, film.viscosity, film.reduced_radius, row)


@inline
def is_due(k, memory):
    """Whether the film or the bridge of edge k is solved with the others in the next step.

    A closed bridge that does not resist may open in the step: all bridges are that do not act by themselves.
    """
    if BRIDGE_APART:
        return memory.bridge_film[k] > 0.0 and memory.bridge_apart[k] == 0.0
    if DRIFTING and BRIDGE_RESISTS:
        return memory.film_due[k] or memory.bridge_film[k] > 0.0
    return memory.film_due[k] if DRIFTING else memory.bridge_film[k] > 0.0


@inline
def enter(k, row, system):
    """List edge k at a row; a film that has acted by itself so far begins with the impulse that it owes."""
    memory = system.memory
    if DRIFTING:
        if not memory.film_due[k]:
            stay_apart(k, system)
        elif not memory.film_solved[k]:
            memory.film_solved[k] = True
            put(memory.impulse, k, times(memory.film_owed[k], normal_of(k, system)))
    memory.joint_edge[row] = k
    memory.joint_row[k] = row


@inline
def leave(k, system):
    """Edge k is not solved with the others, perhaps not any more."""
    memory = system.memory
    if BRIDGE_RESISTS and memory.bridge_solved[k]:
        memory.bridge_solved[k] = False
        put(memory.bridge_impulse, k, NOTHING)
        put(memory.bridge_couple, k, NOTHING)
    if DRIFTING:
        stay_apart(k, system)


@inline
def stay_apart(k, system):
    """The film of edge k is not solved with the others, perhaps not any more, and may approach faster than ever."""
    memory = system.memory
    if memory.film_solved[k]:
        memory.film_solved[k] = False
        put(memory.impulse, k, NOTHING)
        if SHEAR:
            put_impulses(k, memory.shear_impulse, NOTHING, NOTHING, NOTHING)
    if memory.faster[k]:
        note_approach(k, system)


@part
def collect(system):
    """List the films that are solved together, and note fast approaches of all others; returns their number."""
    memory = system.memory
    number, counts = len(system.edges.first), np.zeros(CHUNKS + 1, np.int64)
    for chunk in prange(CHUNKS):
        count = 0
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            count += 1 if is_due(k, memory) else 0
        counts[chunk + 1] = count
    for chunk in range(CHUNKS):
        counts[chunk + 1] += counts[chunk]
    for chunk in prange(CHUNKS):
        row = counts[chunk]
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            if is_due(k, memory):
                enter(k, row, system)
                row += 1
            else:
                leave(k, system)
    return counts[CHUNKS]


@inline
def list_due(k, place, end, system):
    """Let edge k, at a place of `incident`, follow the listed ones of its particle if it is solved."""
    memory = system.memory
    memory.joint_incident[end] = system.edges.incident[place]
    return end + (_1 if is_due(k, memory) else _0)


@inline
def mark_due(k, system, step):
    """Solve the film of edge k with the others if it is not weak at this step."""
    memory = system.memory
    if memory.film_due[k] or memory.resistance[k] == 0.0:
        return
    leaps, gap, (_, weight) = False, memory.film_gap[k], pair_mass_and_radius(k, system)
    rate = memory.resistance[k] * weight * min(max(gap, 0.0) / memory.minimum_gap[k], 1.0)
    if memory.film_unmoved[k] and weight > 0.0:
        speed = dot(relative_velocity(k, system), normal_of(k, system))
        leaps = gap > memory.minimum_gap[k] and abs(step * speed) > LEAP * gap
    if leaps or step * rate >= WEAK:
        memory.film_due[k], memory.film_owed[k] = True, 0.0


@inline
def list_all_due(i, system):
    """List the edges of particle i that are solved with the others."""
    edges = system.edges
    end = np.uint64(edges.start[i])
    for place in places_of(i, edges):
        k, _ = edge_role(edges.incident[place])
        end = list_due(k, place, end, system)
    system.particles.joint_end[i] = end


@part
def find_due(system, step):
    """Find the films and bridges that are solved together at a step that may differ from the last one."""
    if DRIFTING:
        for k in prange(len(system.edges.first)):
            mark_due(k, system, step)
    for i in prange(system.particles.owned):
        list_all_due(i, system)
