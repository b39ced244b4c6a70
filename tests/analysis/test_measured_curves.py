"""Measured curves against the inlet velocity: how to run a case at them, in which units, and what a report says."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from command_line import call
from made_up_run import BED, WEIGHT, made_up

from cfddem.analysis.report import report
from cfddem.backend.errors import InputError
from cfddem.case.compare import CaseData, points_of, read_table
from cfddem.case.schema import Case
from cfddem.preflight.issue import Issue
from cfddem.preflight.summary import preflight

STEPS = "[[0.0, 0.02], [1.0, 0.02], [1.02, 0.05], [2.0, 0.05]]"


def csv_file(folder: Path, text: str) -> Path:
    """A file of measured data."""
    path = folder / "points.csv"
    path.write_text(text)
    return path


def about(case: Case) -> list[Issue]:
    """What the check says about the measured curve of a case."""
    return [each for each in preflight(case).issues if each.key == "compare.curve"]


def test_velocities_that_the_inlet_does_not_hold_are_named(tmp_path: Path) -> None:
    csv_file(tmp_path, "superficial velocity [m/s], bed height [m]\n0.02, 0.04\n0.03, 0.04\n")
    text = BED.replace("inlet_velocity = 0.05", f"inlet_velocity = {STEPS}")
    (tmp_path / "case.toml").write_text(text + '[compare.curve]\nfile = "points.csv"\n')
    (issue,) = about(Case.from_toml(tmp_path / "case.toml"))
    assert issue.severity == "note", "it is compared at the other"
    assert "at only 1 of 2 velocities; its inlet does not hold 0.03 m/s" in issue.reason
    steps = tomllib.loads(issue.remedy.split("; or ")[1])["bed"]["inlet_velocity"]
    case = Case.from_toml(tmp_path / "case.toml")
    assert not about(case.with_(**{"bed.inlet_velocity": steps})), "the steps of the remedy hold all"
    assert "sweep --over inlet_velocity=0.02,0.03;" in issue.remedy
    (none,) = about(case.with_(**{"bed.inlet_velocity": 0.06}))
    assert none.severity == "warning"


def test_runs_are_compared_by_the_folder_that_holds_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a", "b"):
        made_up(tmp_path / "sweep" / name)
    (tmp_path / "sweep" / "sweep.csv").write_text("run\n")
    monkeypatch.chdir(tmp_path)
    assert "reference  a: finished" in call("compare", "sweep", "-o", "c.png")[1]
    assert "it is a file" in call("compare", "sweep/a", "sweep/sweep.csv")[2]
    assert "it does not exist" in call("report", "nowhere")[2]


def test_a_flow_rate_is_refused_and_units_may_stand_in_parentheses(tmp_path: Path) -> None:
    """The five heights of five flow rates are no five values of one mean."""
    path = csv_file(tmp_path, "flow rate [L/min]; bed height (cm)\n4.5; 9.1\n6; 10.6\n")
    rate, height = read_table(path)
    assert (rate.unit, height.name, height.unit) == ("m3/s", "bed_height", "m")
    assert rate.values == pytest.approx([7.5e-5, 1e-4]) and height.values == pytest.approx([0.091, 0.106])
    for column in (None, "bed_height"):
        with pytest.raises(InputError, match=r"flow_rate: must be a velocity.*floor area"):
            points_of("heights", CaseData(file=str(path), column=column))


def test_means_of_a_run_in_steps_are_those_of_its_last_velocity(tmp_path: Path) -> None:
    """Steps to 80, then 5 mm/s: the window is the second half of the last step, the regime that of its velocity."""
    down = "[[0.0, 0.08], [1.2, 0.08], [1.21, 0.005]]"
    text = BED.replace("inlet_velocity = 0.05", f"inlet_velocity = {down}").replace("average_from", "# average_from")
    folder = made_up(tmp_path / "run", text, largest_speed=0.0, wall_load=WEIGHT)
    found = report(folder)
    assert found.window == pytest.approx((0.5 * (1.21 + 2.0), 2.0))
    regime = next(each for each in found.key_results if each.name == "regime")
    assert "although" not in regime.verdict and "the inlet velocity is 0." in regime.verdict


def test_a_sweep_refuses_data_before_its_first_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    csv_file(tmp_path, "flow rate [l/min], bed height [m]\n4.5, 0.03\n")
    monkeypatch.chdir(tmp_path)
    data = f"compare.curve.file={tmp_path / 'points.csv'}"
    refused = call("sweep", "liquid-bed", "--over", "seed=1,2", "--set", data, "-o", "many")
    assert refused[0] == 2 and "floor area" in refused[2] and not (tmp_path / "many").exists()
