"""Loops compiled for the laws of a run: shared, cached by the sources of the laws, and never stale."""

from __future__ import annotations

import pickle
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from numba import njit as serial_without_cache

from cfddem.backend.compile import either, inline, prange
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import (
    Slot,
    bind_arguments,
    callable_in_loops,
    check_compiles,
    compile_source,
    fingerprint,
    specialise,
)
from cfddem.backend.named import named_arrays

scale = Slot("scale")
TWICE = Slot("TWICE")


@inline
def helper(x):  # type: ignore[no-untyped-def]
    return scale(x) + (1.0 if TWICE else 0.0)


@either
def fill(values):  # type: ignore[no-untyped-def]
    for n in prange(len(values)):
        values[n] = helper(values[n])


def filled(law: object, twice: bool = False, threads: bool = False) -> list[float]:
    values = np.array([1.0, 2.0])
    specialise(fill, {"scale": callable_in_loops(law), "TWICE": twice}, threads)(values)  # type: ignore[arg-type]
    return values.tolist()


def triple(x: float) -> float:
    return 3.0 * x


def shifted(x: float) -> float:
    return triple(x) + OFFSET


OFFSET = 5.0


def test_a_loop_runs_the_law_in_its_slot() -> None:
    assert filled(triple) == [3.0, 6.0]
    assert filled(shifted, twice=True) == [9.0, 12.0]
    assert filled(shifted, threads=True) == [8.0, 11.0]
    with pytest.raises(TypeError, match="scale is a slot"):
        scale(1.0)


def test_equal_choices_share_a_loop() -> None:
    choices = {"scale": callable_in_loops(triple), "TWICE": False}
    again = {"scale": callable_in_loops(triple), "TWICE": False}
    assert specialise(fill, choices) is specialise(fill, again)
    assert specialise(fill, choices) is not specialise(fill, again | {"TWICE": True})
    assert specialise(fill, choices) is not specialise(fill, choices, threads=True)


def test_the_fingerprint_follows_everything_a_law_refers_to(monkeypatch: pytest.MonkeyPatch) -> None:
    before = fingerprint(shifted)
    monkeypatch.setitem(shifted.__globals__, "OFFSET", 6.0)
    changed = fingerprint(shifted)
    monkeypatch.setitem(shifted.__globals__, "triple", lambda x: 4.0 * x)
    assert len({before, changed, fingerprint(shifted)}) == 3


def test_arguments_are_found_by_name() -> None:
    law = bind_arguments(lambda b, a: a - 2.0 * b, "pair", {"a": "pair[0]", "b": "pair[1]"})
    called = serial_without_cache(lambda pair: law(pair))  # helpers have no entry from Python
    assert called((5.0, 1.0)) == 3.0
    with pytest.raises(InputError, match=r"argument of .* = 'c': must be one of a"):
        bind_arguments(lambda c: c, "pair", {"a": "pair[0]"})


def test_a_law_that_cannot_be_compiled_is_refused() -> None:
    def worded(x: float) -> float:
        return float(str(x))

    with pytest.raises(InputError, match=r"laws.test = 'worded'.*compiled"):
        check_compiles("laws.test", worded)


def test_copies_of_functions_made_from_text_differ_by_their_text() -> None:
    """As loops over pairs do, whose text lists the fields of a run."""
    inner = Slot("inner")
    texts = ["def made(x):\n    return inner(x) + 1.0\n", "def made(x):\n    return inner(x) + 2.0\n"]
    results = []
    for text in texts:
        values = np.array([1.0])
        choices = {"scale": compile_source(text, inner=inner), "inner": callable_in_loops(triple), "TWICE": False}
        specialise(fill, choices)(values)
        results.append(values[0])
    assert results == [4.0, 5.0]


def test_a_law_is_compiled_once_until_it_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    first = callable_in_loops(shifted)
    assert callable_in_loops(shifted) is first
    monkeypatch.setitem(shifted.__globals__, "OFFSET", 7.0)
    assert callable_in_loops(shifted) is not first


def test_a_law_needs_no_module_when_its_loop_is_read_from_the_cache() -> None:
    scope: dict[str, object] = {"__name__": "nowhere"}
    exec("def law(x):\n    return 2.0 * x\n", scope)
    assert callable_in_loops(scope["law"]).py_func.__module__ in sys.modules  # type: ignore[arg-type]


LAW = """
    import math

    CONSTANT = {constant}

    def strength(viscosity, reduced_radius):
        return CONSTANT * math.pi * viscosity * reduced_radius**2

    def brenner(gap, viscosity, reduced_radius):
        return strength(viscosity, reduced_radius) / gap
"""

RUN = """
    import json, sys, time
    start = time.perf_counter()
    import numpy as np
    from mylaw import brenner
    from numba.core import event
    from cfddem import Laws, Material, ParticleSolver, make_particles, pair_table
    from cfddem.particles.interactions.film_law import FilmLaw

    glass = Material(density=2500, youngs_modulus=1e7, poisson=0.25, restitution=0.7, friction=0.4, roughness=2e-6)
    pair = make_particles([[0, 0, 0], [1.1e-3, 0, 0]], 5e-4, 2500.0, velocity=[[0.1, 0, 0], [0, 0, 0]], viscosity=1e-2)
    with event.install_recorder("numba:compile") as compiled:
        run = ParticleSolver(pair, pair_table([glass]), laws=Laws(film=True, lubrication=FilmLaw(brenner)))
        run.advance(1e-6, 10)
    print(json.dumps([len(compiled.buffer), run.particles.velocity[0, 0], time.perf_counter() - start]))
"""


@pytest.mark.slow
def test_the_cache_serves_a_users_law_and_is_never_stale(tmp_path: Path) -> None:
    """A second start compiles nothing of the loops; a change of a constant that a helper reads compiles them anew."""
    import json
    import os

    def started() -> tuple[int, float, float]:
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
        done = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(RUN)], env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr[-2000:]
        return tuple(json.loads(done.stdout))

    def written(constant: float) -> None:
        (tmp_path / "mylaw.py").write_text(textwrap.dedent(LAW.format(constant=constant)))

    written(6.0)
    first, second = started(), started()
    written(7.0)
    changed = started()
    assert second[1] == first[1] != changed[1]
    assert second[0] < 0.2 * first[0]
    assert changed[0] > 0.5 * first[0]


def test_the_type_of_a_memory_is_found_by_its_name_in_another_process() -> None:
    """The compile cache stores the types of the arguments of loops; another process may not have made them yet."""
    stored = pickle.dumps(named_arrays("Memory", ("spring", "normal_wear"))).hex()
    code = "import pickle, sys; print(pickle.loads(bytes.fromhex(sys.argv[1]))._fields)"
    found = subprocess.run([sys.executable, "-c", code, stored], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "('spring', 'normal_wear')"
