"""Work of the fluid's forces on the particles over a fluid step.

The forces are constant while the particles move. The work of each one is the force times the displacement of its
particle, which the particle solver counts (`energies=True`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.coupling.exchange import Exchange
from cfddem.coupling.terms import CouplingTerms, FluidForces
from cfddem.data.fields import Field
from cfddem.fluid.grid import Array
from cfddem.particles.state import Particles

FORCES = tuple(
    Field(f"force_of_{name}", "N", 3, "scratch", meaning=f"force of the fluid on the particle: {name}")
    for name in FluidForces._fields
)
FLUCTUATING = Field("force_of_fluctuation", "N", 3, "scratch", meaning="drag of the fluctuation of the fluid velocity")
PRESSURE = Field("pressure_before", "Pa", role="scratch", meaning="fluid pressure before the particles moved")


class ImplicitWork(NamedTuple):
    """Work of drag and history force in a fluid step at the velocity with which the fluid acts on every particle."""

    drag: float  # [J]
    fluctuating: Array  # drag of the fluctuation of the fluid velocity (N, 3) [N]
    of_fluctuation: float  # work of that part of the drag [J]
    history: float  # of the implicit part of the history force [J]
    explicit_history: float  # of the rest [J]


class ParticleWork(NamedTuple):
    """Work on the particles in a fluid step [J]."""

    drag: float
    drag_on_fluid: float  # of the same force at the velocity with which the fluid acts
    fluctuating: float  # part of the drag by the fluctuation of the fluid velocity
    fluctuating_on_fluid: float  # of the same part at the velocity with which the fluid acts
    history: float
    history_on_fluid: float  # of the implicit part of the same force at the velocity with which the fluid acts
    explicit_history_on_fluid: float  # of its other part
    explicit: float  # lift, viscous stress, added mass and wall drag across the slip
    agitation: float  # other forces of agitation
    added: float  # kinetic energy that a change of the added mass has given to the particles
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
        for field in (*FORCES, FLUCTUATING, PRESSURE):
            particles.declare(field)
        self._on_fluid = ImplicitWork(0.0, np.zeros(0), 0.0, 0.0, 0.0)
        self._added = 0.0
        self._pressure = np.zeros(0)  # of the cells, smoothed by the kernel (1, nz, ny, nx) [Pa]

    def begin(self, particles: Particles, terms: CouplingTerms, forces: FluidForces) -> None:
        """After `Exchange.apply`, before the particles move; `particles` are those of this rank, without ghosts."""
        total = self.exchange.fluid.communicator.sum
        pressure = np.ascontiguousarray(self.exchange.fluid.pressure)[None]
        self._pressure = self.exchange.kernel.smooth(pressure)
        self._on_fluid = self._implicit_work(particles, terms, forces)
        particles[FLUCTUATING.name][:] = self._on_fluid.fluctuating
        self._added = total(0.5 * terms.added[:, None] * particles.velocity**2)
        for field, force in zip(FORCES, forces):
            particles[field.name][:] = 0.0 if force is None else force
        particles.pressure_before = self._pressure_at(particles)

    def end(self, particles: Particles) -> ParticleWork:
        """After the particles have moved."""
        fluid, total = self.exchange.fluid, self.exchange.fluid.communicator.sum
        model_a = float(fluid.model == "A")
        drag, pressure, weight, explicit, agitation, history = (particles[field.name] for field in FORCES)
        driving = model_a * particles.volume[:, None] * fluid.boundaries.driving
        rise = self._pressure_at(particles) - particles.pressure_before
        return ParticleWork(
            drag=total(drag * particles.work_displacement),
            drag_on_fluid=self._on_fluid.drag,
            fluctuating=total(particles[FLUCTUATING.name] * particles.work_displacement),
            fluctuating_on_fluid=self._on_fluid.of_fluctuation,
            history=total(history * particles.work_displacement),
            history_on_fluid=self._on_fluid.history,
            explicit_history_on_fluid=self._on_fluid.explicit_history,
            explicit=total(explicit * particles.work_displacement),
            agitation=total(agitation * particles.work_displacement),
            added=self._added,
            weight=total(weight * particles.displacement),
            driving=total(driving * particles.work_displacement),
            pressure=total((pressure - driving) * particles.work_displacement),
            displaced=-total(model_a * particles.volume * rise),
        )

    def _implicit_work(self, particles: Particles, terms: CouplingTerms, forces: FluidForces) -> ImplicitWork:
        """Work of drag and history force on the fluid."""
        kernel, fluid, received = self.exchange.kernel, self.exchange.fluid, particles.drag_impulse / terms.step
        weight = kernel.smooth(np.moveaxis(fluid.drag_response()[0], -1, 0))
        conductance = kernel.gather(terms.cell_map.stencil, weight) * terms.implicit.implicit[:, None]
        acting = terms.implicit.target + received / np.maximum(conductance, 1e-300)

        def work(force: Array) -> float:
            return terms.step * float(fluid.communicator.sum(force * acting))

        drag, history, explicit, fluctuating = received, 0.0, 0.0, np.zeros_like(received)
        if terms.history is not None and forces.history is not None:
            drag, explicit = forces.drag, work(terms.history.force)
            history = work(forces.history - terms.history.force)
        if terms.agitation is not None:
            share = terms.drag / np.maximum(terms.implicit.conductance, 1e-300)
            fluctuating = share[:, None] * conductance * terms.agitation.velocity
        return ImplicitWork(work(drag), fluctuating, work(fluctuating), history, explicit)

    def _pressure_at(self, particles: Particles) -> Array:
        """Pressure at every particle, by the weights of the deposit (N,) [Pa]."""
        kernel = self.exchange.kernel
        return kernel.gather(kernel.stencil(particles.position, particles.radius), self._pressure)[:, 0]
