r"""The film below the grid: the part of the lubrication force that the cells do not resolve.

Two spheres that approach on the lattice feel a resistance as if their gap were wider by a fraction of a cell,
:math:`\delta`. The particle engine adds what is missing within two cells,

.. math:: c(h) = 6\pi\eta R^{*2}\left(\frac1h - \frac1{h+\delta} - \frac1{h_g} + \frac1{h_g+\delta}\right),
          \qquad h < h_g = 2\ \mathrm{cells} .

Measured with 12 cells a diameter, :math:`\delta` is 0.141, 0.143 and 0.135 cells at gaps of 0.25, 0.5 and 1 cell.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.particles.solver import ParticleSolver
from closures.registry import law

GRID_GAP = 2.0
"""Gap below which the film acts, h_g [cells]."""

WIDENING = 0.14
"""By how much wider the grid sees a gap, delta [cells]."""


@law("lubrication", "Brenner (1961) for small gaps, less what the flow solver resolves", gap=(0.0, 2.0))
def unresolved_film(gap: float, viscosity: float, reduced_radius: float, cutoff_gap: float) -> float:
    r"""Resistance of a film in excess of what the flow solver resolves, in lattice units.

    .. math:: c = 6\pi\eta R^{*2}\,[1/h - 1/(h+\delta) - 1/h_g + 1/(h_g+\delta)]

    gap             h [cells]
    viscosity       eta
    reduced_radius  R* [cells]
    cutoff_gap      h_g, gap below which the grid misses a part [cells]
    returns         c; 0 above h_g

    >>> unresolved_film(2.0, 1.0, 1.0, 2.0), round(unresolved_film(0.25, 1.0, 1.0, 2.0) / (6 * math.pi), 3)
    (0.0, 1.403)
    """
    missing = 1.0 / gap - 1.0 / (gap + WIDENING)
    resolved = 1.0 / cutoff_gap - 1.0 / (cutoff_gap + WIDENING)
    return 6.0 * math.pi * viscosity * reduced_radius**2 * max(missing - resolved, 0.0)


def approach_resistance(gap: float) -> float:
    r"""Exact resistance of two equal spheres that approach each other along their centres, over Stokes' 6 pi eta a.

    gap  over the radius
    returns  force on each over :math:`6\pi\eta a U`, each moving with U; Brenner (1961), a sphere and a free plane

    >>> round(approach_resistance(1e-3) - 500.0, 1), round(approach_resistance(100.0), 3)
    (4.5, 1.015)
    """
    alpha = math.acosh(1.0 + 0.5 * gap)
    total, n = 0.0, 1
    while n * alpha < 40.0 and n < 200_000:
        k = (2 * n + 1) * alpha
        above = 4.0 * math.cosh(0.5 * k) ** 2 + (2 * n + 1) ** 2 * math.sinh(alpha) ** 2
        below = 2.0 * math.sinh(k) - (2 * n + 1) * math.sinh(2.0 * alpha)
        term = n * (n + 1) / ((2 * n - 1) * (2 * n + 3)) * (above / below - 1.0)
        total += term
        n += 1
    return 4.0 / 3.0 * math.sinh(alpha) * total


# ---------------------------------------------------------------- impacts


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
