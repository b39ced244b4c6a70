"""Mutated case files, command lines, measured data and run folders end in clear lines; see :mod:`tests.fuzz`."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command_line import HOME, call, commands
from fuzz import workers
from fuzz.plausible import LINES
from fuzz.trials import judge_command, refused_or_accepted
from made_up_run import made_up

from cfddem.backend.errors import InputError, RunFailed
from cfddem.io.reading import open_run

LIMITS = workers.Limits(seconds=0.2)


@pytest.mark.parametrize("count", [200, pytest.param(2000, marks=pytest.mark.slow)])
def test_mutated_inputs_are_accepted_or_refused_in_clear_lines(count: int, tmp_path: Path) -> None:
    """Exit code 0 of the command says that there was no traceback, no hang and no unclear answer."""
    command = [sys.executable, "-m", "tests.fuzz", "--count", str(count), "--workers", "1", "--nice", "0", "--output"]
    done = subprocess.run([*command, str(tmp_path / "out")], cwd=HOME, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    answers = json.loads((tmp_path / "out").read_text())["answers"]
    assert answers["accepted"] + answers["refused"] == count
    assert min(answers.values()) > count // 10, "both kinds of answers are tried"


@pytest.mark.slow
def test_a_thousand_likely_command_lines_of_all_commands_end_without_a_traceback(tmp_path: Path) -> None:
    """With `--json` they print one object with a schema."""
    command = [sys.executable, "-m", "tests.fuzz", "--count", "0", "--plausible", "1000", "--seconds", "60", "--memory"]
    done = subprocess.run([*command, "8", "--workers", "1"], cwd=HOME, capture_output=True, text=True, timeout=3600)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]


def test_every_command_has_a_likely_line() -> None:
    assert {line.split()[0] for line in LINES.strip().splitlines()} == {*commands()}


@pytest.mark.parametrize("given", ["bed.diameter=1e12", "material.glass.density=1e300", "fluid.viscosity=1e-300"])
def test_a_case_with_impossible_values_is_refused_in_a_line(given: str) -> None:
    done = call("check", "liquid-bed", "--set", given)
    assert done.code == 2
    assert f"error: {given.split('=')[0]}: " in done.out.replace("\n  ", " ")


def _unequal(file: Any) -> None:
    del file["bed_height"]
    file["bed_height"] = np.zeros(3)


def _flat(file: Any) -> None:
    del file["particles/Points"]
    file["particles/Points"] = np.zeros(3)


@pytest.mark.parametrize(
    ("name", "damage", "said"),
    [
        ("history.h5", _unequal, r"history.h5: the file is damaged \(its columns have different lengths\)"),
        ("data/00000000.h5", _flat, r"00000000.h5: the file is damaged \(particles/position has the shape \(3,\)\)"),
        ("run.json", '"format": 2, "status": 5', r"run.json: the file is damaged \(status is not a text\); restore it"),
        ("run.json", '"format": Infinity', r"run.json: the file is damaged"),
        ("case.toml", "\udcff", r"must be UTF-8 text"),
    ],
)
def test_a_damaged_file_of_a_run_is_named_in_one_line(name: str, damage: Any, said: str, tmp_path: Path) -> None:
    path = made_up(tmp_path / "run", rows=41) / name
    if callable(damage):
        with h5py.File(path, "r+") as file:
            damage(file)
    else:
        text = re.sub(r'"format": 2,\s*"status": "finished"', damage, path.read_text())
        path.write_bytes((text if name == "run.json" else damage).encode(errors="surrogateescape"))
    with pytest.raises((RunFailed, InputError), match=said) as failure:
        run = open_run(tmp_path / "run")
        assert run.history and run.particles(0) and run.case_text is None
    assert "\n" not in str(failure.value)


def test_a_column_that_the_history_lacks_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean 'bed_height'"):
        open_run(made_up(tmp_path / "run", rows=41)).history["bed_hight"]


def test_a_trial_that_hangs_or_fails_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def hangs(*_: Any) -> str:
        while True:
            pass

    def fails(*_: Any) -> str:
        raise ZeroDivisionError("division by zero")

    around: Any = None
    monkeypatch.setattr(workers, "perform", hangs)
    assert workers.trial(around, 1, 1, LIMITS) == "hangs: longer than 0.2 s"
    monkeypatch.setattr(workers, "perform", fails)
    assert workers.trial(around, 1, 1, LIMITS).startswith("ZeroDivisionError: division by zero  at test_fuzz.py:")


@pytest.mark.parametrize(
    ("code", "out", "err"),
    [
        (0, "", "Traceback (most recent call last):"),
        (7, "", "cfddem: no"),
        (2, "", ""),
        (0, "", "x.py:3: RuntimeWarning: overflow encountered"),
        (2, "", "cfddem: no\n" * 50),
    ],
)
def test_an_unclear_answer_of_a_command_is_found(code: int, out: str, err: str) -> None:
    with pytest.raises(AssertionError):
        judge_command(code, out, err)


def test_an_unclear_refusal_is_found() -> None:
    def refuse(failure: Exception) -> None:
        raise failure

    assert refused_or_accepted(lambda: refuse(InputError("a", 1, "2"))) == "refused"
    assert refused_or_accepted(lambda: None) == "accepted"
    for unclear in (RunFailed(""), RunFailed("x" * 1000), RunFailed("a\n\nb"), RunFailed("a\n" * 100)):
        with pytest.raises(AssertionError):
            refused_or_accepted(lambda failure=unclear: refuse(failure))  # type: ignore[misc]
    with pytest.raises(KeyError):
        refused_or_accepted(lambda: refuse(KeyError("a")))
