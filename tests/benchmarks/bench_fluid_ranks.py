"""Pressure iterations and time of a solve, in one process and on the ranks of an MPI launcher.

    python tests/benchmarks/bench_fluid_ranks.py                       one process
    mpiexec -n 4 python tests/benchmarks/bench_fluid_ranks.py          four ranks, and one process beside them

Each case is a bed of voidage 0.4 with a bubble, an empty freeboard and noise, solved to 1e-8 of the right-hand side.
Time is the processor time of the slowest rank, without and within messages. A rank that waits for a message spins: on a
machine with other work, or with fewer cores than ranks, the second number says little.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.launch import communicator as launched
from cfddem.fluid.block import Block, divide
from cfddem.fluid.grid import Array, Grid, outside_cylinder
from cfddem.fluid.pressure.multigrid import ClosedRegions
from cfddem.fluid.pressure.ranks import pressure_equation

CASES: dict[str, dict[str, Any]] = {
    "64 x 64 x 64": {"cells": (64, 64, 64)},
    "cylinder, 31 x 31 x 97": {"cells": (31, 31, 97), "round": True},
    "tall cells, 64 x 64 x 32": {"cells": (64, 64, 32), "spacing": (1.0, 1.0, 4.0)},
    "flat cells, 32 x 32 x 128": {"cells": (32, 32, 128), "spacing": (4.0, 4.0, 1.0)},
    "periodic, 64 x 64 x 64": {"cells": (64, 64, 64), "periodic": (True, True, True)},
    "closed, 64 x 64 x 64": {"cells": (64, 64, 64), "closed": True},
}
REPEATS = 3


def voidage_of(grid: Grid) -> Array:
    """A bed with a bubble below a freeboard, with noise (nz, ny, nx)."""
    x, y, z = (c / length for c, length in zip(grid.centres(), grid.size))
    bubble = (x - 0.5) ** 2 + (y - 0.5) ** 2 + (z - 0.3) ** 2 < 0.02
    voidage = np.where(bubble | (z > 0.6), 0.98, 0.42)
    return np.asarray(voidage * np.random.default_rng(0).uniform(0.95, 1.0, grid.shape))


def coefficients(grid: Grid, periodic: tuple[bool, bool, bool], closed: bool) -> tuple[list[Array], Array]:
    """Coefficients of the low faces of all cells along x, y, z, and anchors of an outlet at the top, and b."""
    share, faces = voidage_of(grid) ** 2, []
    for d in range(3):
        at = 2 - d
        both = 2.0 / (1.0 / share + 1.0 / np.roll(share, 1, at)) * (grid.open & np.roll(grid.open, 1, at))
        if not periodic[d]:
            np.moveaxis(both, at, 0)[0] = 0.0
        faces.append(both * grid.face_area(d) / grid.spacing[d])
    anchor = np.zeros(grid.shape)
    b = np.random.default_rng(1).standard_normal(grid.shape) * grid.open
    if closed or periodic[2]:
        b -= grid.open * b.sum() / grid.open.sum()
    else:
        anchor[-1] = 2.0 * (share * grid.open)[-1] * grid.face_area(2) / grid.spacing[2]
    return [*faces, anchor], b


def solve(case: dict[str, Any], ranks: Communicator) -> tuple[int, float, float]:
    """Iterations, and processor time of setup and solve without and within messages [s]."""
    whole, periodic = Grid(case["cells"], case.get("spacing", (1.0, 1.0, 1.0))), case.get("periodic", (False,) * 3)
    if case.get("round"):
        whole = whole.with_solid(outside_cylinder((0.5 * whole.size[0], 0.5 * whole.size[1], 0.0), 0.5 * whole.size[0]))
    given, b = coefficients(whole, periodic, case.get("closed", False))
    grid = whole if ranks.size == 1 else Block(whole, divide(whole, ranks.size), ranks)
    closed = None
    if case.get("closed") or periodic[2]:
        closed = ClosedRegions.numbered(grid.part(whole.open.astype(np.int64)), ranks)
    equation = pressure_equation(grid, closed, ranks, np.array(periodic), np.array([False, False, True]))
    for own, values in zip(equation.coefficients, given):
        own[:] = grid.part(values)
    mine, limit = np.ascontiguousarray(grid.part(b)), 1e-8 * float(np.abs(b).max())
    waiting, times = timed_messages(ranks), []
    for _ in range(REPEATS):
        waiting[0], begin = 0.0, time.process_time()
        equation.prepare()
        _, iterations = equation.solve(mine, limit)
        times.append((time.process_time() - begin - waiting[0], waiting[0]))
    spent, messages = min(times)
    return iterations, ranks.largest([spent]), ranks.largest([messages])


def timed_messages(ranks: Communicator) -> list[float]:
    """Processor time of the messages that a rank sends and waits for, in a list of one number [s]."""
    spent = [0.0]

    def timed(method: Any) -> Any:
        def call(*arguments: Any) -> Any:
            begin = time.process_time()
            result = method(*arguments)
            spent[0] += time.process_time() - begin
            return result

        return call

    if ranks.size > 1:
        for name in ("swap", "_combine"):
            setattr(ranks, name, timed(getattr(type(ranks), name).__get__(ranks)))
    return spent


def main() -> None:
    """Print a line for each case."""
    ranks = launched()
    chosen = sys.argv[1:] or list(CASES)
    for name in chosen:
        alone = solve(CASES[name], SERIAL) if ranks.rank == 0 else (0, 0.0, 0.0)
        ranks.any([False])  # the others wait
        shared = solve(CASES[name], ranks) if ranks.size > 1 else alone
        if ranks.rank == 0:
            print(
                f"{name:24s} one process: {alone[0]} iterations, {alone[1]:.3f} s; {ranks.size} ranks: {shared[0]} "
                f"iterations, {shared[1]:.3f} + {shared[2]:.3f} s each",
                flush=True,
            )


if __name__ == "__main__":
    main()
