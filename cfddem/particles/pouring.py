"""Pour particles between walls and let them come to rest."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cfddem.errors import RunFailed
from cfddem.materials import Material, pair_table
from cfddem.particles.filling import loose_places
from cfddem.particles.forces import Laws
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Bodies, bodies, kinetic_energy
from cfddem.particles.walls import Plane, Wall
from closures import contact

AT_REST = 1e-7
"""A bed is at rest when its kinetic energy is below this share of the energy it fell with."""

Progress = Callable[[float, float], None]

_SOFT_PRESS, _SOFT_IMPACT = 1e-4, 2e-4
"""While they fall, grains are as soft as keeps weight and impact of the bed below these shares of the modulus."""
_FALLING_RESTITUTION = 0.3
_STIFFER = 8.0
"""Contacts become stiffer by this factor at a time."""
_BREATHS = (5, 7, 11, 13)
"""Steps between two looks at who swings back; unequal, lest a swing keep time with them."""

NEARLY_AT_REST = 1e-4
"""Share of the energy that may be left where a fluid will stir the bed at once; a few grains may still roll."""

_UNBALANCED, _FEW, _SOME = 0.05, 1e-3, 2e-2
"""In a bed at rest, no more than a few particles feel more than this share of their weight; nearly at rest, some."""


class Bed(NamedTuple):
    """A bed at rest."""

    bodies: Bodies  # in the order of the diameters, with no velocity
    largest_overlap: float  # of a sphere with another or a wall, over the smaller radius [-]
    energy: float  # kinetic energy that was left over the energy of the fall [-]
    time: float  # that the bed took to come to rest [s]
    run: ParticleSolver  # in which it rests


def pour_into(
    table: np.ndarray,
    diameters: np.ndarray,
    density: np.ndarray | float,
    walls: Sequence[Wall],
    corner: tuple[float, float, float],
    size: tuple[float, float, float],
    *,
    box: tuple[float | None, float | None, float | None] = (None, None, None),
    seed: int,
    material: np.ndarray | int = 0,
    layer: np.ndarray | None = None,
    gravity: float = 9.81,
    laws: Laws | None = None,
    at_rest: float = AT_REST,
    progress: Progress | None = None,
) -> Bodies:
    """Particles at rest between walls, as :func:`poured_bed` pours them."""
    return poured_bed(
        table,
        diameters,
        density,
        walls,
        corner,
        size,
        box=box,
        seed=seed,
        material=material,
        layer=layer,
        gravity=gravity,
        laws=laws,
        at_rest=at_rest,
        progress=progress,
    ).bodies


def poured_bed(
    table: np.ndarray,
    diameters: np.ndarray,
    density: np.ndarray | float,
    walls: Sequence[Wall],
    corner: tuple[float, float, float],
    size: tuple[float, float, float],
    *,
    box: tuple[float | None, float | None, float | None] = (None, None, None),
    seed: int,
    material: np.ndarray | int = 0,
    layer: np.ndarray | None = None,
    gravity: float = 9.81,
    laws: Laws | None = None,
    at_rest: float = AT_REST,
    patience: float = 50.0,
    progress: Progress | None = None,
) -> Bed:
    """Pour spheres between walls, as fast as may be, and let them come to rest.

    They fall with soft contacts of little restitution, without fluid and between walls at rest, are stopped whenever
    they swing back until they lie still, and get back their stiffness step by step. The bed rests under the contacts
    of the later run. Friction has a memory, which is in `run` and not in the bodies: a new run over the bodies alone
    begins without friction, and the bed yields a little before it rests again.

    table         pair table, :func:`cfddem.materials.pair_table`
    diameters     (N,) [m]
    density       (N,) or one for all [kg/m3]
    walls         of the later run
    corner, size  lowest corner and edges of the box in which the spheres start, open upward; walls below it or in it
                  catch them [m]
    box           length of the periodic box, which begins at 0; None along open axes [m]
    seed          same seed, same bed
    material      (N,) or one for all, row of the pair table
    layer         (N,) those of a lower number are poured first; mixed if not given
    gravity       along -z [m/s2]
    laws          of the later run
    at_rest       share of the energy of the fall that may be left
    patience      give up after this many times the time of a fall from the top
    progress      called now and then with the time and the share of the kinetic energy that is left

    Raises RunFailed where the bed does not come to rest in time.
    """
    diameters = np.asarray(diameters, float)
    still = [replace(wall, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0)) for wall in walls]
    places = loose_places(diameters, still, corner, size, seed, layer)
    spheres = bodies(places, 0.5 * diameters, density, material=material)
    laws = laws or Laws()
    # without viscosity films carry nothing, but they hold grains apart at their minimum gap
    laws = laws._replace(cutoff_ratio=min(laws.cutoff_ratio, 0.02))
    height = float(places[:, 2].max()) - corner[2] + 0.5 * float(diameters.max())
    soft = _softening(table, float(np.max(density)), height, gravity)
    run = ParticleSolver(
        spheres,
        _softened(table, soft, True),
        walls=still,
        laws=laws,
        gravity=(0.0, 0.0, -gravity),
        box=box,
        check_steps=False,  # steps follow the clocks here
    )
    bath = _Bath(run, float(np.sum(spheres.mass * gravity * (places[:, 2] - corner[2]))), gravity, height)
    bath.patience, bath.progress, bath.at_rest = patience, progress, at_rest
    bath.fall()
    bath.calm()
    while soft < 1.0:
        soft = min(1.0, _STIFFER * soft)
        run.table[:] = _softened(table, soft, True)
        run.refresh()
        bath.calm()
    run.table[:] = table
    run.refresh()
    while (left := bath.release()) > at_rest:
        bath.calm()
    grains = _in_order(run.bodies)
    return Bed(grains, deepest(run), left, bath.time, run)


class _Bath:
    """A bed on its way to rest."""

    patience = 50.0
    at_rest = AT_REST
    progress: Progress | None = None

    def __init__(self, run: ParticleSolver, brought: float, gravity: float, height: float) -> None:
        self.run, self.brought, self.gravity = run, brought, gravity
        self.fall_time = math.sqrt(2.0 * height / gravity)
        self.time = 0.0
        self.slow = 0.1 * math.sqrt(gravity * float(run.bodies.radius.min()))

    def go(self, step: float, steps: int) -> None:
        self.run.advance(step, steps)
        self.time += steps * step
        if self.time > self.patience * self.fall_time:
            raise RunFailed(
                f"the bed still holds {self.left:.2g} of its energy after {self.time:.3g} s (limit {self.at_rest:g}); "
                "raise patience, or use a material with more friction or less restitution"
            )

    @property
    def left(self) -> float:
        """Share of the energy of the fall that is left."""
        return kinetic_energy(self.run.bodies) / self.brought

    def tell(self) -> None:
        if self.progress is not None:
            self.progress(self.time, self.left)

    def fall(self) -> None:
        """Let the bed fall until most of its energy is gone."""
        step = 0.5 * self.run.clocks(self.gravity * self.fall_time).limit
        while True:
            self.go(step, max(1, int(0.1 * self.fall_time / step)))
            self.tell()
            if self.left < 1e-2 and self.time > 0.5 * self.fall_time:
                return

    def calm(self) -> None:
        """Stop whatever swings back, again and again, until the bed is at rest."""
        made = self.run.bodies
        while True:
            step = 0.7 * self.run.clocks(self.slow).limit
            for steps in 6 * _BREATHS:
                self.go(step, steps)
                back = (made.velocity * made.force + made.spin * made.torque).sum(axis=1) < 0.0
                made.velocity[back] = 0.0
                made.spin[back] = 0.0
            self.tell()
            few = _FEW if self.at_rest <= AT_REST else _SOME
            if self.left < 0.3 * self.at_rest and (unbalanced(self.run) > _UNBALANCED).mean() <= few:
                return

    def release(self) -> float:
        """Watch the bed without damping; returns the largest share of its energy seen."""
        step = self.run.clocks(self.slow).recommended
        most = 0.0
        for _ in range(10):
            self.go(step, 50)
            most = max(most, self.left)
        self.tell()
        return most


def unbalanced(run: ParticleSolver) -> np.ndarray:
    """Force that is left on each particle, or torque over its radius, over its weight (N,) [-]."""
    made = run.bodies
    force, pull = np.linalg.norm(made.force, axis=1), np.linalg.norm(made.torque, axis=1) / made.radius
    return np.maximum(force, pull) / (made.mass * float(np.linalg.norm(run.gravity)))


def deepest(run: ParticleSolver) -> float:
    """Largest overlap of a sphere with another or a wall, over the smaller radius [-]."""
    if len(run.gap) == 0:
        return 0.0
    radius = run.bodies.radius[run.edges.first]
    pairs = run.edges.between_particles
    radius[:pairs] = np.minimum(radius[:pairs], run.bodies.radius[run.edges.second[:pairs]])
    return max(0.0, float((-run.gap / radius).max()))


def _softening(table: np.ndarray, density: float, height: float, gravity: float) -> float:
    """How much softer contacts may be while the bed is poured, 1 at most."""
    needed = density * gravity * height * max(1.0 / _SOFT_PRESS, 2.0 / _SOFT_IMPACT)
    return min(1.0, needed / float(table["contact_modulus"].min()))


def _softened(table: np.ndarray, softening: float, damped: bool) -> np.ndarray:
    """The pair table with softer contacts of little restitution."""
    soft = table.copy()
    for modulus in ("contact_modulus", "shear_modulus"):
        soft[modulus] *= softening
    if damped:
        soft["damping_ratio"] = np.maximum(soft["damping_ratio"], contact.damping_ratio(_FALLING_RESTITUTION))
        soft["linear_damping_ratio"] = np.maximum(
            soft["linear_damping_ratio"], contact.linear_damping_ratio(_FALLING_RESTITUTION)
        )
    return soft


def _in_order(made: Bodies) -> Bodies:
    """The same particles in the order of their ids, at rest and without what they remember."""
    order = np.argsort(made.id)
    return bodies(made.position[order], made.radius[order], made.density[order], material=made.material[order])


def pour(
    material: Material,
    diameters: np.ndarray,
    column: tuple[float, float],
    *,
    seed: int,
    periodic: bool = False,
    gravity: float = 9.81,
    laws: Laws | None = None,
    patience: float = 20.0,
    progress: Progress | None = None,
) -> ParticleSolver:
    """Let spheres fall into a column with a flat floor at z = 0 until they lie still.

    Nothing but their contacts brings them to rest; :func:`pour_into` is faster.

    material   of the spheres, the floor and the sides
    diameters  (N,) [m]
    column     width along x and depth along y; its corner is at the origin [m]
    seed       same seed, same bed
    periodic   repeat the column sideways instead of closing it by walls
    gravity    [m/s2]
    laws       which laws hold between two bodies; without resistance to rolling, loose grains roll for long
    patience   give up after this many times the time of a fall from the top
    progress   called now and then with the time and the share of the kinetic energy that is left
    returns    the run at rest; its `bodies` are the bed

    Raises RunFailed where the bed does not come to rest in time.
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
        bodies(places, 0.5 * diameters, material.density),
        pair_table([material]),
        walls=sides[:1] if periodic else sides,
        laws=laws,
        gravity=(0.0, 0.0, -gravity),
        box=(width, depth, None) if periodic else (None, None, None),
    )
    spheres = run.bodies
    top = float(spheres.position[:, 2].max())
    fall = math.sqrt(2.0 * top / gravity)
    brought = float(np.sum(spheres.mass * gravity * spheres.position[:, 2]))
    step = run.clocks(gravity * fall).recommended
    while run.time < patience * fall:
        run.advance(step, max(1, int(0.05 * fall / step)))
        left = kinetic_energy(run.bodies) / brought
        if progress is not None:
            progress(run.time, left)
        if run.time > fall and left < AT_REST:
            return run
    raise RunFailed(
        f"the bed still holds {left:.2g} of its energy after {run.time:.3g} s (limit {AT_REST:g}); "
        "raise patience, or use a material with more friction or less restitution"
    )
