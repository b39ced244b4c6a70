"""The flow around spheres in a periodic box: lattice, spheres and static solids put together, step by step."""

from __future__ import annotations

import math

import numpy as np

from scenarios.references.resolved_suspension import lattice, spheres

MAGIC = 3.0 / 16.0
"""Product of both relaxation times: a plane wall then lies half-way between solid and fluid cells."""

SURFACE = 0.1
"""Cells to add to the radius of the solid weight, so that the hydrodynamic radius is the radius asked for."""


class Flow:
    """Fluid in a periodic box of cells, in lattice units (cell, step, density of the fluid 1).

    shape      cells along x, y, z
    viscosity  kinematic, of the lattice [cells2/step]
    force      body force on every cell, the inside of spheres included
    static     solid weight of cells that are no spheres: walls (1), or layers that hold a velocity (below 1)
    moving     velocity times weight of these cells (3, z, y, x); at rest if not given
    """

    def __init__(
        self,
        shape: tuple[int, int, int],
        viscosity: float,
        *,
        force: tuple[float, float, float] = (0.0, 0.0, 0.0),
        static: np.ndarray | None = None,
        moving: np.ndarray | None = None,
        magic: float = MAGIC,
    ) -> None:
        self.shape, self.viscosity = shape, viscosity
        self.force = np.array(force, float)
        self.rates = lattice.rates(viscosity, magic)
        self.populations, self._next = lattice.at_rest(shape), lattice.at_rest(shape)
        cells = shape[::-1]
        self.static = np.zeros(cells) if static is None else static
        self.moving = np.zeros((3, *cells)) if moving is None else moving
        self.share, self.weight, self.target = np.empty(cells), np.empty(cells), np.empty((3, *cells))
        self._arriving = np.zeros((3, *cells))

    @property
    def softness(self) -> float:
        """Viscosity by which partly solid cells are weighted: relaxation time less one half [steps]."""
        return 3.0 * self.viscosity

    def place(self, positions: np.ndarray, radius: float) -> None:
        """Find the share of every cell that solids cover, spheres at these positions among them."""
        self.positions, self.radius = np.ascontiguousarray(positions), radius + SURFACE
        np.copyto(self.share, self.static)
        spheres.cover(self.positions, self.radius, self.share)

    def sums(self) -> np.ndarray:
        """Sums over the cells of every sphere that its exchange of momentum needs (spheres, SUMS)."""
        sums = np.empty((len(self.positions), spheres.SUMS))
        lattice.momentum_of(self.populations, self.share, self._arriving)
        spheres.gather(self.positions, self.radius, self.share, self.softness, self._arriving, self.force, sums)
        return sums

    def advance(self, velocity: np.ndarray, spin: np.ndarray) -> None:
        """One step of the fluid around spheres that move with these velocities and spins."""
        np.copyto(self.weight, self.static)
        np.copyto(self.target, self.moving)
        spheres.impose(self.positions, velocity, spin, self.radius, self.share, self.softness, self.weight, self.target)
        lattice.stream_and_collide(self.populations, self._next, self.weight, self.target, self.force, *self.rates)
        self.populations, self._next = self._next, self.populations

    def move(self, velocity: np.ndarray) -> None:
        """Set all of the fluid in motion at one velocity."""
        self.populations[:] = lattice.equilibrium(velocity)[:, None, None, None]

    def momentum(self) -> np.ndarray:
        """Momentum of all cells (3,)."""
        interior = self.populations[:, :, :, 1:-1].reshape(19, -1).sum(axis=1)
        return np.asarray(lattice.VELOCITIES.T @ interior)

    def velocity(self) -> np.ndarray:
        """Velocity in every cell (3, z, y, x): of the fluid, and of solids where there are any."""
        velocity = np.empty_like(self.target)
        lattice.momentum_of(self.populations, np.ones_like(self.share), velocity)
        velocity += 0.5 * self.force[:, None, None, None]
        share = np.minimum(self.weight, 1.0)
        return (1.0 - share) * velocity + self.target


def force_of(sums: np.ndarray, velocity: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Force of the fluid on every sphere whose motion is given (spheres, 3), the inside's acceleration included."""
    moment = sums[:, 1:4]
    return sums[:, 10:13] - sums[:, :1] * velocity - np.cross(spin, moment)


def sphere_volume(diameter: float) -> float:
    """Volume of a sphere."""
    return math.pi / 6.0 * diameter**3
