"""The bridge of one pair of particles, without branches: for the loops that work on several pairs at once.

Most bridges of a bed are closed: their gap is below h_min, where resistances do not depend on it. Loops over single
edges treat the others, which are open (:mod:`~cfddem.particles.interactions.bridge_changes`).
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from cfddem.backend.compile import inline
from cfddem.particles.interactions.bond import SMALLEST_GAP, dried, thinnest_film
from cfddem.particles.interactions.bridge import bridge_state
from cfddem.particles.interactions.bridge_apart import resist_apart
from cfddem.particles.interactions.bridge_solution import held_gap
from cfddem.particles.interactions.slots import BRIDGE_APART, BRIDGE_PULL, DRYING, bridge_pull
from cfddem.particles.pair_graph import of_two_spheres
from cfddem.particles.vectors import NOTHING, at, plus, put, times

WetParticles = namedtuple("WetParticles", "position radius film_thickness velocity spin inverse_mass bridge_load")
"""Arrays of the particles that loops over bridges read."""


@inline
def kept_separation(k, system):
    """Separation of a pair at the present positions, its length, and the sum of the radii."""
    particles, edges, memory = system.particles, system.edges, system.memory
    radii = particles.radius[edges.first[k]] + particles.radius[edges.second[k]]
    return at(memory.bridge_separation, k), memory.bridge_distance[k], radii


@inline
def pair_bridge(n, system, step):
    """Force of the bridge of a pair, its resistance if it is closed, and whether one forms.

    step  since the last positions; 0 if these are the same [s]
    """
    particles, edges, memory, shift, p = system.particles, system.edges, system.memory, system.shift, system.parameters
    k = np.uint64(n)
    i, j = edges.first[k], edges.second[k]
    separation, distance, radii = of_two_spheres(k, particles, edges, shift)
    put(memory.bridge_separation, k, separation)
    memory.bridge_distance[k] = distance
    gap, reduced_radius = distance - radii, particles.radius[i] * particles.radius[j] / radii
    state = bridge_state(k, gap, reduced_radius, memory, p)
    film = particles.film_thickness[i] + particles.film_thickness[j]
    bridged = memory.bridge_film[k] > 0.0
    floor = held_gap(state)
    closed = gap < floor
    thinnest = SMALLEST_GAP
    if DRYING:
        thinnest = max(thinnest, thinnest_film(reduced_radius, p.bridge.minimum_gap))
    forms = (not bridged) & (film > thinnest) & (gap < film)  # dry solids overlap without a bridge
    memory.bridge_change[k] = 1 if forms else 0
    memory.bridge_open[k] = bridged & (not closed)
    if DRYING:
        memory.bridge_open[k] = bridged & ((not closed) | dried(k, reduced_radius, memory))
    memory.bridge_resistance[k] = memory.closed_along[k] + memory.closed_across[k] if bridged & closed else 0.0
    force = NOTHING
    if BRIDGE_PULL:
        pull = bridge_pull(state)
        force = times(-pull / distance if bridged else 0.0, separation)
    if BRIDGE_APART:
        lasts = bridged & closed
        if DRYING:
            lasts = bridged & (not memory.bridge_open[k])
        between = (times(1.0 / distance, separation), distance, gap)
        force = plus(force, resist_apart(k, between, lasts, floor, system, step))
    if BRIDGE_PULL or BRIDGE_APART:
        put(memory.bridge_force, k, force)
