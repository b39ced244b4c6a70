r"""History force: the memory of the flow around each particle of its earlier acceleration.

With the slip :math:`w = u - v` and a kernel :math:`K = A\,g(s/t_c)` of :mod:`closures.history`,

.. math:: F_h = 3\pi\eta d\int_{-\infty}^t K(t-\tau)\,\dot w\,d\tau

**Constant memory.** g is a sum of exponentials, :math:`g(x) = \sum_k a_k e^{-b_kx}`. Each has a mode, which decays and
grows with the change of the slip in every step (:mod:`cfddem.coupling.forces.history_modes`). Rates scale with t_c at
the present slip; for the kernel of Basset t_c is d^2/nu.

**One step.** The slip changes steadily in a step h. The mean force over the step is

.. math:: \bar F_h = B\,(w' - w) + \sum_k\ldots p_k,\qquad B = 3\pi\eta d\,A\,\frac{H(h/t_c)}{(h/t_c)^2}

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
from cfddem.backend.compile import inline
from cfddem.backend.law_set import specialise
from cfddem.coupling.forces import history_modes
from cfddem.coupling.forces.history_modes import Memory, columns, exponentials
from cfddem.coupling.sampled_flow import SampledFlow, Seen
from cfddem.coupling.terms import ForceTerms
from cfddem.data.fields import Field
from cfddem.fluid.grid import Array
from cfddem.model.feature import FluidForce
from cfddem.particles.state import Particles
from closures.history import (
    BASSET_AMPLITUDES,
    BASSET_MISSING,
    BASSET_SLOWEST,
    MEI_ADRIAN_AMPLITUDES,
    MEI_ADRIAN_MISSING,
    MEI_ADRIAN_SLOWEST,
    decay_time,
)

SLIP = Field(
    "history_slip", "m/s", 3, "memory", np.nan, meaning="fluid velocity less particle velocity in the last fluid step"
)
"""NaN in inserted particles, which have no memory yet."""

NEWEST = Field("history_impulse", "N s", 3, "memory", meaning="implicit part of the history force of the last step")


class HistoryTerms(NamedTuple):
    """History force in one fluid step."""

    conductance: Array  # of the implicit part, as a drag (N,) [kg/s]
    force: Array  # explicit part on every particle, its opposite on the fluid (N, 3) [N]
    factor: Array  # of the impulse of the implicit part (N,) [-]


def _room(count: int) -> HistoryTerms:
    """Arrays for the terms of so many particles."""
    return HistoryTerms(np.empty(count), np.empty((count, 3)), np.empty(count))


@inline
def _diffusion_time(slip, diameter, kinematic_viscosity):
    """Time in which vorticity diffuses over a diameter [s]."""
    return diameter * diameter / kinematic_viscosity


@inline
def _decay_time(slip, diameter, kinematic_viscosity):
    """t_c; infinite without slip [s]."""
    return decay_time(slip, diameter, kinematic_viscosity) if slip > 0.0 else math.inf


_KERNELS = {
    "basset": (exponentials(BASSET_AMPLITUDES, BASSET_SLOWEST, BASSET_MISSING), _diffusion_time),
    "mei_adrian": (exponentials(MEI_ADRIAN_AMPLITUDES, MEI_ADRIAN_SLOWEST, MEI_ADRIAN_MISSING), _decay_time),
}
"""The kernel, and its scale of time t_c."""


class History(FluidForce):
    """History force of the particles.

    kernel   "mei_adrian" or "basset"
    density  of the fluid [kg/m3]
    model    "A" or "B" of the fluid
    """

    name, lines, late = "history", ("history",), True

    def __init__(self, kernel: Literal["mei_adrian", "basset"], density: float, model: str = "A") -> None:
        self.density, self.model = density, model
        self._kernel, scale = _KERNELS[kernel]
        self._modes = Field(
            "history_modes", "m/s", columns(self._kernel), "memory", meaning="changes of the slip, as they fade"
        )
        self.fields = (SLIP, NEWEST, self._modes)
        self._terms = _room(0)
        self._advance = specialise(history_modes.advance, {"memory_time": scale})

    def act(self, terms: ForceTerms) -> None:
        """Resist the newest change of the slip; the memory of the others pushes."""
        history = self.terms(terms.particles, terms.flow, terms.resistance, terms.inertia, terms.step, terms.last_step)
        terms.resist("history", history.conductance)
        terms.between("history", history.force)

    def end(self, terms: ForceTerms) -> None:
        """Store the impulse of the implicit part."""
        self.store(terms.particles, terms.implicit_force["history"], self._terms, terms.step)

    def terms(
        self, particles: Particles, flow: SampledFlow, drag: Array, inertia: Array, step: float, last_step: float
    ) -> HistoryTerms:
        """History force in the coming fluid step [s].

        drag       conductance of the drag (N,) [kg/s]
        inertia    mass and added mass (N,); infinite for fixed particles [kg]
        last_step  0 at the start [s]
        returns    arrays that the next step overwrites
        """
        if len(self._terms.factor) != particles.count:
            self._terms = _room(particles.count)
        terms = self._terms
        voidage = flow.voidage if self.model == "B" else flow.voidage[:0]
        flow_seen = Seen(flow.slip, voidage, particles.radius, particles.viscosity, float(self.density))
        memory = Memory(particles[SLIP.name], particles[NEWEST.name], particles[self._modes.name], *terms)
        self._advance(flow_seen, drag, inertia, self._kernel, float(step), float(last_step), memory)
        return terms

    def store(self, particles: Particles, implicit: Array, terms: HistoryTerms, step: float) -> None:
        """Store the impulse that the implicit part has given.

        implicit  force of the conductance of the history on every particle (N, 3) [N]
        """
        newest, slip = particles[NEWEST.name], particles[SLIP.name]
        history_modes.store_impulse(newest, implicit, terms.conductance, terms.factor, slip, float(step))
