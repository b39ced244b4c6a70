"""Several ranks in one process: each in a thread of its own, one at a time."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable, Sequence
from typing import Any

from cfddem.backend.communicator import Communicator, Value


class Board:
    """Where ranks leave their values for each other. Only the rank that holds the turn runs."""

    def __init__(self, size: int) -> None:
        self.size, self.turn = size, threading.Lock()
        self._values: list[Any] = [None] * size
        self._barrier = threading.Barrier(size)

    def gather(self, rank: int, value: Any) -> list[Any]:
        """The values of all ranks, in their order."""
        self._values[rank] = value
        self._wait()
        values = list(self._values)
        self._wait()
        return values

    def _wait(self) -> None:
        self.turn.release()
        try:
            self._barrier.wait(timeout=300.0)
        finally:
            self.turn.acquire()

    def give_up(self) -> None:
        """Let the other ranks fail, too."""
        self._barrier.abort()


class Rank(Communicator):
    """The communicator of one of these ranks."""

    def __init__(self, rank: int, board: Board) -> None:
        self.rank, self.size, self.board = rank, board.size, board

    def broadcast(self, value: Value, root: int = 0) -> Value:
        return self.board.gather(self.rank, value)[root]  # type: ignore[no-any-return]

    def exchange(self, parcels: Sequence[Value]) -> list[Value]:
        assert len(parcels) == self.size
        given = self.board.gather(self.rank, [pickle.dumps(parcel) for parcel in parcels])  # as between processes
        return [pickle.loads(parcels[self.rank]) for parcels in given]

    def _combine(self, local: Any, operation: Callable[[Any, Any], Any]) -> Any:
        total, *others = self.board.gather(self.rank, local)
        for other in others:
            total = operation(total, other)
        return total


def on_ranks(size: int, program: Callable[[Communicator], Any]) -> list[Any]:
    """Run a program on each rank; returns what it returns, in the order of ranks. The first error is raised."""
    board, results, errors = Board(size), [None] * size, []

    def run(rank: int) -> None:
        with board.turn:
            try:
                results[rank] = program(Rank(rank, board))
            except threading.BrokenBarrierError:
                pass
            except BaseException as error:
                errors.append(error)
                board.give_up()

    threads = [threading.Thread(target=run, args=(rank,)) for rank in range(size)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]
    return results
