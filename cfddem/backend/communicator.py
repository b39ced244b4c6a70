"""Sums, extreme values and decisions over all ranks of a run; and how ranks share a box.

A run on a cluster divides cells and particles among ranks. A rank then knows only a part of every array, so a sum, an
extreme value or a decision over the whole array must go through a communicator. `Communicator` is that of a run in one
process. A parallel communicator (:class:`cfddem.backend.mpi.Ranks`) replaces `_combine`, `broadcast`, `swap` and
`_given_by_all`, and `_add` and `_largest` for speed.

Sums are sums of whole numbers (:mod:`cfddem.backend.exact_sums`): they have the bits of one process on any number of
ranks, however an array is divided among them. All ranks must make the same calls in the same order.

A line that reduces an array of this rank alone, on purpose, says so with a comment `# local: reason`.
`tests/backend/test_communicator.py` forbids other reductions without a communicator in the code of the solver.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from cfddem.backend.errors import CfddemError, InputError, failure_elsewhere
from cfddem.backend.exact_sums import put_together, unit_of

Value = TypeVar("Value")
Axis = int | tuple[int, ...] | None


class Communicator:
    """The communicator of a run in one process.

    rank  number of this process among all, from 0
    size  number of processes
    shape  of them along x, y, z, where the user gives it

    >>> one = Communicator()
    >>> one.sum([1.0, 2.0]), one.largest([1.0, float("nan")]), one.any([False, True])
    (3.0, nan, True)
    """

    rank: int = 0
    size: int = 1
    shape: Shape | None = None

    def sum(self, values: ArrayLike, axis: Axis = None) -> Any:
        """Sum over all elements, or over some axes, of the arrays of all ranks; NaN where an element is not finite.

        axis     axes to sum over; all if None; () adds the arrays of the ranks element by element. The axes that
                 stay must be equally long on all ranks
        returns  a number, or an array of the axes that stay
        """
        array = np.asarray(values)
        if array.dtype.kind in "biu":
            return _plain(self._add(np.asarray(array.sum(axis=axis, dtype=np.int64))))
        # loads the compiler, which checks lack
        from cfddem.backend.exact_sums_loops import largest_of_rows, split, sums_of_rows

        rows, kept = _rows(array.astype(float, copy=False), axis)
        if self.size == 1:  # the same in one call
            of_rows = np.empty(len(rows))
            sums_of_rows(rows, rows.view(np.int64), of_rows, of_rows.view(np.int64))
            return of_rows.reshape(kept) if kept else float(of_rows[0])
        most, parts = np.zeros(len(rows)), np.zeros((2, len(rows)), np.int64)
        largest_of_rows(rows.view(np.int64), most.view(np.int64))
        most = self._largest(most)
        units = [unit_of(size) if math.isfinite(size) else 0.0 for size in most.tolist()]
        split(rows, np.array(units), parts)
        whole, fine = self._add(parts).tolist()
        sums = [put_together(pieces, unit) if unit > 0.0 else math.nan for *pieces, unit in zip(whole, fine, units)]
        return np.array(sums).reshape(kept) if kept else sums[0]

    def largest(self, values: ArrayLike, axis: Axis = None, *, default: float = -np.inf) -> Any:
        """Largest element of the arrays of all ranks; NaN if any element is NaN.

        default  contribution of a rank without elements
        """
        tops = array = np.asarray(values)
        if not array.size:
            tops = np.full(array.sum(axis=axis).shape, default)
        elif axis != ():
            tops = np.maximum.reduce(array, axis=tuple(range(array.ndim)) if axis is None else axis)
        whole = self._largest(np.asarray(tops, float))
        return _plain(whole if tops.dtype.kind == "f" else whole.astype(tops.dtype))

    def smallest(self, values: ArrayLike, axis: Axis = None, *, default: float = np.inf) -> Any:
        """Smallest element of the arrays of all ranks; NaN if any element is NaN.

        default  contribution of a rank without elements
        """
        return _plain(-np.asarray(self.largest(-np.asarray(values), axis, default=-default)))

    def any(self, condition: ArrayLike) -> bool:
        """Whether a condition holds for any element on any rank; False without elements."""
        return bool(self._add(np.asarray(np.count_nonzero(condition))) > 0)

    def all(self, condition: ArrayLike) -> bool:
        """Whether a condition holds for all elements on all ranks; True without elements."""
        return not self.any(np.logical_not(condition))

    def count(self, condition: ArrayLike) -> int:
        """Number of elements on all ranks for which a condition holds."""
        return int(self._add(np.asarray(np.count_nonzero(condition))))

    def mean(self, values: ArrayLike) -> float:
        """Mean of the elements on all ranks; NaN without elements."""
        total, count = self.sum(values), int(self._add(np.asarray(np.size(values))))
        return float(total / count) if count else float("nan")

    def joined(self, rows: np.ndarray) -> np.ndarray:
        """The rows of the arrays of all ranks, in the order of the ranks."""
        return np.asarray(self._combine(rows, lambda first, second: np.concatenate([first, second])))

    def gathered(self, rows: np.ndarray) -> np.ndarray:
        """The rows of the arrays of all ranks, in the order of the ranks, on rank 0; no rows on the others."""
        whole = self.joined(rows)
        return whole if self.rank == 0 else whole[:0]

    def first(self, value: Value | None) -> Value | None:
        """The value of the lowest rank that passes one; None if all pass None."""
        return self._combine(value, lambda first, second: second if first is None else first)  # type: ignore[no-any-return]

    def broadcast(self, value: Value, root: int = 0) -> Value:
        """The value that rank `root` passes, on all ranks."""
        return value

    def by_first(self, function: Callable[[], Value]) -> Value:
        """What a function returns that only rank 0 calls, on all ranks; where it fails, all ranks fail."""
        value: Any = None
        told: tuple[str, int] | None = None
        if self.rank == 0:
            try:
                value = function()
            except CfddemError as failure:
                self.wait()
                self.broadcast((None, (str(failure), failure.exit_code)))
                raise
        self.wait()
        value, told = self.broadcast((value, told))
        if told is not None:
            raise failure_elsewhere(*told)
        return value  # type: ignore[no-any-return]

    def wait(self) -> None:
        """Wait until all ranks have come here, without keeping a processor busy."""

    def exchange(self, parcels: Mapping[int, np.ndarray], beside: Sequence[int] | None = None) -> dict[int, np.ndarray]:
        """Give bytes to some ranks; returns those that ranks give to this one, in the order of the ranks.

        Numbers of bytes go first.

        parcels  (n,) uint8, by the rank that gets each
        beside   the only ranks that give to this one or get from it, which name this one, too; nothing is sent to
                 others. All ranks if None
        """
        if beside is None:
            told = self._given_by_all(np.array([len(parcels.get(rank, ())) for rank in range(self.size)], np.int64))
            counts = dict(enumerate(told.tolist()))
        else:
            numbers = {rank: np.zeros(1, np.int64) for rank in sorted(beside)}
            self.swap({rank: np.array([len(parcels.get(rank, ()))], np.int64) for rank in numbers}, numbers)
            counts = {rank: int(number[0]) for rank, number in numbers.items()}
        incoming = {rank: np.empty(count, np.uint8) for rank, count in counts.items() if count}
        self.swap({rank: parcel for rank, parcel in parcels.items() if len(parcel)}, incoming)
        return incoming

    def swap(self, outgoing: Mapping[int, np.ndarray], incoming: Mapping[int, np.ndarray]) -> None:
        """Send an array to each of some ranks, and fill those of `incoming` with what these ranks send to this one.

        Both sides know the sizes.

        outgoing  contiguous arrays, by the rank that gets each
        incoming  contiguous arrays of the same sizes as those that ranks send to this one, by the rank that sends each
        """
        for rank, into in incoming.items():
            into[...] = outgoing[rank]

    def _given_by_all(self, numbers: np.ndarray) -> np.ndarray:
        """Of the arrays of all ranks, each with one number for every rank, the numbers for this one."""
        return numbers

    def _add(self, whole_numbers: np.ndarray) -> np.ndarray:
        """Sum of the integer arrays of all ranks, element by element."""
        return np.asarray(self._combine(whole_numbers, np.add))

    def _largest(self, values: np.ndarray) -> np.ndarray:
        """Largest of the float arrays of all ranks, element by element; NaN where one is NaN."""
        return np.asarray(self._combine(values, np.maximum))

    def _combine(self, local: Any, operation: Callable[[Any, Any], Any]) -> Any:
        """Combine the values of all ranks, in the order of the ranks; the value of this rank if it is the only one."""
        return local


def _rows(array: np.ndarray, axis: Axis) -> tuple[np.ndarray, tuple[int, ...]]:
    """An array as rows of what is summed over some axes (k, n), and the shape of the axes that stay."""
    if axis is None:
        return np.ascontiguousarray(array).reshape(1, -1), ()
    summed = {number % array.ndim for number in ((axis,) if isinstance(axis, int) else axis)}
    stay = [d for d in range(array.ndim) if d not in summed]
    kept = tuple(array.shape[d] for d in stay)
    count = math.prod(array.shape[d] for d in summed)
    return np.ascontiguousarray(array.transpose([*stay, *sorted(summed)])).reshape(math.prod(kept), count), kept


def _plain(value: Any) -> Any:
    """A Python number for an array without axes, so that no NumPy scalar leaves the communicator."""
    return value.item() if np.ndim(value) == 0 and hasattr(value, "item") else value


SERIAL = Communicator()
"""The communicator of solvers that are not given one."""


# ---------------------------------------------------------------- ranks that share a box
#
# Space and cells are divided by planes across x, y and z, the same for all ranks, so that each rank has a *brick*.
# Bricks of one rank along two axes are slabs.


Shape = tuple[int, int, int]
"""Ranks along x, y, z."""


def shapes(ranks: int, most: Sequence[int]) -> list[Shape]:
    """All ways to arrange ranks along x, y, z; along y rather than x and x rather than z first.

    most  largest number along x, y, z
    """
    return [
        (x, ranks // z // x, z)
        for z in range(1, min(ranks, most[2]) + 1) if ranks % z == 0
        for x in range(1, min(ranks // z, most[0]) + 1) if ranks // z % x == 0 and ranks // z // x <= most[1]
    ]  # fmt: skip


def place_of(rank: int, shape: Shape) -> tuple[int, int, int]:
    """Place of a rank along x, y, z."""
    x, y, z = (int(n) for n in np.unravel_index(rank, shape))
    return x, y, z


def with_ghosts(widths: Sequence[np.ndarray], reach: float) -> np.ndarray:
    """Volume of each brick of an open box, with what lies within reach of it in other bricks, over its own volume.

    widths  of the bricks along x, y, z
    reach   in the unit of the widths
    returns of the shape of the ranks
    """
    lines = []
    for width in widths:
        sides = np.full(len(width), 2.0)
        sides[0] -= 1.0
        sides[-1] -= 1.0
        lines.append(1.0 + sides * reach / width)
    return np.einsum("x,y,z->xyz", *lines)


def division_of(text: str) -> Shape:
    """The shape that a text such as "2x2x1" names.

    >>> division_of("2x2x1")
    (2, 2, 1)
    """
    parts = text.lower().split("x")
    if len(parts) != 3 or not all(part.isdecimal() and int(part) > 0 for part in parts):
        raise InputError("--division", text, "ranks along x, y and z, such as 2x2x1")
    x, y, z = map(int, parts)
    return x, y, z
