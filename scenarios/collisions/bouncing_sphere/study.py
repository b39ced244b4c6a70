"""A steel sphere falls onto a wall in silicone oil and bounces: the measured trajectory at St = 27.

What you'll learn: how to set up a sphere and a wall in the particle engine from Python, in a fluid at rest.

Gondret, Lance & Petit, Phys. Fluids 14 (2002) 643. The sphere feels its weight less buoyancy, the film and the wall,
and the fluid around it: drag, added mass and history force. Each can be left out.

>>> time, gap = bounce(surroundings=())                # film, wall and weight alone
>>> round(float(gap[time > 0].max()) * 1e3, 1)         # apex [mm]; 2.0 was measured
2.3
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cfddem.case.materials import Material
from cfddem.coupling.still_fluid import StillFluid
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures import contact, timescales
from closures.drag_single import schiller_naumann
from closures.registry import law_of

RADIUS, SPEED = 3e-3, 0.518
FLUID_DENSITY, DENSITY_RATIO, KINEMATIC_VISCOSITY = 965.0, 8.083, 1.036e-4
VISCOSITY = FLUID_DENSITY * KINEMATIC_VISCOSITY
STEEL = Material(
    density=DENSITY_RATIO * FLUID_DENSITY, youngs_modulus=190e9, poisson=0.27, restitution=0.97, friction=0.11,
    roughness=1e-4 * RADIUS,
)  # fmt: skip
GRAVITY = 9.81


ALL = ("drag", "added_mass", "history")
"""Forces of the fluid around the sphere."""


def bounce(until: float = 0.045, surroundings: Sequence[str] = ALL) -> tuple[np.ndarray, np.ndarray]:
    """Let the sphere arrive with its measured speed at the edge of the film, and follow it through the bounce.

    until         end of the record, counted from contact [s]
    surroundings  those of the forces `ALL` that act
    returns       time since contact [s], gap between sphere and wall [m]
    """
    table, wall = pair_table([STEEL]), Plane()
    sphere = make_particles([[0.0, 0.0, 1.999 * RADIUS]], RADIUS, STEEL.density, velocity=[0.0, 0.0, -SPEED])
    run = ParticleSolver(sphere, table, walls=[wall], laws=Laws(film=True), skin=RADIUS)
    fluid = StillFluid(
        run,
        FLUID_DENSITY,
        VISCOSITY,
        law_of(schiller_naumann) if "drag" in surroundings else None,
        added_mass="added_mass" in surroundings,
        history="mei_adrian" if "history" in surroundings else "none",
        wall=wall,
        gravity=(0.0, 0.0, -GRAVITY),
    )
    stiffness = contact.hertz_stiffness(float(table[0, 0]["contact_modulus"]), RADIUS)
    step = 0.02 * timescales.hertz_time(float(sphere.mass[0]), stiffness, SPEED)
    time, gap = [0.0], [RADIUS - 0.001 * RADIUS]
    touch = np.inf
    while run.time < touch + until:
        fluid.advance(step, 20)
        time.append(run.time)
        gap.append(float(run.particles.position[0, 2]) - RADIUS)
        if gap[-1] < STEEL.roughness:
            touch = min(touch, run.time)
    return np.array(time) - touch, np.array(gap)


def speed_after_contact(time: np.ndarray, gap: np.ndarray, first: float, second: float) -> float:
    """Mean speed away from the wall between two times after contact, as read off a measured trajectory [m/s]."""
    return float(np.interp(second, time, gap) - np.interp(first, time, gap)) / (second - first)
