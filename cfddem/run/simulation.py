"""A case in time: particles, fluid and their coupling, advanced step by step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np

from cfddem.backend import html
from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import InputError
from cfddem.backend.launch import keep_freed_memory
from cfddem.backend.portions import Portions, rows_by_id
from cfddem.case.schema import Case, require_case
from cfddem.coupling.coupling import Coupling, Uncoupled
from cfddem.coupling.terms import ForceTerms, require_features
from cfddem.features.feature_list import FEATURES
from cfddem.fluid.solver import FluidSolver
from cfddem.model.feature import Equipment, Feature, FluidForce, Function, On, OwnForce
from cfddem.model.fields import Field
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles, particles_in
from cfddem.run.build import Parts, parts_of
from cfddem.run.time_steps import StepSettings, TimeSteps

Kind = TypeVar("Kind", bound=Equipment)

Part = TypeVar("Part")

Callback = Callable[["Simulation"], None]
"""Function that is called after every fluid step, with the simulation."""


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

    >>> from cfddem import gallery
    >>> simulation = Simulation(gallery()["liquid-bed"])    # doctest: +SKIP
    >>> simulation.until(0.01)                              # doctest: +SKIP
    >>> simulation.particles.position.mean(axis=0)          # doctest: +SKIP
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
        require_case(case)
        keep_freed_memory()
        particles = None if state is None else particles_in(_share(state["particles"]["particles"], communicator))
        parts = parts_of(case, progress, particles, communicator)
        settings = StepSettings(case.reference_speed, case.run.particle_step, case.run.fluid_step, case.fastest_inflow)
        self._begin(case, parts, settings, fields, callbacks, features, state)

    @classmethod
    def of(
        cls,
        particle_solver: ParticleSolver,
        coupling: Coupling | None = None,
        *,
        steps: StepSettings,
        fields: Iterable[Field] = (),
        callbacks: Iterable[Callback] = (),
        features: Iterable[Feature | Function] = (),
        state: dict[str, Any] | None = None,
    ) -> Simulation:
        """A simulation of solvers that a script has made, without a case.

        particle_solver  with gravity only where there is no fluid
        coupling         of its particles with a fluid; none for particles alone
        steps            what limits the time steps
        others           as for a simulation of a case
        """
        if coupling is not None and any(particle_solver.gravity):
            remedy = "a coupled particle has the force Weight(density of the fluid, gravity)"
            raise InputError("gravity", tuple(particle_solver.gravity), "0 in a particle solver with a fluid", remedy)
        simulation = cls.__new__(cls)
        simulation._begin(None, Parts(particle_solver, coupling), steps, fields, callbacks, features, state)
        return simulation

    def _begin(
        self,
        case: Case | None,
        parts: Parts,
        settings: StepSettings,
        fields: Iterable[Field],
        callbacks: Iterable[Callback],
        features: Iterable[Feature | Function],
        state: dict[str, Any] | None,
    ) -> None:
        """Put the parts together, and continue from a state."""
        self._case, self.particle_solver, self._coupling = case, *parts
        self._around = self._coupling or Uncoupled(self.particle_solver)
        self._fluid, self.forces, self.gravity = self._around.fluid, self._around.forces, self._around.gravity
        self.communicator, self.timers = self.particle_solver.communicator, self.particle_solver.timers
        kinds = [] if case is None else [feature for feature in FEATURES if feature.is_in(case)]
        if case is not None:
            fields = [*fields, *(field for kind in kinds for field in kind.fields_of(case))]
        self.callbacks, fields = list(callbacks), list(fields)
        self.terms: ForceTerms | None = None  # of the last step between fluid and particles
        self.features: list[Equipment] = []
        self._own = 0  # number of them that a user has added
        for feature in features:
            self.add(feature)
        self.steps, self.last_step = 0, 0.0
        particle_step = None if state is None else self._restore(state, fields)
        for field in fields:
            self.particles.declare(field)
        if case is not None:
            self.features[:0] = [kind(case, self) for kind in kinds]
        self._restore_features({} if state is None else state.get("features", {}))
        self.time_steps = TimeSteps(
            settings, self.particle_solver, self._fluid, particle_step, self.communicator, self._step_limits
        )

    @property
    def case(self) -> Case:
        """The case; a simulation of solvers has none, and refuses what needs one."""
        if self._case is None:
            raise InputError("case", None, "there", "this simulation was made of solvers, without a case")
        return self._case

    def add(self, feature: Feature | Function, on: On = "particles") -> None:
        """Add a force or equipment of a user, like those of the case.

        feature  a `FluidForce`; an `Equipment`; or a function of the particles that returns the force on each of them,
                 (N, 3) or (3,) for all [N]
        on       where the force of a function acts: "particles", "fluid", or "both", which is equal and opposite
        """
        added = feature if isinstance(feature, Feature) else OwnForce(feature, on)
        if isinstance(added, FluidForce):
            if added.needs_fluid and not self.has_fluid:
                remedy = 'add it on="particles", or give the case a [fluid]'
                raise InputError(f"force {added.name}", "on the fluid", "a force of a run with a fluid", remedy)
            self.forces.add(added, self.particles)
        elif isinstance(added, Equipment) and added.name not in self._taken and "/" not in added.name:
            self.features.append(added)
            self._own += 1
            for field in added.fields:
                self.particles.declare(field)
        else:
            limit = "a FluidForce, or an Equipment, with a name of its own, without '/'"
            raise InputError("feature", added.name, limit)

    @property
    def _taken(self) -> set[str]:
        """Names that equipment cannot have: those of the features of the case, which may come later, and of others."""
        of_case = (kind.name for kind in FEATURES if self._case is not None and kind.is_in(self._case))
        return {"", *of_case, *(feature.name for feature in self.features)}

    def feature(self, kind: type[Kind]) -> Kind:
        """The feature of a kind that the simulation has.

        errors  InputError if it has none
        """
        for feature in self.features:
            if isinstance(feature, kind):
                return feature
        raise InputError(
            "feature", kind.__name__, "one of " + ", ".join(type(feature).__name__ for feature in self.features)
        )

    @property
    def particles(self) -> Particles:
        """The particles."""
        return self.particle_solver.particles

    @property
    def has_fluid(self) -> bool:
        """Whether there is a fluid around the particles."""
        return self._coupling is not None

    @property
    def fluid(self) -> FluidSolver:
        """The solver of the fluid; InputError where there are dry particles only."""
        return self._required(self._fluid)

    @property
    def coupling(self) -> Coupling:
        """The coupling of particles and fluid; InputError where there are dry particles only."""
        return self._required(self._coupling)

    def _required(self, part: Part | None) -> Part:
        if part is None:
            raise InputError("fluid", None, "given in the case of this simulation", "its particles are dry")
        return part

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
        """A field of the particles of all ranks, in the order of their ids, for measures that need every particle."""
        order = np.argsort(self.communicator.joined(self.owned.id))
        return self.communicator.joined(self.owned[name])[order]

    def snapshot(self) -> dict[str, np.ndarray | Portions]:
        """The fields of the particles of all ranks that a snapshot contains, in the order of the ids."""
        for feature in self.features:
            feature.before_snapshot(self)
        owned, ranks = self.owned, self.communicator
        return {name: rows_by_id(array, owned.id, ranks) for name, array in owned.snapshot().items()}

    def step(self, until: float = math.inf) -> None:
        """Make one fluid step and the particle steps within it; some step ends exactly at `until` [s]."""
        part = self.timers.part
        with part("time steps"):
            step, substeps = self.time_steps.choose(until, self.steps)
        self.terms = self._around.advance(self.owned, step, self.last_step, part)
        for feature in self.features:
            with part(feature.name):
                feature.before(self, step)
        self.particle_solver.advance(step / substeps, substeps)
        for feature in self.features[: len(self.features) - self._own]:
            with part(feature.name):
                feature.after(self)
        self.steps, self.last_step = self.steps + 1, step
        for feature in self.features[len(self.features) - self._own :]:
            with part(feature.name):
                feature.after(self)
        for callback in self.callbacks:
            with part(f"callback {getattr(callback, '__name__', 'without a name')}"):
                callback(self)

    @contextmanager
    def exchange(self) -> Iterator[ParticleSolver]:
        """Let particles enter and leave inside a `with` block, by `insert` and `remove` of the particle solver.

        A particle that enters replaces fluid of its own volume, or leaves room for it.
        """
        before = self.owned
        yield self.particle_solver
        after = self.owned
        same = np.array_equal(before.id, after.id)  # local: of this rank
        if self.communicator.any(not same):
            self._around.exchange(before, after)

    def until(self, time: float) -> None:
        """Continue until a time [s]."""
        while self.time < time * (1.0 - 1e-12):
            self.step(time)

    def _repr_html_(self) -> str:
        """The state in a few numbers, and the particles, in a notebook."""
        rows = [
            ("time", f"{self.time:.4g} s" + (f" of {self._case.run.until:g} s" if self._case is not None else "")),
            ("fluid steps", f"{self.steps}"),
            ("particles", f"{len(self.owned.position)}"),
            ("limit of the last step", self.limiting if self.steps else "-"),
        ]
        owned = self.owned
        size, title = (None, "") if self._case is None else (self._case.column.size, self._case.title)
        drawing = html.spheres(owned.position, owned.radius, owned.velocity, size)
        return html.table(title or "Simulation", rows, drawing)

    # ------------------------------------------------------------ checkpoints

    def checkpoint(self) -> dict[str, Any]:
        """Everything that the next step depends on; on several ranks with `Portions` of what they share."""
        parts: dict[str, Any] = {
            "steps": self.steps,
            "last_step": self.last_step,
            "particle_step": self.time_steps.particle_step,
            "particles": self.particle_solver.checkpoint(),
        }
        parts |= self._around.state()
        if forces := self.forces.checkpoint(self.communicator):
            parts |= {"forces": forces}
        if kept := {feature.name: state for feature in self.features if (state := feature.checkpoint())}:
            parts |= {"features": kept}
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

    def _restore(self, state: dict[str, Any], fields: list[Field]) -> float | None:
        """Take over a checkpoint; returns the particle step [s], None where it is to be chosen anew."""
        for field in fields:
            if field.name in state["particles"]["particles"]:
                self.particles.declare(field)
        self.particle_solver.restore(state["particles"])
        self._around.take_over(state)
        self.forces.restore(state.get("forces", {}), self.communicator)
        self.steps, self.last_step = int(state["steps"]), float(state.get("last_step", 0.0))
        return None if state["particle_step"] is None else float(state["particle_step"])

    def _restore_features(self, kept: dict[str, Any]) -> None:
        """Take over what a checkpoint keeps of the features."""
        require_features(kept, [feature.name for feature in self.features])
        for feature in self.features:
            if feature.name in kept:
                feature.restore(kept[feature.name])

    def _step_limits(self) -> dict[str, float]:
        """Longest fluid step that the features allow, by criterion [s]."""
        return {name: longest for feature in self.features for name, longest in feature.step_limits.items()}

    def is_acted_on(self) -> bool:
        """Whether a user's function may put energy in."""
        return bool(self.callbacks or self._own) or "external" in self.forces.lines


def _share(fields: Mapping[str, Any], communicator: Communicator) -> dict[str, np.ndarray]:
    """As many rows of some fields for each rank, one rank after the other."""
    rows = len(next(iter(fields.values())))
    first, last = (rows * n // communicator.size for n in (communicator.rank, communicator.rank + 1))
    return {name: np.asarray(values[first:last]) for name, values in fields.items()}
