"""The forces of a run, one after the other; and their sum on every particle, beside forces from outside."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import prange, threaded, vector_inline
from cfddem.backend.errors import InputError
from cfddem.coupling.terms import LINES, ForceTerms
from cfddem.fluid.grid import Array
from cfddem.model.feature import FluidForce
from cfddem.model.fields import Field
from cfddem.particles.state import Particles

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
            _add(new, term.reshape(-1)[here])
        for n in range(len(new)):
            of_all[n] += new[n] - old[n]
            old[n] = new[n]


@vector_inline
def _add(total, term):
    for n in range(len(total)):
        total[n] += term[n]
