"""The model of `cfddem check --ranks N` against runs: shares of work, exchanges, and the time of a rank.

    python tests/benchmarks/bench_scaling_model.py [beads or seeds] [fluid steps]

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
from golden.beds import BEADS, SEEDS
from in_process_ranks import Rank, on_ranks

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import use_threads
from cfddem.case.schema import Case
from cfddem.run.division import Machine, RunCost, Shares, cost_of, expected_shares, time_of_a_rank
from cfddem.run.simulation import Simulation

CASES = {
    "beads": (BEADS, {"column.width": 0.06, "column.height": 0.18, "bed.count": 20_000}, (1, 2, 4, 8)),
    "seeds": (SEEDS, {"column.width": 0.036, "column.height": 0.072, "bed.count": 10_000}, (1, 2, 3, 6, 8)),
}
"""Text, changes and ranks of the runs: with beads the constants of the model were found, with seeds it is checked."""

WITHOUT_NETWORK = Machine(latency=0.0, bandwidth=1e300, reduction=0.0)


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


def measured(communicator: Communicator, case: Case, steps: int) -> tuple[float, ...]:
    """Processor time of some fluid steps [s]; particle steps, exchanges and reductions in them."""
    use_threads(1)
    simulation = Simulation(case, communicator=communicator)
    for _ in range(3):
        simulation.step()
    solver: Any = simulation.particle_solver
    counted: Any = communicator
    before = np.array([time.thread_time() - counted.within, solver.steps, counted.swaps, counted.reductions])
    for _ in range(steps):
        simulation.step()
    found = np.array([time.thread_time() - counted.within, solver.steps, counted.swaps, counted.reductions]) - before
    return tuple(found.tolist())


def main(name: str, steps: int) -> None:
    """One line for each number of ranks; times of the model are those of one process here, shared."""
    setattr(in_process_ranks, "Rank", Counted)  # noqa: B010
    text, changes, numbers = CASES[name]
    case = Case.from_text(text, name, changes)
    print("ranks  bricks    time of the slowest, ms   model, ms   exchanges, sums a fluid step")
    one, cells = 0.0, cost_of(case).cell_seconds / cost_of(case).seconds
    for ranks in numbers:
        shares = Shares((1, 1, 1), 1.0) if ranks == 1 else expected_shares(case, ranks)
        found = np.array(on_ranks(ranks, lambda communicator: measured(communicator, case, steps)))
        slowest, particle_steps = 1e3 * float(found[:, 0].max()) / steps, found[0, 1] / steps
        one = one or slowest
        films = case.has_films or bool(case.liquid)
        cost = RunCost(1e-3 * one, particle_steps, 1.0, case.particle_count, films, 1e-3 * one * cells)
        modelled = 1e3 * sum(time_of_a_rank(cost, shares, WITHOUT_NETWORK).values())
        print(
            f"{ranks:5}  {'x'.join(map(str, shares.shape))} {slowest:24.0f} {modelled:11.0f} "
            f"{found[0, 2] / steps:10.0f}, {found[0, 3] / steps:.0f}   with {particle_steps:.0f} particle steps, "
            f"shares {shares.particles:.2f} and {shares.cells:.2f}"
        )


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "beads", int(sys.argv[2]) if len(sys.argv) > 2 else 5)
