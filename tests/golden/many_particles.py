"""Golden runs of many particles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cfddem.case.materials import Material
from cfddem.particles.initial.packing import random_packing
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.walls.shapes import Box, Plane
from golden.building import particles, stirred_dense_bed
from golden.registry import State, golden
from golden.states import collisions, counted, liquid, particle_state
from golden.two_particles import BEAD, RADIUS, STEEL, against_wall, bounced, pair


def swarm(
    count: int = 150, materials: Sequence[Material] = (BEAD,), solid: float = 0.5, speed: float = 0.3, **options: Any
) -> ParticleSolver:
    """Unequal spheres close together that move and spin in all directions; in a periodic box if none is given."""
    draw = np.random.default_rng(1)
    size = RADIUS * draw.uniform(0.7, 1.3, count)
    places, box = random_packing(2.0 * size, solid, 1)
    given = {"box": tuple(box)} if "walls" not in options else {}
    velocity, spin = draw.normal(0.0, speed, (count, 3)), draw.normal(0.0, 100.0, (count, 3))
    of = np.arange(count) % len(materials)
    return particles(places, size, materials, of=of, velocity=velocity, spin=spin, **given | options)


def after(run: ParticleSolver, steps: int = 20, step: float = 1e-6) -> State:
    """The state after a few steps."""
    run.advance(step, steps)
    return particle_state(run)


@golden
def periodic_box() -> State:
    return after(swarm(materials=(BEAD, STEEL)), 100)


@golden
def periodic_box_film() -> State:
    return after(swarm(materials=(BEAD, STEEL), film=1e-3), 40)


@golden
def periodic_box_film_verlet() -> State:
    return after(swarm(film=1e-3, laws={"integrator": "verlet"}), 40)


@golden
def dense_bed_dry() -> State:
    return after(stirred_dense_bed(False), step=1e-5)


@golden
def dense_bed_film() -> State:
    return after(stirred_dense_bed(True), step=1e-5)


@golden
def rolling_constant_torque() -> State:
    return after(swarm(laws={"rolling": "constant_torque"}), 40)


@golden
def rolling_spring_dashpot() -> State:
    return after(swarm(laws={"rolling": "spring_dashpot", "rolling_damping": 0.4}), 40)


@golden
def rolling_on_a_floor() -> State:
    run = against_wall(laws={"rolling": "spring_dashpot"}, gravity=(0.0, 0.0, -9.81))
    return bounced(run)


@golden
def cohesion() -> State:
    """Fine dust that sticks to itself and to a floor."""
    dust = Material(density=2500, youngs_modulus=1e8, poisson=0.3, restitution=0.7, friction=0.3, surface_energy=0.02)
    size, draw = 50e-6, np.random.default_rng(2)
    places = (np.indices((3, 3, 3)).reshape(3, -1).T + 0.501) * 2.0 * size
    places = places + draw.uniform(-0.01, 0.01, places.shape) * size
    run = particles(
        places, size, [dust], velocity=draw.normal(0.0, 0.05, places.shape), walls=[Plane()],
        laws={"contact": "jkr"}, check_steps=False,
    )  # fmt: skip
    return after(run, 60, 1e-7)


def wet(laws: BridgeLaws, steps: int = 20) -> State:
    """Spheres with liquid on them."""
    run = swarm(solid=0.45, liquid=(25e-6, laws))
    return after(run, steps, 1e-6) | liquid(run)


@golden
def bridges_pendular() -> State:
    return wet(BridgeLaws(viscosity=0.1, surface_tension=0.07, contact_angle=0.26))


@golden
def bridges_deforming() -> State:
    laws = BridgeLaws(
        viscosity=5.0, surface_tension=0.07, contact_angle=0.26, film="deforming", tangential="davis", minimum_gap=1e-6
    )
    return wet(laws)


@golden
def bridges_static() -> State:
    laws = BridgeLaws(
        viscosity=0.5, surface_tension=0.07, film="static", cut="constant", tangential="nase", pull="constant",
        rupture="film", minimum_gap=1e-6,
    )  # fmt: skip
    return wet(laws)


@golden
def energies() -> State:
    floor = Box(low=(-1.0, -1.0, -0.66e-3), high=(1.0, 1.0, 1.0), velocity=(0.3, 0.0, 1.0))
    run = swarm(film=1e-3, walls=[floor], energies=True)
    return after(run, 40) | counted(run)


@golden
def energies_dry_rolling() -> State:
    run = swarm(gravity=(0.0, 0.0, -9.81), laws={"rolling": "constant_torque"}, energies=True)
    return after(run, 40) | counted(run)


@golden
def collision_record() -> State:
    run = swarm(60, speed=1.0, solid=0.3, record=True)
    return after(run, 400) | collisions(run)


@golden
def collision_record_film() -> State:
    """The collision of two, from reach to reach, with the energy that it took."""
    run = pair(0.9 * RADIUS, 1.0, 0.2, film=1e-3, record=True, energies=True)
    return bounced(run, 1e-6, 1500) | collisions(run) | counted(run)


@golden
def held_along_an_axis() -> State:
    """Some spheres that nothing moves, and positions that change in a plane only."""
    fixed = np.arange(150) % 10 == 0
    return after(swarm(film=1e-3, free=(1.0, 1.0, 0.0), fixed=fixed))
