"""Several ranks in one process: each in a thread of its own, one at a time."""

from __future__ import annotations

import threading
from collections import defaultdict, deque
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from cfddem.backend.communicator import Communicator, Value
from cfddem.backend.compile import use_threads


class EndedByOthersError(Exception):
    """Another rank has failed, or all wait for each other."""


class Board:
    """Where ranks leave their values for each other. One rank runs at a time, until it has to wait for others."""

    def __init__(self, size: int) -> None:
        self.size, self.failed = size, False
        self._values: tuple[list[Any], ...] = [None] * size, [None] * size  # of the present gather and of the last
        self._rounds = [0] * size
        self._mail: dict[tuple[int, int], deque[np.ndarray]] = defaultdict(deque)
        self._turns = [threading.Lock() for _ in range(size)]
        for turn in self._turns:
            turn.acquire()
        self._ready, self._gathering = deque(range(size)), list[int]()
        self._receiving: dict[tuple[int, int], int] = {}

    def gather(self, rank: int, value: Any) -> list[Any]:
        """The values of all ranks, in their order."""
        values = self._values[self._rounds[rank] % 2]
        values[rank] = value
        self._rounds[rank] += 1
        self._gathering.append(rank)
        if len(self._gathering) < self.size:
            self._wait(rank)
        else:
            self._ready += self._gathering[:-1]
            self._gathering.clear()
        return list(values)

    def send(self, sender: int, receiver: int, values: np.ndarray) -> None:
        """Leave a copy of an array for another rank."""
        self._mail[sender, receiver].append(values.copy())
        if self._receiving.pop((sender, receiver), None) is not None:
            self._ready.append(receiver)

    def receive(self, sender: int, receiver: int) -> np.ndarray:
        """The next array that a rank has left for this one."""
        if not self._mail[sender, receiver]:
            self._receiving[sender, receiver] = receiver
            self._wait(receiver)
        return self._mail[sender, receiver].popleft()

    def _wait(self, rank: int) -> None:
        self.pass_on()
        self.take_turn(rank)

    def take_turn(self, rank: int) -> None:
        """Wait for the turn of a rank."""
        self._turns[rank].acquire()
        if self.failed:
            raise EndedByOthersError

    def pass_on(self) -> None:
        """Let the next rank run; if all that are left wait for each other, let them fail."""
        if self._ready:
            self._turns[self._ready.popleft()].release()
        elif self._gathering or self._receiving:
            self.give_up()

    def give_up(self) -> None:
        """Let all ranks that wait fail."""
        waiting = set() if self.failed else {*self._ready, *self._gathering, *self._receiving.values()}
        self.failed = True
        for rank in waiting:
            self._turns[rank].release()


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
        try:
            board.take_turn(rank)
            use_threads(threads)  # a new thread of Python begins with all
            results[rank] = program(Rank(rank, board))
            board.pass_on()
        except EndedByOthersError:
            pass
        except BaseException as error:
            errors.append(error)
            board.give_up()

    begun = [threading.Thread(target=run, args=(rank,)) for rank in range(size)]
    for each in begun:
        each.start()
    board.pass_on()
    for each in begun:
        each.join()
    if errors:
        raise errors[0]
    assert not board.failed, "the ranks wait for each other"
    return results
