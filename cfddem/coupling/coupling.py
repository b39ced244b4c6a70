r"""Coupling of particles and fluid over one fluid step.

The force of the fluid on a particle of volume V and diameter d, at the velocity v in a fluid of velocity u:

.. math:: \text{model A:}\quad b(u-v) - V\nabla p' - \rho V g, \qquad b = 3\pi\eta d\,\varepsilon F
.. math:: \text{model B:}\quad \tfrac{1}{\varepsilon}\, b(u-v) - \rho V g

with F(Re, eps) the drag factor of the drag law. Added mass, history force, lift and viscous stress are optional. Each
force is a :class:`cfddem.model.feature.FluidForce`; the coupling goes over their list and names none of them.
Resistance is implicit on both sides, see :mod:`cfddem.coupling.transfer`; all other forces are explicit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.coupling.sampled_flow import FlowSampler, SharpFlowSampler
from cfddem.coupling.terms import CouplingTerms, ForceList, ForceTerms, inertia, total
from cfddem.coupling.transfer import Transfer, columns
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles

Part = Callable[[str], AbstractContextManager[None]]

SAME_STEP = 1e-6
"""Fluid steps that differ by less than this part are equal."""

STEP_RELAXATION = 0.01
"""Weight of the present step in the running mean of the fluid step."""

MAPPED = Field(
    "mapped_position", "m", 3, "memory", lambda table, rows: table.position[rows],
    meaning="position from which the voidage was computed in the last fluid step",
)  # fmt: skip

RESPONSE = Field(
    "response_rate", "1/s", 3, "memory",
    meaning="rate at which a particle took up the fluid's velocity along each axis",
)  # fmt: skip

CROWDING = Field("crowding", "1", role="memory", meaning="solids over fluid around a particle in the last fluid step")

STABLE = 0.7
"""Largest foresight, over that from which on motions to and fro from step to step grow."""


class Coupling:
    """All forces between a fluid and its particles.

    particles  get the fields that the coupling stores
    fluid      the fluid solver; its model, "A" or "B", holds for the coupling. It gets the voidage of the particles,
               and the flow that its boundaries drive between them
    kernel     deposits on cells and gathers from them
    forces     in the order in which they act

    `exchanged_impulse` has the impulses of drag in this step of the particles before every exchange, and less those
    after it; their sum is what the particles that have left received (N, 3) [N s].
    """

    def __init__(
        self,
        particles: Particles,
        fluid: FluidSolver,
        kernel: FilterKernel,
        forces: Iterable[FluidForce],
    ) -> None:
        forces = list(forces)
        self.fluid, self.kernel = fluid, kernel
        sampler = SharpFlowSampler if any(force.sharp for force in forces) else FlowSampler
        self.flow = sampler.of_forces(fluid, kernel, forces)
        owned = particles.without_ghosts()
        cell_map = kernel.map_particles(owned.position, owned.radius)
        fluid.set_voidage(1.0 - kernel.solid_fraction(cell_map))
        fluid.set_velocity((0.0, 0.0, 0.0))
        self.momentum = Transfer(
            kernel, "velocity", ("drag_impulse", "N s"), inertia, lambda particles: particles.force
        )
        self._mean_step = 0.0
        self.exchanged_impulse = np.zeros((0, 3))
        own = (MAPPED, RESPONSE, CROWDING, *self.flow.fields)
        for field in own:
            particles.declare(field)
        declared = [*(field.name for field in own), *self.momentum.declare(particles)]
        self.forces = ForceList(particles, forces)
        self._stored = (*declared, *(field.name for force in self.forces for field in force.fields))
        if self.sets_inertia:
            terms = self._terms(particles.without_ghosts(), cell_map, 0.0)  # with the fields of the forces
            for force in self.forces:
                if force.sets_inertia:
                    force.begin(terms)

    @property
    def gravity(self) -> Array:
        """Acceleration of gravity (3,) [m/s2]."""
        return np.array(self.fluid.gravity)

    @property
    def sets_inertia(self) -> bool:
        """Whether a force changes the inertia of particles."""
        return any(force.sets_inertia for force in self.forces)

    # ------------------------------------------------------------ around one fluid step

    def advance(self, particles: Particles, step: float, _: float, part: Part) -> CouplingTerms:
        """Make one step of the fluid [s] with its forces on the particles.

        particles  of this rank, without ghosts
        part       measures the wall time of a part
        """
        self.exchanged_impulse = np.zeros((0, 3))
        with part("voidage and drag"):
            terms = self.prepare(particles, step)
        with part("fluid"):
            self.fluid.step(step, *terms.fields)
        with part("forces of the fluid"):
            self.apply(particles, terms)
        return terms

    def exchange(self, before: Particles, after: Particles) -> None:
        """Let particles that enter replace fluid of their own volume, and those that leave make room for it."""
        self.fluid.add_voidage(self.solid_fraction(before) - self.solid_fraction(after))
        parts = (self.exchanged_impulse, before.drag_impulse, -after.drag_impulse)
        self.exchanged_impulse = np.concatenate(parts)

    def prepare(self, particles: Particles, step: float) -> CouplingTerms:
        """What the particles send into the coming fluid step [s]: volume, drag, momentum and explicit forces.

        particles  of this rank, without ghosts
        """
        if self.momentum.last_step == 0.0:
            particles.reset(*self._stored)  # particles may have been moved since the fields were declared
        cell_map = self.kernel.map_particles(self._mapped_position(particles, step), particles.radius)
        particles.viscosity[:] = self.kernel.between_centres(self.fluid.viscosity, particles.position)
        terms = self._terms(particles, cell_map, step)
        self.forces.act(terms)
        unseen = terms.unseen
        on_fluid = total(terms.on_fluid, unseen) if terms.on_fluid else None
        terms.implicit = self.momentum.prepare(
            particles, cell_map, terms.resistance, step, unseen, on_fluid, terms.directions
        )
        return terms

    def apply(self, particles: Particles, terms: CouplingTerms) -> None:
        """Set `particles.applied`, the force on every particle until the next fluid step.

        The fluid has made its step with `terms`, which then have the force of every line.
        """
        terms.receive(self.momentum.apply(particles, terms.cell_map, terms.implicit, *self.fluid.drag_response()))
        self.forces.finish(terms)
        self.flow.remember(particles, terms.flow)
        particles.mapped_position = terms.cell_map.position
        particles.response_rate[:] = terms.response_rate
        particles.crowding = (1.0 - terms.flow.voidage) / terms.flow.voidage

    def solid_fraction(self, particles: Particles) -> Array:
        """Solid fraction of the cells by the places from which the last voidage was computed (nz, ny, nx) [-]."""
        return self.kernel.solid_fraction(self.kernel.map_particles(particles.mapped_position, particles.radius))

    @property
    def outside(self) -> dict[str, int]:
        """How often the law of each force was evaluated outside its range, by the name of the force."""
        return self.forces.outside(self.fluid.communicator)

    def state(self) -> dict[str, Any]:
        """Entries of the checkpoint of a simulation: the fluid, and what the next step depends on beside the forces."""
        steps = {"last_step": self.momentum.last_step, "mean_step": self._mean_step}
        return {"fluid": self.fluid.checkpoint(), "coupling": steps}

    def take_over(self, state: dict[str, Any]) -> None:
        """Continue from a checkpoint of a simulation."""
        self.fluid.restore(state["fluid"])
        steps = state["coupling"]
        self.momentum.last_step, self._mean_step = float(steps["last_step"]), float(steps["mean_step"])

    # ------------------------------------------------------------ terms

    def _terms(self, particles: Particles, cell_map: ParticleCellMap, step: float) -> CouplingTerms:
        """Terms of a step with the flow around every particle, before any force has acted."""
        cells = self.flow.deposited(particles, cell_map)
        solid = cells.solid
        terms = CouplingTerms(particles, step, self.momentum.last_step, cell_map, solid)
        # forces act over the step: they see the mean of the solid fractions at its beginning and its end
        first = self.momentum.last_step == 0.0
        mean = solid if first else 0.5 * (solid + (1.0 - self.fluid.voidage))
        terms.flow = self.flow.sample(particles, cell_map, cells, mean)
        terms.seen_solids = self.flow.seen_solids
        return terms

    def _mapped_position(self, particles: Particles, step: float) -> Array:
        r"""Positions from which the voidage at the end of the step is computed (N, 3) [m].

        .. math:: x + \left(h - (1-w)\,\bar h\right) v

        with the foresight w (`_foresight`) and a running mean :math:`\bar h` of the step, which follows h slowly. Over
        a step the voidage moves from where the particles were mapped in the step before to where they are mapped now.
        Heavy particles (w = 1) keep their velocity: they displace the fluid while they move. With x the fluid would
        follow a step later, and feed waves. Light particles follow the fluid within the step, and crowded ones push it.
        To predict their motion would be unstable; they are mapped where they are, and shifted where h changes, so that
        they displace the fluid at their rate. Each step makes up for what the last one has missed by the acceleration
        of a particle; a shorter one for a part of it, as its square, or this would be a shock of pressure.
        """
        mean, last = self._mean_step or step, self.momentum.last_step
        light = 1.0 - self._foresight(particles, mean)
        ahead = (step - light * mean) * particles.velocity
        if last > step * (1.0 + SAME_STEP):
            missed = self.kernel.nearest(particles.mapped_position - particles.position)
            ahead += (1.0 - (step / last) ** 2) * (missed + light * mean * particles.velocity)
        self._mean_step = mean + STEP_RELAXATION * (step - mean)
        return self.kernel.wrapped(particles.position + ahead)

    def _foresight(self, particles: Particles, step: float) -> Array:
        r"""Part w of their motion over the coming step by which particles are mapped ahead, along each axis (N, 3) [-].

        .. math:: w = \min\left(\frac{1}{1+\lambda^2},\;
                  s\,\frac{2-\Lambda}{k\,(2\Lambda + 4 r)}\right),\qquad
                  \Lambda = \frac{\lambda\,(1 + k)}{1+\lambda},\quad k = \varphi/\varepsilon

        with :math:`\lambda` the step over the time in which the fluid takes a particle along, and r the mass of the
        displaced fluid over that of the particle. The second part is s times the largest w at which particles that
        move to and fro from step to step do so less and less: the fluid between them moves by the opposite of their
        volume flux, which is mapped ahead, and drag and pressure act back on them. A bead that slides along a
        wall is not light because the wall holds it: each axis has its own.
        """
        response, crowding = step * particles.response_rate, columns(particles.crowding)
        drag = np.minimum(response * (1.0 + crowding) / (1.0 + response), 2.0)
        displaced = columns(self.fluid.density * particles.volume * particles.inverse_mass)
        largest = STABLE * (2.0 - drag) / np.maximum(crowding * (2.0 * drag + 4.0 * displaced), 1e-12)
        return np.asarray(np.minimum(1.0 / (1.0 + response**2), largest))


class Uncoupled:
    """What stands in for the coupling of dry particles: forces of a user, and no fluid.

    solver  of the particles
    """

    fluid = None

    def __init__(self, solver: ParticleSolver) -> None:
        self.forces, self.gravity = ForceList(solver.particles), np.array(solver.gravity)

    def advance(self, particles: Particles, step: float, last_step: float, _: Part) -> ForceTerms:
        """Set the forces on the particles over a step [s]."""
        terms = ForceTerms(particles, step, last_step)
        self.forces.act(terms)
        self.forces.finish(terms)
        return terms

    def exchange(self, before: Particles, after: Particles) -> None:
        """No fluid makes room."""

    def state(self) -> dict[str, Any]:
        """Nothing."""
        return {}

    def take_over(self, state: dict[str, Any]) -> None:
        """Nothing."""
