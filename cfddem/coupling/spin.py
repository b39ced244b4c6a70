r"""The torque that the fluid sets against the spin of a sphere relative to its own, half its vorticity.

.. math:: I\,\dot\omega = -\pi\eta d^3\,C(Re_r)\,(\omega - \tfrac12 w),\qquad
          Re_r = \frac{\rho d^2}{\eta}\,\bigl|\omega - \tfrac12 w\bigr|

A small sphere takes the spin of the fluid within a small part of a fluid step, so that the equation is solved
exactly over the step, with the factor C of its start. The fluid, averaged over cells, has no spin of its own to
lose: what the sphere gives is heat.
"""

from __future__ import annotations

import math

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.fluid.grid import Array
from cfddem.kernels import prange, threaded
from cfddem.particles.state import Bodies
from closures.lift import torque


def turn_with_fluid(bodies: Bodies, curl: Array, density: float, step: float) -> float:
    """Change the spin of all particles by the torque of the fluid over a step [s].

    bodies   with the viscosity of the fluid around each, positive
    curl     vorticity of the fluid around every particle (N, 3) [1/s]
    density  of the fluid [kg/m3]
    returns  kinetic energy that the particles have gained [J]
    """
    gained = np.empty(bodies.count)
    _turn(bodies.spin, curl, bodies.radius, bodies.viscosity, bodies.inverse_inertia, density, step, gained)
    return float(gained.sum())


@threaded
def _turn(spin, curl, radius, viscosity, inverse_inertia, density, step, gained):
    """Relax the spin of every particle towards that of the fluid."""
    for n in prange(len(radius)):
        diameter, square = 2.0 * radius[n], 0.0
        for d in range(3):
            square += (spin[n, d] - 0.5 * curl[n, d]) ** 2
        factor = torque(density * diameter * diameter * math.sqrt(square) / viscosity[n])
        kept = math.exp(-step * math.pi * viscosity[n] * diameter**3 * factor * inverse_inertia[n])
        work = 0.0
        for d in range(3):
            end = 0.5 * curl[n, d] + kept * (spin[n, d] - 0.5 * curl[n, d])
            work += 0.5 * (end * end - spin[n, d] * spin[n, d])
            spin[n, d] = end
        gained[n] = work / inverse_inertia[n] if inverse_inertia[n] > 0.0 else 0.0
