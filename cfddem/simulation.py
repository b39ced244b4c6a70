"""A run: the one place where particles, walls and laws are put together and moved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cfddem.errors import RunFailed
from cfddem.particles.encounters import ENCOUNTER
from cfddem.particles.forces import Laws
from cfddem.particles.motion import march
from cfddem.particles.neighbours import list_edges
from cfddem.particles.pairs import Edges, gaps, remember
from cfddem.particles.state import Bodies
from cfddem.particles.walls import Plane, walls
from cfddem.record.collisions import CollisionRecord

_NO_ROWS = np.zeros(0, ENCOUNTER)


class Simulation:
    """Particles in time.

    bodies   the particles, :func:`cfddem.particles.state.bodies`
    table    pair table, :func:`cfddem.materials.pair_table`
    planes   walls
    laws     which laws hold between two bodies
    gravity  [m/s2]
    free     1 along axes in which positions may change, 0 where they are held
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
        skin: float | None = None,
        record: bool = False,
    ) -> None:
        self.bodies = bodies
        self.table = table
        self.walls = walls(planes)
        self.laws = laws or Laws()
        self.gravity, self.free = gravity, free
        self.skin = 0.25 * float(bodies.radius.max()) if skin is None else skin
        self.time, self.steps = 0.0, 0
        self.collisions = CollisionRecord() if record else None
        self.edges = self._listed()
        self._origin = bodies.position.copy()
        self.refresh()

    @property
    def _reach_ratio(self) -> float:
        return self.laws.cutoff_ratio if self.laws.film else 0.0

    @property
    def gap(self) -> np.ndarray:
        """Gap of every listed pair [m]."""
        return gaps(self.edges, self.bodies, self.walls)

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
        return march(
            self.bodies,
            self.edges,
            self.walls,
            self.table,
            self.laws,
            self.free,
            self.gravity,
            step,
            steps,
            self._origin,
            0.5 * self.skin,
            self.time,
            _NO_ROWS if self.collisions is None else self.collisions.room(len(self.edges.first)),
        )

    def _listed(self) -> Edges:
        return list_edges(self.bodies, self.walls, self._reach_ratio, self.skin, self.collisions is not None)

    def _relist(self) -> None:
        fresh = self._listed()
        remember(self.edges, fresh, self.bodies)
        self.edges = fresh
        self._origin = self.bodies.position.copy()
        self.refresh()

    def _lost_number(self) -> str:
        row = int(np.argmax(np.isnan(self.bodies.position).any(axis=1)))
        return (
            f"particle {self.bodies.id[row]} has no position any more at t = {self.time:.6g} s; "
            "the step is too large or a force is no number"
        )
