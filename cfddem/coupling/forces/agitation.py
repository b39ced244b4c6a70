r"""Agitation: the fluctuating force on each particle from the disturbed flow around its neighbours.

**Fluctuating velocity.** Each particle sees the mean velocity of the fluid plus a fluctuation :math:`u''`. A law of the
kind `agitation`, such as :func:`closures.agitation.pseudo_turbulence`, gives its variance along and across the mean
slip :math:`w`. The force is

.. math:: F'' = b\,\mathsf a_d u'' + a_i\,\frac{m'\,(1 + C)\,m_f}{m + C m_f}\,\frac{du''}{dt}

The first part is the drag of the fluctuation and goes through the implicit transfer; :math:`\mathsf a_d` has one value
along and one across the mean slip. The second is the response of a body to the acceleration of the fluid around
it. Here m' is the inertia of the particle in the run, m its mass, and m_f the mass of the displaced fluid. C is the
coefficient of the run's added mass or, without added mass, Zuber's. u'' is not part of the velocity whose change drives
the added-mass force of the run, so that no acceleration is counted twice.

**Fluctuating force** after Lattanzi et al. (2022): :math:`dF'' = -F''\,dt/\tau_F + \sigma_F\sqrt{2/\tau_F}\,dW`.

Both are random processes of each particle, drawn by seed, particle and step (:mod:`cfddem.backend.counter_random`).
The mean over the neighbourhood is subtracted (:func:`cfddem.coupling.forces.agitation.without_mean`), so that the
sum of the fluctuating forces is zero, for any mixture. A lone particle is its own neighbourhood and feels no agitation.
The fluid receives the opposite of every force. Without slip there is no agitation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, prange, threaded
from cfddem.backend.counter_random import normal_numbers
from cfddem.backend.law_set import Slot, bind_arguments, specialise
from cfddem.coupling.forces.added_mass import AddedMass
from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.coupling.sampled_flow import SampledFlow, Seen
from cfddem.coupling.terms import CouplingTerms
from cfddem.fluid.grid import Array
from cfddem.fluid.solver import FluidSolver
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.state import Particles
from closures.agitation import SHORT, AgitationFactors, force_deviation, force_rate, isolated_drag_factor
from closures.kinds import AGITATION_ARGUMENTS
from closures.registry import Law, law_of


class Neighbourhood(NamedTuple):
    """The surroundings of the particles in one fluid step."""

    cell_map: ParticleCellMap
    flow: SampledFlow
    mean_slip: Array  # mean over the neighbourhood, weighted by volume (N, 3) [m/s]
    conductance: Array  # drag over slip (N,) [kg/s]
    solid: Array  # solid fraction of the cells (nz, ny, nx)


class Draws(NamedTuple):
    """What the random numbers of a step follow from."""

    names: Array  # ids of the particles (N,)
    seed: int
    step: int  # number of the step


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
    kept = ("steps",)  # from which random numbers follow

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
        agitation = self.terms(terms.particles, around, terms.step)
        terms.fluctuate("drag", share.reshape(-1, 1) * agitation.velocity)
        if self.pushes:
            terms.between("agitation", agitation.force)

    def terms(self, particles: Particles, around: Neighbourhood, step: float) -> AgitationTerms:
        """What a model adds to the coming fluid step [s]."""
        raise NotImplementedError

    def _draws(self, particles: Particles) -> Draws:
        """What the random numbers of the step follow from; the next step has others."""
        self.steps += 1
        return Draws(particles.id, self.seed, self.steps - 1)

    def _seen(self, particles: Particles, around: Neighbourhood) -> Seen:
        """The fluid around the particles, with the mean slip."""
        return Seen(
            around.mean_slip, around.flow.voidage, particles.radius, particles.viscosity, float(self.fluid.density)
        )


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


# ---------------------------------------------------------------- two models

PROCESS = Field(
    "agitation_process", "1", 6, "memory", np.nan, meaning="random process of agitation and its scaled derivative"
)
"""NaN in inserted particles: their process starts in its stationary state."""

FLUCTUATION = Field(
    "fluid_fluctuation", "m/s", 3, "memory", np.nan, meaning="fluctuation of the fluid velocity at the particle"
)
FORCE_PROCESS = Field(
    "agitation_force_process", "1", 3, "memory", np.nan, meaning="random process of the fluctuating force"
)

variance = Slot("variance")


class PseudoTurbulence(Agitation):
    """Fluctuation of the fluid velocity that each particle sees.

    fluid, kernel      of the run
    seed               of the random numbers
    law                variance of the fluctuation over the square of the mean slip, of the kind `agitation`
    added_mass         whose coefficient the response to du''/dt takes
    factors            of the fluctuation in the drag, of the response to du''/dt, and of the correlation time

    outside  how often the law was evaluated outside its range
    """

    def __init__(
        self,
        fluid: FluidSolver,
        kernel: FilterKernel,
        seed: int,
        law: Law,
        *,
        added_mass: AddedMass,
        factors: AgitationFactors,
    ) -> None:
        super().__init__(fluid, kernel, seed)
        self.factors, self.pushes = factors, factors.inertia > 0.0
        self.fields = (PROCESS, FLUCTUATION) if self.pushes else (PROCESS,)
        self.added_mass = added_mass
        called = bind_arguments(
            law.function, ", ".join(AGITATION_ARGUMENTS), {name: name for name in AGITATION_ARGUMENTS}
        )
        self._loop = specialise(_fluctuate, {"variance": called})
        self._ranges = np.array([law.ranges.get(name, (-math.inf, math.inf)) for name in AGITATION_ARGUMENTS])

    def terms(self, particles: Particles, around: Neighbourhood, step: float) -> AgitationTerms:
        """Fluctuation and force in the coming fluid step [s]."""
        fluctuation = np.empty((2, particles.count, 3))  # in the drag, and without the factors of the drag
        self.outside += int(
            self._loop(
                particles[PROCESS.name], self._draws(particles), self._seen(particles, around),
                particles.density / self.fluid.density, self.factors, step, self._ranges, fluctuation,
            )
        )  # fmt: skip
        velocity = without_mean(self.kernel, around.cell_map, around.conductance, fluctuation[0])
        return AgitationTerms(velocity, self._inertial_force(particles, around, fluctuation[1], step))

    def _inertial_force(self, particles: Particles, around: Neighbourhood, velocity: Array, step: float) -> Array:
        """Response of every particle to the acceleration of the fluctuation (N, 3) [N]."""
        if not self.pushes:
            return np.zeros_like(velocity)
        change = velocity - particles[FLUCTUATION.name]
        change[np.isnan(change)] = 0.0  # of inserted particles
        particles[FLUCTUATION.name][:] = velocity
        mass, displaced = particles.mass, self.fluid.density * around.cell_map.volume
        coefficient = self.added_mass.coefficient(around.flow.voidage)
        with np.errstate(divide="ignore"):
            free = np.where(particles.inverse_mass > 0.0, 1.0 / particles.inverse_mass, 0.0)
        inertia = free * (1.0 + coefficient) * displaced / (mass + coefficient * displaced)
        force: Array = self.factors.inertia / step * inertia[:, None]
        return force * without_mean(self.kernel, around.cell_map, inertia, change)


class FluctuatingForce(Agitation):
    """Fluctuating force of Lattanzi et al. (2022).

    fluid, kernel  of the run
    seed           of the random numbers
    factors        of the deviation of the force along and across the mean slip, and of the correlation time

    outside  how often the law was evaluated outside its range
    """

    fields = (FORCE_PROCESS,)

    def __init__(self, fluid: FluidSolver, kernel: FilterKernel, seed: int, factors: AgitationFactors) -> None:
        super().__init__(fluid, kernel, seed)
        self.factors = factors
        self._range = law_of(force_deviation).ranges["solid_fraction"]

    def terms(self, particles: Particles, around: Neighbourhood, step: float) -> AgitationTerms:
        """Force in the coming fluid step [s]."""
        volume, velocity = around.cell_map.volume, particles.velocity
        square = (velocity**2).sum(axis=1)  # local: components of a row
        moments = np.concatenate([velocity, square[:, None]], axis=1)
        mean = neighbourhood_mean(self.kernel, around.cell_map, around.solid, moments)
        speed = (mean[:, :3] ** 2).sum(axis=1)  # local: components of a row
        temperature, force = np.maximum(mean[:, 3] - speed, 0.0) / 3.0, np.empty_like(velocity)
        self.outside += int(
            _fluctuate_force(
                particles[FORCE_PROCESS.name], self._draws(particles), self._seen(particles, around), temperature,
                self.factors, step / self.factors.time, self._range, force,
            )
        )  # fmt: skip
        free = volume * (particles.inverse_mass > 0.0)  # fixed particles get no force and are left out of the mean
        acceleration = without_mean(self.kernel, around.cell_map, free, force / volume[:, None])
        return AgitationTerms(np.zeros_like(force), free[:, None] * acceleration)


@inline
def _transition(long, short, step):
    """Coefficients of `_advanced` for the correlation times t1 > t2 and the step [s]."""
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
    return keep, mix, rate_keep, deviation, shared, rest


@inline
def _advanced(value, rate, transition, first, second):
    """Exact update over a step of a stationary process of unit variance with two correlation times.

    The process obeys dx/dt = y / sqrt(t1 t2), dy/dt = -x / sqrt(t1 t2) - (1/t1 + 1/t2) y + white noise.

    value, rate    x and y
    transition     of `_transition`
    first, second  independent standard normal numbers
    """
    keep, mix, rate_keep, deviation, shared, rest = transition
    return (
        keep * value + mix * rate + deviation * first,
        -mix * value + rate_keep * rate + shared * first + rest * second,
    )


@inline
def _slip_numbers(around, n):
    """Size of the mean slip, its direction, and its Reynolds number."""
    slip, voidage, radius, viscosity, density = around
    size = math.sqrt(slip[n, 0] ** 2 + slip[n, 1] ** 2 + slip[n, 2] ** 2)
    inverse = 1.0 / max(size, 1e-300)
    direction = (slip[n, 0] * inverse, slip[n, 1] * inverse, slip[n, 2] * inverse)
    return size, direction, voidage[n] * density * size * 2.0 * radius[n] / max(viscosity[n], 1e-300)


@inline
def _along(process, n, direction):
    """Component of a process along the mean slip."""
    return process[n, 0] * direction[0] + process[n, 1] * direction[1] + process[n, 2] * direction[2]


@threaded
def _fluctuate(process, draws, around, ratio, factors, step, ranges, fluctuation):
    """Advance the process of every particle and give it the variance of the law; returns how many are out of range.

    ratio        density of the particle over that of the fluid
    ranges       of the law, low and high of each argument (4, 2)
    fluctuation  with the factors of the drag, and without them (2, N, 3)
    """
    names, radius, voidage = draws.names, around.radius, around.voidage
    outside = 0
    for n in prange(len(names)):
        a, b, c, d = normal_numbers(draws.seed, names[n], draws.step, 0)
        e, f, _, _ = normal_numbers(draws.seed, names[n], draws.step, 1)
        size, direction, reynolds = _slip_numbers(around, n)
        if math.isnan(process[n, 0]):
            process[n, 0], process[n, 1], process[n, 2] = a, b, c
            process[n, 3], process[n, 4], process[n, 5] = d, e, f
        elif size > 0.0:
            time = factors.time * 2.0 * radius[n] / size
            steps = _transition((1.0 - SHORT) * time, SHORT * time, step)
            process[n, 0], process[n, 3] = _advanced(process[n, 0], process[n, 3], steps, a, b)
            process[n, 1], process[n, 4] = _advanced(process[n, 1], process[n, 4], steps, c, d)
            process[n, 2], process[n, 5] = _advanced(process[n, 2], process[n, 5], steps, e, f)
        solid = 1.0 - voidage[n]
        along = size * math.sqrt(variance(solid, reynolds, 1.0, ratio[n]))
        across = size * math.sqrt(variance(solid, reynolds, 0.0, ratio[n]))
        part = _along(process, n, direction)
        for k in range(3):
            parallel = along * part * direction[k]
            normal = across * (process[n, k] - part * direction[k])
            fluctuation[0, n, k] = factors.along * parallel + factors.across * normal
            fluctuation[1, n, k] = parallel + normal
        beyond = solid < ranges[0, 0] or solid > ranges[0, 1] or reynolds < ranges[1, 0] or reynolds > ranges[1, 1]
        outside += 1 if beyond or ratio[n] < ranges[3, 0] or ratio[n] > ranges[3, 1] else 0
    return outside


@threaded
def _fluctuate_force(process, draws, around, temperature, factors, step, fitted, force):
    """Advance the process of every particle, exactly for a constant rate, and give it the deviation of the force.

    returns  how many are out of the range of solid fractions that the law is fitted to
    """
    names, voidage, viscosity = draws.names, around.voidage, around.viscosity
    outside = 0
    for n in prange(len(names)):
        a, b, c, _ = normal_numbers(draws.seed, names[n], draws.step, 0)
        size, direction, reynolds = _slip_numbers(around, n)
        solid, diameter = 1.0 - voidage[n], 2.0 * around.radius[n]
        kept = 0.0
        if not math.isnan(process[n, 0]):
            kept = math.exp(-step * force_rate(solid, diameter, temperature[n]))
        else:
            process[n, 0], process[n, 1], process[n, 2] = 0.0, 0.0, 0.0
        new = math.sqrt(1.0 - kept * kept)
        process[n, 0] = kept * process[n, 0] + new * a
        process[n, 1] = kept * process[n, 1] + new * b
        process[n, 2] = kept * process[n, 2] + new * c
        alone = 3.0 * math.pi * viscosity[n] * diameter * isolated_drag_factor(reynolds) * voidage[n] * size
        deviation = force_deviation(solid) * alone
        part = _along(process, n, direction)
        for k in range(3):
            normal = process[n, k] - part * direction[k]
            force[n, k] = deviation * (factors.along * part * direction[k] + factors.across * normal)
        outside += 1 if solid < fitted[0] or solid > fitted[1] else 0
    return outside
