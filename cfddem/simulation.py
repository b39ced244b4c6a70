"""A run: the one place where particles, walls and laws are put together and moved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cfddem.errors import RunFailed
from cfddem.particles.encounters import ENCOUNTER
from cfddem.particles.forces import Laws
from cfddem.particles.motion import march, march_threaded
from cfddem.particles.neighbours import list_edges, wrap
from cfddem.particles.pairs import Edges, gaps, remember, shifts
from cfddem.particles.state import Bodies
from cfddem.particles.vectors import flat
from cfddem.particles.walls import Plane, walls
from cfddem.record.collisions import CollisionRecord

THREADING_PAYS = 1000
"""From this many particles on, loops run on all threads; on one they still work on several pairs at once."""

_NO_ROWS = np.zeros(0, ENCOUNTER)


class Simulation:
    """Particles in time.

    bodies   the particles, :func:`cfddem.particles.state.bodies`
    table    pair table, :func:`cfddem.materials.pair_table`
    planes   walls
    laws     which laws hold between two bodies
    gravity  [m/s2]
    free     1 along axes in which positions may change, 0 where they are held
    box      length of the periodic box, which begins at 0; None along open axes [m]
    skin     allowance of the neighbour list; a quarter of the largest radius if not given [m]
    record   keep a record of encounters, in `collisions`
    """

    def __init__(
        self,
        bodies: Bodies,
        table: np.ndarray,
        *,
        planes: Sequence[Plane] = (),
        laws: Laws | None = None,
        gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        free: tuple[float, float, float] = (1.0, 1.0, 1.0),
        box: tuple[float | None, float | None, float | None] = (None, None, None),
        skin: float | None = None,
        record: bool = False,
    ) -> None:
        self.bodies = bodies
        self.table = table
        self.walls = walls(planes)
        self.laws = laws or Laws()
        self.gravity, self.free = gravity, free
        self.skin = 0.25 * float(bodies.radius.max()) if skin is None else skin
        self.box = np.array([np.inf if length is None else length for length in box])
        self.time, self.steps = 0.0, 0
        self.collisions = CollisionRecord() if record else None
        self._take_list(self._listed())
        self.refresh()

    @property
    def _reach_ratio(self) -> float:
        return self.laws.cutoff_ratio if self.laws.film else 0.0

    @property
    def gap(self) -> np.ndarray:
        """Gap of every listed pair [m]."""
        return gaps(self.edges, self.bodies, self.walls, self.box)

    def refresh(self) -> None:
        """Find the forces at the present places, as after a change of state from outside."""
        self._march(0.0, 0)

    def advance(self, step: float, steps: int = 1) -> None:
        """Move by a number of equal time steps.

        step   [s]
        steps  how many
        """
        while steps > 0:
            done, farthest, noted = self._march(step, steps)
            steps -= done
            if self.collisions is not None:
                self.collisions.keep(noted)
            self.steps += done
            self.time += done * step
            if np.isnan(farthest):
                raise RunFailed(self._lost_number())
            if farthest >= (0.5 * self.skin) ** 2:
                self._relist()

    def _march(self, step: float, steps: int) -> tuple[int, float, int]:
        record = self.collisions
        large = self.bodies.count >= THREADING_PAYS
        return (march_threaded if large else march)(  # type: ignore[no-any-return]
            *self._views,
            self.table,
            self.laws.without_the_absent() if large else self.laws,
            self.free,
            self.gravity,
            step,
            steps,
            self._origin.reshape(-1),
            0.5 * self.skin,
            self.time,
            _NO_ROWS if record is None else record.room(len(self.edges.first)),
        )

    def _take_list(self, edges: Edges) -> None:
        """Use a list from here on: the places it was made at, and the arrays as loops take them."""
        self.edges = edges
        self._origin = self.bodies.position.copy()
        self._views = (flat(self.bodies), flat(edges), flat(self.walls), shifts(self.box).reshape(-1))

    def _listed(self) -> Edges:
        return list_edges(self.bodies, self.walls, self._reach_ratio, self.skin, self.box, self.collisions is not None)

    def _relist(self) -> None:
        """Find the pairs anew; what they remember and the forces at hand are carried over."""
        wrap(self.bodies.position, self.box)
        order = np.arange(self.bodies.count, dtype=np.int32)
        fresh = self._listed()
        remember(self.edges, fresh, order, order)
        self._take_list(fresh)

    def _lost_number(self) -> str:
        row = int(np.argmax(np.isnan(self.bodies.position).any(axis=1)))
        return (
            f"particle {self.bodies.id[row]} has no position any more at t = {self.time:.6g} s; "
            "the step is too large or a force is no number"
        )
