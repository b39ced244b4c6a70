"""Particles that enter and leave during a run: feeds and outlets."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from cfddem.backend.errors import InputError
from cfddem.particles.initial.packing import Seed
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles, make_particles
from cfddem.particles.vectors import Vector
from cfddem.particles.walls.arrays import near_walls
from cfddem.particles.walls.nearest_point import Walls

_TRIES = 20
"""Positions that are tried for a particle before it waits for the next call."""


_NOWHERE_BELOW, _NOWHERE_ABOVE = (-np.inf, -np.inf, -np.inf), (np.inf, np.inf, np.inf)


@dataclass(eq=False)
class Feed:
    """Inserts particles in a box at a constant rate.

    Call it with the run from time to time; it inserts the particles due since its first call, or since `begin`. A
    particle that finds no position in the box free of particles and walls waits for the next call. A run that is
    resumed with the `checkpoint()` of its feeds and outlets continues with the same bits.

    rate          [1/s]
    corner, size  of the box in which centres appear; a size may be 0 [m]
    diameters     (number, generator) -> diameters (number,) [m], drawn from the random generator of the feed, for
                  instance `lambda number, draw: normal(number, 1e-3, 1e-4, draw)`
    density       [kg/m3]
    velocity      of inserted particles [m/s]
    material      row of the pair table
    viscosity     of the fluid around them [Pa s]
    seed          of the random positions and diameters
    begin, end    times between which particles become due; from the first call on if not given [s]
    finish        called with new particles before they are inserted, for instance to declare fields
    """

    rate: float
    corner: Vector
    size: Vector
    diameters: Callable[[int, np.random.Generator], np.ndarray]
    density: float
    _: KW_ONLY
    velocity: Vector = (0.0, 0.0, 0.0)
    material: int = 0
    viscosity: float = 0.0
    seed: Seed
    begin: float = math.nan  # or time of the first call
    end: float = math.inf
    finish: Callable[[Particles], None] = lambda _: None

    def __post_init__(self) -> None:
        if not 0.0 <= self.rate < np.inf:
            raise InputError("rate", self.rate, "at least 0")
        self._corner, self._size = np.array(self.corner, float), np.array(self.size, float)
        self.entered = 0
        self.waiting = np.zeros(0)  # diameters of particles that are due [m]
        self._generator = np.random.default_rng(self.seed)

    def __call__(self, run: ParticleSolver) -> int:
        """Insert the particles that are due; returns their number."""
        if math.isnan(self.begin):
            self.begin = run.time
        active = max(min(run.time, self.end) - self.begin, 0.0)
        due = int(self.rate * active * (1.0 + 1e-12)) - self.entered - len(self.waiting)
        if due > 0:
            self.waiting = np.append(self.waiting, self.diameters(due, self._generator))
        if not len(self.waiting):
            return 0
        radius = 0.5 * self.waiting
        place, free = self._places(run, radius)
        free &= apart_from_walls(place, radius, run.walls)
        entered = len(radius[free])
        if entered:
            fresh = make_particles(
                place[free],
                radius[free],
                self.density,
                velocity=np.array(self.velocity),
                material=self.material,
                viscosity=self.viscosity,
            )
            self.finish(fresh)
            run.insert(fresh)
        self.waiting = self.waiting[~free]
        self.entered += entered
        return entered

    def _places(self, run: ParticleSolver, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A position for each sphere, and whether it is free; the same on all ranks."""
        largest = run.communicator.largest(np.append(run.particles.radius, radius))
        low, high = self._corner - 2.0 * largest, self._corner + self._size + 2.0 * largest
        near = _inside(run.particles.position, low, high)
        there, sizes = run.particles.position[near], run.particles.radius[near]
        place, free = np.zeros((len(radius), 3)), np.zeros(len(radius), bool)
        tree = cKDTree(there) if len(there) else None
        for n in range(len(radius)):
            for _ in range(_TRIES):
                spot = self._corner + self._generator.uniform(0.0, 1.0, 3) * self._size
                near_by = [] if tree is None else tree.query_ball_point(spot, radius[n] + largest)
                others = np.concatenate([there[near_by], place[:n][free[:n]]])
                reach = np.concatenate([sizes[near_by], radius[:n][free[:n]]]) + radius[n]
                if run.communicator.all(np.einsum("nd,nd->n", others - spot, others - spot) > reach**2):
                    place[n], free[n] = spot, True
                    break
        return place, free

    def checkpoint(self) -> dict[str, Any]:
        """Everything that the next particles depend on."""
        return {
            "entered": self.entered,
            "waiting": self.waiting.copy(),
            "begin": self.begin,
            "generator": self._generator.bit_generator.state,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()` of the same feed."""
        self.entered, self.waiting = int(state["entered"]), np.array(state["waiting"])
        self.begin = float(state["begin"])
        self._generator.bit_generator.state = state["generator"]


class ParticleOutlet:
    """Removes and counts particles outside a region, or inside it.

    Particles with a field `entered`, the time at which they did [s], have a residence time where this is a number.

    low, high  opposite corners of the region; infinite in directions without an outlet [m]
    inside     remove the particles inside
    """

    def __init__(self, low: Vector = _NOWHERE_BELOW, high: Vector = _NOWHERE_ABOVE, *, inside: bool = False) -> None:
        self.low, self.high, self.inside = np.array(low, float), np.array(high, float), inside
        self.left, self.mass, self._times = 0, 0.0, [np.zeros(0)]

    @property
    def times(self) -> np.ndarray:
        """Residence times in the order in which particles left, of those that leave together the shortest first
        (n,) [s]."""
        if len(self._times) > 1:
            self._times = [np.concatenate(self._times)]
        return self._times[0]

    def takes(self, particles: Particles) -> np.ndarray:
        """Which particles are removed (N,) bool."""
        return _inside(particles.position, self.low, self.high) == self.inside

    def __call__(self, run: ParticleSolver) -> int:
        """Remove the particles that have left; returns their number."""
        gone = run.remove(self.takes(run.particles))
        left = run.communicator.sum(gone.count)
        self.left += left
        self.mass += run.communicator.sum(gone.mass)
        if left and "entered" in gone:
            stayed = run.time - run.communicator.joined(gone.entered)
            self._times.append(np.sort(stayed[np.isfinite(stayed)]))  # joined where they are read
        return left

    def checkpoint(self) -> dict[str, Any]:
        """What has left so far."""
        return {"left": self.left, "mass": self.mass, "times": self.times.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()` of the same outlet."""
        self.left, self.mass, self._times = int(state["left"]), float(state["mass"]), [np.array(state["times"], float)]


def apart_from_walls(place: np.ndarray, radius: np.ndarray, walls: Walls) -> np.ndarray:
    """Which spheres at positions (N, 3) [m] with radii (N,) [m] touch no wall and are behind none (N,) bool."""
    apart = np.ones(len(radius), bool)
    if len(radius) and len(walls.kind):
        touching, _ = near_walls(make_particles(place, radius, 1.0), walls, 0.0, 0.0)
        apart[touching] = False
    return apart


def _inside(position: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Which positions lie between two corners (N,) bool."""
    return np.logical_and.reduce((position >= low) & (position <= high), axis=1)  # local: three coordinates of a row
