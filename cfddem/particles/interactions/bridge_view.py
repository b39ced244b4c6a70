"""The liquid bridges of a run, as a user sees them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cfddem.backend.compile import serial
from cfddem.backend.law_set import specialise
from cfddem.particles.agglomerates import agglomerates
from cfddem.particles.interactions.bridge import thickness_of_films
from cfddem.particles.interactions.bridge_changes import longest_gap
from cfddem.particles.interactions.wall_liquid import gained_by_walls

if TYPE_CHECKING:
    from cfddem.particles.solver import ParticleSolver


class Bridges:
    """A view of the bridges of a particle solver; those whose first body this process owns."""

    def __init__(self, solver: ParticleSolver) -> None:
        self._solver = solver
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

    def feed(self, liquid: np.ndarray) -> None:
        """Count the liquid on inserted particles, or less than none on removed ones (n,) [m3]."""
        self._fed += float(liquid.sum())  # local: of this rank

    @property
    def gained_by_walls(self) -> float:
        """Liquid on the walls less that at the start [m3]."""
        laws = self._solver.laws.bridge
        assert laws is not None
        return gained_by_walls(self._solver.walls, laws.wall_film, laws.wall_patch)

    @property
    def thickness(self) -> np.ndarray:
        """Thickness of the film of each particle, without the liquid in bridges (N,) [m]."""
        return thickness_of_films(self._solver.particles.radius, self._solver.particles.liquid)

    @property
    def agglomerates(self) -> np.ndarray:
        """Number of the agglomerate of each particle: particles joined by bridges (N,), by row."""
        edges, count = self._solver.edges, self._solver.particles.count
        joined = self.edges[self.edges < edges.between_particles]
        return agglomerates(edges.first[joined].astype(np.int64), edges.second[joined].astype(np.int64), count)

    def gaps(self) -> tuple[np.ndarray, np.ndarray]:
        """Gap of every bridge, and how far it can still be stretched (n,), (n,) [m]."""
        solver, rows = self._solver, self.edges
        longest = np.empty(len(rows))
        specialise(_longest, solver.choices)(rows, solver.system, longest)
        gap = solver.gap[rows]
        return gap, longest - gap

    def forget(self, gone: np.ndarray) -> None:
        """Keep the counts of particles that will be removed (N,) bool."""
        self._formed += self._sum("bridges_formed", gone)
        self._broken += self._sum("bridges_broken", gone)

    def counters(self, reach: float) -> dict[str, Any]:
        """What a checkpoint contains beside the fields; `reach` of the neighbour list over R* [-]."""
        return {"reach": reach, "formed": self._formed, "broken": self._broken, "fed": self.fed}

    def restore(self, counters: Mapping[str, Any]) -> float:
        """Continue from a checkpoint; returns the reach of its neighbour list."""
        self._formed, self._broken = int(counters["formed"]), int(counters["broken"])
        self._fed = float(counters["fed"]) if self._solver.communicator.rank == 0 else 0.0
        return float(counters["reach"])

    def _sum(self, name: str, rows: Any = slice(None)) -> int:
        """Sum of a count over the owned particles, or some of them."""
        particles = self._solver.particles
        return int(self._solver.communicator.sum(particles[name][: particles.owned][rows]))


@serial
def _longest(rows, system, longest):
    for n in range(len(rows)):
        longest[n] = longest_gap(rows[n], system)
