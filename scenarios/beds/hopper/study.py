"""A hopper with a gate, a feed and an outlet: its discharge beside the law of Beverloo.

>>> from cfddem.case.gallery import gallery
>>> from cfddem.case.schema import Case
>>> round(beverloo(gallery()["hopper"]), 3)
0.404
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cfddem.case.bed import POURED_SOLID_FRACTION
from cfddem.case.schema import Case
from cfddem.io.reading import RunData
from closures import discharge as laws_of_discharge


@dataclass(frozen=True)
class Discharge:
    """Mass flow out of the hopper."""

    mean: float  # over the averaging window [kg/s]
    halves: tuple[float, float]  # over its two halves [kg/s]
    law: float  # by Beverloo [kg/s]


def beverloo(case: Case) -> float:
    """Discharge of the first wall, a cone, by Beverloo with a correction for its angle [kg/s]."""
    cone = case.wall[0]
    slope = ((cone.top_radius or 0.0) - (cone.radius or 0.0)) / (cone.length or 1.0)
    bulk, gravity = POURED_SOLID_FRACTION * case.solid.density, math.hypot(*case.laws.gravity)
    flat = laws_of_discharge.beverloo(bulk, 2.0 * (cone.radius or 0.0), case.bed.diameter, gravity)
    return flat * laws_of_discharge.cone_factor(slope)


def discharge(run: RunData, case: Case) -> Discharge:
    """Discharge of a run, from the mass that its outlet has removed."""
    begin, end = case.run.average_from or 0.5 * case.run.until, case.run.until
    middle = 0.5 * (begin + end)
    rates = [_slope(run, *span) for span in ((begin, end), (begin, middle), (middle, end))]
    return Discharge(rates[0], (rates[1], rates[2]), beverloo(case))


def _slope(run: RunData, begin: float, end: float) -> float:
    """Removed mass per time [kg/s]."""
    time = run.history["time"]
    inside = (time >= begin) & (time <= end)
    return float(np.polyfit(time[inside], run.history["removed_mass"][inside], 1)[0])
