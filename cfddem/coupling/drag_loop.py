"""The loop that asks a drag law for every particle, and counts how often outside of its range."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from inspect import signature
from typing import Any

import numpy as np
from numba import njit

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.fluid.grid import Array
from cfddem.kernels import prange
from closures.law import Law


class DragLoop:
    """A drag law as a run asks it.

    drag  card of the law; None for none
    """

    def __init__(self, drag: Law | None) -> None:
        self.knows_sizes = drag is not None and "diameter_ratio" in signature(drag.function).parameters
        self._loop = _compiled(drag.function, self.knows_sizes) if drag else None
        card, everywhere = drag.ranges if drag else {}, (0.0, math.inf)
        self._ranges = tuple(card.get(name, everywhere) for name in ("reynolds", "voidage", "diameter_ratio"))

    def factors(self, reynolds: Array, voidage: Array, diameter_ratio: Array) -> tuple[Array, int]:
        """Drag factor of every particle (N,) [-], zero without a law; and how often the law was outside its range."""
        factor = np.zeros(len(reynolds))
        if self._loop is None:
            return factor, 0
        return factor, int(self._loop(reynolds, voidage, diameter_ratio, *self._ranges, factor))


@cache
def _compiled(law: Callable[..., float], knows_sizes: bool) -> Any:
    """The loop; small, and compiled for the law that a run has chosen."""
    asked = law if knows_sizes else _of_equals(law)

    @njit(parallel=True, error_model="numpy")
    def factors(reynolds, voidage, ratio, numbers, voidages, ratios, factor):
        outside = 0
        for n in prange(len(reynolds)):
            factor[n] = asked(reynolds[n], voidage[n], ratio[n])
            beyond = reynolds[n] < numbers[0] or reynolds[n] > numbers[1]
            beyond = beyond or voidage[n] < voidages[0] or voidage[n] > voidages[1]
            outside += 1 if beyond or ratio[n] < ratios[0] or ratio[n] > ratios[1] else 0
        return outside

    return factors


def _of_equals(law: Callable[..., float]) -> Callable[..., float]:
    """A law that knows of equal spheres only, where a diameter ratio is offered, too."""

    @njit(error_model="numpy")
    def equals(reynolds, voidage, ratio):
        return law(reynolds, voidage)

    return equals  # type: ignore[no-any-return]
