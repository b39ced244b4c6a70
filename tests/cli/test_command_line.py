"""The command line: wrong input ends in one clear line, and every documented example runs."""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from contextlib import redirect_stderr
from importlib.util import find_spec
from pathlib import Path

import pytest
from command_line import HOME, WIDTH, call, cfddem, commands, parsed
from example_case import TEXT

from cfddem.case.schema import Case
from cfddem.cli.app import main


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("collide --stokes 30 --velocity 0.1 --diameter -0.01", ["diameter", "-0.01", "between 1e-9 and 1000 m"]),
        ("collide --stokes 30 --velocity nan", ["velocity", "nan", "finite"]),
        ("collide --stokes inf --velocity 0.1", ["stokes", "inf", "finite"]),
        ("collide --stokes 30 --velocity 0.1 --material wood", ["material", "wood", "delrin"]),
        ("collide --stokes 30 --velocity 0.1 --target oak", ["target = ", "oak", "delrin"]),
        (
            "collide --stokes 30 --velocity 0.1 --viscosity 0.001",
            ["velocity", "viscosity", "stokes", "two of the three"],
        ),
        ("collide --stokes 30", ["velocity", "viscosity", "stokes", "two of the three"]),
        ("collide --stokes 30 --velocity 0.1 --angle 95", ["angle", "95", "below 90"]),
        ("collide --stokes 30 --velocity 0.1 --against floor", ["against", "floor", "sphere, wall"]),
        ("collide --stokes 30 --velocity 0.1 --trajectory ful", ["trajectory", "ful", "did you mean 'full'"]),
        ("collide --stokes 30 --velocity fast", ["velocity", "fast", "float"]),
        ("collide --stoke 30 --velocity 0.1", ["--stoke"]),
        ("collid --stokes 30", ["collid"]),
        ("check liquid-bed --set roughness=1e-6", ["roughness", "material.NAME.roughness"]),
        ("check liquid-bed --set inlet_velocity=-0.1", ["bed.inlet_velocity = -0.1", "at least 0"]),
        ("sweep liquid-bed --over inlet_velocity=0.02,-0.1", ["--over bed.inlet_velocity = -0.1", "at least 0"]),
        ("sweep liquid-bed --over seed=1..2 --set inlet_velocity=-0.1", ["--set bed.inlet_velocity = -0.1"]),
        ("explain nijsen", ["law", "nijsen", "did you mean 'nijssen'?"]),
        ("explain di_felice --plot nowhere/a.png", ["output = 'nowhere/a.png'", "create nowhere first"]),
        ("view . --movie nowhere/a.gif", ["output = 'nowhere/a.gif'", "create nowhere first"]),
        ("validate binary-colision", ["target", "binary-colision", "did you mean 'binary-collision'"]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_wrong_input_ends_in_one_line_and_exit_code_2(words: str, said: list[str]) -> None:
    done = call(*words.split())
    assert done.code == 2, done.err
    assert done.out == ""
    assert done.err.startswith("cfddem: ")
    assert done.err.count("\n") == 1
    for word in said:
        assert word in done.err


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"restitution": 1.2}, "restitution = 1.2: must be at most 1"),
        ({"restitution": 0.0}, "restitution = 0.0: must be above 0"),
        ({"density": -1.0}, "density = -1.0: must be above 0"),
        ({"youngs_modulus": float("nan")}, "youngs_modulus = nan: must be "),
        ({"poisson": 0.6}, "poisson = 0.6: must be at most 0.5"),
        ({"restituton": 0.9}, "did you mean 'restitution'"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_impossible_material_is_refused_in_one_line(values: dict[str, float], said: str) -> None:
    from cfddem.backend.errors import InputError
    from cfddem.case.materials import Material

    good = {"density": 2500.0, "youngs_modulus": 60e9, "poisson": 0.23, "restitution": 0.9}
    with pytest.raises(InputError) as refusal:
        Material(**(good | values))
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_long_error_is_wrapped_between_words_on_a_terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["cfddem", "check", "liquid-bed", "--set", "laws.drag=x"])
    monkeypatch.setenv("COLUMNS", "120")
    with redirect_stderr(Terminal()) as seen, pytest.raises(SystemExit):
        main()
    reported = seen.getvalue().splitlines()
    assert len(reported) > 1 and max(map(len, reported)) <= WIDTH
    assert " ".join(line.strip() for line in reported) == call(*sys.argv[1:]).err.strip()


def test_json_can_be_parsed_and_holds_the_whole_result() -> None:
    done = call("collide", "--material", "glass", "--stokes", "50", "--velocity", "0.1", "--json")
    assert done.code == 0, done.err
    result = parsed(done.out)
    assert result["restitution"] == pytest.approx(0.5539, abs=1e-3)
    assert result["restitution_tangential"] is None
    assert result["outcome"] == "rebound"


def test_small_products_of_matrices_take_one_thread_unless_a_user_says_so() -> None:
    said = "import cfddem, sys; early = 'numpy' in sys.modules; import cfddem.cli, os; print(early, os.environ['{}'])"
    name = "OPENBLAS_NUM_THREADS"
    for chosen, expected in (({}, "1"), ({name: "2"}, "2")):
        others = {key: value for key, value in os.environ.items() if key != name}
        command = [sys.executable, "-c", said.format(name)]
        told = subprocess.run(command, env=others | chosen, capture_output=True, text=True, check=True)
        assert told.stdout.split() == ["False", expected]


def test_a_collision_without_viscosity_is_dry() -> None:
    result = parsed(call("collide", "--viscosity", "0", "--velocity", "0.1", "--json").out)
    assert (result["mechanism"], result["stokes"]) == ("dry", None)


# ---------------------------------------------------------------- every documented command, as it stands

ORDER = ("new", "check", "run", "resume", "report", "view", "export", "sweep")
"""Later commands read what earlier ones have written."""


def quick(line: str) -> bool:
    """Whether a command takes seconds: no comparison with the literature, no run of a whole demonstration, and no loops
    that few others use."""
    verb = line.split()[1]
    return verb not in ("validate", "bench", "wet-pair", "wet-wall", "three-spheres", "film-impact") and (
        verb not in ("run", "sweep") or "until=" in line
    )


def documented() -> list[str]:
    """Command lines in the help of every command, on the front page and in the gallery."""
    helps = [call(name, "--help").out for name in commands()]
    pages = [page.read_text() for page in (HOME / "README.md", HOME / "scenarios" / "README.md")]
    found = re.findall(
        r"(?:^|Example: +|`|/)(cfddem [a-z][^`\n]*?)(?= *(?:`|$|│))", "\n".join([*helps, *pages]), re.MULTILINE
    )
    places = {name: place for place, name in enumerate(ORDER)}
    tried = {*commands()} - {"calibrate"}  # needs data and Optuna: see the page of that name
    lines = {line for line in found if "<" not in line and line.split()[1] in tried}
    return sorted(lines, key=lambda line: (places.get(line.split()[1], len(ORDER)), line))


def test_every_command_has_an_example() -> None:
    for name in commands():
        text = call(name, "--help").out
        assert f"Example: cfddem {name}" in text, name


def test_documented_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from cfddem.plotting.rendering import why_not

    monkeypatch.chdir(tmp_path)
    examples = [each for each in documented() if quick(each)]
    assert "cfddem collide --material delrin --stokes 30 --velocity 0.1" in examples
    assert len(examples) >= 15
    for example in examples:
        verb = example.split()[1]
        if (verb == "view" and why_not()) or (verb == "export" and find_spec("pandas") is None):
            continue  # no graphics here, or the extra packages of export are not installed
        done = call(*shlex.split(example)[1:])
        assert done.code == 0, f"{example}: {done.err}"
        assert (
            "--json" in example or " schema" in example or max(map(len, done.out.splitlines()), default=0) <= WIDTH
        ), example


@pytest.mark.slow
def test_documented_examples_that_take_minutes_run(tmp_path: Path) -> None:
    for example in documented():
        if not quick(example) and "tumbler" not in example:
            done = cfddem(*shlex.split(example)[1:], folder=tmp_path, seconds=1800)
            assert done.returncode == 0, f"{example}: {done.stderr}"


def test_help_fits_a_narrow_terminal() -> None:
    for words in ([], *([name] for name in commands())):
        done = call(*words, "--help")
        assert done.code == 0
        assert max(map(len, done.out.splitlines())) <= WIDTH, words
        assert "\x1b" not in done.out
    assert "Exit codes: 0 success" in call("--help").out
    assert re.fullmatch(r"\d+\.\d+\.\d+\n", call("--version").out)


# ---------------------------------------------------------------- cases

TINY = ("--set", "start=suspended", "--set", "bed.count=50", "--set", "run.until=0.01", "--set", "run.every=0.005")


def test_a_new_case_is_checked_run_and_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "liquid-bed" in call("new").out
    assert call("new", "liquid-bed").code == 0
    before = (tmp_path / "liquid_bed.toml").read_bytes()
    again = call("new", "liquid-bed")
    assert (again.code, again.err.count("\n")) == (2, 1)
    assert "does not exist yet" in again.err and (tmp_path / "liquid_bed.toml").read_bytes() == before
    checked = call("check")
    assert checked.code == 0 and checked.out.splitlines()[-1].startswith("ok: ")
    assert [path.name for path in tmp_path.iterdir()] == ["liquid_bed.toml"], "check writes nothing"
    done = call("run", *TINY, "-o", "bed")
    assert done.code == 0, done.err
    assert "pressure drop" in done.out and "particles lost" in done.out
    taken = call("run", *TINY, "-o", "bed")
    assert taken.code == 2 and "continue that run with" in taken.err
    assert call("resume", "bed", "--until", "0.015").code == 0
    result = parsed(call("report", "--json").out)
    assert (result["status"], result["window"][1]) == ("finished", pytest.approx(0.015))


@pytest.mark.parametrize("command", ["report", "view", "resume", "export"])
def test_a_run_folder_of_an_earlier_version_is_refused_in_one_line(command: str, tmp_path: Path) -> None:
    folder = tmp_path / "bed"
    folder.mkdir()
    (folder / "run.json").write_text('{"format": 1}')
    (folder / "case.toml").write_text(TEXT)
    done = call(command, str(folder))
    assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)
    assert "run.json: format = 1: must be 2; " in done.err
    assert "earlier version" in done.err and "case.toml again" in done.err
    assert sorted(path.name for path in folder.iterdir()) == ["case.toml", "run.json"]


def test_all_input_errors_of_a_case_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "liquid_bed.toml"
    path.write_text(TEXT.replace("count = 2000", 'cuont = "many"').replace("until = 3.0", "until = -3.0"))
    for command in ("check", "run"):
        done = call(command, "--set", "restituton=1")
        assert done.code == 2 and "did you mean 'restitution'" not in done.err
        done = call(command, "--set", "sides=sticky")
        assert done.code == 2
        reported = done.err.splitlines()
        assert len(reported) == 3 and all(line.startswith("cfddem: ") for line in reported)
        assert any("liquid_bed.toml:27: bed.cuont" in line and "did you mean 'count'" in line for line in reported)
        assert any("run.until = -3.0: must be above 0" in line for line in reported)
        assert any("--set column.sides = 'sticky'" in line for line in reported)
    assert [each.name for each in tmp_path.iterdir()] == ["liquid_bed.toml"]


def test_the_status_of_the_check_sets_the_exit_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    low, high = ("--set", "inlet_velocity=0.007", "--set", "start=poured"), ("--set", "inlet_velocity=0.7")
    codes = [call("check", "liquid-bed", *given).code for given in ((), low, (*low, "--strict"), high)]
    assert codes == [0, 0, 1, 2]
    refused = call("run", "liquid-bed", *high)
    assert refused.code == 2 and "above the terminal velocity" in refused.err
    assert list(tmp_path.iterdir()) == []
    assert parsed(call("check", "liquid-bed", *high, "--json").out)["status"] == "error"
    shared, refused = (call("check", "liquid-bed", "--ranks", ranks) for ranks in ("2", "40"))
    assert shared.code == 0 and "can share the case, about 800 particles each" in shared.out
    assert "1 x 1 x 2 bricks, the least work" in shared.out
    given = call("check", "liquid-bed", "--set", "column.width=0.06", "--division", "2x2x2")
    assert "2 x 2 x 2 bricks, as given" in given.out
    assert "ranks along x, y and z, such as 2x2x1" in call("check", "liquid-bed", "--division", "2x2").err
    assert refused.code == 2 and "error: ranks: 40 must be at most" in refused.out


def test_the_schema_is_json() -> None:
    assert json.loads(call("new", "--schema").out)["properties"]["bed"]


def test_the_status_is_coloured_on_a_terminal_only(monkeypatch: pytest.MonkeyPatch) -> None:
    from cfddem.cli.cases import with_colour

    lines = ["warning: bed.count: too many", "  a warning: inside a line"]
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert list(with_colour(lines)) == lines
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    assert list(with_colour(lines)) == ["\x1b[33mwarning\x1b[0m: bed.count: too many", lines[1]]
    monkeypatch.setenv("NO_COLOR", "1")
    assert list(with_colour(lines)) == lines


# ---------------------------------------------------------------- sweeps


def test_a_sweep_keeps_finished_runs_lists_failed_ones_and_continues(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    line = ("sweep", "liquid-bed", "--over", "inlet_velocity=0.1,0.7", "--over", "seed=1..2", *TINY, "-o", "many")
    done = call(*line)
    assert done.code == 3
    failed = done.err.splitlines()
    assert len(failed) == 2 and all("inlet_velocity-0.7" in each and "terminal velocity" in each for each in failed)
    table = (tmp_path / "many" / "sweep.csv").read_text().splitlines()
    assert table[0].startswith("run,bed.inlet_velocity,bed.seed,status,bed_height [m],bed_height error")
    assert [row.split(",")[3] for row in table[1:]] == ["finished", "finished", "refused", "refused"]
    assert (tmp_path / "many" / "sweep.png").stat().st_size > 10_000
    written = {path: path.stat().st_mtime_ns for path in (tmp_path / "many").glob("*/data/*.h5")}
    again = call(*line, "--json")
    outcomes = parsed(again.out)["runs"]
    assert [each["kept"] for each in outcomes] == [True, True, False, False]
    assert written == {path: path.stat().st_mtime_ns for path in (tmp_path / "many").glob("*/data/*.h5")}
    (tmp_path / "heights.csv").write_text("velocity [m/s], bed height [m]\n0.1, 0.03\n")
    data = call(*line, "--json", "--set", f"compare.heights.file={tmp_path / 'heights.csv'}")
    assert [each["kept"] for each in parsed(data.out)["runs"]] == [True, True, False, False], (
        "data change nothing in a run"
    )
    other = call(*line, "--set", "diameter=0.003")
    assert "a folder of the same case" in other.err


def test_a_stopped_sweep_begins_no_further_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from cfddem.studies import sweep

    def one(case: Case, values: dict[str, int], folder: Path, alone: bool, laws: Sequence[Path]) -> sweep.Outcome:
        status = "stopped" if values["bed.seed"] == 2 else "failed"
        return sweep.Outcome(str(folder), values, status, "of a test")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sweep, "_one", one)
    done = call("sweep", "liquid-bed", "--over", "seed=1..4", "-o", "many")
    assert done.code == 3
    said = [line.split(": ")[2].split(";")[0] for line in done.err.splitlines()]
    assert said == ["failed", "stopped", "waiting", "waiting"]


@pytest.mark.parametrize(
    ("over", "said"),
    [
        (["seed"], "key=value,value"),
        (["seed=5..1"], "smaller first"),
        (["seed=1..200000"], "at most 10000 runs"),
        (["seeed=1"], "did you mean 'seed'"),
        (["seed=1,2", "bed.seed=3"], "given once"),
        (["seed=1,1"], "a different name for every run"),
        (["diameter=-1,0.001"], "bed.diameter = -1: must be above 0"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_a_wrong_sweep_is_refused_before_anything_runs(
    over: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = call("sweep", "liquid-bed", *(word for each in over for word in ("--over", each)))
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert said in done.err
    assert list(tmp_path.iterdir()) == []
