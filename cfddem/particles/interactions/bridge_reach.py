"""How far neighbour lists must reach for liquid bridges, and what becomes of the bridges of removed particles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from cfddem.backend.compile import serial
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import specialise
from cfddem.particles.interactions.bridge import thickness_of_films
from cfddem.particles.interactions.bridge_changes import clear_bridges, mark_bodies, transfer_liquid
from cfddem.particles.interactions.slots import WALL_LIQUID, WALLS
from cfddem.particles.interactions.wall_liquid import transfer_wall_liquid
from cfddem.particles.pair_graph import Edges
from cfddem.particles.state import Particles

if TYPE_CHECKING:
    from cfddem.particles.solver import ParticleSolver

GROWTH = 1.25
"""Factor by which films may grow before a new list is made."""

ROUNDING = 1.0 + 1e-9
"""Factor by which a list reaches beyond the longest bridge."""


def bridge_reach_ratio(solver: ParticleSolver, after: Particles | None = None) -> float:
    """Largest gap at which two films can touch before the next list, or that a bridge has now, over R* [-].

    A listed pair stays in its list however far its bridge is stretched. The bound assumes that every bridge of a
    particle breaks and returns all its liquid.

    after  the particles that will be in the list, if others than those of the run
    """
    particles, largest = solver.particles, solver.communicator.largest
    radius, most = particles.radius, particles.liquid.copy()
    edges: Edges | None = getattr(solver, "edges", None)
    longest = np.zeros(0)
    if edges is not None and len(edges.first):
        rows = np.flatnonzero(edges.bridge_film > 0.0)
        at_wall = rows >= edges.between_particles
        first, second = edges.first[rows], edges.second[rows]
        np.add.at(most, first, edges.bridge_volume[rows])
        np.add.at(most, second[~at_wall], edges.bridge_volume[rows[~at_wall]])
        other = np.where(at_wall, np.inf, radius[np.where(at_wall, 0, second)])
        longest = solver.gap[rows] * (1.0 / radius[first] + 1.0 / other)
    films, radii = thickness_of_films(radius, most), radius
    if after is not None:
        films, radii = np.append(films, thickness_of_films(after.radius, after.liquid)), np.append(radius, after.radius)
    laws = solver.laws.bridge
    on_walls = max(laws.wall_film, float(solver.walls.patch_thickest[0])) if laws is not None else 0.0
    reach = (4.0 * GROWTH * largest(films, default=0.0) + on_walls) / solver.communicator.smallest(
        radii, default=np.inf
    )
    return max(reach, ROUNDING * largest(longest, default=0.0))  # type: ignore[no-any-return]


def films_outgrow(solver: ParticleSolver, reach: float) -> bool:
    """Whether liquid from outside, such as a spray, has made films thicker than the neighbour list allows.

    reach  of the list over R* [-]
    """
    particles, communicator = solver.particles, solver.communicator
    square = particles.radius**2
    thickest = communicator.largest(particles.liquid / (4.0 * np.pi * square), default=0.0)  # of a thin layer, or less
    smallest = communicator.smallest(square, default=np.inf)
    return bool(4.0 * thickest > reach * math.sqrt(smallest))


def release_bridges(solver: ParticleSolver, gone: np.ndarray) -> None:
    """Break the bridges of particles that will be removed; each keeps its part of the liquid.

    gone  rows of the particles (N,) bool
    """
    if solver.communicator.size > 1:
        raise InputError("remove", None, "absent in a run of several processes with liquid bridges")
    edges, pairs = solver.edges, solver.edges.between_particles
    leaves = gone[edges.first]
    leaves[:pairs] |= gone[edges.second[:pairs]]
    edges.bridge_change[:] = np.where(leaves & (edges.bridge_film > 0.0), -1, 0)
    specialise(_break, solver.choices)(solver.system)


@serial
def _break(system):
    edges, memory = system.edges, system.memory
    mark_bodies(system)
    if WALLS and WALL_LIQUID:
        transfer_wall_liquid(system)
    transfer_liquid(system)
    clear_bridges(edges, memory)
