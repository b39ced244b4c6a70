"""Time of one full fluid step, beside the memory speed of the machine measured in the same run.

    python tests/benchmarks/bench_fluid_step.py [--threads N] [--profile]
    python -m pytest -n 0 tests/benchmarks/bench_fluid_step.py

The work: a bed of voidage about 0.45 that moves a little each step fills the lower half of a box, gas enters below at
0.3 m/s and leaves above, drag 2 000 kg/m3/s, model A, pressure tolerance 1e-9 of the largest face flux in every
cell; two stages, so two pressure solves. A step counts everything: checks, ghost cells, step-size time_scales.

The memory limit is the time to move the bytes the loops must touch at the triad speed of the machine, if no loop
found anything in a cache: 200 B a cell and stage for transport, 260 for the predictor, 120 for the rest of a stage,
780 a cell and pressure iteration (coarse grids included). Beside it: icoFoam's own step, two PISO correctors, p to
1e-6, on a machine of the class AMD EPYC, one core: 0.50 s on 64^3, 0.20 s on 32 x 32 x 128.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time

import numpy as np
import pytest

from cfddem.backend.compile import use_threads
from cfddem.fluid.conditions import Inlet, Outlet
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver

LIMITS = {(32, 8, 128): 0.05, (64, 64, 64): 0.25}
STAGE_BYTES, ITERATION_BYTES = 200 + 260 + 120, 780


def triad(count: int = 10_000_000, repeats: int = 5) -> float:
    """Bytes per second of a = b + s c on arrays that fit no cache, one thread, best of a few."""
    b, c, a = np.ones(count), np.ones(count), np.empty(count)
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        np.multiply(c, 3.0, out=a)  # numpy has no fused triad: five streams
        np.add(a, b, out=a)
        best = min(best, time.perf_counter() - begin)
    return 5 * 8 * count / best


def bed(cells: tuple[int, int, int]):
    """The fluid, its voidage as a function of time, and its drag."""
    grid = Grid(cells, (0.005,) * 3)
    x, y, z = grid.centres()
    inside = np.broadcast_to(z < 0.5 * grid.size[2], grid.shape)

    def voidage(t: float) -> np.ndarray:
        return np.where(inside, 0.45 + 0.05 * np.sin(20 * t + 50 * x) * np.sin(40 * y + 1), 1.0)

    fluid = FluidSolver(
        grid, {"z_low": Inlet(0.3), "z_high": Outlet()}, density=1.2, viscosity=1.8e-5, voidage=voidage(0.0)
    )
    return fluid, voidage, np.where(inside, 2000.0, 0.0), np.zeros((*grid.shape, 3))


def measure(cells: tuple[int, int, int], speed: float, profile: bool, steps: int = 15, step: float = 5e-4) -> None:
    """Print the median of a few steps after some to warm up."""
    fluid, voidage, drag, momentum = bed(cells)
    times, iterations = [], []
    profiler = cProfile.Profile()
    for n in range(1, steps + 6):
        field = voidage(n * step)
        if profile and n > 5:
            profiler.enable()
        begin = time.perf_counter()
        report = fluid.step(step, field, drag, momentum)
        times.append(time.perf_counter() - begin)
        profiler.disable()
        iterations.append(sum(report.pressure_iterations))
    median, work = float(np.median(times[5:])), float(np.mean(iterations[5:]))
    moved = np.prod(cells) * (2 * STAGE_BYTES + work * ITERATION_BYTES)
    print(
        f"{cells[0]:4d} x {cells[1]:3d} x {cells[2]:3d}   {median:.4f} s a step (limit {LIMITS[cells]} s), "
        f"{median / np.prod(cells) * 1e9:.0f} ns a cell, {work:.1f} pressure iterations, "
        f"{median / (moved / speed):.1f} times the memory limit {moved / speed:.4f} s"
    )
    if profile:
        pstats.Stats(profiler).sort_stats("tottime").print_stats(12)


@pytest.mark.parametrize("cells", LIMITS, ids=str)
def bench_fluid_step(benchmark, cells):
    """The same step under pytest-benchmark, on the threads that are set."""
    fluid, voidage, drag, momentum = bed(cells)
    step, fields = 5e-4, iter(range(1, 1000))
    benchmark.extra_info["triad [GB/s]"] = round(triad() / 1e9, 1)
    benchmark.pedantic(
        lambda: fluid.step(step, voidage(step * next(fields)), drag, momentum), rounds=10, warmup_rounds=4
    )


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--profile", action="store_true")
    arguments = parser.parse_args()
    use_threads(arguments.threads)
    speed = triad()
    print(f"triad {speed / 1e9:.1f} GB/s on one thread; the fluid on {arguments.threads}")
    for cells in LIMITS:
        measure(cells, speed, arguments.profile)


if __name__ == "__main__":
    main()
