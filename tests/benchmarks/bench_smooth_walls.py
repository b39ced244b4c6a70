"""Time of a fluid step in a round column and in a cone whose smooth wall cuts cells, over that in the whole box.

    python tests/benchmarks/bench_smooth_walls.py [--steps N]

All make their steps in turns on one thread; the median of the ratios of single steps counts, in processor time.
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
from cfddem.fluid.surfaces import cylinder, turned

CELLS, SIDE, STEP, AIM = (24, 24, 48), 0.0024, 5e-4, 1.25
"""Cells, their edge [m], the step [s], and what a wet cell may take."""

CONE = 0.3
"""Radius of the lower end of the cone over that of the upper one, which is that of the column."""


def main() -> None:
    """Measure and print."""
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--steps", type=int, default=60)
    steps = asked.parse_args().steps
    use_threads(1)
    box, middle = Grid(CELLS, (SIDE, SIDE, SIDE)), 0.5 * CELLS[0] * SIDE
    axis = (middle, middle, 0.0)
    grids = {
        "column": within(box, cylinder(axis, middle)),
        "cone": within(box, turned([(0.0, CONE * middle), (CELLS[2] * SIDE, middle)], axis)),
    }
    ends = {"z_low": Inlet(0.5), "z_high": Outlet()}
    fluids = [FluidSolver(grid, ends, density=1.2, viscosity=1.8e-5) for grid in (box, *grids.values())]
    ratios, iterations = [], []
    for n in range(steps + 5):
        seconds, counts = [], []
        for fluid in fluids:
            begin = time.process_time()
            report = fluid.step(STEP)
            seconds.append(time.process_time() - begin)
            counts.append(sum(report.pressure_iterations))
        if n >= 5:
            ratios.append([each / seconds[0] for each in seconds])
            iterations.append(counts)
    of_box, *others = (statistics.mean(counts) for counts in zip(*iterations))
    for name, grid, counts, taken in zip(grids, grids.values(), others, list(zip(*ratios))[1:]):
        ratio, wet = statistics.median(taken), float(open_share(grid).astype(bool).mean())
        print(
            f"{name}: a step takes {ratio:.2f} of one of the box; a wet cell {ratio / wet:.2f} (aim {AIM}); "
            f"pressure iterations of a step {counts:.1f}, in the box {of_box:.1f}"
        )


if __name__ == "__main__":
    main()
