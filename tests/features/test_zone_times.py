"""Visits to the spray zone, from a history made by hand, and what snapshots of wet particles contain."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cfddem.backend.communicator import SERIAL
from cfddem.features.spray import FIELDS, mean_round, mean_visit, note_visits
from cfddem.particles.state import Particles, make_particles

HISTORY = {  # time -> which of three particles are in the zone
    0.0: (False, True, False),
    1.0: (True, True, False),
    2.0: (True, False, False),
    3.0: (False, False, True),
    5.0: (True, True, True),
    6.0: (False, True, True),
}


def three() -> Particles:
    made = make_particles(np.zeros((3, 3)), 1e-3, 2500.0)
    for field in FIELDS:
        made.declare(field)
    return made


def test_visits_and_rounds_of_a_history_made_by_hand() -> None:
    particles = three()
    assert math.isnan(mean_visit(particles, SERIAL)) and math.isnan(mean_round(particles, SERIAL))
    for time, inside in HISTORY.items():
        note_visits(particles, np.array(inside), time)
    # the first particle: in from 1 to 3 and from 5 to 6; the second one's first visit has no beginning
    assert particles.zone_visits.tolist() == [2, 0, 0]
    assert particles.zone_visit_time.tolist() == [3.0, 0.0, 0.0]
    assert particles.zone_rounds.tolist() == [1, 0, 0] and particles.zone_round_time[0] == 4.0
    assert mean_visit(particles, SERIAL) == 1.5 and mean_round(particles, SERIAL) == 4.0


def test_share_of_time_in_the_zone_is_visit_over_round() -> None:
    """Little's law: particles that come round every 10 s for 2 s make up a fifth of those in the zone."""
    particles, share = make_particles(np.zeros((50, 3)), 1e-3, 2500.0), []
    for field in FIELDS:
        particles.declare(field)
    phase = np.arange(50) * 0.2
    for time in np.arange(0.0, 100.0, 0.1):
        inside = (time + phase) % 10.0 < 2.0 - 1e-9
        note_visits(particles, inside, float(time))
        share.append(inside.mean())
    assert mean_visit(particles, SERIAL) == pytest.approx(2.0, rel=0.02)
    assert mean_round(particles, SERIAL) == pytest.approx(10.0, rel=0.02)
    assert np.mean(share) == pytest.approx(mean_visit(particles, SERIAL) / mean_round(particles, SERIAL), rel=0.03)
