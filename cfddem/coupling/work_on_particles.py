"""Work of the fluid's forces on the particles over a fluid step.

The forces are constant while the particles move. The work of each one is the force times the displacement of its
particle, which the particle solver counts (`energies=True`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.coupling.coupling import Coupling
from cfddem.coupling.terms import LINES, CouplingTerms
from cfddem.data.fields import Field
from cfddem.fluid.grid import Array
from cfddem.particles.state import Particles

FORCES = {
    line: Field(f"force_of_{line}", "N", 3, "scratch", meaning=f"force on the particle: {meaning}")
    for line, meaning in LINES.items()
}
FLUCTUATING = Field("force_of_fluctuation", "N", 3, "scratch", meaning="drag of the fluctuation of the fluid velocity")
PRESSURE = Field("pressure_before", "Pa", role="scratch", meaning="fluid pressure before the particles moved")


class ImplicitWork(NamedTuple):
    """Work of drag and history force in a fluid step at the velocity with which the fluid acts on every particle."""

    drag: float  # [J]
    fluctuating: Array  # drag of the fluctuation of the fluid velocity (N, 3) [N]
    of_fluctuation: float  # work of that part of the drag [J]
    history: float  # of the implicit part of the history force [J]
    explicit_history: float  # of the rest [J]
    explicit_drag: float  # of drag and its pressure, of which the fluid receives nothing in the step [J]
    external: float  # of forces from outside on the fluid [J]


class ParticleWork(NamedTuple):
    """Work on the particles in a fluid step [J]."""

    drag: float
    drag_on_fluid: float  # of the same force at the velocity with which the fluid acts
    fluctuating: float  # part of the drag by the fluctuation of the fluid velocity
    fluctuating_on_fluid: float  # of the same part at the velocity with which the fluid acts
    history: float
    history_on_fluid: float  # of the implicit part of the same force at the velocity with which the fluid acts
    explicit_history_on_fluid: float  # of its other part
    explicit_drag_on_fluid: float  # of the part of drag and its pressure that the fluid receives a step later
    explicit: float  # lift, viscous stress, added mass and wall drag across the slip
    agitation: float  # other forces of agitation
    external: float  # forces from outside, and of a user
    external_on_fluid: float  # of those on the fluid
    added: float  # kinetic energy that a change of the added mass has given to the particles
    weight: float  # less buoyancy
    driving: float  # mean pressure gradient of periodic sides
    pressure: float  # all other pressure
    displaced: float  # of the cells' pressure on the volume that the particles displace


class CouplingWork:
    """Counts the work of the forces of a coupling.

    particles  get the fields that the count stores within a step
    coupling   the coupling
    """

    def __init__(self, particles: Particles, coupling: Coupling) -> None:
        self.coupling = coupling
        for field in (*FORCES.values(), FLUCTUATING, PRESSURE):
            particles.declare(field)
        self._on_fluid = ImplicitWork(0.0, np.zeros(0), 0.0, 0.0, 0.0, 0.0, 0.0)
        self._added = 0.0
        self._pressure = np.zeros(0)  # of the cells (1, nz, ny, nx) [Pa]

    def begin(self, terms: CouplingTerms) -> None:
        """After `Coupling.apply`, before the particles move."""
        particles = terms.particles
        total = self.coupling.fluid.communicator.sum
        self._pressure = self.coupling.fluid.pressure[None].copy()
        self._on_fluid = self._implicit_work(particles, terms)
        particles[FLUCTUATING.name][:] = self._on_fluid.fluctuating
        self._added = total(0.5 * terms.added[:, None] * particles.velocity**2)
        for line, field in FORCES.items():
            particles[field.name][:] = terms.force(line)
        particles.pressure_before = self._pressure_at(particles)

    def end(self, particles: Particles) -> ParticleWork:
        """After the particles have moved."""
        fluid, total = self.coupling.fluid, self.coupling.fluid.communicator.sum
        model_a = float(fluid.model == "A")

        def work(line: str) -> float:
            return float(total(particles[FORCES[line].name] * particles.work_displacement))

        driving = model_a * particles.volume[:, None] * fluid.boundaries.driving
        rise = self._pressure_at(particles) - particles.pressure_before
        return ParticleWork(
            drag=work("drag"),
            drag_on_fluid=self._on_fluid.drag,
            fluctuating=total(particles[FLUCTUATING.name] * particles.work_displacement),
            fluctuating_on_fluid=self._on_fluid.of_fluctuation,
            history=work("history"),
            history_on_fluid=self._on_fluid.history,
            explicit_history_on_fluid=self._on_fluid.explicit_history,
            explicit_drag_on_fluid=self._on_fluid.explicit_drag,
            explicit=work("explicit"),
            agitation=work("agitation"),
            external=work("external"),
            external_on_fluid=self._on_fluid.external,
            added=self._added,
            weight=total(particles[FORCES["weight"].name] * particles.displacement),
            driving=total(driving * particles.work_displacement),
            pressure=total((particles[FORCES["pressure"].name] - driving) * particles.work_displacement),
            displaced=-total(model_a * particles.volume * rise),
        )

    def _implicit_work(self, particles: Particles, terms: CouplingTerms) -> ImplicitWork:
        """Work of drag and history force on the fluid, and of forces from outside."""
        kernel, fluid, received = self.coupling.kernel, self.coupling.fluid, particles.drag_impulse / terms.step
        cell_map, weight = terms.cell_map, np.moveaxis(fluid.drag_response()[0], -1, 0)
        conductance = kernel.sample(cell_map.stencil, cell_map.radius, weight) * terms.implicit.implicit[:, None]
        acting = terms.implicit.target + received / np.maximum(conductance, 1e-300)

        def work(force: Array) -> float:
            return terms.step * float(fluid.communicator.sum(force * acting))

        fluctuating = np.zeros_like(received)
        for line, velocity in terms.fluctuations.items():
            share = terms.conductance(line) / np.maximum(terms.resistance, 1e-300)
            fluctuating = share[:, None] * conductance * velocity
        none = np.zeros_like(received)
        return ImplicitWork(
            work(terms.implicit_force["drag"]), fluctuating, work(fluctuating),
            work(terms.implicit_force.get("history", none)), work(terms.explicit.get("history", none)),
            work(terms.explicit.get("drag", none)),
            self._external_work(terms),
        )  # fmt: skip

    def _external_work(self, terms: CouplingTerms) -> float:
        """Work of forces from outside on the fluid, at the mean of its velocity before and after the step."""
        if "external" not in terms.on_fluid:
            return 0.0
        kernel, fluid = self.coupling.kernel, self.coupling.fluid
        cell_map, mean = terms.cell_map, np.moveaxis(fluid.mean_velocity, -1, 0)
        velocity = kernel.sample(cell_map.stencil, cell_map.radius, mean)
        return terms.step * float(fluid.communicator.sum(terms.on_fluid["external"] * velocity))

    def _pressure_at(self, particles: Particles) -> Array:
        """Pressure at every particle, by the weights of the deposit (N,) [Pa]."""
        kernel, radius = self.coupling.kernel, particles.radius
        return kernel.sample(kernel.stencil(particles.position, radius), radius, self._pressure)[:, 0]
