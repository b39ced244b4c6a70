"""Gradient of the fluid velocity in cells, and what particles take from it: vorticity and change along a direction."""

from __future__ import annotations

import numpy as np

from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver


def velocity_gradient(fluid: FluidSolver, kernel: FilterKernel) -> Array:
    """Derivative of component c of the velocity along axis d in cells (c, d, nz, ny, nx) [1/s].

    Central differences; one-sided beside a side that is not periodic, and zero along an axis of one cell.
    """
    velocity = np.moveaxis(fluid.velocity, -1, 0)
    padded, gradient = kernel.halo.padded(velocity), np.zeros((3, *velocity.shape))
    for axis, (count, spacing) in enumerate(zip(fluid.grid.cells, fluid.grid.spacing)):
        if count == 1:
            continue
        along = kernel.halo.inner(np.roll(padded, -1, 3 - axis) - np.roll(padded, 1, 3 - axis)) / (2.0 * spacing)
        ends = np.moveaxis(along, 3 - axis, 0)
        for layer, side in ((0, 0), (-1, 1)):
            if kernel.halo.ends[axis, side]:
                ends[layer] *= 2.0  # the ghost repeats the cell beside it
        gradient[axis] = along
    return np.moveaxis(gradient, 0, 1)


def vorticity_at(fluid: FluidSolver, kernel: FilterKernel, cell_map: ParticleCellMap) -> Array:
    """Vorticity of the fluid around every particle (N, 3) [1/s]."""
    slope = velocity_gradient(fluid, kernel)
    curl = np.stack([slope[2, 1] - slope[1, 2], slope[0, 2] - slope[2, 0], slope[1, 0] - slope[0, 1]])
    return kernel.sample(cell_map.stencil, cell_map.radius, curl)


def change_along(fluid: FluidSolver, kernel: FilterKernel, cell_map: ParticleCellMap, direction: Array) -> Array:
    r"""Change of the velocity along a vector at every particle, :math:`(w\cdot\nabla)u` (N, 3).

    direction  w (N, 3)
    """
    slope = velocity_gradient(fluid, kernel).reshape(9, *fluid.grid.shape)
    gathered = kernel.sample(cell_map.stencil, cell_map.radius, slope).reshape(-1, 3, 3)
    return np.einsum("ncd,nd->nc", gathered, direction)
