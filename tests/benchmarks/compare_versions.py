"""Speed of one version of the package over that of another, measured in turns in one run.

    python tests/benchmarks/compare_versions.py OTHER [--rounds N] [--threads N] [--start] [NAME ...]

OTHER is a checkout of the other version; this version is the checkout that holds this file. Both need the packages of
this Python environment. Each version has a process of its own. The two take turns, so that what else the machine does
slows both alike. NAME is one or more of the keys of MEASUREMENTS; all of them if none is given.

Printed for each: processor time of this version over the other's, as ratio of medians, with the standard error of the
ratios of single turns. Below 1 means that this version is faster. With --start the first steps of a new process are
measured instead: with an empty cache of compiled loops, and then once more with what the first start has left in it.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

MEASUREMENTS = {
    "dense bed, 10 000, dry": ("dense", 10_000, False, 300),
    "dense bed, 10 000, film": ("dense", 10_000, True, 100),
    "dense bed, 100 000, dry": ("dense", 100_000, False, 30),
    "dense bed, 100 000, film": ("dense", 100_000, True, 15),
    "gas bed, fluid step 2e-5 s": ("gas", 2e-5, None, 60),
    "gas bed, fluid step 1e-4 s": ("gas", 1e-4, None, 15),
}
"""Name -> kind; number of particles or fluid step [s]; film; steps a turn."""

WORKER = """
import json, sys, time
try:
    from cfddem.backend.compile import use_threads
except ImportError:  # an earlier version had other names
    from cfddem.kernels import use_threads
kind, size, film, steps, threads = json.loads(sys.argv[1])
use_threads(threads)
if kind == "dense":
    try:
        from scenarios.benchmarks import dense_bed
    except ImportError:
        from scenarios import dense_bed
    run = dense_bed.bed(size, film)
    def turn():
        run.advance(dense_bed.STEP, steps)
else:
    try:
        from scenarios.beds.gas_bed.study import standard_bed
        from cfddem.run.simulation import Simulation
    except ImportError:
        from scenarios.gas_bed import standard_bed
        from cfddem.simulation import Simulation
    run = Simulation(standard_bed(size))
    def turn():
        for _ in range(steps):
            run.step()
turn()
print("ready", flush=True)
for line in sys.stdin:
    begin = time.process_time()
    turn()
    print(time.process_time() - begin, flush=True)
"""


class Version:
    """A process that makes one measurement with one version, turn by turn."""

    def __init__(self, checkout: Path, measurement: tuple[object, ...], threads: int) -> None:
        path = {"PYTHONPATH": str(checkout), "NUMBA_NUM_THREADS": str(threads)}
        self.process = subprocess.Popen(
            [sys.executable, "-c", WORKER, json.dumps([*measurement, threads])],
            cwd=checkout, env=os.environ | path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        self._read()

    def turn(self) -> float:
        """Processor time of one turn [s]."""
        assert self.process.stdin is not None
        print(file=self.process.stdin, flush=True)
        return float(self._read())

    def close(self) -> None:
        """End the process."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()

    def _read(self) -> str:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"the measurement ended with exit code {self.process.wait()}")
        return line


def compare(this: Path, other: Path, measurement: tuple[object, ...], rounds: int, threads: int) -> list[list[float]]:
    """Processor times of both versions, turn by turn [s]."""
    versions = [Version(checkout, measurement, threads) for checkout in (this, other)]
    times: list[list[float]] = [[], []]
    for number in range(rounds):
        for which in (0, 1) if number % 2 else (1, 0):
            times[which].append(versions[which].turn())
    for version in versions:
        version.close()
    return times


def start(checkout: Path, measurement: tuple[object, ...], cache: str, threads: int) -> float:
    """Processor time of a process that makes one turn and ends [s]."""

    def spent() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    before, earlier = spent(), os.environ.get("XDG_CACHE_HOME")
    os.environ["XDG_CACHE_HOME"] = cache
    try:
        Version(checkout, (*measurement[:-1], 1), threads).close()
    finally:
        os.environ.pop("XDG_CACHE_HOME")
        if earlier is not None:
            os.environ["XDG_CACHE_HOME"] = earlier
    return spent() - before


def compare_starts(this: Path, other: Path, names: Iterable[str], threads: int) -> None:
    """Print the processor time of the first and the second start of both versions."""
    print(f"{'':28} {'first start':>23} {'second start':>23}")
    for name in names:
        text = f"{name:28}"
        with tempfile.TemporaryDirectory() as cache:
            for _ in range(2):
                mine, theirs = (start(each, MEASUREMENTS[name], cache, threads) for each in (this, other))
                text += f"   {mine:5.1f} s, other {theirs:5.1f} s"
        print(text, flush=True)


def main() -> None:
    """Compare the versions and print a line for each measurement."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", type=Path, help="checkout of the other version")
    parser.add_argument("names", nargs="*", metavar="NAME", help="; ".join(MEASUREMENTS))
    parser.add_argument("--rounds", type=int, default=10, help="turns of each version")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--start", action="store_true", help="measure starts instead of speed")
    given = parser.parse_intermixed_args()
    this, other = Path(__file__).resolve().parents[2], given.other.resolve()
    if given.start:
        compare_starts(this, other, given.names or MEASUREMENTS, given.threads)
        return
    print(f"{'':28} {'time / other':>12} {'error':>8}")
    for name in given.names or MEASUREMENTS:
        mine, theirs = compare(this, other, MEASUREMENTS[name], given.rounds, given.threads)
        ratios = [a / b for a, b in zip(mine, theirs)]
        ratio = statistics.median(mine) / statistics.median(theirs)
        print(f"{name:28} {ratio:12.3f} {statistics.stdev(ratios) / len(ratios) ** 0.5:8.3f}", flush=True)


if __name__ == "__main__":
    main()
