"""Dense suspensions whose films resist sliding and rolling: work of shear, dissipation by films, relative viscosity.

Spheres of 100 um without friction, whose contacts lose nothing: films must dissipate all the work. Nothing else
resists, so the viscosity is that of the films alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import kinetic_energy
from scenarios.validation.particles.suspensions import SUSPENDED, suspension

SMOOTH = SUSPENDED.model_copy(update={"friction": 0.0, "restitution": 1.0, "contact_modulus": 1e7})
"""The spheres of `suspension`, softer, without friction and damping."""

VISCOSITY, SPEED, STEP = 0.05, 0.2, 1.25e-7
"""Of the fluid [Pa s], of the upper plate [m/s], and time step [s]: a Stokes number of 0.1, and a step in which films
across the line of centres hardly change the motion."""


class Sheared(NamedTuple):
    """What was measured over a strain."""

    dissipated: float  # by films, over the work that is not stored [-]
    sliding: float  # part of it by sliding and rolling [-]
    stored: float  # in motion and contacts, over the work [-]
    viscosity: float  # over that of the fluid [-]
    solid_fraction: float  # between the plates [-]


def sheared(
    solid_fraction: float, motions: str = "full", press: float = 0.0, strain: float = 0.5, count: int = 400
) -> Sheared:
    """Shear a suspension between two layers of its own spheres, and measure over the second half of the strain.

    motions  that films resist
    press    if given, the upper layer is a free lid under this pressure and half as much traction; else held [Pa]
    """
    made, upper = suspension(count, solid_fraction, fixed=True, viscosity=VISCOSITY)
    spheres, (width, depth, _) = made.particles, made.box
    if press > 0.0:
        spheres.inverse_mass[upper] = 1.0 / spheres.mass[upper]
        spheres.inverse_inertia[upper] = 2.5 / (spheres.mass[upper] * spheres.radius[upper] ** 2)
        spheres.applied[upper] = np.array([0.5, 0.0, -1.0]) * press * width * depth / int(upper.sum())
    else:
        spheres.velocity[upper, 0] = SPEED
    laws = Laws(film=True, film_motions=motions)
    run = ParticleSolver(
        spheres, pair_table([SMOOTH]), laws=laws, box=(width, depth, None), energies=True, check_steps=False
    )
    lid = run.particles.id[upper]
    height = _height(run, lid)
    steps = round(0.5 * strain * height / SPEED / STEP)
    _work(run, lid, steps)
    before, start = dict(zip(run.energies.channels, run.energies.totals.copy())), _stored(run)  # type: ignore[union-attr]
    work, moved = _work(run, lid, steps)
    after = dict(zip(run.energies.channels, run.energies.totals))  # type: ignore[union-attr]
    lost = {name: after[name] - before[name] for name in after}
    sliding = lost.get("film_shear", 0.0)
    stored = _stored(run) - start
    height, rate = _height(run, lid), moved / (steps * STEP)
    volume = width * depth * height
    plates = np.isin(run.particles.id, lid) | (run.particles.inverse_mass == 0.0)
    inner = run.particles.volume.sum() - 0.5 * run.particles.volume[plates].sum()
    return Sheared(
        (lost["film"] + sliding) / (work - stored), sliding / work, stored / work,
        work / (steps * STEP) / (volume * (rate / height) ** 2 * VISCOSITY),
        float(inner / volume),
    )  # fmt: skip


def _height(run: ParticleSolver, lid: np.ndarray) -> float:
    """Distance of the mean heights of the two layers [m]."""
    upper = np.isin(run.particles.id, lid)
    lower = (run.particles.inverse_mass == 0.0) & ~upper
    return float(run.particles.position[upper, 2].mean() - run.particles.position[lower, 2].mean())


def _stored(run: ParticleSolver) -> float:
    """Kinetic energy of what moves freely, and energy of contacts [J]."""
    free = run.particles.copy(run.particles.inverse_mass > 0.0)
    assert run.energies is not None
    return kinetic_energy(free) + sum(run.energies.springs(run))


def _work(run: ParticleSolver, lid: np.ndarray, steps: int) -> tuple[float, float]:
    """Advance; returns the work of what moves the upper layer [J], and the way that it goes [m].

    The work on a layer that is held follows from the contact forces and impulses on it.
    """
    work = way = impulse = 0.0
    for _ in range(steps):
        force, lists = _force_on(run, lid), run.lists.made
        run.advance(STEP)
        upper = np.isin(run.particles.id, lid)
        moved = run.particles.work_displacement[upper]
        way += float(moved[:, 0].mean())
        if run.particles.inverse_mass[upper].any():
            work += float((run.particles.applied[upper] * moved).sum())
        else:
            # a new list of pairs has forgotten the last impulses, which hardly change in a step
            impulse = _impulse_on(run, lid) if run.lists.made == lists else impulse
            work -= SPEED * (0.5 * STEP * (force + _force_on(run, lid)) + impulse)
    return work, way


def _force_on(run: ParticleSolver, lid: np.ndarray) -> float:
    """Contact force on the upper layer along the shear [N]."""
    return float(run.particles.force[np.isin(run.particles.id, lid), 0].sum())


def _impulse_on(run: ParticleSolver, lid: np.ndarray) -> float:
    """Impulse of all films on the upper layer in the last step, along the shear [N s]."""
    upper, edges = np.isin(run.particles.id, lid), run.edges
    impulse = edges.impulse[:, 0] + edges.film_push[:, 0]
    impulse += edges.shear_impulse[:, 0] if "shear_impulse" in edges else 0.0
    sign = upper[edges.first].astype(float) - upper[edges.second]
    return float(sign @ impulse)
