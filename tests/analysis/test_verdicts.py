"""Verdicts of a report about beds at rest, published heights, and means that are not steady."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import h5py
import numpy as np
import pytest
from made_up_run import BED, WEIGHT, made_up

from cfddem.analysis.report import report
from cfddem.analysis.report_values import KeyResult
from cfddem.plotting.study_figures import Point, sweep_figure
from cfddem.studies.sweep import Outcome, _measured, write_table


def answer(folder: Path, name: str) -> KeyResult:
    """One answer of a report."""
    return next(each for each in report(folder).key_results if each.name == name)


def test_a_bed_at_rest_on_the_floor_is_not_fluidised_whatever_its_inlet(tmp_path: Path) -> None:
    record = {"largest_speed": 3e-4, "pressure_drop": 0.909 * WEIGHT, "wall_load": 0.091 * WEIGHT}
    found = answer(made_up(tmp_path / "run", **record), "regime")
    assert (found.value, found.holds) == ("at rest, not fluidised", False)
    assert "carries 90.9 % of" in str(found.verdict) and "although the inlet velocity is" in str(found.verdict)


def test_published_heights_do_not_depend_on_the_run(tmp_path: Path) -> None:
    once, other = (answer(made_up(tmp_path / f"{n}", bed_height=h), "bed height") for n, h in enumerate((0.04, 0.09)))
    assert str(once.verdict).split(";")[1] == str(other.verdict).split(";")[1]
    voidage = next(row.expected for row in report(tmp_path / "0").laws if "Garside" in row.law)
    solids = 0.99 * 2000 * math.pi / 6.0 * 8e-9 / 0.02**2  # the bed height is that of 99 % of the volume
    assert f"{solids / (1.0 - voidage):.3g}" in str(once.verdict)


def test_means_that_are_not_known_to_be_steady_are_not_recommended(tmp_path: Path) -> None:
    folder = made_up(tmp_path / "run", rows=20, bed_voidage_from_pressure=0.6)
    assert "use this value" not in str(answer(folder, "bed voidage").verdict)
    assert answer(folder, "regime").holds is None
    assert str(answer(folder, "regime").value).startswith("so far: ")


@pytest.mark.parametrize(("drift", "steady"), [(5e-4, True), (2e-3, False)])
def test_a_drift_below_a_thousandth_of_the_mean_is_steady(tmp_path: Path, drift: float, steady: bool) -> None:
    folder = made_up(tmp_path / "run")
    with h5py.File(folder / "history.h5", "r+") as file:
        file["bed_height"][:] = 0.04 * (1.0 + drift * np.clip(file["time"][:] - 1.0, 0.0, 1.0))
    assert report(folder).measures["bed_height"].stationary is steady


def test_a_step_of_the_inlet_within_the_window_is_named_as_the_cause_of_a_drift(tmp_path: Path) -> None:
    ramp = BED.replace("inlet_velocity = 0.05", "inlet_velocity = [[0, 0.04], [1.4, 0.04], [1.5, 0.05]]")
    for name, text, changes in (("ramp", ramp, True), ("steady", BED, False)):
        found = report(made_up(tmp_path / name, text, trend=5e-3))
        (height,) = (each for each in found.key_results if each.name == "bed height")
        assert ("in which the inlet velocity changes" in height.verdict) == changes
        assert ("the inlet velocity changes within that time, 0.04 to 0.05 m/s" in "".join(found.warnings)) == changes


def test_a_sweep_has_the_voidages_by_published_laws_beside_the_means(tmp_path: Path) -> None:
    folder = made_up(tmp_path / "run")
    outcome = _measured(Outcome(str(folder), {"bed.inlet_velocity": 0.05}, "finished"), 1.0, False)
    write_table([outcome], tmp_path / "sweep.csv")
    (row,) = csv.DictReader((tmp_path / "sweep.csv").open())
    expected = {each.law: each.expected for each in report(folder).laws if "Garside" in each.law}
    assert float(row["voidage by Garside [-]"]) == expected["voidage by Garside"]
    assert "voidage by Garside error" not in row and float(row["bed_voidage error"]) > 0.0
    assert sweep_figure([Point(outcome.values, outcome.measures)], tmp_path / "sweep.png")
