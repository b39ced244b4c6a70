"""Speed of the particle engine on the standard dense bed: `pytest -n 0 tests/benchmarks/bench_dense_bed.py`."""

from __future__ import annotations

import resource
from typing import Any

import pytest

from cfddem.backend.compile import use_threads
from scenarios.benchmarks.dense_bed import STEP, bed


@pytest.mark.slow
@pytest.mark.parametrize("film", [False, True])
@pytest.mark.parametrize(("count", "steps"), [(1_000, 5000), (10_000, 500), (100_000, 50), (1_000_000, 5)])
@pytest.mark.parametrize("threads", [1, 2])
def bench_dense_bed(benchmark: Any, count: int, steps: int, threads: int, film: bool) -> None:
    """Cost of a step against the number of particles and of threads, list rebuilds included."""
    use_threads(threads)
    run = bed(count, film)
    run.advance(STEP, steps)
    benchmark.pedantic(run.advance, args=(STEP, steps), rounds=3)
    run._relist()
    benchmark.extra_info["peak memory of the process [MB]"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000
    benchmark.extra_info["million particle-steps per second"] = count * steps / benchmark.stats.stats.median / 1e6
