"""Samples of ranges, the fit of a response with its errors, and the search: restarts, failed and killed trials."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import call, parsed
from made_up_run import BED

from cfddem.analysis.response import FLAT, response
from cfddem.backend.errors import InputError
from cfddem.studies import calibration, sweep
from cfddem.studies.samples import Variable, samples, unit_samples, variables

TIMES = np.linspace(0.0, 1.0, 12)


# ---------------------------------------------------------------- samples


@pytest.mark.parametrize("kind", ["latin", "sobol"])
def test_samples_fill_every_range_evenly(kind: str) -> None:
    """One point in each of 16 equal parts of every range."""
    points = unit_samples(3, 16, kind)
    for column in points.T:
        assert sorted(np.floor(16.0 * column).astype(int)) == list(range(16))
    varied = [Variable("bed.diameter", 1e-3, 2e-3), Variable("fluid.viscosity", 1e-4, 1e-2, True)]
    for each in samples(varied, 16, kind):
        assert 1e-3 <= each["bed.diameter"] <= 2e-3 and 1e-4 <= each["fluid.viscosity"] <= 1e-2


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["diameter"], "key=low..high"),
        (["diameter=2..1"], "key=low..high"),
        (["diameter=a..b"], "key=low..high"),
        (["diameter=1e-3..inf"], "key=low..high"),
        (["diametre=1..2"], "did you mean 'diameter'"),
        (["viscosity=0..1 log"], "above 0"),
        (["diameter=1..2", "bed.diameter=1..2"], "given once"),
        ([], "1 to 20 times"),
    ],
)
def test_a_wrong_range_is_refused(given: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        variables(given)


def test_a_sweep_takes_values_or_ranges(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def one(case: Any, values: dict[str, Any], folder: Path, alone: bool, laws: Sequence[Path]) -> sweep.Outcome:
        return sweep.Outcome(
            str(folder), values, "finished", measures={"bed_height": (values["bed.diameter"], 0.1, "m")}
        )

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sweep, "_one", one)
    line = ("sweep", "liquid-bed", "--vary", "diameter=1e-3..2e-3", "--runs", "8", "--sample", "sobol", "-o", "many")
    done = call(*line, "--json")
    assert done.code == 0, done.err
    assert len({each["values"]["bed.diameter"] for each in parsed(done.out)["runs"]}) == 8
    assert (tmp_path / "many" / "sweep.png").exists()
    assert "only one of them" in call(*line, "--over", "seed=1..2").err
    assert "did you mean 'sobol'" in call(*line[:-4], "--sample", "sobl").err


# ---------------------------------------------------------------- the fit


def cooling(shares: np.ndarray) -> np.ndarray:
    """Values of a model that falls faster with its first parameter; the second one does nothing."""
    return np.exp(-6.0 * (1.0 - shares[0]) * TIMES)


def errors_of(parameters: int, cases: int) -> np.ndarray:
    """Differences of best and true parameters, over the stated errors (cases, parameters)."""
    random, found = np.random.default_rng(1), []
    for _ in range(cases):
        true, error = random.uniform(0.2, 0.8, parameters), np.full(12, 0.02)
        measured = cooling(true) + error * random.normal(size=12) + 0.01 * random.normal() * TIMES
        shares = random.random((24, parameters))
        shares[12:, 0] = (true[0] + 0.1 * random.normal(size=12)).clip(0.0, 1.0)
        computed = np.array([cooling(each) + 0.01 * random.normal() * TIMES for each in shares])
        made = response(shares, computed, measured, error, np.ones(12))
        assert made is not None
        found.append((made.best - true) / made.error)
    return np.array(found)


def test_stated_errors_are_those_that_are_found() -> None:
    """With scatter of data, and of runs that is the same at all times: 95 of 100 within two errors, none too large."""
    off = errors_of(1, 200)
    assert (np.abs(off) < 2.0).mean() > 0.93
    assert 0.7 < np.sqrt((off**2).mean()) < 1.15


def test_a_search_that_fits_nothing_does_not_say_that_the_data_hardly_depend_on_a_key() -> None:
    assert calibration._verdict(False, (), True, agrees=True).startswith("not identified: the data hardly depend")
    lost = calibration._verdict(False, (), True, agrees=False)
    assert lost == "not known: no value in its range agrees with the data; widen it, the best is at its end"


def test_a_parameter_without_effect_is_not_identified() -> None:
    random = np.random.default_rng(2)
    shares, error = random.random((30, 2)), np.full(12, 0.02)
    computed = np.array([cooling(each) + 0.01 * random.normal(size=12) for each in shares])
    made = response(shares, computed, cooling(np.array([0.5, 0.5])), error, np.ones(12))
    assert made is not None and list(made.identified) == [True, False] and made.error[1] > 0.7 * FLAT
    assert not made.tied()


def test_parameters_that_act_alike_are_tied() -> None:
    shares, error = np.random.default_rng(3).random((30, 2)), np.full(12, 0.005)
    computed = np.array([cooling(np.array([each.mean()])) for each in shares])
    made = response(shares, computed, cooling(np.array([0.5])), error, np.ones(12))
    assert made is not None
    ((first, second, r),) = made.tied()
    assert (first, second) == (0, 1) and r < -0.95


def test_too_few_runs_give_no_estimate() -> None:
    assert response(np.zeros((3, 1)), np.zeros((3, 12)), np.zeros(12), np.ones(12), np.ones(12)) is None


# ---------------------------------------------------------------- the search


VARY = Variable("material.glass.restitution", 0.5, 1.0)
TRUE = 0.8


@pytest.fixture
def box(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A case and data; runs above a restitution of 0.9 fail, others are a formula."""
    pytest.importorskip("optuna")

    def one(case: Any, values: dict[str, Any], folder: Path, alone: bool, laws: Sequence[Path]) -> sweep.Outcome:
        failed = values[VARY.key] > 0.9
        return sweep.Outcome(
            str(folder), values, "failed" if failed else "finished", "lost, of a test" if failed else ""
        )

    def computed(outcome: sweep.Outcome, case: Any, data: Any) -> tuple[float, ...]:
        value = outcome.values[VARY.key]
        return () if outcome.status == "failed" else tuple(cooling(np.array([VARY.share(value)])).tolist())

    monkeypatch.setattr(sweep, "_one", one)
    monkeypatch.setattr(calibration, "_computed", computed)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(BED)
    true = cooling(np.array([VARY.share(TRUE)]))
    rows = "\n".join(f"{time:.4f}, {value:.5f}, 0.01" for time, value in zip(TIMES, true))
    (tmp_path / "cooling.csv").write_text(f"time [s], granular temperature [m2/s2], error [m2/s2]\n{rows}\n")
    return tmp_path


def search(trials: int) -> calibration.Calibration:
    """A calibration of the box."""
    return calibration.calibrate(Path("case.toml"), [Path("cooling.csv")], [VARY], Path("out"), trials=trials)


def test_the_search_finds_the_value_survives_failures_and_continues(box: Path) -> None:
    first = search(6)
    again = search(14)
    assert [each.number for each in again.trials[:6]] == [each.number for each in first.trials]
    assert [each.values for each in again.trials[:6]] == [each.values for each in first.trials]
    assert len(again.trials) == 14 and len(again.finished) < 14
    (estimate,) = again.estimates()
    assert again.verdict == "the case agrees with the data at its best values"
    far = replace(again, data=(replace(again.data[0], value=again.data[0].value + 1.0),), response=None)
    assert (
        "no values in these ranges agree"
        in replace(far, trials=tuple(replace(t, chi2=1e4) for t in far.trials)).verdict
    )
    assert abs(estimate["value"] - TRUE) < 2.0 * estimate["error"] < 0.05 and estimate["identified"]
    assert json.loads((box / "out" / "calibration.json").read_text())["failed"] == 14 - len(again.finished)
    assert (box / "out" / "calibration.png").exists() and "lost, of a test" in (box / "out" / "trials.csv").read_text()


def test_another_calibration_is_refused_its_folder(box: Path) -> None:
    search(2)
    (box / "case.toml").write_text(BED.replace("0.05\n", "0.04\n"))
    with pytest.raises(InputError, match="same case, laws, data and ranges"):
        search(3)


def test_a_killed_trial_does_not_count(box: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    search(2)
    with monkeypatch.context() as patch:
        patch.setattr(sweep, "_one", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            search(3)
    found = search(4)
    assert [each.number for each in found.trials] == [0, 1, 3, 4]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--vary", "restitution=0.5..1"), "material.NAME.restitution"),
        (("--vary", "material.glass.restitution=0.5..1.5"), "at most 1"),
        (("--vary", "material.glass.restitution=0.5..1", "--trials", "0"), "at least 1"),
        (("--vary", "material.glass.restitution=0.5..1", "--match", "none.csv"), "does not exist"),
        (("--vary", "material.glass.restitution=0.5..1", "--match", "bare.csv"), "standard errors"),
        (("--vary", "material.glass.restitution=0.5..1", "--match", "depth.csv"), "did you mean 'bed_height'"),
        (("--vary", "material.glass.restitution=0.5..1", "--match", "curve.csv"), "a velocity that the case holds"),
        (("--vary", "material.glass.restitution=0.5..1", "--match", "unit.csv"), "a unit of bed_height, such as m"),
    ],
)
def test_wrong_input_of_a_calibration_is_one_line(box: Path, words: tuple[str, ...], said: str) -> None:
    (box / "bare.csv").write_text("bed height [m]\n0.04\n")
    (box / "depth.csv").write_text("bed heigth [m], error [m]\n0.04, 0.001\n")
    (box / "curve.csv").write_text("velocity [m/s], bed height [m], bed height error [m]\n7, 0.04, 0.001\n")
    (box / "unit.csv").write_text("bed height [s], error [s]\n0.04, 0.001\n")
    matched = () if "--match" in words else ("--match", "cooling.csv")
    done = call("calibrate", "case.toml", *words, *matched)
    assert (done.code, done.err.count("\n")) == (2, 1) and said in done.err, done.err
    assert not (box / "case-calibration").exists()


def test_without_data_or_optuna_there_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(BED)
    vary = ("calibrate", "case.toml", "--vary", "material.glass.restitution=0.5..1")
    assert "nothing to calibrate against" in call(*vary).err
    (tmp_path / "height.csv").write_text("bed height [m], error [m]\n0.04, 0.001\n")
    monkeypatch.setattr(calibration, "find_spec", lambda name: None)
    done = call(*vary, "--match", "height.csv")
    assert (done.code, done.err.count("\n")) == (2, 1) and "cfddem[calibrate]" in done.err
