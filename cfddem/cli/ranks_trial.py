"""A trial of several ranks for `cfddem doctor`: messages, a sum, and a fluid step that they share.

mpiexec -n 2 python -m cfddem.cli.ranks_trial
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import RunFailed
from cfddem.backend.launch import communicator
from cfddem.fluid.block import Block, divide
from cfddem.fluid.conditions import Inlet, Outlet
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver

LARGEST_DIFFERENCE = 1e-6
"""Largest difference of the pressure from that of one process, over the largest pressure [-]."""


def flow(grid: Grid, ranks: Communicator) -> FluidSolver:
    """A step of a fluid that rises through a porous bed, on the cells of one rank or of all."""
    voidage = grid.part(np.random.default_rng(1).uniform(0.4, 0.9, grid.whole.shape))
    fluid = FluidSolver(
        grid, {"z_low": Inlet(0.1), "z_high": Outlet()}, density=1000.0, viscosity=1e-3, voidage=voidage,
        communicator=ranks,
    )  # fmt: skip
    fluid.step(1e-3)
    return fluid


def try_solve(ranks: Communicator) -> str:
    """Solve for the pressure on all ranks and in one process; returns what was found.

    errors  RunFailed if the pressures differ
    """
    whole = Grid((8, 8 * ranks.size, 16), (0.01, 0.01, 0.01))
    shared = flow(Block(whole, divide(whole, ranks.size), ranks), ranks).whole("pressure")
    alone = flow(whole, SERIAL).whole("pressure")
    difference = float(np.abs(shared - alone).max() / np.abs(alone).max())
    if not difference < LARGEST_DIFFERENCE:
        raise RunFailed(f"the pressure of {ranks.size} ranks differs from that of one process by {difference:.2g}")
    return f"pressure as in one process, to {difference:.1g}"


def main() -> None:
    """Run all trials; rank 0 prints what was found."""
    ranks = communicator()
    from cfddem.backend.mpi import try_out

    lines = try_out(), try_solve(ranks)
    if ranks.rank == 0:
        print("\n".join(lines))


if __name__ == "__main__":
    main()
