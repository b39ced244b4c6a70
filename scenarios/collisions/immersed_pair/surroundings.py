"""The fluid around a pair that collides, a `QuiescentFluid`: drag, added mass, history, and drag beside the wall."""

from __future__ import annotations

from collections.abc import Sequence

from cfddem.backend.errors import InputError, nearest
from cfddem.coupling.forces.wall_drag import WallDrag
from cfddem.coupling.quiescent_fluid import QuiescentFluid
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.walls.shapes import Plane
from closures.drag_single import schiller_naumann
from closures.registry import law_of

FORCES = ("drag", "added_mass", "history", "wall_drag")
"""Forces of the fluid, beyond the film."""

WALL = Plane(normal=(-1.0, 0.0, 0.0), material=1)
"""The wall; the sphere moves along x."""


def chosen_forces(given: str | Sequence[str]) -> tuple[str, ...]:
    """Names of forces, from "none", "all", or names joined by commas.

    >>> chosen_forces("drag,history"), chosen_forces("none")
    (('drag', 'history'), ())
    """
    words = given.replace(" ", "").split(",") if isinstance(given, str) else list(given)
    if words in (["none"], [""]):
        return ()
    if words == ["all"]:
        return FORCES
    for word in words:
        if word not in FORCES:
            raise InputError("surroundings", word, nearest(word, FORCES), 'names joined by commas, "all" or "none"')
    return tuple(words)


def fluid_around(
    run: ParticleSolver, forces: Sequence[str], density: float, viscosity: float, gravity: float, against_wall: bool
) -> QuiescentFluid | None:
    """A fluid at rest with these forces; None where nothing but the film and the contact acts.

    gravity  along x, from striker to target [m/s2]
    """
    if not forces and gravity == 0.0:
        return None
    if "wall_drag" in forces and forces != FORCES and not against_wall:
        raise InputError("surroundings", "wall_drag", "left out without a wall", 'or collide with against="wall"')
    beside = None
    if against_wall and "wall_drag" in forces:
        beside = WallDrag([WALL], "nearest", film=run.laws.film, shear=run.laws.shears)
    return QuiescentFluid(
        run,
        density,
        viscosity,
        law_of(schiller_naumann) if "drag" in forces else None,
        added_mass="added_mass" in forces,
        history="mei_adrian" if "history" in forces else "none",
        wall=WALL if against_wall else None,
        wall_drag=beside,
        gravity=(gravity, 0.0, 0.0),
    )
