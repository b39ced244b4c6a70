"""What a case compiles on a new machine: only what it uses, for the widest vectors of the processor."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from cfddem.backend.compile import prange, threaded, use_threads

LOOPS = {"liquid-bed": 43, "gas-bed": 39, "settling": 42, "wet-bed": 49}
"""Most compiled loops of a case; helpers within them do not count."""

COUNT = """
import sys
from numba.core import event
from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.run.simulation import Simulation

class Counter(event.Listener):
    depth = loops = 0
    def on_start(self, seen):
        self.depth += 1
        self.loops += self.depth == 1
    def on_end(self, seen):
        self.depth -= 1

counter = Counter()
event.register("numba:compile", counter)
few = {"bed.count": 100, "bed.start": "suspended"}
case = Case.from_toml(gallery_files()[sys.argv[1]], {} if sys.argv[1] == "settling" else few)
simulation = Simulation(case)
simulation.step()
simulation.step()
print(counter.loops)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_a_case_compiles_only_what_it_uses(name: str, tmp_path: Path) -> None:
    """In a process of its own, with an empty cache."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_NUM_THREADS": "1"}
    ran = subprocess.run(
        [sys.executable, "-c", COUNT, name], env=environment, capture_output=True, text=True, check=True
    )
    assert 0 < int(ran.stdout) <= LOOPS[name]


def test_loops_use_the_widest_vectors_of_the_processor() -> None:
    """The compiler uses vectors of 512 bits where the processor has them, unless the user chose otherwise."""
    import llvmlite.binding as processor
    from numba import config

    import closures.compiled  # noqa: F401  sets the compiler

    if config.CPU_NAME or not processor.get_host_cpu_features().get("avx512f"):  # type: ignore[attr-defined]
        pytest.skip("needs a processor with AVX-512, and no choice by the user")
    assert "-prefer-256-bit" in config.CPU_FEATURES.split(",")  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "processor, llvm, by_loads", [("znver4", 20, True), ("znver4", 15, False), ("sapphirerapids", 20, False)]
)
def test_processors_of_amd_load_numbers_one_by_one(processor: str, llvm: int, by_loads: bool) -> None:
    from closures.compiled import _wide_vectors

    assert ("+prefer-no-gather" in _wide_vectors(processor, llvm).split(",")) == by_loads


@threaded
def counted(numbers: np.ndarray) -> None:
    for n in prange(len(numbers)):
        numbers[n] += 1.0


def test_a_loop_is_compiled_for_all_threads_when_it_first_runs_on_several() -> None:
    numbers, before = np.zeros(3), use_threads(None)
    use_threads(1)
    counted(numbers)
    assert counted.one.signatures and not counted.all.signatures
    if numba.config.NUMBA_NUM_THREADS == 1:  # type: ignore[attr-defined]
        pytest.skip("needs two threads")
    use_threads(2)
    counted(numbers)
    use_threads(before)
    assert counted.all.signatures
    assert (numbers == 2.0).all()
