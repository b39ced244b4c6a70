"""Energy of solid bonds: what their springs hold, what their dashpots take, and what is lost where they break.

Bonds form without stress. A bond that breaks takes along what its springs hold; the half kick in which they acted
last belongs to this line.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, prange, threaded
from cfddem.backend.law_set import specialise
from cfddem.particles.energy_of_contacts import EnergyAccount
from cfddem.particles.interactions.bond import bond_loads
from cfddem.particles.particle_feature import Engine
from cfddem.particles.vectors import at, dot, flat, minus, plus, times

CHANNELS = ("bond_damping", "bonds_broken")
"""Energy lost to the dashpots of bonds, and where bonds break."""

DAMPING, BROKEN = range(2)


class BondCount(NamedTuple):
    """State of the count between two steps, as compiled loops take it."""

    held: np.ndarray  # (n,) energy of the springs of each bond [J]
    pulled: np.ndarray  # (n,) work of the springs in the half kick after the last count [J]
    totals: np.ndarray  # (2, CHUNKS, 2); the second half is of pairs that another rank adds [J]


class BondEnergies(EnergyAccount):
    """The energy account of the bonds of a particle engine."""

    channels = CHANNELS

    def __init__(self, engine: Engine) -> None:
        self._loop = specialise(_count_bonds, engine.choices)
        self.make_room(engine)

    def make_room(self, engine: Engine) -> None:
        """Begin with another neighbour list."""
        held, pulled = np.zeros((2, len(engine.edges.first)))
        self._state = BondCount(held, pulled, np.zeros((2, CHUNKS, 2)))

    def renewed(self, engine: Engine, kick: float) -> None:
        """Note the work of springs in the half kick that follows; it is counted already."""
        self._sums(engine, 0.0, 0.0, kick)

    def count(
        self, engine: Engine, step: float, before: float, after: float, contacts: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Count at this instant."""
        return self._sums(engine, step, before, after), 0.0

    def _sums(self, engine: Engine, step: float, before: float, after: float) -> np.ndarray:
        self._state.totals[:] = 0.0
        state = flat(self._state._replace(totals=None))._replace(totals=self._state.totals)  # type: ignore[arg-type]
        self._loop(engine.system, state, step, before, after)
        return np.asarray(engine.communicator.sum(self._state.totals[0], axis=0))

    def stored(self, engine: Engine) -> dict[str, float]:
        """Energy of the springs of all bonds [J]."""
        held = self._state.held[engine.edges.first < engine.particles.owned]
        return {"bonds": float(engine.communicator.sum(held))}


@inline
def _moved(i, particles, kick, sign):
    """Distance and angle of particle i in a half kick (sign 1: after this instant, -1: before it)."""
    half = 0.5 * sign * kick
    velocity = plus(at(particles.velocity, i), times(half * particles.inverse_mass[i], at(particles.force, i)))
    spin = plus(at(particles.spin, i), times(half * particles.inverse_inertia[i], at(particles.torque, i)))
    return times(kick, velocity), times(kick, spin)


@inline
def _work(k, system, loads, kick, sign):
    """Work of a force, a couple and a moment of edge k in a half kick."""
    particles, edges = system.particles, system.edges
    i, j = edges.first[k], edges.second[k]
    moved, turned = _moved(i, particles, kick, sign)
    other, about = _moved(j, particles, kick, sign)
    rolled = plus(times(particles.radius[i], turned), times(particles.radius[j], about))
    force, couple, moment = loads
    return dot(force, minus(moved, other)) + dot(couple, rolled) + dot(moment, minus(turned, about))


@inline
def _count_bond(k, system, count, step, kicks, totals):
    """Count the bond of edge k at this instant; `kicks`: half kicks before and after it."""
    memory = system.memory
    before, after = kicks
    if memory.bond_radius[k] == 0.0:
        totals[BROKEN] += count.held[k] - count.pulled[k] if step > 0.0 else 0.0
        count.held[k] = 0.0
        count.pulled[k] = 0.0
        return
    force, couple, moment, energy = bond_loads(k, system)
    whole = at(memory.bond_force, k), at(memory.bond_couple, k), at(memory.bond_moment, k)
    damping = minus(whole[0], force), minus(whole[1], couple), minus(whole[2], moment)
    totals[DAMPING] -= _work(k, system, damping, before, -1.0) + _work(k, system, damping, after, 1.0)
    count.held[k] = energy
    count.pulled[k] = _work(k, system, whole, after, 1.0)


@threaded
def _count_bonds(system, count, step, before, after):
    """See `BondEnergies.count`."""
    particles, edges = system.particles, system.edges
    number = edges.between_particles
    for chunk in prange(CHUNKS):
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            totals = count.totals[0 if edges.first[k] < particles.owned else 1, chunk]
            _count_bond(k, system, count, step, (before, after), totals)
