r"""Drag of every particle, by the drag law of the run; with sharp surfaces also the pressure that goes with it.

**Drag in its total form.** The law gives :math:`b = 3\pi\eta d\,\varepsilon F`. Model A adds to :math:`b(u-v)` the
pressure gradient on the volume of the particle, and most of this gradient is the drag of the particles themselves.
Where it changes, at the surface of a bed, the cells smear it over both sides. So a particle takes that of its own drag,

.. math:: \frac{b}{\varepsilon}(u-v) - V\left(\nabla p' + \overline{f/\varepsilon}\right),\qquad
          f = \overline{\varepsilon_i D_i}/V_c

with D the first term. What the drag around has added to the pressure gradient is taken out of it again. In an even
suspension this is model A, and the fluid receives the opposite of b (u - v). With smeared surfaces the force is
:math:`b(u-v) - V\nabla p'`, in model B the first term.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from inspect import signature
from typing import Any

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import prange, threaded
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import Slot, adapted, specialise
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.coupling.terms import ForceTerms
from cfddem.data.fields import Field
from cfddem.fluid.grid import Array
from cfddem.model.feature import FluidForce
from cfddem.particles.state import Particles
from closures.kinds import DRAG_ARGUMENTS
from closures.registry import Law, law_of

OWED = Field("drag_momentum", "N s", 3, "memory", meaning="of drag and its pressure, not received by the fluid yet")

drag_factor = Slot("drag_factor")


class Drag(FluidForce):
    """Drag over slip of every particle.

    law    drag law, or its function
    model  "A" or "B" of the fluid
    sharp  the kernel of the run, for sharp surfaces of beds in model A; None for smeared ones. Of drag in its total
           form the fluid then receives b (u - v) in the step, and what is left a step later; in an even suspension
           nothing is left

    outside  how often the law was evaluated outside its range
    """

    name, lines = "drag", ("drag",)

    def __init__(self, law: Law | Callable[..., float], model: str = "A", sharp: FilterKernel | None = None) -> None:
        law = law if isinstance(law, Law) else law_of(law)
        self.law_name, self._kernel = law.name, sharp
        self.sharp, self._total = sharp is not None, model == "B" or sharp is not None
        self.fields = (OWED,) if self.sharp else ()
        self._alone = np.zeros(0)  # conductance of the drag law alone
        self.needs_sizes = "diameter_ratio" in signature(law.function).parameters
        factor = adapted(law.function, ", ".join(DRAG_ARGUMENTS), {name: name for name in DRAG_ARGUMENTS})
        self._loop = specialise(_conductances, {"drag_factor": factor})
        self._ranges = tuple(law.ranges.get(name, (0.0, math.inf)) for name in DRAG_ARGUMENTS)

    def act(self, terms: ForceTerms) -> None:
        """Resist the slip; withhold the share of the particle's own pressure gradient from the fluid, and give it what
        the last step has left."""
        conductance = self.conductance(terms.particles, terms.flow)
        terms.resist("drag", conductance)
        if self._kernel is not None:
            self._alone = conductance * terms.flow.narrowing
            terms.withhold((1.0 - terms.flow.voidage) * self._alone)
            terms.pull("drag", -terms.particles[OWED.name] / terms.step)

    def respond(self, terms: Any) -> None:
        """Take the drag around out of the pressure gradient of the cells, which contains it in this step."""
        if self._kernel is None:
            return
        kernel, flow = self._kernel, terms.flow
        slip = terms.implicit_force["drag"] / np.maximum(terms.conductance("drag"), 1e-300)[:, None]
        if "drag" in terms.fluctuations:
            slip = slip - terms.fluctuations["drag"]
        of_model_a = (flow.voidage * self._alone)[:, None] * slip
        density = kernel.smooth(kernel.deposit(terms.cell_map, of_model_a)) / kernel.grid.cell_volume
        gradient = kernel.gather(terms.cell_map.stencil, kernel.smooth(density / (1.0 - terms.solid)))
        around = -(terms.cell_map.volume * flow.company)[:, None] * gradient
        terms.push("drag", around)
        terms.particles[OWED.name][:] = terms.step * (terms.unsent + around)

    def conductance(self, particles: Particles, flow: SampledFlow) -> Array:
        r"""Drag over slip of every particle (N,) [kg/s]: :math:`3\pi\eta d\,\varepsilon F`; total form: over eps."""
        conductance = np.empty(particles.count)
        outside, wrong = self._loop(
            particles.viscosity, particles.radius, flow.reynolds, flow.voidage, flow.diameter_ratio, *self._ranges,
            self._total, conductance,
        )  # fmt: skip
        self.outside += int(outside)
        if wrong:
            share = 1.0 if self._total else flow.voidage
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
def _conductances(viscosity, radius, reynolds, voidage, ratio, numbers, voidages, ratios, total, conductance):
    """Drag over slip of every particle, in its `total` form or that of model A; returns how many flows are outside the
    range of the law, and how many numbers are negative or not finite."""
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
        conductance[n] *= 6.0 * math.pi * viscosity[n] * radius[n] * (1.0 if total else voidage[n])
    return outside, wrong
