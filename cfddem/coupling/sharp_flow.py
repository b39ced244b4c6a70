r"""The flow around each particle where surfaces of beds are sharp.

Across the surface of a bed the volume flux of fluid and particles is continuous, and the velocity of the fluid is not.
The velocity between the particles therefore follows from the flux of the cells and from the solids that a particle
sees. With a bar for smoothed and gathered fields of the cells,

.. math:: u_i = \frac{\overline{(1-\varphi)u} + \overline{\varphi v} - \varphi_i\,\bar v_i}{1 - \varphi_i}
          = \bar u + \frac{(\varphi_i - \bar\varphi)(\bar u - \bar v_i) + \bar\varphi\,\bar u - \overline{\varphi u}}
                           {1 - \varphi_i},\qquad \bar v_i = \overline{\varphi v}/\bar\varphi

The *narrowing* :math:`N = (1-\bar\varphi)/(1-\varphi_i)` is the part of it that acts on any change of the velocity of
the cells: a resistance b to the slip :math:`u_i - v` is a resistance b N to that of the cells, and implicit as such.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import inline, prange, threaded
from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.coupling.sampled_flow import FlowSampler, Sampled, SampledFlow, nothing_of_its_own
from cfddem.coupling.seen_solids import SeenSolids
from cfddem.data.fields import Field
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.particles.state import Particles

SEEN = Field("seen_solids", "1", 0, "memory", np.nan, meaning="solid fraction that the particle saw in the last step")
"""Without its own part. NaN in inserted particles."""


class SharpFlowSampler(FlowSampler):
    """As `FlowSampler`, with sharp surfaces of beds."""

    fields = (SEEN,)

    def __init__(
        self, fluid: FluidSolver, kernel: FilterKernel, own: Sampled = nothing_of_its_own, sizes: bool = False
    ) -> None:
        super().__init__(fluid, kernel, own, sizes)
        self.seen = SeenSolids(kernel)

    def sample(
        self, particles: Particles, cell_map: ParticleCellMap, solid: Array, mean: Array | None = None
    ) -> SampledFlow:
        """See `FlowSampler.sample`."""
        assert self.seen is not None
        around = self.seen.around(cell_map)
        gathered = self._means(particles, cell_map, solid if mean is None else mean)
        own, last = self.own(particles, cell_map), particles[SEEN.name]
        (slip, unseen), ratio = np.empty((2, particles.count, 3)), self._diameter_ratio(particles, cell_map, solid)
        voidage, reynolds, others, narrowing, of_others, company = np.empty((6, particles.count))
        flow = SampledFlow(slip, unseen, voidage, reynolds, others, ratio, narrowing, of_others, company)
        spheres = _Spheres(cell_map.volume, particles.radius, particles.velocity, particles.viscosity)
        _sample(gathered, around, last, spheres, own, self.fluid.density, flow)
        return flow

    def remember(self, particles: Particles, flow: SampledFlow) -> None:
        """Store the solid fraction seen at the end of the step."""
        particles[SEEN.name][:] = flow.solid

    def _means(self, particles: Particles, cell_map: ParticleCellMap, solid: Array) -> Array:
        """Means of the cells around every particle: velocity of the fluid, solid fraction, solid fraction times
        velocity of the fluid, and of the particles (N, 10) [m/s], [-], [m/s], [m/s]."""
        kernel, velocity = self.kernel, np.moveaxis(self.fluid.velocity, -1, 0)
        momentum = cell_map.volume[:, None] * particles.velocity
        carried = kernel.spread(cell_map, momentum, kernel.grid.cell_volume)
        fields = np.concatenate([velocity, solid[None], solid * velocity, carried])
        return kernel.sample(cell_map.stencil, cell_map.radius, fields)


class _Spheres(NamedTuple):
    """What the loop needs of the particles."""

    volume: Array
    radius: Array
    velocity: Array
    viscosity: Array


@inline
def _sample_one(n, gathered, around, last, spheres, own, density, flow):
    """See `_sample`."""
    cells = gathered[n, 3]
    share = min(max(own.solid[n] / max(cells, 1e-300), 0.0), 1.0)
    of_others = max(cells - share * own.solid[n], 0.0)
    flow.company[n] = of_others / max(cells, 1e-300)
    own_share = min(max(own.seen[n] / max(around[n], 1e-300), 0.0), 1.0)
    solid = max(around[n] - own_share * own.seen[n], 0.0)
    voidage = 1.0 - (solid if math.isnan(last[n]) else 0.5 * (solid + last[n]))
    narrowing, square = (1.0 - of_others) / voidage, 0.0
    for d in range(3):
        disturbed = 0.0
        for k in range(own.modes.shape[1]):
            disturbed += own.modes[n, k, d]
        fluid, particles, velocity = gathered[n, d], gathered[n, 7 + d] / max(cells, 1e-300), spheres.velocity[n, d]
        uneven = cells * fluid - gathered[n, 4 + d]
        between = fluid + ((narrowing - 1.0) * (fluid - particles) + uneven / voidage)
        slip = between - narrowing * share * disturbed - velocity
        flow.slip[n, d], flow.unseen[n, d] = slip, fluid - velocity - slip / narrowing
        square += slip * slip
    flow.others[n] = max(around[n] - own.seen[n], 0.0) / spheres.volume[n]
    flow.solid[n], flow.voidage[n], flow.narrowing[n] = solid, voidage, narrowing
    scale = density * 2.0 * spheres.radius[n] / max(spheres.viscosity[n], 1e-300)
    flow.reynolds[n] = scale * voidage * math.sqrt(square)


@threaded
def _sample(gathered, around, last, spheres, own, density, flow):
    """The flow around every particle, without its own part.

    gathered  of `SharpFlowSampler._means` (N, 10)
    around    solid fraction that each sees at the end of the step (N,) [-]
    last      that of the others which it saw in the last step, or NaN (N,) [-]
    own       zeros switch the correction off
    """
    for n in prange(len(around)):
        _sample_one(n, gathered, around, last, spheres, own, density, flow)
