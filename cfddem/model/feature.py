"""A feature is one object: its fields, what it does in a step, and what a checkpoint keeps of it.

The machine goes over lists of features and names none of them. Features of a case and those of a user are added in the
same way, `Simulation.add`. Every method does nothing unless a feature says otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.backend.portions import Portions
from cfddem.model.fields import Field

Function = Callable[[Any], Any]
"""The force on each of the particles, (N, 3), or (3,) for all [N]."""

On = Literal["particles", "fluid", "both"]


class Feature:
    """Something that a simulation can have.

    name    in checkpoints and messages; no two features of a simulation share one
    fields  of the particles that it needs; declared where it is added
    kept    names of its numbers that a checkpoint holds
    """

    name: str = ""
    fields: tuple[Field, ...] = ()
    kept: tuple[str, ...] = ()

    def checkpoint(self) -> dict[str, Any]:
        """What the next step depends on, beside the fields."""
        return {name: getattr(self, name) for name in self.kept}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`."""
        for name in self.kept:
            setattr(self, name, type(getattr(self, name))(state[name]))


class Equipment(Feature):
    """What acts around the steps of a simulation: it may move, feed, measure or write."""

    @property
    def step_limits(self) -> dict[str, float]:
        """Longest fluid step that it allows, by criterion [s]."""
        return {}

    def before_snapshot(self, simulation: Any) -> None:
        """Find what only snapshots hold."""

    def cells_for_snapshot(self) -> Mapping[str, np.ndarray | Portions]:
        """Its fields of the fluid in snapshots, in the cells of all ranks (nz, ny, nx), by `in_portions`."""
        return {}

    def before(self, simulation: Any, step: float) -> None:
        """Act before the particles make their steps, over `step` [s]."""

    def after(self, simulation: Any) -> None:
        """Act after the step."""


class FluidForce(Feature):
    """A force on particles, on the fluid around them, or between both, constant over a fluid step.

    lines         of the energy budget to which its work belongs, some of `cfddem.coupling.terms.LINES`
    late          whether it acts after the others, since it depends on their resistance
    sets_inertia  whether it changes the inertia of particles
    needs_fluid   whether it needs the flow around the particles
    sharp         whether the surfaces of beds are sharp in the flow that all forces see
    needs_sizes   whether it needs the diameter of each particle over the Sauter mean around it
    own           what every particle adds to the flow itself, which other forces do not see; of the type
                  `cfddem.coupling.sampled_flow.Own`
    outside       how often its law was evaluated outside its range, on this rank

    In a fluid step every method is called for all forces before the next one, with the terms of the step,
    :class:`cfddem.coupling.terms.ForceTerms`: `begin`, `act`, the step of the fluid, `respond`, `end`.
    """

    lines: tuple[str, ...] = ()
    late: bool = False
    sets_inertia: bool = False
    needs_fluid: bool = True
    needs_sizes: bool = False
    sharp: bool = False
    own: Any = None
    outside: int = 0

    def begin(self, terms: Any) -> None:
        """Prepare what all forces see: the inertia of the particles, or the flow around them."""

    def act(self, terms: Any) -> None:
        """Add resistance to the slip and forces of the coming step, by `terms.resist`, `push`, `pull`, `between`."""

    def respond(self, terms: Any) -> None:
        """Add forces on the particles that are known only after the step of the fluid, by `terms.push`."""

    def end(self, terms: Any) -> None:
        """Store what the next step needs; `terms.force` has the force of every line."""


class OwnForce(FluidForce):
    """A user's force, from a function of the particles, evaluated once in every fluid step.

    function  particles -> force on each of them (N, 3), or (3,) for all [N]
    on        "particles", "fluid" (where the particles are), or "both": on the particles, its opposite on the fluid

    >>> OwnForce(lambda particles: 1e-7 * particles.radius[:, None] * [1.0, 0.0, 0.0]).on
    'particles'
    """

    lines = ("external",)

    def __init__(self, function: Function, on: On = "particles") -> None:
        self.function, self.on, self.needs_fluid = function, on, on != "particles"
        self.name = getattr(function, "__name__", type(function).__name__)
        if not callable(function) or on not in ("particles", "fluid", "both"):
            raise InputError(f"force {self.name}", on, 'a function, on="particles", "fluid" or "both"')

    def act(self, terms: Any) -> None:
        """The force at the present positions and velocities."""
        forces, count = np.asarray(self.function(terms.particles), float), terms.particles.count
        if forces.shape not in ((3,), (count, 3)):
            raise InputError(f"force {self.name}", forces.shape, f"an array of the shape (3,) or ({count}, 3), in N")
        force = np.broadcast_to(forces, (count, 3)).copy()
        wrong = ~np.isfinite(force).all(axis=1)  # local: components of a row
        if wrong.any():  # local: every rank has its own particles
            n = int(np.argmax(wrong))  # local: the first on this rank
            at = f"particle {terms.particles.id[n]} at {terms.particles.position[n]}"
            raise InputError(f"force {self.name}", force[n], "finite", at)
        {"particles": terms.push, "fluid": terms.pull, "both": terms.between}[self.on]("external", force)
