"""Memory of a particle on the standard dense bed with films, the making of a new list included.

    python tests/benchmarks/bench_memory.py [--count N]

A bed of 1 000 is run first, so that the compiler's own memory does not count.
"""

from __future__ import annotations

import argparse
import resource

from cfddem.backend.compile import use_threads
from scenarios.benchmarks.dense_bed import STEP, bed


def peak() -> float:
    """Largest memory of the process so far [kB]."""
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)


def main() -> None:
    """Measure and print."""
    asked = argparse.ArgumentParser()
    asked.add_argument("--count", type=int, default=1_000_000)
    count = asked.parse_args().count
    use_threads(1)
    for size in (1_000, count):
        before = peak()
        run = bed(size, film=True)
        run.advance(STEP, 10)
        run._relist()
        run.advance(STEP, 5)
    pairs = run.edges.between_particles / count
    print(f"{count} spheres, {pairs:.2f} pairs a sphere: {(peak() - before) / count:.2f} kB a sphere at most")


if __name__ == "__main__":
    main()
