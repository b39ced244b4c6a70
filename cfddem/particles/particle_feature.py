"""What a particle solver may have beside contacts and films: bridges, recorded collisions, energies; one object each.

The solver goes over a list of them and names none. Every method does nothing unless a feature says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.model.feature import Feature
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.listing import NeighbourLists
from cfddem.particles.pair_graph import Edges
from cfddem.particles.state import Particles
from cfddem.particles.system import System
from cfddem.particles.walls.nearest_point import Walls


class Engine(Protocol):
    """What a feature sees of its particle solver.

    choices  what the run puts into the slots of the loops
    gap      of every listed pair (n,) [m]
    """

    particles: Particles
    edges: Edges
    walls: Walls
    system: System
    laws: Laws
    lists: NeighbourLists
    communicator: Communicator
    choices: Mapping[str, Any]
    gravity: tuple[float, float, float]
    free: tuple[float, float, float]

    @property
    def gap(self) -> np.ndarray: ...


class ParticleFeature(Feature):
    """A part of a particle solver.

    every_step  whether it acts in every step, so that the loop makes one step at a time
    """

    every_step: bool = False

    def reach_ratio(self, engine: Engine, after: Particles | None) -> float:
        """Reach that the next neighbour list must have, over R* [-]; `after` a change to these particles."""
        return 0.0

    def outgrows(self, engine: Engine, reach: float) -> bool:
        """Whether the neighbour list, of this reach over R*, is too short by now."""
        return False

    def with_room(self, walls: Walls, edges: Edges) -> Walls:
        """The walls with the room that a new list needs."""
        return walls

    def before(self, engine: Engine, step: float, first: bool) -> None:
        """Act before a step [s]; `first` of an advance, in which the present forces begin to act."""

    def after(self, engine: Engine, step: float, last: bool, ended: int) -> None:
        """Act after a step [s], `last` of an advance; `ended`: number of collisions that the loop has recorded."""

    def inserted(self, engine: Engine, joined: Particles, rows: np.ndarray) -> None:
        """Count inserted particles: some rows of all that are there now."""

    def removing(self, engine: Engine, gone: np.ndarray) -> None:
        """Prepare the particles that will be removed, rows (N,) bool."""

    def before_exchange(self, engine: Engine) -> None:
        """Act before particles are replaced by others, with a new list."""

    def after_exchange(self, engine: Engine) -> None:
        """Act after particles were replaced by others."""
