"""Feeds and outlets of a case: particles that enter and leave during a run, through boxes and openings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cfddem.backend.errors import RunFailed
from cfddem.case.bed import CaseFeed
from cfddem.case.feeds import fed_species, feed_rate
from cfddem.case.particle_properties import SPECIES, diameters_of
from cfddem.case.patches import PLANES, CasePatch, along, middle_of
from cfddem.case.schema import Case
from cfddem.features.case_feature import CaseFeature, Measured
from cfddem.model.fields import Field
from cfddem.particles.feeding import Feed, ParticleOutlet
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles

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
