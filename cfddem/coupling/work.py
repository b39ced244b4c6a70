"""Work of the fluid's forces on the particles over a fluid step.

The forces are constant while the particles move. Each does the force times the way of its particle, which the particle
solver counts (`energies=True`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.coupling.exchange import CouplingTerms, Exchange
from cfddem.data.fields import Field
from cfddem.fluid.grid import Array
from cfddem.particles.state import Particles

EXPLICIT = Field("explicit_force", "N", 3, "scratch", meaning="lift, viscous stress, added mass, agitation")
PRESSURE = Field("pressure_before", "Pa", role="scratch", meaning="fluid pressure before the particles moved")


class ParticleWork(NamedTuple):
    """Work of each force of the fluid on the particles [J]."""

    drag: float  # along the way of the particles
    drag_on_fluid: float  # of the same force at the velocity with which the fluid acts
    explicit: float  # lift, viscous stress, added mass and agitation
    weight: float  # less buoyancy
    driving: float  # mean pressure gradient of periodic sides
    pressure: float  # all other pressure
    displaced: float  # of the cells' pressure on the volume that the particles displace


class CouplingWork:
    """Counts the work of the forces of a coupling.

    particles  get the fields that the count stores within a step
    exchange   the coupling
    gravity    (3,) [m/s2]
    """

    def __init__(self, particles: Particles, exchange: Exchange, gravity: Array) -> None:
        self.exchange, self.gravity = exchange, gravity
        for field in (EXPLICIT, PRESSURE):
            particles.declare(field)
        self._step = self._drag_on_fluid = 0.0
        self._pressure = np.zeros(0)  # of the cells, smoothed by the kernel (1, nz, ny, nx) [Pa]

    def begin(self, particles: Particles, terms: CouplingTerms) -> None:
        """After `Exchange.apply`, before the particles move."""
        pressure = np.ascontiguousarray(self.exchange.fluid.pressure)[None]
        self._step, self._pressure = terms.step, self.exchange.kernel.smooth(pressure)
        self._drag_on_fluid = self.exchange.drag_work(particles, terms)
        particles.explicit_force = terms.explicit
        particles.pressure_before = self._pressure_at(particles)

    def end(self, particles: Particles) -> ParticleWork:
        """After the particles have moved."""
        fluid, total = self.exchange.fluid, self.exchange.fluid.communicator.sum
        model_a, volume = float(fluid.model == "A"), particles.volume[:, None]
        drag = particles.drag_impulse / self._step
        weight = (particles.mass[:, None] - fluid.density * volume) * self.gravity
        driving = model_a * volume * fluid.boundaries.driving
        pressure = particles.applied - drag - weight - particles.explicit_force - driving
        rise = self._pressure_at(particles) - particles.pressure_before
        return ParticleWork(
            drag=total(drag * particles.way),
            drag_on_fluid=self._drag_on_fluid,
            explicit=total(particles.explicit_force * particles.way),
            weight=total(weight * particles.path),
            driving=total(driving * particles.way),
            pressure=total(pressure * particles.way),
            displaced=-total(model_a * particles.volume * rise),
        )

    def _pressure_at(self, particles: Particles) -> Array:
        """Pressure at every particle, by the weights of the deposit (N,) [Pa]."""
        kernel = self.exchange.kernel
        return kernel.gather(kernel.stencil(particles.position, particles.radius), self._pressure)[:, 0]
