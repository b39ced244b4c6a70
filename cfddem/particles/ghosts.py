"""Particles of a run that several processes share: who owns which, and ghosts of those that others own.

Space is divided among the ranks. At every new neighbour list each particle moves to the rank that owns its place, with
all its fields and with what its pairs remember. Then each rank receives copies of all particles that its own particles
may meet before the next list. Between two lists ranks send the fields of a phase (:class:`cfddem.data.fields.Field`).

Both owners of a pair compute it, from the same numbers in the same order, so that a run has the same bits for any
division of space.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import specialise
from cfddem.data.fields import Phase, Table
from cfddem.particles.integrate import finish_step, move, start_step
from cfddem.particles.pair_graph import Edges
from cfddem.particles.state import Particles


@dataclass(frozen=True)
class Slabs:
    """Space divided by planes across one axis: rank n owns what lies between plane n - 1 and plane n.

    axis    0, 1 or 2
    planes  positions along the axis, in ascending order, one fewer than ranks [m]
    """

    axis: int
    planes: Sequence[float]

    def owner(self, position: np.ndarray) -> np.ndarray:
        """Rank that owns each position (N,)."""
        return np.searchsorted(np.asarray(self.planes), position[:, self.axis], side="right")

    def distance(self, position: np.ndarray, rank: int, box: np.ndarray) -> np.ndarray:
        """Distance of each position from the space of a rank, over the borders of a periodic box too (N,) [m].

        box  (3,) length of the periodic box, which begins at 0; infinite along open axes [m]
        """
        ends = (-np.inf, *self.planes, np.inf)
        place, length = position[:, self.axis], box[self.axis]
        if np.isinf(length):
            return np.maximum(np.maximum(ends[rank] - place, place - ends[rank + 1]), 0.0)
        low, high = max(ends[rank], 0.0), min(ends[rank + 1], length)
        images = [np.maximum(low - place - shift, place + shift - high) for shift in (-length, 0.0, length)]
        return np.maximum(np.minimum(np.minimum(*images[:2]), images[2]), 0.0)


class Whole:
    """The particles of a run in one process: it owns all of them."""

    def own(self, particles: Particles) -> Particles:
        """Those of the particles that belong to this rank."""
        return particles

    def migrate(self, particles: Particles, old_row: np.ndarray, edges: Edges | None) -> np.ndarray:
        """Drop all ghosts, give particles to the ranks that own their places, and take those that come.

        old_row  (N,) int32, row in the old list of each particle of this rank, without ghosts; -1 for new ones
        edges    the old list; None if there is none
        returns  the rows in the old list of the particles as they are now; -1 for those that were not in it
        """
        return old_row

    def renew(self, particles: Particles, reach: float, box: np.ndarray) -> np.ndarray:
        """Add the ghosts that lists up to a distance `reach` [m] need; returns their rows in the old list."""
        return np.zeros(0, np.int32)

    def recall(self, edges: Edges, ids: np.ndarray) -> None:
        """Give pairs of particles that have come what they remember."""

    def refresh(self, phase: Phase) -> None:
        """Give ghosts the present values of the fields of a phase."""

    def checkpoint(self) -> dict[str, np.ndarray]:
        """Which rows are ghosts, and of whom."""
        return {}

    def restore(self, particles: Particles, state: Mapping[str, np.ndarray]) -> None:
        """Continue from a `checkpoint()`, with the particles of that time."""


class Divided(Whole):
    """The particles of one rank of several.

    division      of space
    communicator  between the ranks
    """

    def __init__(self, division: Slabs, communicator: Communicator) -> None:
        if len(division.planes) + 1 != communicator.size:
            raise InputError("planes", len(division.planes), f"{communicator.size - 1}, one fewer than ranks")
        self.division, self.communicator = division, communicator
        self._sent: list[np.ndarray] = []  # owned rows that each rank has as ghosts
        self._received: list[slice] = []  # rows of the ghosts from each rank
        self._ids = np.zeros(0, np.int64)  # of all rows, as the last list was made
        self._order = np.zeros(0, np.int64)  # rows in the order of these ids
        self._arrived: list[Table] = []
        self._particles: Any = None

    def own(self, particles: Particles) -> Particles:
        """See `Whole.own`."""
        return particles.copy(self.division.owner(particles.position) == self.communicator.rank)

    def migrate(self, particles: Particles, old_row: np.ndarray, edges: Edges | None) -> np.ndarray:
        """See `Whole.migrate`."""
        particles.drop_ghosts()
        owner = self.division.owner(particles.position)
        stay = owner == self.communicator.rank
        parcels = []
        for rank in range(self.communicator.size):
            go = np.flatnonzero((owner == rank) & ~stay)
            parcels.append((particles.copy(go), None if edges is None else edges.of(old_row[go], self._ids)))
        particles.keep(stay)
        old_row, self._arrived = old_row[stay], []
        for comers, pairs in self.communicator.exchange(parcels):
            old_row = np.append(old_row, self._known(comers.id))
            particles.append(comers)
            if pairs is not None and pairs.rows:
                self._arrived.append(pairs)
        return old_row

    def renew(self, particles: Particles, reach: float, box: np.ndarray) -> np.ndarray:
        """See `Whole.renew`."""
        others = [rank for rank in range(self.communicator.size) if rank != self.communicator.rank]
        self._sent = [np.zeros(0, np.int64) for _ in range(self.communicator.size)]
        for rank in others:
            self._sent[rank] = np.flatnonzero(self.division.distance(particles.position, rank, box) < reach)
        self._received = []
        for ghosts in self.communicator.exchange([particles.copy(rows) for rows in self._sent]):
            self._received.append(slice(particles.count, particles.count + ghosts.count))
            particles.add_ghosts(ghosts)
        old_row = self._known(particles.id[particles.owned :])
        self._listed(particles)
        return old_row

    def recall(self, edges: Edges, ids: np.ndarray) -> None:
        """See `Whole.recall`."""
        for pairs in self._arrived:
            edges.recall(pairs, ids)
        self._arrived = []

    def refresh(self, phase: Phase) -> None:
        """See `Whole.refresh`."""
        particles = self._particles
        names = particles.halo_fields(phase)
        parcels = [[particles[name][rows] for name in names] for rows in self._sent]
        for rows, parcel in zip(self._received, self.communicator.exchange(parcels)):
            for name, values in zip(names, parcel):
                particles[name][rows] = values

    def checkpoint(self) -> dict[str, np.ndarray]:
        """See `Whole.checkpoint`."""
        return {
            "sent": np.concatenate(self._sent),
            "sent_to": np.array([len(rows) for rows in self._sent]),
            "received": np.array([rows.stop - rows.start for rows in self._received]),
        }

    def restore(self, particles: Particles, state: Mapping[str, np.ndarray]) -> None:
        """See `Whole.restore`."""
        self._sent = np.split(np.asarray(state["sent"]), np.cumsum(state["sent_to"])[:-1])
        ends = particles.count - np.cumsum(state["received"][::-1])[::-1]
        self._received = [slice(int(a), int(a + n)) for a, n in zip(ends, state["received"])]
        particles.set_ghosts(particles.count - self._received[0].start)
        self._listed(particles)

    def _listed(self, particles: Particles) -> None:
        """Take note of the rows of a list."""
        self._particles, self._ids, self._order = particles, particles.id.copy(), np.argsort(particles.id)

    def _known(self, ids: np.ndarray) -> np.ndarray:
        """Row that each id had in the last list; -1 if it was not in it (k,) int32."""
        place = np.searchsorted(self._ids, ids, sorter=self._order)
        found = np.full(len(ids), -1, np.int32)
        inside = np.flatnonzero(place < len(self._order))
        rows = self._order[place[inside]]
        same = self._ids[rows] == ids[inside]
        found[inside[same]] = rows[same]
        return found


class StepsWithGhosts:
    """The loop of :func:`cfddem.particles.integrate.integrate` on one rank of several: one phase after the other.

    choices       what the run puts into the slots of the loops
    threads       compile loops for all threads
    ghosts        of the run
    communicator  of the run
    """

    def __init__(self, choices: Mapping[str, Any], threads: bool, ghosts: Whole, communicator: Communicator) -> None:
        loops = (start_step, move, finish_step)
        self.start, self.move, self.finish = (specialise(loop, choices, threads) for loop in loops)
        self.films, self.recording = choices["DRIFTING"], choices["RECORD"]
        self.ghosts, self.communicator = ghosts, communicator

    def __call__(self, *arguments: Any) -> tuple[int, float, int]:
        """Arguments and results of `integrate`."""
        *pairs, p, free, gravity, step, steps, origin, reach, time, log = arguments
        particles, edges = pairs[:2]
        self.ghosts.refresh("start")
        largest, done, noted, full = 0.0, 0, 0, False
        if steps == 0:
            self.finish(*pairs, p, free, gravity, 0.0, time, log, noted)
        while done < steps and not full and largest < reach * reach:
            self.start(particles, step)
            if self.films:
                self.ghosts.refresh("film")
            moved = self.move(*pairs, free, step, origin)
            self.ghosts.refresh("motion")
            done += 1
            noted = self.finish(*pairs, p, free, gravity, step, time + done * step, log, noted)
            largest = self.communicator.largest([largest, moved])
            full = self.recording and self.communicator.any(len(log) - noted < len(edges.first))
        return done, largest, noted
