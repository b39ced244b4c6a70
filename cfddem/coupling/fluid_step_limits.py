"""Limits of the fluid step of a coupled run, for estimates before the run and for every step of it.

Nothing is compiled here. The limits of the fluid alone are in :mod:`cfddem.fluid.step_limit`, those of the particles
in :mod:`cfddem.particles.step_criteria`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator

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
