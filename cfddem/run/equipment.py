"""Walls, feeds and outlets of a case as the particle solver takes them, and what they do around every step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError, RunFailed
from cfddem.case.bed import Species
from cfddem.case.feeds import CaseFeed, fed_species, feed_rate
from cfddem.case.particle_properties import diameters_of
from cfddem.case.schema import Case
from cfddem.case.walls import CaseWall
from cfddem.data.fields import Field
from cfddem.particles.feeding import Feed, ParticleOutlet
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles
from cfddem.particles.walls.motion import Motion, WallMotions
from cfddem.particles.walls.shapes import Cone, Cylinder, Mesh, Plane, Wall
from cfddem.run.initial_particles import SPECIES

_FED = 2
"""Random numbers of the feeds; others use the seed alone, or with other numbers."""


def case_walls(case: Case, default: int) -> list[Wall]:
    """The walls of a case beside those of the column.

    default  row of the pair table of walls without a material
    """
    names = list(case.material)
    return [
        wall_of(wall, default if wall.material is None else names.index(wall.material), f"wall.{number}")
        for number, wall in enumerate(case.wall)
    ]


def wall_of(given: CaseWall, material: int, key: str) -> Wall:
    """A wall of a case as the solver takes it."""
    velocity = tuple(np.array(given.velocity) + given.swing)
    common: dict[str, Any] = {"velocity": velocity, "spin": given.spin, "centre": given.centre, "material": material}
    try:
        if given.shape == "plane":
            return Plane(point=given.point, normal=given.normal, **common)
        if given.shape == "cylinder":
            return Cylinder(
                point=given.point, axis=given.axis, radius=given.radius or 0.0, length=given.length, caps=given.caps,
                outside=given.outside, **common,
            )  # fmt: skip
        if given.shape == "cone":
            return Cone(
                point=given.point, axis=given.axis, radius=given.radius or 0.0, top_radius=given.top_radius or 0.0,
                length=given.length or 0.0, **common,
            )  # fmt: skip
        return Mesh.from_stl(given.file or "", scale=given.scale, place=given.point, **common)
    except InputError as failure:
        raise InputError(f"{key}.{failure.field}", failure.value, failure.limit, failure.remedy) from None


LANDED = Field(
    "landed", role="memory", initial=1.0, dtype=np.int8, meaning="1, or 0 before the first contact of a fed particle"
)
"""Declared on the particles of a run with feeds."""


class CaseEquipment:
    """Moving walls, feeds and outlets of a case.

    case    with tables [[wall]], [[feed]] and [[outlet]]
    solver  of its particles; the walls of the case are its last ones
    """

    def __init__(self, case: Case, solver: ParticleSolver) -> None:
        first = len(solver.walls.sweep) - len(case.wall)
        self.motions = WallMotions([
            Motion(
                first + number, each.velocity, each.spin, each.amplitude, each.frequency, each.begin,
                math.inf if each.end is None else each.end,
            )
            for number, each in enumerate(case.wall)
            if each.has_schedule
        ])  # fmt: skip
        self.feeds = [_feed(case, each, number) for number, each in enumerate(case.feed)]
        if self.feeds:
            solver.particles.declare(LANDED)
        self.outlets = [
            ParticleOutlet(each.corner, tuple(np.add(each.corner, each.size)), inside=True) for each in case.outlet
        ]

    @property
    def exchanges(self) -> bool:
        """Whether particles may enter or leave."""
        return bool(self.feeds or self.outlets)

    def move_walls(self, solver: ParticleSolver, step: float) -> None:
        """Set the velocities of the walls for the coming step [s]."""
        self.motions(solver, step)

    def exchange_particles(self, solver: ParticleSolver) -> bool:
        """Insert the particles that are due, and remove those that have left; returns whether there were any."""
        if self.feeds:
            _note_landings(solver)
        moved = sum(feed(solver) for feed in self.feeds)
        for number, outlet in enumerate(self.outlets):
            owned = solver.particles.without_ghosts()
            if solver.communicator.all(outlet.takes(owned.position)):
                raise RunFailed(
                    f"t = {solver.time:.6g} s: the last particles have reached outlet.{number}, and a run needs at "
                    "least one; end it earlier with run.until, or feed more"
                )
            moved += outlet(solver)
        return moved > 0

    @property
    def fed(self) -> int:
        """Number of particles that have entered."""
        return sum(each.entered for each in self.feeds)

    @property
    def waiting(self) -> int:
        """Number of particles that are due, and found no free place so far."""
        return sum(len(each.waiting) for each in self.feeds)

    @property
    def removed(self) -> tuple[int, float]:
        """Number and mass of the particles that have left [-], [kg]."""
        return sum(each.left for each in self.outlets), sum(each.mass for each in self.outlets)

    def checkpoint(self) -> dict[str, Any]:
        """What feeds and outlets have done so far; the places of walls are in the state of the solver."""
        return {name: each.checkpoint() for name, each in self._by_name()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()` of the same case."""
        for name, each in self._by_name():
            each.restore(state[name])

    def _by_name(self) -> Iterator[tuple[str, Feed | ParticleOutlet]]:
        """All feeds and outlets by name."""
        yield from ((f"feed_{number}", each) for number, each in enumerate(self.feeds))
        yield from ((f"outlet_{number}", each) for number, each in enumerate(self.outlets))


def _feed(case: Case, given: CaseFeed, number: int) -> Feed:
    """A feed of a case."""
    species = fed_species(case, given)
    names = list(case.species)
    middle = given.corner[2] + 0.5 * given.size[2]
    return Feed(
        feed_rate(case, given),
        given.corner,
        given.size,
        _sizes(species),
        case.material_of(species).density,
        velocity=given.velocity,
        material=list(case.material).index(case.material_name_of(species)),
        viscosity=0.0 if case.fluid is None else float(case.fluid.viscosity_at(np.array([middle]))[0]),
        seed=(case.bed.seed, number, _FED),
        begin=given.begin,
        end=math.inf if given.end is None else given.end,
        finish=_fresh(None if given.species is None else names.index(given.species)),
    )


def _sizes(species: Species) -> Callable[[int, np.random.Generator], np.ndarray]:
    """Diameters of a species, drawn from the generator of a feed."""

    def draw(count: int, generator: np.random.Generator) -> np.ndarray:
        return diameters_of(species, count, generator)

    return draw


def _fresh(species: int | None) -> Callable[[Particles], None]:
    """Declares the species of new particles, and that they have not landed."""

    def declare(fresh: Particles) -> None:
        fresh.declare(LANDED, np.zeros(fresh.count, np.int8))
        if species is not None:
            fresh.declare(SPECIES, np.full(fresh.count, species, np.int32))

    return declare


def _note_landings(solver: ParticleSolver) -> None:
    """Mark the particles that are in contact with another one or with a wall."""
    edges, landed = solver.edges, solver.particles.landed
    touching = (edges.force != 0.0).any(axis=1)  # local: components of a row
    landed[edges.first[touching]] = 1
    pairs = touching[: edges.between_particles]
    landed[edges.second[: edges.between_particles][pairs]] = 1
