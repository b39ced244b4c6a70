"""Limits of the fluid step, for estimates before a run and in every step of it: of a fluid alone, and of a coupled run.

Importing this module compiles nothing. The limits of the particles are in :mod:`cfddem.particles.step_criteria`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator

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


# ---------------------------------------------------------------- of a coupled run


MOST_SUBSTEPS = 50
"""Particle steps in a fluid step, at most: about one collision, fifty steps of 2 % of the Hertz time."""

COURANT = 0.5
"""Part of a cell that fluid or particles may cross in a fluid step."""


def crossing_rate(velocity: np.ndarray, spacing: Sequence[float], communicator: Communicator = SERIAL) -> float:
    """Cells that the fastest particle crosses in a second.

    velocity      of the particles (N, 3) [m/s]
    spacing       edges of a cell [m]
    communicator  of the run

    >>> crossing_rate(np.array([[0.5, 0.0, -0.5], [0.0, 1.5, 0.0]]), (0.5, 0.5, 0.25))
    3.0
    """
    fastest = (communicator.largest(np.abs(along), default=0.0) for along in velocity.T)
    return max(float(speed) / length for speed, length in zip(fastest, spacing))


def courant_step(speed: float, spacing: Sequence[float]) -> float:
    """Step in which something crosses half of the shortest edge of a cell [s].

    speed    [m/s]
    spacing  edges of a cell [m]

    >>> courant_step(0.5, (0.01, 0.01, 0.005))
    0.005
    """
    return COURANT * min(spacing) / max(speed, 1e-300)


def fluid_step_limits(particle_step: float, of_case: float | None, flow: Mapping[str, float]) -> dict[str, float]:
    """Every limit of the fluid step by its criterion [s].

    particle_step  [s]
    of_case        step that the case gives; None if it gives none [s]
    flow           limits by fluid, inlet and moving particles; empty without a fluid [s]
    """
    limits = {"collision": MOST_SUBSTEPS * particle_step}
    if of_case is not None:
        limits["given"] = of_case
    return limits | dict(flow)
