"""Spray on a small spouted bed: how evenly the particles are coated, and how often they pass the spray.

Every pass through the spray zone brings a particle some drops. After many passes the coating is the more even, the
more often particles pass: the square of its coefficient of variation falls as the inverse of the number of passes.
Nothing is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.io.reading import RunData


@dataclass(frozen=True)
class Coating:
    """The coating of the particles at one time."""

    time: float  # [s]
    liquid: float  # mean on a particle, its part of its bridges included [m3]
    variation: float  # standard deviation over mean [-]
    wet_share: float  # of the particles that carry liquid [-]
    joined_share: float  # of the particles that a bridge joins to another [-]
    residence_time: float  # mean time of a visit to the spray zone so far [s]
    circulation_time: float  # mean time from one entry into the zone to the next so far [s]


def bed() -> Case:
    """The case of the gallery."""
    return gallery()["coating"]


def coating(run: RunData, snapshot: int = -1) -> Coating:
    """The coating in a snapshot of a run; `snapshot` 0 is the first, -1 the last."""
    liquid = run.particles(snapshot)["liquid_carried"]
    time = float(run.times[snapshot])
    row = int(np.abs(run.history["time"] - time).argmin())
    mean = float(liquid.mean())
    return Coating(
        time=time,
        liquid=mean,
        variation=float(liquid.std()) / mean if mean > 0.0 else np.nan,
        wet_share=float((liquid > 0.0).mean()),
        joined_share=float(run.history["agglomerated_share"][row]),
        residence_time=float(run.history["spray_residence_time"][row]),
        circulation_time=float(run.history["spray_circulation_time"][row]),
    )


def distribution(run: RunData, edges: np.ndarray, snapshot: int = -1) -> np.ndarray:
    """Share of the particles by liquid over the mean (n,) [-].

    edges  of the classes, of liquid over its mean (n + 1,)
    """
    liquid = run.particles(snapshot)["liquid_carried"]
    counts, _ = np.histogram(liquid / liquid.mean(), edges)
    return np.asarray(counts / len(liquid))
