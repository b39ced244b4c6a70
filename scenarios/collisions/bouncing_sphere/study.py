"""A steel sphere falls onto a wall in silicone oil and bounces: the measured trajectory at St = 27.

What you'll learn: how to set up a sphere and a wall in the particle engine from Python, with gravity.

Gondret, Lance & Petit, Phys. Fluids 14 (2002) 643. The sphere feels its weight less buoyancy, the film and
the wall. Drag, added mass and the history force of the fluid around it are absent.

>>> time, gap = bounce()
>>> round(float(gap[time > 0].max()) * 1e3, 1)         # apex [mm]; 2.0 was measured
2.3
"""

from __future__ import annotations

import numpy as np

from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures import contact, timescales

RADIUS, SPEED = 3e-3, 0.518
FLUID_DENSITY, DENSITY_RATIO, KINEMATIC_VISCOSITY = 965.0, 8.083, 1.036e-4
VISCOSITY = FLUID_DENSITY * KINEMATIC_VISCOSITY
STEEL = Material(
    density=DENSITY_RATIO * FLUID_DENSITY, youngs_modulus=190e9, poisson=0.27, restitution=0.97, friction=0.11,
    roughness=1e-4 * RADIUS,
)  # fmt: skip
GRAVITY = 9.81


def bounce(until: float = 0.045) -> tuple[np.ndarray, np.ndarray]:
    """Let the sphere arrive with its measured speed at the edge of the film, and follow it through the bounce.

    until    end of the record, counted from contact [s]
    returns  time since contact [s], gap between sphere and wall [m]
    """
    table = pair_table([STEEL])
    sphere = make_particles(
        [[0.0, 0.0, 1.999 * RADIUS]], RADIUS, STEEL.density, velocity=[0.0, 0.0, -SPEED], viscosity=VISCOSITY
    )
    weight = -GRAVITY * (1.0 - 1.0 / DENSITY_RATIO)
    run = ParticleSolver(sphere, table, walls=[Plane()], laws=Laws(film=True), gravity=(0.0, 0.0, weight), skin=RADIUS)
    stiffness = contact.hertz_stiffness(float(table[0, 0]["contact_modulus"]), RADIUS)
    step = 0.02 * timescales.hertz_time(float(sphere.mass[0]), stiffness, SPEED)
    time, gap = [0.0], [RADIUS - 0.001 * RADIUS]
    touch = np.inf
    while run.time < touch + until:
        run.advance(step, 20)
        time.append(run.time)
        gap.append(float(run.particles.position[0, 2]) - RADIUS)
        if gap[-1] < STEEL.roughness:
            touch = min(touch, run.time)
    return np.array(time) - touch, np.array(gap)


def speed_after_contact(time: np.ndarray, gap: np.ndarray, first: float, second: float) -> float:
    """Mean speed away from the wall between two times after contact, as read off a measured trajectory [m/s]."""
    return float(np.interp(second, time, gap) - np.interp(first, time, gap)) / (second - first)
