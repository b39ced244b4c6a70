"""The packages tell type checkers that they have types, and the wheel holds this mark."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import cfddem

HOME = Path(__file__).parents[2]
PROJECT = tomllib.loads((HOME / "pyproject.toml").read_text(encoding="utf-8"))
PACKAGES = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]

SCRIPT = """from pathlib import Path
from cfddem import Case, Simulation, check, gallery, open_run, report
from closures.drag import di_felice
case = Case.from_toml("bed.toml", {"bed.inlet_velocity": 0.05})
status: str = check(gallery()["liquid-bed"]).status
height: float = report("run").measures["bed_height"].mean
simulation = Simulation(case)
factor: float = di_felice(10.0, 0.5) * simulation.time
print(case.particle_count, status, factor, height, open_run(Path("run")).history["time"])
"""


def test_every_package_of_the_wheel_is_marked_as_typed() -> None:
    """The wheel holds every file of its packages that git does not ignore."""
    assert set(PACKAGES) == {"packages"}, "no rule leaves files out"
    for name in PACKAGES["packages"]:
        assert (HOME / name / "py.typed").read_bytes() == b""
    assert not {"py.typed", "*.typed"} & set((HOME / ".gitignore").read_text(encoding="utf-8").split())


def test_the_source_package_holds_what_its_first_page_links_to() -> None:
    """And the citation file names the version of the package."""
    kept = PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    links = re.findall(r"\]\(([\w./-]+)", (HOME / "README.md").read_text(encoding="utf-8"))
    assert len(links) > 10 and {link.split("/")[0] for link in links} <= {*kept}
    assert f"version: {cfddem.__version__}\n" in (HOME / "CITATION.cff").read_text(encoding="utf-8")


@pytest.mark.slow  # mypy reads the whole package
def test_mypy_accepts_scripts_of_users_and_finds_a_wrong_argument_in_one(tmp_path: Path) -> None:
    """Also the scripts of the first page."""
    pytest.importorskip("mypy")
    first_page = re.findall(r"```python\n(.*?)```", (HOME / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    names = [f"readme{number}.py" for number in range(len(first_page))]
    for name, text in zip(names, first_page, strict=True):
        (tmp_path / name).write_text(text, encoding="utf-8")
    assert len(names) == 3 and "simulation.fluid" in first_page[2]
    (tmp_path / "script.py").write_text(SCRIPT, encoding="utf-8")
    wrong = SCRIPT.replace("10.0", '"ten"').replace("Simulation(case)", "Simulation(10.0)")
    (tmp_path / "wrong.py").write_text(wrong, encoding="utf-8")
    mypy = [sys.executable, "-P", "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache")]
    checked = subprocess.run(
        [*mypy, "script.py", "wrong.py", *names],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(HOME)}, capture_output=True, text=True,
    )  # fmt: skip
    said = [line for line in checked.stdout.splitlines() if ": error:" in line]
    assert [line.split(": ")[0] for line in said] == ["wrong.py:7", "wrong.py:8"], checked.stdout
    assert '"Simulation"' in said[0] and '"di_felice"' in said[1], "names at the top of the package have types"
