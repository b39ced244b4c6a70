"""Drag of every particle, by the drag law of the run."""

from __future__ import annotations

import math
from collections.abc import Callable
from inspect import signature

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import prange, threaded
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import Slot, adapted, specialise
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.coupling.terms import ForceTerms
from cfddem.fluid.grid import Array
from cfddem.model.feature import FluidForce
from cfddem.particles.state import Particles
from closures.kinds import DRAG_ARGUMENTS
from closures.registry import Law, law_of

drag_factor = Slot("drag_factor")


class Drag(FluidForce):
    """Drag over slip of every particle.

    law    drag law, or its function
    model  "A" or "B" of the fluid

    outside  how often the law was evaluated outside its range
    """

    name, lines = "drag", ("drag",)

    def __init__(self, law: Law | Callable[..., float], model: str = "A") -> None:
        law = law if isinstance(law, Law) else law_of(law)
        self.law_name, self.model = law.name, model
        self.needs_sizes = "diameter_ratio" in signature(law.function).parameters
        factor = adapted(law.function, ", ".join(DRAG_ARGUMENTS), {name: name for name in DRAG_ARGUMENTS})
        self._loop = specialise(_conductances, {"drag_factor": factor})
        self._ranges = tuple(law.ranges.get(name, (0.0, math.inf)) for name in DRAG_ARGUMENTS)

    def act(self, terms: ForceTerms) -> None:
        """Resist the slip."""
        terms.resist("drag", self.conductance(terms.particles, terms.flow))

    def conductance(self, particles: Particles, flow: SampledFlow) -> Array:
        r"""Drag over slip of every particle (N,) [kg/s]: :math:`3\pi\eta d\,\varepsilon F`, in model B over eps."""
        conductance = np.empty(particles.count)
        outside, wrong = self._loop(
            particles.viscosity, particles.radius, flow.reynolds, flow.voidage, flow.diameter_ratio, *self._ranges,
            self.model == "B", conductance,
        )  # fmt: skip
        self.outside += int(outside)
        if wrong:
            share = 1.0 if self.model == "B" else flow.voidage
            self._require_drag(flow, conductance / (6.0 * math.pi * particles.viscosity * particles.radius * share))
        return conductance

    def _require_drag(self, flow: SampledFlow, factor: Array) -> None:
        """Refuse a law that pushes a particle against the flow or is not finite; a flow that is not finite is no fault
        of the law."""
        wrong = ~((factor >= 0.0) & (factor < np.inf)) & np.isfinite(flow.reynolds) & np.isfinite(flow.voidage)
        if wrong.any():  # local: every rank has its own particles
            n = int(np.argmax(wrong))  # local: the first on this rank
            at = f"it is {factor[n]:.3g} at Re = {flow.reynolds[n]:.3g}, voidage = {flow.voidage[n]:.3g}"
            raise InputError("laws.drag", self.law_name, "a law that is finite and not negative", at)


@threaded
def _conductances(viscosity, radius, reynolds, voidage, ratio, numbers, voidages, ratios, model_b, conductance):
    """Drag over slip of every particle; returns how many flows are outside the range of the law, and how many numbers
    are negative or not finite."""
    slowest, fastest = numbers
    densest, loosest = voidages
    smallest, largest = ratios
    outside = wrong = 0
    for n in prange(len(reynolds)):
        factor = drag_factor(reynolds[n], voidage[n], ratio[n])
        conductance[n] = factor
        beyond = reynolds[n] < slowest or reynolds[n] > fastest
        beyond = beyond or voidage[n] < densest or voidage[n] > loosest
        outside += 1 if beyond or ratio[n] < smallest or ratio[n] > largest else 0
        wrong += 0 if factor >= 0.0 and factor < math.inf else 1
    # In the same loop the compiler would evaluate all branches of a law.
    for n in prange(len(reynolds)):
        conductance[n] *= 6.0 * math.pi * viscosity[n] * radius[n] * (1.0 if model_b else voidage[n])
    return outside, wrong
