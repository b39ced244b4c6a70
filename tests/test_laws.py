"""Every law on the shelf: its page, its two faces, and that compiled code never outlives its source."""

from __future__ import annotations

import doctest
import importlib
import inspect
import os
import pkgutil
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import closures
from closures.law import SHELF, Law, page

for _module in pkgutil.iter_modules(closures.__path__):
    importlib.import_module(f"closures.{_module.name}")

from numba import njit  # noqa: E402  the laws say first where compiled code is kept

HOUSE = Path(__file__).parents[1]
PACKAGES = ("closures", "cfddem", "scenarios")
LAWS = [card for laws in SHELF.values() for card in laws.values() if card.function.__module__.startswith("closures.")]
IMPACT = """
from scenarios.binary_collision import MATERIALS, collide
print(repr(float(collide(MATERIALS["delrin"], velocity=0.1, viscosity=0.01317).restitution)))
"""
CACHE = "from closures.compiled import cache_folder; print(cache_folder())"


def of_each_law(test: Callable[..., None]) -> Callable[..., None]:
    return pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.kind}-{law.name}")(test)


@of_each_law
def test_a_law_has_a_page(law: Law) -> None:
    """A sentence, the equation, every argument with its unit, what returns, an example, and a reference."""
    text = inspect.getdoc(law.function) or ""
    sentence, _, rest = text.partition("\n")
    assert sentence.endswith((".", ":")), "the first line is a sentence"
    assert ".. math::" in rest
    for argument in inspect.signature(law.function).parameters:
        assert argument in rest, f"{argument} is not described"
    returns = [line for line in text.splitlines() if line.startswith("returns")]
    assert len(returns) == 1
    described = rest[rest.index("returns") :].split("\n\n")[0]
    assert "[" in described or "same unit" in described, "what returns has a unit"
    assert doctest.DocTestParser().get_examples(text), "there is an example"
    assert len(law.reference) > 5
    assert page(law.function) is law
    assert set(law.ranges) <= set(inspect.signature(law.function).parameters)


@of_each_law
def test_both_faces_of_a_law_give_the_same_number(law: Law) -> None:
    """The plain face is the specification; the compiled one may differ by rounding, 1e-15 relative."""
    names = list(inspect.signature(law.function).parameters)
    arguments = ", ".join(names)
    scope = {"law": law.function}
    exec(f"def call({arguments}):\n    return law({arguments})", scope)
    compiled = njit(error_model="numpy")(scope["call"])
    random = np.random.default_rng(len(law.name))
    for _ in range(200):
        values = [plausible(name, random) for name in names]
        plain = law.function(*values)
        assert compiled(*values) == pytest.approx(plain, rel=1e-15, abs=0.0, nan_ok=True), dict(zip(names, values))


def plausible(name: str, random: np.random.Generator) -> float:
    """A random value that an argument of this name can have."""
    if name in ("restitution", "voidage", "solid_fraction"):
        return random.uniform(0.05, 0.95)
    if name.startswith("poisson"):
        return random.uniform(0.1, 0.45)
    if name == "cutoff_gap":
        return 10.0 ** random.uniform(0.0, 1.0)
    return 10.0 ** random.uniform(-3.0, 0.0)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the packages that a test may change."""
    for package in PACKAGES:
        shutil.copytree(HOUSE / package, tmp_path / "house" / package, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "house"


def run_in(house: Path, code: str, **environment: str) -> str:
    """What a piece of code prints when it runs on the packages in a folder."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=house.parent,
        env=os.environ | {"PYTHONPATH": str(house), "NUMBA_NUM_THREADS": "1"} | environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def strengthen_films(house: Path) -> None:
    """Change a constant of a law that compiled loops call from other files."""
    law = house / "closures" / "lubrication.py"
    source, constant = law.read_text(), "return 6.0 * math.pi * viscosity"
    assert constant in source
    law.write_text(source.replace(constant, "return 7.0 * math.pi * viscosity"))


def test_compiled_code_is_kept_under_a_key_of_its_sources(copy: Path, tmp_path: Path) -> None:
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    before = run_in(copy, CACHE, **kept)
    assert before.startswith(str(tmp_path / "cache"))
    assert run_in(copy, CACHE, **kept) == before
    strengthen_films(copy)
    assert run_in(copy, CACHE, **kept) != before


def test_a_child_process_finds_the_compiled_code_of_its_parent(tmp_path: Path) -> None:
    child = f"import subprocess, sys, closures.compiled; subprocess.run([sys.executable, '-c', {CACHE!r}])"
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert Path(run_in(HOUSE, child, **kept).strip()).parent == tmp_path / "cache"


@pytest.mark.slow
def test_an_edited_law_is_compiled_anew(copy: Path, tmp_path: Path) -> None:
    """A loop does not notice by itself that a law it calls in another file has changed."""
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    before = float(run_in(copy, IMPACT, **kept))
    assert float(run_in(copy, IMPACT, **kept)) == before
    strengthen_films(copy)
    assert float(run_in(copy, IMPACT, **kept)) < before - 0.05


@pytest.mark.slow
def test_a_read_only_house_without_a_home_still_runs(copy: Path, tmp_path: Path) -> None:
    """Packages that cannot be written beside, and a cache folder that cannot be made."""
    (tmp_path / "no_folder").write_text("")
    before = sorted(copy.rglob("*"))
    folders = [copy, *(place for place in before if place.is_dir())]
    for folder in folders:
        folder.chmod(0o555)
    nowhere = str(tmp_path / "no_folder" / "home")
    try:
        e = run_in(copy, IMPACT, HOME=nowhere, XDG_CACHE_HOME=nowhere, PYTHONDONTWRITEBYTECODE="1", NUMBA_CACHE_DIR="")
    finally:
        for folder in folders:
            folder.chmod(0o755)
    assert float(e) == pytest.approx(0.394, abs=2e-3)
    assert sorted(copy.rglob("*")) == before
