"""The clocks of the particles: how large a step their physics allows, and which piece of it binds."""

from __future__ import annotations

import math

import numpy as np

from cfddem.chosen_laws import FILM_ARGUMENTS, asked_by_name
from cfddem.kernels import kernel
from cfddem.particles.forces import LINEAR, VERLET, Laws
from cfddem.particles.pairs import Edges
from cfddem.particles.state import Bodies
from cfddem.particles.steps import STABLE, Clocks, check_step, crossing_step, hertz_steps, linear_steps
from cfddem.particles.surfaces import Walls
from closures import lubrication, timescales
from closures.contact import hertz_stiffness
from closures.timescales import overlap_period

__all__ = ["Clocks", "check_step", "clocks"]


def clocks(
    bodies: Bodies,
    edges: Edges,
    walls: Walls,
    gap: np.ndarray,
    table: np.ndarray,
    laws: Laws,
    reference_speed: float,
) -> Clocks:
    """Read the clocks of the particles as they are.

    gap              (n,) of every edge [m]
    reference_speed  fastest approach to be expected; the fastest particle counts too [m/s]
    """
    speed = max(reference_speed, float(np.linalg.norm(bodies.velocity, axis=1).max(initial=0.0)))
    hertz, impact, film = math.inf, math.inf, math.inf
    for mass, radius, row in _lightest_pairs(bodies, table):
        if laws.contact == LINEAR:
            steps = linear_steps(mass, laws.normal_stiffness, laws.tangential_stiffness)
        elif speed > 0.0 and row["contact_modulus"] > 0.0:
            steps = hertz_steps(mass, radius, float(row["contact_modulus"]), speed)
        else:
            steps = math.inf, math.inf
        hertz, impact = min(hertz, steps[0]), min(impact, steps[1])
        if laws.film and laws.integrator == VERLET:
            strongest = _film_strength(laws, float(bodies.viscosity.max()), radius, float(row["roughness_gap"]))
            film = min(film, 2.0 * timescales.film_time(mass, strongest, float(row["roughness_gap"])))
    built_in = laws._replace(minimum_gap=None, lubrication=None)
    overlap = STABLE / math.sqrt(max(_largest_rate(bodies, edges, walls, gap, table, built_in), 1e-300))
    return Clocks(hertz, impact, overlap, film, crossing_step(float(bodies.radius.min()), speed))


def _film_strength(laws: Laws, viscosity: float, reduced_radius: float, gap: float) -> float:
    """Resistance of a film at the gap of asperities, times that gap [N s]."""
    if laws.lubrication is None:
        return lubrication.film_strength(viscosity, reduced_radius)
    numbers = (gap, viscosity, reduced_radius, gap, laws.cutoff_ratio * reduced_radius)
    return gap * asked_by_name(laws.lubrication, FILM_ARGUMENTS, numbers)


def _lightest_pairs(bodies: Bodies, table: np.ndarray) -> list[tuple[float, float, np.ndarray]]:
    """Reduced mass, reduced radius and table row of the smallest pair of each two materials."""
    found = []
    for kind in np.unique(bodies.material):
        own = np.flatnonzero(bodies.material == kind)
        smallest = own[np.argmin(bodies.radius[own])]
        for row in table[kind]:
            found.append((0.5 * float(bodies.mass[smallest]), 0.5 * float(bodies.radius[smallest]), row))
    return found


@kernel
def _largest_rate(bodies, edges, walls, gap, table, laws):
    """Bound of the contacts' squared angular frequency: twice the stiffness on a particle over its mass."""
    stiffness = np.zeros(len(bodies.radius))
    for k in range(len(gap)):
        overlap = (edges.minimum_gap[k] if laws.film else 0.0) - gap[k]
        if overlap <= 0.0:
            continue
        i, j = edges.first[k], edges.second[k]
        pair = k < edges.between_particles
        radius = bodies.radius[i]
        if pair:
            radius = radius * bodies.radius[j] / (radius + bodies.radius[j])
        row = table[bodies.material[i], bodies.material[j] if pair else walls.material[j]]
        stiff = laws.normal_stiffness
        if laws.contact != LINEAR:
            stiff = overlap_period(1.0, hertz_stiffness(row.contact_modulus, radius), overlap) ** -2
        stiffness[i] += stiff
        if pair:
            stiffness[j] += stiff
    largest = 0.0
    for i in range(len(stiffness)):
        largest = max(largest, 2.0 * stiffness[i] * bodies.inverse_mass[i])
    return largest
