"""The liquid bridges of a run, as a user sees them, and the agglomerates that they join.

How far neighbour lists must reach for bridges, and what becomes of those of removed particles, is here, too. Functions
of agglomerates take the numbers of the joined particles; a bridge to a wall joins no agglomerate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from cfddem.backend.compile import serial
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import specialise
from cfddem.particles.interactions.bridge import bridge_state, find_closed, thickness_of_films
from cfddem.particles.interactions.bridge_changes import longest_gap, mark_bodies, return_liquid
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.bridge_solution import pull_energy
from cfddem.particles.interactions.kinematics import pair_mass_and_radius
from cfddem.particles.interactions.slots import BRIDGE_PULL
from cfddem.particles.interactions.wall_liquid import gained_by_walls, with_room
from cfddem.particles.pair_graph import Edges, geometry
from cfddem.particles.particle_feature import Engine, ParticleFeature
from cfddem.particles.state import Particles
from cfddem.particles.system import BridgeSystem
from cfddem.particles.walls.nearest_point import Walls

GROWTH = 1.25
"""Factor by which films may grow before a new list is made."""

ROUNDING = 1.0 + 1e-9
"""Factor by which a list reaches beyond the longest bridge."""


class Bridges(ParticleFeature):
    """A view of the bridges of a particle solver; those whose first body this process owns.

    solver  with the laws of bridges `laws`
    """

    name = "bridges"

    def __init__(self, solver: Engine, laws: BridgeLaws) -> None:
        self._solver, self._laws = solver, laws
        self._formed, self._broken = 0, 0  # counted by particles that have been removed
        self._fed = 0.0  # of this rank [m3]

    @property
    def edges(self) -> np.ndarray:
        """Rows of the edges that have a bridge (n,)."""
        edges = self._solver.edges
        return np.flatnonzero((edges.bridge_film > 0.0) & (edges.first < self._solver.particles.owned))

    @property
    def bodies(self) -> np.ndarray:
        """Ids of the bodies of every bridge, -1 - w for piece w of the walls (n, 2)."""
        return self._solver.edges.ends(self._solver.particles.id, self.edges)

    @property
    def bonds(self) -> np.ndarray:
        """Rows of the edges that have a solid bond (n,)."""
        edges = self._solver.edges
        if not self._laws.bond:
            return np.zeros(0, np.int64)
        return np.flatnonzero((edges.bond_radius > 0.0) & (edges.first < self._solver.particles.owned))

    @property
    def bonds_formed(self) -> int:
        """Number of solid bonds that have formed between the particles that are there."""
        return self._sum("bonds_formed") if self._laws.bond else 0

    @property
    def volume(self) -> np.ndarray:
        """Liquid in every bridge (n,) [m3]."""
        volume: np.ndarray = self._solver.edges.bridge_volume[self.edges]
        return volume

    @property
    def count(self) -> int:
        """Number of bridges, of all ranks."""
        return int(self._solver.communicator.sum([len(self.edges)]))

    @property
    def formed(self) -> int:
        """Number of bridges that have formed."""
        return self._formed + self._sum("bridges_formed")

    @property
    def broken(self) -> int:
        """Number of bridges that have broken."""
        return self._broken + self._sum("bridges_broken")

    @property
    def liquid(self) -> float:
        """All liquid of the run: on particles, in bridges, and what walls have gained [m3]."""
        particles, total = self._solver.particles, self._solver.communicator.sum
        return total(particles.liquid[: particles.owned]) + total(self.volume) + self.gained_by_walls  # type: ignore[no-any-return]

    @property
    def fed(self) -> float:
        """Liquid that inserted particles have brought, less what removed ones have taken along [m3]."""
        return float(self._solver.communicator.sum([self._fed]))

    @property
    def gained_by_walls(self) -> float:
        """Liquid on the walls less that at the start [m3]."""
        return gained_by_walls(self._solver.walls, self._laws.wall_film, self._laws.wall_patch)

    @property
    def thickness(self) -> np.ndarray:
        """Thickness of the film of each particle, without the liquid in bridges (N,) [m]."""
        return thickness_of_films(self._solver.particles.radius, self._solver.particles.liquid)

    @property
    def agglomerates(self) -> np.ndarray:
        """Number of the agglomerate of each particle: particles joined by bridges and bonds (N,), by row."""
        edges, count = self._solver.edges, self._solver.particles.count
        joined = np.append(self.edges[self.edges < edges.between_particles], self.bonds)
        return agglomerates(edges.first[joined].astype(np.int64), edges.second[joined].astype(np.int64), count)

    def gaps(self) -> tuple[np.ndarray, np.ndarray]:
        """Gap of every bridge, and how far it can still be stretched (n,), (n,) [m]."""
        solver, rows = self._solver, self.edges
        longest = np.empty(len(rows))
        specialise(_longest, solver.choices)(rows, solver.system, longest)
        gap = solver.gap[rows]
        return gap, longest - gap

    def dry(self, rows: np.ndarray, lost: np.ndarray, bridges: BridgeSystem | None = None) -> float:
        """Let bridges lose water; those that have none left break with the next step.

        rows     of their edges, also of those whose first body another process owns (n,)
        lost     volume (n,), below 0 where vapour condenses [m3]
        bridges  the present ones as loops take them; found if None
        returns  energy of the pulls that is gone, of bridges whose first body this process owns [J]
        """
        system = self._solver.system
        return float(self._dry(rows, lost, bridges or BridgeSystem.of(system), system.parameters))

    @cached_property
    def _dry(self) -> Any:
        """The loop of `dry`, which is called in every step."""
        return specialise(_dry, self._solver.choices)

    def checkpoint(self) -> dict[str, Any]:
        """What the fields of particles do not tell."""
        return {"formed": self._formed, "broken": self._broken, "fed": self.fed}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self._formed, self._broken = int(state["formed"]), int(state["broken"])
        self._fed = float(state["fed"]) if self._solver.communicator.rank == 0 else 0.0

    def inserted(self, engine: Engine, joined: Particles, rows: np.ndarray) -> None:
        """Count the liquid that particles bring."""
        self._fed += float(joined.liquid[rows].sum())  # local: of this rank

    def removing(self, engine: Engine, gone: np.ndarray) -> None:
        """Break the bridges of particles that will be removed; each keeps its part of the liquid and takes it along."""
        if engine.communicator.size > 1:
            raise InputError("remove", None, "absent in a run of several processes with liquid bridges")
        edges, pairs = engine.edges, engine.edges.between_particles
        leaves = gone[edges.first]
        leaves[:pairs] |= gone[edges.second[:pairs]]
        edges.bridge_change[:] = np.where(leaves & (edges.bridge_film > 0.0), -1, 0)
        specialise(_break, engine.choices)(engine.system)
        self._formed += self._sum("bridges_formed", gone)
        self._broken += self._sum("bridges_broken", gone)
        self._fed += float(-engine.particles.liquid[: len(gone)][gone].sum())  # local: of this rank

    def reach_ratio(self, engine: Engine, after: Particles | None) -> float:
        """Largest gap at which two films can touch before the next list, or that a bridge has now, over R* [-].

        A listed pair stays in its list however far its bridge is stretched. The bound assumes that every bridge of a
        particle breaks and returns all its liquid.
        """
        particles, largest = engine.particles, engine.communicator.largest
        radius, most = particles.radius, particles.liquid.copy()
        edges: Edges | None = getattr(engine, "edges", None)
        longest = np.zeros(0)
        if edges is not None and len(edges.first):
            joined = edges.bridge_film > 0.0
            if self._laws.bond:
                joined |= edges.bond_radius > 0.0
            rows = np.flatnonzero(joined)
            at_wall = rows >= edges.between_particles
            first, second = edges.first[rows], edges.second[rows]
            np.add.at(most, first, edges.bridge_volume[rows])
            np.add.at(most, second[~at_wall], edges.bridge_volume[rows[~at_wall]])
            other = np.where(at_wall, np.inf, radius[np.where(at_wall, 0, second)])
            longest = engine.gap[rows] * (1.0 / radius[first] + 1.0 / other)
        films, radii = thickness_of_films(radius, most), radius
        if after is not None:
            films = np.append(films, thickness_of_films(after.radius, after.liquid))
            radii = np.append(radius, after.radius)
        on_walls = max(self._laws.wall_film, float(engine.walls.patch_thickest[0]))
        reach = (4.0 * GROWTH * largest(films, default=0.0) + on_walls) / engine.communicator.smallest(
            radii, default=np.inf
        )
        return max(reach, ROUNDING * largest(longest, default=0.0))  # type: ignore[no-any-return]

    def outgrows(self, engine: Engine, reach: float) -> bool:
        """Whether liquid from outside, such as a spray, has made films thicker than the neighbour list allows."""
        particles, communicator = engine.particles, engine.communicator
        square = particles.radius**2
        spread = particles.liquid / (4.0 * np.pi * square)  # thickness of a thin layer; a thicker one has less
        thickest = communicator.largest(spread, default=0.0)
        smallest = communicator.smallest(square, default=np.inf)
        return bool(4.0 * thickest > reach * math.sqrt(smallest))

    def with_room(self, walls: Walls, edges: Edges) -> Walls:
        """The walls with room for the patches of liquid that may be made until the next list."""
        if self._laws.wall_share == 0.0:
            return walls
        return with_room(walls, int(self._solver.communicator.sum([len(edges.first) - edges.between_particles])))

    def _sum(self, name: str, rows: Any = slice(None)) -> int:
        """Sum of a count over the owned particles, or some of them."""
        particles = self._solver.particles
        return int(self._solver.communicator.sum(particles[name][: particles.owned][rows]))


@serial
def _longest(rows, system, longest):
    for n in range(len(rows)):
        longest[n] = longest_gap(rows[n], system)


@serial
def _break(system):
    mark_bodies(system)
    return_liquid(system)


@serial
def _dry(rows, lost, system, p):
    """See `Bridges.dry`; returns the energy of the pulls that is gone [J]."""
    memory, edges, energy = system.memory, system.edges, 0.0
    for n in range(len(rows)):
        k = rows[n]
        _, _, gap = geometry(k, system)
        reduced_radius, _ = pair_mass_and_radius(k, system)
        owned = edges.first[k] < system.particles.owned
        if BRIDGE_PULL and owned:
            energy += pull_energy(bridge_state(k, gap, reduced_radius, memory, p))
        left = memory.bridge_volume[k] - lost[n]
        memory.bridge_volume[k] = left if left > 1e-12 * memory.bridge_volume[k] else 0.0
        find_closed(k, reduced_radius, memory, p)
        if BRIDGE_PULL and owned:
            energy -= pull_energy(bridge_state(k, gap, reduced_radius, memory, p))
    return energy


# ---------------------------------------------------------------- agglomerates


Numbers = NDArray[np.integer]


def agglomerates(first: Numbers, second: Numbers, count: int) -> Numbers:
    """Number of the agglomerate of each particle (N,), counted from 0.

    first, second  rows of the particles that each bridge joins (n,)
    count          number of particles N

    >>> agglomerates(np.array([0, 3]), np.array([1, 1]), 5).tolist()
    [0, 0, 1, 0, 2]
    """
    joined = coo_matrix((np.ones(len(first)), (first, second)), shape=(count, count))
    return np.asarray(connected_components(joined, directed=False)[1])


class AgglomerateSizes(NamedTuple):
    """Sizes of all agglomerates, as numbers of particles; a particle without a bridge is one of size 1."""

    mean_by_particle: float  # size of the agglomerate that a particle belongs to, mean over particles
    largest: int
    joined: float  # share of the particles that have a bridge to another


def size_distribution(belongs: Numbers) -> tuple[Numbers, Numbers]:
    """The sizes that occur, and how many agglomerates have each (k,), (k,).

    belongs  of :func:`agglomerates`, or the field `agglomerate` of a snapshot, whose numbers have gaps

    >>> [each.tolist() for each in size_distribution(np.array([0, 0, 7, 0, 9]))]
    [[1, 3], [2, 1]]
    """
    _, members = np.unique(belongs, return_counts=True)
    return np.unique(members, return_counts=True)


def agglomerate_sizes(first: Numbers, second: Numbers, count: int) -> AgglomerateSizes:
    """Sizes of the agglomerates of a state.

    >>> agglomerate_sizes(np.array([0, 3]), np.array([1, 1]), 5)
    AgglomerateSizes(mean_by_particle=2.2, largest=3, joined=0.6)
    """
    if count == 0:
        return AgglomerateSizes(float("nan"), 0, float("nan"))
    members = np.bincount(agglomerates(first, second, count)).astype(float)  # local: numbers of all ranks
    alone = float(np.count_nonzero(members == 1.0))  # local: numbers of all ranks
    return AgglomerateSizes(
        mean_by_particle=float((members * members).sum()) / count,  # local: numbers of all ranks
        largest=int(members.max()),  # local: numbers of all ranks
        joined=1.0 - alone / count,
    )


def carried_liquid(
    liquid: NDArray[np.float64], first: Numbers, second: Numbers, volume: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Liquid of each particle: its film, and half of each bridge to another particle (N,) [m3].

    liquid         in the film of each particle (N,) [m3]
    first, second  rows of the particles that each bridge joins (n,)
    volume         of the liquid in each bridge (n,) [m3]
    """
    carried = liquid.astype(float)
    np.add.at(carried, first, 0.5 * volume)
    np.add.at(carried, second, 0.5 * volume)
    return carried
