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
from cfddem.coupling.forces.drag import Drag, WallDrag
from cfddem.coupling.forces.history import History
from cfddem.coupling.forces.pressure import Weight
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.coupling.terms import ForceList, ForceTerms, total
from cfddem.coupling.transfer import after_source, implicit_coefficients
from cfddem.fluid.grid import Array
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles
from cfddem.particles.walls.shapes import Plane
from closures.added_mass import near_wall
from closures.registry import Law

_APART = 1e-5
"""Part of the distance from the wall over which the added mass is differentiated."""

DURATION = Field("fluid_duration", "s", role="memory", meaning="duration of the last step of the fluid at rest")
"""0 in inserted particles, which have no memory yet."""


class AddedMassBesideWall(FluidForce):
    """Added mass of 1/2, raised by a plane at rest, and the force by its gradient.

    density  of the fluid [kg/m3]
    walls    the plane, if there is one
    """

    name, lines, sets_inertia = "added_mass", ("explicit",), True

    def __init__(self, density: float, *walls: Plane) -> None:
        self.density, self.walls = density, walls
        self._push = np.zeros((0, 3))

    def begin(self, terms: ForceTerms) -> None:
        """Set the inertia of every particle.

        By Lagrange's equations, with C of the distance z from the wall, the force is -1/2 rho V dC/dz (v_n^2) n.
        """
        particles = terms.particles
        displaced = self.density * particles.volume
        coefficient, self._push = np.full(particles.count, 0.5), np.zeros((particles.count, 3))
        for wall in self.walls:
            normal = np.array(wall.normal) / np.linalg.norm(wall.normal)  # local: one vector
            away = np.maximum((particles.position - wall.point) @ normal, particles.radius)
            far = [near_wall(z * (1.0 + _APART), r) for z, r in zip(away, particles.radius)]
            coefficient = np.array([near_wall(z, r) for z, r in zip(away, particles.radius)])
            gradient = (np.array(far) - coefficient) / (_APART * away)
            self._push = -0.5 * (displaced * gradient * (particles.velocity @ normal) ** 2)[:, None] * normal
        free = particles.inverse_mass > 0.0
        after = np.where(free, 1.0 / (particles.mass + coefficient * displaced), 0.0)
        particles.inverse_mass[:] = after

    def act(self, terms: ForceTerms) -> None:
        """The force by the gradient of the added mass."""
        terms.push("explicit", self._push)


class QuiescentFluid:
    """A fluid at rest around the particles of a solver.

    solver      without gravity of its own, in one process; its checkpoint holds all that the fluid remembers
    density     of the fluid [kg/m3]
    viscosity   of the fluid [Pa s]
    drag        drag law; None for no drag
    added_mass  whether particles have an added mass, 1/2 far from walls; or a plane at rest that raises it, for motion
                towards it and away from it alone: motion along the wall, whose added mass grows less, gets the same
    history     "mei_adrian", "basset" or "none"
    wall_drag   extra drag beside walls; None for none
    gravity     (3,) [m/s2]

    forces   the forces of the fluid; add others by `forces.add(force, solver.particles)`
    force    of each line on every particle over the last step (N, 3) [N]
    """

    def __init__(
        self,
        solver: ParticleSolver,
        density: float,
        viscosity: float,
        drag: Law | None,
        *,
        added_mass: bool | Plane = True,
        history: Literal["none", "mei_adrian", "basset"] = "mei_adrian",
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
        self.solver, self.density, self.viscosity = solver, density, viscosity
        forces: list[FluidForce] = [Weight(density, np.array(gravity))]
        if added_mass:
            forces.append(AddedMassBesideWall(density, *([added_mass] if isinstance(added_mass, Plane) else [])))
        if drag:
            forces.append(Drag(drag, "A"))
        forces += filter(None, [wall_drag])
        if history != "none":
            forces.append(History(history, density))
        solver.particles.declare(DURATION)
        self.forces, self.force = ForceList(solver.particles, forces), dict[str, Array]()

    def advance(self, step: float, steps: int = 1) -> None:
        """Advance the particles by some steps, over which the forces of the fluid are constant.

        step  of the particles [s]
        """
        particles, span = self.solver.particles, step * steps
        particles.viscosity[:] = self.viscosity
        last = float(particles[DURATION.name].max())  # local: one process; inserted particles have no slip yet
        terms = ForceTerms(particles, span, last)
        terms.flow = self._flow(particles)
        self.forces.act(terms)
        force = total(terms.explicit, particles.external) + particles.external
        last_step = after_source(particles.velocity, force)
        implicit, target, _ = implicit_coefficients(
            terms.resistance, terms.inertia, particles.velocity, terms.unseen, last_step, span, terms.directions
        )
        terms.receive(-implicit * target)
        self.forces.finish(terms)
        self.force = terms.forces
        particles[DURATION.name][:] = span
        self.solver.advance(step, steps)

    def _flow(self, particles: Particles) -> SampledFlow:
        """The flow around every particle, as if it were alone in the fluid."""
        slip = -particles.velocity
        speed = np.sqrt((slip**2).sum(axis=1))  # local: components of a row
        reynolds = 2.0 * self.density * particles.radius * speed / np.maximum(particles.viscosity, 1e-300)
        none, one = np.zeros(particles.count), np.ones(particles.count)
        return SampledFlow(slip, np.zeros_like(slip), one, reynolds, none, one)
