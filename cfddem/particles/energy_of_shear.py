"""Energy lost to films that resist sliding, rolling and twisting.

The work of an impulse is its product with the mean of the motion before and after all impulses of the step. So the work
of all impulses adds up to the change of the kinetic energy to round-off.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, prange, threaded
from cfddem.backend.law_set import specialise
from cfddem.particles.energy_of_contacts import BY_SHEAR, FILMS, EnergyAccount, note_loss
from cfddem.particles.impulse_motion import keep_motion, mean_motion
from cfddem.particles.interactions.shear_film import impulses_of
from cfddem.particles.particle_feature import Engine
from cfddem.particles.vectors import at, dot, flat
from cfddem.particles.walls.nearest_point import SURFACE, touched

CHANNELS = ("film_shear",)
"""Energy lost to films that resist sliding, rolling and twisting."""


class ShearCount(NamedTuple):
    """State of the count between two steps, as compiled loops take it."""

    ahead: np.ndarray  # (N, 3) velocity after the first half kick of the step [m/s]
    spin_ahead: np.ndarray  # (N, 3) likewise [rad/s]
    totals: np.ndarray  # (2, CHUNKS, 2) lost, and put in by moving walls; second half: another rank adds it [J]


class ShearEnergies(EnergyAccount):
    """The energy account of films that resist sliding."""

    channels = CHANNELS

    def __init__(self, engine: Engine) -> None:
        self._loop = specialise(_count_shear, engine.choices)
        self.make_room(engine)

    def make_room(self, engine: Engine) -> None:
        """Begin with another neighbour list."""
        ahead, spin_ahead = np.zeros((2, engine.particles.count, 3))
        self._state = ShearCount(ahead, spin_ahead, np.zeros((2, CHUNKS, 2)))

    def before(self, engine: Engine, step: float, ahead: np.ndarray) -> None:
        """Before a step [s]; `ahead`, the velocity after the first half kick (N, 3) [m/s]."""
        keep_motion(self._state, engine.particles, step, ahead)

    def count(
        self, engine: Engine, step: float, before: float, after: float, contacts: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Count at this instant."""
        lost, by_walls = np.zeros(2)
        if step > 0.0:
            state = flat(self._state._replace(totals=None))._replace(totals=self._state.totals)  # type: ignore[arg-type]
            state.totals[:] = 0.0
            self._loop(engine.system, state, step)
            lost, by_walls = engine.communicator.sum(state.totals[0], axis=0)
        return np.array([lost + contacts[BY_SHEAR]]), float(by_walls)


@inline
def _shear_works(k, system, count, step):
    """Energy that the film of edge k has taken in the step, and that a moving wall has put in through it."""
    particles, edges, memory, walls = system.particles, system.edges, system.memory, system.walls
    i, j = edges.first[k], edges.second[k]
    impulse, first, second = impulses_of(k, memory.shear_impulse)
    velocity, spin = mean_motion(i, particles, count, step)
    gained = dot(impulse, velocity) + dot(first, spin)
    if k < edges.between_particles:
        velocity, spin = mean_motion(j, particles, count, step)
        gained += dot(second, spin) - dot(impulse, velocity)
        return -gained, 0.0
    by_wall = dot(impulse, touched(edges, k, SURFACE)) - dot(second, at(walls.spin, walls.wall[j]))
    return by_wall - gained, by_wall


@threaded
def _count_shear(system, count, step):
    """See `ShearEnergies.count`."""
    particles, edges, memory = system.particles, system.edges, system.memory
    number = len(edges.first)
    for chunk in prange(CHUNKS):
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            totals = count.totals[0 if edges.first[k] < particles.owned else 1, chunk]
            lost, by_wall = _shear_works(k, system, count, step)
            totals[0] += lost
            totals[1] += by_wall
            note_loss(k, memory, FILMS, lost)
