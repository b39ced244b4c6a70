"""Rates of a fluid that limit its step."""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import prange, threaded
from cfddem.fluid.grid import LOW, UNIT, Array
from cfddem.fluid.state import FluidState
from cfddem.fluid.step_limit import Rates


class FlowRates:
    """Finds the largest rates of a fluid.

    fluid  with its effective viscosity
    """

    def __init__(self, fluid: FluidState) -> None:
        self.fluid = fluid
        self._inverse_where_varied = fluid.inverse_spacing * [fluid.boundaries.varies_along(d) for d in range(3)]
        self._by_plane = np.zeros((3, fluid.grid.shape[0]))

    def of(self, velocity: Array, voidage: Array) -> Rates:
        """Largest rates of a padded velocity and voidage, with the effective viscosity as it is."""
        fluid = self.fluid
        largest_rates(
            velocity, voidage, fluid.fields.effective_viscosity, fluid.open_cells, fluid.density,
            self._inverse_where_varied, *self._by_plane,
        )  # fmt: skip
        return Rates(*(float(rate) for rate in fluid.communicator.largest(self._by_plane, axis=1)))


@threaded
def largest_rates(velocity, voidage, viscosity, open_cells, density, inverse, advection, viscous, fluxes):
    """Write the largest rates of each plane of cells, in the units of `Rates`.

    viscosity is eps mu. The viscous rate of a cell combines its voidage with the largest viscosity among the cell and
    its six neighbours.
    """
    nz, ny, nx = open_cells.shape
    squares = 2.0 * (inverse[0] ** 2 + inverse[1] ** 2 + inverse[2] ** 2)
    for k in prange(nz):
        fastest, stiffest, flux = 0.0, 0.0, 0.0
        for j in range(ny):
            for i in range(nx):
                kk, jj, ii = k + LOW, j + LOW, i + LOW
                crossing, largest = 0.0, viscosity[kk, jj, ii]
                for d in range(velocity.shape[0]):
                    dk, dj, di = UNIT[d]
                    speed = max(abs(velocity[d, kk, jj, ii]), abs(velocity[d, kk + dk, jj + dj, ii + di]))
                    crossing += speed * inverse[d]
                    flux = max(flux, speed * voidage[kk, jj, ii])
                    around = max(viscosity[kk - dk, jj - dj, ii - di], viscosity[kk + dk, jj + dj, ii + di])
                    largest = max(largest, around)
                fastest = max(fastest, crossing)
                stiffest = max(stiffest, open_cells[k, j, i] * largest * squares / (density * voidage[kk, jj, ii]))
        advection[k], viscous[k], fluxes[k] = fastest, stiffest, flux
