"""The liquid budget: where the liquid is, and how much the sum has changed that the spray did not bring."""

from __future__ import annotations

from typing import Any

from cfddem.particles.solver import ParticleSolver
from cfddem.particles.spray import Spray


class LiquidBudget:
    """Volumes of liquid of a simulation, summed over all ranks.

    particle_solver  whose particles carry liquid
    spray            that brings more of it, if there is one
    """

    def __init__(self, particle_solver: ParticleSolver, spray: Spray | None) -> None:
        self.particle_solver, self.spray = particle_solver, spray
        self.start = self.total

    @property
    def on_particles(self) -> float:
        """Volume in the films of the particles [m3]."""
        particles, total = self.particle_solver.particles, self.particle_solver.communicator.sum
        return float(total(particles.liquid[: particles.owned]))

    @property
    def in_bridges(self) -> float:
        """Volume in bridges [m3]."""
        bridges = self.particle_solver.bridges
        return 0.0 if bridges is None else float(self.particle_solver.communicator.sum(bridges.volume))

    @property
    def gained_by_walls(self) -> float:
        """Volume on the walls less that at the start [m3]."""
        bridges = self.particle_solver.bridges
        return 0.0 if bridges is None else bridges.gained_by_walls

    @property
    def sprayed(self) -> float:
        """Volume that has landed on particles since the start [m3]."""
        return 0.0 if self.spray is None else self.spray.volume

    @property
    def total(self) -> float:
        """All liquid, but for that on the walls at the start [m3]."""
        return self.on_particles + self.in_bridges + self.gained_by_walls

    @property
    def imbalance(self) -> float:
        """Change of the total that spray and inserted particles did not bring, over all liquid there was [-]."""
        bridges = self.particle_solver.bridges
        came = self.start + self.sprayed + (0.0 if bridges is None else bridges.fed)
        return abs(self.total - came) / max(came, -self.gained_by_walls, self.on_particles, 1e-300)

    def checkpoint(self) -> dict[str, Any]:
        """The start, and the drops of the spray."""
        return {"start": self.start, "spray": None if self.spray is None else self.spray.checkpoint()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.start = float(state["start"])
        if self.spray is not None:
            self.spray.restore(state["spray"])
