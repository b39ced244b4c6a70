r"""Added-mass force, :math:`C\rho V(Du/Dt - dv/dt)`.

The part :math:`-C\rho V\,dv/dt` is moved to the left side of the equation of motion: `inverse_mass` is
:math:`1/(m + C\rho V)`. What remains is :math:`C\rho V\,Du/Dt`, with the acceleration of the fluid that passes the
particle,

.. math:: \frac{Du}{Dt} = \frac{du}{dt} + ((u-v)\cdot\nabla)u

where du/dt is the change of the sampled velocity at the particle over the last step (Auton, Hunt & Prud'homme, J. Fluid
Mech. 197 (1988) 241).

C is a number, or a law of the voidage around the particle. A law is evaluated in every fluid step and C is constant
within it: a change of C changes the inertia of a particle and not its velocity.

**Smoothing.** The fluid and the particles learn of each other's acceleration one step late. Where the added mass
exceeds the mass of the fluid around, each overcorrects the motion of the other, and an oscillation grows that changes
its sign in every step. Where particles and fluid move as a whole, its factor per step is -Q with

.. math:: Q = \frac12\left(\gamma + \sqrt{\gamma^2 + 4\gamma\kappa}\right),\qquad
          \gamma = \frac{\phi}{\varepsilon}\,C,\quad \kappa = \frac{C\rho}{\rho_p + C\rho}

so that with Zuber's C it would grow above :math:`\phi` = 0.36 for glass in water. Both accelerations are therefore
running means, with the weight :math:`\min(1, \tfrac32/(1+Q))` for the newest: the factor is at least -1/2. The mean is
that of the newest value alone in less dense suspensions: C = 1/2 and glass in water below :math:`\phi` = 0.43. What the
fluid has not received yet is kept, so that no momentum is lost.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import prange, threaded
from cfddem.backend.law_set import Slot, bind_arguments, specialise
from cfddem.coupling.kernel import ParticleCellMap
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.coupling.terms import CouplingTerms
from cfddem.fluid.grid import Array
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.state import Particles, added_mass
from closures.registry import Law

SAMPLED = Field(
    "sampled_velocity", "m/s", 3, "memory", np.nan, meaning="fluid velocity at the particle in the last fluid step"
)
"""NaN in inserted particles: the acceleration of the fluid is not known there."""

ACCELERATION = Field("fluid_acceleration", "m/s2", 3, "memory", meaning="Du/Dt at the particle, smoothed")

OWED = Field("added_momentum", "N s", 3, "memory", meaning="lost to the added mass, and not received by the fluid yet")

DAMPED = 1.5
"""Sum of 1 and the share of an oscillation between particles and fluid that may be left after a step; below 2."""

coefficient = Slot("coefficient")


class AddedMass(FluidForce):
    """Added mass of the particles and its force.

    coefficient  C, or a law C(voidage)
    density      rho of the fluid [kg/m3]
    passing      places among the cells, and slip -> the change of the fluid velocity along the slip; none if not given
    """

    name, lines, sets_inertia = "added_mass", ("explicit",), True
    fields = (SAMPLED, ACCELERATION, OWED)

    def __init__(
        self,
        coefficient: float | Law,
        density: float,
        passing: Callable[[ParticleCellMap, Array], Array] = lambda _, slip: np.zeros_like(slip),
    ) -> None:
        self.density, self._passing = density, passing
        self._varies = isinstance(coefficient, Law)
        self._deferred = np.zeros((0, 3))
        if isinstance(coefficient, Law):
            law = bind_arguments(coefficient.function, "voidage", {"voidage": "voidage"})
            self._fill = specialise(_coefficients, {"coefficient": law})
        else:
            self._fill = lambda voidage, values: values.fill(float(coefficient))

    def begin(self, terms: CouplingTerms) -> None:
        """Set the inertia of the step; what the particles owe the fluid is taken with that of the last step."""
        first = terms.last_step == 0.0
        self._deferred = np.zeros((terms.particles.count, 3)) if first else self.deferred_momentum(terms.particles)
        terms.added = self.update(terms.particles, terms.flow.voidage)

    def act(self, terms: CouplingTerms) -> None:
        """The fluid's acceleration pushes the particles; on the fluid acts its opposite, and, a step late, what the
        particles have lost to their added mass."""
        particles, flow = terms.particles, terms.flow
        if terms.last_step == 0.0:
            terms.between("explicit", np.zeros((particles.count, 3)))
            return
        weight = self.newest_weight(particles, flow.voidage)
        force = self.force(particles, flow, self._passing(terms.cell_map, flow.slip), weight, terms.last_step)
        terms.push("explicit", force)
        terms.pull("explicit", self.hand_over(particles, self._deferred, weight) / terms.step - force)

    def end(self, terms: CouplingTerms) -> None:
        """Store the sampled velocity for the next step."""
        terms.particles.sampled_velocity = terms.flow.slip + terms.particles.velocity

    def coefficient(self, voidage: Array) -> Array:
        """C of particles at these voidages (N,) [-]."""
        values = np.empty(len(voidage))
        self._fill(voidage, values)
        return values

    def update(self, particles: Particles, voidage: Array) -> Array:
        """Set the inertia of the coming step: of all particles for a law, of inserted ones for a constant C.

        voidage  around every particle (N,) [-]
        returns  change of the added mass of every particle (N,) [kg]
        """
        change = np.zeros(particles.count)
        rows = particles.inverse_mass > 0.0
        if not self._varies:
            rows &= np.isnan(particles.sampled_velocity[:, 0])
        if rows.any():  # local: every rank sets the inertia of its own particles
            before = particles.inverse_mass[rows]
            ratio = self.coefficient(voidage[rows]) * self.density / particles.density[rows]
            after = 1.0 / particles.mass[rows] / (1.0 + ratio)
            particles.inverse_mass[rows] = after
            change[rows] = 1.0 / after - 1.0 / before
        return change

    def newest_weight(self, particles: Particles, voidage: Array) -> Array:
        """Weight of the newest acceleration of particles and fluid in their running means (N,) [-].

        voidage  around every particle (N,) [-]
        """
        added = self.mass(particles)
        around = added * (1.0 - voidage) / (voidage * self.density * particles.volume)  # over the mass of fluid there
        growth = 0.5 * (around + np.sqrt(around * (around + 4.0 * added / (particles.mass + added))))
        weight: Array = np.minimum(1.0, DAMPED / (1.0 + growth))
        return weight

    def force(self, particles: Particles, flow: SampledFlow, passing: Array, weight: Array, last_step: float) -> Array:
        r"""C rho V Du/Dt on every particle (N, 3) [N].

        passing    :math:`((u-v)\cdot\nabla)u` at every particle (N, 3) [m/s2]
        weight     of `newest_weight` (N,) [-]
        last_step  over which the change of u at the particle is taken [s]
        """
        before, mean = particles.sampled_velocity, particles.fluid_acceleration
        newest = (flow.slip + particles.velocity - before) / last_step + passing
        mean[:] = np.where(np.isnan(before), 0.0, weight[:, None] * newest + (1.0 - weight[:, None]) * mean)
        force: Array = self.mass(particles)[:, None] * mean
        return force

    def deferred_momentum(self, particles: Particles) -> Array:
        r"""Momentum that particles have lost to their added mass, and the fluid has not received yet (N, 3) [N s].

        :math:`C\rho V\,\Delta v` of the last fluid step, with C still that of this step, and what earlier steps left.
        """
        moved = self.mass(particles)[:, None] * (particles.velocity - particles.velocity_before)
        owed: Array = moved + particles.added_momentum
        return owed

    def hand_over(self, particles: Particles, deferred: Array, weight: Array) -> Array:
        """Part of the deferred momentum that the fluid receives in the coming step (N, 3) [N s]; the rest is stored.

        deferred  of `deferred_momentum`, before C has changed (N, 3) [N s]
        weight    of `newest_weight` (N,) [-]
        """
        momentum: Array = weight[:, None] * deferred
        particles.added_momentum[:] = deferred - momentum
        return momentum

    mass = staticmethod(added_mass)


@threaded
def _coefficients(voidage, values):
    """Coefficient of every particle by the law."""
    for n in prange(len(voidage)):
        values[n] = coefficient(voidage[n])
