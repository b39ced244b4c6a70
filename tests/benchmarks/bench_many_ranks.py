"""What a reduction and a neighbour list cost one rank of 8 to 4096.

    python tests/benchmarks/bench_many_ranks.py [particles a rank]

One process runs the code of one rank. Its neighbours are recorded: the bed repeats itself, so that each neighbour sends
what this rank sends to the one on the other side. The network costs nothing here: the times are those of the code.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[1]))

import rooms  # noqa: F401
from test_ghosts import DRY, GLASS

from cfddem.backend.communicator import Shape, place_of
from cfddem.backend.compile import use_threads
from cfddem.backend.mpi import Ranks
from cfddem.particles.bricks import Bricks
from cfddem.particles.ghosts import DividedDomain, packed, unpacked
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, Sharing, SolverSettings
from cfddem.particles.state import make_particles

DIAMETER, SPACING, LISTS, CALLS = 1e-3, 1.02e-3, 7, 2000

SHAPES: tuple[Shape, ...] = ((2, 2, 2), (3, 3, 3), (4, 4, 4), (8, 8, 8), (16, 16, 16), (1, 2, 2048), (1, 1, 4096))

ALONG, NAMES = np.array([1, 64, 4096]), 2**20
"""An id is that of the particle in its brick, and beyond `NAMES` the place of the brick along x, y, z."""

MOST_REDUCTION, MOST_LIST = 50e-6, 1.5
"""Time of a reduction [s], and of a list over that of 8 ranks, that are allowed."""

Record = list[dict[tuple[int, ...], np.ndarray]]
"""What came from the neighbour at each offset, message by message."""


class Replica(Ranks):
    """One rank of many, whose neighbours are recorded, or mirrored and recorded where there is no record yet."""

    def __init__(self, shape: Shape, record: Record | None = None) -> None:
        super().__init__(MPI.COMM_SELF)
        self.place = tuple(min(1, n - 1) for n in shape)
        self.rank, self.size, self.shape = int(np.ravel_multi_index(self.place, shape)), int(np.prod(shape)), shape
        self.record: Record = record or []
        self.mirrors, self.messages, self.width = record is None, 0, 0.0
        self.tables: list[Any] = []

    def _offset(self, rank: int) -> tuple[int, ...]:
        return tuple(np.subtract(place_of(rank, self.shape or (1, 1, 1)), self.place).tolist())

    def swap(self, outgoing: Mapping[int, np.ndarray], incoming: Mapping[int, np.ndarray]) -> None:
        if self.mirrors:
            sent = {self._offset(rank): values for rank, values in outgoing.items()}
            self.record.append(
                {tuple(-n for n in offset): self._mirrored(offset, each) for offset, each in sent.items()}
            )
        for rank, into in incoming.items():
            into[...] = self.record[self.messages][self._offset(rank)]
        self.messages += 1

    def _mirrored(self, offset: tuple[int, ...], message: np.ndarray) -> np.ndarray:
        """What the neighbour on the other side sends."""
        if message.dtype != np.uint8:
            return message.copy()
        tables = unpacked(message, *self.tables[: 1 if self.messages % 4 == 2 else 2])  # ghosts, or those that move
        for table in tables[:1]:
            table["position"] -= self.width * np.array(offset)
            table["id"] -= NAMES * int(ALONG @ offset)
        for table in filter(None, tables[1:]):
            table["bodies"] -= NAMES * int(ALONG @ offset)
        return packed(*tables)

    def _given_by_all(self, numbers: np.ndarray) -> np.ndarray:
        return numbers.copy()


def lists(shape: Shape, a_side: int, record: Record | None = None) -> tuple[float, Record, int, int]:
    """Median time of a list [s], what neighbours sent, ghosts, and neighbours."""
    replica, draw = Replica(shape, record), np.random.default_rng(1)
    replica.width = width = a_side * SPACING
    places = width + SPACING * (0.5 + np.indices((a_side,) * 3).reshape(3, -1).T)
    places += draw.uniform(-0.005, 0.005, places.shape) * DIAMETER
    spheres = make_particles(places, 0.5 * DIAMETER, GLASS.density)
    spheres.id[:] += NAMES * int(ALONG @ (32, 32, 32))
    replica.tables.append(spheres.arrays)
    x, y, z = ((width * np.arange(1, n)).tolist() for n in shape)
    run: Any = ParticleSolver(
        spheres, pair_table([GLASS]), laws=DRY,
        sharing=Sharing(communicator=replica, division=Bricks((x, y, z))),
        settings=SolverSettings(skin=0.1 * DIAMETER, check_steps=False),
    )  # fmt: skip
    replica.tables.append(run.edges.of(np.zeros(0, np.int32), run.particles.id))
    seconds = []
    for _ in range(LISTS):
        number = run.particles.id % NAMES
        run.particles.position[:] += draw.normal(0.0, 0.02 * DIAMETER, places.shape)[number]
        begin = time.process_time()
        run._relist()
        seconds.append(time.process_time() - begin)
    ghosts = run.lists.ghosts
    return float(np.median(seconds)), replica.record, run.particles.count - run.particles.owned, len(ghosts._near)


def reductions() -> dict[str, float]:
    """Times of reductions by the name of each, without the network [s]."""
    replica, one, field = Replica((16, 16, 16)), np.ones(1), np.ones((3, 8))
    calls: dict[str, Callable[[], Any]] = {
        "any": lambda: replica.any(False), "largest": lambda: replica.largest(one), "sum": lambda: replica.sum(one),
        "sum of three": lambda: replica.sum(field, axis=1),
    }  # fmt: skip
    found = {}
    for name, call in calls.items():
        call()
        begin = time.process_time()
        for _ in range(CALLS):
            call()
        found[name] = (time.process_time() - begin) / CALLS
    return found


def main(count: int) -> None:
    """Print times, and whether they stay within what is allowed."""
    for name, seconds in reductions().items():
        word = "" if seconds < MOST_REDUCTION else f", above {1e6 * MOST_REDUCTION:.0f} us"
        print(f"  {name:<14}{1e6 * seconds:8.1f} us{word}")
    a_side, first = round(count ** (1.0 / 3.0)), 0.0
    use_threads(1)
    patched: Any = DividedDomain
    patched.refresh = lambda self, phase: None  # what ghosts receive in steps is not recorded
    _, record, *_ = lists((3, 3, 3), a_side)
    for shape in SHAPES:
        seconds, _, ghosts, beside = lists(shape, a_side, record)
        first = first or seconds
        ratio, name = seconds / first, "x".join(map(str, shape))
        word = "" if ratio < MOST_LIST else f", above {MOST_LIST}"
        times = f"{1e3 * seconds:8.1f} ms a list, {ratio:.2f} of that of 8 ranks{word}"
        print(f"  {name:<14}{times}; {beside} neighbours, {ghosts} ghosts")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20_000)
