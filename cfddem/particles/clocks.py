"""The clocks of the particles: how large a step their physics allows, and which piece of it binds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cfddem.errors import UnstableStep
from cfddem.kernels import kernel
from cfddem.particles.forces import LINEAR, VERLET, Laws
from cfddem.particles.pairs import Edges
from cfddem.particles.state import Bodies
from cfddem.particles.surfaces import Walls
from closures import contact, lubrication, timescales
from closures.contact import hertz_stiffness
from closures.timescales import overlap_period

STEPS_PER_HERTZ_TIME = 50
"""The default step is 2 % of the Hertz time of the fastest approach."""

STABLE = 1.0
"""A step may be at most this over the largest angular frequency; velocity Verlet breaks at 2."""


@dataclass(frozen=True)
class Clocks:
    """Largest steps that each piece of physics allows, in seconds; infinite where it sets no limit."""

    hertz: float  # 2 % of the Hertz time at the reference speed
    impact: float  # stability of an impact at the reference speed
    overlap: float  # stability of the contacts that exist
    film: float  # stability of the film as an explicit force; the lubricated drift has no limit
    crossing: float  # a particle may not cross a tenth of its radius in a step

    @property
    def recommended(self) -> float:
        """The step to take: 2 % of the Hertz time, less where stability asks for it [s]."""
        return min(self.hertz, 0.5 * self.limit)

    @property
    def limit(self) -> float:
        """The step from which a run is refused [s]."""
        return min(self.impact, self.overlap, self.film, self.crossing)

    @property
    def binding(self) -> str:
        """The clock that sets the limit."""
        return min(("impact", "overlap", "film", "crossing"), key=lambda name: float(getattr(self, name)))


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
            swing = math.sqrt(mass / max(laws.normal_stiffness, laws.tangential_stiffness))
            hertz, impact = min(hertz, math.pi * swing / STEPS_PER_HERTZ_TIME), min(impact, STABLE * swing)
        elif speed > 0.0 and row["contact_modulus"] > 0.0:
            stiffness = contact.hertz_stiffness(float(row["contact_modulus"]), radius)
            deepest = contact.hertz_largest_overlap(mass, stiffness, speed)
            hertz = min(hertz, timescales.hertz_time(mass, stiffness, speed) / STEPS_PER_HERTZ_TIME)
            impact = min(impact, STABLE * timescales.overlap_period(mass, stiffness, deepest))
        if laws.film and laws.integrator == VERLET:
            strength = lubrication.film_strength(float(bodies.viscosity.max()), radius)
            film = min(film, 2.0 * timescales.film_time(mass, strength, float(row["roughness_gap"])))
    overlap = STABLE / math.sqrt(max(_largest_rate(bodies, edges, walls, gap, table, laws), 1e-300))
    crossing = 0.1 * float(bodies.radius.min()) / speed if speed > 0.0 else math.inf
    return Clocks(hertz, impact, overlap, film, crossing)


def check_step(step: float, read: Clocks) -> None:
    """Refuse a step that the physics cannot follow, with the one that works."""
    if step > read.limit:
        raise UnstableStep(step, read.limit, f"{read.binding} clock", f"take {read.recommended:.2g} s")


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
