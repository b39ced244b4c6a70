"""The communicator of a run on several processes, over MPI (mpi4py).

Imported only by a run of several processes. MPI adds whole numbers and finds largest ones, with the same bits in any
order. All else is gathered from all ranks and combined in their order.

mpi4py suffices for all that ranks exchange, and pip installs it with an MPI of its own. In a step a rank sends a few
contiguous arrays to its neighbours, which costs as little by plain messages as by PetscSF.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from mpi4py import MPI

from cfddem.backend.communicator import Communicator, Value
from cfddem.backend.errors import RunFailed

_TAG = 1

PAUSE = 0.01
"""Time between two looks at whether the other ranks have come [s]."""

TRIAL, TRIES = 20_000, 50
"""Numbers in a message of `try_out`, about those of 2000 ghosts, and how often it is sent."""


class Ranks(Communicator):
    """The communicator of one rank of several.

    world  communicator of mpi4py; that of all processes if not given
    """

    def __init__(self, world: Any = None) -> None:
        self.world = (MPI.COMM_WORLD if world is None else world).Dup()  # our messages meet no others
        self.rank, self.size = self.world.Get_rank(), self.world.Get_size()

    def broadcast(self, value: Value, root: int = 0) -> Value:
        """See `Communicator.broadcast`."""
        return self.world.bcast(value, root)  # type: ignore[no-any-return]

    def wait(self) -> None:
        """See `Communicator.wait`."""
        arrived = self.world.Ibarrier()
        while not arrived.Test():
            time.sleep(PAUSE)

    def swap(self, outgoing: Mapping[int, np.ndarray], incoming: Mapping[int, np.ndarray]) -> None:
        """See `Communicator.swap`."""
        requests = [self.world.Irecv(into, rank, _TAG) for rank, into in incoming.items()]
        requests += [self.world.Isend(values, rank, _TAG) for rank, values in outgoing.items()]
        MPI.Request.Waitall(requests)

    def _given_by_all(self, numbers: np.ndarray) -> np.ndarray:
        """See `Communicator._given_by_all`."""
        received = np.empty_like(numbers)
        self.world.Alltoall(numbers, received)
        return received

    def joined(self, rows: np.ndarray) -> np.ndarray:
        """See `Communicator.joined`."""
        whole, sizes = self._room(rows, everywhere=True)
        self.world.Allgatherv([_bytes(rows), MPI.BYTE], [_bytes(whole), sizes, MPI.BYTE])
        return whole

    def gathered(self, rows: np.ndarray) -> np.ndarray:
        """See `Communicator.gathered`."""
        whole, sizes = self._room(rows, everywhere=False)
        self.world.Gatherv([_bytes(rows), MPI.BYTE], [_bytes(whole), sizes, MPI.BYTE] if self.rank == 0 else None)
        return whole

    def _room(self, rows: np.ndarray, everywhere: bool) -> tuple[np.ndarray, list[int]]:
        """An array for the rows of all ranks, with none where they are not wanted, and the bytes of each rank."""
        counts = self.world.allgather(len(rows))
        wanted = sum(counts) if everywhere or self.rank == 0 else 0
        whole = np.empty((wanted, *rows.shape[1:]), rows.dtype)
        width = rows.dtype.itemsize * int(np.prod(rows.shape[1:]))
        return whole, [count * width for count in counts]

    def _add(self, whole_numbers: np.ndarray) -> np.ndarray:
        """See `Communicator._add`."""
        total = np.array(whole_numbers, np.int64)
        self.world.Allreduce(MPI.IN_PLACE, total, MPI.SUM)
        return total

    def _largest(self, values: np.ndarray) -> np.ndarray:
        """See `Communicator._largest`; MPI does not say what the largest of NaN and a number is."""
        missing = np.isnan(values)
        extremes = np.stack([np.where(missing, -np.inf, values), missing])
        self.world.Allreduce(MPI.IN_PLACE, extremes, MPI.MAX)
        return np.where(extremes[1] > 0.0, np.nan, extremes[0])

    def _combine(self, local: Any, operation: Callable[[Any, Any], Any]) -> Any:
        """See `Communicator`."""
        total, *others = self.world.allgather(local)
        for term in others:
            total = operation(total, term)
        return total


def _bytes(rows: np.ndarray) -> np.ndarray:
    """The bytes of an array; a copy if it is not contiguous."""
    return np.ascontiguousarray(rows).reshape(-1).view(np.uint8)


def try_out(world: Any = None) -> str:
    """Exchange ghosts and a sum between all ranks; returns what was found, with the time of each."""
    ranks = Ranks(world)
    expected = (ranks.size + 1) * ranks.size // 2
    if ranks.sum([ranks.rank + 1]) != expected:
        raise RunFailed(
            f"the sum over {ranks.size} ranks is not {expected}: launcher and mpi4py belong to different MPIs"
        )
    outgoing = {rank: np.full(TRIAL, 1.0 + ranks.rank) for rank in range(ranks.size)}
    incoming = {rank: np.zeros(TRIAL) for rank in range(ranks.size)}
    times = np.empty((2, TRIES))
    for n in range(TRIES):
        begin = time.perf_counter()
        ranks.swap(outgoing, incoming)
        middle = time.perf_counter()
        ranks.largest([1.0])
        times[:, n] = middle - begin, time.perf_counter() - middle
    if not all(np.all(values == 1.0 + rank) for rank, values in incoming.items()):
        raise RunFailed("ranks received other values than were sent")
    swap, reduce = 1e6 * np.median(times, axis=1)
    library = MPI.Get_library_version().strip("\0").splitlines()[0].strip()
    size = f"{8e-3 * TRIAL:.0f} kB"
    return f"{ranks.size} ranks, {library}: {size} between neighbours {swap:.0f} us, largest of all {reduce:.0f} us"


if __name__ == "__main__":
    text = try_out()
    if MPI.COMM_WORLD.Get_rank() == 0:
        print(text)
