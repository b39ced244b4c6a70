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

from typing import TYPE_CHECKING, Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.backend.law_set import specialise
from cfddem.data.fields import Field
from cfddem.particles.energy_of_bridges import RESISTANCE, BridgeEnergies
from cfddem.particles.energy_of_contacts import (
    BY_IMPULSES,
    BY_SHEAR,
    CHANNELS,
    WALLS,
    count_motion,
    count_work,
    room_for_count,
)
from cfddem.particles.energy_of_shear import CHANNELS as OF_SHEAR
from cfddem.particles.energy_of_shear import ShearEnergies
from cfddem.particles.impulse_motion import keep_motion
from cfddem.particles.state import added_mass_energy, kinetic_energy
from cfddem.particles.vectors import flat

if TYPE_CHECKING:
    from cfddem.particles.solver import ParticleSolver

DISPLACEMENT = Field("displacement", "m", 3, "scratch", meaning="displacement in the last advance")
WORK_DISPLACEMENT = Field(
    "work_displacement", "m", 3, "scratch", meaning="displacement whose product with a force is its work"
)


class Energies:
    """The energy account of a particle solver.

    channels  names of the channels: `CHANNELS`, and those of bridges and of films that resist sliding, if any
    totals    energy of each channel since the count began [J]

    Fields of the particles, set in every `advance`: `displacement` (N, 3) [m], and `work_displacement`, whose product
    with a constant force is its work; they differ by the impulses of films.
    """

    def __init__(self, solver: ParticleSolver) -> None:
        laws = solver.laws
        if laws.contact_law.energy is None:
            name = laws.contact_law.name
            raise InputError("energies", None, "a contact law that gives its energy", f"the law {name!r} does not")
        if laws.film and laws.integrator != "drift":
            raise InputError("energies", None, 'films with integrator "drift"', "work of explicit films is not counted")
        self._work, self._motion = specialise(count_work, solver.choices), specialise(count_motion, solver.choices)
        self._bridges = None if laws.bridge is None else BridgeEnergies(solver)
        self._shear = ShearEnergies(solver) if laws.shears else None
        self.channels = CHANNELS if self._bridges is None else (*CHANNELS, *self._bridges.channels)
        self.channels = (*self.channels, *OF_SHEAR) if laws.shears else self.channels
        self.totals = np.zeros(len(self.channels))
        self.fed = 0.0  # energy of inserted particles less that of removed ones [J]
        for field in (DISPLACEMENT, WORK_DISPLACEMENT):
            solver.particles.declare(field)
        self._edges: Any = None
        self._count: Any = None

    def before(self, solver: ParticleSolver, step: float, first: bool) -> None:
        """Count before a step [s]; `first` of an advance, in which the present forces begin to act."""
        if first:
            solver.particles.reset(DISPLACEMENT.name, WORK_DISPLACEMENT.name)
        if first or self._edges is not solver.edges:
            if self._edges is not solver.edges:
                self._make_room(solver)
            self._pass(solver, 0.0, 0.0, 0.5 * step if first else 0.0)
            if self._bridges is not None and not first:
                self._bridges.count(solver, 0.0, 0.0, 0.5 * step)  # a new list forgets the half kick that follows
        particles = solver.particles
        ahead = particles.velocity + (0.5 * step * particles.inverse_mass)[:, None] * particles.force
        keep_motion(self._count, particles, step, ahead)
        if self._bridges is not None:
            self._bridges.before(solver, step, ahead)
        if self._shear is not None:
            self._shear.before(solver, step, ahead)

    def after(self, solver: ParticleSolver, step: float, last: bool) -> None:
        """Count after a step [s]; `last` of an advance."""
        self._pass(solver, step, 0.5 * step, 0.0 if last else 0.5 * step)

    def springs(self, solver: ParticleSolver) -> tuple[float, float]:
        """Energy of the normal and of the tangential springs [J]."""
        self._renew(solver)
        count, total, mine = self._count, solver.communicator.sum, solver.edges.first < solver.particles.owned
        return total(count.held[mine]), 0.5 * total((count.stiffness * count.spring)[mine])

    def bridges(self, solver: ParticleSolver) -> float:
        """Energy of the pull of liquid bridges, from contact [J]."""
        if self._bridges is None:
            return 0.0
        self._renew(solver)
        return self._bridges.held(solver)

    def mechanical(self, solver: ParticleSolver) -> float:
        """Kinetic energy, and that of springs and bridges [J]."""
        stored = sum(self.springs(solver)) + self.bridges(solver)
        return kinetic_energy(solver.particles, solver.communicator) + stored

    def of_all(self, solver: ParticleSolver) -> float:
        """Energy that particles bring and take along: mechanical energy, and that of their added mass [J]."""
        return self.mechanical(solver) + added_mass_energy(solver.particles, solver.communicator)

    def checkpoint(self) -> dict[str, Any]:
        """What has been counted."""
        return {"totals": self.totals.copy(), "fed": self.fed}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        self.totals, self.fed = np.array(state["totals"]), float(state["fed"])
        self._edges = None

    def _renew(self, solver: ParticleSolver) -> None:
        """Evaluate stored energy where the neighbour list is new."""
        if self._edges is not solver.edges:
            self._make_room(solver)
            self._pass(solver, 0.0, 0.0, 0.0)

    def _make_room(self, solver: ParticleSolver) -> None:
        """Begin with another neighbour list."""
        self._edges, self._count = solver.edges, room_for_count(solver)
        if self._bridges is not None:
            self._bridges.make_room(solver)
        if self._shear is not None:
            self._shear.make_room(solver)

    def _pass(self, solver: ParticleSolver, step: float, before: float, after: float) -> None:
        solver.lists.ghosts.refresh("work")
        count = flat(self._count._replace(totals=None))._replace(totals=self._count.totals)
        count.totals[:] = 0.0
        gravity, free = np.array(solver.gravity, float), np.array(solver.free, float)
        self._motion(solver.system.particles, count, gravity, free, step, before, after)
        self._work(solver.system, count, step, before, after)
        counted = solver.communicator.sum(count.totals[0], axis=0)
        self.totals[: len(CHANNELS)] += counted[: len(CHANNELS)]
        if self._bridges is not None:
            done, by_walls = self._bridges.count(solver, step, before, after)
            done[RESISTANCE] -= counted[BY_IMPULSES]
            self.totals[len(CHANNELS) :][: len(done)] += done
            self.totals[WALLS] += by_walls
        if self._shear is not None:
            lost, by_walls = self._shear.count(solver, step)
            self.totals[-1] += lost + counted[BY_SHEAR]
            self.totals[WALLS] += by_walls
        if before + after > 0.0:
            solver.particles.work_displacement += self._count.moved
        if step > 0.0:
            solver.particles.displacement += self._count.drifted
