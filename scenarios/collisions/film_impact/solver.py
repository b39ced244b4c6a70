"""One impact, step by step: liquid on the grid and in particles, and the bead."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from scenarios.collisions.film_impact import ledger, liquid, pressure, surface, viscosity
from scenarios.collisions.film_impact.grid import Cells, Faces, Grid, Underside
from scenarios.collisions.film_impact.pressure import Bead

FALL = 0.02
"""Longest step of a bead that its weight accelerates, over sqrt(film/g)."""

MISSING = 0.5
"""The outermost wetted column may lack this share of its volume, summed from the axis [-]."""


@dataclass(frozen=True)
class Settings:
    """Numbers of the method."""

    minimum_gap: float = 1e-6  # at which the solids touch [m]
    flip: float = 0.97  # share of its own velocity that a particle keeps [-]
    per_side: int = 3  # particles along each side of a cell
    missing: float = MISSING  # of the wetted radius
    guessed: float | None = None  # share of the guessed wetted radius, instead of the tracked one
    courant: float = 0.5
    contact: bool = True  # the bead rebounds at the minimum gap
    cavitation: float | None = None  # lowest pressure, below 0 [Pa]
    tension: surface.Tension | None = None  # of the surface


@dataclass
class GridImpact:
    """State of an impact, advanced by :meth:`step`."""

    grid: Grid
    bead: Bead
    film: float  # depth of the layer at rest [m]
    density: float  # of the liquid [kg/m3]
    viscosity: float  # dynamic [Pa s]
    restitution: float  # dry [-]
    gravity: float = 9.81  # [m/s2]
    settings: Settings = field(default_factory=Settings)

    def __post_init__(self) -> None:
        grid = self.grid
        self.time, self.contacts, self.steps = 0.0, 0, 0
        self.particles, self.volume = liquid.seed(grid, self.film, self.settings.per_side)
        self.u, self.w = np.zeros_like(grid.open_u), np.zeros_like(grid.open_w)
        # faces, radial and horizontal, whose velocity comes from particles or an earlier step; and those beside liquid
        self.known = [np.zeros(self.u.shape, np.bool_), np.zeros(self.w.shape, np.bool_)]
        self.wet = [np.zeros(self.u.shape, np.bool_), np.zeros(self.w.shape, np.bool_)]
        self.filled, self.whole = np.zeros(grid.open_cell.shape), liquid.full(grid, self.settings.per_side)
        self.liquid = np.zeros(grid.open_cell.shape, np.bool_)
        self.wetted = 0
        floor = self.settings.cavitation
        self.voids = None if floor is None else pressure.Voids(floor, np.zeros(grid.open_cell.shape))
        self.solved = pressure.Solved(np.zeros(grid.open_cell.shape), 0.0, 0.0)
        self.losses, self.turning = ledger.Losses(), (np.nan, np.nan)
        self.impulses = np.zeros(3)  # on the bead by the liquid, on the liquid by the plate, and of its weight [N s]

    @property
    def flow(self) -> Faces:
        """Velocity on the faces [m/s]."""
        return Faces(self.u, self.w)

    @property
    def cells(self) -> Cells:
        """Liquid in the cells."""
        return Cells(self.liquid, self.filled, self.grid.dx, self.grid.outer_open, self.density)

    @property
    def kinematic(self) -> float:
        """Kinematic viscosity [m2/s]."""
        return self.viscosity / self.density

    def step(self, longest: float = np.inf) -> None:
        """Advance liquid and bead by one step of at most `longest` seconds."""
        dt = min(self.time_step(), longest)
        self.find_liquid()
        last = self.u.copy(), self.w.copy()
        self.velocities_from_particles(dt, last)
        before = self.u.copy(), self.w.copy()
        arrived = self.grid_energy()
        self.apply_forces(dt)
        self.solve_pressure(dt)
        self.velocities_to_particles(dt, before, arrived)
        self.move(dt)
        self.time += dt
        self.steps += 1

    def time_step(self) -> float:
        """Longest stable and accurate step [s]."""
        s, dx, bead = self.settings, self.grid.dx, self.bead
        wide = viscosity.heights(self.grid, bead.radius, bead.gap) >= dx
        fastest = max(
            np.abs(self.u[wide] * self.wet[0][wide]).max(initial=0.0),
            np.abs(self.w * self.wet[1]).max(),
            abs(bead.velocity),
            1e-9,
        )
        dt = s.courant * dx / fastest
        if self.viscosity > 0.0:
            dt = min(dt, 0.2 * dx**2 / self.kinematic)
        if self.gravity > 0.0:
            dt = min(dt, s.courant * np.sqrt(dx / self.gravity))
            if np.isfinite(bead.mass) and abs(bead.velocity) < np.sqrt(self.gravity * self.film):
                dt = min(dt, FALL * np.sqrt(self.film / self.gravity))
        if s.tension is not None:
            dt = min(dt, s.tension.longest_step(dx, self.density))
        if bead.gap < dx:
            dt = min(dt, 0.2 * max(bead.gap, s.minimum_gap) / max(abs(bead.velocity), 1e-9))
        return float(dt)

    def find_liquid(self) -> None:
        """Mark the liquid cells: those filled to the centre, and the gap under the bead within the wetted radius."""
        grid, bead, s = self.grid, self.bead, self.settings
        grid.place_bead(bead.radius, bead.gap)
        self.filled = liquid.filled_share(grid, self.particles, self.volume, self.whole)
        if s.guessed is None:
            column = liquid.in_columns(grid, self.particles, self.volume)
            self.wetted = wetted_columns(grid, column, bead.radius, s.missing)
        else:
            self.wetted = guessed_columns(grid, s.guessed, bead.radius, bead.gap, self.film)
        self.liquid = self.filled > 0.5
        self.liquid[: self.wetted] |= grid.open_cell[: self.wetted] > 0.0

    def velocities_from_particles(self, dt: float, last: tuple[np.ndarray, np.ndarray]) -> None:
        """Velocities on the faces, from the particles or, where there is none, from the step before."""
        grid = self.grid
        liquid.to_faces(self.particles, self.volume, grid.dx, self.u, self.w, *self.known)
        liquid.carry(dt, grid.dx, last[0], self.u, self.known[0], last[0], self.wet[0])
        liquid.carry(dt, grid.dx, last[0], self.w, self.known[1], last[1], self.wet[1])
        wet_u, wet_w = liquid.cells_to_faces(self.liquid)
        self.wet = [wet_u & (grid.open_u > 0.0), wet_w & (grid.open_w > 0.0)]
        liquid.extend(self.u, self.known[0], liquid.AROUND)
        liquid.extend(self.w, self.known[1], liquid.AROUND)

    def apply_forces(self, dt: float) -> None:
        """Viscous stress of the liquid, and gravity on liquid and bead."""
        grid, bead = self.grid, self.bead
        rate, resting = self.kinematic * dt / grid.dx**2, self.grid_energy()
        under = Underside(bead.radius, bead.gap, bead.velocity, grid.dx)
        viscosity.diffuse(self.flow, Faces(*self.wet), grid.open, rate, under)
        self.losses.viscous += resting - self.grid_energy()
        self.w[:, 1:] -= self.gravity * dt
        if np.isfinite(bead.mass):
            bead.velocity -= self.gravity * dt
        if self.settings.tension is not None:
            self.pull(self.settings.tension, dt)

    def pull(self, tension: surface.Tension, dt: float) -> None:
        """Pull of the surface on the bead, along its contact line."""
        grid, bead = self.grid, self.bead
        contact = surface.contact_radius(self.filled, self.liquid, grid.open_w, grid.open_cell, grid.dx)
        before, force = bead.velocity, tension.pull(contact, bead.radius)
        bead.velocity += dt * force / bead.mass
        self.impulses[0] += dt * force
        if np.isfinite(bead.mass):
            self.losses.surface += 0.5 * bead.mass * (before**2 - bead.velocity**2)

    def grid_energy(self) -> float:
        """Kinetic energy of the flow on the grid [J]."""
        return float(ledger.kinetic_energy(self.flow, self.cells, self.grid.open))

    def solve_pressure(self, dt: float) -> None:
        """Make velocities and bead satisfy continuity."""
        grid, bead, tension = self.grid, self.bead, self.settings.tension
        mobility = viscosity.mobility_of_gaps(grid, bead.radius, bead.gap, self.kinematic, dt)
        edges = None if tension is None else tension.pressure(grid, self.filled, self.liquid, bead.radius, bead.gap)
        before = Faces(self.u.copy(), self.w.copy())
        arrived, moving = bead.velocity, self.grid_energy()
        self.solved = pressure.solve(grid, bead, self.flow, self.cells, mobility, dt, self.voids, edges=edges)
        if edges is not None:
            power = surface.work(*edges, self.liquid, self.u, self.w, grid.open_u, grid.open_w, grid.dx)
            self.losses.surface += float(power) * dt
        self.count_pressure_losses(mobility, before, arrived, moving)
        weight = self.density * self.gravity * float(self.volume.sum())
        self.impulses += dt * np.array([self.solved.force, self.solved.plate, -weight])

    def count_pressure_losses(self, mobility: np.ndarray, before: Faces, arrived: float, moving: float) -> None:
        """Add what the pressure step took from liquid and bead to the losses.

        mobility  of the radial faces
        before    velocities on the faces before the step [m/s]
        arrived   speed of the bead before it [m/s]
        moving    kinetic energy of the flow before it [J]
        """
        bead, losses = self.bead, self.losses
        impulsive, viscous = ledger.pressure_losses(self.flow, before, mobility, self.cells, self.grid.open)
        losses.viscous += viscous
        losses.impulsive += impulsive
        if np.isfinite(bead.mass):
            losses.impulsive += 0.5 * bead.mass * (bead.velocity - arrived) ** 2
        if self.voids is not None:
            losses.voids = self.voids.work
        if self.contacts == 1 and np.isnan(self.turning[0]):  # the first step after contact, in which the liquid turns
            self.turning = ledger.while_turning(moving, self.grid_energy(), impulsive)

    def velocities_to_particles(self, dt: float, before: tuple[np.ndarray, np.ndarray], arrived: float) -> None:
        """Give the particles their new velocities, and extend the grid's around the liquid."""
        gained = self.grid_energy() - arrived
        self.u = liquid.extended_change(self.u, before[0], self.wet[0], 0.0)
        self.w = liquid.extended_change(self.w, before[1], self.wet[1], -self.gravity * dt)
        kinetic = self.liquid_energy()[0]
        liquid.to_particles(self.particles, self.grid.dx, self.settings.flip, self.u, self.w, *before)
        self.losses.exchange += gained - (self.liquid_energy()[0] - kinetic)

    def liquid_energy(self) -> tuple[float, float, float]:
        """Kinetic and potential energy of the liquid [J], and its vertical momentum [kg m/s]."""
        return ledger.particle_energy(self.particles, self.volume, self.density, self.gravity)  # type: ignore[no-any-return]

    def move(self, dt: float) -> None:
        """Move bead and particles; at the minimum gap the bead turns, and the next pressure turns the liquid."""
        bead, s = self.bead, self.settings
        bead.gap += dt * bead.velocity
        if s.contact and bead.gap <= s.minimum_gap and bead.velocity < 0.0:
            bead.gap = s.minimum_gap
            self.losses.contact += 0.5 * bead.mass * bead.velocity**2 * (1.0 - self.restitution**2)
            bead.velocity *= -self.restitution
            self.contacts += 1
        thin = viscosity.heights(self.grid, bead.radius, bead.gap) < viscosity.THIN * self.grid.dx
        liquid.spread_out(self.particles, self.grid.dx, self.filled, self.grid.open_cell, int(thin.sum()))
        liquid.move(self.particles, self.grid.dx, dt, self.u, self.w, bead.radius, bead.gap)


# ---------------------------------------------------------------- wetting


def wetted_columns(grid: Grid, column: np.ndarray, radius: float, missing: float = MISSING) -> int:
    """Number of columns from the axis whose gap is full.

    column   volume of the liquid in each column [m3]
    radius   of the bead [m]
    missing  share of its volume that the outermost wetted column may lack
    """
    below = min(int(radius / grid.dx), grid.radial)
    room = (grid.ring * grid.dx)[:below] * grid.open_cell[:below].sum(axis=1)
    lacking = np.cumsum(room - column[:below])
    full = np.flatnonzero(lacking <= missing * room)
    return int(full[-1]) + 1 if len(full) else 0


def guessed_columns(grid: Grid, share: float, radius: float, gap: float, film: float) -> int:
    """The same from a guess instead: a share of the radius of an undisturbed layer of twice its depth, for comparison.

    .. math:: r_w = s \\sqrt{2 R (2 d - z_0 - d)} = s \\sqrt{D (d - z_0)}
    """
    return int(share * math.sqrt(max(2.0 * radius * (film - gap), 0.0)) / grid.dx)
