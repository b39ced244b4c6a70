"""Dense suspensions whose films overlap: sheared between plates, pressed by a lid, and with films alone."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cfddem.case.materials import Material
from cfddem.particles.initial.packing import random_packing
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import kinetic_energy, make_particles


class Crowd(NamedTuple):
    """Result of a run of a dense suspension."""

    smallest_gap: float  # over the minimum gap [-]
    energy: np.ndarray  # kinetic energy after each step or sample [J]
    momentum: float  # change over the sum of m |v| [-]
    speed: float  # largest speed over that of the shear [-]
    steps: int


SUSPENDED = Material(
    density=2500, youngs_modulus=50e9, contact_modulus=1e9, poisson=0.25, restitution=0.8, friction=0.3, roughness=1e-7
)
"""Spheres of 100 um in a fluid of 1 Pa s."""
HELD_APART = float(pair_table([SUSPENDED])[0, 0]["roughness_gap"])
"""Their minimum gap where asperities set it [m]."""


def suspension(
    count: int, solid_fraction: float, fixed: bool, viscosity: float = 1.0
) -> tuple[ParticleSolver, np.ndarray]:
    """Random spheres of 100 um in a periodic box, none touching.

    fixed   hold two layers, bottom and top, as plates; the box is open between them
    returns the run, and which particles belong to the upper plate
    """
    diameter = 1e-4
    grown = diameter * 1.0015
    places, box = random_packing(np.full(count, grown), solid_fraction * 1.0015**3, 5, (1.0, 1.0, 1.0))
    height = places[:, 2]
    lower, upper = height < 0.9 * diameter, height > box[2] - 0.9 * diameter
    spheres = make_particles(
        places, 0.5 * diameter, SUSPENDED.density, viscosity=viscosity, fixed=(lower | upper) if fixed else False
    )
    run = ParticleSolver(
        spheres,
        pair_table([SUSPENDED]),
        laws=Laws(film=True),
        box=(box[0], box[1], None if fixed else box[2]),
    )
    return run, upper[run.particles.id]


def shear(solid_fraction: float, steps: int, speed: float = 0.02, press: float = 0.0, count: int = 1000) -> Crowd:
    """Shear a dense suspension between layers of its own spheres at the Hertz step.

    speed  of the upper layer, which is held [m/s]
    press  if given, the upper layer is a free lid under this pressure and half as much traction [Pa]
    """
    run, upper = suspension(count, solid_fraction, fixed=True)
    if press > 0.0:
        made = run.particles
        made.inverse_mass[upper] = 1.0 / made.mass[upper]
        made.inverse_inertia[upper] = 2.5 / (made.mass[upper] * made.radius[upper] ** 2)
        area = float(run.box[0] * run.box[1])
        made.applied[upper] = np.array([0.5, 0.0, -1.0]) * press * area / int(upper.sum())
    else:
        run.particles.velocity[upper, 0] = speed
    run.refresh()
    step = run.time_scales(speed).recommended
    energy, smallest, fastest = [], math.inf, 0.0
    for _ in range(50):
        run.advance(step, max(1, steps // 50))
        pairs = run.edges.between_particles
        smallest = min(smallest, float(run.gap[:pairs].min()) / HELD_APART)
        fastest = max(fastest, float(np.linalg.norm(run.particles.velocity, axis=1).max()) / speed)
        energy.append(kinetic_energy(run.particles))
    return Crowd(smallest, np.array(energy), 0.0, fastest, run.steps)


def films_alone(solid_fraction: float, steps: int, step: float, viscosity: float = 1.0, count: int = 1000) -> Crowd:
    """Spheres with random velocities and without contacts: only films act.

    step  [s]
    """
    run, _ = suspension(count, solid_fraction, fixed=False, viscosity=viscosity)
    run.table["contact_modulus"] = 0.0
    run.table["shear_modulus"] = 0.0
    run.particles.velocity[:] = np.random.default_rng(1).normal(0.0, 0.02, run.particles.velocity.shape)
    run.refresh()
    mass = run.particles.mass[:, None]
    carried, size = (mass * run.particles.velocity).sum(axis=0), float((mass * np.abs(run.particles.velocity)).sum())
    energy, smallest = [kinetic_energy(run.particles)], math.inf
    for _ in range(steps):
        run.advance(step)
        energy.append(kinetic_energy(run.particles))
        smallest = min(smallest, float(run.gap.min()) / HELD_APART)
    drift = np.abs((mass * run.particles.velocity).sum(axis=0) - carried).max() / size
    return Crowd(smallest, np.array(energy), float(drift), math.nan, run.steps)
