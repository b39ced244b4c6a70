"""The record of encounters: who met whom, when, how hard, on what film, and how they parted."""

from __future__ import annotations

import numpy as np

from cfddem.particles.encounters import ENCOUNTER

MOST = 500_000
"""Rows that are kept between two snapshots; where there are more, every second is dropped, as often as it takes."""

_FIRST, _SECOND, _SPREAD = (np.uint64(odd) for odd in (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0xBF58476D1CE4E5B9))


class CollisionRecord:
    """An appendable table of encounters, filled by the particle loop.

    `table` is a structured array of dtype :data:`cfddem.particles.encounters.ENCOUNTER`. Too many rows are thinned
    out evenly; the weight of a row says how many encounters it stands for.

    most  rows to keep until they are taken
    """

    def __init__(self, most: int = MOST) -> None:
        self.most = most
        self._kept: list[np.ndarray] = []
        self._count, self._share = 0, 1  # rows kept; one of how many encounters is
        self._rows = np.zeros(0, ENCOUNTER)

    @property
    def table(self) -> np.ndarray:
        """All encounters that have ended, in the order of their ends."""
        return np.concatenate([np.zeros(0, ENCOUNTER), *self._kept])

    def room(self, edges: int) -> np.ndarray:
        """Rows for the loop to write to; enough for every edge to part at least once."""
        if len(self._rows) < 2 * edges:
            self._rows = np.zeros(2 * edges + 64, ENCOUNTER)
        return self._rows

    def keep(self, count: int) -> None:
        """Keep the first rows that the loop has written."""
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
        """All rows, which are forgotten here."""
        table = self.table
        self._kept, self._count, self._share = [], 0, 1
        return table

    def put_back(self, rows: np.ndarray) -> None:
        """Rows that ended before those to come, as after a restart."""
        kept = np.array(rows, ENCOUNTER)
        self._kept, self._count = [kept], len(kept)
        self._share = int(kept["weight"].max(initial=1.0))


def _thinned(rows: np.ndarray, share: int) -> np.ndarray:
    """One of `share` rows, a power of two; which ones depends on the encounters alone, not on when they were kept."""
    if share == 1:
        return rows.copy()
    mixed = np.ascontiguousarray(rows["begin"]).view(np.uint64) * _SPREAD
    mixed = mixed ^ (rows["first"].astype(np.uint64) * _FIRST) ^ (rows["second"].astype(np.uint64) * _SECOND)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * _SPREAD
    chosen = rows[(mixed >> np.uint64(40)) % np.uint64(share) == 0].copy()
    chosen["weight"] = share
    return chosen
