"""Energy of liquid bridges: what their resistance takes, what their pull stores, and what forms and breaks with them.

The pull of a bridge stores the work of separating its bodies from contact. A bridge that forms at a gap brings this
energy along, and a bridge that breaks takes it away: both have a line of their own. Half kicks in which a new or an old
pull acts alone belong to these lines, so that the account closes to the accuracy of the time integration.

A pull in a stiff film gives particles energy in each kick that the impulse of the film takes again: more than passes at
the speed at which they drift. The line of the resistance is therefore what pull and resistance together take beyond
what the pull stores. The same holds for the springs of contacts (`energy_of_contacts.BY_IMPULSES`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cfddem.backend.compile import CHUNKS, inline, prange, serial, threaded
from cfddem.backend.law_set import specialise
from cfddem.particles.energy_of_contacts import BY_IMPULSES, EnergyAccount, note_bridge_loss
from cfddem.particles.impulse_motion import keep_motion, mean_motion
from cfddem.particles.interactions.bridge import bridge_state
from cfddem.particles.interactions.bridge_changes import of_same_wall
from cfddem.particles.interactions.bridge_solution import pull_energy
from cfddem.particles.interactions.kinematics import pair_mass_and_radius
from cfddem.particles.interactions.slots import BRIDGE_APART, BRIDGE_PULL
from cfddem.particles.pair_graph import geometry
from cfddem.particles.particle_feature import Engine
from cfddem.particles.vectors import at, dot, flat, minus, plus, times
from cfddem.particles.walls.nearest_point import SURFACE, touched

CHANNELS = ("bridge", "bridges_formed", "bridges_broken")
"""Energy lost to the resistance of bridges; energy gained where bridges form and lost where they break."""

DRIED = "bridges_dried"
"""Energy lost as bridges dry, of runs in which they do."""

RESISTANCE, FORMED, BROKEN, BY_WALLS = range(4)


class BridgeCount(NamedTuple):
    """State of the count between two steps, as compiled loops take it."""

    ahead: np.ndarray  # (N, 3) velocity after the first half kick of the step [m/s]
    spin_ahead: np.ndarray  # (N, 3) likewise [rad/s]
    held: np.ndarray  # (n,) energy of the pull of each bridge [J]
    pulled: np.ndarray  # (n,) work of the pull in the half kick after the last count [J]
    totals: np.ndarray  # (2, CHUNKS, 4); the second half is of pairs that another rank adds [J]


class BridgeEnergies(EnergyAccount):
    """The energy account of the bridges of a particle engine.

    channels  `CHANNELS`, and `DRIED` where bridges dry, which is counted as they do
    """

    channels: tuple[str, ...] = CHANNELS

    def __init__(self, engine: Engine) -> None:
        if engine.choices["DRYING"]:
            self.channels = (*CHANNELS, DRIED)
        self._loop = specialise(_count_bridges, engine.choices)
        self.make_room(engine)

    def make_room(self, engine: Engine) -> None:
        """Begin with another neighbour list."""
        ahead, spin_ahead = np.zeros((2, engine.particles.count, 3))
        held, pulled = np.zeros((2, len(engine.edges.first)))
        self._state = BridgeCount(ahead, spin_ahead, held, pulled, np.zeros((2, CHUNKS, 4)))

    def before(self, engine: Engine, step: float, ahead: np.ndarray) -> None:
        """Before a step [s]; `ahead`, the velocity after the first half kick (N, 3) [m/s]."""
        keep_motion(self._state, engine.particles, step, ahead)

    def renewed(self, engine: Engine, kick: float) -> None:
        """Note the work of pulls in the half kick that follows; it is counted already."""
        self._sums(engine, 0.0, 0.0, kick)

    def count(
        self, engine: Engine, step: float, before: float, after: float, contacts: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Count at this instant."""
        done = self._sums(engine, step, before, after)
        done[RESISTANCE] -= contacts[BY_IMPULSES]
        counted = np.zeros(len(self.channels))
        counted[:BY_WALLS] = done[:BY_WALLS]
        return counted, float(done[BY_WALLS])

    def _sums(self, engine: Engine, step: float, before: float, after: float) -> np.ndarray:
        state = flat(self._state._replace(totals=None))._replace(totals=self._state.totals)  # type: ignore[arg-type]
        state.totals[:] = 0.0
        if step > 0.0 and len(engine.walls.kind) > 0:
            _follow_bridges(engine.system, state)
        self._loop(engine.system, state, step, before, after)
        return engine.communicator.sum(state.totals[0], axis=0)  # type: ignore[no-any-return]

    def stored(self, engine: Engine) -> dict[str, float]:
        """Energy of the pull of all bridges, from contact [J]."""
        held = self._state.held[engine.edges.first < engine.particles.owned]
        return {"bridges": float(engine.communicator.sum(held))}


@serial
def _follow_bridges(system, count):
    """Move what is held for a bridge at a wall to the piece of the wall to which the bridge has passed."""
    edges, memory, walls = system.edges, system.memory, system.walls
    begin, number = edges.between_particles, len(edges.first)
    while begin < number:
        end, left, taken = begin, -1, -1
        while end < number and of_same_wall(begin, end, edges, walls):
            if memory.bridge_film[end] > 0.0 or memory.bridge_change[end] < 0:
                taken = end
            elif count.held[end] != 0.0:
                left = end
            end += 1
        if left >= 0 and taken >= 0:
            count.held[taken], count.pulled[taken] = count.held[left], count.pulled[left]
            count.held[left], count.pulled[left] = 0.0, 0.0
        begin = end


@inline
def _half_motion(i, particles, kick, sign):
    """Motion of particle i in a half kick (sign 1: after this instant, -1: before it)."""
    gain = times(0.5 * sign * kick * particles.inverse_mass[i], at(particles.force, i))
    return times(kick, plus(at(particles.velocity, i), gain))


@inline
def _half_turn(i, particles, kick, sign):
    """The same of its spin."""
    gain = times(0.5 * sign * kick * particles.inverse_inertia[i], at(particles.torque, i))
    return times(kick, plus(at(particles.spin, i), gain))


@inline
def _pulled(k, system, kick, sign):
    """Work of the force of the bridge of edge k in a half kick, and the part of it that a wall does."""
    particles, edges, memory = system.particles, system.edges, system.memory
    i, j = edges.first[k], edges.second[k]
    moved, force = _half_motion(i, particles, kick, sign), at(memory.bridge_force, k)
    if k < edges.between_particles:
        work = dot(force, minus(moved, _half_motion(j, particles, kick, sign)))
        if BRIDGE_APART:
            turned = times(particles.radius[i], _half_turn(i, particles, kick, sign))
            turned = plus(turned, times(particles.radius[j], _half_turn(j, particles, kick, sign)))
            work += dot(at(memory.bridge_turn, k), turned)
        return work, 0.0
    by_wall = dot(force, times(kick, touched(edges, k, SURFACE)))
    return dot(force, moved) - by_wall, by_wall


@inline
def _resisted(k, system, count, step):
    """Energy that the resistance of edge k has taken in the step, and that a moving wall has put in through it."""
    particles, edges, memory = system.particles, system.edges, system.memory
    i, j = edges.first[k], edges.second[k]
    impulse, couple = at(memory.bridge_impulse, k), at(memory.bridge_couple, k)
    velocity, spin = mean_motion(i, particles, count, step)
    turned = particles.radius[i] * dot(couple, spin)
    if k < edges.between_particles:
        other, spin = mean_motion(j, particles, count, step)
        turned += particles.radius[j] * dot(couple, spin)
        return -dot(impulse, minus(velocity, other)) - turned, 0.0
    surface = touched(edges, k, SURFACE)
    return -dot(impulse, minus(velocity, surface)) - turned, dot(impulse, surface)


@inline
def _count_bridge(k, system, count, step, before, after, totals):
    """Count the bridge of edge k at this instant."""
    memory, p = system.memory, system.parameters
    bridged, change = memory.bridge_film[k] > 0.0, memory.bridge_change[k] if step > 0.0 else 0
    if step > 0.0 and ((bridged and change <= 0) or change < 0):
        lost, by_wall = _resisted(k, system, count, step)
        totals[RESISTANCE] += lost
        totals[BY_WALLS] += by_wall
        note_bridge_loss(k, memory, lost)
    if change < 0:
        totals[BROKEN] += count.held[k] - count.pulled[k]
    held, pulled = count.held[k], count.pulled[k]
    count.held[k] = 0.0
    count.pulled[k] = 0.0
    if not (BRIDGE_PULL or BRIDGE_APART) or not bridged:
        return
    if BRIDGE_PULL:
        _, _, gap = geometry(k, system)
        reduced_radius, _ = pair_mass_and_radius(k, system)
        count.held[k] = pull_energy(bridge_state(k, gap, reduced_radius, memory, p))
    work, by_wall = _pulled(k, system, before, -1.0)
    totals[BY_WALLS] += by_wall
    if change > 0:
        totals[FORMED] += count.held[k] + work
    elif step > 0.0 and (BRIDGE_APART or held != 0.0) and memory.bridge_resistance[k] > 0.0:
        surplus = pulled + work + count.held[k] - held
        totals[RESISTANCE] -= surplus
        note_bridge_loss(k, memory, -surplus)
    count.pulled[k], by_wall = _pulled(k, system, after, 1.0)
    totals[BY_WALLS] += by_wall


@threaded
def _count_bridges(system, count, step, before, after):
    """See `BridgeEnergies.count`."""
    particles, edges = system.particles, system.edges
    number = len(edges.first)
    for chunk in prange(CHUNKS):
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            totals = count.totals[0 if edges.first[k] < particles.owned else 1, chunk]
            _count_bridge(k, system, count, step, before, after, totals)
