"""The table of a validation: verdicts, files, and what is on them."""

from __future__ import annotations

import doctest
import json
import math
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import h5py
import numpy as np
import pytest
from command_line import call, parsed

from cfddem.backend.errors import InputError
from cfddem.plotting import curves as plots
from scenarios.collisions.bouncing_sphere import study as bouncing_sphere
from scenarios.collisions.immersed_pair import checks
from scenarios.collisions.immersed_pair import validation as study
from scenarios.validation.table import Row, replacing, worst, write_histories
from scenarios.validation.targets import TARGETS, validate


def test_a_row_fails_only_by_a_limit() -> None:
    assert Row("e", 0.5, 0.4, 0.2).verdict == "holds"
    assert Row("e", 0.5, 0.4, 0.05).verdict == "FAILS"
    assert Row("e", 0.5, 0.4).verdict == "report"
    assert Row("e", math.nan, 0.4, 0.05).verdict == "FAILS"


def test_the_help_lists_every_target() -> None:
    told = " ".join(call("validate", "--help").out.replace("\u2502", " ").split())
    assert all(f"{name}," in told or f"{name} or all" in told for name in TARGETS)


def test_the_worst_of_many_points_is_shown_and_all_are_kept() -> None:
    row = worst("e", [(1, 0.50, 0.51), (2, 0.30, 0.25), (3, 0.9, 0.9)], 0.1)
    assert (row.value, row.reference, len(row.points)) == (0.30, 0.25, 3)
    assert worst("e", [(1, 0.5, 0.4), (2, math.nan, 0.4)], 0.2).verdict == "FAILS"


def target(monkeypatch: pytest.MonkeyPatch, *rows: Row) -> None:
    """Make `example` a target with these rows."""
    module = ModuleType("example_of_a_target")
    module.study = lambda folder, progress: list(rows)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(TARGETS, "example", module.__name__)


@pytest.mark.parametrize(("limit", "holds"), [(0.2, True), (0.05, False), (None, True)])
def test_the_outcome_is_that_of_the_rows(
    limit: float | None,
    holds: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    target(monkeypatch, Row("restitution [" + "long " * 30 + "]", 0.5, 0.4, limit, unit="m"), Row("x", math.nan))
    assert validate("example", tmp_path) is holds
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines()[:-1])) <= 100
    assert "\x1b" not in printed
    assert "[m]" in printed
    report = json.loads((tmp_path / "example" / "table.json").read_text())
    assert report["holds"] is holds
    assert report["rows"][0]["difference"] == pytest.approx(0.1)
    assert report["rows"][1]["value"] is None
    assert [each.name for each in (tmp_path / "example").iterdir()] == ["table.json"]


@pytest.mark.filterwarnings("ignore:Cyclopts application invoked")
@pytest.mark.parametrize(("limit", "code"), [(0.2, 0), (0.05, 1)])
def test_the_exit_code_says_whether_the_limits_hold(
    limit: float, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from cfddem.cli import app as cli

    target(monkeypatch, Row("e", 0.5, 0.4, limit))
    monkeypatch.setattr(sys, "argv", ["cfddem", "validate", "example", "--output", str(tmp_path)])
    try:
        cli.main()
        left_with = 0
    except SystemExit as leaving:
        left_with = leaving.code
    assert left_with == code


def test_the_table_can_be_printed_as_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    target(monkeypatch, Row("e", 0.5, 0.4, 0.2))
    from cfddem.cli import app as cli

    monkeypatch.setattr(sys, "argv", ["cfddem", "validate", "example", "--json", "--output", str(tmp_path)])
    with pytest.raises(SystemExit):
        cli.main()
    printed = parsed(capsys.readouterr().out)
    assert printed["holds"] and [each["target"] for each in printed["targets"]] == ["example"]


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="output"):
        validate("binary-collision", tmp_path / "file")


def test_histories_say_their_units(tmp_path: Path) -> None:
    write_histories(tmp_path / "h.h5", {"a/b": {"gap": (np.arange(3.0), "m")}, "c": {"e": (0.5, "-")}})
    with h5py.File(tmp_path / "h.h5") as file:
        assert file["a/b/gap"].attrs["units"] == "m"
        assert file["c/e"].attrs["units"] == "-"


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    place = tmp_path / "table"
    place.write_text("old")
    with pytest.raises(RuntimeError), replacing(place) as fresh:
        fresh.write_text("half of the n")
        raise RuntimeError
    assert place.read_text() == "old"
    assert list(tmp_path.iterdir()) == [place]


@pytest.mark.parametrize(
    "part",
    [
        study.gap_histories, study.gondret, checks.film_zone,
        *(pytest.param(part, marks=pytest.mark.slow) for part in (study.roughness, checks.walls, checks.tables)),
    ],
    ids=lambda part: part.__name__,
)  # fmt: skip
def test_quick_parts_of_the_binary_collisions_hold(part: Callable[[study.Curves], list[Row]]) -> None:
    assert [row.as_dict() for row in part({}) if row.verdict == "FAILS"] == []


@pytest.mark.parametrize("module", [bouncing_sphere, plots], ids=lambda module: module.__name__)
def test_examples_in_the_pages_of_modules_hold(module: ModuleType) -> None:
    assert doctest.testmod(module).failed == 0


@pytest.mark.slow
def test_binary_collisions_hold_all_their_limits(tmp_path: Path) -> None:
    assert validate("binary-collision", tmp_path)
    folder = tmp_path / "binary-collision"
    assert len(list(folder.glob("*.png"))) == 7

    def has_unit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        assert isinstance(item, h5py.Group) or "units" in item.attrs, name

    with h5py.File(folder / "histories.h5") as file:
        file.visititems(has_unit)
