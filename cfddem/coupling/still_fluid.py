r"""A fluid at rest around a few particles, without a fluid solver: drag, added mass, history force and buoyancy.

For collisions and falls in a large vessel. A particle moves as if it were alone in an unbounded fluid, but a plane wall
can raise its added mass, and walls its drag. The fluid that a particle sets in motion acts on this particle, by the
history force, and on no other. Lubrication films are computed by the particle solver.

Drag and the newest part of the history force are implicit, as in a coupled run (:mod:`cfddem.coupling.transfer`).
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.coupling.exchange import inertia
from cfddem.coupling.forces.drag import Drag
from cfddem.coupling.forces.history import History
from cfddem.coupling.forces.wall_drag import WallDrag
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.data.fields import Field
from cfddem.fluid.grid import Array
from cfddem.particles.far_films import rates_of_films
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles
from cfddem.particles.walls.shapes import Plane
from closures.added_mass import near_wall
from closures.registry import Law

_APART = 1e-5
"""Part of the distance from the wall over which the added mass is differentiated."""

DURATION = Field("fluid_duration", "s", role="memory", meaning="duration of the last step of the fluid at rest")
"""0 in inserted particles, which have no memory yet."""


class StillFluid:
    """A fluid at rest around the particles of a solver.

    solver      without gravity of its own, in one process; its checkpoint holds all that the fluid remembers
    density     of the fluid [kg/m3]
    viscosity   of the fluid [Pa s]
    drag        drag law; None for no drag
    added_mass  whether particles have an added mass, 1/2 far from the wall
    history     "mei_adrian", "basset" or "none"
    wall        plane at rest that raises the added mass, for motion towards it and away from it alone: motion along
                the wall, whose added mass grows less, gets the same; None for none
    wall_drag   extra drag beside walls; None for none
    gravity     (3,) [m/s2]
    """

    def __init__(
        self,
        solver: ParticleSolver,
        density: float,
        viscosity: float,
        drag: Law | None,
        *,
        added_mass: bool = True,
        history: Literal["none", "mei_adrian", "basset"] = "mei_adrian",
        wall: Plane | None = None,
        wall_drag: WallDrag | None = None,
        gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        if any(solver.gravity):
            raise InputError("gravity", tuple(solver.gravity), "0 in the particle solver", "give it to the fluid")
        if solver.communicator.size > 1:
            raise InputError("solver", None, "in one process")
        for name, value in (("density", density), ("viscosity", viscosity)):
            if not 0.0 < value < math.inf:
                raise InputError(name, value, "above 0 and finite")
        self.solver, self.density, self.viscosity, self.drag = solver, density, viscosity, Drag(drag, "A")
        self.added_mass, self.wall, self.gravity = added_mass, wall, np.array(gravity)
        self.history = None if history == "none" else History(history, density)
        self.wall_drag = wall_drag
        for field in (DURATION, *(() if self.history is None else self.history.fields)):
            solver.particles.declare(field)
        self.forces: dict[str, Array] = {}

    def advance(self, step: float, steps: int = 1) -> None:
        """Advance the particles by some steps, over which the forces of the fluid are constant.

        step  of the particles [s]
        """
        particles, span = self.solver.particles, step * steps
        particles.viscosity[:] = self.viscosity
        push = self._set_inertia(particles)
        weight = (particles.mass - self.density * particles.volume)[:, None] * self.gravity
        received, explicit = self._drag_and_history(particles, weight + push, span)
        self.forces |= {"weight": weight, "added_mass_gradient": push}
        total = received + weight + push + explicit
        particles.force += total - particles.applied
        particles.applied[:] = total
        particles[DURATION.name][:] = span
        self.solver.advance(step, steps)

    def _set_inertia(self, particles: Particles) -> Array:
        """Set the inertia of every particle; returns the force by the gradient of its added mass (N, 3) [N].

        By Lagrange's equations, with C of the distance z from the wall, it is -1/2 rho V dC/dz (v_n^2) n.
        """
        push, displaced = np.zeros((particles.count, 3)), self.density * particles.volume
        if not self.added_mass:
            return push
        coefficient = np.full(particles.count, 0.5)
        if self.wall is not None:
            normal = np.array(self.wall.normal) / np.linalg.norm(self.wall.normal)  # local: one vector
            away = np.maximum((particles.position - self.wall.point) @ normal, particles.radius)
            far = [near_wall(z * (1.0 + _APART), r) for z, r in zip(away, particles.radius)]
            coefficient = np.array([near_wall(z, r) for z, r in zip(away, particles.radius)])
            gradient = (np.array(far) - coefficient) / (_APART * away)
            push = -0.5 * (displaced * gradient * (particles.velocity @ normal) ** 2)[:, None] * normal
        free = particles.inverse_mass > 0.0
        after = np.where(free, 1.0 / (particles.mass + coefficient * displaced), 0.0)
        for rate in rates_of_films(particles):
            rate[free] *= after[free] / particles.inverse_mass[free]
        particles.inverse_mass[:] = after
        return push

    def _drag_and_history(self, particles: Particles, other: Array, span: float) -> tuple[Array, Array]:
        """Implicit force of drag and history on every particle, and the explicit part of the history (N, 3) [N]."""
        slip, capacity = -particles.velocity, inertia(particles)
        speed = np.sqrt((slip**2).sum(axis=1))  # local: components of a row
        reynolds = 2.0 * self.density * particles.radius * speed / np.maximum(particles.viscosity, 1e-300)
        none, one = np.zeros(particles.count), np.ones(particles.count)
        flow = SampledFlow(slip, np.zeros_like(slip), one, reynolds, none, one)
        drag, aside = self.drag.conductance(particles, flow), np.zeros_like(slip)
        if self.wall_drag is not None:
            beside = self.wall_drag.terms(particles, slip)
            drag, aside = drag + beside.conductance, beside.force
        conductance, explicit, terms = drag, aside, None
        if self.history is not None:
            last = float(particles[DURATION.name].max())  # local: one process; inserted particles have no slip yet
            terms = self.history.terms(particles, flow, drag, capacity, span, last)
            conductance, explicit = drag + terms.conductance, aside + terms.force
        stiffness = span * conductance / capacity
        theta = (1.0 + stiffness) / (2.0 + stiffness)
        foreseen = slip - (theta * span / capacity)[:, None] * (other + explicit)
        received = (conductance / (1.0 + theta * stiffness))[:, None] * foreseen
        share = (drag / np.maximum(conductance, 1e-300))[:, None]
        if self.history is not None and terms is not None:
            self.history.store(particles, received * (1.0 - share), terms, span)
        self.forces |= {"drag": received * share + aside, "history": received * (1.0 - share) + explicit - aside}
        return received, explicit
