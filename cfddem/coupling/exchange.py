"""Nusselt number of every particle by the law of a run; with the Schmidt number it is the Sherwood number."""

from __future__ import annotations

import math

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import prange, threaded
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import Slot, adapted, specialise
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.fluid.grid import Array
from closures.kinds import HEAT_ARGUMENTS
from closures.registry import Law

exchange_number = Slot("exchange_number")


class ExchangeLaw:
    """Evaluates a law of heat transfer for all particles.

    outside  how often it was evaluated outside its range, on this rank
    """

    def __init__(self, law: Law) -> None:
        self.law, self.outside = law, 0
        number = adapted(law.function, ", ".join(HEAT_ARGUMENTS), {name: name for name in HEAT_ARGUMENTS})
        self._loop = specialise(_numbers, {"exchange_number": number})
        self._ranges = np.array([law.ranges.get(name, (-math.inf, math.inf)) for name in HEAT_ARGUMENTS])

    def numbers(self, flow: SampledFlow, prandtl: Array) -> Array:
        """Nusselt number of every particle (N,) [-].

        prandtl  Prandtl number of the fluid around each, or Schmidt number (N,) [-]
        """
        numbers = np.empty(len(flow.reynolds))
        outside, wrong = self._loop(flow.reynolds, prandtl, flow.voidage, self._ranges, numbers)
        self.outside += int(outside)
        if wrong and np.isfinite(flow.reynolds).all():  # local: every rank has its own particles
            n = int(np.argmin(np.isfinite(numbers) & (numbers >= 0.0)))  # local: the first on this rank
            at = f"it is {numbers[n]:.3g} at Re = {flow.reynolds[n]:.3g}, voidage = {flow.voidage[n]:.3g}"
            raise InputError("laws.heat_transfer", self.law.name, "a law that is finite and not negative", at)
        return numbers


@threaded
def _numbers(reynolds, prandtl, voidage, ranges, numbers):
    """Number of every particle; returns how many states are outside the range, how many numbers negative or NaN."""
    outside = wrong = 0
    for n in prange(len(reynolds)):
        number = exchange_number(reynolds[n], prandtl[n], voidage[n])
        numbers[n] = number
        beyond = reynolds[n] < ranges[0, 0] or reynolds[n] > ranges[0, 1]
        beyond = beyond or prandtl[n] < ranges[1, 0] or prandtl[n] > ranges[1, 1]
        outside += 1 if beyond or voidage[n] < ranges[2, 0] or voidage[n] > ranges[2, 1] else 0
        wrong += 0 if number >= 0.0 and number < math.inf else 1
    return outside, wrong
