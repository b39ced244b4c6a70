"""The names at the top of the package: what commands do, as values; and that type checkers know them."""

from __future__ import annotations

import ast
import json
from importlib import import_module
from pathlib import Path

import pytest
from command_line import call, parsed
from made_up_run import made_up

import cfddem
from cfddem.backend.json_text import as_json


def test_check_gives_what_the_command_prints() -> None:
    case = cfddem.gallery()["liquid-bed"]
    found = cfddem.check(case, ranks=2)
    numbers = {row.name: row.value for row in found.rows if row.group == "several processes"}
    assert 0.0 < numbers["efficiency"] < 1.0 and numbers["recommended ranks"] == 1  # few particles
    assert isinstance(found, cfddem.Preflight) and found.status == "ok" and "ranks" in [row.name for row in found.rows]
    assert f"{found}\n" == call("check", "liquid-bed", "--ranks", "2").out
    with pytest.raises(cfddem.CfddemError, match=r"ranks = 10+: must be 1 to 100000"):  # at once
        cfddem.check(case, ranks=10**30)
    broken = cfddem.check(case.with_(**{"bed.diameter": 0.5}))
    assert broken.status == "error" and {each.severity for each in broken.issues} >= {"error"}


def test_check_refuses_measured_data_that_a_run_will_not_have(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the command does; the check of a run at its start, `preflight`, does not know the columns of the history."""
    monkeypatch.chdir(tmp_path)
    Path("data.csv").write_text("time [s], colour [1]\n0.1, 3.0\n")
    case = cfddem.gallery()["liquid-bed"].with_(compare={"mine": {"file": "data.csv"}})
    (issue,) = (each for each in cfddem.check(case).issues if each.severity == "error")
    assert "compare.mine" in issue.key and "colour" in issue.reason


def test_a_report_is_an_object_that_prints_as_the_command_does(tmp_path: Path) -> None:
    folder = made_up(tmp_path / "run")
    found = cfddem.report(str(folder))
    height = found.measures["bed_height"]
    assert isinstance(found, cfddem.Report) and height.stationary and height.mean == pytest.approx(0.04, rel=0.01)
    assert found.key_results[0].name == "bed height" and found.key_results[0].value == height.mean
    assert f"{found}\n" in call("report", str(folder), "-o", str(tmp_path / "page.html")).out
    printed = parsed(call("report", str(folder), "--json").out)
    assert printed.pop("schema") == "cfddem/report/1"
    assert printed == json.loads(as_json(found)) == json.loads(as_json(found.summary()))
    assert printed["measures"]["bed_height"]["mean"] == height.mean
    assert "<td>bed height</td>" in found._repr_html_()


def test_gallery_has_the_cases_that_the_command_lists() -> None:
    listed = [line.split(maxsplit=1) for line in call("new").out.splitlines()]
    assert [[name, case.title] for name, case in cfddem.gallery().items()] == listed


def test_help_lists_the_public_names_and_those_that_users_begin_with_have_an_example() -> None:
    assert {name for name in dir(cfddem) if not name.startswith("_")} == {*cfddem._MODULES}
    first = "Case check gallery run_case Run report open_run open_sweep Simulation make_particles pair_table coat Grid"
    for name in [*first.split(), "Material", "Fluid", "Field", "Box", "Cone", "OwnForce", "measure"]:
        assert ">>> " in getattr(cfddem, name).__doc__, name


def test_names_for_type_checkers_are_those_that_are_imported() -> None:
    tree = ast.parse(Path(cfddem.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
    typed = {
        (node.module, name.name, name.asname)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for name in node.names
    }
    assert typed == {(module, name, name) for name, module in cfddem._MODULES.items()}
    for module, name, _ in typed:
        assert getattr(cfddem, name) is getattr(import_module(str(module)), name) and getattr(cfddem, name).__doc__
