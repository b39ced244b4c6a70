"""A case in time: particles, fluid and their coupling, advanced step by step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from cfddem.backend import html
from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import InputError
from cfddem.backend.memory import keep_freed_memory
from cfddem.case.schema import Case
from cfddem.coupling.force_list import ForceList, require_features
from cfddem.coupling.terms import ForceTerms
from cfddem.data.fields import Field
from cfddem.model.feature import Equipment, Feature, FluidForce, Function, On, OwnForce
from cfddem.particles.state import Particles, particles_in
from cfddem.particles.zone_times import FIELDS as ZONE_FIELDS
from cfddem.particles.zone_times import note_visits
from cfddem.run.budgets.energy import EnergyLedger
from cfddem.run.budgets.liquid import LiquidBudget
from cfddem.run.build import parts_of, spray_of
from cfddem.run.equipment import CaseEquipment
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
    features      a user's forces and equipment, see `add`
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
        features: Iterable[Feature | Function] = (),
        state: dict[str, Any] | None = None,
        communicator: Communicator = SERIAL,
    ) -> None:
        keep_freed_memory()
        self.case, self.gravity, self.communicator = case, np.array(case.laws.gravity), communicator
        self.callbacks, fields = list(callbacks), [*fields, *_fields_of(case)]
        particles = None if state is None else particles_in(state["particles"]["particles"])
        parts = parts_of(case, progress, particles, communicator)
        self.particle_solver, self.fluid, self.coupling = parts.particle_solver, parts.fluid, parts.coupling
        self.wall = self.particle_solver.wall
        self.spray = spray_of(case, communicator)
        self.equipment = CaseEquipment(case, self.particle_solver)
        self.liquid = None if case.liquid is None else LiquidBudget(self.particle_solver, self.spray)
        self.forces = ForceList(self.particles) if self.coupling is None else self.coupling.forces
        self.features: list[Equipment] = []
        for feature in features:
            self.add(feature)
        self.steps, self.last_step = 0, 0.0
        particle_step = None if state is None else self._restore(state, fields)
        for field in fields:
            self.particles.declare(field)
        self.energy = self._ledger(state)
        self.time_steps = TimeSteps(
            case, self.particle_solver, self.fluid, particle_step, communicator, self.equipment.motions.largest_step
        )

    def add(self, feature: Feature | Function, on: On = "particles") -> None:
        """Add a force or equipment of a user, like those of the case.

        feature  a `FluidForce`; an `Equipment`; or a function of the particles that returns the force on each of them,
                 (N, 3) or (3,) for all [N]
        on       where the force of a function acts: "particles", "fluid", or "both", which is equal and opposite
        """
        added = feature if isinstance(feature, Feature) else OwnForce(feature, on)
        if isinstance(added, FluidForce):
            if added.needs_fluid and self.fluid is None:
                remedy = 'add it on="particles", or give the case a [fluid]'
                raise InputError(f"force {added.name}", "on the fluid", "a force of a run with a fluid", remedy)
            self.forces.add(added, self.particles)
        elif isinstance(added, Equipment) and added.name not in {"", *(each.name for each in self.features)}:
            self.features.append(added)
            for field in added.fields:
                self.particles.declare(field)
        else:
            raise InputError("feature", added.name, "a FluidForce, or an Equipment, with a name of its own")

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
        if self.fluid is not None and self.coupling is not None:
            owned = self.owned
            with part("voidage and drag"):
                terms = self.coupling.prepare(owned, step)
            with part("fluid"):
                self.fluid.step(step, *terms.fields)
            with part("forces of the fluid"):
                self.coupling.apply(owned, terms)
            if self.energy is not None:
                with part("energies"):
                    self.energy.after_fluid_step(terms)
        else:
            alone = ForceTerms(self.owned, step, self.last_step)
            self.forces.act(alone)
            self.forces.finish(alone)
        for feature in self.features:
            with part(feature.name):
                feature.before(self, step)
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
        for feature in self.features:
            with part(feature.name):
                feature.after(self)
        for callback in self.callbacks:
            with part(f"callback {getattr(callback, '__name__', 'without a name')}"):
                callback(self)

    def _exchange_particles(self) -> None:
        """Let particles enter and leave; each replaces fluid of its own volume, or leaves room for it."""
        before = self.owned
        moved = self.equipment.exchange_particles(self.particle_solver)
        if moved and self.fluid is not None and self.coupling is not None:
            self.fluid.add_voidage(self.coupling.solid_fraction(before) - self.coupling.solid_fraction(self.owned))

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
        if self.fluid is not None and self.coupling is not None:
            parts |= {"fluid": self.fluid.checkpoint(), "coupling": self.coupling.checkpoint()}
        if forces := self.forces.checkpoint(self.communicator):
            parts |= {"forces": forces}
        if kept := {each.name: state for each in self.features if (state := each.checkpoint())}:
            parts |= {"features": kept}
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
        features: Iterable[Feature | Function] = (),
        communicator: Communicator = SERIAL,
    ) -> Simulation:
        """The simulation of a case as it was at a `checkpoint()`; it continues bit for bit."""
        return cls(case, fields=fields, callbacks=callbacks, features=features, state=state, communicator=communicator)

    def _restore(self, state: dict[str, Any], fields: list[Field]) -> float:
        """Take over a checkpoint; returns the particle step [s]."""
        for field in fields:
            if field.name in state["particles"]["particles"]:
                self.particles.declare(field)
        self.particle_solver.restore(state["particles"])
        if self.fluid is not None and self.coupling is not None:
            self.fluid.restore(state["fluid"])
            self.coupling.restore(state["coupling"])
        self.forces.restore(state.get("forces", {}), self.communicator)
        kept = state.get("features", {})
        require_features(kept, [each.name for each in self.features])
        for feature in self.features:
            if feature.name in kept:
                feature.restore(kept[feature.name])
        if self.liquid is not None:
            self.liquid.restore(state["liquid"])
        if self.equipment.exchanges:
            self.equipment.restore(state["equipment"])
        self.steps = int(state["steps"])
        return float(state["particle_step"])

    def _is_acted_on(self) -> bool:
        """Whether a user's function may put energy in."""
        return bool(self.callbacks or self.features) or "external" in self.forces.lines

    def _ledger(self, state: dict[str, Any] | None = None) -> EnergyLedger | None:
        """The energy ledger, where the case asks for one."""
        if not self.case.run.energy_budget:
            return None
        ledger = EnergyLedger(self.particle_solver, self.fluid, self.coupling, self._is_acted_on)
        if state is not None:
            ledger.restore(state["energy"])
        return ledger
