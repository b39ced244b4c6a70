"""Golden runs of two particles, and of one and a wall."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cfddem.case.materials import Material
from cfddem.particles.interactions.contacts.linear import LINEAR
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.walls.shapes import Plane
from cfddem.particles.walls.wall import Wall
from golden.building import own_law, particles
from golden.registry import State, golden
from golden.states import particle_state

RADIUS = 0.5e-3
BEAD = Material(
    density=2500, youngs_modulus=60e9, contact_modulus=1e8, poisson=0.25, restitution=0.9, friction=0.3,
    friction_lubricated=0.1, rolling_friction=0.05, roughness=1e-6,
)  # fmt: skip
STEEL = Material(density=7800, youngs_modulus=210e9, contact_modulus=5e8, poisson=0.3, restitution=0.8, friction=0.2)


def pair(gap: float, speed: float, slide: float = 0.0, **options: Any) -> ParticleSolver:
    """Two unequal beads that approach each other along x, not far from touching."""
    return particles(
        [[0.0, 0.0, 0.0], [2.2 * RADIUS + gap, 0.0, 0.0]],
        [RADIUS, 1.2 * RADIUS],
        [BEAD],
        velocity=[[speed, slide, 0.0], [-speed, 0.0, 0.5 * slide]],
        spin=[[0.0, 3.0 * slide / RADIUS, 50.0], [10.0, 0.0, -slide / RADIUS]],
        check_steps=False,
        **options,
    )


def bounced(run: ParticleSolver, step: float = 2e-7, steps: int = 100) -> State:
    """The state after a number of steps."""
    run.advance(step, steps)
    return particle_state(run)


@golden
def collision_dry() -> State:
    return bounced(pair(1.03e-6, 0.1))


@golden
def collision_head_on_film() -> State:
    return bounced(pair(1e-5, 0.1, film=1e-3))


@golden
def collision_thick_film() -> State:
    return bounced(pair(2e-5, 0.1, film=0.05), steps=400)


@golden
def collision_oblique() -> State:
    return bounced(pair(1.03e-6, 0.1, 0.05))


@golden
def collision_oblique_film() -> State:
    return bounced(pair(3e-6, 0.1, 0.2, film=1e-3))


@golden
def collision_film_overlap_onset() -> State:
    return bounced(pair(3e-6, 0.1, 0.2, film=1e-3, laws={"friction_onset": "overlap"}))


@golden
def collision_film_verlet() -> State:
    return bounced(pair(1e-5, 0.1, 0.2, film=1e-3, laws={"integrator": "verlet"}))


@golden
def collision_film_short_reach() -> State:
    return bounced(pair(1e-5, 0.1, 0.2, film=1e-3, laws={"cutoff_ratio": 0.01}))


@golden
def collision_rescaled_spring() -> State:
    return bounced(pair(1.03e-6, 0.1, 0.05, laws={"spring": "rescaled"}))


@golden
def collision_two_materials() -> State:
    run = particles(
        [[0.0, 0.0, 0.0], [2.0 * RADIUS + 1.03e-6, 0.0, 0.0]], RADIUS, [BEAD, STEEL], of=[0, 1],
        velocity=[[0.1, 0.05, 0.0], [-0.1, 0.0, 0.0]], film=1e-3, check_steps=False,
    )  # fmt: skip
    return bounced(run)


def against_wall(film: float = 0.0, wall: Wall | None = None, **options: Any) -> ParticleSolver:
    """A bead that meets a floor of steel askew."""
    return particles(
        [[0.0, 0.0, RADIUS + 2e-6]], RADIUS, [BEAD, STEEL], velocity=[[0.05, 0.02, -0.1]], spin=[[0.0, 30.0, 20.0]],
        film=film, walls=[wall or Plane(material=1)], check_steps=False, **options,
    )  # fmt: skip


@golden
def collision_wall() -> State:
    return bounced(against_wall())


@golden
def collision_wall_film() -> State:
    return bounced(against_wall(1e-3))


@golden
def collision_wall_film_verlet() -> State:
    return bounced(against_wall(1e-3, laws={"integrator": "verlet"}))


@golden
def collision_sliding_wall() -> State:
    return bounced(against_wall(1e-3, Plane(material=1, velocity=(0.1, 0.0, 0.05))))


@golden
def linear_contact() -> State:
    laws = {"contact": LINEAR.with_parameters(normal_stiffness=1e5, tangential_stiffness=3e4)}
    return bounced(pair(1.03e-6, 0.1, 0.05, laws=laws))


@golden
def linear_contact_film() -> State:
    laws = {"contact": LINEAR.with_parameters(normal_stiffness=1e5, tangential_stiffness=3e4)}
    return bounced(pair(1.03e-6, 0.1, 0.05, film=1e-3, laws=laws))


@golden
def own_minimum_gap_and_film() -> State:
    """User-defined laws in place of the built-in ones."""

    def golden_gap(approach_speed: float, reduced_radius: float) -> float:
        return 1e-3 * reduced_radius * (1.0 + 10.0 * approach_speed)

    def golden_film(gap: float, viscosity: float, reduced_radius: float) -> float:
        return 4.0 * math.pi * viscosity * reduced_radius**2 / (gap + 1e-7)

    laws = {"minimum_gap": own_law("minimum_gap", golden_gap), "lubrication": own_law("lubrication", golden_film)}
    run = pair(1e-5, 0.1, 0.2, film=1e-3, laws=laws)
    return bounced(run) | {"outside": np.array([run.outside])}
