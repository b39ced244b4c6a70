"""Time of one full fluid step, and where it goes. `cfddem bench fluid` prints the figures alone.

python tests/benchmarks/bench_fluid_step.py [--threads N]       with a profile
python -m pytest -n 0 tests/benchmarks/bench_fluid_step.py
"""

from __future__ import annotations

import argparse
import cProfile
import pstats

import pytest

from cfddem.backend.compile import use_threads
from scenarios.benchmarks.fluid_box import CELLS, STEP, bench, box, rows
from scenarios.benchmarks.memory import triad


@pytest.mark.parametrize("cells", CELLS, ids=str)
def bench_fluid_step(benchmark, cells):
    """The same step under pytest-benchmark, on the threads that are set."""
    fluid, voidage, drag, momentum = box(cells)
    fields = iter(range(1, 1000))
    benchmark.extra_info["triad [GB/s]"] = round(triad() / 1e9, 1)
    benchmark.pedantic(
        lambda: fluid.step(STEP, voidage(STEP * next(fields)), drag, momentum), rounds=10, warmup_rounds=4
    )


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--threads", type=int, default=1)
    threads = parser.parse_args().threads
    for name, text in rows(bench(threads)):
        print(f"{name:<16} {text}")
    use_threads(threads)
    for cells in CELLS:
        fluid, voidage, drag, momentum = box(cells)
        with cProfile.Profile() as profiler:
            for n in range(1, 15):
                fluid.step(STEP, voidage(n * STEP), drag, momentum)
        pstats.Stats(profiler).sort_stats("tottime").print_stats(12)


if __name__ == "__main__":
    main()
