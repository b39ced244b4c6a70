"""Particles of a run that several processes share: who owns which, and ghosts of those that others own.

Space is divided among the ranks. At every new neighbour list each particle moves to the rank that owns its place, with
all its fields and with what its pairs remember. Then each rank receives copies of all particles that its own particles
may meet before the next list. Between two lists ranks send the fields of a phase (:class:`cfddem.model.fields.Field`).

Both owners of a pair compute it, from the same numbers in the same order, so that a run has the same bits for any
division of space.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import renamed, serial
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import specialise
from cfddem.backend.portions import slices
from cfddem.model.fields import Phase
from cfddem.particles.bricks import Bricks
from cfddem.particles.integrate import find_bridge_changes, finish_step, move, start_step, start_steps
from cfddem.particles.interactions.bridge_changes import share_wall_liquid
from cfddem.particles.interactions.joint_solution import (
    along_direction,
    begin_solution,
    best_factor,
    film_kick,
    finish_solution,
    new_direction,
    new_product,
    new_residual,
    new_scale,
    scale_of,
    settled,
    start_films,
    units_of,
)
from cfddem.particles.interactions.wall_liquid import wall_requests
from cfddem.particles.pair_graph import Edges
from cfddem.particles.state import Particles, rows_of
from cfddem.particles.system import System

IMBALANCE = 1.2
"""Largest work of a rank over the mean, or over what the last cut has left; where it is exceeded space is cut anew."""

ALONE = 2
"""Work for a particle over that for a pair of its list, by the bytes that a step moves for each: 296 and 177 (dry)."""


class SingleDomain:
    """The particles of a run in one process: it owns all of them.

    division  of space among the ranks, a new one after each cut; None in one process
    """

    division: Bricks | None = None

    def own(self, particles: Particles) -> Particles:
        """Those of the particles that belong to this rank."""
        return particles

    def owns(self, position: np.ndarray) -> np.ndarray:
        """Which of the places (N, 3) [m] belong to this rank (N,) bool."""
        return np.ones(len(position), bool)

    def migrate(self, particles: Particles, old_row: np.ndarray, edges: Edges | None, cut: bool = False) -> np.ndarray:
        """Drop all ghosts, give particles to the ranks that own their places, and take those that come.

        old_row  (N,) int32, row in the old list of each particle of this rank, without ghosts; -1 for new ones
        edges    the old list; None if there is none
        cut      cut space anew if the work has become unequal
        returns  the rows in the old list of the particles as they are now; -1 for those that were not in it
        """
        return old_row

    def renew(self, particles: Particles, reach: float, box: np.ndarray) -> np.ndarray:
        """Add the ghosts that lists up to a distance `reach` [m] need; returns their rows in the old list."""
        return np.zeros(0, np.int32)

    def recall(self, edges: Edges) -> None:
        """Give pairs of particles that have come what they remember."""

    def refresh(self, phase: Phase) -> None:
        """Give ghosts the present values of the fields of a phase."""


class DividedDomain(SingleDomain):
    """The particles of one rank of several.

    division      of space
    communicator  between the ranks
    balance       cut space anew when the work becomes unequal
    """

    division: Bricks

    def __init__(self, division: Bricks, communicator: Communicator, balance: bool = False) -> None:
        if math.prod(division.shape) != communicator.size:
            raise InputError("bricks", math.prod(division.shape), f"{communicator.size}, one for each rank")
        self.division, self.communicator, self.balance = division, communicator, balance
        self._sent: dict[int, np.ndarray] = {}  # owned rows that a rank has as ghosts
        self._received: dict[int, slice] = {}  # rows of the ghosts from a rank
        self._ids = np.zeros(0, np.int64)  # of all rows, as the last list was made
        self._order = np.zeros(0, np.int64)  # rows in the order of these ids
        self._arrived: list[dict[str, np.ndarray]] = []
        self._particles: Any = None
        self._uneven = 1.0  # most work of a rank over the mean, after the last cut
        self._near: list[int] | None = None  # ranks to which particles go between lists; all ranks if None

    def own(self, particles: Particles) -> Particles:
        """See `SingleDomain.own`."""
        return particles.copy(self.owns(particles.position))

    def owns(self, position: np.ndarray) -> np.ndarray:
        """See `SingleDomain.owns`."""
        return self.division.owner(position) == self.communicator.rank

    def migrate(self, particles: Particles, old_row: np.ndarray, edges: Edges | None, cut: bool = False) -> np.ndarray:
        """See `SingleDomain.migrate`."""
        particles.drop_ghosts()
        if self.balance and cut:
            self._cut_anew(particles, _work(old_row, edges))
        owner = self.division.owner(particles.position)
        leave = np.flatnonzero(owner != self.communicator.rank)

        def remembered(rows: np.ndarray) -> dict[str, np.ndarray]:
            return {} if edges is None else edges.of(rows, self._ids)

        parcels = dict[int, np.ndarray]()
        for rank in np.unique(owner[leave]).tolist():
            go = leave[owner[leave] == rank]
            parcels[rank] = packed(particles.copy(go).arrays, remembered(old_row[go]))
        if len(leave):
            stay = np.flatnonzero(owner == self.communicator.rank)
            particles.keep(stay)
            old_row = old_row[stay]
        far = self._near is None or not parcels.keys() <= set(self._near)
        beside = None if self.communicator.any(far) else self._near  # all write to all where a particle goes far
        received = self.communicator.exchange(parcels, beside).values()
        arrived = [unpacked(parcel, particles.arrays, remembered(old_row[:0])) for parcel in received]
        if arrived:
            comers = joined_rows([rows for rows, _ in arrived])
            old_row = np.append(old_row, self._known(comers["id"]))
            particles.append(particles.rows_from(comers))
        self._arrived = [pairs for _, pairs in arrived if pairs]
        return old_row

    def renew(self, particles: Particles, reach: float, box: np.ndarray) -> np.ndarray:
        """See `SingleDomain.renew`."""
        self._near = self.division.near(self.communicator.rank, reach, box)
        rows_of_ranks = self.division.rows_near(self._near, particles.position, reach, box)
        self._sent, self._received = {other: rows for other, rows in zip(self._near, rows_of_ranks) if len(rows)}, {}
        parcels = {other: packed(particles.copy(rows).arrays) for other, rows in self._sent.items()}
        copies, end = [], particles.count
        for other, parcel in self.communicator.exchange(parcels, self._near).items():
            (ghosts,) = unpacked(parcel, particles.arrays)
            begin, end = end, end + len(ghosts["id"])
            self._received[other] = slice(begin, end)
            copies.append(ghosts)
        if copies:
            particles.add_ghosts(particles.rows_from(joined_rows(copies)))
        old_row = self._known(particles.id[particles.owned :])
        self._listed(particles)
        return old_row

    def recall(self, edges: Edges) -> None:
        """See `SingleDomain.recall`."""
        for pairs in self._arrived:
            edges.recall(pairs, self._known(pairs["bodies"].reshape(-1)).reshape(-1, 2))
        self._arrived = []

    def refresh(self, phase: Phase) -> None:
        """See `SingleDomain.refresh`."""
        arrays = [_as_words(self._particles[name]) for name in self._particles.halo_fields(phase)]
        width = sum(array.shape[1] for array in arrays)
        outgoing = {rank: np.empty(width * len(rows), np.int32) for rank, rows in self._sent.items()}
        places = self._received.items()
        incoming = {rank: np.empty(width * (rows.stop - rows.start), np.int32) for rank, rows in places}
        for rank, buffer in outgoing.items():
            end = 0
            for array in arrays:
                end = _pack(array, self._sent[rank], buffer, end)
        self.communicator.swap(outgoing, incoming)
        for rank, buffer in incoming.items():
            end = 0
            for array in arrays:
                ghosts = array[self._received[rank]]
                begin, end = end, end + ghosts.size
                ghosts[...] = buffer[begin:end].reshape(ghosts.shape)

    def _cut_anew(self, particles: Particles, work: np.ndarray) -> None:
        """Divide space anew if a rank has much more work than the mean.

        work  of each particle of this rank (n,)
        """
        mine, ranks = work.sum(), self.communicator.size  # local: compared below
        most, total = self.communicator.largest([mine]), self.communicator.sum([mine])
        if most > IMBALANCE * self._uneven * total / ranks:
            self.division = Bricks.balanced(self.division.shape, particles.position, self.communicator, work)
            shares = np.zeros(ranks, np.int64)
            np.add.at(shares, self.division.owner(particles.position), work)
            self._uneven = max(max(self.communicator.sum(shares, axis=())) * ranks / total, 1.0)

    def _known(self, ids: np.ndarray) -> np.ndarray:
        """Row that each id had in the last list; -1 if it was not in it (k,) int32."""
        return rows_of(ids, self._ids, self._order)

    def _listed(self, particles: Particles) -> None:
        """Take note of the rows of a list."""
        self._particles, self._ids, self._order = particles, particles.id.copy(), np.argsort(particles.id)


def _work(old_row: np.ndarray, edges: Edges | None) -> np.ndarray:
    """Work for each particle by the pairs of its last list, in whole numbers; arguments of `SingleDomain.migrate`."""
    work = np.full(len(old_row), ALONE, np.int64)
    if edges is not None and len(edges.start) > 1:
        work += np.where(old_row >= 0, np.diff(edges.start)[old_row], 0)
    return work


def handed_out(particles: Particles, division: Bricks, communicator: Communicator) -> Particles:
    """The particles of this rank, where each rank has some of all to begin with, in any way.

    They travel in portions, so that no rank needs room for more than what it has and what it gets.

    particles     that this rank has, each of which no other rank has
    division      of space among the ranks
    communicator  between them
    """
    parts = list(slices(particles.count, sum(math.prod(array.shape[1:]) for array in particles.arrays.values())))
    mine = particles.copy(slice(0))
    for n in range(communicator.largest([len(parts)])):
        some = particles.copy(parts[n] if n < len(parts) else slice(0))
        owner = division.owner(some.position)
        parcels = {
            rank: packed(some.copy(np.flatnonzero(owner == rank)).arrays)
            for rank in np.unique(owner).tolist() if rank != communicator.rank
        }  # fmt: skip
        mine.append(some.copy(np.flatnonzero(owner == communicator.rank)))
        for parcel in communicator.exchange(parcels).values():
            mine.append(mine.rows_from(unpacked(parcel, mine.arrays)[0]))
    return mine


def packed(*tables: Mapping[str, np.ndarray]) -> np.ndarray:
    """The bytes of tables: how many rows each has, then their arrays in the order of the names."""
    rows = [len(next(iter(table.values()), ())) for table in tables]
    arrays = [np.array(rows, np.int64), *(table[name] for table in tables for name in sorted(table))]
    return np.concatenate([np.ascontiguousarray(array).reshape(-1).view(np.uint8) for array in arrays])


def unpacked(parcel: np.ndarray, *tables: Mapping[str, np.ndarray]) -> list[dict[str, np.ndarray]]:
    """The tables that another rank has `packed`, with the names and types of these, whose rows do not matter."""
    end = 8 * len(tables)
    parts = []
    for rows, table in zip(parcel[:end].view(np.int64).tolist(), tables):
        arrays = {}
        for name in sorted(table):
            array = arrays[name] = np.empty((rows, *table[name].shape[1:]), table[name].dtype)
            begin, end = end, end + array.nbytes
            array.reshape(-1).view(np.uint8)[:] = parcel[begin:end]
        parts.append(arrays)
    return parts


def joined_rows(tables: Sequence[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The rows of tables with the same fields, one table after the other."""
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}


def _as_words(array: np.ndarray) -> np.ndarray:
    """An array of numbers of four or eight bytes as words of four bytes, one row for each of its rows."""
    width = array.itemsize * math.prod(array.shape[1:]) // 4
    return array.reshape(-1).view(np.int32).reshape(len(array), width)


@serial
def _pack(values, rows, buffer, begin):
    """Copy some rows to a buffer, from `begin` on; returns the end."""
    for row in rows:
        for c in range(values.shape[1]):
            buffer[begin] = values[row, c]
            begin += 1
    return begin


class StepsWithGhosts:
    """The loop of :func:`cfddem.particles.integrate.integrate` on one rank of several: one phase after the other.

    choices       what the run puts into the slots of the loops
    threads       compile loops for all threads
    ghosts        of the run
    communicator  of the run
    """

    def __init__(
        self, choices: Mapping[str, Any], threads: bool, ghosts: SingleDomain, communicator: Communicator
    ) -> None:
        loops = (start_steps, start_step, move, find_bridge_changes, finish_step)
        self.begin, self.start, self.move, self.find_bridge_changes, self.finish = (
            specialise(loop, choices, threads) for loop in loops
        )
        self.films = films_with_ghosts(choices, threads, ghosts, communicator) if choices["JOINT"] else None
        self.bridges, self.recording = choices["BRIDGE"], choices["RECORD"]
        self.inertia, self.wet_walls = choices["BRIDGE_INERTIA"], choices.get("WALL_LIQUID")
        if self.wet_walls:
            self.requests, self.share = (specialise(loop, choices) for loop in (wall_requests, share_wall_liquid))
        self.ghosts, self.communicator = ghosts, communicator

    def __call__(
        self, system: System, step: float, steps: int, origin: np.ndarray, reach: float, time: float, log: np.ndarray
    ) -> tuple[int, float, int]:
        """Arguments and results of `integrate`."""
        self.ghosts.refresh("start")
        self.begin(system, step if steps > 0 else 0.0)
        largest, done, noted, full = 0.0, 0, 0, False
        if steps == 0:
            self.finish(self._changes(system, 0.0), system, 0.0, time, log, noted)
        while done < steps and not full and largest < reach * reach:
            self.start(system.particles, step)
            if self.films is not None:
                self.films(system, step)
            if self.inertia:
                self.ghosts.refresh("bridge")
            moved = self.move(system, step, origin)
            self.ghosts.refresh("motion")
            done += 1
            changes = self._changes(system, step)
            noted = self.finish(changes, system, step, time + done * step, log, noted)
            largest = self.communicator.largest([largest, moved])
            full = self.recording and self.communicator.any(len(log) - noted < len(system.edges.first))
        return done, largest, noted

    def _changes(self, system: System, step: float) -> int:
        """Number of bridges that form and break, found before ghosts receive liquid; -1 without bridges."""
        if not self.bridges:
            return -1
        changes: int = self.find_bridge_changes(system, step)
        self.ghosts.refresh("liquid")
        if self.wet_walls and self.communicator.any(changes):
            return self._share_wall_liquid(system)
        return changes

    def _share_wall_liquid(self, system: System) -> int:
        """Let bridges form and break, those of all ranks at walls; returns that no changes are left."""
        requesting, names, amounts = self.requests(system)
        counts = self.communicator.joined(np.array([len(requesting)]))
        rank, edges = self.communicator.rank, np.full(counts.sum(), -1)  # local: all ranks
        edges[counts[:rank].sum() :][: len(requesting)] = requesting  # local: ranks before
        joined = self.communicator.joined
        self.share(system, edges, joined(names), joined(amounts))
        return 0


# ---------------------------------------------------------------- films that are solved together


def films_with_ghosts(
    choices: Mapping[str, Any], threads: bool, ghosts: SingleDomain, communicator: Communicator
) -> Callable[[System, float], None]:
    """:func:`cfddem.particles.interactions.joint_solution.film_kick` on one rank of several.

    It is run by Python, with compiled phases, between which ghosts receive what others have found; sums are those of
    all ranks.

    Arguments as of :class:`StepsWithGhosts`.
    """
    loops = (start_films, begin_solution, new_residual, new_scale, new_direction, new_product, along_direction)
    phases = {loop.__name__: specialise(loop, choices, threads) for loop in (*loops, finish_solution, units_of)}

    def refreshed(name: str, before: Phase | None = None, after: Phase | None = None) -> Callable[..., Any]:
        """A phase with what ghosts receive before it or after it."""

        def with_ghosts(*arguments: Any) -> Any:
            if before:
                ghosts.refresh(before)
            result = phases[name](*arguments)
            if after:
                ghosts.refresh(after)
            return result

        return with_ghosts

    def of_all_ranks(number: int) -> int:
        return int(communicator.sum([number]))

    def total_of(system: System, count: int, number: int, column: int, largest: float) -> float:
        largest = communicator.largest([largest])
        if not 0.0 < largest < math.inf:
            return largest
        power = scale_of.py_func(largest, number)
        return math.ldexp(float(communicator.sum([phases["units_of"](system, count, column, power)])), -power)

    on_ranks = phases | {
        "start_films": refreshed("start_films", before="film"),
        "begin_solution": refreshed("begin_solution", after="film_change"),
        "new_direction": refreshed("new_direction", after="film_direction"),
        "of_all_ranks": of_all_ranks,
        "total_of": total_of,
        "best_factor": best_factor.py_func,
        "settled": settled.py_func,
    }
    loop = film_kick.py_func
    left = {name for name in loop.__code__.co_names if hasattr(loop.__globals__.get(name), "py_func")} - on_ranks.keys()
    if left:  # they would run without the laws of the case, and without what other ranks have found
        raise LookupError(f"phases of film_kick that ranks lack: {', '.join(sorted(left))}")
    return renamed(loop, "film_kick_with_ghosts", on_ranks)
