"""Liquid on walls that evaporates: by a coefficient of mass transfer and a temperature of the wall, which gives the
latent heat. No particle is cooled, and no vapour condenses on walls."""

from __future__ import annotations

from typing import Any

import numpy as np

from closures.evaporation import latent_heat, saturation_pressure, stefan_drive, vapour_fraction


class WallFilms:
    """The liquid on the walls of a simulation: patches, and the film elsewhere, of one thickness.

    film  thickness where no bridge has drawn or returned liquid so far [m]
    heat  latent heat that the walls have given [J]
    """

    def __init__(self, simulation: Any, coefficient: float, temperature: float, density: float) -> None:
        self.solver, self.coefficient, self.temperature = simulation.particle_solver, coefficient, temperature
        self.density, self.heat, self._known = density, 0.0, int(self.solver.walls.patch_count[0])
        numbers = self.solver.parameters.bridge
        self.film = self._start = float(numbers.wall_film)
        self.area = float(numbers.wall_patch) ** 2

    def lose(self, fraction: float, pressure: float, gas_density: float, step: float) -> float:
        """Evaporate over the step [s] into air of a mass fraction of vapour; returns the volume that leaves patches,
        with what new ones had lost before [m3]."""
        saturated = vapour_fraction(min(saturation_pressure(self.temperature), 0.999 * pressure), pressure)
        rate = max(self.coefficient * gas_density * stefan_drive(saturated, fraction), 0.0) / self.density  # [m/s]
        walls, count = self.solver.walls, int(self.solver.walls.patch_count[0])
        gone = max(count - self._known, 0) * (self._start - self.film) * self.area
        there = walls.patch_liquid[:count]
        lost = np.minimum(there, rate * step * self.area)
        there -= lost
        gone += float(lost.sum())  # local: every rank has all patches
        self._known = count
        self._thin(max(self.film - rate * step, 0.0))
        self.heat += gone * self.density * latent_heat(self.temperature)
        return gone

    def _thin(self, film: float) -> None:
        """Let the film where there are no patches have a thickness [m]."""
        self.film, solver = film, self.solver
        solver.parameters = solver.parameters._replace(bridge=solver.parameters.bridge._replace(wall_film=film))
        solver.system = solver.system._replace(parameters=solver.parameters)

    def checkpoint(self) -> dict[str, float]:
        """The film, the patches that are known, and the heat."""
        return {"film": self.film, "known": self._known, "heat": self.heat}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self._known, self.heat = int(state["known"]), float(state["heat"])
        self._thin(float(state["film"]))
