"""Pour particles into a column and let them come to rest."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from cfddem.errors import InputError, RunFailed
from cfddem.materials import Material, pair_table
from cfddem.particles.packing import lattice
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Bodies, bodies
from cfddem.particles.walls import Plane

AT_REST = 1e-7
"""A bed is at rest when its kinetic energy is below this share of the energy it fell with."""

Progress = Callable[[float, float], None]


def pour(
    material: Material,
    diameters: np.ndarray,
    column: tuple[float, float],
    *,
    seed: int,
    periodic: bool = False,
    gravity: float = 9.81,
    patience: float = 20.0,
    progress: Progress | None = None,
) -> ParticleSolver:
    """Let spheres fall into a column with a flat floor at z = 0 until they lie still.

    material   of the spheres, the floor and the sides
    diameters  (N,) [m]
    column     width along x and depth along y; its corner is at the origin [m]
    seed       same seed, same bed
    periodic   repeat the column sideways instead of closing it by walls
    gravity    [m/s2]
    patience   give up after this many times the time of a fall from the top
    progress   called now and then with the time and the share of the kinetic energy that is left
    returns    the run at rest; its `bodies` are the bed

    Raises RunFailed where the bed does not come to rest in time.
    """
    spheres = _above_the_floor(material, np.asarray(diameters, float), column, seed)
    width, depth = column
    sides = [
        Plane(),
        Plane(normal=(1.0, 0.0, 0.0)),
        Plane(point=(width, 0.0, 0.0), normal=(-1.0, 0.0, 0.0)),
        Plane(normal=(0.0, 1.0, 0.0)),
        Plane(point=(0.0, depth, 0.0), normal=(0.0, -1.0, 0.0)),
    ]
    run = ParticleSolver(
        spheres,
        pair_table([material]),
        walls=sides[:1] if periodic else sides,
        gravity=(0.0, 0.0, -gravity),
        box=(width, depth, None) if periodic else (None, None, None),
    )
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


def kinetic_energy(spheres: Bodies) -> float:
    """Kinetic energy of all particles, spin included [J]."""
    mass = spheres.mass
    linear = np.sum(mass[:, None] * spheres.velocity**2)
    turning = np.sum(0.4 * mass[:, None] * spheres.radius[:, None] ** 2 * spheres.spin**2)
    return 0.5 * float(linear + turning)


def _above_the_floor(material: Material, diameters: np.ndarray, column: tuple[float, float], seed: int) -> Bodies:
    """A loose, shaken lattice high enough for all spheres, in random order."""
    largest = float(diameters.max())
    if min(column) < 1.05 * largest:
        raise InputError("column", min(column), f"wider than {1.05 * largest:.3g} m, a little more than a sphere")
    layer = math.prod(int(length / (1.05 * largest)) for length in column)
    layers = math.ceil(len(diameters) / layer)
    room = ((0.0, 0.0, 0.0), (*column, 1.05 * largest * layers))
    places = lattice(largest, room, seed=seed)[: len(diameters)]
    order = np.random.default_rng(seed).permutation(len(diameters))
    return bodies(places, 0.5 * diameters[order], material.density)
