r"""Torque of the fluid against the spin of a sphere relative to the fluid, whose spin is half its vorticity.

.. math:: I\,\dot\omega = -\pi\eta d^3\,C(Re_r)\,(\omega - \tfrac12 w),\qquad
          Re_r = \frac{\rho d^2}{\eta}\,\bigl|\omega - \tfrac12 w\bigr|

A small sphere takes the spin of the fluid within a small part of a fluid step. The equation is therefore solved
exactly over the step, with the factor C at its start. The averaged fluid has no spin that it could gain: the energy
that the sphere loses is dissipated.
"""

from __future__ import annotations

import math

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import prange, threaded
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.terms import CouplingTerms
from cfddem.coupling.velocity_gradient import vorticity_at
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.model.feature import FluidForce
from cfddem.particles.state import Particles
from closures.lift import torque


class Torque(FluidForce):
    """Torque of a viscous fluid on every particle.

    fluid   the fluid solver
    kernel  gathers its vorticity
    """

    name = "torque"

    def __init__(self, fluid: FluidSolver, kernel: FilterKernel) -> None:
        self.fluid, self.kernel = fluid, kernel

    def end(self, terms: CouplingTerms) -> None:
        """Turn the particles over the step."""
        if self.fluid.viscous:
            curl = vorticity_at(self.fluid, self.kernel, terms.cell_map)
            gained = turn_with_fluid(terms.particles, curl, self.fluid.density, terms.step)
            terms.spin_work = self.fluid.communicator.sum(gained)


def turn_with_fluid(particles: Particles, curl: Array, density: float, step: float) -> Array:
    """Change the spin of all particles by the torque of the fluid over a step [s].

    particles  with the viscosity of the fluid around each, positive
    curl       vorticity of the fluid around every particle (N, 3) [1/s]
    density    of the fluid [kg/m3]
    returns    kinetic energy that each particle has gained (N,) [J]
    """
    gained = np.empty(particles.count)
    _turn(particles.spin, curl, particles.radius, particles.viscosity, particles.inverse_inertia, density, step, gained)
    return gained


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
