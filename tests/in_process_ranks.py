"""Several ranks in one process: each in a thread of its own, one at a time."""

from __future__ import annotations

import pickle
import queue
import threading
from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from cfddem.backend.communicator import Communicator, Value
from cfddem.backend.compile import use_threads

PATIENCE = 300
"""How long a rank waits for another [s]."""


class Board:
    """Where ranks leave their values for each other. Only the rank that holds the turn runs."""

    def __init__(self, size: int) -> None:
        self.size, self.turn = size, threading.Lock()
        self._values: list[Any] = [None] * size
        self._barrier = threading.Barrier(size)
        self._mail: dict[tuple[int, int], queue.SimpleQueue[bytes]] = defaultdict(queue.SimpleQueue)

    def gather(self, rank: int, value: Any) -> list[Any]:
        """The values of all ranks, in their order."""
        self._values[rank] = value
        self._wait()
        values = list(self._values)
        self._wait()
        return values

    def send(self, sender: int, receiver: int, value: Any) -> None:
        """Leave a value for another rank."""
        self._mail[sender, receiver].put(pickle.dumps(value))  # as between processes

    def receive(self, sender: int, receiver: int) -> Any:
        """The next value that a rank has left for this one."""
        mail = self._mail[sender, receiver]
        for _ in range(PATIENCE):
            if not mail.empty():
                return pickle.loads(mail.get())
            self.turn.release()
            try:
                return pickle.loads(mail.get(timeout=1.0))
            except queue.Empty:
                if self._barrier.broken:
                    break
            finally:
                self.turn.acquire()
        raise threading.BrokenBarrierError

    def _wait(self) -> None:
        self.turn.release()
        try:
            self._barrier.wait(timeout=PATIENCE)
        finally:
            self.turn.acquire()

    def give_up(self) -> None:
        """Let the other ranks fail, too."""
        self._barrier.abort()


class Rank(Communicator):
    """The communicator of one of these ranks."""

    def __init__(self, rank: int, board: Board) -> None:
        self.rank, self.size, self.board = rank, board.size, board
        self.partners: set[int] = set()  # ranks with which it has exchanged arrays

    def broadcast(self, value: Value, root: int = 0) -> Value:
        return self.board.gather(self.rank, value)[root]  # type: ignore[no-any-return]

    def swap(self, outgoing: Mapping[int, np.ndarray], incoming: Mapping[int, np.ndarray]) -> None:
        self.partners |= set(outgoing) | set(incoming)
        for rank, values in outgoing.items():
            self.board.send(self.rank, rank, values)
        for rank, into in incoming.items():
            into[...] = self.board.receive(rank, self.rank)

    def _given_by_all(self, numbers: np.ndarray) -> np.ndarray:
        return np.array([each[self.rank] for each in self.board.gather(self.rank, numbers)])

    def _combine(self, local: Any, operation: Callable[[Any, Any], Any]) -> Any:
        total, *others = self.board.gather(self.rank, local)
        for other in others:
            total = operation(total, other)
        return total


def on_ranks(size: int, program: Callable[[Communicator], Any], threads: int | None = 1) -> list[Any]:
    """Run a program on each rank; returns what it returns, in the order of ranks. The first error is raised.

    threads  for the loops of each rank; None for all, which compiles them anew
    """
    board, results, errors = Board(size), [None] * size, []

    def run(rank: int) -> None:
        with board.turn:
            use_threads(threads)  # a new thread of Python begins with all
            try:
                results[rank] = program(Rank(rank, board))
            except threading.BrokenBarrierError:
                pass
            except BaseException as error:
                errors.append(error)
                board.give_up()

    begun = [threading.Thread(target=run, args=(rank,)) for rank in range(size)]
    for each in begun:
        each.start()
    for each in begun:
        each.join()
    if errors:
        raise errors[0]
    return results
