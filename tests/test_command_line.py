"""The command line: what it says when it is asked wrongly, and that every documented example runs."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[1]
WIDTH = 100


def cfddem(*words: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command as a person would, in a terminal of 100 columns."""
    environment = os.environ | {"COLUMNS": str(WIDTH), "NUMBA_NUM_THREADS": "1", "PYTHONPATH": str(HOUSE)}
    return subprocess.run(
        [sys.executable, "-m", "cfddem.cli", *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
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
        ("validate binary-colision", ["target", "binary-colision", "did you mean 'binary-collision'"]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_mistake_ends_in_one_line_and_exit_code_2(words: str, said: list[str]) -> None:
    done = cfddem(*words.split())
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert done.stderr.startswith("cfddem: ")
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr
    for word in said:
        assert word in done.stderr


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


def test_json_can_be_parsed_and_holds_the_whole_result() -> None:
    done = cfddem("collide", "--material", "glass", "--stokes", "50", "--velocity", "0.1", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["restitution"] == pytest.approx(0.5539, abs=1e-3)
    assert result["restitution_tangential"] is None
    assert result["outcome"] == "rebound"


def test_a_dry_collision_is_said_to_be_dry() -> None:
    done = cfddem("collide", "--viscosity", "0", "--velocity", "0.1", "--json")
    result = json.loads(done.stdout)
    assert (result["mechanism"], result["stokes"]) == ("dry", None)


def documented() -> list[str]:
    """Command lines in the help texts and on the front page, without the ones that set up or validate."""
    helps = [cfddem(*words).stdout for words in (["--help"], ["collide", "--help"], ["validate", "--help"])]
    texts = [*helps, *(page.read_text() for page in (HOUSE / "README.md", HOUSE / "scenarios" / "README.md"))]
    found = re.findall(r"(?:^|Example: +|`|/)(cfddem [a-z][^`\n]*?)(?= *(?:`|$|│))", "\n".join(texts), re.MULTILINE)
    return sorted({line for line in found if "validate" not in line and "<" not in line})


def test_documented_examples_run(tmp_path: Path) -> None:
    examples = documented()
    assert "cfddem collide --material delrin --stokes 30 --velocity 0.1" in examples
    for example in examples:
        done = cfddem(*shlex.split(example)[1:], folder=tmp_path)
        assert done.returncode == 0, f"{example}: {done.stderr}"
        assert "--json" in example or max(map(len, done.stdout.splitlines())) <= WIDTH


@pytest.mark.parametrize("words", ["--help", "collide --help", "validate --help", "--version"])
def test_help_fits_a_narrow_terminal(words: str) -> None:
    done = cfddem(*words.split())
    assert done.returncode == 0
    assert max(map(len, done.stdout.splitlines())) <= WIDTH


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
