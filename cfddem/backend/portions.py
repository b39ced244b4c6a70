"""Arrays of which every rank has a part, given to rank 0 in portions, so that no rank needs room for the whole.

In one process they are plain arrays. All ranks must go through the portions together, and through those of several
arrays in the same order: rank 0 takes them, the others :func:`take_part`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from cfddem.backend.communicator import Communicator

LARGEST = 4_000_000
"""Numbers in a portion, about."""

Parts = Iterator[tuple[Any, np.ndarray]]
"""Places in the whole array, as an index of it, and the numbers there; of no size except on rank 0."""


class Portions:
    """An array in portions.

    shape, dtype  of the whole array
    parts         goes through the portions from the first
    """

    def __init__(self, shape: tuple[int, ...], dtype: Any, parts: Callable[[], Parts]) -> None:
        self.shape, self.dtype, self._parts = shape, np.dtype(dtype), parts

    def __iter__(self) -> Parts:
        for index, values in self._parts():
            yield index, values.astype(self.dtype, copy=False)

    def as_type(self, dtype: Any) -> Portions:
        """The same numbers in another type."""
        return Portions(self.shape, dtype, self._parts)


def rows_by_id(values: np.ndarray, ids: np.ndarray, communicator: Communicator) -> np.ndarray | Portions:
    """The rows of all ranks in the order of their ids.

    values  rows of this rank (n, ...)
    ids     of these rows (n,), from 0
    """
    order = np.argsort(ids, kind="stable")
    if communicator.size == 1:
        return np.asarray(values[order])
    ordered, count = ids[order], communicator.sum([len(ids)])
    end, step = communicator.largest(ids, default=-1) + 1, max(LARGEST // math.prod(values.shape[1:]), 1)

    def parts() -> Parts:
        row = 0
        for first in range(0, end, step):
            begin, last = np.searchsorted(ordered, [first, first + step])
            keys = communicator.gathered(ordered[begin:last])
            rows = communicator.gathered(values[order[begin:last]])
            yield slice(row, row + len(rows)), rows[np.argsort(keys, kind="stable")]
            row += len(rows)

    return Portions((count, *values.shape[1:]), values.dtype, parts)


def rows_by_rank(values: np.ndarray, communicator: Communicator) -> np.ndarray | Portions:
    """The rows of all ranks in the order of the ranks.

    values  rows of this rank (n, ...)
    """
    if communicator.size == 1:
        return values
    counts = communicator.joined(np.array([len(values)]))
    ends = np.append(0, np.cumsum(counts))
    step = max(LARGEST // math.prod(values.shape[1:]), 1)
    mine = int(ends[communicator.rank])

    def parts() -> Parts:
        for first in range(0, int(ends[-1]), step):
            index = slice(first, min(first + step, int(ends[-1])))
            begin, end = np.clip([index.start - mine, index.stop - mine], 0, len(values))
            yield index, communicator.gathered(values[begin:end])

    return Portions((int(ends[-1]), *values.shape[1:]), values.dtype, parts)


def slices(count: int, width: int = 1, largest: int = 0) -> Iterator[slice]:
    """Rows from the first to the last of so many, in portions.

    width    numbers in a row
    largest  numbers in a portion; `LARGEST` if 0

    >>> list(slices(5, width=2, largest=4))
    [slice(0, 2, None), slice(2, 4, None), slice(4, 5, None)]
    """
    step = max((largest or LARGEST) // width, 1)
    return (slice(first, min(first + step, count)) for first in range(0, count, step))


def take_part(values: Any) -> None:
    """Give rank 0 what it asks for where it goes through these values, nested mappings of `Portions` and others."""
    if isinstance(values, Mapping):
        for array in values.values():
            take_part(array)
    elif isinstance(values, Portions):
        for _ in values:
            pass


def collected(values: Any, communicator: Communicator) -> Any:
    """The same values with whole arrays, on all ranks."""
    if isinstance(values, Mapping):
        return {name: collected(array, communicator) for name, array in values.items()}
    if not isinstance(values, Portions):
        return values
    whole = np.empty(values.shape if communicator.rank == 0 else 0, values.dtype)
    for index, part in values:
        if communicator.rank == 0:
            whole[index] = part
    return communicator.broadcast(whole)
