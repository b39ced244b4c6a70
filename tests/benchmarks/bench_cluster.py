"""What ranks cost each other in a step: halo and reductions, migration and ghosts.

    mpiexec -n 2 python tests/benchmarks/bench_cluster.py [particles a rank] [film]

Medians over the steps of the slowest rank, since other programs on the machine disturb means. The clock of an exchange
starts when all ranks have come to it: waiting for a slower rank is imbalance, not cost. Set
NUMBA_NUM_THREADS=1 for one rank a core.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import rooms  # noqa: F401
from test_ghosts import DRY, GLASS, WET

from cfddem.backend.launch import communicator as started
from cfddem.particles.bricks import Bricks
from cfddem.particles.initial.packing import random_packing
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, Sharing, SolverSettings
from cfddem.particles.state import make_particles

DIAMETER, STEP, STEPS, TOGETHER = 1e-3, 2e-6, 400, 10


class Watch:
    """Times of the calls of a method, after `wait` [s]."""

    def __init__(self, owner: Any, name: str, wait: Callable[[], Any] = lambda: None) -> None:
        self.wait = wait
        self.call, self.seconds = getattr(owner, name), [0.0]
        self.seconds.clear()
        setattr(owner, name, self)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        self.wait()
        begin = time.perf_counter()
        result = self.call(*arguments, **named)
        self.seconds.append(time.perf_counter() - begin)
        return result

    @property
    def median(self) -> float:
        """[ms]"""
        return 1e3 * float(np.median(self.seconds)) if self.seconds else 0.0


def main(a_rank: int, film: bool) -> None:
    """Run, and print on rank 0."""
    communicator = started()
    size, draw = communicator.size, np.random.default_rng(1)
    centres, box = random_packing(np.full(a_rank, DIAMETER), 0.5, seed=3)
    positions = np.concatenate([centres + np.array([n * box[0], 0.0, 0.0]) for n in range(size)])
    spheres = make_particles(
        positions, 0.5 * DIAMETER, GLASS.density, velocity=draw.normal(0.0, 0.1, positions.shape), viscosity=1e-3
    )
    division = Bricks.slabs(0, [n * box[0] for n in range(1, size)]) if size > 1 else None
    run = ParticleSolver(
        spheres, pair_table([GLASS]), box=(box[0] * size, box[1], box[2]), laws=WET if film else DRY,
        sharing=Sharing(communicator=communicator, division=division), settings=SolverSettings(check_steps=False),
    )  # fmt: skip
    run.advance(STEP, 3)
    ghosts, steps = run.lists.ghosts, []
    others_are_ready = partial(communicator.any, False) if size > 1 else lambda: None
    halo = Watch(ghosts, "refresh", others_are_ready)
    reduce = Watch(communicator, "largest", others_are_ready)
    migrate, renew = Watch(ghosts, "migrate"), Watch(ghosts, "renew")
    lists = Watch(run, "_relist")
    for _ in range(STEPS // TOGETHER):
        begin = time.perf_counter()
        before = len(lists.seconds)
        run.advance(STEP, TOGETHER)
        if len(lists.seconds) == before:
            steps.append((time.perf_counter() - begin) / TOGETHER)
    exchanges = len(halo.seconds) / STEPS
    row = [1e3 * float(np.median(steps)), halo.median * exchanges, reduce.median, lists.median, migrate.median,
           renew.median, run.particles.count - run.particles.owned, len(lists.seconds)]  # fmt: skip
    rows = communicator.joined(np.array([row]))
    if communicator.rank == 0:
        names = ("step ms", "halo ms", "reduction ms", "list ms", "migration ms", "ghosts ms", "ghosts", "lists")
        print(
            f"{size} ranks, {a_rank} particles a rank, {'films' if film else 'dry'}, {exchanges:.2g} exchanges a step"
        )
        for name, column in zip(names, rows.T):
            print(f"  {name:<14}{column.max():10.4g}")
        step, halos, reductions = rows[:, :3].max(axis=0)
        print(f"  halo and reductions over step: {(halos + reductions) / step:.1%}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50_000, "film" in sys.argv[2:])
