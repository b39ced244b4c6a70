r"""Added-mass force, :math:`C\rho V(\dot u - \dot v)`.

The inertia of a particle contains the added mass :math:`C\rho V` (`inverse_mass`), which is the second part of the
force. What remains is :math:`C\rho V\dot u`, with the change of the sampled fluid velocity over the last step.
"""

from __future__ import annotations

import numpy as np

from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.data.fields import Field
from cfddem.fluid.grid import Array
from cfddem.particles.state import Particles

SAMPLED = Field(
    "sampled_velocity", "m/s", 3, "memory", np.nan, meaning="fluid velocity at the particle in the last fluid step"
)
"""NaN in inserted particles: the acceleration of the fluid is not known there."""


class AddedMass:
    """Added-mass force with a constant coefficient.

    coefficient  C; 0 for none
    """

    def __init__(self, coefficient: float) -> None:
        self.coefficient = float(coefficient)
        self.fields = (SAMPLED,) if self.coefficient else ()

    def force(self, particles: Particles, flow: SampledFlow, last_step: float) -> Array:
        """C rho V du/dt on every particle (N, 3) [N], from the change of u over the last step [s]."""
        if not self.fields or last_step == 0.0:
            return np.zeros_like(flow.slip)
        before = particles.sampled_velocity
        gained = np.where(np.isnan(before), 0.0, flow.slip + particles.velocity - before)
        force: Array = self.mass(particles)[:, None] * gained / last_step
        return force

    def deferred_momentum(self, particles: Particles) -> Array:
        """Momentum that added mass has taken from every particle; the fluid gets it in the next step (N, 3) [N s]."""
        moved: Array = self.mass(particles)[:, None] * (particles.velocity - particles.velocity_before)
        return moved

    def store(self, particles: Particles, slip: Array) -> None:
        """Store the sampled velocity of this step for the next."""
        if self.fields:
            particles.sampled_velocity = slip + particles.velocity

    @staticmethod
    def mass(particles: Particles) -> Array:
        """Added mass of every particle (N,) [kg]; zero for fixed particles."""
        free = particles.inverse_mass > 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(free, 1.0 / particles.inverse_mass - particles.mass, 0.0)
