r"""Added-mass force, :math:`C\rho V(Du/Dt - dv/dt)`.

The part :math:`-C\rho V\,dv/dt` is moved to the left side of the equation of motion: `inverse_mass` is
:math:`1/(m + C\rho V)`. What remains is :math:`C\rho V\,Du/Dt`, with the acceleration of the fluid that passes the
particle,

.. math:: \frac{Du}{Dt} = \frac{du}{dt} + ((u-v)\cdot\nabla)u

where du/dt is the change of the sampled velocity at the particle over the last step (Auton, Hunt & Prud'homme, J. Fluid
Mech. 197 (1988) 241).

C is a number, or a law of the voidage around the particle. A law is evaluated in every fluid step and C is constant
within it: a change of C changes the inertia of a particle and not its velocity.
"""

from __future__ import annotations

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import prange, threaded
from cfddem.backend.law_set import Slot, adapted, specialise
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.data.fields import Field
from cfddem.fluid.grid import Array
from cfddem.particles.state import Particles, added_mass
from closures.registry import Law

SAMPLED = Field(
    "sampled_velocity", "m/s", 3, "memory", np.nan, meaning="fluid velocity at the particle in the last fluid step"
)
"""NaN in inserted particles: the acceleration of the fluid is not known there."""

coefficient = Slot("coefficient")


class AddedMass:
    """Added mass of the particles and its force.

    given    C, or a law C(voidage); 0 for none
    density  rho of the fluid [kg/m3]
    """

    def __init__(self, given: float | Law, density: float) -> None:
        self.law = given if isinstance(given, Law) else None
        self.constant, self.density = 0.0 if isinstance(given, Law) else float(given), density
        self.fields = (SAMPLED,) if self else ()
        self._loop = None
        if self.law is not None:
            law = adapted(self.law.function, "voidage", {"voidage": "voidage"})
            self._loop = specialise(_coefficients, {"coefficient": law})

    def __bool__(self) -> bool:
        """Whether particles have an added mass."""
        return self.law is not None or self.constant > 0.0

    def coefficient(self, voidage: Array) -> Array:
        """C of particles at these voidages (N,) [-]."""
        values = np.full(len(voidage), self.constant)
        if self._loop is not None:
            self._loop(voidage, values)
        return values

    def update(self, particles: Particles, voidage: Array) -> Array:
        """Set the inertia of the coming step: of all particles for a law, of inserted ones for a constant C.

        voidage  around every particle (N,) [-]
        returns  change of the added mass of every particle (N,) [kg]
        """
        change = np.zeros(particles.count)
        if not self:
            return change
        rows = particles.inverse_mass > 0.0
        if self.law is None:
            rows &= np.isnan(particles.sampled_velocity[:, 0])
        if rows.any():  # local: every rank sets the inertia of its own particles
            before = particles.inverse_mass[rows]
            ratio = self.coefficient(voidage[rows]) * self.density / particles.density[rows]
            after = 1.0 / particles.mass[rows] / (1.0 + ratio)
            particles.inverse_mass[rows] = after
            particles.film_rate[rows] *= after / before  # a resistance over the inertia
            change[rows] = 1.0 / after - 1.0 / before
        return change

    def force(self, particles: Particles, flow: SampledFlow, passing: Array, last_step: float) -> Array:
        r"""C rho V Du/Dt on every particle (N, 3) [N].

        passing    :math:`((u-v)\cdot\nabla)u` at every particle (N, 3) [m/s2]
        last_step  over which the change of u at the particle is taken [s]
        """
        before = particles.sampled_velocity
        acceleration = (flow.slip + particles.velocity - before) / last_step + passing
        force: Array = self.mass(particles)[:, None] * np.where(np.isnan(before), 0.0, acceleration)
        return force

    def deferred_momentum(self, particles: Particles) -> Array:
        r""":math:`C\rho V\,\Delta v` over the last fluid step (N, 3) [N s]; the fluid loses or gains it one step late.

        C is still that of the step in which the particles have moved.
        """
        moved: Array = self.mass(particles)[:, None] * (particles.velocity - particles.velocity_before)
        return moved

    def store(self, particles: Particles, slip: Array) -> None:
        """Store the sampled velocity of this step for the next."""
        if self:
            particles.sampled_velocity = slip + particles.velocity

    mass = staticmethod(added_mass)


@threaded
def _coefficients(voidage, values):
    """Coefficient of every particle by the law."""
    for n in prange(len(voidage)):
        values[n] = coefficient(voidage[n])
