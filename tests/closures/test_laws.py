"""All laws: docstrings, compiled against interpreted values, and the cache of compiled code."""

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
from closures.linked import CALLED
from closures.registry import REGISTRY, Law, law_of

for _module in pkgutil.iter_modules(closures.__path__):
    importlib.import_module(f"closures.{_module.name}")

from numba import njit  # noqa: E402  after closures.compiled, which sets the cache folder

ROOT = Path(__file__).parents[2]
PACKAGES = ("closures", "cfddem", "scenarios")
LAWS = [
    entry for laws in REGISTRY.values() for entry in laws.values() if entry.function.__module__.startswith("closures.")
]
IMPACT = """
from scenarios.collisions.immersed_pair import MATERIALS, collide
print(repr(float(collide(MATERIALS["delrin"], velocity=0.1, viscosity=0.01317).restitution)))
"""
CACHE = "from closures.compiled import cache_folder; print(cache_folder())"


def for_each_law(test: Callable[..., None]) -> Callable[..., None]:
    return pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.kind}-{law.name}")(test)


@for_each_law
def test_docstring_of_a_law_is_complete(law: Law) -> None:
    """Sentence, equation, arguments and return value with units, range, example, and a reference."""
    text = inspect.getdoc(law.function) or ""
    sentence, _, rest = text.partition("\n")
    assert sentence.endswith((".", ":")), "the first line must be a sentence"
    assert ".. math::" in rest
    for argument in inspect.signature(law.function).parameters:
        assert argument in rest, f"{argument} is not described"
    returns = [line for line in text.splitlines() if line.startswith("returns")]
    assert len(returns) == 1
    described = rest[rest.index("returns") :].split("\n\n")[0]
    assert "[" in described or "same unit" in described, "the return value needs a unit"
    assert "\nRange: " in text, "the valid range is missing"
    assert doctest.DocTestParser().get_examples(text), "an example is missing"
    assert len(law.reference) > 5
    assert law_of(law.function) is law
    assert set(law.ranges) <= set(inspect.signature(law.function).parameters)


@for_each_law
def test_compiled_law_equals_the_interpreted_law(law: Law) -> None:
    """Within 1e-15 relative."""
    names = list(inspect.signature(law.function).parameters)
    arguments = ", ".join(names)
    scope = {"law": law.function}
    exec(f"def call({arguments}):\n    return law({arguments})", scope)
    compiled = njit(**CALLED)(scope["call"])
    random = np.random.default_rng(len(law.name))
    for _ in range(200):
        values = [plausible(name, random) for name in names]
        plain = law.function(*values)
        assert compiled(*values) == pytest.approx(plain, rel=1e-15, abs=0.0, nan_ok=True), dict(zip(names, values))


def plausible(name: str, random: np.random.Generator) -> float:
    """A random value for an argument of this name."""
    if name in ("restitution", "voidage", "solid_fraction"):
        return random.uniform(0.05, 0.95)
    if name.startswith("poisson"):
        return random.uniform(0.1, 0.45)
    if name == "cutoff_gap":
        return 10.0 ** random.uniform(0.0, 1.0)
    return 10.0 ** random.uniform(-3.0, 0.0)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the packages for a test to modify."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / "copy" / package, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "copy"


def run_in(root: Path, code: str, **environment: str) -> str:
    """Output of a piece of code, run with the packages in a folder."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=root.parent,
        env=os.environ | {"PYTHONPATH": str(root), "NUMBA_NUM_THREADS": "1"} | environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def strengthen_films(root: Path) -> None:
    """Change a constant of a law that compiled loops of other files call."""
    law = root / "closures" / "lubrication.py"
    source, constant = law.read_text(), "return 6.0 * math.pi * viscosity"
    assert constant in source
    law.write_text(source.replace(constant, "return 7.0 * math.pi * viscosity"))


def test_cache_folder_depends_on_the_sources(copy: Path, tmp_path: Path) -> None:
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    before = run_in(copy, CACHE, **kept)
    assert before.startswith(str(tmp_path / "cache"))
    assert run_in(copy, CACHE, **kept) == before
    strengthen_films(copy)
    assert run_in(copy, CACHE, **kept) != before


def test_child_process_uses_the_cache_of_its_parent(tmp_path: Path) -> None:
    child = f"import subprocess, sys, closures.compiled; subprocess.run([sys.executable, '-c', {CACHE!r}])"
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert Path(run_in(ROOT, child, **kept).strip()).parent == tmp_path / "cache"


@pytest.mark.slow
def test_edited_law_is_recompiled(copy: Path, tmp_path: Path) -> None:
    """numba alone does not detect a change of a law in another file."""
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    before = float(run_in(copy, IMPACT, **kept))
    assert float(run_in(copy, IMPACT, **kept)) == before
    strengthen_films(copy)
    assert float(run_in(copy, IMPACT, **kept)) < before - 0.05


@pytest.mark.slow
def test_read_only_installation_without_home_folder_runs(copy: Path, tmp_path: Path) -> None:
    """Read-only packages, and a cache folder that cannot be created."""
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
