"""Time of a fluid step in a round column whose smooth wall cuts cells, over that in the whole box, in one run.

    python tests/benchmarks/bench_smooth_walls.py [--steps N]

Both make their steps in turns on one thread; the median of the ratios of single steps counts, in processor time.
"""

from __future__ import annotations

import argparse
import statistics
import time

from cfddem.backend.compile import use_threads
from cfddem.fluid.conditions import Inlet, Outlet
from cfddem.fluid.cut_cells import open_share, within
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver
from cfddem.fluid.surfaces import cylinder

CELLS, SIDE, STEP, AIM = (24, 24, 48), 0.0024, 5e-4, 1.25
"""Cells, their edge [m], the step [s], and what a wet cell may take."""


def main() -> None:
    """Measure and print."""
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--steps", type=int, default=60)
    steps = asked.parse_args().steps
    use_threads(1)
    box, middle = Grid(CELLS, (SIDE, SIDE, SIDE)), 0.5 * CELLS[0] * SIDE
    column = within(box, cylinder((middle, middle, 0.0), middle))
    ends = {"z_low": Inlet(0.5), "z_high": Outlet()}
    fluids = [FluidSolver(grid, ends, density=1.2, viscosity=1.8e-5) for grid in (box, column)]
    ratios, iterations = [], []
    for n in range(steps + 5):
        seconds, counts = [], []
        for fluid in fluids:
            begin = time.process_time()
            report = fluid.step(STEP)
            seconds.append(time.process_time() - begin)
            counts.append(sum(report.pressure_iterations))
        if n >= 5:
            ratios.append(seconds[1] / seconds[0])
            iterations.append(counts)
    ratio, wet = statistics.median(ratios), float(open_share(column).astype(bool).mean())
    of_box, of_column = (statistics.mean(counts) for counts in zip(*iterations))
    print(f"pressure iterations of a step: {of_box:.1f} in the box, {of_column:.1f} in the column")
    print(f"a step of the column takes {ratio:.2f} of one of the box; a wet cell {ratio / wet:.2f} (aim {AIM})")


if __name__ == "__main__":
    main()
