r"""Lift on a sphere in shear (Saffman-Mei) and on a spinning sphere (Magnus), and the torque that slows its spin.

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
from cfddem.coupling.sampled_flow import vorticity_at
from cfddem.coupling.terms import CouplingTerms
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.model.feature import FluidForce
from cfddem.particles.state import Particles
from cfddem.particles.vectors import cross, dot, minus, of_row, times
from closures.lift import magnus, saffman_mei, torque


class Lift(FluidForce):
    """Lift on every particle in a viscous fluid.

    fluid   the fluid solver
    kernel  gathers its vorticity
    """

    name, lines = "lift", ("explicit",)

    def __init__(self, fluid: FluidSolver, kernel: FilterKernel) -> None:
        self.fluid, self.kernel = fluid, kernel

    def act(self, terms: CouplingTerms) -> None:
        """Lift at the present slip, spin and vorticity."""
        if self.fluid.viscous:
            spheres, curl = terms.particles, vorticity_at(self.fluid, self.kernel, terms.cell_map)
            force = lift_force(
                terms.flow.slip, curl, spheres.spin, spheres.radius, self.fluid.density, spheres.viscosity
            )
            terms.between("explicit", force)


def lift_force(slip: Array, curl: Array, spin: Array, radius: Array, density: float, viscosity: Array) -> Array:
    """Lift of shear and of spin on every particle (N, 3) [N].

    slip       u - v (N, 3) [m/s]
    curl       vorticity of the fluid around the particle (N, 3) [1/s]
    spin       of the particle (N, 3) [rad/s]
    viscosity  of the fluid around the particle (N,), positive [Pa s]
    """
    force = np.empty_like(slip)
    _lift(slip, curl, spin, radius, density, viscosity, force)
    return force


@threaded
def _lift(slip, curl, spin, radius, density, viscosity, force):
    """Saffman-Mei along slip x curl; Magnus along slip x (spin - curl/2)."""
    for n in prange(len(radius)):
        u, w = of_row(slip, n), of_row(curl, n)
        diameter, kinematic = 2.0 * radius[n], viscosity[n] / density
        speed, turning = math.sqrt(dot(u, u)), math.sqrt(dot(w, w))
        reynolds = diameter * speed / kinematic
        across = cross(u, w)
        size = math.sqrt(dot(across, across))
        stokes = 3.0 * math.pi * viscosity[n] * diameter * speed
        shear = stokes * saffman_mei(reynolds, diameter * diameter * turning / kinematic) / max(size, 1e-300)
        relative = minus(of_row(spin, n), times(0.5, w))
        twist = cross(u, relative)
        rolled = math.pi / 8.0 * density * diameter**3 * magnus(reynolds)
        for d in range(3):
            force[n, d] = (shear * across[d] if size > 0.0 else 0.0) + rolled * twist[d]


# ---------------------------------------------------------------- torque


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
