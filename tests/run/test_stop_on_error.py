"""Runs that end when their means are known, and beds that start near their expected state."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from disturbed_runs import TINY
from test_series import with_memory

from cfddem import open_run
from cfddem.analysis.report import report
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.preflight.bed_estimate import estimate_bed
from cfddem.run.initial_particles import LARGEST_EXPANDED_FRACTION, expanded_height
from cfddem.run.runner import Run, averages_from

TIME = np.linspace(0.0, 10.0, 2000)


def series(start_up: float = 0.0) -> dict[str, np.ndarray]:
    """A mean of 10 with fluctuations of 1, and a start-up of time constant 0.3 s."""
    return {"time": TIME, "height": 10.0 + with_memory(len(TIME), 0.9, 3) + start_up * np.exp(-TIME / 0.3)}


def test_a_mean_is_known_when_its_error_is_below_the_limit() -> None:
    """The exact error of this mean is sqrt(1.9/0.1/2000)/10 = 0.0097."""
    assert averages_from(series(), {"height": 0.015}) < 5.0
    assert np.isnan(averages_from(series(), {"height": 0.007}))


def test_averages_begin_after_the_start_up_and_not_before_a_given_time() -> None:
    assert 0.5 < averages_from(series(50.0), {"height": 0.015}) < 5.0
    assert averages_from(series(), {"height": 0.02}, earliest=4.0) >= 4.0


def test_a_drifting_or_short_series_is_not_known() -> None:
    drifting = {"time": TIME, "height": series()["height"] + 2.0 * TIME}
    assert np.isnan(averages_from(drifting, {"height": 1.0}))
    assert np.isnan(averages_from({name: each[:20] for name, each in series().items()}, {"height": 1.0}))


def test_a_run_ends_when_its_means_are_known_and_continues_on_demand(tmp_path: Path) -> None:
    at_rest = {"bed.fixed": True, "run.until": 10.0, "run.every": 1e-3, "run.until_error": {"bed_height": 0.5}}
    case = Case.from_text(TINY, "case", at_rest)
    Run.begin(case, tmp_path / "run").go()
    run = open_run(tmp_path / "run")
    assert run.status == "finished" and run.times[-1] < 0.1 and "bed height" in run.message
    assert report(tmp_path / "run").window == (run.averages_from, run.times[-1])
    later = run.times[-1] + 2e-3
    Run.resume(tmp_path / "run", until=later).go()
    assert open_run(tmp_path / "run").times[-1] == pytest.approx(later)


def test_a_measure_that_the_case_does_not_have_is_refused(tmp_path: Path) -> None:
    case = Case.from_text(TINY, "case", {"run.until_error": {"bed_hight": 0.5}})
    with pytest.raises(InputError, match="bed_height"):
        Run.begin(case, tmp_path / "run")


@pytest.mark.parametrize("velocity", [0.02, 0.04])
def test_an_expanded_start_has_the_height_of_the_bed_in_the_flow(velocity: float) -> None:
    case = Case.from_text(TINY, "case", {"bed.start": "expanded", "bed.inlet_velocity": velocity})
    assert expanded_height(case) == pytest.approx(
        max(estimate_bed(case).height, sum(case.volumes.values()) / case.column.floor_area / LARGEST_EXPANDED_FRACTION)
    )
