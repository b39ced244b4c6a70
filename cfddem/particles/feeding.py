"""Particles that enter and leave during a run: feeds and outlets."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from cfddem.backend.errors import InputError
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.vectors import Vector

_TRIES = 20
"""Positions that are tried for a particle before it waits for the next call."""


_NOWHERE_BELOW, _NOWHERE_ABOVE = (-np.inf, -np.inf, -np.inf), (np.inf, np.inf, np.inf)


class Feed:
    """Inserts particles in a box at a constant rate.

    Call it with the run from time to time; it inserts the particles due since its first call. A particle that finds no
    free position in the box waits for the next call.

    rate          [1/s]
    corner, size  of the box in which centres appear; a size may be 0 [m]
    diameters     number -> diameters (number,) [m], as the functions of :mod:`cfddem.particles.initial.packing`
    density       [kg/m3]
    velocity      of inserted particles [m/s]
    material      row of the pair table
    viscosity     of the fluid around them [Pa s]
    seed          of the random positions
    """

    def __init__(
        self,
        rate: float,
        corner: Vector,
        size: Vector,
        diameters: Callable[[int], np.ndarray],
        density: float,
        *,
        velocity: Vector = (0.0, 0.0, 0.0),
        material: int = 0,
        viscosity: float = 0.0,
        seed: int,
    ) -> None:
        if not 0.0 <= rate < np.inf:
            raise InputError("rate", rate, "at least 0")
        self.rate, self.corner, self.size = rate, np.array(corner, float), np.array(size, float)
        self.diameters, self.density = diameters, density
        self.velocity, self.material, self.viscosity = velocity, material, viscosity
        self.entered = 0
        self.waiting = np.zeros(0)  # diameters of particles that are due [m]
        self._begin: float | None = None
        self._generator = np.random.default_rng(seed)

    def __call__(self, run: ParticleSolver) -> int:
        """Insert the particles that are due; returns their number."""
        if self._begin is None:
            self._begin = run.time
        due = int(self.rate * (run.time - self._begin) * (1.0 + 1e-12)) - self.entered - len(self.waiting)
        if due > 0:
            self.waiting = np.append(self.waiting, self.diameters(due))
        radius = 0.5 * self.waiting
        place, free = self._places(run, radius)
        if free.any():
            run.insert(
                make_particles(
                    place[free],
                    radius[free],
                    self.density,
                    velocity=np.array(self.velocity),
                    material=self.material,
                    viscosity=self.viscosity,
                )
            )
        self.waiting = self.waiting[~free]
        self.entered += int(free.sum())
        return int(free.sum())

    def _places(self, run: ParticleSolver, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A position for each sphere, and whether it is free."""
        largest = float(max(run.particles.radius.max(), radius.max(initial=0.0)))
        near = (run.particles.position >= self.corner - 2.0 * largest).all(axis=1)
        near &= (run.particles.position <= self.corner + self.size + 2.0 * largest).all(axis=1)
        there, sizes = run.particles.position[near], run.particles.radius[near]
        place, free = np.zeros((len(radius), 3)), np.zeros(len(radius), bool)
        tree = cKDTree(there) if len(there) else None
        for n in range(len(radius)):
            for _ in range(_TRIES):
                spot = self.corner + self._generator.uniform(0.0, 1.0, 3) * self.size
                others = [] if tree is None else tree.query_ball_point(spot, radius[n] + largest)
                apart = np.linalg.norm(there[others] - spot, axis=1) > sizes[others] + radius[n]
                new = np.linalg.norm(place[:n][free[:n]] - spot, axis=1) > radius[:n][free[:n]] + radius[n]
                if apart.all() and new.all():
                    place[n], free[n] = spot, True
                    break
        return place, free


class Outlet:
    """Removes and counts particles outside a region.

    low, high  opposite corners of the region; infinite in directions without an outlet [m]
    """

    def __init__(self, low: Vector = _NOWHERE_BELOW, high: Vector = _NOWHERE_ABOVE) -> None:
        self.low, self.high = np.array(low, float), np.array(high, float)
        self.left, self.mass = 0, 0.0

    def __call__(self, run: ParticleSolver) -> int:
        """Remove the particles that have left; returns their number."""
        place = run.particles.position
        gone = run.remove(np.any((place < self.low) | (place > self.high), axis=1))
        self.left += gone.count
        self.mass += float(gone.mass.sum())
        return gone.count
