"""Films of pairs that cannot touch before the next neighbour list, which may act once in several steps.

These far films are weak: in one step they hardly slow a pair down. Their impulse is a difference of potentials between
two gaps, so nothing is lost where it is given for several steps at once. In every n-th step, before the other films,

    far kick     impulses of the far films over n steps: of every pair, then of every particle

and only before these steps are gap and resistance of far films found. Each group of films has its own sum of
resistances: the far films share out the whole mass of a particle, and so do the others.

What moves a pair between two kicks is not foreseen. Where a film has taken more than the gap then allows, it returns
the rest in its next kick; all other films only take.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline, part, prange, serial
from cfddem.data.fields import Field
from cfddem.particles.interactions.film import film_impulse
from cfddem.particles.interactions.slots import far_impulses, update_films
from cfddem.particles.motion import apply_all_film_impulses
from cfddem.particles.pair_graph import edge_role, is_far, places_of
from cfddem.particles.state import Particles

FIELDS = (Field("far_rate", "1/s", halo=("far",), meaning="resistance of the far films of the particle over its mass"),)
"""Fields of particles whose far films act once in several steps."""


@part
def _find_hard(system, step):
    """Impulses of the far films that change much within their step."""
    edges, memory = system.edges, system.memory
    for k in prange(edges.near, edges.between_particles):
        if memory.hard[k]:
            film_impulse(k, system, step)


@serial
def far_kick(system, step):
    """Give the particles the impulses of their far films.

    step  for which they are given: several steps of the run [s]
    """
    edges = system.edges
    far_impulses(edges.near, edges.between_particles, system, step)
    _find_hard(system, step)
    apply_all_film_impulses(system, True)


@inline
def _sum_rates(i, system):
    """Sum the resistances of the films of particle i over its mass, those of far films apart."""
    particles, edges, memory = system.particles, system.edges, system.memory
    near = far = 0.0
    for place in places_of(i, edges):
        k, _ = edge_role(edges.incident[place])
        resistance = memory.resistance[k]
        if is_far(k, edges):
            far += resistance
        else:
            near += resistance
    particles.film_rate[i] = particles.inverse_mass[i] * near
    particles.far_rate[i] = particles.inverse_mass[i] * far


@part
def _sum_all_rates(system):
    """Sum the resistances of the films of all particles."""
    particles = system.particles
    for i in prange(particles.owned):
        _sum_rates(i, system)


@serial
def sort_films(system):
    """After a new list, in which other pairs are far: films at the present positions, and their sums."""
    update_films(0, system.edges.between_particles, system)
    _sum_all_rates(system)


def rates_of_films(particles: Particles) -> list[np.ndarray]:
    """Resistances of films over the inertia of the particles, which change with it."""
    return [particles[name] for name in ("film_rate", "far_rate") if name in particles]
