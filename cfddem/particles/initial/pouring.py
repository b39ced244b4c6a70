"""Pour particles between walls until they are at rest."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cfddem.backend.errors import RunFailed
from cfddem.particles.initial.filling import loose_places
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import Solid, pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import Particles, kinetic_energy, make_particles
from cfddem.particles.walls.shapes import Plane
from cfddem.particles.walls.wall import Wall
from closures import contact

AT_REST = 1e-7
"""A bed is at rest if its kinetic energy is below this share of the potential energy released in the fall."""

Progress = Callable[[float, float], None]

_SOFT_PRESS, _SOFT_IMPACT = 1e-4, 2e-4
"""During the fall contacts are softened until weight and impact of the bed reach these shares of the modulus."""
_FALLING_RESTITUTION = 0.3
_STIFFER = 8.0
"""Contacts are stiffened by this factor at a time."""
_STEPS_BETWEEN_STOPS = (5, 7, 11, 13)
"""Steps between two stops of particles that move against their force; unequal, so as not to follow an oscillation."""

ROLLING, _ROLLS = 10.0, 1e-3
"""After this many times of a fall, particles that gain less than this share of the power of their weight are stopped,
too: nothing else slows a sphere that rolls on a flat floor."""

_BEFORE_RELEASE = 0.3
"""Particles are stopped until the bed has this share of the energy that it may have without stops."""

NEARLY_AT_REST = 1e-4
"""Share of the energy that may be left if a fluid stirs the bed anyway; a few particles may still roll."""

_UNBALANCED, _FEW, _SOME = 0.05, 1e-3, 2e-2
"""Unbalanced force over weight, and shares of particles that may exceed it: in a bed at rest, and nearly at rest."""


class Spheres(NamedTuple):
    """Spheres to pour."""

    table: np.ndarray  # pair table, of `cfddem.particles.material_pairs.pair_table`
    diameters: np.ndarray  # (N,) [m]
    density: np.ndarray | float  # (N,) or one for all [kg/m3]
    material: np.ndarray | int = 0  # (N,) or one for all, row of the pair table
    layer: np.ndarray | None = None  # (N,) lower numbers are poured first; mixed if not given


class Place(NamedTuple):
    """Where spheres are poured. Walls lie below the box or in it."""

    walls: Sequence[Wall]  # of the later run
    corner: tuple[float, float, float]  # lowest corner of the box in which the spheres start, open upward [m]
    size: tuple[float, float, float]  # its edges [m]
    periodic: tuple[float | None, float | None, float | None] = (None, None, None)  # lengths; None along open axes [m]


class Bed(NamedTuple):
    """A poured bed at rest."""

    particles: Particles  # in the order of the diameters, at rest
    largest_overlap: float  # of a sphere with another or a wall, over the smaller radius [-]
    energy: float  # remaining kinetic energy over the energy of the fall [-]
    time: float  # until the bed was at rest [s]
    run: ParticleSolver  # the run at its end


def poured_bed(
    spheres: Spheres,
    place: Place,
    *,
    seed: int,
    gravity: float = 9.81,
    laws: Laws | None = None,
    at_rest: float = AT_REST,
    patience: float = 50.0,
    progress: Progress | None = None,
) -> Bed:
    """Pour spheres between walls as fast as possible until they are at rest.

    Spheres fall with soft contacts of low restitution, without fluid and between walls at rest. Then particles that
    move against their force are stopped repeatedly until the bed is at rest, and the contacts are stiffened step by
    step. At the end the bed rests with the contacts of the later run. The tangential springs are in `run`, not in the
    particles: a new run over the particles alone begins without friction, and the bed settles a little before it rests
    again.

    seed      of the initial positions
    gravity   along -z [m/s2]
    laws      of the later run
    at_rest   largest remaining share of the energy of the fall
    patience  longest time, over the time of a fall from the top, or through the width if that is longer
    progress  called from time to time with the time and the remaining share of the energy

    Raises RunFailed if the bed does not come to rest in time.
    """
    table, diameters, density, material, layer = spheres
    diameters = np.asarray(diameters, float)
    still = [replace(wall, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0)) for wall in place.walls]
    corner = place.corner
    places = loose_places(diameters, still, corner, place.size, seed, layer)
    loose = make_particles(places, 0.5 * diameters, density, material=material)
    laws = laws or Laws()
    # without viscosity films have no force, but they keep particles at their minimum gap
    laws = laws._replace(cutoff_ratio=min(laws.cutoff_ratio, 0.02))
    height = float(places[:, 2].max()) - corner[2] + 0.5 * float(diameters.max())
    soft = _softening(table, float(np.max(density)), height, gravity)
    run = ParticleSolver(
        loose,
        _softened(table, soft, True),
        walls=still,
        laws=laws,
        gravity=(0.0, 0.0, -gravity),
        box=place.periodic,
        settings=SolverSettings(check_steps=False),  # steps follow the time_scales here
    )
    pouring = _Pouring(run, float(np.sum(loose.mass * gravity * (places[:, 2] - corner[2]))), gravity, height, patience)
    pouring.progress, pouring.at_rest = progress, at_rest
    pouring.fall()
    pouring.calm()
    while soft < 1.0:
        soft = min(1.0, _STIFFER * soft)
        run.table[:] = _softened(table, soft, True)
        run.refresh()
        pouring.calm()
    run.table[:] = table
    run.refresh()
    while (left := pouring.release()) > at_rest:
        pouring.calm()
    poured = _in_order(run.particles)
    return Bed(poured, deepest(run), left, pouring.time, run)


class _Pouring:
    """The stages of pouring: fall, calm, release."""

    at_rest = AT_REST
    progress: Progress | None = None

    def __init__(self, run: ParticleSolver, brought: float, gravity: float, height: float, patience: float) -> None:
        self.run, self.brought, self.gravity = run, brought, gravity
        self.fall_time = math.sqrt(2.0 * height / gravity)
        # in a shallow bed particles take longer to roll to their places than to fall
        reach = max(height, *np.ptp(run.particles.position[:, :2], axis=0))
        self.longest = patience * math.sqrt(2.0 * reach / gravity)
        self.time, self.start = 0.0, self._potential()
        self.slow = 0.1 * math.sqrt(gravity * float(run.particles.radius.min()))

    def go(self, step: float, steps: int) -> None:
        """Advance the bed, and give up when it does not come to rest.

        step    [s]
        steps   number of steps
        errors  RunFailed if the particles still move after the longest time
        """
        self.run.advance(step, steps)
        self.time += steps * step
        if self.time > self.longest:
            raise RunFailed(_not_at_rest(self.run, self.left, self.time, _BEFORE_RELEASE * self.at_rest))

    @property
    def left(self) -> float:
        """Remaining share of the energy of the fall: through the box, or further to where the particles are now."""
        return kinetic_energy(self.run.particles) / max(self.brought, self.start - self._potential())

    def _potential(self) -> float:
        """Energy of the weight above z = 0 [J]."""
        particles = self.run.particles
        return float(np.sum(particles.mass * self.gravity * particles.position[:, 2]))

    def report_progress(self) -> None:
        if self.progress is not None:
            self.progress(self.time, self.left)

    def fall(self) -> None:
        """Let the bed fall until 99 % of its energy is dissipated."""
        step = 0.5 * self.run.time_scales(self.gravity * self.fall_time).limit
        while True:
            self.go(step, max(1, int(0.1 * self.fall_time / step)))
            self.report_progress()
            if self.left < 1e-2 and self.time > 0.5 * self.fall_time:
                return

    def calm(self) -> None:
        """Stop particles that move against their force, repeatedly, until the bed is at rest."""
        particles = self.run.particles
        while True:
            step = 0.7 * self.run.time_scales(self.slow).limit
            for steps in 6 * _STEPS_BETWEEN_STOPS:
                self.go(step, steps)
                power = (particles.velocity * particles.force + particles.spin * particles.torque).sum(axis=1)
                back = power < 0.0
                if self.time > ROLLING * self.fall_time:
                    turning = particles.radius * np.linalg.norm(particles.spin, axis=1)
                    speed = np.linalg.norm(particles.velocity, axis=1) + turning
                    back |= power < _ROLLS * self.gravity * particles.mass * speed
                particles.velocity[back] = 0.0
                particles.spin[back] = 0.0
            self.report_progress()
            few = _FEW if self.at_rest <= AT_REST else _SOME
            if self.left < _BEFORE_RELEASE * self.at_rest and (unbalanced(self.run) > _UNBALANCED).mean() <= few:
                return

    def release(self) -> float:
        """Advance the bed without stops; returns the largest share of its energy."""
        step = self.run.time_scales(self.slow).recommended
        most = 0.0
        for _ in range(10):
            self.go(step, 50)
            most = max(most, self.left)
        self.report_progress()
        return most


def _not_at_rest(run: ParticleSolver, left: float, time: float, limit: float) -> str:
    """What to say of a bed that does not come to rest in time, and what a case can change."""
    moving = int(np.argmax((run.particles.velocity**2).sum(axis=1)))
    place = ", ".join(f"{coordinate:.3g}" for coordinate in run.particles.position[moving])
    share = (unbalanced(run) > _UNBALANCED).mean()
    return (
        f"the poured bed is not at rest after {time:.3g} s: it holds {left:.2g} of the energy of its fall (limit "
        f"{limit:g}), {share:.2%} of the particles are out of balance, the fastest one at ({place}) m.\n"
        'Raise friction or lower restitution of its material, set laws.rolling_resistance, or bed.start = "suspended"'
    )


def unbalanced(run: ParticleSolver) -> np.ndarray:
    """Unbalanced force on each particle, or torque over its radius, over its weight (N,) [-]."""
    particles = run.particles
    force, pull = np.linalg.norm(particles.force, axis=1), np.linalg.norm(particles.torque, axis=1) / particles.radius
    return np.maximum(force, pull) / (particles.mass * float(np.linalg.norm(run.gravity)))


def deepest(run: ParticleSolver) -> float:
    """Largest overlap of a sphere with another or a wall, over the smaller radius [-]."""
    if len(run.gap) == 0:
        return 0.0
    radius = run.particles.radius[run.edges.first]
    pairs = run.edges.between_particles
    radius[:pairs] = np.minimum(radius[:pairs], run.particles.radius[run.edges.second[:pairs]])
    return max(0.0, float((-run.gap / radius).max()))


def _softening(table: np.ndarray, density: float, height: float, gravity: float) -> float:
    """Factor by which contacts may be softened while the bed is poured, at most 1."""
    needed = density * gravity * height * max(1.0 / _SOFT_PRESS, 2.0 / _SOFT_IMPACT)
    return min(1.0, needed / float(table["contact_modulus"].min()))


def _softened(table: np.ndarray, softening: float, damped: bool) -> np.ndarray:
    """The pair table with softer contacts of low restitution."""
    soft = table.copy()
    for modulus in ("contact_modulus", "shear_modulus"):
        soft[modulus] *= softening
    if damped:
        soft["damping_ratio"] = np.maximum(soft["damping_ratio"], contact.damping_ratio(_FALLING_RESTITUTION))
        soft["linear_damping_ratio"] = np.maximum(
            soft["linear_damping_ratio"], contact.linear_damping_ratio(_FALLING_RESTITUTION)
        )
    return soft


def _in_order(particles: Particles) -> Particles:
    """The same particles in the order of their ids, at rest."""
    order = np.argsort(particles.id)
    return make_particles(
        particles.position[order], particles.radius[order], particles.density[order], material=particles.material[order]
    )


def pour(
    material: Solid,
    diameters: np.ndarray,
    column: tuple[float, float],
    *,
    seed: int,
    periodic: bool = False,
    gravity: float = 9.81,
    laws: Laws | None = None,
    progress: Progress | None = None,
) -> ParticleSolver:
    """Let spheres fall into a column with a flat floor at z = 0 until they are at rest.

    Only their contacts dissipate energy; :func:`poured_bed` is faster.

    material   of the spheres, the floor and the sides
    diameters  (N,) [m]
    column     width along x and depth along y; its corner is at the origin [m]
    seed       of the initial positions
    periodic   repeat the column sideways instead of closing it by walls
    gravity    [m/s2]
    laws       laws between particles; without rolling resistance, loose particles roll for a long time
    progress   called from time to time with the time and the remaining share of the energy
    returns    the run at rest; its `particles` are the bed

    Raises RunFailed if the bed does not come to rest within 20 times the fall from the top.
    """
    width, depth = column
    diameters = np.asarray(diameters, float)
    sides = [
        Plane(),
        Plane(normal=(1.0, 0.0, 0.0)),
        Plane(point=(width, 0.0, 0.0), normal=(-1.0, 0.0, 0.0)),
        Plane(normal=(0.0, 1.0, 0.0)),
        Plane(point=(0.0, depth, 0.0), normal=(0.0, -1.0, 0.0)),
    ]
    places = loose_places(diameters, sides, (0.0, 0.0, 0.0), (width, depth, float(diameters.max())), seed)
    run = ParticleSolver(
        make_particles(places, 0.5 * diameters, material.density),
        pair_table([material]),
        walls=sides[:1] if periodic else sides,
        laws=laws,
        gravity=(0.0, 0.0, -gravity),
        box=(width, depth, None) if periodic else (None, None, None),
    )
    spheres = run.particles
    top = float(spheres.position[:, 2].max())
    fall = math.sqrt(2.0 * top / gravity)
    brought = float(np.sum(spheres.mass * gravity * spheres.position[:, 2]))
    step = run.time_scales(gravity * fall).recommended
    while run.time < 20.0 * fall:
        run.advance(step, max(1, int(0.05 * fall / step)))
        left = kinetic_energy(run.particles) / brought
        if progress is not None:
            progress(run.time, left)
        if run.time > fall and left < AT_REST:
            return run
    raise RunFailed(_not_at_rest(run, left, run.time, AT_REST))
