"""Residence times of particles that feeds bring and outlets remove."""

from __future__ import annotations

import math
import os
import signal
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cfddem.analysis.report import report
from cfddem.backend.communicator import SERIAL
from cfddem.backend.errors import RunStopped
from cfddem.case.schema import Case
from cfddem.features.feeds import Feeds
from cfddem.io.reading import open_run
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


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run without interruption."""
    run = Run.begin(Case.from_text(CASE, "c.toml"), tmp_path_factory.mktemp("residence") / "run")
    run.go()
    return run


def test_falling_particles_have_the_residence_times_of_their_fall(straight: Run) -> None:
    """From 0.180 to 0.184 m down to 0.02 m; the particle of the start, which falls longer, does not count."""
    feeds = straight.simulation.feature(Feeds)
    times, removed = feeds.residence_times, feeds.removed[0]
    assert len(times) == removed - 1 and len(times) > 30
    assert fall(0.16) - 1e-3 <= times.min() and times.max() <= fall(0.164) + 2e-3
    found = report(straight.folder.folder)
    (answer,) = (each for each in found.key_results if each.name == "residence time")
    assert answer.value == pytest.approx(fall(0.162), rel=0.01) and answer.unit == "s"
    assert "10, 50 and 90 % of those that left stayed at most" in answer.verdict


def test_an_interrupted_run_ends_with_the_residence_times_of_an_uninterrupted_one(
    straight: Run, tmp_path: Path
) -> None:
    """A stop between two rows, with particles on their way: at the end all times and columns have the same bits."""
    case = Case.from_text(CASE, "c.toml")
    stopped = Run.begin(case, tmp_path / "stopped")
    step = stopped.simulation.step

    def stepping(until: float) -> None:
        step(until)
        if stopped.simulation.time > 0.27:
            os.kill(os.getpid(), signal.SIGINT)

    stopped.simulation.step = stepping  # type: ignore[method-assign]
    with pytest.raises(RunStopped):
        stopped.go()
    some = stopped.simulation.feature(Feeds).residence_times
    resumed = Run.resume(tmp_path / "stopped")
    assert 0.27 < resumed.simulation.time < 0.28
    resumed.go()
    times = straight.simulation.feature(Feeds).residence_times
    assert len(times) > len(some) + 10 > 20
    assert np.array_equal(resumed.simulation.feature(Feeds).residence_times, times)
    one, other = (open_run(run.folder.folder).history for run in (straight, resumed))
    assert math.isfinite(one["residence_time_90"][-1])
    for name in (each.name for each in Feeds.measures if each.when(case)):
        assert np.array_equal(other[name], one[name], equal_nan=True), name


def test_neither_a_particle_that_leaves_nor_a_row_without_new_ones_costs_a_pass_over_all_times() -> None:
    """Memory that a million residence times take, beside that which they have."""
    case = Case.from_text(CASE, "c.toml", {"feed": []})
    feeds, times = Feeds(case, None), np.random.default_rng(0).uniform(0.0, 1.0, 1_000_000)
    gone = {"entered": np.array([0.5])}
    run = SimpleNamespace(
        time=1.0, communicator=SERIAL, particles=SimpleNamespace(position=np.zeros((1, 3))), remove=lambda _: Gone(gone)
    )
    feeds.restore({"outlet_0": {"left": len(times), "mass": 0.0, "times": times}})

    def row() -> dict[str, float]:
        return dict(feeds.values(SimpleNamespace(case=case)))

    assert row()["residence_time"] == np.mean(times) and row()["residence_time_deviation"] == np.std(times)
    assert [row()[f"residence_time_{each}"] for each in (10, 50, 90)] == np.quantile(times, [0.1, 0.5, 0.9]).tolist()
    (outlet,) = feeds.outlets.values()
    outlet(run)  # type: ignore[arg-type]  # the first call loads the compiler
    row()
    tracemalloc.start()
    row()
    for _ in range(99):
        outlet(run)  # type: ignore[arg-type]
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert taken < 0.1 * times.nbytes
    assert row()["residence_time"] == np.mean(np.append(times, [0.5] * 100))
    assert np.array_equal(feeds.residence_times, np.append(times, [0.5] * 100))


class Gone(dict[str, np.ndarray]):
    """One particle that was removed."""

    count, mass = 1, np.array([1e-6])

    @property
    def entered(self) -> np.ndarray:
        """When it entered [s]."""
        return self["entered"]
