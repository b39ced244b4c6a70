"""The forces of a fluid step: the terms that they add for particles and fluid, and their list in the order of a run."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import prange, threaded, vector_inline
from cfddem.backend.errors import InputError
from cfddem.coupling.kernel import ParticleCellMap
from cfddem.coupling.sampled_flow import SampledFlow
from cfddem.coupling.seen_solids import SeenSolids
from cfddem.coupling.transfer import Directions, ImplicitCoefficients, by_axis, implicit_force, slip_of
from cfddem.fluid.grid import Array
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.state import Particles

LINES = {
    "drag": "drag",
    "pressure": "pressure of model A, without buoyancy",
    "weight": "weight, less buoyancy",
    "explicit": "lift, viscous stress and added mass",
    "agitation": "acceleration of the fluctuation of the fluid, or fluctuating force; not that in the drag",
    "history": "history force",
    "external": "forces from outside, and of a user",
}
"""Lines of the energy budget of the coupling, in the order in which forces are summed."""


class ForceTerms:
    """The terms of one fluid step.

    particles   of this rank, without ghosts
    step        length of the step [s]
    last_step   of the step before, 0 in the first [s]
    flow        the undisturbed flow around every particle; forces may change what the laws see

    A force adds its part of a line of `LINES`:

    resist      a conductance b (N,) [kg/s]: the force b (u - v), implicit on particles and fluid. It is stored as
                that of the slip of the cells, b N. Or a symmetric tensor (N, 3, 3), which adds a resistance that
                depends on direction
    fluctuate   a velocity u'' (N, 3) [m/s], added to that of the cells in the conductance of a line; tensors, such as
                the resistance beside a wall, do not see it
    push        a force on the particles (N, 3) [N]
    pull        a force on the fluid around them (N, 3) [N]
    between     a force on the particles (N, 3) [N], and its opposite on the fluid
    """

    flow: SampledFlow

    def __init__(self, particles: Particles, step: float, last_step: float) -> None:
        self.particles, self.step, self.last_step = particles, step, last_step
        self.conductances: dict[str, Array] = {}
        self.fluctuations: dict[str, Array] = {}
        self.tensors: dict[str, Array] = {}  # resistance of each line that depends on direction, beside conductances
        self.foreseen: Array | float = 0.0  # change of the fluid in the step that resistance by direction expects [m/s]
        self.explicit: dict[str, Array] = {}  # explicit force of each line on the particles
        self.on_fluid: dict[str, Array] = {}
        self.implicit_force: dict[str, Array] = {}  # of the resistance of each line on the particles
        self.added: Array = np.zeros(particles.count)  # change of the added mass at the start of the step (N,) [kg]
        self.spin_work = 0.0  # kinetic energy that torques of the fluid have given to the particles [J]

    def resist(self, line: str, resistance: Array) -> None:
        """Add a resistance to the slip of the particles, a conductance (N,) or a tensor (N, 3, 3)."""
        if resistance.ndim == 1:
            _add(self.conductances, line, resistance * self.flow.narrowing)
        else:
            _add(self.tensors, line, resistance * np.reshape(self.flow.narrowing, (-1, 1, 1)))

    def fluctuate(self, line: str, velocity: Array) -> None:
        """Add a fluctuation of the fluid velocity that acts through the conductance of a line."""
        _add(self.fluctuations, line, velocity)

    def push(self, line: str, force: Array) -> None:
        """Add a force on the particles."""
        _add(self.explicit, line, force)

    def pull(self, line: str, force: Array) -> None:
        """Add a force on the fluid around the particles."""
        _add(self.on_fluid, line, force)

    def between(self, line: str, force: Array) -> None:
        """Add a force on the particles, and its opposite on the fluid."""
        self.push(line, force)
        self.pull(line, -force)

    def conductance(self, line: str) -> Array:
        """Conductance b N of a line so far (N,) [kg/s]; zero for a line without resistance."""
        return self.conductances[line] if line in self.conductances else np.zeros(self.particles.count)

    @property
    def resistance(self) -> Array:
        """Conductance b N of all lines (N,) [kg/s]."""
        return total(self.conductances, np.zeros(self.particles.count))

    @property
    def inertia(self) -> Array:
        """Mass and added mass of every particle (N,) [kg]; infinite for fixed particles."""
        return inertia(self.particles)

    @property
    def unseen(self) -> Array:
        """Part of the cells' velocity that does not act on every particle (N, 3) [m/s].

        It is what the sampled flow lacks, less what the resistance of a line adds for itself alone.
        """
        unseen = self.flow.unseen
        for line in self.fluctuations:
            unseen = unseen - self.fluctuation_in_all(line)
        return unseen

    def fluctuation_in_all(self, line: str) -> Array:
        """Change of the velocity of the cells that has the force of a line's fluctuation, in all resistance (N, 3)."""
        conductance, velocity = self.conductance(line), self.fluctuations[line]
        if self.tensors:
            return slip_of(conductance[:, None] * velocity, self.resistance, total(self.tensors, velocity))
        return np.asarray((conductance / np.maximum(self.resistance, 1e-300))[:, None] * velocity)

    @property
    def directions(self) -> Directions | None:
        """How all resistance depends on direction; None if it does not."""
        if not self.tensors:
            return None
        slip = self.flow.slip / np.reshape(self.flow.narrowing, (-1, 1)) + self.flow.unseen - self.unseen
        return Directions(total(self.tensors, slip), slip + self.foreseen)

    def receive(self, force: Array) -> None:
        """Divide the force of all resistance among its lines, by their conductances and fluctuations (N, 3) [N].

        The first line gets what the others leave; resistance that depends on direction is in no other.
        """
        of_slip, resistance = force, np.maximum(self.resistance, 1e-300)
        for line, velocity in self.fluctuations.items():
            of_slip = of_slip - self.conductance(line)[:, None] * velocity
        first, *others = [line for line in LINES if line in self.conductances or line in self.tensors] or ["drag"]
        if self.tensors and others:
            of_slip = resistance[:, None] * slip_of(of_slip, resistance, total(self.tensors, force))
        self.implicit_force = {line: of_slip * (self.conductances[line] / resistance)[:, None] for line in others}
        for part in self.implicit_force.values():
            force = force - part
        self.implicit_force = {first: force} | self.implicit_force

    def mean_slip(self, line: str) -> Array:
        """Slip of the cells at which the resistance of a line has acted, without its fluctuation (N, 3) [m/s]."""
        force, conductance = self.implicit_force[line], self.conductance(line)
        fluctuation = self.fluctuations.get(line, np.zeros(3))
        if line in self.tensors:
            return slip_of(force - conductance[:, None] * fluctuation, conductance, self.tensors[line])
        return np.asarray(force / np.maximum(conductance, 1e-300)[:, None] - fluctuation)

    @property
    def response_rate(self) -> Array:
        """Rate at which a particle takes up the velocity of the fluid (N, 1), or along each axis (N, 3) [1/s]."""
        if self.tensors:
            return np.asarray(by_axis(self.resistance, total(self.tensors, self.resistance)) / self.inertia[:, None])
        return np.asarray(self.resistance / self.inertia)[:, None]

    def force(self, line: str) -> Array:
        """Force of a line on every particle (N, 3) [N]; zero for a line that the run lacks."""
        parts = [forces[line] for forces in (self.implicit_force, self.explicit) if line in forces]
        return sum(parts[1:], parts[0]) if parts else np.zeros((self.particles.count, 3))

    @property
    def forces(self) -> dict[str, Array]:
        """Force of every line that the step has on every particle (N, 3) [N]."""
        return {line: self.force(line) for line in LINES if line in self.implicit_force or line in self.explicit}


class CouplingTerms(ForceTerms):
    """The terms of a step that is coupled with the cells of a fluid.

    cell_map  positions of the particles among the cells
    solid     solid fraction of the cells (nz, ny, nx)
    """

    implicit: ImplicitCoefficients
    seen_solids: SeenSolids | None = None  # means that particles see, where surfaces are sharp

    def __init__(
        self, particles: Particles, step: float, last_step: float, cell_map: ParticleCellMap, solid: Array
    ) -> None:
        super().__init__(particles, step, last_step)
        self.cell_map, self.solid = cell_map, solid

    def implicit_force_at(self, slip: Array) -> Array:
        """Force of all resistance by a slip of the cells alone, over the step (N, 3) [N]."""
        if self.tensors:
            return implicit_force(slip, self.resistance, total(self.tensors, slip), self.inertia, self.step)
        return self.implicit.implicit * slip

    @property
    def fields(self) -> tuple[Array, Array, Array, Array | None]:
        """Arguments of `FluidSolver.step` after the length of the step."""
        sent = self.implicit
        return 1.0 - self.solid, sent.cell_conductance, sent.cell_product, sent.cell_source


def inertia(particles: Particles) -> Array:
    """Mass and added mass of every particle (N,) [kg]; infinite for fixed particles."""
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / particles.inverse_mass)


def total(parts: dict[str, Array], nothing: Array) -> Array:
    """Sum over the lines, in their order; `nothing` without any."""
    present = [parts[line] for line in LINES if line in parts]
    return sum(present[1:], present[0]) if present else nothing


def _add(parts: dict[str, Array], line: str, values: Array) -> None:
    """Add to a line."""
    parts[line] = parts[line] + values if line in parts else values


# ---------------------------------------------------------------- the list of forces


EXTERNAL = Field("external", "N", 3, meaning="force from outside, which the user may set at any time")
"""Added to the forces of the fluid, and never changed by them."""

APPLIED = Field(
    "applied_by_run", "N", 3, "scratch", lambda table, rows: table.applied[rows], meaning="applied, as the run set it"
)

PIECE = 1024
"""Components whose forces are summed one after the other: few enough for the cache."""


class ForceList:
    """The forces of a run.

    particles  get the fields of all forces, and `external`
    forces     in the order in which they act; late ones after all others
    """

    def __init__(self, particles: Particles, forces: Iterable[FluidForce] = ()) -> None:
        self._forces: list[FluidForce] = []
        for field in (EXTERNAL, APPLIED):
            particles.declare(field)
        for force in forces:
            self.add(force, particles)

    def add(self, force: FluidForce, particles: Particles) -> None:
        """Add a force, and declare its fields."""
        if force.name in self or not force.name or "/" in force.name:
            raise InputError("name of a force", force.name, "a name without '/' that no other force of the run has")
        if not set(force.lines) <= set(LINES):
            raise InputError(f"lines of the force {force.name}", force.lines, f"some of {', '.join(LINES)}")
        for field in force.fields:
            particles.declare(field)
        self._forces = sorted([*self._forces, force], key=lambda listed: listed.late)

    def __iter__(self) -> Iterator[FluidForce]:
        return iter(self._forces)

    def __getitem__(self, name: str) -> Any:
        return next(force for force in self if force.name == name)

    def __contains__(self, name: str) -> bool:
        return any(force.name == name for force in self)

    @property
    def lines(self) -> list[str]:
        """Lines of the energy budget that the forces have."""
        present = {line for force in self for line in force.lines}
        return [line for line in LINES if line in present]

    def act(self, terms: ForceTerms) -> None:
        """Collect what all forces add to a step."""
        require_unwritten(terms.particles)
        for force in self:
            force.begin(terms)
        for force in self:
            force.act(terms)

    def finish(self, terms: ForceTerms) -> None:
        """Set `applied` after the step of the fluid, and let the forces store what they need."""
        for force in self:
            force.respond(terms)
        terms.push("external", terms.particles.external)
        replace_applied(terms.particles, tuple(terms.forces.values()))
        for force in self:
            force.end(terms)

    def outside(self, communicator: Communicator) -> dict[str, int]:
        """How often the law of each force was evaluated outside its range, on all ranks."""
        counts = communicator.sum(np.array([force.outside for force in self], np.int64), axis=())
        return {force.name: int(count) for force, count in zip(self, counts)}

    def checkpoint(self, communicator: Communicator) -> dict[str, Any]:
        """What the next step depends on, beside the fields of the particles."""
        outside = self.outside(communicator)
        return {force.name: {"outside": outside[force.name], **force.checkpoint()} for force in self}

    def restore(self, state: dict[str, Any], communicator: Communicator) -> None:
        """Continue from a `checkpoint()`."""
        require_features(state, [force.name for force in self])
        for force in self:
            if force.name in state:
                force.restore(state[force.name])
                force.outside = int(state[force.name]["outside"]) if communicator.rank == 0 else 0


def require_features(state: Mapping[str, Any], present: Collection[str]) -> None:
    """Refuse to continue without the features of a checkpoint."""
    if missing := sorted(name for name in state if name not in present):
        names = ", ".join(missing)
        remedy = f"it had {names}: add it to Simulation(features=...), Run.resume(features=...)"
        raise InputError("checkpoint", names, "of a run with the same features", remedy)


def require_unwritten(particles: Particles) -> None:
    """Refuse a change of `applied`, which belongs to the run."""
    written = particles[APPLIED.name]
    changed = (particles.applied != written) & ~np.isnan(written)
    if changed.any():  # local: every rank has its own particles
        name = int(particles.id[np.argmax(changed) // 3])  # local: the first on this rank
        remedy = "write particles.external, or Simulation.add(force)"
        raise InputError(f"applied of particle {name}", "written from outside", "left to the run", remedy)


def replace_applied(particles: Particles, forces: tuple[Array, ...]) -> None:
    """Replace `applied` by the sum of forces (N, 3) [N], also as part of the sum of all forces."""
    _replace(forces, particles[APPLIED.name], particles.applied, particles.force)


@threaded
def _replace(forces, total, applied, force):
    """The sum is written to `total` and `applied`. An array of a tuple costs much to look up: once for many rows."""
    for piece in prange((force.size + PIECE - 1) // PIECE):
        here = slice(piece * PIECE, min((piece + 1) * PIECE, force.size))
        new, old, of_all = total.reshape(-1)[here], applied.reshape(-1)[here], force.reshape(-1)[here]
        new[:] = 0.0
        for term in forces:
            _add_rows(new, term.reshape(-1)[here])
        for n in range(len(new)):
            of_all[n] += new[n] - old[n]
            old[n] = new[n]


@vector_inline
def _add_rows(total, term):
    for n in range(len(total)):
        total[n] += term[n]
