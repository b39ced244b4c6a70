"""Bridges that evaporate: each of its particles takes a half of the meniscus, and gives the latent heat of its half.

A bridge at a wall is all of its particle. What a bridge loses is found by the owners of its particles, so that ranks
agree on every bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cfddem.features.evaporation_loops import menisci, taken_from
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.system import BridgeSystem


class Menisci:
    """The bridges of a simulation at the beginning of a step.

    area  of the menisci of every particle (N,) [m2]
    mass  of the liquid in its parts of bridges (N,) [kg]
    """

    def __init__(self, simulation: Any, density: float) -> None:
        solver, self.density = simulation.particle_solver, density
        self.solver, self.count = solver, solver.particles.owned
        self.rows = np.flatnonzero(solver.edges.bridge_film > 0.0)
        # two parts of every bridge, the first of all bridges, then the second; that at a wall has one
        parts = 2 * len(self.rows)
        self.body, self.parts, self.masses = np.empty(parts, np.int64), np.empty(parts), np.empty(parts)
        self.area, self.mass = np.zeros(self.count), np.zeros(self.count)
        if parts:
            system = BridgeSystem.of(solver.system)
            menisci(self.rows, density, system, self.body, self.parts, self.masses, self.area, self.mass)

    def lose(self, lost: np.ndarray) -> float:
        """Take from the bridges what every particle loses from its parts of them (N,) [kg]; returns the energy of the
        pulls that is gone [J].

        Bridges lose by their areas. What one has not, the others of the particle give.
        """
        if not len(self.rows) and self.solver.communicator.size == 1:
            return 0.0
        taken = np.zeros(len(self.body))
        taken_from(self.body, self.parts, self.masses, self.area, lost, taken)
        halves = self._of_all_owners(taken.reshape(2, -1).T)
        bridges: Bridges = self.solver.feature(Bridges)
        return bridges.dry(self.rows, (halves[:, 0] + halves[:, 1]) / self.density)

    def _of_all_owners(self, halves: np.ndarray) -> np.ndarray:
        """Both parts of every bridge (n, 2) [kg], also where a particle of another rank has one."""
        communicator, edges = self.solver.communicator, self.solver.edges
        if communicator.size == 1:
            return halves
        names = edges.ends(self.solver.particles.id, self.rows).reshape(-1, 2)
        shared = (self.body.reshape(2, -1) >= self.count).any(axis=0) & (names[:, 1] >= 0)
        sent = communicator.joined(np.column_stack([names[shared].astype(float), halves[shared]]).reshape(-1, 4))
        _, place = np.unique(sent[:, :2], axis=0, return_inverse=True)
        sums = np.zeros((len(sent), 2))
        np.add.at(sums, place.ravel(), sent[:, 2:])  # one of two parts is zero
        known = {(one, other): sums[row] for (one, other), row in zip(sent[:, :2].tolist(), place.ravel().tolist())}
        halves = halves.copy()
        for row in np.flatnonzero(shared):
            halves[row] = known[tuple(names[row].astype(float).tolist())]
        return halves
