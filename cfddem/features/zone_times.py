"""Times of particles in and between visits to a zone, such as the spray zone.

A visit lasts from a particle's entry to its exit, a round from one entry to the next. Particles are looked at after
every call; shorter visits are not seen. A particle that is in the zone at the first call counts from its next entry.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.data.fields import Field
from cfddem.particles.state import Particles

INSIDE = Field("zone_inside", dtype=bool, initial=True, meaning="the particle is in the spray zone")
ENTERED = Field("zone_entered", "s", initial=math.nan, meaning="time of the last entry into the spray zone; NaN before")
VISITS = Field("zone_visits", dtype=np.int64, meaning="visits to the spray zone that have ended")
VISIT_TIME = Field("zone_visit_time", "s", meaning="sum of the times of these visits")
ROUNDS = Field("zone_rounds", dtype=np.int64, meaning="rounds from one entry into the spray zone to the next")
ROUND_TIME = Field("zone_round_time", "s", meaning="sum of the times of these rounds")
FIELDS = (INSIDE, ENTERED, VISITS, VISIT_TIME, ROUNDS, ROUND_TIME)
"""What particles remember of the zone. They begin inside, so that a visit without a known beginning does not count."""


def note_visits(particles: Particles, inside: np.ndarray, time: float) -> None:
    """Note which particles have entered or left the zone.

    particles  with `FIELDS`
    inside     whether each is in the zone now (N,) bool
    time       now [s]
    """
    entered = particles.zone_entered
    known = np.isfinite(entered)
    leaves = particles.zone_inside & ~inside & known
    particles.zone_visits += leaves
    particles.zone_visit_time += np.where(leaves, time - entered, 0.0)
    enters = inside & ~particles.zone_inside
    returns = enters & known
    particles.zone_rounds += returns
    particles.zone_round_time += np.where(returns, time - entered, 0.0)
    particles.zone_entered = np.where(enters, time, entered)
    particles.zone_inside = inside


def mean_visit(particles: Particles, communicator: Communicator) -> float:
    """Mean time of a visit so far [s]; NaN before the first has ended."""
    return _mean(particles.zone_visit_time, particles.zone_visits, communicator)


def mean_round(particles: Particles, communicator: Communicator) -> float:
    """Mean time from one entry to the next so far [s]; NaN before the first round."""
    return _mean(particles.zone_round_time, particles.zone_rounds, communicator)


def _mean(time: np.ndarray, number: np.ndarray, communicator: Communicator) -> float:
    count = communicator.sum(number)
    return float(communicator.sum(time) / count) if count > 0 else math.nan
