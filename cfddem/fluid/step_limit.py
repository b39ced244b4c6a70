"""The largest stable step of a fluid. Importing this module compiles nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

VISCOUS = 0.8
"""Largest step of the fluid, over the viscous time of a cell [-]."""


@dataclass(frozen=True)
class StepLimit:
    """The largest stable step [s] and the criterion that sets it: "Courant", "viscous" or "none"."""

    step: float
    criterion: str


class Rates(NamedTuple):
    """Largest values over all cells."""

    advection: float  # |u|/h summed over directions [1/s]
    viscous: float  # 2 mu/(rho eps) times the sum of 1/h^2 over directions [1/s]
    flux: float  # eps |u| [m/s]


def step_limit(rates: Rates, courant: float) -> StepLimit:
    r"""The largest stable step at these rates.

    .. math:: h \le C / \sum_d |u_d|/h_d, \qquad h \le 0.8 / (2\nu \sum_d h_d^{-2})

    courant  C
    """
    limits = {
        "Courant": courant / rates.advection if rates.advection > 0.0 else np.inf,
        "viscous": VISCOUS / rates.viscous if rates.viscous > 0.0 else np.inf,
    }
    criterion = min(limits, key=limits.__getitem__)
    return StepLimit(limits[criterion], criterion if np.isfinite(limits[criterion]) else "none")
