"""What both models of agitation share: the surroundings of every particle, and means over them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.coupling.terms import CouplingTerms
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.model.feature import FluidForce
from cfddem.particles.state import Particles


class Neighbourhood(NamedTuple):
    """The surroundings of the particles in one fluid step."""

    cell_map: ParticleCellMap
    flow: SampledFlow
    mean_slip: Array  # mean over the neighbourhood, weighted by volume (N, 3) [m/s]
    conductance: Array  # drag over slip (N,) [kg/s]
    solid: Array  # solid fraction of the cells (nz, ny, nx)


class AgitationTerms(NamedTuple):
    """What agitation adds to one fluid step."""

    velocity: Array  # fluctuation of the fluid velocity in the drag (N, 3) [m/s]
    force: Array  # explicit force on every particle, its opposite on the fluid (N, 3) [N]


class Agitation(FluidForce):
    """What both models of agitation share: the surroundings of the particles, and the number of their step.

    fluid, kernel  of the run
    seed           of the random numbers

    pushes  whether there is a force beside the drag of the fluctuation
    """

    name, lines, pushes = "agitation", ("agitation",), True

    def __init__(self, fluid: FluidSolver, kernel: FilterKernel, seed: int) -> None:
        self.fluid, self.kernel, self.seed, self.steps = fluid, kernel, seed, 0
        self._mean_slip = np.zeros((0, 3))

    def begin(self, terms: CouplingTerms) -> None:
        """Give drag laws the Reynolds number of the mean slip around each particle.

        They are fits to mean slips: with individual, fluctuating slips the drag would grow with the fluctuation.
        """
        particles, flow = terms.particles, terms.flow
        self._mean_slip = neighbourhood_mean(self.kernel, terms.cell_map, terms.solid, flow.slip)
        speed = np.sqrt((self._mean_slip**2).sum(axis=1))  # local: components of a row
        scale = 2.0 * self.fluid.density * particles.radius * flow.voidage
        terms.flow = flow._replace(reynolds=scale * speed / np.maximum(particles.viscosity, 1e-300))

    def act(self, terms: CouplingTerms) -> None:
        """The fluctuation acts through the drag, the rest as a force."""
        share = 1.0 / np.asarray(terms.flow.narrowing)  # a fluctuation is one between the particles, not of the cells
        drag = terms.conductance("drag") * share
        around = Neighbourhood(terms.cell_map, terms.flow, self._mean_slip, drag, terms.solid)
        made = self.terms(terms.particles, around, terms.step)
        terms.fluctuate("drag", share.reshape(-1, 1) * made.velocity)
        if self.pushes:
            terms.between("agitation", made.force)

    def terms(self, particles: Particles, around: Neighbourhood, step: float) -> AgitationTerms:
        """What a model adds to the coming fluid step [s]."""
        raise NotImplementedError

    def checkpoint(self) -> dict[str, Any]:
        """The number of the step, from which random numbers follow."""
        return {"steps": self.steps}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.steps = int(state["steps"])


def neighbourhood_mean(kernel: FilterKernel, cell_map: ParticleCellMap, solid: Array, values: Array) -> Array:
    """Mean of values (N, m) over the particles around each one, weighted by volume and kernel (N, m)."""
    carried = np.ascontiguousarray(cell_map.volume[:, None] * values)
    fields = kernel.spread(cell_map, carried) / kernel.grid.cell_volume
    gathered = kernel.gather(cell_map.stencil, np.concatenate([fields, solid[None]]))
    mean: Array = gathered[:, :-1] / gathered[:, -1:]
    return mean


def without_mean(kernel: FilterKernel, cell_map: ParticleCellMap, weight: Array, values: Array) -> Array:
    r"""Values (N, m) less a mean over the particles around each one, so that the weighted sum of all is zero.

    .. math:: x_p - \sum_q K_{pq}\,\frac{g_q}{s_q}\,x_q,\qquad s_q = \sum_p K_{qp}\,g_p

    K is the product of deposit, smoothing and gather; it is symmetric, hence :math:`\sum_p g_p x_p` vanishes to
    round-off.

    weight  g (N,), not negative
    """
    around = kernel.gather(cell_map.stencil, kernel.smooth(kernel.deposit(cell_map, weight[:, None])))
    carried = values * (weight / np.maximum(around[:, 0], 1e-300))[:, None]
    return values - kernel.gather(cell_map.stencil, kernel.smooth(kernel.deposit(cell_map, carried)))
