"""A hopper with a gate, a feed and an outlet: its discharge beside the law of Beverloo.

>>> from cfddem.case.gallery import gallery
>>> from cfddem.case.schema import Case
>>> round(beverloo(Case.from_toml(gallery()["hopper"])), 3)
0.404
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cfddem.case.bed import POURED_SOLID_FRACTION
from cfddem.case.schema import Case
from cfddem.io.reading import Run

CONSTANT, EMPTY_RIM = 0.58, 1.4
"""C and k of Beverloo, Leniger & van de Velde, Chem. Eng. Sci. 15 (1961) 260, for spheres [-]."""

STEEP = -0.35
"""Exponent of the correction for cones by Rose & Tanaka, The Engineer 208 (1959) 465; from memory [-]."""


@dataclass(frozen=True)
class Discharge:
    """Mass flow out of the hopper."""

    mean: float  # over the averaging window [kg/s]
    halves: tuple[float, float]  # over its two halves [kg/s]
    law: float  # by Beverloo [kg/s]


def beverloo(case: Case) -> float:
    r"""Discharge of the first wall, a cone, by Beverloo with a correction for its angle [kg/s].

    .. math:: W = C\,\rho_b\,\sqrt g\,(D - k d)^{5/2}\,(\tan\theta)^{-0.35}

    with the bulk density rho_b of a poured bed, the diameter D of the orifice and the half angle theta of the cone.
    """
    cone = case.wall[0]
    orifice = 2.0 * (cone.radius or 0.0)
    slope = ((cone.top_radius or 0.0) - (cone.radius or 0.0)) / (cone.length or 1.0)
    bulk = POURED_SOLID_FRACTION * case.solid.density
    free = orifice - EMPTY_RIM * case.bed.diameter
    return float(CONSTANT * bulk * math.sqrt(math.hypot(*case.laws.gravity)) * free**2.5 * slope**STEEP)


def discharge(run: Run, case: Case) -> Discharge:
    """Discharge of a run, from the mass that its outlet has removed."""
    begin, end = case.run.average_from or 0.5 * case.run.until, case.run.until
    middle = 0.5 * (begin + end)
    rates = [_slope(run, *span) for span in ((begin, end), (begin, middle), (middle, end))]
    return Discharge(rates[0], (rates[1], rates[2]), beverloo(case))


def _slope(run: Run, begin: float, end: float) -> float:
    """Removed mass per time [kg/s]."""
    time = run.history["time"]
    inside = (time >= begin) & (time <= end)
    return float(np.polyfit(time[inside], run.history["removed_mass"][inside], 1)[0])
