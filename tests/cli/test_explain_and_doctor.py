"""Documentation of laws on the command line, checks of the machine, and how the package can be started."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import HOME, WIDTH, call, cfddem, commands, parsed

from cfddem.case.input_errors import TABLES, absent
from cfddem.cli.app import app


def test_the_documentation_of_every_law_is_readable_text(tmp_path: Path) -> None:
    from cfddem.cli import explain_pages as pages

    every = [law for kind in pages.laws().values() for law in kind.values()]
    assert len(every) > 60
    listed = call("explain").out
    assert "for voidage 0.4 to 1, reynolds 0 to 1000\n" in listed
    for law in every:
        text = "\n".join(pages.page(law))
        assert f"  {law.name}" in listed
        assert max(map(len, text.splitlines())) <= WIDTH
        assert not re.search(r"\\|\bfrac\b|varepsilon|:func:|``", text), text
        assert " ".join(law.reference.split()[:2]) in text
    done = call("explain", "di_felice", "--plot", str(tmp_path / "law.png"))
    assert "range of voidage: 0.4 to 1" in done.out
    assert (tmp_path / "law.png").stat().st_size > 10_000
    assert parsed(call("explain", "wen-yu", "--json").out)["laws"][0]["kind"] == "drag"
    drags = call("explain", "drag").out
    assert (
        "di_felice" in drags
        and "asperities" not in drags
        and len(parsed(call("explain", "drag", "--json").out)["laws"]) > 9
    )
    found = call("explain", "richardson").out
    assert "exponent_richardson_zaki" in found and "wen_yu" not in found
    assert call("explain", "bed.inlet_velocity").out.startswith("bed.inlet_velocity = 0.0")
    assert call("explain", "sharp").out.startswith("laws.surface = ")  # a choice of a key
    assert call("explain", "fluid").out.startswith("fluid.density") and "drag" not in call("explain", "fluid").out
    keys = call("explain", "bed").out
    assert "bed.diameter " in keys and "column.width" not in keys and max(map(len, keys.splitlines())) <= 100
    both = call("explain", "stokes")
    assert both.code == 2 and "drag.stokes or " in both.err and call("explain", "drag.stokes").code == 0
    assert "bed.jet.velocity = (required)" in call("explain", "bed.jet").out
    assert call("explain", "wall.shape").out.startswith("wall.NUMBER.shape")
    for name, said in (("KochHillDrag", "did you mean 'koch_hill'?"), ("MeiLift", "see laws.lift")):
        assert said in call("explain", name).err
    unknown = call("explain", "di_felcie")
    assert unknown.code == 2 and "di_felice" in unknown.err


def test_what_is_not_there_is_said_of_tables_and_of_words_that_are_asked_for() -> None:
    from cfddem.cli import explain_pages as pages

    heat = call("explain", "heat").out
    assert heat.count("Not there:") == 1 and "viscosity that changes" in heat
    assert max(map(len, heat.splitlines())) <= WIDTH
    assert "reactions" in parsed(call("explain", "heat", "--json").out)["not_there"]
    assert call("explain", "bed.diameter").out.count("Not there") == 0
    assert "[contact_heat] of contacts" in call("explain", "cooling").err
    assert call("explain", "sieve").out.startswith("bed.sizes"), "a word of a description"
    for words in (
        ("check", "liquid-bed", "--set", "fluid.turbulence=1"),
        ("check", "liquid-bed", "--set", "k_epsilon=1"),
    ):
        refused = call(*words)
        assert refused.code == 2 and "no turbulence model acts in a case" in refused.err
    known = {name for name, _ in pages._keys()}
    assert not [name for name in known if absent(name.rpartition(".")[2])], "a key that there is"
    assert TABLES.keys() <= {name.partition(".")[0] for name in known}


def test_every_argument_of_every_law_is_plotted_with_its_unit() -> None:
    from cfddem.cli import explain_pages as pages

    every = [law for kind in pages.laws().values() for law in kind.values()]
    bare = [
        f"{law.kind}.{law.name}: {name}"
        for law in every
        if law.function.__module__.startswith("closures.")  # other tests register laws of their own
        for name in [*inspect.signature(law.function).parameters, "returns"]
        if "unit not given" in pages.unit(law, name)
    ]
    assert not bare, "\n".join(bare)
    assert pages.unit(pages.find("asperities"), "roughness_j") == "m"


def test_the_doctor_lists_versions_and_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    answers = {each["name"]: each for each in parsed(call("doctor", "--quick", "--json").out)["checks"]}
    assert {"cfddem", "python", "packages", "threads", "compiled loops", "folder"} <= set(answers)
    assert "numba" in answers["packages"]["text"]
    assert list(tmp_path.iterdir()) == []


def test_the_test_run_of_the_doctor_balances() -> None:
    from cfddem.cli.information import _test_run

    answer = _test_run()
    assert answer.ok, answer.text


def test_piped_output_is_plain_text() -> None:
    for words in (["--help"], ["check", "liquid-bed"], ["explain"]):
        done = cfddem(*words)
        assert done.returncode == 0
        assert "\x1b" not in done.stdout + done.stderr
        assert max(map(len, done.stdout.splitlines())) <= WIDTH


def test_completion_can_be_installed(tmp_path: Path) -> None:
    script = app.generate_completion(shell="bash")
    assert all(name in script for name in commands())


LIMITED = "import resource\nresource.setrlimit(resource.RLIMIT_CPU, (200, 200))\n"
"""At most 200 s of processor time, with compilation: other work on the machine does not count."""


def test_python_code_in_the_readme_runs() -> None:
    """The first block as a program of its own."""
    first, *others = re.findall(r"```python\n(.*?)```", (HOME / "README.md").read_text(), re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-c", LIMITED + first],
        env=os.environ | {"PYTHONPATH": str(HOME), "NUMBA_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=1500,
    )
    assert done.returncode == 0, done.stderr
    for block in others:
        exec(compile(block, "README.md", "exec"), {"__name__": "readme"})


def test_the_package_runs_as_a_module() -> None:
    done = subprocess.run([sys.executable, "-m", "cfddem", "explain", "wen-yu"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.startswith("wen_yu, drag")
