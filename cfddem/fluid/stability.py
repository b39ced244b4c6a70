"""Rates of a fluid that limit its step."""

from __future__ import annotations

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import prange, threaded, vector_inline
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.grid import LOW, Array
from cfddem.fluid.step_limit import Rates


class FlowRates:
    """Finds the largest rates of a fluid.

    boundaries  of its grid
    density     rho [kg/m3]
    """

    def __init__(self, boundaries: Boundaries, density: float, communicator: Communicator) -> None:
        grid = boundaries.grid
        self._density, self._communicator, self._open = density, communicator, grid.open.astype(float)
        self._inverse_where_varied = 1.0 / np.array(grid.spacing) * [boundaries.varies_along(d) for d in range(3)]
        self._by_plane = np.zeros((3, grid.shape[0]))

    def of(self, velocity: Array, voidage: Array, effective_viscosity: Array) -> Rates:
        """Largest rates of a padded velocity, voidage, and voidage times viscosity [Pa s]."""
        largest_rates(
            velocity, voidage, effective_viscosity, self._open, self._density, self._inverse_where_varied,
            *self._by_plane,
        )  # fmt: skip
        return Rates(*(float(rate) for rate in self._communicator.largest(self._by_plane, axis=1)))


@threaded
def largest_rates(velocity, voidage, viscosity, open_cells, density, inverse, advection, viscous, fluxes):
    """Write the largest rates of each plane of cells, in the units of `Rates`.

    viscosity is eps mu. The viscous rate of a cell combines its voidage with the largest viscosity among the cell and
    its six neighbours.
    """
    nz, ny, nx = open_cells.shape
    for k in prange(nz):
        largest = np.zeros((3, nx))  # of the cells at each place in a row
        for j in range(ny):
            _row_rates(
                k, j, velocity, voidage, viscosity, open_cells, density, inverse, largest[0], largest[1], largest[2]
            )
        advection[k], viscous[k], fluxes[k] = largest[0].max(), largest[1].max(), largest[2].max()  # local: a plane


@vector_inline
def _row_rates(k, j, velocity, voidage, viscosity, open_cells, density, inverse, advection, viscous, fluxes):
    """Raise the largest rates at every place in a row to those of row j in plane k."""
    n, b, c, i = fluxes.size, j + LOW, k + LOW, LOW
    u0, u1 = velocity[0, c, b, i : i + n], velocity[0, c, b, i + 1 : i + 1 + n]
    v0, v1 = velocity[1, c, b, i : i + n], velocity[1, c, b + 1, i : i + n]
    w0, w1 = velocity[2, c, b, i : i + n], velocity[2, c + 1, b, i : i + n]
    here, fluid, is_open = viscosity[c, b, i : i + n], voidage[c, b, i : i + n], open_cells[k, j]
    west, east = viscosity[c, b, i - 1 : i - 1 + n], viscosity[c, b, i + 1 : i + 1 + n]
    south, north = viscosity[c, b - 1, i : i + n], viscosity[c, b + 1, i : i + n]
    down, up = viscosity[c - 1, b, i : i + n], viscosity[c + 1, b, i : i + n]
    squares = 2.0 * (inverse[0] ** 2 + inverse[1] ** 2 + inverse[2] ** 2)
    for x in range(n):
        u, v, w = max(abs(u0[x]), abs(u1[x])), max(abs(v0[x]), abs(v1[x])), max(abs(w0[x]), abs(w1[x]))
        around = max(max(max(west[x], east[x]), max(south[x], north[x])), max(down[x], up[x]))
        stiffness = is_open[x] * max(here[x], around) * squares / (density * fluid[x])
        advection[x] = max(advection[x], u * inverse[0] + v * inverse[1] + w * inverse[2])
        viscous[x] = max(viscous[x], stiffness)
        fluxes[x] = max(fluxes[x], max(u, max(v, w)) * fluid[x])
