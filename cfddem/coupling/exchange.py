r"""Coupling of particles and fluid over one fluid step.

The force of the fluid on a particle of volume V and diameter d, at the velocity v in a fluid of velocity u:

.. math:: \text{model A:}\quad b(u-v) - V\nabla p' - \rho V g, \qquad b = 3\pi\eta d\,\varepsilon F
.. math:: \text{model B:}\quad \tfrac{1}{\varepsilon}\, b(u-v) - \rho V g

with F(Re, eps) the drag factor of the drag law. Added mass, history force, lift and viscous stress are optional.
Drag and the newest part of the history force are implicit on both sides, see :mod:`cfddem.coupling.transfer`; all other
forces are explicit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cfddem.backend.compile import prange, threaded
from cfddem.coupling.fluid_step_limits import COURANT, crossing_rate
from cfddem.coupling.forces.added_mass import AddedMass
from cfddem.coupling.forces.agitation import (
    AgitationTerms,
    FluctuatingForce,
    Neighbourhood,
    PseudoTurbulence,
    neighbourhood_mean,
)
from cfddem.coupling.forces.drag import Drag
from cfddem.coupling.forces.history import History, HistoryTerms
from cfddem.coupling.forces.lift import lift_force
from cfddem.coupling.forces.pressure import PressureForce
from cfddem.coupling.forces.torque import turn_with_fluid
from cfddem.coupling.forces.viscous_stress import viscous_force
from cfddem.coupling.forces.wall_drag import WallDrag
from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.coupling.sampled_flow import FlowSampler, SampledFlow
from cfddem.coupling.self_disturbance import SelfDisturbance
from cfddem.coupling.self_disturbance_walls import WallsOfGrid
from cfddem.coupling.terms import CouplingTerms, FluidForces
from cfddem.coupling.transfer import Transfer
from cfddem.coupling.velocity_gradient import change_along, vorticity_at
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.particles.state import Particles
from closures.registry import Law

SAME_STEP = 1e-6
"""Fluid steps that differ by less than this part are equal."""

STEP_RELAXATION = 0.01
"""Weight of the present step in the running mean of the fluid step."""


class Exchange:
    """All forces between a fluid and its particles.

    particles        get the fields that the coupling stores
    fluid            the fluid solver; its model, "A" or "B", holds for the coupling
    kernel           deposits on cells and gathers from them
    drag             drag law; None for no drag
    added_mass       of the particles; None for none
    lift             of shear (Saffman-Mei) and of spin (Magnus)
    torque           of the fluid against spin relative to half its vorticity
    viscous_stress   V div(tau), in model A only
    self_disturbance correct the sampled velocity and voidage for what each particle causes itself
    agitation        fluctuating force from the flow around the neighbours; None for none
    history          history force; None for none
    wall_drag        extra drag beside walls; None for none
    """

    def __init__(
        self,
        particles: Particles,
        fluid: FluidSolver,
        kernel: FilterKernel,
        drag: Law | None,
        *,
        added_mass: AddedMass | None = None,
        self_disturbance: bool = True,
        lift: bool = False,
        torque: bool = False,
        viscous_stress: bool = False,
        agitation: PseudoTurbulence | FluctuatingForce | None = None,
        history: History | None = None,
        wall_drag: WallDrag | None = None,
    ) -> None:
        self.fluid, self.kernel = fluid, kernel
        self.lift, self.torque, self.viscous_stress = lift, torque, viscous_stress and fluid.model == "A"
        self.drag, self.agitation, self.history = Drag(drag, fluid.model), agitation, history
        self.wall_drag = wall_drag
        walls = None if wall_drag is None else WallsOfGrid(kernel, fluid.boundaries)
        self.self_disturbance = SelfDisturbance(kernel, walls) if self_disturbance else None
        self.flow = FlowSampler(fluid, kernel, self.self_disturbance, self.drag.needs_sizes)
        self.pressure, self.added_mass = PressureForce(fluid, kernel), added_mass or AddedMass(0.0, fluid.density)
        self.momentum = Transfer(
            kernel, "velocity", ("drag_impulse", "N s"), self.drag.conductance, inertia, lambda each: each.force
        )
        self.spin_work = 0.0  # kinetic energy that the last torque of the fluid has given to the particles [J]
        self._mean_step = 0.0
        self._declare(particles)
        if self.added_mass:
            owned = particles.without_ghosts()
            cell_map = kernel.map_particles(owned.position, owned.radius)
            flow = self.flow.sample(owned, cell_map, kernel.solid_fraction(cell_map))
            self.added_mass.update(owned, flow.voidage)

    def _declare(self, particles: Particles) -> None:
        """Declare the fields of all forces."""
        declared = self.momentum.declare(particles)
        modes = () if self.self_disturbance is None else self.self_disturbance.fields
        random = () if self.agitation is None else self.agitation.fields
        past = () if self.history is None else self.history.fields
        for field in (*self.pressure.fields, *self.added_mass.fields, *modes, *random, *past):
            particles.declare(field)
            declared.append(field.name)
        self._stored = tuple(declared)

    # ------------------------------------------------------------ around one fluid step

    def prepare(self, particles: Particles, step: float) -> CouplingTerms:
        """What the particles send into the coming fluid step [s]: volume, drag, momentum and explicit forces.

        particles  of this rank, without ghosts
        """
        if self.momentum.last_step == 0.0:
            particles.reset(*self._stored)  # particles may have been moved since the fields were declared
        fluid, kernel, last_step = self.fluid, self.kernel, self.momentum.last_step
        particles.viscosity[:] = fluid.viscosity_at(particles.position)
        cell_map = kernel.map_particles(self._mapped_position(particles, step), particles.radius)
        solid = kernel.solid_fraction(cell_map)
        flow = self.flow.sample(particles, cell_map, solid)
        heavier, deferred, added = self._added_mass(particles, cell_map, flow, step)
        transverse = self._transverse_force(particles, cell_map, flow.slip)
        around = agitation = history = None
        if self.agitation is not None:
            around = self._neighbourhood(particles, cell_map, flow, solid)
            flow, agitation = around.flow, self.agitation.terms(particles, around, step)
        drag = self.drag.conductance(particles, flow) if around is None else around.conductance
        if self.wall_drag is not None:
            beside = self.wall_drag.terms(particles, flow.slip)
            drag, transverse = drag + beside.conductance, _sum([transverse, beside.force])
        if self.history is not None:
            history = self.history.terms(particles, flow, drag, inertia(particles), step, last_step)
        not_seen = _not_seen(flow, drag, agitation, history)
        conductance = drag if history is None else drag + history.conductance
        implicit = self.momentum.prepare(particles, cell_map, flow, step, not_seen, conductance)
        on_particles = [added, transverse, *(each.force for each in (agitation, history) if each is not None)]
        lost = _sum([deferred, *(-force for force in on_particles if force is not None)])
        source = None if lost is None else self._source(cell_map, lost)
        explicit = _sum([transverse, added])
        return CouplingTerms(cell_map, flow, drag, implicit, explicit, heavier, 1.0 - solid, source, agitation, history)

    def apply(self, particles: Particles, terms: CouplingTerms, gravity: Array) -> FluidForces:
        """Store in `particles.applied` the force on every particle until the next fluid step; returns its parts.

        The fluid has made its step with `terms`.

        gravity  (3,) [m/s2]; weight and buoyancy are part of the force
        """
        fluid, cell_map, step = self.fluid, terms.cell_map, terms.step
        received = self.momentum.apply(particles, cell_map, terms.implicit, *fluid.drag_response())
        drag, history = self._drag_and_history(particles, terms, received)
        excess_mass = (particles.density - fluid.density) * cell_map.volume
        forces = FluidForces(
            drag=drag,
            pressure=self.pressure.force(particles, cell_map),
            weight=np.stack([excess_mass * along for along in gravity], axis=1),
            explicit=terms.explicit,
            agitation=terms.fluctuating_force,
            history=history,
        )
        _replace(particles.applied, tuple(force for force in forces if force is not None), particles.force)
        self.pressure.store(particles, cell_map)
        self.added_mass.store(particles, terms.flow.slip)
        if self.torque and fluid.viscous:
            gained = turn_with_fluid(particles, vorticity_at(fluid, self.kernel, cell_map), fluid.density, step)
            self.spin_work = fluid.communicator.sum(gained)
        if self.self_disturbance is not None and fluid.viscous:
            on_slip = drag if history is None else drag + history
            screening = terms.drag * terms.flow.others / (fluid.density * terms.flow.voidage)
            self.self_disturbance.advance(particles, cell_map, terms.flow.slip, on_slip, screening, fluid.density, step)
        return forces

    def solid_fraction(self, particles: Particles) -> Array:
        """Solid fraction of the cells by the places from which the last voidage was computed (nz, ny, nx) [-]."""
        place = particles.mapped_position if self.pressure.fields else particles.position
        return self.kernel.solid_fraction(self.kernel.map_particles(place, particles.radius))

    @property
    def outside(self) -> int:
        """How often the drag law was evaluated outside its range."""
        return int(self.fluid.communicator.sum(self.drag.outside))

    def _agitation_outside(self) -> int:
        assert self.agitation is not None
        return int(self.fluid.communicator.sum(self.agitation.outside))

    def checkpoint(self) -> dict[str, Any]:
        """What the next step depends on beside fluid and particles."""
        return {
            "last_step": self.momentum.last_step,
            "mean_step": self._mean_step,
            "outside": self.outside,
            **({} if self.agitation is None else {"agitation": [self.agitation.steps, self._agitation_outside()]}),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.momentum.last_step, self._mean_step = float(state["last_step"]), float(state["mean_step"])
        first = self.fluid.communicator.rank == 0  # counts what all ranks have counted
        self.drag.outside = int(state["outside"]) if first else 0
        if self.agitation is not None:
            steps, outside = (int(each) for each in state["agitation"])
            self.agitation.steps, self.agitation.outside = steps, outside if first else 0

    # ------------------------------------------------------------ terms

    def _mapped_position(self, particles: Particles, step: float) -> Array:
        r"""Positions from which the voidage is computed, :math:`x + (h - \bar h)\,v` (N, 3) [m].

        h is the length of this step and :math:`\bar h` a running mean of it, which follows h slowly. Over a step the
        voidage moves from where the particles were mapped in the step before to where they are mapped now. The
        particles took the last step, h_l, between the two; the fluid takes h. The shift makes both intervals h. Without
        it particles would displace the fluid at h_l/h of their rate, a pressure shock in a liquid.
        """
        fluid, mean = self.fluid, self._mean_step or step
        self._mean_step = mean
        if abs(step - mean) < SAME_STEP * step:
            return particles.position
        crossing = crossing_rate(particles.velocity, fluid.grid.spacing, fluid.communicator)
        mean = min(mean, step + COURANT / max(crossing, 1e-300))  # particles are not moved by more than a cell
        self._mean_step = mean + STEP_RELAXATION * (step - mean)
        return self.kernel.wrapped(particles.position + (step - mean) * particles.velocity)

    def _neighbourhood(
        self, particles: Particles, cell_map: ParticleCellMap, flow: SampledFlow, solid: Array
    ) -> Neighbourhood:
        """The surroundings of the particles, with the Reynolds number and the drag of the mean slip around each.

        Drag laws are fits to mean slips: with individual, fluctuating slips the drag would grow with the fluctuation.
        """
        mean_slip = neighbourhood_mean(self.kernel, cell_map, solid, flow.slip)
        speed = np.sqrt((mean_slip**2).sum(axis=1))  # local: components of a row
        scale = 2.0 * self.fluid.density * particles.radius * flow.voidage
        flow = flow._replace(reynolds=scale * speed / np.maximum(particles.viscosity, 1e-300))
        return Neighbourhood(cell_map, flow, mean_slip, self.drag.conductance(particles, flow), solid)

    def _transverse_force(self, particles: Particles, cell_map: ParticleCellMap, slip: Array) -> Array | None:
        """Viscous stress and lift on every particle (N, 3) [N]; None without them."""
        fluid, forces = self.fluid, []
        if self.viscous_stress:
            forces.append(viscous_force(fluid, self.kernel, cell_map))
        if self.lift and fluid.viscous:
            curl = vorticity_at(fluid, self.kernel, cell_map)
            forces.append(lift_force(slip, curl, particles.spin, particles.radius, fluid.density, particles.viscosity))
        return _sum(forces)

    def _added_mass(
        self, particles: Particles, cell_map: ParticleCellMap, flow: SampledFlow, step: float
    ) -> tuple[Array, Array | None, Array | None]:
        """Change of the added mass (N,) [kg], and two forces (N, 3) [N]; None without them.

        On the fluid acts, one step late, what the particles lost to their added mass; on the particles the acceleration
        of the fluid, and its opposite on the fluid.
        """
        added_mass, last_step = self.added_mass, self.momentum.last_step
        if not added_mass or last_step == 0.0:
            none = np.zeros((particles.count, 3)) if added_mass else None
            return added_mass.update(particles, flow.voidage), none, none
        deferred = added_mass.deferred_momentum(particles)
        heavier = added_mass.update(particles, flow.voidage)
        weight = added_mass.newest_weight(particles, flow.voidage)
        passing = change_along(self.fluid, self.kernel, cell_map, flow.slip)
        force = added_mass.force(particles, flow, passing, weight, last_step)
        return heavier, added_mass.hand_over(particles, deferred, weight) / step, force

    def _drag_and_history(
        self, particles: Particles, terms: CouplingTerms, received: Array
    ) -> tuple[Array, Array | None]:
        """Drag and history force on every particle (N, 3), (N, 3) [N]; None for no history force.

        received  from the implicit transfer (N, 3) [N]
        """
        if self.history is None or terms.history is None:
            return received, None
        of_slip = received
        if terms.agitation is not None:
            of_slip = received - terms.drag[:, None] * terms.agitation.velocity
        newest = of_slip * (terms.history.conductance / np.maximum(terms.implicit.conductance, 1e-300))[:, None]
        self.history.store(particles, newest, terms.history, terms.step)
        return received - newest, newest + terms.history.force

    def _source(self, cell_map: ParticleCellMap, force: Array) -> Array:
        """Explicit force on the fluid, deposited on cells (nz, ny, nx, 3) [N/m3]."""
        source = self.kernel.smooth(self.kernel.deposit(cell_map, force)) / self.fluid.grid.cell_volume
        return np.ascontiguousarray(np.moveaxis(source, 0, -1))


def _sum(forces: Sequence[Array | None]) -> Array | None:
    """Sum of the forces that there are; None without any."""
    present = [force for force in forces if force is not None]
    return sum(present[1:], present[0]) if present else None


@threaded
def _replace(applied, forces, force):
    """Replace the force from outside by the sum of the forces of the fluid, as part of the sum of all forces."""
    for n in prange(len(force)):
        for d in range(3):
            new = 0.0
            for each in forces:
                new += each[n, d]
            force[n, d] += new - applied[n, d]
            applied[n, d] = new


def inertia(particles: Particles) -> Array:
    """Mass and added mass of every particle (N,) [kg]; infinite for fixed particles."""
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / particles.inverse_mass)


def _not_seen(flow: SampledFlow, drag: Array, agitation: AgitationTerms | None, history: HistoryTerms | None) -> Array:
    """Part of the cells' velocity that does not act on every particle (N, 3) [m/s].

    It is the velocity that the particle causes itself, less the fluctuation, which acts through the drag alone.
    """
    if agitation is None:
        return flow.disturbance
    if history is None:
        return flow.disturbance - agitation.velocity
    share = drag / np.maximum(drag + history.conductance, 1e-300)
    return flow.disturbance - share[:, None] * agitation.velocity
