r"""Forces on the volume of a particle: pressure, :math:`-V\nabla p'`, and viscous stress in model A, and weight."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cfddem.coupling.kernel import FilterKernel, ParticleCellMap, Stencil
from cfddem.coupling.terms import CouplingTerms, ForceTerms
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.state import Particles

MAPPED_EARLIER = Field(
    "earlier_mapped_position", "m", 3, "memory", lambda table, rows: table.position[rows],
    meaning="position from which the voidage was computed in the step before the last",
)  # fmt: skip
"""The voidage that the fluid sees is a mean over three steps; so is the pressure gradient that a particle sees."""


class PressureForce(FluidForce):
    """Pressure force of model A; in model B the fluid carries the whole pressure gradient.

    fluid   the fluid solver
    kernel  gathers the pressure gradient
    """

    name, lines, fields = "pressure", ("pressure",), (MAPPED_EARLIER,)

    def __init__(self, fluid: FluidSolver, kernel: FilterKernel) -> None:
        self.fluid, self.kernel = fluid, kernel
        self._known: list[ParticleCellMap] = []  # of the last step and the one before
        self._known_ids = np.zeros(0, np.int64)  # of the particles in the rows of these maps
        self._known_reach: object = None  # the cells that these maps number

    def respond(self, terms: CouplingTerms) -> None:
        """The force by the new pressure."""
        terms.push("pressure", self.force(terms.particles, terms.cell_map))

    def force(self, particles: Particles, cell_map: ParticleCellMap) -> Array:
        """Force on every particle (N, 3) [N], after the step of the fluid.

        The fluid has used the voidage of the last three steps with the weights 1/4, 1/2 and 1/4. The gradient is
        gathered from the places of these three steps with the same weights.
        """
        gradient = self.fluid.cell_pressure_gradient()
        same = self._known_reach is self.kernel.reach  # else space has been cut anew
        if not (same and np.array_equal(self._known_ids, particles.id)):  # local: rows of this rank
            self.forget()
        last, earlier = (
            self._stencil(particles, n, name) for n, name in enumerate(("mapped_position", MAPPED_EARLIER.name))
        )
        force: Array = self.kernel.sample_over_steps(earlier, last, cell_map.stencil, cell_map.radius, gradient)
        for along in force.T:
            along *= -cell_map.volume
        return force

    def forget(self) -> None:
        """Find the stencils of earlier steps anew."""
        self._known = []

    def _stencil(self, particles: Particles, n: int, name: str) -> Stencil:
        """Stencil of stored positions; kept from the step before unless rows or cells of the rank have changed."""
        if n < len(self._known):
            return self._known[n].stencil
        return self.kernel.stencil(particles[name], particles.radius)

    def end(self, terms: CouplingTerms) -> None:
        """Store the places of the last step for the next one; the coupling stores those of this step."""
        particles, cell_map = terms.particles, terms.cell_map
        particles.earlier_mapped_position = particles.mapped_position
        self._known, self._known_ids = [cell_map, *self._known[:1]], particles.id.copy()
        self._known_reach = self.kernel.reach


# ---------------------------------------------------------------- viscous stress


class ViscousStress(FluidForce):
    """Viscous stress of model A on the volume of every particle.

    fluid   the fluid solver
    kernel  gathers the stress
    """

    name, lines = "viscous_stress", ("explicit",)

    def __init__(self, fluid: FluidSolver, kernel: FilterKernel) -> None:
        self.fluid, self.kernel = fluid, kernel

    def act(self, terms: CouplingTerms) -> None:
        """The force of the stress now."""
        cell_map = terms.cell_map
        stress = self.kernel.sample(cell_map.stencil, cell_map.radius, self.fluid.cell_viscous_force())
        terms.between("explicit", cell_map.volume[:, None] * stress)


# ---------------------------------------------------------------- weight less buoyancy


class Weight(FluidForce):
    """Weight, less buoyancy.

    density  of the fluid [kg/m3]
    gravity  (3,) [m/s2]
    """

    name, lines = "weight", ("weight",)

    def __init__(self, density: float, gravity: Sequence[float] | Array) -> None:
        self.density, self.gravity = density, np.array(gravity, float)

    def act(self, terms: ForceTerms) -> None:
        """The same force in every step; the fluid carries the weight of its own volume."""
        excess_mass = (terms.particles.density - self.density) * terms.particles.volume
        terms.push("weight", np.stack([excess_mass * along for along in self.gravity], axis=1))
