"""Results of studies that are kept: runs as folders, numbers as files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from disturbed_runs import TINY

from cfddem.case.schema import Case
from cfddem.io.folder import holds_surfaces_of, keep_files
from cfddem.run import runner
from cfddem.run.runner import Run
from scenarios.beds.wet_bed.validation import reached
from scenarios.validation.kept_runs import advanced, finished, kept


def test_a_run_reports_where_it_is_and_is_not_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "REPORT_EVERY", -1.0)
    said: list[str] = []
    case = Case.from_text(TINY.replace("until = 0.024", "until = 0.008"))
    first = finished(case, tmp_path, "run", said.append, {"bed.seed": 3})
    assert first.status == "finished"
    assert any(line.startswith("run: ") and line.endswith("of 0.008 s") for line in said)
    said.clear()
    assert finished(case, tmp_path, "run", said.append, {"bed.seed": 3}).steps[-1] == first.steps[-1]
    assert said == []


def test_a_run_that_was_killed_before_its_first_snapshot_begins_again(tmp_path: Path) -> None:
    case = Case.from_text(TINY.replace("until = 0.024", "until = 0.004"))
    Run.begin(case, tmp_path / "run")
    for each in (tmp_path / "run" / "data").iterdir():
        each.unlink()
    assert reached(tmp_path / "run") == 0.0
    advanced(case, tmp_path, "run", lambda text: None, 0.004)
    assert reached(tmp_path / "run") == pytest.approx(0.004)


def test_another_surface_is_another_case(tmp_path: Path) -> None:
    wall = '[[wall]]\nshape = "surface"\nfile = "part.stl"\n'
    (tmp_path / "case.toml").write_text(TINY + wall)
    (tmp_path / "part.stl").write_bytes(b"one")
    case = Case.from_toml(tmp_path / "case.toml")
    keep_files(case, tmp_path)
    assert holds_surfaces_of(case, tmp_path)
    (tmp_path / "part.stl").write_bytes(b"another")
    assert not holds_surfaces_of(case, tmp_path)


def test_numbers_are_computed_once(tmp_path: Path) -> None:
    calls = []

    def compute() -> dict[str, Any]:
        calls.append(1)
        return {"voidage": 0.1 + 0.2, "pair": [1.0, 2.0]}

    found = [kept(tmp_path / "numbers.json", compute) for _ in range(2)]
    assert found == [{"voidage": 0.1 + 0.2, "pair": [1.0, 2.0]}] * 2
    assert calls == [1]
