r"""One impact with smoothed particles, step by step, with the interface of the grid's :class:`GridImpact`.

In a film thinner than the spacing, particles miss a part of the viscous resistance; the bead gets it as an impulse,

.. math:: m\,\Delta V = 6\pi\eta R^2\Big[\ln\frac{h}{\Delta x} - \frac{h}{\Delta x}\Big]_{h_1}^{h_2}
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from scenarios.collisions.film_impact.grid import Grid
from scenarios.collisions.film_impact.ledger import Losses
from scenarios.collisions.film_impact.pressure import Bead, Solved
from scenarios.collisions.film_impact.solver import Settings
from scenarios.references.isph.liquid import SmoothedLiquid, reflected

COARSEST = 34, 5
"""Particles along the side of the quarter and in the depth of the film, in the coarsest run of the paper."""

COURANT, NEAR = 0.25, 0.1
"""Spacings that the liquid crosses in a step, and that the bead does while its gap is below one."""


class SmoothedImpact:
    """State of an impact, advanced by :meth:`step`."""

    def __init__(self, bead: Bead, film: float, layers: int, density: float, viscosity: float, restitution: float,
                 gravity: float, settings: Settings) -> None:  # fmt: skip
        dx = film / layers
        widest = 1.1 * math.sqrt(4.0 * bead.radius * film) / dx + 3.0
        side = max(math.ceil(COARSEST[0] * layers / COARSEST[1]), math.ceil(widest))
        self.flow = SmoothedLiquid((side, side, layers), dx, density, viscosity, gravity, bead)
        self.bead, self.film, self.density, self.viscosity = bead, film, density, viscosity
        self.restitution, self.gravity, self.settings = restitution, gravity, settings
        self.grid = Grid(math.ceil(1.5 * side), 5 * layers, dx)
        self.volume = np.full(len(self.flow.place), 4.0 * dx**3)
        self.time, self.contacts, self.steps, self.wetted = 0.0, 0, 0, 0
        self.losses, self.impulses = Losses(), np.zeros(3)
        self._bin()

    def step(self) -> None:
        """Advance liquid and bead."""
        dt = self.time_step()
        self.flow.step(dt)
        self._count(dt)
        self._move(dt)
        self.time += dt
        self.steps += 1
        self._bin()

    def time_step(self) -> float:
        """Longest accurate step; it ends where the solids touch [s]."""
        dx, bead, speed = self.flow.dx, self.bead, abs(self.bead.velocity)
        fastest = max(
            float(np.linalg.norm(self.flow.velocity, axis=1).max()), speed, math.sqrt(self.gravity * dx), 1e-9
        )
        dt = COURANT * dx / fastest
        if bead.gap < dx and speed > 0.0:
            dt = min(dt, NEAR * dx / speed)
        return dt

    def _count(self, dt: float) -> None:
        """Add up losses and impulses of the step."""
        self.losses.viscous += 4.0 * self.flow.losses["viscous"]
        self.losses.impulsive += 4.0 * self.flow.losses["impulsive"]
        self.losses.exchange += 4.0 * self.flow.losses["exchange"]
        self.flow.losses = dict.fromkeys(self.flow.losses, 0.0)
        weight = self.density * self.gravity * float(self.volume.sum())
        self.impulses += dt * np.array([self.bead.force, self.flow.plate_force, -weight])

    def _move(self, dt: float) -> None:
        """Move the bead; at the minimum gap it rebounds. Keep the particles between plate, mirrors and bead."""
        bead, least, before = self.bead, self.settings.minimum_gap, self.bead.gap
        bead.gap = max(before + dt * bead.velocity, least)
        self._resist(before)
        if bead.gap == least and bead.velocity < 0.0:
            self.losses.contact += 0.5 * bead.mass * bead.velocity**2 * (1.0 - self.restitution**2)
            bead.velocity *= -self.restitution
            self.contacts += 1
        flow = self.flow
        flow.place = reflected(flow.place, flow.size)
        centre = np.array([0.0, 0.0, bead.gap + bead.radius])
        away = flow.place - centre
        far = np.linalg.norm(away, axis=1)
        inside = far < bead.radius
        flow.place[inside] = centre + away[inside] * (bead.radius / far[inside])[:, None]
        flow.place[:, 2] = np.maximum(flow.place[:, 2], 0.0)

    def _resist(self, before: float) -> None:
        """Resistance that the particles miss in a film thinner than their spacing, between two gaps."""
        bead, dx = self.bead, self.flow.dx
        low, high = sorted((min(before, dx) / dx, min(bead.gap, dx) / dx))
        lost = 6.0 * math.pi * self.viscosity * bead.radius**2 / bead.mass * (math.log(high / low) - (high - low))
        slower = math.copysign(max(abs(bead.velocity) - lost, 0.0), bead.velocity)
        self.losses.viscous += 0.5 * bead.mass * (bead.velocity**2 - slower**2)
        bead.velocity = slower

    def liquid_energy(self) -> tuple[float, float, float]:
        """Kinetic and potential energy of the liquid [J], and its vertical momentum [kg m/s]."""
        flow = self.flow
        mass = 4.0 * flow.mass
        potential = mass * self.gravity * float(flow.place[:, 2].sum())
        return 4.0 * flow.kinetic_energy(), potential, mass * float(flow.velocity[:, 2].sum())

    @property
    def particles(self) -> np.ndarray:
        """Radius and height [m], radial and vertical velocity [m/s] of the particles (n, 4)."""
        place, velocity = self.flow.place, self.flow.velocity
        radius = np.hypot(place[:, 0], place[:, 1])
        outwards = (place[:, 0] * velocity[:, 0] + place[:, 1] * velocity[:, 1]) / np.maximum(radius, 1e-30)
        return np.stack([radius, place[:, 2], outwards, velocity[:, 2]], axis=1)

    def _bin(self) -> None:
        """Mean pressure of the particles in rings of the grid, and the wetted radius."""
        grid, bead = self.grid, self.bead
        grid.place_bead(bead.radius, bead.gap)
        most = np.array(grid.open_cell.shape) - 1
        place = np.minimum((self.particles[:, :2] / grid.dx).astype(int), most)
        counts, sums = np.zeros(grid.open_cell.shape), np.zeros(grid.open_cell.shape)
        np.add.at(counts, (place[:, 0], place[:, 1]), 1.0)
        np.add.at(sums, (place[:, 0], place[:, 1]), self.flow.pressure)
        self.liquid = counts > 0.0
        pressure = np.where(self.liquid, sums / np.maximum(counts, 1.0), 0.0)
        self.solved = Solved(pressure, bead.force, self.flow.plate_force)
        away = np.linalg.norm(self.flow.place - np.array([0.0, 0.0, bead.gap + bead.radius]), axis=1)
        touching = place[away < bead.radius + grid.dx, 0]
        self.wetted = int(touching.max(initial=-1)) + 1


# ---------------------------------------------------------------- checks


class AtRest(NamedTuple):
    """Errors of a layer of water at rest."""

    plate_force: float  # relative [-]
    bottom_pressure: float  # of the lowest layer of particles, relative [-]
    largest_speed: float  # of any particle, in the whole time [m/s]


def layer_at_rest(layers: int, steps: int = 200) -> AtRest:
    """A layer of water of 0.09 mm per particle, from the start on.

    layers   of particles
    steps    of 0.2 ms; pressure and force are those of the third
    """
    dx, density, gravity = 0.09e-3, 1000.0, 9.81
    pool = SmoothedLiquid((8, 8, layers), dx, density, 1e-3, gravity)
    for _ in range(3):
        pool.step(1e-5)
    weight = density * gravity * layers * dx
    force = pool.plate_force / (weight * 4.0 * (8.0 * dx) ** 2) - 1.0
    lowest = float(pool.pressure[::layers].mean()) / (weight * (layers - 0.5) / layers) - 1.0
    fastest = 0.0
    for _ in range(steps):
        pool.step(2e-4)
        fastest = max(fastest, float(np.abs(pool.velocity).max()))
    return AtRest(force, lowest, fastest)


def taylor_green(side: int, until: float = 0.2, viscosity: float = 0.05) -> float:
    """Relative error of the speed of a Taylor-Green vortex, which decays as exp(-2 pi^2 nu t).

    side       particles along the unit square
    until      time over that of a crossing [-]
    viscosity  over speed and side [-]
    """
    box = SmoothedLiquid((side, side, 3), 1.0 / side, 1.0, viscosity, 0.0, None, False)
    x, y = box.place[:, :2].T
    box.velocity[:, 0] = np.sin(np.pi * x) * np.cos(np.pi * y)
    box.velocity[:, 1] = -np.cos(np.pi * x) * np.sin(np.pi * y)
    begin, time = box.kinetic_energy(), 0.0
    dt = min(0.25 / side, 0.2 / (viscosity * side**2))
    while time < until:
        box.step(dt)
        box.place = reflected(box.place, box.size)
        time += dt
    return math.sqrt(box.kinetic_energy() / begin) * math.exp(2.0 * math.pi**2 * viscosity * time) - 1.0
