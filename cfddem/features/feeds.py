"""Feeds and outlets: particles that enter and leave during a run, through boxes and, in a case, through openings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import KW_ONLY, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from cfddem.backend.errors import InputError, RunFailed
from cfddem.case.bed import CaseFeed
from cfddem.case.feeds import fed_species, feed_rate
from cfddem.case.particle_properties import SPECIES, diameters_of
from cfddem.case.patches import PLANES, CasePatch, along, middle_of
from cfddem.case.schema import Case
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.model.fields import Field
from cfddem.particles.initial.packing import Seed
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles, make_particles
from cfddem.particles.vectors import Vector
from cfddem.particles.walls.arrays import near_walls
from cfddem.particles.walls.nearest_point import Walls

_TRIES = 20
"""Positions that are tried for a particle before it waits for the next call."""


_NOWHERE_BELOW, _NOWHERE_ABOVE = (-np.inf, -np.inf, -np.inf), (np.inf, np.inf, np.inf)


@dataclass(eq=False)
class Feed:
    """Inserts particles in a box at a constant rate.

    Call it with the run from time to time; it inserts the particles due since its first call, or since `begin`. A
    particle that finds no position in the box free of particles and walls waits for the next call. A run that is
    resumed with the `checkpoint()` of its feeds and outlets continues with the same bits.

    rate          [1/s]
    corner, size  of the box in which centres appear; a size may be 0 [m]
    diameters     (number, generator) -> diameters (number,) [m], drawn from the random generator of the feed, for
                  instance `lambda number, draw: normal(number, 1e-3, 1e-4, draw)`
    density       [kg/m3]
    velocity      of inserted particles [m/s]
    material      row of the pair table
    viscosity     of the fluid around them [Pa s]
    seed          of the random positions and diameters
    begin, end    times between which particles become due; from the first call on if not given [s]
    finish        called with new particles before they are inserted, for instance to declare fields
    """

    rate: float
    corner: Vector
    size: Vector
    diameters: Callable[[int, np.random.Generator], np.ndarray]
    density: float
    _: KW_ONLY
    velocity: Vector = (0.0, 0.0, 0.0)
    material: int = 0
    viscosity: float = 0.0
    seed: Seed
    begin: float = math.nan  # or time of the first call
    end: float = math.inf
    finish: Callable[[Particles], None] = lambda _: None

    def __post_init__(self) -> None:
        if not 0.0 <= self.rate < np.inf:
            raise InputError("rate", self.rate, "at least 0")
        self._corner, self._size = np.array(self.corner, float), np.array(self.size, float)
        self.entered = 0
        self.waiting = np.zeros(0)  # diameters of particles that are due [m]
        self._generator = np.random.default_rng(self.seed)

    def __call__(self, run: ParticleSolver) -> int:
        """Insert the particles that are due; returns their number."""
        if math.isnan(self.begin):
            self.begin = run.time
        active = max(min(run.time, self.end) - self.begin, 0.0)
        due = int(self.rate * active * (1.0 + 1e-12)) - self.entered - len(self.waiting)
        if due > 0:
            self.waiting = np.append(self.waiting, self.diameters(due, self._generator))
        if not len(self.waiting):
            return 0
        radius = 0.5 * self.waiting
        place, free = self._places(run, radius)
        free &= apart_from_walls(place, radius, run.walls)
        entered = len(radius[free])
        if entered:
            fresh = make_particles(
                place[free],
                radius[free],
                self.density,
                velocity=np.array(self.velocity),
                material=self.material,
                viscosity=self.viscosity,
            )
            self.finish(fresh)
            run.insert(fresh)
        self.waiting = self.waiting[~free]
        self.entered += entered
        return entered

    def _places(self, run: ParticleSolver, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A position for each sphere, and whether it is free; the same on all ranks."""
        largest = run.communicator.largest(np.append(run.particles.radius, radius))
        low, high = self._corner - 2.0 * largest, self._corner + self._size + 2.0 * largest
        near = _inside(run.particles.position, low, high)
        there, sizes = run.particles.position[near], run.particles.radius[near]
        place, free = np.zeros((len(radius), 3)), np.zeros(len(radius), bool)
        tree = cKDTree(there) if len(there) else None
        for n in range(len(radius)):
            for _ in range(_TRIES):
                spot = self._corner + self._generator.uniform(0.0, 1.0, 3) * self._size
                near_by = [] if tree is None else tree.query_ball_point(spot, radius[n] + largest)
                others = np.concatenate([there[near_by], place[:n][free[:n]]])
                reach = np.concatenate([sizes[near_by], radius[:n][free[:n]]]) + radius[n]
                if run.communicator.all(np.einsum("nd,nd->n", others - spot, others - spot) > reach**2):
                    place[n], free[n] = spot, True
                    break
        return place, free

    def checkpoint(self) -> dict[str, Any]:
        """Everything that the next particles depend on."""
        return {
            "entered": self.entered,
            "waiting": self.waiting.copy(),
            "begin": self.begin,
            "generator": self._generator.bit_generator.state,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()` of the same feed."""
        self.entered, self.waiting = int(state["entered"]), np.array(state["waiting"])
        self.begin = float(state["begin"])
        self._generator.bit_generator.state = state["generator"]


class ParticleOutlet:
    """Removes and counts particles outside a region, or inside it.

    Particles with a field `entered`, the time at which they did [s], have a residence time where this is a number.

    low, high  opposite corners of the region; infinite in directions without an outlet [m]
    inside     remove the particles inside
    """

    def __init__(self, low: Vector = _NOWHERE_BELOW, high: Vector = _NOWHERE_ABOVE, *, inside: bool = False) -> None:
        self.low, self.high, self.inside = np.array(low, float), np.array(high, float), inside
        self.left, self.mass, self._times = 0, 0.0, [np.zeros(0)]

    @property
    def times(self) -> np.ndarray:
        """Residence times in the order in which particles left, of those that leave together the shortest first
        (n,) [s]."""
        if len(self._times) > 1:
            self._times = [np.concatenate(self._times)]
        return self._times[0]

    def takes(self, particles: Particles) -> np.ndarray:
        """Which particles are removed (N,) bool."""
        return _inside(particles.position, self.low, self.high) == self.inside

    def __call__(self, run: ParticleSolver) -> int:
        """Remove the particles that have left; returns their number."""
        gone = run.remove(self.takes(run.particles))
        left = run.communicator.sum(gone.count)
        self.left += left
        self.mass += run.communicator.sum(gone.mass)
        if left and "entered" in gone:
            stayed = run.time - run.communicator.joined(gone.entered)
            self._times.append(np.sort(stayed[np.isfinite(stayed)]))  # joined where they are read
        return left

    def checkpoint(self) -> dict[str, Any]:
        """What has left so far."""
        return {"left": self.left, "mass": self.mass, "times": self.times.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()` of the same outlet."""
        self.left, self.mass, self._times = int(state["left"]), float(state["mass"]), [np.array(state["times"], float)]


def apart_from_walls(place: np.ndarray, radius: np.ndarray, walls: Walls) -> np.ndarray:
    """Which spheres at positions (N, 3) [m] with radii (N,) [m] touch no wall and are behind none (N,) bool."""
    apart = np.ones(len(radius), bool)
    if len(radius) and len(walls.kind):
        touching, _ = near_walls(make_particles(place, radius, 1.0), walls, 0.0, 0.0)
        apart[touching] = False
    return apart


def _inside(position: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Which positions lie between two corners (N,) bool."""
    return np.logical_and.reduce((position >= low) & (position <= high), axis=1)  # local: three coordinates of a row


# ---------------------------------------------------------------- of a case


TOUCHING = 0.05
"""Gap between a particle and an opening, over its radius, at which it leaves: before the wall pushes it back [-]."""

_FED = 2
"""Random numbers of the feeds; others use the seed alone, or with other numbers."""

LANDED = Field(
    "landed", role="memory", initial=1.0, dtype=np.int8, meaning="1, or 0 before the first contact of a fed particle"
)
"""Declared on the particles of a run with feeds."""

ENTERED = Field(
    "entered", "s", role="memory", initial=math.nan,
    meaning="time at which a particle entered; NaN of those that were there before the first feed",
)  # fmt: skip
"""Declared on the particles of a run with outlets; without feeds, those of the start count from 0."""


def _drained(case: Case) -> bool:
    """Whether particles leave during a run."""
    return bool(case.outlet or case.drains)


class Feeds(CaseFeature):
    """Feeds and outlets of a case. A particle that enters replaces fluid of its own volume, or leaves room for it."""

    name = "feeds and outlets"
    measures = (
        Measured("fed_count", "1", "recorded", "number of particles that feeds have inserted so far",
                 lambda feeds, _: feeds.fed, lambda case: case.feed),
        Measured("waiting_count", "1", "recorded",
                 "number of particles that are due, and wait for a free place in the box of a feed",
                 lambda feeds, _: feeds.waiting, lambda case: case.feed),
        Measured("removed_count", "1", "recorded", "number of particles that outlets have removed so far",
                 lambda feeds, _: feeds.removed[0], _drained),
        Measured("removed_mass", "kg", "recorded", "mass of the particles that outlets have removed so far",
                 lambda feeds, _: feeds.removed[1], _drained),
        Measured("residence_time", "s", "recorded",
                 "mean residence time of the particles that outlets have removed so far; with feeds, of fed ones",
                 lambda feeds, _: feeds.of_residence_times[0], _drained),
        Measured("residence_time_deviation", "s", "recorded", "standard deviation of these residence times",
                 lambda feeds, _: feeds.of_residence_times[1], _drained),
        Measured("residence_time_10", "s", "recorded",
                 "residence time that a tenth of these particles have not reached",
                 lambda feeds, _: feeds.of_residence_times[2], _drained),
        Measured("residence_time_50", "s", "recorded",
                 "residence time that half of these particles have not reached",
                 lambda feeds, _: feeds.of_residence_times[3], _drained),
        Measured("residence_time_90", "s", "recorded",
                 "residence time that nine tenths of these particles have not reached",
                 lambda feeds, _: feeds.of_residence_times[4], _drained),
    )  # fmt: skip

    def __init__(self, case: Case, simulation: Any) -> None:
        self.feeds = [_feed(case, table, number) for number, table in enumerate(case.feed)]
        self.outlets: dict[str, ParticleOutlet] = {
            f"outlet.{number}": ParticleOutlet(box.corner, tuple(np.add(box.corner, box.size)), inside=True)
            for number, box in enumerate(case.outlet)
        }
        self._openings = {f"patch.{name}": Opening(case, patch) for name, patch in case.drains.items()}
        self.outlets |= self._openings
        self._summary: tuple[int, tuple[float, ...]] = (-1, ())  # number that left, and what their times gave

    @classmethod
    def is_in(cls, case: Case) -> bool:
        """Whether the case has a feed, an outlet, or an opening through which particles leave."""
        return bool(case.feed) or _drained(case)

    @classmethod
    def fields_of(cls, case: Case) -> tuple[Field, ...]:
        """What the particles of a case with feeds or outlets remember."""
        entered = ENTERED if case.feed else replace(ENTERED, initial=0.0)
        return ((LANDED,) if case.feed else ()) + ((entered,) if _drained(case) else ())

    def before(self, simulation: Any, step: float) -> None:
        """Note the step, over which particles must not bounce off an opening [s]."""
        for opening in self._openings.values():
            opening.step = step

    def after(self, simulation: Any) -> None:
        """Insert the particles that are due, and remove those that have left."""
        with simulation.exchange() as solver:
            self._exchange(solver)

    def _exchange(self, solver: ParticleSolver) -> None:
        """Let particles enter and leave."""
        if self.feeds:
            _note_landings(solver)
        for feed in self.feeds:
            feed(solver)
        if self.outlets and self.feeds:
            entered = solver.particles[ENTERED.name]
            entered[np.isinf(entered)] = solver.time
        for name, outlet in self.outlets.items():
            if solver.communicator.all(outlet.takes(solver.particles.without_ghosts())):
                raise RunFailed(
                    f"t = {solver.time:.6g} s: the last particles have reached {name}, and a run needs at "
                    "least one; end it earlier with run.until, or feed more"
                )
            outlet(solver)

    @property
    def fed(self) -> int:
        """Number of particles that have entered."""
        return sum(feed.entered for feed in self.feeds)

    @property
    def waiting(self) -> int:
        """Number of particles that are due, and found no free place so far."""
        return sum(len(feed.waiting) for feed in self.feeds)

    @property
    def residence_times(self) -> np.ndarray:
        """How long each particle that has left was there, where this is known (n,) [s]."""
        return np.concatenate([np.zeros(0), *(outlet.times for outlet in self.outlets.values())])

    @property
    def of_residence_times(self) -> tuple[float, ...]:
        """Mean, standard deviation, 10, 50 and 90 % quantile of the residence times; NaN before any is known [s]."""
        if (count := self.removed[0]) != self._summary[0]:
            times, numbers = self.residence_times, [math.nan] * 5
            if len(times):  # local: every rank has all times
                quantiles = np.quantile(times, (0.1, 0.5, 0.9))
                numbers = [float(number) for number in (np.mean(times), np.std(times), *quantiles)]
            self._summary = count, tuple(numbers)
        return self._summary[1]

    @property
    def removed(self) -> tuple[int, float]:
        """Number and mass of the particles that have left [-], [kg]."""
        outlets = self.outlets.values()
        return sum(outlet.left for outlet in outlets), sum(outlet.mass for outlet in outlets)

    def checkpoint(self) -> dict[str, Any]:
        """What feeds and outlets have done so far."""
        return {name: device.checkpoint() for name, device in self._by_name()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()` of the same case."""
        for name, device in self._by_name():
            device.restore(state[name])
        self._summary = (-1, ())

    def _by_name(self) -> Iterator[tuple[str, Feed | ParticleOutlet]]:
        """All feeds and outlets by name."""
        yield from ((f"feed_{number}", feed) for number, feed in enumerate(self.feeds))
        yield from ((name.replace(".", "_"), outlet) for name, outlet in self.outlets.items())


class Opening(ParticleOutlet):
    """Removes and counts the particles that touch the wall within a patch, or would within another step.

    case   with the vessel or column
    patch  through which they leave
    step   until the next call, about [s]
    """

    step = 0.0

    def __init__(self, case: Case, patch: CasePatch) -> None:
        super().__init__()
        self._case, self._patch, (self._axis, high) = case, patch, PLANES[patch.side]
        self._outward, self._middle = 1.0 if high else -1.0, 0.5 * case.column.size[self._axis]
        self._to_wall = self._middle  # of a flat one
        self._flat = patch not in case.openings or not case.vessel or bool(case.vessel.size)
        if patch in case.openings and case.vessel and self._flat:
            self._to_wall = float(case.vessel.plan_in(case.column)[:, self._axis].max()) - self._middle

    def takes(self, particles: Particles) -> np.ndarray:
        """Which particles touch the wall, now or at their velocity within a step, and lie within the outline of the
        patch as a whole (N,) bool."""
        at, radius, (first, second) = particles.position, particles.radius, along(self._patch.side)
        inside = self._patch.holds(at[:, first], at[:, second], middle_of(self._case, self._patch.side), radius)
        outward, reach = self._outward * (at[:, self._axis] - self._middle), (1.0 + TOUCHING) * radius
        ahead = at + self.step * particles.velocity
        if self._flat:
            soon = self._outward * (ahead[:, self._axis] - self._middle) + radius
            return np.asarray(inside & (np.maximum(outward + reach, soon) >= self._to_wall))
        beyond = np.maximum(self._case.beyond_the_side(at, reach), self._case.beyond_the_side(ahead, radius))
        return np.asarray(inside & (outward > 0.0) & (beyond >= 0.0))


def _feed(case: Case, table: CaseFeed, number: int) -> Feed:
    """A feed of a case."""
    species = fed_species(case, table)
    middle = table.corner[2] + 0.5 * table.size[2]
    return Feed(
        feed_rate(case, table),
        table.corner,
        table.size,
        partial(diameters_of, species),
        case.material_of(species).density,
        velocity=table.velocity,
        material=list(case.material).index(case.material_name_of(species)),
        viscosity=float(case.around.viscosity_at(np.array([middle]))[0]),
        seed=(case.bed.seed, number, _FED),
        begin=table.begin,
        end=math.inf if table.end is None else table.end,
        finish=_fresh(case, table),
    )


def _fresh(case: Case, table: CaseFeed) -> Callable[[Particles], None]:
    """Declares the species of new particles, that they have not landed, and where it counts that they enter now."""

    def declare(fresh: Particles) -> None:
        fresh.declare(LANDED, np.zeros(fresh.count, np.int8))
        if _drained(case):
            fresh.declare(ENTERED, np.full(fresh.count, math.inf))
        if table.species:
            fresh.declare(SPECIES, np.full(fresh.count, list(case.species).index(table.species), np.int32))

    return declare


def _note_landings(solver: ParticleSolver) -> None:
    """Mark the particles that are in contact with another one or with a wall."""
    edges, landed = solver.edges, solver.particles.landed
    touching = (edges.force != 0.0).any(axis=1)  # local: components of a row
    landed[edges.first[touching]] = 1
    pairs = touching[: edges.between_particles]
    landed[edges.second[: edges.between_particles][pairs]] = 1
