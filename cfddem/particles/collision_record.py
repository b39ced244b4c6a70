"""The record of collisions: which bodies, when, at what speed, with which film, and how they separated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.particles.collision_events import COLLISION
from cfddem.particles.particle_feature import Engine, ParticleFeature

MOST = 500_000
"""Rows kept between two snapshots; where there are more, every second row is dropped, repeatedly if needed."""

_FIRST, _SECOND, _SPREAD = (np.uint64(odd) for odd in (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0xBF58476D1CE4E5B9))


class CollisionRecord(ParticleFeature):
    """A growing table of collisions, filled by the particle loop.

    `table` is a structured array of dtype :data:`cfddem.particles.collision_events.COLLISION`, with liquid of more
    columns. Above `most` rows the table is thinned out evenly; the weight of a row is the number of collisions
    that it represents.

    most          rows to keep until they are taken
    dtype         of a row
    communicator  of the run
    """

    name = "collisions"

    def __init__(self, most: int = MOST, dtype: np.dtype = COLLISION, communicator: Communicator = SERIAL) -> None:
        self.most, self.dtype, self._communicator = most, dtype, communicator
        self._kept: list[np.ndarray] = []
        self._count, self._share = 0, 1  # rows kept; one of how many collisions is
        self._rows = np.zeros(0, self.dtype)

    @property
    def table(self) -> np.ndarray:
        """All collisions that have ended, in the order of their ends."""
        return np.concatenate([np.zeros(0, self.dtype), *self._kept])

    def room(self, edges: int) -> np.ndarray:
        """Rows for the loop to write to; enough for one collision of every edge."""
        if len(self._rows) < 2 * edges:
            self._rows = np.zeros(2 * edges + 64, self.dtype)
        return self._rows

    def after(self, engine: Engine, step: float, last: bool, ended: int) -> None:
        """Keep the rows that the loop has written."""
        self.keep(ended)

    def keep(self, count: int) -> None:
        """Keep the first `count` rows that the loop has written."""
        if not count:
            return
        fresh = _thinned(self._rows[:count], self._share)
        self._kept.append(fresh)
        self._count += len(fresh)
        while self._count > self.most:
            self._share *= 2
            self._kept = [_thinned(self.table, self._share)]
            self._count = len(self._kept[0])

    def take(self) -> np.ndarray:
        """All rows of all ranks, on rank 0, in the order of their ends; the table is empty afterwards."""
        table = self._gathered()
        self._kept, self._count, self._share = [], 0, 1
        return table

    def _gathered(self) -> np.ndarray:
        rows = self._communicator.gathered(self.table)
        return rows if self._communicator.size == 1 else np.sort(rows, order=["end", "first", "second"])

    def checkpoint(self) -> dict[str, Any]:
        """All rows of all ranks, on rank 0."""
        return {"rows": self._gathered()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        if self._communicator.rank == 0:
            self.put_back(state["rows"])

    def put_back(self, rows: np.ndarray) -> None:
        """Put earlier rows back, as after a restart."""
        kept = np.array(rows, self.dtype)
        self._kept, self._count = [kept], len(kept)
        self._share = int(kept["weight"].max(initial=1.0))  # local: record of this rank


def _thinned(rows: np.ndarray, share: int) -> np.ndarray:
    """One of `share` rows, a power of two; the choice depends on the collisions alone, not on when they were kept."""
    if share == 1:
        return rows.copy()
    mixed = np.ascontiguousarray(rows["begin"]).view(np.uint64) * _SPREAD
    mixed = mixed ^ (rows["first"].astype(np.uint64) * _FIRST) ^ (rows["second"].astype(np.uint64) * _SECOND)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * _SPREAD
    chosen = rows[(mixed >> np.uint64(40)) % np.uint64(share) == 0].copy()
    chosen["weight"] = share
    return chosen
