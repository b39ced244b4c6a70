r"""History force: the memory of the flow around each particle of its earlier acceleration.

With the slip :math:`w = u - v` and a kernel :math:`K = A\,g(s/t_c)` of :mod:`closures.history`,

.. math:: F_h = 3\pi\eta d\int_{-\infty}^t K(t-\tau)\,\dot w\,d\tau

**Constant memory.** g is a sum of exponentials, :math:`g(x) = \sum_k a_k e^{-b_kx}`. Each has a mode
:math:`q_k = \int e^{-b_k(t-\tau)/t_c}\,dw`, which decays and grows with the change of the slip in every step. Rates
scale with t_c at the present slip; for the kernel of Basset t_c is d^2/nu.

**One step.** The slip changes steadily in a step h. The mean force over the step is

.. math:: \bar F_h = B\,(w' - w) + \sum_k\ldots q_k,\qquad B = 3\pi\eta d\,A\,\frac{H(h/t_c)}{(h/t_c)^2}

with w' the slip at the end and H the second integral of g, exact for the step itself. The first part is implicit: it
joins the conductance of the drag (:mod:`cfddem.coupling.transfer`). A contact can change the velocity by more than the
implicit part predicts; the missing impulse is applied in the next step.

There is no kernel for suspensions in the literature: every particle has that of a single sphere in the flow around it.
A particle begins without memory where it is inserted.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import CHUNKS, inline, prange, threaded
from cfddem.backend.law_set import Slot, specialise
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.data.fields import Field
from cfddem.fluid.grid import Array
from cfddem.particles.state import Particles
from cfddem.particles.vectors import NOTHING, minus, plus, times
from closures.history import (
    BASSET_AMPLITUDES,
    BASSET_MISSING,
    BASSET_SLOWEST,
    MEI_ADRIAN_AMPLITUDES,
    MEI_ADRIAN_MISSING,
    MEI_ADRIAN_SLOWEST,
    RATE_RATIO,
    basset,
    decay_time,
)

SLIP = Field(
    "history_slip", "m/s", 3, "memory", np.nan, meaning="fluid velocity less particle velocity in the last fluid step"
)
"""NaN in inserted particles, which have no memory yet."""

NEWEST = Field("history_impulse", "N s", 3, "memory", meaning="implicit part of the history force of the last step")

SHORTEST = 1e-4
"""Step over t_c, at least: the exponentials hold from a hundredth of it on. A slower memory is cut to this."""

memory_time = Slot("memory_time")


class HistoryTerms(NamedTuple):
    """History force in one fluid step."""

    conductance: Array  # of the implicit part, as a drag (N,) [kg/s]
    force: Array  # explicit part on every particle, its opposite on the fluid (N, 3) [N]


@inline
def _diffusion_time(slip, diameter, kinematic_viscosity):
    """Time in which vorticity diffuses over a diameter [s]."""
    return diameter * diameter / kinematic_viscosity


@inline
def _decay_time(slip, diameter, kinematic_viscosity):
    """t_c; infinite without slip [s]."""
    return decay_time(slip, diameter, kinematic_viscosity) if slip > 0.0 else math.inf


class _Exponentials(NamedTuple):
    """Sum of exponentials of a kernel, as compiled loops take it; times are over t_c."""

    slowest: float  # rate
    inverse_rate: Array
    weight: Array  # amplitude over rate
    missing: float  # integral of the kernel that the exponentials lack near 0


def _exponentials(amplitudes: tuple[float, ...], slowest: float, missing: float) -> _Exponentials:
    rates = slowest * RATE_RATIO ** np.arange(len(amplitudes), dtype=float)
    return _Exponentials(slowest, 1.0 / rates, np.array(amplitudes) / rates, missing)


_KERNELS = {
    "basset": (_exponentials(BASSET_AMPLITUDES, BASSET_SLOWEST, BASSET_MISSING), _diffusion_time),
    "mei_adrian": (_exponentials(MEI_ADRIAN_AMPLITUDES, MEI_ADRIAN_SLOWEST, MEI_ADRIAN_MISSING), _decay_time),
}
"""The kernel, and its scale of time t_c."""


class History:
    """History force of the particles.

    kernel   "mei_adrian" or "basset"
    density  of the fluid [kg/m3]
    model    "A" or "B" of the fluid
    """

    def __init__(self, kernel: Literal["mei_adrian", "basset"], density: float, model: str = "A") -> None:
        self.density, self.model = density, model
        self._kernel, scale = _KERNELS[kernel]
        modes = 3 * len(self._kernel.weight)
        self._modes = Field("history_modes", "m/s", modes, "memory", meaning="changes of the slip, as they fade")
        self.fields = (SLIP, NEWEST, self._modes)
        self._loop = specialise(_remember, {"memory_time": scale})

    def terms(
        self, particles: Particles, flow: SampledFlow, drag: Array, inertia: Array, step: float, last_step: float
    ) -> HistoryTerms:
        """History force in the coming fluid step [s].

        drag       conductance of the drag (N,) [kg/s]
        inertia    mass and added mass (N,); infinite for fixed particles [kg]
        last_step  0 at the start [s]
        """
        scale = 1.0 / flow.voidage if self.model == "B" else np.ones(particles.count)
        terms = HistoryTerms(np.empty(particles.count), np.empty((particles.count, 3)))
        self._loop(
            particles[SLIP.name], particles[NEWEST.name], particles[self._modes.name], flow.slip, particles.radius,
            particles.viscosity, scale, self.density, drag, 1.0 / inertia, step, last_step, self._kernel, *terms,
        )  # fmt: skip
        particles[SLIP.name][:] = flow.slip
        return terms

    def store(self, particles: Particles, implicit: Array, terms: HistoryTerms, step: float) -> None:
        """Store the impulse that the implicit part has given.

        implicit  force of the conductance of the history on every particle (N, 3) [N]
        """
        given = implicit - terms.conductance[:, None] * particles[SLIP.name]
        particles[NEWEST.name][:] = step * given


@inline
def implicit_share(drag, growing):
    """Where in the step the implicit transfer takes the slip, 0 to 1, with a history force.

    The slip changes by the share theta of its whole change, so that the conductance of the history is growing/theta,
    and theta = (1 + x)/(2 + x) with x the stiffness of both.

    drag, growing  stiffness h b / m of the drag, and of the force per change of the slip in the whole step
    """
    linear = 1.0 + drag - growing
    return (linear + math.sqrt(linear * linear + 4.0 * growing * (2.0 + drag))) / (2.0 * (2.0 + drag))


@inline
def _vector(rows, n):
    return rows[n, 0], rows[n, 1], rows[n, 2]


@inline
def _put(rows, n, vector):
    rows[n, 0], rows[n, 1], rows[n, 2] = vector


@inline
def _faded(kernel, time, gone):
    """Share of each mode that fades in a time over t_c; returns the second integral of g over that time."""
    share, integral = -math.expm1(-kernel.slowest * time), 0.0
    for k in range(len(gone)):
        gone[k] = share
        integral += kernel.weight[k] * (time - share * kernel.inverse_rate[k])
        share = share * (3.0 - share * (3.0 - share))  # 1 - (1 - D)^3: each rate is 3 times the one before
    return integral + kernel.missing * time


@threaded
def _remember(
    before, newest, modes, slip, radius, viscosity, scale, density, drag, inverse_inertia, step, last_step, kernel,
    conductance, force,
):  # fmt: skip
    """Advance the modes of every particle over the last step, and find the force of the coming one."""
    count, number = len(kernel.weight), len(radius)
    for chunk in prange(CHUNKS):
        gone, gone_last = np.empty(count), np.empty(count)
        for n in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            diameter, kinematic = 2.0 * radius[n], max(viscosity[n], 1e-300) / density
            speed = math.sqrt(slip[n, 0] ** 2 + slip[n, 1] ** 2 + slip[n, 2] ** 2)
            memory = min(memory_time(speed, diameter, kinematic), step / SHORTEST)
            stokes = scale[n] * 3.0 * math.pi * viscosity[n] * diameter * basset(memory, speed, diameter, kinematic)
            now, last, known = step / memory, last_step / memory, last_step > 0.0 and not math.isnan(before[n, 0])
            grown = stokes / (now * now) * _faded(kernel, now, gone)
            grown_last = grown
            if step == last_step:
                gone_last[:] = gone
            elif known:
                grown_last = stokes / (last * last) * _faded(kernel, last, gone_last)
            share = implicit_share(step * inverse_inertia[n] * drag[n], step * inverse_inertia[n] * grown)
            conductance[n] = grown / share
            if not known:
                _put(force, n, times(-conductance[n], _vector(slip, n)))
                continue
            change = minus(_vector(slip, n), _vector(before, n))
            gain, remembered = times(1.0 / last, change), NOTHING
            for k in range(count):
                new = times(kernel.inverse_rate[k], gain)
                old = (modes[n, 3 * k], modes[n, 3 * k + 1], modes[n, 3 * k + 2])
                mode = plus(old, times(gone_last[k], minus(new, old)))
                modes[n, 3 * k], modes[n, 3 * k + 1], modes[n, 3 * k + 2] = mode
                remembered = plus(remembered, times(gone[k] * kernel.weight[k], mode))
            missing = minus(times(last_step * grown_last, change), _vector(newest, n))
            explicit = plus(times(stokes / now, remembered), times(1.0 / step, missing))
            _put(force, n, minus(explicit, times(conductance[n], _vector(slip, n))))
