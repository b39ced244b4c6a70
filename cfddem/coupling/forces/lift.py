"""Lift on a sphere in shear (Saffman-Mei) and on a spinning sphere (Magnus)."""

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
from cfddem.particles.vectors import cross, dot, minus, of_row, times
from closures.lift import magnus, saffman_mei


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
