r"""Force of the fluid's viscous stress on the volume of a particle, :math:`V\,\nabla\cdot\tau` in model A."""

from __future__ import annotations

from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.terms import CouplingTerms
from cfddem.fluid.solver import FluidSolver
from cfddem.model.feature import FluidForce


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
