r"""Force of the fluid's viscous stress on the volume of a particle, :math:`V\,\nabla\cdot\tau` in model A."""

from __future__ import annotations

from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver


def viscous_force(fluid: FluidSolver, kernel: FilterKernel, cell_map: ParticleCellMap) -> Array:
    """Force on every particle (N, 3) [N]."""
    force: Array = cell_map.volume[:, None] * kernel.gather(cell_map.stencil, kernel.smooth(fluid.cell_viscous_force()))
    return force
