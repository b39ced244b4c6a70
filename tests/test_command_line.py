"""The command line: what it says when it is asked wrongly, and that every documented example runs."""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import pytest
from example_case import TEXT

from cfddem.case import Case
from cfddem.cli import app, main

HOUSE = Path(__file__).parents[1]
WIDTH = 100


class Done(NamedTuple):
    """What a command has said, and how it ended."""

    code: int
    out: str
    err: str


def call(*words: str) -> Done:
    """Run a command in this process, in a terminal of 100 columns."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["cfddem", *words])
        patch.setenv("COLUMNS", str(WIDTH))
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
    return Done(code, out.getvalue(), err.getvalue())


def cfddem(*words: str, folder: Path | None = None, seconds: float = 120) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own, in a terminal of 100 columns."""
    environment = os.environ | {"COLUMNS": str(WIDTH), "NUMBA_NUM_THREADS": "1", "PYTHONPATH": str(HOUSE)}
    return subprocess.run(
        [sys.executable, "-m", "cfddem.cli", *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=seconds,
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("collide --stokes 30 --velocity 0.1 --diameter -0.01", ["diameter", "-0.01", "above 0"]),
        ("collide --stokes 30 --velocity nan", ["velocity", "nan", "finite"]),
        ("collide --stokes inf --velocity 0.1", ["stokes", "inf", "finite"]),
        ("collide --stokes 30 --velocity 0.1 --material wood", ["material", "wood", "delrin"]),
        ("collide --stokes 30 --velocity 0.1 --target oak", ["material", "oak", "delrin"]),
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
        ("explain di_felice --plot nowhere/a.png", ["output = 'nowhere/a.png'", "make nowhere first"]),
        ("view . --movie nowhere/a.gif", ["output = 'nowhere/a.gif'", "make nowhere first"]),
        ("validate binary-colision", ["target", "binary-colision", "did you mean 'binary-collision'"]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_mistake_ends_in_one_line_and_exit_code_2(words: str, said: list[str]) -> None:
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
def test_a_material_that_cannot_be_is_refused_in_one_line(values: dict[str, float], said: str) -> None:
    from cfddem.errors import InputError
    from cfddem.materials import Material

    good = {"density": 2500.0, "youngs_modulus": 60e9, "poisson": 0.23, "restitution": 0.9}
    with pytest.raises(InputError) as refusal:
        Material(**(good | values))
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_long_mistake_is_broken_between_words_on_a_terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["cfddem", "check", "liquid-bed", "--set", "laws.drag=x"])
    monkeypatch.setenv("COLUMNS", "120")
    with redirect_stderr(Terminal()) as seen, pytest.raises(SystemExit):
        main()
    told = seen.getvalue().splitlines()
    assert len(told) > 1 and max(map(len, told)) <= WIDTH
    assert " ".join(line.strip() for line in told) == call(*sys.argv[1:]).err.strip()


def test_json_can_be_parsed_and_holds_the_whole_result() -> None:
    done = call("collide", "--material", "glass", "--stokes", "50", "--velocity", "0.1", "--json")
    assert done.code == 0, done.err
    result = json.loads(done.out)
    assert result["restitution"] == pytest.approx(0.5539, abs=1e-3)
    assert result["restitution_tangential"] is None
    assert result["outcome"] == "rebound"


def test_a_dry_collision_is_said_to_be_dry() -> None:
    result = json.loads(call("collide", "--viscosity", "0", "--velocity", "0.1", "--json").out)
    assert (result["mechanism"], result["stokes"]) == ("dry", None)


# ---------------------------------------------------------------- every documented command, as it stands

ORDER = ("new", "check", "run", "resume", "report", "view", "export", "sweep")
"""Later ones look at what earlier ones have written."""


def quick(line: str) -> bool:
    """Whether a command takes seconds: no comparison with the literature, no run of a whole demonstration."""
    verb = line.split()[1]
    return verb not in ("validate", "bench") and (verb not in ("run", "sweep") or "until=" in line)


def commands() -> list[str]:
    """Names of all commands."""
    return sorted(name for name in app if not name.startswith("-"))


def documented() -> list[str]:
    """Command lines in the help of every command, on the front page and in the gallery."""
    helps = [call(name, "--help").out for name in commands()]
    pages = [page.read_text() for page in (HOUSE / "README.md", HOUSE / "scenarios" / "README.md")]
    found = re.findall(
        r"(?:^|Example: +|`|/)(cfddem [a-z][^`\n]*?)(?= *(?:`|$|│))", "\n".join([*helps, *pages]), re.MULTILINE
    )
    places = {name: place for place, name in enumerate(ORDER)}
    lines = {line for line in found if "<" not in line and line.split()[1] in commands()}
    return sorted(lines, key=lambda line: (places.get(line.split()[1], len(ORDER)), line))


def test_every_command_has_an_example() -> None:
    for name in commands():
        text = call(name, "--help").out
        assert f"Example: cfddem {name}" in text, name


def test_documented_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from cfddem.view.rendering import why_not

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
        assert "--json" in example or max(map(len, done.out.splitlines()), default=0) <= WIDTH, example


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
    assert "Exit codes: 0 all is well" in call("--help").out
    assert re.fullmatch(r"\d+\.\d+\.\d+\n", call("--version").out)


# ---------------------------------------------------------------- cases, from the door to the report

TINY = ("--set", "start=suspended", "--set", "bed.count=50", "--set", "run.until=0.01", "--set", "run.every=0.005")


def test_a_new_case_is_checked_run_and_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "liquid-bed" in call("new").out
    assert call("new", "liquid-bed").code == 0
    before = (tmp_path / "liquid_bed.toml").read_bytes()
    again = call("new", "liquid-bed")
    assert (again.code, again.err.count("\n")) == (2, 1)
    assert "not there yet" in again.err and (tmp_path / "liquid_bed.toml").read_bytes() == before
    checked = call("check")
    assert checked.code == 0 and checked.out.splitlines()[-1].startswith("green")
    assert [path.name for path in tmp_path.iterdir()] == ["liquid_bed.toml"], "check writes nothing"
    done = call("run", *TINY, "-o", "bed")
    assert done.code == 0, done.err
    assert "pressure drop" in done.out and "particles lost" in done.out
    taken = call("run", *TINY, "-o", "bed")
    assert taken.code == 2 and "holds no run yet" in taken.err
    assert call("resume", "bed", "--until", "0.015").code == 0
    result = json.loads(call("report", "--json").out)
    assert (result["status"], result["window"][1]) == ("finished", pytest.approx(0.015))


def test_a_case_tells_all_its_mistakes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "liquid_bed.toml"
    path.write_text(TEXT.replace("count = 2000", 'cuont = "many"').replace("until = 3.0", "until = -3.0"))
    for command in ("check", "run"):
        done = call(command, "--set", "restituton=1")
        assert done.code == 2 and "did you mean 'restitution'" not in done.err
        done = call(command, "--set", "sides=sticky")
        assert done.code == 2
        told = done.err.splitlines()
        assert len(told) == 3 and all(line.startswith("cfddem: ") for line in told)
        assert any("liquid_bed.toml:27: bed.cuont" in line and "did you mean 'count'" in line for line in told)
        assert any("run.until = -3.0: must be above 0" in line for line in told)
        assert any("--set column.sides = 'sticky'" in line for line in told)
    assert [each.name for each in tmp_path.iterdir()] == ["liquid_bed.toml"]


def test_the_colour_of_the_card_is_the_exit_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    amber, red = ("--set", "inlet_velocity=0.03"), ("--set", "inlet_velocity=0.7")
    assert [call("check", "liquid-bed", *given).code for given in ((), amber, (*amber, "--strict"), red)] == [
        0,
        0,
        1,
        2,
    ]
    refused = call("run", "liquid-bed", *red)
    assert refused.code == 2 and "above the terminal velocity" in refused.err
    assert list(tmp_path.iterdir()) == []
    assert json.loads(call("check", "liquid-bed", *red, "--json").out)["colour"] == "red"


def test_the_schema_is_json() -> None:
    assert json.loads(call("new", "--schema").out)["properties"]["bed"]


# ---------------------------------------------------------------- sweeps


def test_a_sweep_keeps_what_runs_lists_what_fails_and_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
    outcomes = json.loads(again.out)
    assert [each["kept"] for each in outcomes] == [True, True, False, False]
    assert written == {path: path.stat().st_mtime_ns for path in (tmp_path / "many").glob("*/data/*.h5")}
    other = call(*line, "--set", "diameter=0.003")
    assert "a folder of the same case" in other.err


def test_a_sweep_that_is_stopped_begins_no_further_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from cfddem import sweep

    def one(case: Case, values: dict[str, int], folder: Path, alone: bool) -> sweep.Outcome:
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
        (["seed=1,1"], "another name for every run"),
        (["diameter=-1,0.001"], "bed.diameter = -1: must be above 0"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_a_wrong_sweep_is_told_before_anything_runs(
    over: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = call("sweep", "liquid-bed", *(word for each in over for word in ("--over", each)))
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert said in done.err
    assert list(tmp_path.iterdir()) == []


# ---------------------------------------------------------------- laws and machine


def test_the_page_of_every_law_can_be_read(tmp_path: Path) -> None:
    from cfddem import pages

    shelf = [law for kind in pages.laws().values() for law in kind.values()]
    assert len(shelf) > 60
    listed = call("explain").out
    assert "for voidage 0.4 to 1, reynolds 0 to 1000\n" in listed
    for law in shelf:
        text = "\n".join(pages.page(law))
        assert f"  {law.name}" in listed
        assert max(map(len, text.splitlines())) <= WIDTH
        assert not re.search(r"\\|frac|varepsilon|:func:|``", text), text
        assert " ".join(law.reference.split()[:2]) in text
    done = call("explain", "di_felice", "--plot", str(tmp_path / "law.png"))
    assert "fitted for voidage from 0.4 to 1" in done.out
    assert (tmp_path / "law.png").stat().st_size > 10_000
    assert json.loads(call("explain", "wen-yu", "--json").out)["kind"] == "drag"
    unknown = call("explain", "di_felic")
    assert unknown.code == 2 and "di_felice" in unknown.err


def test_the_doctor_names_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    answers = {each["name"]: each for each in json.loads(call("doctor", "--quick", "--json").out)}
    assert {"cfddem", "python", "packages", "threads", "compiled loops", "folder"} <= set(answers)
    assert "numba" in answers["packages"]["text"]
    assert list(tmp_path.iterdir()) == []


def test_the_self_test_closes_its_ledger() -> None:
    from cfddem.doctor import _self_test

    answer = _self_test()
    assert answer.fine, answer.text


def test_what_is_piped_is_plain() -> None:
    for words in (["--help"], ["check", "liquid-bed"], ["explain"]):
        done = cfddem(*words)
        assert done.returncode == 0
        assert "\x1b" not in done.stdout + done.stderr
        assert max(map(len, done.stdout.splitlines())) <= WIDTH


def test_completion_can_be_installed(tmp_path: Path) -> None:
    script = app.generate_completion(shell="bash")
    assert all(name in script for name in commands())


def test_python_on_the_front_page_runs() -> None:
    blocks = re.findall(r"```python\n(.*?)```", (HOUSE / "README.md").read_text(), re.DOTALL)
    assert blocks
    for block in blocks:
        done = subprocess.run(
            [sys.executable, "-c", block],
            env=os.environ | {"PYTHONPATH": str(HOUSE), "NUMBA_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr


def test_the_module_is_the_command() -> None:
    done = subprocess.run([sys.executable, "-m", "cfddem", "explain", "wen-yu"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.startswith("wen_yu, drag")
