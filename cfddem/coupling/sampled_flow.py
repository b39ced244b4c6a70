r"""The flow around each particle, sampled from the cells without the disturbance that the particle causes itself.

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
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import inline, prange, threaded
from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.coupling.seen_solids import SeenSolids
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.state import Particles


class SampledFlow(NamedTuple):
    """The undisturbed flow around every particle."""

    slip: Array  # u - v (N, 3) [m/s]
    unseen: Array  # part of the gathered velocity that does not act: the self-disturbance (N, 3) [m/s]
    voidage: Array  # (N,)
    reynolds: Array  # of the superficial slip (N,)
    others: Array  # number of other particles per volume (N,) [1/m3]
    diameter_ratio: Array  # diameter over the Sauter mean of the particles around (N,)
    narrowing: Array | float = 1.0  # slip over gathered velocity less unseen part and v (N,) [-]
    solid: Array | float = 0.0  # solid fraction of the others at the end of the step (N,) [-]
    company: Array | float = 1.0  # share of the others in the solids of the cells around (N,) [-]


class Seen(NamedTuple):
    """The fluid around every particle, as loops over particles take it."""

    slip: Array  # (N, 3) [m/s]
    voidage: Array  # (N,); empty for 1
    radius: Array  # of the particles (N,) [m]
    viscosity: Array  # (N,) [Pa s]
    density: float  # [kg/m3]


class Own(NamedTuple):
    """What every particle adds to the flow."""

    modes: Array  # of its disturbance (N, modes, 3) [m/s]
    solid: Array  # solid fraction that it gathers from the cells (N,) [-]
    solid_seen: Array  # solid fraction that it sees, where surfaces are sharp (N,) [-]


def nothing_of_its_own(particles: Particles, cell_map: ParticleCellMap) -> Own:
    """No modes, and no solid fraction: the flow is sampled as it is."""
    return Own(np.zeros((particles.count, 0, 3)), np.zeros(particles.count), np.zeros(particles.count))


Sampled = Callable[[Particles, ParticleCellMap], Own]


class Deposited(NamedTuple):
    """What particles deposit on the cells before the flow is sampled."""

    solid: Array  # solid fraction (nz, ny, nx) [-]
    momentum: Array = np.empty((0, 0, 0, 0))  # solid fraction times velocity, for sharp surfaces (3, nz, ny, nx) [m/s]


class FlowSampler:
    """Samples the flow around particles.

    fluid   the fluid solver
    kernel  gathers the fields of the fluid
    own     what every particle adds itself, which is taken away
    sizes   whether the Sauter mean is sampled; the diameter ratio is 1 otherwise
    seen_solids  means that particles see, where surfaces of beds are sharp

    fields  of the particles that it remembers from step to step
    """

    fields: tuple[Field, ...] = ()

    def __init__(
        self, fluid: FluidSolver, kernel: FilterKernel, own: Sampled = nothing_of_its_own, sizes: bool = False
    ):
        self.fluid, self.kernel, self.own, self.sizes = fluid, kernel, own, sizes
        self.seen_solids: SeenSolids | None = None

    @classmethod
    def of_forces(cls, fluid: FluidSolver, kernel: FilterKernel, forces: Iterable[FluidForce]) -> FlowSampler:
        """Samples what the forces of a run need."""
        needs = list(forces)
        own = next((force.own for force in needs if force.own is not None), nothing_of_its_own)
        return cls(fluid, kernel, own, any(force.needs_sizes for force in needs))

    def deposited(self, particles: Particles, cell_map: ParticleCellMap) -> Deposited:
        """What `sample` needs of the cells."""
        return Deposited(self.kernel.solid_fraction(cell_map))

    def sample(self, particles: Particles, cell_map: ParticleCellMap, cells: Deposited, mean: Array) -> SampledFlow:
        """The flow around every particle now.

        cells  as deposited, of the positions in `cell_map`
        mean   solid fraction of the cells in the middle of the step, which particles see (nz, ny, nx) [-]
        """
        gathered, solid = self._gathered(cell_map, mean), cells.solid
        if self.kernel.unequal:
            gathered[:, 3] *= self._seen_over_gathered(cell_map, solid)
        own = self.own(particles, cell_map)
        slip, disturbance = np.empty((2, particles.count, 3))
        voidage, reynolds, others = np.empty((3, particles.count))
        spheres = cell_map.volume, particles.radius, particles.velocity, particles.viscosity
        _sample(gathered, spheres, own, self.fluid.density, (slip, disturbance, voidage, reynolds, others))
        ratio = self._diameter_ratio(particles, cell_map, solid)
        return SampledFlow(slip, disturbance, voidage, reynolds, others, ratio)

    def remember(self, particles: Particles, flow: SampledFlow) -> None:
        """Store in `fields` what the next step needs of this one."""

    def _gathered(self, cell_map: ParticleCellMap, solid: Array) -> Array:
        """Mean velocity of the fluid and solid fraction around every particle (N, 4) [m/s], [-]."""
        velocity = np.moveaxis(self.fluid.velocity, -1, 0)
        return self.kernel.sample(cell_map.stencil, cell_map.radius, velocity, solid[None])

    def _seen_over_gathered(self, cell_map: ParticleCellMap, solid: Array) -> Array:
        """Solid fraction with the kernel of each particle for all particles around it, over that of the cells (N,) [-].

        The cells have each particle with its own kernel: beside large particles, small ones would see these smeared.
        """
        kernel = self.kernel
        deposited = kernel.deposit(cell_map, cell_map.volume[:, None]) / kernel.grid.cell_volume
        around = kernel.sample(cell_map.stencil, cell_map.radius, deposited, solid[None])
        return np.asarray(around[:, 0] / np.maximum(around[:, 1], 1e-300))

    def _diameter_ratio(self, particles: Particles, cell_map: ParticleCellMap, solid: Array) -> Array:
        """Diameter of every particle over the Sauter mean around it (N,) [-]; 1 unless sizes are sampled.

        The Sauter mean is the volume of the particles around, over the sum of their volumes divided by diameters.
        """
        if not self.sizes:
            return np.ones(particles.count)
        kernel, diameter, volume = self.kernel, 2.0 * particles.radius, cell_map.volume
        if kernel.unequal:
            deposited = kernel.deposit(cell_map, np.stack([volume, volume / diameter], axis=1))
            around = kernel.sample(cell_map.stencil, cell_map.radius, deposited)
        else:
            surface = kernel.spread(cell_map, (volume / diameter)[:, None]) / kernel.grid.cell_volume
            around = kernel.gather(cell_map.stencil, np.concatenate([solid[None], surface]))
        ratio: Array = diameter * around[:, 1] / around[:, 0]
        return ratio


@threaded
def _sample(gathered, spheres, own, density, flow):
    """Write slip, self-disturbance, voidage, Reynolds number and number of others, without the particle's own part.

    gathered  mean velocity of the fluid and solid fraction around each (N, 4) [m/s], [-]
    spheres   volume, radius, velocity and viscosity
    own       `Own`; solid fractions of zero switch the correction off
    """
    for n in prange(len(gathered)):
        _find_undisturbed(n, gathered, spheres, own, density, flow)


@inline
def _find_undisturbed(n, gathered, spheres, own, density, flow):
    """`_sample` of one particle."""
    volume, radius, velocity, viscosity = spheres
    slip, disturbance, voidage, reynolds, others = flow
    solid, alone = gathered[n, 3], own.solid[n]
    share = min(max(alone / max(solid, 1e-300), 0.0), 1.0)
    others[n] = max(solid - alone, 0.0) / volume[n]
    voidage[n] = 1.0 - max(solid - share * alone, 0.0)
    square = 0.0
    for d in range(3):
        disturbed = 0.0
        for k in range(own.modes.shape[1]):
            disturbed += own.modes[n, k, d]
        disturbance[n, d] = share * disturbed
        slip[n, d] = gathered[n, d] - disturbance[n, d] - velocity[n, d]
        square += slip[n, d] * slip[n, d]
    reynolds[n] = density * 2.0 * radius[n] * voidage[n] * math.sqrt(square) / max(viscosity[n], 1e-300)


# ---------------------------------------------------------------- gradient of the velocity


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


# ---------------------------------------------------------------- with sharp surfaces


SEEN = Field("seen_solids", "1", 0, "memory", np.nan, meaning="solid fraction that the particle saw in the last step")
"""Without its own part. NaN in inserted particles."""


class SharpFlowSampler(FlowSampler):
    """As `FlowSampler`, with sharp surfaces of beds."""

    fields = (SEEN,)

    def __init__(
        self, fluid: FluidSolver, kernel: FilterKernel, own: Sampled = nothing_of_its_own, sizes: bool = False
    ) -> None:
        super().__init__(fluid, kernel, own, sizes)
        self.seen_solids = SeenSolids(kernel)

    def deposited(self, particles: Particles, cell_map: ParticleCellMap) -> Deposited:
        """See `FlowSampler.deposited`; both in one pass."""
        kernel, cell = self.kernel, self.kernel.grid.cell_volume
        values = np.column_stack([cell_map.volume, particles.velocity])
        for momentum in values.T[1:]:
            momentum *= cell_map.volume
        fields = kernel.spread(cell_map, values, np.array([1.0, cell, cell, cell]))
        return Deposited(fields[0] / cell, fields[1:])

    def sample(self, particles: Particles, cell_map: ParticleCellMap, cells: Deposited, mean: Array) -> SampledFlow:
        """See `FlowSampler.sample`."""
        assert self.seen_solids is not None
        solids = _Solids(self.seen_solids.around(cell_map), self.seen_solids.change, particles[SEEN.name])
        gathered = self._means(cell_map, mean, cells.momentum)
        own = self.own(particles, cell_map)
        (slip, unseen), ratio = (
            np.empty((2, particles.count, 3)),
            self._diameter_ratio(particles, cell_map, cells.solid),
        )
        voidage, reynolds, others, narrowing, of_others, company = np.empty((6, particles.count))
        flow = SampledFlow(slip, unseen, voidage, reynolds, others, ratio, narrowing, of_others, company)
        spheres = _Spheres(cell_map.volume, particles.radius, particles.velocity, particles.viscosity)
        _sample_sharp(gathered, solids, spheres, own, self.fluid.density, flow)
        return flow

    def remember(self, particles: Particles, flow: SampledFlow) -> None:
        """Store the solid fraction seen at the end of the step."""
        particles[SEEN.name][:] = flow.solid

    def _means(self, cell_map: ParticleCellMap, solid: Array, momentum: Array) -> Array:
        """Means of the cells around every particle: velocity of the fluid, solid fraction, solid fraction times
        velocity of the fluid, and of the particles (N, 10) [m/s], [-], [m/s], [m/s]."""
        velocity = np.moveaxis(self.fluid.velocity, -1, 0)
        fields = np.concatenate([velocity, solid[None], solid * velocity, momentum])
        return self.kernel.sample(cell_map.stencil, cell_map.radius, fields)


class _Spheres(NamedTuple):
    """What the loop needs of the particles."""

    volume: Array
    radius: Array
    velocity: Array
    viscosity: Array


class _Solids(NamedTuple):
    """The solids that every particle sees, see `SeenSolids`."""

    around: Array  # solid fraction at the end of the step (N,) [-]
    change: Array  # of the solid fraction (N, 3)
    last: Array  # solid fraction of the others in the last step, or NaN (N,) [-]


@inline
def _share_of_surface(change, gathered):
    """Share of what a particle sees of the suspension that it belongs to: 1 but at a surface that opens into a fan.

    change    of the solid fraction, see `SeenSolids`
    gathered  of `SharpFlowSampler._means`
    """
    along, square = 0.0, 0.0
    for d in range(3):
        slip = gathered[d] - gathered[7 + d] / max(gathered[3], 1e-300)
        along += change[d] * slip
        square += slip * slip
    return math.exp(-along * along / square) if along > 0.0 else 1.0


@inline
def _sample_one(n, gathered, solids, spheres, own, density, flow):
    """See `_sample_sharp`."""
    around, last = solids.around[n], solids.last[n]
    cells = gathered[n, 3]
    share = min(max(own.solid[n] / max(cells, 1e-300), 0.0), 1.0)
    of_others = max(cells - share * own.solid[n], 0.0)
    flow.company[n] = of_others / max(cells, 1e-300)
    own_share = min(max(own.solid_seen[n] / max(around, 1e-300), 0.0), 1.0)
    solid = max(around - own_share * own.solid_seen[n], 0.0)
    belongs = _share_of_surface(solids.change[n], gathered[n])
    mean_solid = solid if math.isnan(last) else 0.5 * (solid + last)
    voidage = 1.0 - (belongs * mean_solid + (1.0 - belongs) * of_others)
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
    flow.others[n] = max(around - own.solid_seen[n], 0.0) / spheres.volume[n]
    flow.solid[n], flow.voidage[n], flow.narrowing[n] = solid, voidage, narrowing
    scale = density * 2.0 * spheres.radius[n] / max(spheres.viscosity[n], 1e-300)
    flow.reynolds[n] = scale * voidage * math.sqrt(square)


@threaded
def _sample_sharp(gathered, solids, spheres, own, density, flow):
    """The flow around every particle, without its own part.

    gathered  of `SharpFlowSampler._means` (N, 10)
    own       zeros switch the correction off
    """
    for n in prange(len(gathered)):
        _sample_one(n, gathered, solids, spheres, own, density, flow)
