r"""The solid fraction that a particle sees: that of the suspension around it, up to the surface of a bed.

A kernel smears the surface of a bed: the particles of the last layers would see half of the solids that are around
them, the drag would be too small there, and the layers would sink onto those below. So a particle does not see what is
around its place, but a mean over the particles around it, in which those at a surface hardly count:

.. math:: \varphi_i = \frac{[w S' d(g x)]_i}{[w S' d(g)]_i},\qquad
          x_i = [w S' d(V)/V_c]_i,\qquad
          g_i = V_i \max\left(e^{-(m_i/m_0)^2}, 10^{-4}\right),\qquad m_i = \sigma |\nabla x_i| / x_i

with d the deposit and w the gather of the linear mapping, and S' the sweeps that give both together the standard
deviation :math:`\sigma` of the kernel. m is the change of x over :math:`\sigma`: 0 within an even bed, about 0.6 in its
last layer. In a small wave the weights drop out, and what is left is the kernel twice,
:math:`\exp(-k^2\sigma^2)`.

A particle above the surface must fall back onto it, or the surface would spread: it sees looser surroundings than the
bed. At the plane surface of an even bed x is half of that within, whatever the symmetric kernel. Where it is less, the
particle is no part of the bed, and

.. math:: \varphi_i \to \min(\varphi_i, 2 x_i)

so that what it sees is continuous at the surface, and that of the particles of an even bed does not change. Its own
part of x, which the drag leaves out, counts twice there.

The cells of this mean are parts of those of the fluid, small enough for :math:`\sigma`. So what a particle sees does
not depend on the cells of the fluid. Of particles of unequal sizes each sees with the :math:`\sigma` of its own size.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import prange, threaded
from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.fluid.grid import Array

WIDEST = 1.15
"""Widest cell over the standard deviation of the kernel. Chosen with `SHARPNESS` on a fixed cubic lattice: the drag on
its last layer is within a tenth of that within the bed."""

MOST_PARTS = 4
"""Most parts of a cell along an axis: in wider cells a surface stays smeared."""

SHARPNESS = 0.15
"""m_0, the relative change of x over the standard deviation of the kernel at which the weight of a particle falls."""

AT_SURFACE = 0.5
"""x over the solid fraction of an even bed at its plane surface, for any kernel that is symmetric."""

LEAST_WEIGHT = 1e-4
"""Least weight: a lone particle or a row of them sees its own surroundings."""


class SeenSolids:
    """The solid fraction around particles, as a mean over the particles around each one.

    kernel  of the run; without a second stage (width 0) a particle sees what it gathers there

    cells   the kernel on its own cells
    change  of x around each particle in the last call of `around`, over m_0: sigma grad x / (m_0 x) (N, 3) [-]
    """

    def __init__(self, kernel: FilterKernel) -> None:
        self.cells, self._weighted = cells_of(kernel), kernel.smoothing > 0.0
        self._map: ParticleCellMap | None = None  # of the particles in the last call of `around`
        self._weights, self._sums = np.zeros((2, 0))
        self.change = np.zeros((0, 3))

    def around(self, cell_map: ParticleCellMap) -> Array:
        """Solid fraction around every particle, its own part included (N,) [-]."""
        cells = self.cells
        if not self._weighted:
            self._map, self._weights, self.change = cell_map, cell_map.volume, np.zeros((len(cell_map.volume), 3))
            self._sums = self._summed(cell_map.volume[:, None])[:, 0]
            return cells.gather(cell_map.stencil, cells.solid_fraction(cell_map)[None])[:, 0]
        # the slabs of the cells of the fluid are slabs of their parts, too
        self._map = cell_map._replace(stencil=cells.stencil(cell_map.position, cell_map.radius))
        gathered = cells.solids_with_slope(self._map)
        weighted, self.change = np.empty((len(gathered), 2)), np.empty((len(gathered), 3))
        _weigh(gathered, cell_map.volume, cells.width(cell_map.radius) / SHARPNESS, weighted, self.change)
        sums = self._summed(weighted)
        self._weights, self._sums = weighted[:, 1], sums[:, 1]
        surroundings: Array = weighted[:, 0] / weighted[:, 1]
        return np.minimum(sums[:, 0] / sums[:, 1], surroundings / AT_SURFACE)

    def averaged(self, values: Array) -> Array:
        """The same mean of values of the particles that `around` was called with (N, m)."""
        weighted = values.copy()
        for column in weighted.T:
            column *= self._weights
        mean = self._summed(weighted)
        for column in mean.T:
            column /= self._sums
        return mean

    def _summed(self, weighted: Array) -> Array:
        """Sums over the particles around every particle (N, m)."""
        assert self._map is not None
        return self.cells.sample(self._map.stencil, self._map.radius, self.cells.deposit(self._map, weighted))


def cells_of(kernel: FilterKernel) -> FilterKernel:
    """The kernel on the cells in which particles see; the same without a second stage."""
    if kernel.smoothing == 0.0:
        return kernel
    parts = parts_of(kernel)
    return FilterKernel(
        kernel.grid.divided(parts), kernel.periodic, smoothing=kernel.smoothing, sizes=kernel.sizes, twice=True,
        parts=parts, owners=kernel.owners,
    )  # fmt: skip


def parts_of(kernel: FilterKernel) -> tuple[int, int, int]:
    """Into how many parts along x, y, z the cells of the fluid are divided; those of a grid one cell thick are not."""
    grid, widest = kernel.grid.whole, WIDEST * float(kernel.widths.min())  # local: of the sizes of the run
    along = [
        1 if count == 1 else min(max(math.ceil(h / widest - 1e-9), 1), MOST_PARTS)
        for h, count in zip(grid.spacing, grid.cells)
    ]
    return along[0], along[1], along[2]


@threaded
def _weigh(gathered, volume, length, weighted, change):
    """Weight g times x, and g, of every particle, and the change of x.

    gathered  x, and its derivatives along x, y, z (N, 4) [-], [1/m]
    length    standard deviation of the particle's kernel over m_0 (N,) [m]
    """
    for n in prange(len(volume)):
        solid, uneven = gathered[n, 0], 0.0
        for d in range(3):
            change[n, d] = gathered[n, 1 + d] * length[n] / solid
            uneven += change[n, d] ** 2
        weighted[n, 1] = volume[n] * max(math.exp(-uneven), LEAST_WEIGHT)
        weighted[n, 0] = weighted[n, 1] * solid
