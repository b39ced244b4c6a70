"""The record of encounters: who met whom, when, how hard, on what film, and how they parted."""

from __future__ import annotations

import numpy as np

from cfddem.particles.encounters import ENCOUNTER


class CollisionRecord:
    """An appendable table of encounters, filled by the particle loop.

    `table` is a structured array of dtype :data:`cfddem.particles.encounters.ENCOUNTER`.
    """

    def __init__(self) -> None:
        self._kept: list[np.ndarray] = []
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
        if count:
            self._kept.append(self._rows[:count].copy())

    def take(self) -> np.ndarray:
        """All rows, which are forgotten here."""
        table, self._kept = self.table, []
        return table

    def put_back(self, rows: np.ndarray) -> None:
        """Rows that ended before those to come, as after a restart."""
        self._kept = [np.array(rows, ENCOUNTER)]
