r"""Agitation: the fluctuating force on each particle from the disturbed flow around its neighbours.

**Pseudo-turbulence.** Each particle sees the mean velocity of the fluid plus a fluctuation :math:`u''` with the
covariance of :func:`closures.agitation.pseudo_turbulence`, along and across the mean slip :math:`w`:

.. math:: F'' = a_d\,b\,u'' + a_i\,\frac{m'\,(1 + C)\,m_f}{m + C m_f}\,\frac{du''}{dt}

The first part is the drag of the fluctuation and goes through the implicit transfer; the second is the response of a
body to the acceleration of the fluid around it (m' the inertia of the particle in the run, m its mass, m_f the mass of
the displaced fluid, C the added-mass coefficient of the run or, without one, Zuber's).

**Fluctuating force** after Lattanzi et al. (2022): :math:`dF'' = -F''\,dt/\tau_F + \sigma_F\sqrt{2/\tau_F}\,dW`.

Both are random processes of each particle, drawn by seed, particle and step (:mod:`cfddem.backend.counter_random`).
The mean over the neighbourhood, weighted by volume, is subtracted, so that spheres of one size drive no mean flow; in a
mixture a small mean drag remains. The fluid receives the opposite of every force. Without slip there is no agitation.

Limits: the laws were fitted to fixed spheres at solid fractions of 0.1 to 0.4 and Re_m up to 300. The part a_i is a
free number (0.4 by default), not yet measured in resolved simulations.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, prange, threaded
from cfddem.backend.counter_random import normal_numbers
from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.data.fields import Field
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.particles.state import Particles
from closures.added_mass import zuber
from closures.agitation import anisotropy, force_deviation, force_rate, pseudo_turbulence

SHORT = 0.2
"""Shorter of the two times of the process, over their sum. The process has a finite derivative because of it."""

PROCESS = Field(
    "agitation_process", "1", 6, "memory", np.nan, meaning="random process of agitation and its scaled derivative"
)
"""NaN in inserted particles: their process starts in its stationary state."""

FLUCTUATION = Field(
    "fluid_fluctuation", "m/s", 3, "memory", meaning="fluctuation of the fluid velocity at the particle"
)
FORCE_PROCESS = Field(
    "agitation_force_process", "1", 3, "memory", np.nan, meaning="random process of the fluctuating force"
)


class Neighbourhood(NamedTuple):
    """The surroundings of the particles in one fluid step."""

    cell_map: ParticleCellMap
    flow: SampledFlow
    mean_slip: Array  # mean over the neighbourhood, weighted by volume (N, 3) [m/s]
    solid: Array  # solid fraction of the cells (nz, ny, nx)


class AgitationTerms(NamedTuple):
    """What agitation adds to one fluid step."""

    velocity: Array  # fluctuation of the fluid velocity in the drag (N, 3) [m/s]
    force: Array  # explicit force on every particle, its opposite on the fluid (N, 3) [N]


class PseudoTurbulence:
    """Fluctuation of the fluid velocity that each particle sees.

    fluid, kernel   of the run
    seed            of the random numbers
    added_mass      coefficient C of the run; 0 takes Zuber's in the response to du''/dt
    drag_share      a_d, part of the fluctuation that enters the drag [-]
    inertia_share   a_i, part of the response to du''/dt, an average over eddies as small as a particle [-]
    time_share      correlation time over d / w [-]
    """

    fields = (PROCESS, FLUCTUATION)

    def __init__(
        self,
        fluid: FluidSolver,
        kernel: FilterKernel,
        seed: int,
        added_mass: float = 0.0,
        *,
        drag_share: float = 1.0,
        inertia_share: float = 0.4,
        time_share: float = 1.0,
    ) -> None:
        self.fluid, self.kernel, self.seed, self.added_mass = fluid, kernel, seed, added_mass
        self.drag_share, self.inertia_share, self.time_share = drag_share, inertia_share, time_share
        self.steps = 0

    def terms(self, particles: Particles, around: Neighbourhood, step: float) -> AgitationTerms:
        """Fluctuation and force in the coming fluid step [s]."""
        cell_map, flow, mean_slip, solid = around
        density, fresh = self.fluid.density, np.isnan(particles[PROCESS.name][:, 0])
        seen = np.empty((particles.count, 3))
        _fluctuate(
            particles[PROCESS.name], particles.id, mean_slip, flow.voidage, particles.radius, particles.viscosity,
            density, self.time_share, step, self.seed, self.steps, seen,
        )  # fmt: skip
        seen -= neighbourhood_mean(self.kernel, cell_map, solid, seen)
        change = np.where(fresh[:, None], 0.0, seen - particles[FLUCTUATION.name])
        particles[FLUCTUATION.name][:] = seen
        force = np.empty_like(seen)
        _inertial_force(
            change, flow.voidage, particles.mass, density * cell_map.volume, particles.inverse_mass, self.added_mass,
            self.inertia_share / step, force,
        )  # fmt: skip
        self.steps += 1
        return AgitationTerms(self.drag_share * seen, force)


class FluctuatingForce:
    """Fluctuating force of Lattanzi et al. (2022).

    fluid, kernel  of the run
    seed           of the random numbers
    across         deviation of the force across the mean slip over that along it [-]
    """

    fields = (FORCE_PROCESS,)

    def __init__(self, fluid: FluidSolver, kernel: FilterKernel, seed: int, *, across: float = 0.6) -> None:
        self.fluid, self.kernel, self.seed, self.across, self.steps = fluid, kernel, seed, across, 0

    def terms(self, particles: Particles, around: Neighbourhood, step: float) -> AgitationTerms:
        """Force in the coming fluid step [s]."""
        cell_map, flow, mean_slip, solid = around
        velocity = particles.velocity
        square = (velocity**2).sum(axis=1)  # local: components of a row
        mean = neighbourhood_mean(self.kernel, cell_map, solid, np.concatenate([velocity, square[:, None]], axis=1))
        speed = (mean[:, :3] ** 2).sum(axis=1)  # local: components of a row
        temperature, force = np.maximum(mean[:, 3] - speed, 0.0) / 3.0, np.empty_like(velocity)
        _fluctuate_force(
            particles[FORCE_PROCESS.name], particles.id, mean_slip, flow.voidage, temperature, particles.radius,
            particles.viscosity, self.fluid.density, self.across, step, self.seed, self.steps, force,
        )  # fmt: skip
        self.steps += 1
        force -= neighbourhood_mean(self.kernel, cell_map, solid, force)
        force[particles.inverse_mass == 0.0] = 0.0
        return AgitationTerms(np.zeros_like(force), force)


def neighbourhood_mean(kernel: FilterKernel, cell_map: ParticleCellMap, solid: Array, values: Array) -> Array:
    """Mean of values (N, m) over the particles around each one, weighted by volume and kernel (N, m)."""
    carried = np.ascontiguousarray(cell_map.volume[:, None] * values)
    fields = kernel.smooth(kernel.deposit(cell_map, carried)) / kernel.grid.cell_volume
    gathered = kernel.gather(cell_map.stencil, np.concatenate([fields, solid[None]]))
    mean: Array = gathered[:, :-1] / gathered[:, -1:]
    return mean


@inline
def _advanced(value, rate, long, short, step, first, second):
    """Exact update over a step of a stationary process of unit variance with two correlation times.

    The process obeys dx/dt = y / sqrt(t1 t2), dy/dt = -x / sqrt(t1 t2) - (1/t1 + 1/t2) y + white noise.

    value, rate    x and y
    long, short    t1 > t2 [s]
    first, second  independent standard normal numbers
    """
    decay_long, decay_short = math.exp(-step / long), math.exp(-step / short)
    spread = 1.0 / (long - short)
    keep = (long * decay_long - short * decay_short) * spread
    mix = math.sqrt(long * short) * (decay_long - decay_short) * spread
    rate_keep = (long * decay_short - short * decay_long) * spread
    variance = max(1.0 - keep * keep - mix * mix, 0.0)
    covariance = mix * (keep - rate_keep)
    rate_variance = max(1.0 - mix * mix - rate_keep * rate_keep, 0.0)
    deviation = math.sqrt(variance)
    shared = covariance / deviation if deviation > 0.0 else 0.0
    rest = math.sqrt(max(rate_variance - shared * shared, 0.0))
    return (
        keep * value + mix * rate + deviation * first,
        -mix * value + rate_keep * rate + shared * first + rest * second,
    )


@inline
def _slip_numbers(slip, n, voidage, radius, viscosity, density):
    """Size of the mean slip, its direction, and its Reynolds number."""
    size = math.sqrt(slip[n, 0] ** 2 + slip[n, 1] ** 2 + slip[n, 2] ** 2)
    inverse = 1.0 / max(size, 1e-300)
    direction = (slip[n, 0] * inverse, slip[n, 1] * inverse, slip[n, 2] * inverse)
    return size, direction, voidage[n] * density * size * 2.0 * radius[n] / max(viscosity[n], 1e-300)


@threaded
def _fluctuate(process, names, slip, voidage, radius, viscosity, density, time_share, step, seed, number, seen):
    """Advance the process of every particle and give it the covariance of pseudo-turbulence."""
    for n in prange(len(names)):
        a, b, c, d = normal_numbers(seed, names[n], number, 0)
        e, f, _, _ = normal_numbers(seed, names[n], number, 1)
        size, direction, reynolds = _slip_numbers(slip, n, voidage, radius, viscosity, density)
        if math.isnan(process[n, 0]):
            process[n, 0], process[n, 1], process[n, 2] = a, b, c
            process[n, 3], process[n, 4], process[n, 5] = d, e, f
        elif size > 0.0:
            time = time_share * 2.0 * radius[n] / size
            long, short = (1.0 - SHORT) * time, SHORT * time
            process[n, 0], process[n, 3] = _advanced(process[n, 0], process[n, 3], long, short, step, a, b)
            process[n, 1], process[n, 4] = _advanced(process[n, 1], process[n, 4], long, short, step, c, d)
            process[n, 2], process[n, 5] = _advanced(process[n, 2], process[n, 5], long, short, step, e, f)
        solid = 1.0 - voidage[n]
        energy = 0.5 * size * size * pseudo_turbulence(solid, reynolds)
        uneven = anisotropy(solid, reynolds)
        along = math.sqrt(2.0 * energy * (uneven + 1.0 / 3.0))
        across = math.sqrt(2.0 * energy * (1.0 / 3.0 - 0.5 * uneven))
        part = process[n, 0] * direction[0] + process[n, 1] * direction[1] + process[n, 2] * direction[2]
        for k in range(3):
            seen[n, k] = across * process[n, k] + (along - across) * part * direction[k]


@threaded
def _inertial_force(change, voidage, mass, displaced, inverse_mass, added_mass, share, force):
    """Response of every particle to the acceleration of the fluctuation (N, 3) [N]."""
    for n in prange(len(mass)):
        coefficient = added_mass if added_mass > 0.0 else zuber(voidage[n])
        factor = (1.0 + coefficient) * displaced[n] / (mass[n] + coefficient * displaced[n])
        inertia = 1.0 / inverse_mass[n] if inverse_mass[n] > 0.0 else 0.0
        for k in range(3):
            force[n, k] = share * inertia * factor * change[n, k]


@threaded
def _fluctuate_force(
    process, names, slip, voidage, temperature, radius, viscosity, density, across, step, seed, number, force
):
    """Advance the process of every particle, exactly for a constant rate, and give it the deviation of the force."""
    for n in prange(len(names)):
        a, b, c, _ = normal_numbers(seed, names[n], number, 0)
        size, direction, reynolds = _slip_numbers(slip, n, voidage, radius, viscosity, density)
        solid, diameter = 1.0 - voidage[n], 2.0 * radius[n]
        kept = 0.0
        if not math.isnan(process[n, 0]):
            kept = math.exp(-step * force_rate(solid, diameter, temperature[n]))
        else:
            process[n, 0], process[n, 1], process[n, 2] = 0.0, 0.0, 0.0
        new = math.sqrt(1.0 - kept * kept)
        process[n, 0] = kept * process[n, 0] + new * a
        process[n, 1] = kept * process[n, 1] + new * b
        process[n, 2] = kept * process[n, 2] + new * c
        alone = 3.0 * math.pi * viscosity[n] * diameter * (1.0 + 0.15 * reynolds**0.687) * voidage[n] * size
        deviation = force_deviation(solid) * alone
        part = process[n, 0] * direction[0] + process[n, 1] * direction[1] + process[n, 2] * direction[2]
        for k in range(3):
            force[n, k] = deviation * (across * process[n, k] + (1.0 - across) * part * direction[k])
