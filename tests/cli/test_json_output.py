"""What commands print with `--json`: one object of a known form, also for errors. Other tests parse theirs alike."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from command_line import HOME, call, commands, parsed
from made_up_run import made_up

from cfddem.backend.json_text import as_json
from cfddem.cli.json_output import SCHEMAS, word


def test_every_command_that_prints_results_has_json() -> None:
    assert [name for name in commands() if "--json  " not in call(name, "--help").out] == ["schema"]


@pytest.mark.parametrize("name", sorted(SCHEMAS))
def test_a_schema_names_its_version_and_describes_its_values(name: str) -> None:
    printed = json.loads(call("schema", name).out)
    word = printed["properties"]["schema"]["const"]
    assert re.fullmatch(rf"cfddem/{name}/\d+", word) and printed["$id"] == word
    assert "schema" in printed["required"] and printed["description"]


def test_the_schema_of_a_case_is_that_of_new_and_an_unknown_one_is_refused() -> None:
    assert call("schema").out == call("new", "--schema").out
    assert "did you mean 'report'?" in call("schema", "reprot").err


def test_files_that_commands_write_are_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    made_up(tmp_path / "bed")
    names = {each["name"] for each in parsed(call("new", "--json").out)["cases"]}
    assert {"liquid-bed", "settling"} <= names
    for words in (
        ("new", "settling"),
        ("view", "bed", "--history"),
        ("sweep", "settling.toml", "--over", "seed=1..3", "--write-jobs", "-o", "many"),
    ):
        files = parsed(call(*words, "--json").out)["files"]
        assert files and all(Path(each).is_file() for each in files), words


def test_keys_of_a_case_are_explained_with_unit_default_and_choices() -> None:
    keys = {each["key"]: each for each in parsed(call("explain", "column", "--json").out)["keys"]}
    assert keys["column.width"]["unit"] == "m" and keys["column.cell"]["required"]
    assert "periodic" in keys["column.ends"]["choices"] and keys["column.ends"]["default"] == "flow"
    assert parsed(call("explain", "di-felice", "--json").out)["keys"] == []


def test_errors_are_an_object_with_place_key_value_limit_and_remedy(tmp_path: Path) -> None:
    """On standard output, beside the lines on standard error; also those that the command line itself finds."""
    case = tmp_path / "bed.toml"
    case.write_text((HOME / "scenarios/beds/liquid_bed/case.toml").read_text().replace("until = ", "untill = "))
    done = call("run", str(case), "--json", "--set", "bed.count=-1")
    printed = parsed(done.out)
    assert (printed["schema"], printed["exit_code"], done.code) == ("cfddem/error/1", 2, 2)
    assert [each["message"] for each in printed["errors"]] == [
        line.removeprefix("cfddem: ") for line in done.err.splitlines()
    ]
    count = next(each for each in printed["errors"] if each["key"] == "bed.count")
    assert (count["place"], count["value"], count["limit"]) == ("--set", "-1", "above 0")
    assert any(re.search(r"bed\.toml:\d+", each["place"]) for each in printed["errors"])
    assert parsed(call("report", "nowhere", "--json").out)["errors"][0]["key"] == "folder"
    assert "--colou" in parsed(call("view", "--colou", "x", "--json").out)["errors"][0]["message"]
    flow = parsed(call("run", "liquid-bed", "--set", "inlet_velocity=0.7", "--json").out)["errors"]
    assert [each["key"] for each in flow] == ["bed.inlet_velocity"] and "terminal velocity" in flow[0]["limit"]


def test_a_run_prints_its_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The run of the tests of the command line, whose loops are compiled."""
    monkeypatch.chdir(tmp_path)
    tiny = ("start=suspended", "bed.count=50", "run.until=0.005", "run.every=0.005")
    done = call("run", "liquid-bed", "-o", "bed", "--json", *(word for each in tiny for word in ("--set", each)))
    printed = parsed(done.out)
    assert (done.code, printed["schema"], printed["status"]) == (0, "cfddem/report/1", "finished")
    again = parsed(call("resume", "bed", "--json").out)
    assert again["measures"] == printed["measures"] == parsed(call("report", "bed", "--json").out)["measures"]


def test_collisions_over_a_range_are_listed_and_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A rougher sphere keeps a thicker film and rebounds faster; the CSV file is one that `--data` reads."""
    monkeypatch.chdir(tmp_path)
    words = ("collide", "--velocity", "0.1", "--stokes", "20,100")
    listed = parsed(call(*words, "--csv", "e.csv", "--json").out)["collisions"]
    assert [each["stokes"] for each in listed] == pytest.approx([20.0, 100.0])
    rough = parsed(call(*words, "--roughness", "5e-6", "--json").out)["collisions"]
    assert all(one["restitution"] <= other["restitution"] for one, other in zip(listed, rough))
    assert {each["minimum_gap"] for each in rough} == {5e-6}
    rows = Path("e.csv").read_text().splitlines()
    assert len(rows) == 3 and rows[0].startswith("stokes [-],velocity [m/s],viscosity [Pa s],outcome,restitution [-]")
    assert "e.csv" not in call(*words, "--csv", "nowhere/e.csv").out
    rough = call(*words, "--roughness", "60")
    assert rough.code == 2 and "roughness = 60" in rough.err and "5 % of a diameter" in rough.err
    for wrong in ("1..0.5", "0..10", "..", "x", "1..inf"):
        refused = call("collide", "--velocity", "0.1", "--stokes", wrong)
        assert refused.code == 2 and "stokes" in refused.err and refused.err.count("\n") == 1, wrong


def test_the_page_for_programs_has_every_schema() -> None:
    page = (HOME / "docs/how-to/programs.md").read_text()
    assert [name for name in SCHEMAS if word(name) not in page and f"`{name}`" not in page] == []


def test_json_has_no_nan() -> None:
    assert (
        as_json({"a": float("nan"), "b": (1.0, float("inf")), "c": Path("x")})
        == '{"a": null, "b": [1.0, null], "c": "x"}'
    )
