"""Energy of the particles by channel: energy stored in springs, and work of every force since the count began.

A force at an instant acts over the half kick before it and the half kick after it. The mean velocity of a half kick is
known, so the work of the force equals the gain of kinetic energy to round-off, and so does the work of a film's
impulse. Energy stored in springs follows from the positions. Both agree to the accuracy of the time integration.

Of several ranks, both owners of a pair keep its count; the owner of the first body adds it to the totals.

Stored energies, stiffnesses and elastic forces are those of the run's contact law. They are evaluated again here and
not stored by the pair loop: the mean velocity of a half kick is known only after all forces on a particle are summed,
and runs that count no energy pay nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cfddem.backend.compile import CHUNKS, prange, threaded
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import Slot, specialise
from cfddem.model.fields import Field
from cfddem.particles.energy_of_bridges import BONDS, BRIDGES, DRYING_BRIDGES
from cfddem.particles.energy_of_contacts import (
    CHANNELS,
    SHEARED_FILMS,
    WALLS,
    Count,
    EnergyAccount,
    Tally,
    allocate_tally,
    count_motion,
    count_work,
    keep_motion,
)
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.particle_feature import Engine, ParticleFeature
from cfddem.particles.state import added_mass_energy, kinetic_energy
from cfddem.particles.vectors import flat

DISPLACEMENT = Field("displacement", "m", 3, "scratch", meaning="displacement in the last advance")
WORK_DISPLACEMENT = Field(
    "work_displacement", "m", 3, "scratch", meaning="displacement whose product with a force is its work"
)


EVERY_CHANNEL = (*CHANNELS, *DRYING_BRIDGES.channels, *BONDS.channels, *SHEARED_FILMS.channels)
"""Channels of a run that has everything."""

count_edge = Slot("count_edge")


@threaded
def _count_edges(system, tally, number, step, before, after):
    """Count the first `number` edges of an account, see :class:`EnergyAccount`."""
    particles, edges = system.particles, system.edges
    for chunk in prange(CHUNKS):
        for k in range(chunk * number // CHUNKS, (chunk + 1) * number // CHUNKS):
            totals = tally.totals[0 if edges.first[k] < particles.owned else 1, chunk]
            count_edge(k, system, tally, step, before, after, totals)


class _Counter:
    """Counts one account of a particle engine."""

    def __init__(self, account: EnergyAccount, engine: Engine) -> None:
        self.account = account
        self._loop = specialise(_count_edges, {**engine.choices, "count_edge": account.count_edge})

    def make_room(self, engine: Engine, contacts: Count) -> None:
        """Begin with another neighbour list; `contacts` keeps what impulses act on."""
        stored, pulled = np.zeros((2, len(engine.edges.first)))
        totals = np.zeros((2, CHUNKS, len(self.account.channels) + 1))
        self._tally = Tally(contacts.ahead, contacts.spin_ahead, stored, pulled, totals)

    def count(self, engine: Engine, step: float, before: float, after: float) -> np.ndarray:
        """Energy of each channel, and what moving walls have put in [J]; step and half kicks as in `EnergyAccount`."""
        tally = _flat_but_totals(self._tally)
        tally.totals[:] = 0.0
        if self.account.at_walls and step > 0.0 and len(engine.walls.kind) > 0:
            self.account.at_walls(engine.system, tally)
        edges = engine.edges
        number = edges.between_particles if self.account.pairs_only else len(edges.first)
        self._loop(engine.system, tally, number, step, before, after)
        return engine.communicator.sum(tally.totals[0], axis=0)  # type: ignore[no-any-return]

    def stored(self, engine: Engine) -> dict[str, float]:
        """Energy that all edges store, by its form [J]."""
        stored = self._tally.stored[engine.edges.first < engine.particles.owned]
        return {self.account.form: float(engine.communicator.sum(stored))} if self.account.form else {}


def _flat_but_totals(count: Any) -> Any:
    """A count as compiled loops take it."""
    return flat(count._replace(totals=None))._replace(totals=count.totals)


class Energies(ParticleFeature):
    """The energy account of a particle engine.

    channels  names of the channels: `CHANNELS`, and those of bridges and of films that resist sliding, if any
    totals    energy of each channel since the count began [J]

    Fields of the particles, set in every `advance`: `displacement` (N, 3) [m], and `work_displacement`, whose product
    with a constant force is its work; they differ by the impulses of films.
    """

    name, every_step = "energies", True

    @staticmethod
    def check(laws: Laws) -> None:
        """Refuse laws whose work is not counted; asked before their loops are compiled."""
        if laws.contact_law.energy is None:
            name = laws.contact_law.name
            raise InputError("energies", None, "a contact law that gives its energy", f"the law {name!r} does not")
        if laws.film and laws.integrator != "drift":
            raise InputError("energies", None, 'films with integrator "drift"', "work of explicit films is not counted")

    def __init__(self, engine: Engine) -> None:
        laws = engine.laws
        self._work, self._motion = specialise(count_work, engine.choices), specialise(count_motion, engine.choices)
        choices = engine.choices
        bridges = DRYING_BRIDGES if choices["DRYING"] else BRIDGES
        present = {bridges: choices["BRIDGE"], BONDS: choices["BOND"], SHEARED_FILMS: laws.shears}
        self._counters = [_Counter(account, engine) for account, counted in present.items() if counted]
        self.channels = (*CHANNELS, *(name for counter in self._counters for name in counter.account.channels))
        self.totals = np.zeros(len(self.channels))
        self.fed, self._had = 0.0, 0.0  # energy of inserted particles less that of removed ones; before an exchange [J]
        for field in (DISPLACEMENT, WORK_DISPLACEMENT):
            engine.particles.declare(field)
        self._edges: Any = None
        self._count: Any = None

    def before(self, engine: Engine, step: float, first: bool) -> None:
        """Count before a step [s]; `first` of an advance, in which the present forces begin to act."""
        if first:
            engine.particles.reset(DISPLACEMENT.name, WORK_DISPLACEMENT.name)
        if first or self._edges is not engine.edges:
            if self._edges is not engine.edges:
                self._make_room(engine)
            self._pass(engine, 0.0, 0.0, 0.5 * step if first else 0.0)
            for counter in () if first else self._counters:
                counter.count(engine, 0.0, 0.0, 0.5 * step)  # the half kick that follows is in the totals already
        particles = engine.particles
        ahead = particles.velocity + (0.5 * step * particles.inverse_mass)[:, None] * particles.force
        keep_motion(self._count, particles, step, ahead)

    def after(self, engine: Engine, step: float, last: bool, ended: int) -> None:
        """Count after a step [s]; `last` of an advance."""
        self._pass(engine, step, 0.5 * step, 0.0 if last else 0.5 * step)

    def add(self, channel: str, energy: float) -> None:
        """Add what something outside of the steps has taken from a channel [J]."""
        self.totals[self.channels.index(channel)] += energy

    def before_exchange(self, engine: Engine) -> None:
        """Note the energy of the particles that are there."""
        self._had = self.of_all(engine)

    def after_exchange(self, engine: Engine) -> None:
        """Count what others have brought or taken along."""
        self.fed += self.of_all(engine) - self._had

    def stored(self, engine: Engine) -> dict[str, float]:
        """Energy of normal and tangential springs, and what else stores energy, such as `bridges`, by its form [J]."""
        self._renew(engine)
        count, total, mine = self._count, engine.communicator.sum, engine.edges.first < engine.particles.owned
        forms = {
            "normal_springs": total(count.spring_energy[mine]),
            "tangential_springs": 0.5 * total((count.stiffness * count.spring)[mine]),
        }
        for counter in self._counters:
            forms |= counter.stored(engine)
        return forms

    def springs(self, engine: Engine) -> tuple[float, float]:
        """Energy of the normal and of the tangential springs [J]."""
        forms = self.stored(engine)
        return forms["normal_springs"], forms["tangential_springs"]

    def mechanical(self, engine: Engine) -> float:
        """Kinetic energy, and that of springs and bridges [J]."""
        return kinetic_energy(engine.particles, engine.communicator) + sum(self.stored(engine).values())

    def of_all(self, engine: Engine) -> float:
        """Energy that particles bring and take along: mechanical energy, and that of their added mass [J]."""
        return self.mechanical(engine) + added_mass_energy(engine.particles, engine.communicator)

    def checkpoint(self) -> dict[str, Any]:
        """What has been counted."""
        return {"totals": self.totals.copy(), "fed": self.fed}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.totals, self.fed = np.array(state["totals"]), float(state["fed"])
        self._edges = None

    def _renew(self, engine: Engine) -> None:
        """Evaluate stored energy where the neighbour list is new."""
        if self._edges is not engine.edges:
            self._make_room(engine)
            self._pass(engine, 0.0, 0.0, 0.0)

    def _make_room(self, engine: Engine) -> None:
        """Begin with another neighbour list."""
        self._edges, self._count = engine.edges, allocate_tally(engine)
        for counter in self._counters:
            counter.make_room(engine, self._count)

    def _pass(self, engine: Engine, step: float, before: float, after: float) -> None:
        engine.lists.ghosts.refresh("work")
        count = _flat_but_totals(self._count)
        count.totals[:] = 0.0
        gravity, free = np.array(engine.gravity, float), np.array(engine.free, float)
        self._motion(engine.system.particles, count, gravity, free, step, before, after)
        self._work(engine.system, count, step, before, after)
        counted = engine.communicator.sum(count.totals[0], axis=0)
        self.totals[: len(CHANNELS)] += counted[: len(CHANNELS)]
        place = len(CHANNELS)
        for counter in self._counters:
            *done, by_walls = counter.count(engine, step, before, after)
            if counter.account.begun is not None:
                done[0] += counted[counter.account.begun]
            self.totals[place : place + len(done)] += done
            self.totals[WALLS] += by_walls
            place += len(done)
        if before + after > 0.0:
            engine.particles.work_displacement += self._count.moved
        if step > 0.0:
            engine.particles.displacement += self._count.drifted
