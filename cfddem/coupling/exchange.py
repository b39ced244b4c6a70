r"""Coupling of particles and fluid over one fluid step.

The force of the fluid on a particle of volume V and diameter d, at the velocity v in a fluid of velocity u:

.. math:: \text{model A:}\quad b(u-v) - V\nabla p' - \rho V g, \qquad b = 3\pi\eta d\,\varepsilon F
.. math:: \text{model B:}\quad \tfrac{1}{\varepsilon}\, b(u-v) - \rho V g

with F(Re, eps) the drag factor of the drag law. Added mass, lift and viscous stress are added on request. Drag is
implicit on both sides, see :mod:`cfddem.coupling.transfer`; all other forces are explicit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cfddem.coupling.forces.added_mass import AddedMass
from cfddem.coupling.forces.agitation import (
    AgitationTerms,
    FluctuatingForce,
    Neighbourhood,
    PseudoTurbulence,
    neighbourhood_mean,
)
from cfddem.coupling.forces.drag import Drag
from cfddem.coupling.forces.lift import lift_force, vorticity
from cfddem.coupling.forces.pressure import PressureForce
from cfddem.coupling.forces.torque import turn_with_fluid
from cfddem.coupling.forces.viscous_stress import viscous_force
from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.coupling.sampled_flow import FlowSampler, SampledFlow
from cfddem.coupling.self_disturbance import SelfDisturbance
from cfddem.coupling.time_scales import COURANT, crossing_rate
from cfddem.coupling.transfer import ImplicitCoefficients, Transfer
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.particles.state import Particles
from closures.registry import Law

SAME_STEP = 1e-6
"""Fluid steps that differ by less than this part are equal."""

STEP_RELAXATION = 0.01
"""Part of its distance to the present step by which the usual fluid step moves in every step."""


class CouplingTerms(NamedTuple):
    """What particles send into a fluid step, and what the coupling needs after it."""

    cell_map: ParticleCellMap
    flow: SampledFlow
    drag: ImplicitCoefficients
    explicit: Array  # forces known before the fluid's step: lift, viscous stress, added mass, agitation (N, 3) [N]
    voidage: Array  # of the cells (nz, ny, nx)
    source: Array | None  # force on the fluid (nz, ny, nx, 3) [N/m3]

    @property
    def step(self) -> float:
        """Length of the fluid step [s]."""
        return self.drag.step

    @property
    def fields(self) -> tuple[Array, Array, Array, Array | None]:
        """Arguments of `FluidSolver.step` after the length of the step."""
        return self.voidage, self.drag.cell_conductance, self.drag.cell_product, self.source


class Exchange:
    """All forces between a fluid and its particles.

    particles        get the fields that the coupling stores
    fluid            the fluid solver; its model, "A" or "B", holds for the coupling
    kernel           deposits on cells and gathers from them
    drag             drag law; None for no drag
    added_mass       coefficient C of the added mass C rho V; 0 for none
    lift             of shear (Saffman-Mei) and of spin (Magnus)
    torque           of the fluid against spin relative to half its vorticity
    viscous_stress   V div(tau), in model A only
    self_disturbance correct the sampled velocity and voidage for what each particle causes itself
    agitation        fluctuating force from the flow around the neighbours; None for none
    """

    def __init__(
        self,
        particles: Particles,
        fluid: FluidSolver,
        kernel: FilterKernel,
        drag: Law | None,
        *,
        added_mass: float = 0.0,
        self_disturbance: bool = True,
        lift: bool = False,
        torque: bool = False,
        viscous_stress: bool = False,
        agitation: PseudoTurbulence | FluctuatingForce | None = None,
    ) -> None:
        self.fluid, self.kernel = fluid, kernel
        self.lift, self.torque, self.viscous_stress = lift, torque, viscous_stress and fluid.model == "A"
        self.drag, self.agitation = Drag(drag, fluid.model), agitation
        self.self_disturbance = SelfDisturbance(kernel) if self_disturbance else None
        self.flow = FlowSampler(fluid, kernel, self.self_disturbance, self.drag.needs_sizes)
        self.pressure, self.added_mass = PressureForce(fluid, kernel), AddedMass(added_mass)
        self.momentum = Transfer(
            kernel, "velocity", ("drag_impulse", "N s"), self.drag.conductance, inertia, lambda each: each.force
        )
        self.spin_work = 0.0  # kinetic energy that the last torque of the fluid has given to the particles [J]
        self._usual_step = 0.0
        self._declare(particles)

    def _declare(self, particles: Particles) -> None:
        """Declare the fields of all forces."""
        declared = self.momentum.declare(particles)
        modes = () if self.self_disturbance is None else self.self_disturbance.fields
        random = () if self.agitation is None else self.agitation.fields
        for field in (*self.pressure.fields, *self.added_mass.fields, *modes, *random):
            particles.declare(field)
            declared.append(field.name)
        self._stored = tuple(declared)

    # ------------------------------------------------------------ around one fluid step

    def prepare(self, particles: Particles, step: float) -> CouplingTerms:
        """What the particles send into the coming fluid step [s]: volume, drag, momentum and explicit forces."""
        if self.momentum.last_step == 0.0:
            particles.reset(*self._stored)  # particles may have been moved since the fields were declared
        fluid, kernel, last_step = self.fluid, self.kernel, self.momentum.last_step
        particles.viscosity[:] = fluid.viscosity_at(particles.position)
        cell_map = kernel.map_particles(self._mapped_position(particles, step), particles.radius)
        solid = kernel.solid_fraction(cell_map)
        flow = self.flow.sample(particles, cell_map, solid)
        transverse = self._transverse_force(particles, cell_map, flow.slip)
        not_seen = flow.disturbance  # part of the cells' velocity that does not act on the particle
        if self.agitation is not None:
            flow, agitation = self._agitate(particles, cell_map, flow, solid, step)
            transverse += agitation.force
            not_seen = not_seen - agitation.velocity
        drag = self.momentum.prepare(particles, cell_map, flow, step, not_seen)
        added = self.added_mass.force(particles, flow, last_step)
        lost = self._deferred_force(particles, added, step) - transverse
        return CouplingTerms(cell_map, flow, drag, transverse + added, 1.0 - solid, self._source(cell_map, lost))

    def apply(self, particles: Particles, terms: CouplingTerms, gravity: Array) -> None:
        """Store in `particles.applied` the force on every particle until the next fluid step.

        The fluid has made its step with `terms`.

        gravity  (3,) [m/s2]; weight and buoyancy are part of the force
        """
        fluid, cell_map, step = self.fluid, terms.cell_map, terms.step
        weight, seen, _ = fluid.drag_exchange()
        drag = self.momentum.apply(particles, cell_map, terms.drag, weight, seen)
        force = (
            drag
            + self.pressure.force(particles, cell_map)
            + (particles.mass - fluid.density * cell_map.volume)[:, None] * gravity
            + terms.explicit
        )
        particles.force += force - particles.applied
        particles.applied = force
        self.pressure.store(particles, cell_map)
        self.added_mass.store(particles, terms.flow.slip)
        if self.torque and fluid.viscous:
            gained = turn_with_fluid(particles, self._vorticity(cell_map), fluid.density, step)
            self.spin_work = fluid.communicator.sum(gained)
        if self.self_disturbance is not None and fluid.viscous:
            screening = terms.drag.conductance * terms.flow.others / (fluid.density * terms.flow.voidage)
            self.self_disturbance.advance(particles, cell_map, terms.flow.slip, drag, screening, fluid.density, step)

    def drag_work(self, particles: Particles, terms: CouplingTerms) -> float:
        """Work of the last drag impulse at the velocity with which the fluid acts on every particle [J]."""
        kernel, drag = self.kernel, particles.drag_impulse / terms.step
        weight = kernel.smooth(np.moveaxis(self.fluid.drag_exchange()[0], -1, 0))
        gathered = kernel.gather(terms.cell_map.stencil, weight)
        acting = terms.drag.target + drag / np.maximum(gathered * terms.drag.implicit[:, None], 1e-300)
        work: float = terms.step * self.fluid.communicator.sum(drag * acting)
        return work

    @property
    def outside(self) -> int:
        """How often the drag law was evaluated outside its range."""
        return int(self.fluid.communicator.sum(self.drag.outside))

    def checkpoint(self) -> dict[str, Any]:
        """What the next step depends on beside fluid and particles."""
        return {
            "last_step": self.momentum.last_step,
            "usual_step": self._usual_step,
            "outside": self.drag.outside,
            **({} if self.agitation is None else {"agitation_steps": self.agitation.steps}),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.momentum.last_step, self._usual_step = float(state["last_step"]), float(state["usual_step"])
        self.drag.outside = int(state["outside"])
        if self.agitation is not None:
            self.agitation.steps = int(state["agitation_steps"])

    # ------------------------------------------------------------ terms

    def _mapped_position(self, particles: Particles, step: float) -> Array:
        r"""Positions from which the voidage is computed, :math:`x + (h - h_u)\,v` (N, 3) [m], h_u the usual step.

        The voidage moves over a step from where particles were mapped in the last to where they are mapped in this
        one. Between the two lies the last step of the particles, h_l, but h for the fluid. Mapped at the time of the
        particles plus h less the usual step, both intervals are h. Otherwise particles would displace the fluid at
        h_l/h of their rate, a pressure shock in a liquid. The usual step follows the present one slowly.
        """
        fluid, usual = self.fluid, self._usual_step or step
        self._usual_step = usual
        if abs(step - usual) < SAME_STEP * step:
            return particles.position
        crossing = crossing_rate(particles.velocity, fluid.grid.spacing, fluid.communicator)
        usual = min(usual, step + COURANT / max(crossing, 1e-300))  # particles are not moved by more than a cell
        self._usual_step = usual + STEP_RELAXATION * (step - usual)
        return self.kernel.wrapped(particles.position + (step - usual) * particles.velocity)

    def _agitate(
        self, particles: Particles, cell_map: ParticleCellMap, flow: SampledFlow, solid: Array, step: float
    ) -> tuple[SampledFlow, AgitationTerms]:
        """The flow with the Reynolds number of the mean slip of each neighbourhood, and the agitation of this step.

        Drag laws are fits to mean slips: with individual, fluctuating slips the drag would grow with the fluctuation.
        """
        assert self.agitation is not None
        mean_slip = neighbourhood_mean(self.kernel, cell_map, solid, flow.slip)
        speed = np.sqrt((mean_slip**2).sum(axis=1))  # local: components of a row
        scale = 2.0 * self.fluid.density * particles.radius * flow.voidage
        flow = flow._replace(reynolds=scale * speed / np.maximum(particles.viscosity, 1e-300))
        return flow, self.agitation.terms(particles, Neighbourhood(cell_map, flow, mean_slip, solid), step)

    def _transverse_force(self, particles: Particles, cell_map: ParticleCellMap, slip: Array) -> Array:
        """Viscous stress and lift on every particle (N, 3) [N]."""
        fluid, force = self.fluid, np.zeros_like(slip)
        if self.viscous_stress:
            force += viscous_force(fluid, self.kernel, cell_map)
        if self.lift and fluid.viscous:
            curl = self._vorticity(cell_map)
            force += lift_force(slip, curl, particles.spin, particles.radius, fluid.density, particles.viscosity)
        return force

    def _vorticity(self, cell_map: ParticleCellMap) -> Array:
        """Vorticity of the fluid around every particle (N, 3) [1/s]."""
        curl = vorticity(np.moveaxis(self.fluid.velocity, -1, 0), self.fluid.grid.spacing)
        return self.kernel.gather(cell_map.stencil, self.kernel.smooth(curl))

    def _deferred_force(self, particles: Particles, added: Array, step: float) -> Array:
        """Force of the added mass on the fluid in the coming step (N, 3) [N].

        The fluid gets the momentum that the particles lost to their added mass over the last step, less the part
        that the fluid's own acceleration gives them now.
        """
        if self.added_mass.coefficient == 0.0 or self.momentum.last_step == 0.0:
            return np.zeros_like(added)
        return self.added_mass.deferred_momentum(particles) / step - added

    def _source(self, cell_map: ParticleCellMap, force: Array) -> Array | None:
        """Explicit force on the fluid, deposited on cells (nz, ny, nx, 3) [N/m3]; None where there is none."""
        if not (self.added_mass.coefficient or self.lift or self.viscous_stress or self.agitation):
            return None
        source = self.kernel.smooth(self.kernel.deposit(cell_map, force)) / self.fluid.grid.cell_volume
        return np.ascontiguousarray(np.moveaxis(source, 0, -1))


def inertia(particles: Particles) -> Array:
    """Mass and added mass of every particle (N,) [kg]; infinite for fixed particles."""
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / particles.inverse_mass)
