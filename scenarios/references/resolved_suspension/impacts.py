"""Impacts of spheres: pairs whose solids have come to touch since they were last examined."""

from __future__ import annotations

import numpy as np

from cfddem.particles.solver import ParticleSolver


def new_impacts(solver: ParticleSolver, velocity: np.ndarray, touching: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs whose solids touch, and the normal speeds of approach of those that did not touch before.

    velocity  of all spheres by id, before (N, 3)
    touching  pairs that touched before, as returned by the last call
    """
    edges, particles = solver.edges, solver.particles
    pairs = slice(0, edges.between_particles)
    close = np.flatnonzero(solver.gap[pairs] < edges.minimum_gap[pairs])
    first, second = edges.first[close], edges.second[close]
    i, j = particles.id[first].astype(np.int64), particles.id[second].astype(np.int64)
    name = np.minimum(i, j) * particles.count + np.maximum(i, j)
    fresh = ~np.isin(name, touching)
    apart = particles.position[first[fresh]] - particles.position[second[fresh]]
    span = np.where(np.isfinite(solver.box), solver.box, 1e30)
    apart -= span * np.round(apart / span)
    apart /= np.linalg.norm(apart, axis=1, keepdims=True)
    return name, -np.einsum("ij,ij->i", velocity[i[fresh]] - velocity[j[fresh]], apart)
