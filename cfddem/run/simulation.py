"""A case in time: particles, fluid and their coupling, advanced step by step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from cfddem.backend import html
from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.memory import keep_freed_memory
from cfddem.case.schema import Case
from cfddem.data.fields import Field
from cfddem.particles.state import Particles, particles_in
from cfddem.particles.zone_times import FIELDS as ZONE_FIELDS
from cfddem.particles.zone_times import note_visits
from cfddem.run.budgets.energy import EnergyLedger
from cfddem.run.budgets.liquid import LiquidBudget
from cfddem.run.build import parts_of, spray_of
from cfddem.run.equipment import Equipment
from cfddem.run.time_steps import TimeSteps
from cfddem.run.wet_state import SNAPSHOT_FIELDS, fill_snapshot_fields

Callback = Callable[["Simulation"], None]
"""Function that is called after every fluid step, with the simulation."""


def _fields_of(case: Case) -> list[Field]:
    """Fields of the particles that measures and snapshots of a case need."""
    return [*(SNAPSHOT_FIELDS if case.liquid is not None else ()), *(ZONE_FIELDS if case.spray is not None else ())]


class Simulation:
    """A case in time.

    case          the case
    progress      receives a line of text on what is being prepared
    fields        more fields of the particles, for example a temperature; sorted, inserted, removed and stored in
                  checkpoints with the others, and in snapshots if they ask for it
    callbacks     functions to call after every fluid step, in this order
    state         `checkpoint()` to continue from
    communicator  path to sums, extremes and decisions over all ranks
    """

    def __init__(
        self,
        case: Case,
        progress: Callable[[str], None] = lambda _: None,
        *,
        fields: Iterable[Field] = (),
        callbacks: Iterable[Callback] = (),
        state: dict[str, Any] | None = None,
        communicator: Communicator = SERIAL,
    ) -> None:
        keep_freed_memory()
        self.case, self.gravity, self.communicator = case, np.array(case.laws.gravity), communicator
        self.callbacks, fields = list(callbacks), [*fields, *_fields_of(case)]
        particles = None if state is None else particles_in(state["particles"]["particles"])
        parts = parts_of(case, progress, particles, communicator)
        self.particle_solver, self.fluid, self.exchange = parts.particle_solver, parts.fluid, parts.exchange
        self.wall = self.particle_solver.wall
        self.spray = spray_of(case, communicator)
        self.equipment = Equipment(case, self.particle_solver)
        self.liquid = None if case.liquid is None else LiquidBudget(self.particle_solver, self.spray)
        self.steps, self.last_step = 0, 0.0
        particle_step = None if state is None else self._restore(state, fields)
        for field in fields:
            self.particles.declare(field)
        self.energy = self._ledger(state)
        self.time_steps = TimeSteps(
            case, self.particle_solver, self.fluid, particle_step, communicator, self.equipment.motions.largest_step
        )

    @property
    def particles(self) -> Particles:
        """The particles."""
        return self.particle_solver.particles

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.particle_solver.time

    @property
    def limiting(self) -> str:
        """Criterion that limited the last fluid step."""
        return self.time_steps.limiting

    @property
    def owned(self) -> Particles:
        """The particles of this rank; `particles` has the ghosts of others too where several share a run."""
        return self.particles.without_ghosts()

    def whole(self, name: str) -> np.ndarray:
        """A field of the particles of all ranks, for measures that need every particle."""
        return self.communicator.joined(self.owned[name])

    def snapshot(self) -> dict[str, np.ndarray]:
        """The fields of the particles that a snapshot contains; those of all ranks on rank 0, no rows on the others."""
        if self.liquid is not None:
            fill_snapshot_fields(self.particle_solver)
        return {name: self.communicator.gathered(array) for name, array in self.owned.snapshot().items()}

    def step(self, until: float = math.inf) -> None:
        """Make one fluid step and the particle steps within it; some step ends exactly at `until` [s]."""
        part = self.wall.part
        with part("time steps"):
            step, substeps = self.time_steps.choose(until, self.steps)
        if self.fluid is not None and self.exchange is not None:
            owned = self.owned
            with part("voidage and drag"):
                terms = self.exchange.prepare(owned, step)
            with part("fluid"):
                self.fluid.step(step, *terms.fields)
            with part("forces of the fluid"):
                forces = self.exchange.apply(owned, terms, self.gravity)
            if self.energy is not None:
                with part("energies"):
                    self.energy.after_fluid_step(terms, forces)
        self.equipment.move_walls(self.particle_solver, step)
        self.particle_solver.advance(step / substeps, substeps)
        if self.spray is not None:
            with part("spray"):
                owned = self.owned
                self.spray(owned, self.time)
                note_visits(owned, self.spray.zone(owned.position), self.time)
        if self.energy is not None:
            with part("energies"):
                self.energy.after_particle_steps()
        if self.equipment.exchanges:
            with part("feeds and outlets"):
                self._exchange_particles()
        self.steps, self.last_step = self.steps + 1, step
        for callback in self.callbacks:
            with part(f"callback {getattr(callback, '__name__', 'without a name')}"):
                callback(self)

    def _exchange_particles(self) -> None:
        """Let particles enter and leave; each replaces fluid of its own volume, or leaves room for it."""
        before = self.owned
        moved = self.equipment.exchange_particles(self.particle_solver)
        if moved and self.fluid is not None and self.exchange is not None:
            self.fluid.add_voidage(self.exchange.solid_fraction(before) - self.exchange.solid_fraction(self.owned))

    def until(self, time: float) -> None:
        """Continue until a time [s]."""
        while self.time < time * (1.0 - 1e-12):
            self.step(time)

    def _repr_html_(self) -> str:
        """The state in a few numbers, and the particles, in a notebook."""
        rows = [
            ("time", f"{self.time:.4g} s of {self.case.run.until:g} s"),
            ("fluid steps", f"{self.steps}"),
            ("particles", f"{len(self.owned.position)}"),
            ("limit of the last step", self.limiting if self.steps else "-"),
        ]
        owned = self.owned
        drawing = html.spheres(owned.position, owned.radius, owned.velocity, self.case.column.size)
        return html.table(self.case.title or "Simulation", rows, drawing)

    # ------------------------------------------------------------ checkpoints

    def checkpoint(self) -> dict[str, Any]:
        """Everything that the next step depends on."""
        parts: dict[str, Any] = {
            "steps": self.steps,
            "particle_step": self.time_steps.particle_step,
            "particles": self.particle_solver.checkpoint(),
        }
        if self.fluid is not None and self.exchange is not None:
            parts |= {"fluid": self.fluid.checkpoint(), "exchange": self.exchange.checkpoint()}
        if self.energy is not None:
            parts |= {"energy": self.energy.checkpoint()}
        if self.liquid is not None:
            parts |= {"liquid": self.liquid.checkpoint()}
        if self.equipment.exchanges:
            parts |= {"equipment": self.equipment.checkpoint()}
        return parts

    @classmethod
    def restored(
        cls,
        case: Case,
        state: dict[str, Any],
        *,
        fields: Iterable[Field] = (),
        callbacks: Iterable[Callback] = (),
        communicator: Communicator = SERIAL,
    ) -> Simulation:
        """The simulation of a case as it was at a `checkpoint()`; it continues bit for bit."""
        return cls(case, fields=fields, callbacks=callbacks, state=state, communicator=communicator)

    def _restore(self, state: dict[str, Any], fields: list[Field]) -> float:
        """Take over a checkpoint; returns the particle step [s]."""
        for field in fields:
            if field.name in state["particles"]["particles"]:
                self.particles.declare(field)
        self.particle_solver.restore(state["particles"])
        if self.fluid is not None and self.exchange is not None:
            self.fluid.restore(state["fluid"])
            self.exchange.restore(state["exchange"])
        if self.liquid is not None:
            self.liquid.restore(state["liquid"])
        if self.equipment.exchanges:
            self.equipment.restore(state["equipment"])
        self.steps = int(state["steps"])
        return float(state["particle_step"])

    def _ledger(self, state: dict[str, Any] | None = None) -> EnergyLedger | None:
        """The energy ledger, where the case asks for one."""
        if not self.case.run.energy_budget:
            return None
        ledger = EnergyLedger(self.particle_solver, self.fluid, self.exchange, self.gravity)
        if state is not None:
            ledger.restore(state["energy"])
        return ledger
