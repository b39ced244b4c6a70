"""Residence times of particles that feeds bring and outlets remove."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cfddem.analysis.report import report
from cfddem.case.schema import Case
from cfddem.features.feeds import Feeds
from cfddem.run.runner import Run

CASE = """
column = { width = 0.02, height = 0.2, cell = 0.005 }
laws = { lubrication = "none" }
run = { until = 0.4, particle_step = 1e-5, fluid_step = 5e-4, every = 0.1, history_every = 0.05 }

[material.glass]
density = 2500.0
youngs_modulus = 6.0e10
contact_modulus = 1.0e6
poisson = 0.25
friction = 0.3

[bed]
diameter = 1.0e-3
positions = [[0.003, 0.003, 0.19]]

[[feed]]
corner = [0.005, 0.005, 0.18]
size = [0.01, 0.01, 0.004]
rate = 200.0
velocity = [0.0, 0.0, -0.5]

[[outlet]]
corner = [0.0, 0.0, 0.0]
size = [0.02, 0.02, 0.02]
"""


def fall(distance: float) -> float:
    """Time of a fall that begins with 0.5 m/s."""
    return (math.sqrt(0.25 + 2.0 * 9.81 * distance) - 0.5) / 9.81


def test_falling_particles_have_the_residence_times_of_their_fall(tmp_path: Path) -> None:
    """From 0.180 to 0.184 m down to 0.02 m; the particle of the start, which falls longer, does not count."""
    run = Run.begin(Case.from_text(CASE, "c.toml"), tmp_path / "run")
    run.go()
    feeds = run.simulation.feature(Feeds)
    times, removed = feeds.residence_times, feeds.removed[0]
    assert len(times) == removed - 1 and len(times) > 30
    assert fall(0.16) - 1e-3 <= times.min() and times.max() <= fall(0.164) + 2e-3
    found = report(tmp_path / "run")
    (answer,) = (each for each in found.key_results if each.name == "residence time")
    assert answer.value == pytest.approx(fall(0.162), rel=0.01) and answer.unit == "s"
    assert "10, 50 and 90 % of those that left stayed at most" in answer.verdict
    again = Run.resume(tmp_path / "run", until=0.45)
    assert np.array_equal(again.simulation.feature(Feeds).residence_times, times)
