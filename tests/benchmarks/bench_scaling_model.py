"""The model of `cfddem check --ranks N` against runs: shares of work, exchanges, and the time of a rank.

    python tests/benchmarks/bench_scaling_model.py [fluid steps]

The ranks are threads of one process, one at a time. Times are processor times of the slowest rank, without messages
and sums: they test how the work is shared, on any machine, also one with fewer cores than ranks.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import in_process_ranks
import rooms  # noqa: F401
from golden.beds import BEADS
from in_process_ranks import Rank, on_ranks

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import use_threads
from cfddem.case.schema import Case
from cfddem.run.division import expected_division
from cfddem.run.simulation import Simulation

RANKS = (1, 2, 4, 8)
CASE = Case.from_text(BEADS, "beads", {"column.width": 0.06, "column.height": 0.18, "bed.count": 20_000})


class Counted(Rank):
    """A rank that counts its exchanges and reductions, and the processor time in them [s]."""

    swaps = reductions = 0
    within = 0.0

    def swap(self, outgoing: Mapping[int, np.ndarray], incoming: Mapping[int, np.ndarray]) -> None:
        begin = time.thread_time()
        super().swap(outgoing, incoming)
        self.swaps, self.within = self.swaps + 1, self.within + time.thread_time() - begin

    def _combine(self, local: Any, operation: Any) -> Any:
        begin = time.thread_time()
        found = super()._combine(local, operation)
        self.reductions, self.within = self.reductions + 1, self.within + time.thread_time() - begin
        return found


def measured(communicator: Communicator, steps: int) -> tuple[float, ...]:
    """Processor time of some fluid steps [s]; particle steps, exchanges and reductions in them."""
    use_threads(1)
    simulation = Simulation(CASE, communicator=communicator)
    for _ in range(3):
        simulation.step()
    solver: Any = simulation.particle_solver
    counted: Any = communicator
    before = np.array([time.thread_time() - counted.within, solver.steps, counted.swaps, counted.reductions])
    for _ in range(steps):
        simulation.step()
    found = np.array([time.thread_time() - counted.within, solver.steps, counted.swaps, counted.reductions]) - before
    return tuple(found.tolist())


def main(steps: int) -> None:
    """One line for each number of ranks."""
    setattr(in_process_ranks, "Rank", Counted)  # noqa: B010
    print("ranks  bricks    time of the slowest   work, model  measured   exchanges, reductions a fluid step")
    one = 0.0
    for ranks in RANKS:
        shape, work = ((1, 1, 1), 1.0) if ranks == 1 else expected_division(CASE, ranks)
        found = np.array(on_ranks(ranks, lambda communicator: measured(communicator, steps)))
        slowest = float(found[:, 0].max())
        one = one or slowest
        print(
            f"{ranks:5}  {'x'.join(map(str, shape))}  {1e3 * slowest / steps:12.0f} ms {work:15.2f} "
            f"{slowest * ranks / one:10.2f} {found[0, 2] / steps:10.0f} {found[0, 3] / steps:10.0f}"
            f"   with {found[0, 1] / steps:.0f} particle steps"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
