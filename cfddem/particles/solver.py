"""The particle solver: particles, walls and laws, advanced in time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.backend.law_set import specialise
from cfddem.backend.stopwatch import Stopwatch
from cfddem.particles.collision_events import COLLISION
from cfddem.particles.collision_events import FIELDS as RECORD_FIELDS
from cfddem.particles.collision_record import CollisionRecord
from cfddem.particles.guard import guard
from cfddem.particles.integrate import integrate
from cfddem.particles.interactions.bridge import Bridges
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.interactions.pair_loops import loop_choices
from cfddem.particles.neighbours import list_edges, locality_order, wrap
from cfddem.particles.pair_graph import Edges, Graph, gaps, shifts, wall_forces
from cfddem.particles.skin import FIRST_SKIN, tuned
from cfddem.particles.state import Particles
from cfddem.particles.time_scales import TimeScales, check_step, time_scales
from cfddem.particles.vectors import flat
from cfddem.particles.walls.arrays import assemble, check_walls
from cfddem.particles.walls.mesh_contacts import wall_contacts
from cfddem.particles.walls.nearest_point import Walls
from cfddem.particles.walls.shapes import Wall
from cfddem.particles.work import Energies

THREADING_PAYS = 1000
"""Number of particles from which loops run on all threads."""

CHECK_EVERY = 20
"""The time step is checked again at every this many neighbour lists."""

_NO_ROWS = np.zeros(0, COLLISION)
_NO_LOOP: Any = None


class ParticleSolver:
    """Particles advanced in time.

    particles  :func:`cfddem.particles.state.make_particles`
    table    pair table, :func:`cfddem.particles.material_pairs.pair_table`
    walls    :class:`cfddem.particles.walls.shapes.Plane`, `Box`, `Cylinder`, `Cone`, `Mesh`
    laws     laws between two particles and between particles and walls
    gravity  [m/s2]
    free     1 along axes along which positions may change, else 0
    box      length of the periodic box, which begins at 0; None along open axes [m]
    domain   opposite corners of the region that no centre may leave; unlimited if not given [m]
    skin     allowance of the neighbour list; tuned during the run if not given [m]
    sort_every  sort particles by position at every this many lists, from 1000 particles on
    record   record collisions, in `collisions`
    bridges  liquid bridges between the particles, :class:`cfddem.particles.interactions.bridge.Bridges`
    energies  count energy by channel, in `energies`; slows the run down
    check_steps  refuse time steps above the stability limit
    after    an earlier run over the same particles and walls, whose pair memory is taken over
    """

    def __init__(
        self,
        particles: Particles,
        table: np.ndarray,
        *,
        walls: Sequence[Wall] = (),
        laws: Laws | None = None,
        gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        free: tuple[float, float, float] = (1.0, 1.0, 1.0),
        box: tuple[float | None, float | None, float | None] = (None, None, None),
        domain: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None,
        skin: float | None = None,
        sort_every: int = 5,
        record: bool = False,
        bridges: Bridges | None = None,
        energies: bool = False,
        check_steps: bool = True,
        after: ParticleSolver | None = None,
    ) -> None:
        self.particles = particles
        self.table = table
        self.walls = assemble(walls)
        self.laws = laws or Laws()
        self.laws.check()
        if energies and bridges is not None:
            raise InputError("energies", True, "false with liquid bridges", "what these do is not counted")
        self.pair_fields = [*self.laws.fields(), *(RECORD_FIELDS if record else ())]
        kept_apart = {field.name for field in RECORD_FIELDS}
        choices = self.laws.choices() | {"WALLS": bool(walls), "RECORD": record}
        self.choices = choices | loop_choices(self.pair_fields, choices, kept_apart)
        self._parameters, self._loop, self._threads = self.laws.parameters, _NO_LOOP, False
        self.gravity, self.free = gravity, free
        self._skin_is_given = skin is not None
        self.skin = FIRST_SKIN[self._many] * float(particles.radius.mean()) if skin is None else skin
        self.domain = None if domain is None else np.array(domain, float)
        self.sort_every = sort_every
        self._lists, self._listed_at = -1, 0
        self._checking, self._accepted = check_steps, 0.0
        self._next_id = int(particles.id.max(initial=-1)) + 1
        self.box = np.array([np.inf if length is None else length for length in box])
        check_walls(walls, self.box, len(table))
        self.time, self.steps = 0.0, 0
        self._outside = 0
        self.collisions = CollisionRecord() if record else None
        self.bridges = bridges
        self.wall = Stopwatch()
        wrap(self.particles.position, self.box)
        self._next_order()
        fresh = self._listed()
        if after is not None:
            self._recall(after, fresh)
        self._take_list(fresh)
        self.refresh()
        if bridges is not None:
            bridges.update(self._views[1], self.box)
        self.energies = Energies(self) if energies else None

    @property
    def views(self) -> tuple[Any, Graph, Any, Walls, np.ndarray]:
        """Particles, graph, memory of pairs and walls as compiled loops take them, and shifts of periodic images."""
        return self._views

    @property
    def _many(self) -> bool:
        return self.particles.count >= THREADING_PAYS

    @property
    def _reach_ratio(self) -> float:
        reach = self.laws.cutoff_ratio if self.laws.film else 0.0
        return reach if self.bridges is None else max(reach, self.bridges.reach_ratio)

    @property
    def gap(self) -> np.ndarray:
        """Gap of every listed pair [m]."""
        return gaps(self.edges, self.particles, self.walls, self.box)

    @property
    def outside(self) -> int:
        """Number of uses of a user's law, minimum gap or film, outside of its range."""
        return self._outside + self.edges.uses_outside

    def refresh(self) -> None:
        """Find the forces at the present positions, for instance after a change of state from outside."""
        self._integrate(0.0, 0)

    @property
    def wall_force(self) -> np.ndarray:
        """Contact force of all particles on each wall (walls, 3) [N]; without the impulses of films."""
        return wall_forces(self.edges, self.walls)

    def time_scales(self, reference_speed: float = 0.0) -> TimeScales:
        """Largest time steps that the particles allow now.

        reference_speed  expected fastest approach [m/s]
        """
        return time_scales(self.particles, self.edges, self.walls, self.gap, self.table, self.laws, reference_speed)

    def _limits(self) -> TimeScales:
        """Time scales by which a step is refused; with films only existing contacts, as films may stop an approach."""
        read = self.time_scales()
        return replace(read, impact=math.inf, film=math.inf, crossing=math.inf) if self.laws.film else read

    def recommended_step(self, reference_speed: float = 0.0) -> float:
        """Recommended time step: 2 % of the Hertz time, less where stability requires it [s].

        reference_speed  expected fastest approach [m/s]
        """
        return self.time_scales(reference_speed).recommended

    def advance(self, step: float, steps: int = 1) -> None:
        """Advance by a number of equal time steps.

        step   [s]
        steps  number of steps

        Raises UnstableStep if the step is above the stability limit of contacts, and RunFailed, with the particle, if
        a position is NaN, or a particle has left the domain or was pressed through another body.
        """
        if self.bridges is None:
            self._advance(step, steps)
            return
        while steps > 0:
            several = min(self.bridges.laws.every, steps)
            self.bridges.kick(self.box, 0.5 * several * step, backwards=False)
            self._advance(step, several)
            self.bridges.update(self._views[1], self.box)
            self.bridges.kick(self.box, 0.5 * several * step, backwards=True)
            self.wall.lap("liquid bridges")
            steps -= several

    def _advance(self, step: float, steps: int) -> None:
        """Advance by a number of steps without bridges."""
        self.wall.start()
        counting, first = self.energies, True
        while steps > 0:
            if self._checking and step > self._accepted:
                check_step(step, self._limits())
                self._accepted = step
            if counting is not None:
                counting.before(self, step, first)
            done, farthest, noted = self._integrate(step, steps if counting is None else 1)
            self.wall.lap("pairs and motion")
            steps -= done
            if counting is not None:
                counting.after(self, step, steps == 0)
                self.wall.lap("energies")
            first = False
            if self.collisions is not None:
                self.collisions.keep(noted)
            self.steps += done
            self.time += done * step
            moved_far = not farthest < (0.5 * self.skin) ** 2
            if moved_far or steps == 0:  # no pair can have passed through each other between two lists
                gap = self.gap if moved_far else None
                guard(self.particles, self.edges, gap, self.domain, self.time, step, self.walls.wall)
            if moved_far:
                self._relist()
            self.wall.lap("neighbour lists")

    def checkpoint(self) -> dict[str, Any]:
        """Copies of everything that the next step depends on, including age and order of the neighbour list."""
        counted = {} if self.energies is None else {"energies": self.energies.checkpoint()}
        return {
            **counted,
            "particles": self.particles.checkpoint(),
            "edges": self.edges.checkpoint(),
            "walls": _copied(self.walls),
            **({} if self.bridges is None else {"bridges": self.bridges.checkpoint()}),
            "origin": self._origin.copy(),
            "counters": {
                "time": self.time, "steps": self.steps, "skin": self.skin,
                "lists": self._lists, "listed_at": self._listed_at, "accepted": self._accepted,
                "outside": self._outside,
            },
        }  # fmt: skip

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()` of a solver with the same particles, walls and laws, with the same bits."""
        self.particles.restore(state["particles"])
        walls = dict(zip(self.walls._fields, self.walls)) | state["walls"]
        self.walls = type(self.walls)(**{name: np.array(each) for name, each in walls.items()})
        counters = state["counters"]
        self.time, self.steps, self.skin = float(counters["time"]), int(counters["steps"]), float(counters["skin"])
        self._next_id = max(self._next_id, int(self.particles.id.max()) + 1)
        self._lists, self._listed_at = int(counters["lists"]), int(counters["listed_at"])
        self._accepted, self._outside = float(counters.get("accepted", 0.0)), int(counters.get("outside", 0))
        travel = self.walls.travel.copy()
        if self.bridges is not None:
            self.bridges.restore(state["bridges"])
        self._take_list(self.edges.restored(state["edges"]))
        self._origin[:] = state["origin"]
        self.walls.travel[:] = travel
        self.edges.touch[:] = state["edges"]["touch"]
        if self.energies is not None:
            self.energies.restore(state["energies"])

    def _integrate(self, step: float, steps: int) -> tuple[int, float, int]:
        if self._loop is _NO_LOOP or self._threads != self._many:
            self._threads = self._many
            self._loop = specialise(integrate, self.choices, self._threads)
        log = _NO_ROWS if self.collisions is None else self.collisions.room(len(self.edges.first))
        cutoff_ratio = self.laws.cutoff_ratio if self.laws.film else 0.0
        return self._loop(  # type: ignore[no-any-return]
            *self._views, self.table, cutoff_ratio, self._parameters, self.free, self.gravity, step, steps,
            self._origin.reshape(-1), 0.5 * self.skin, self.time, log,
        )  # fmt: skip

    def _take_list(self, edges: Edges) -> None:
        """Use a new neighbour list: note the positions it was made at, and make the arrays that loops take."""
        self.edges = edges
        self._origin = self.particles.position.copy()
        self._views = (
            self.particles.view, edges.flat_graph, edges.memory, flat(self.walls), shifts(self.box).reshape(-1),
        )  # fmt: skip
        self.walls.travel[:] = 0.0
        if self.bridges is not None:
            self.bridges.take(self.particles)
        if len(self.walls.kind):
            particles, graph, memory, walls, _ = self._views
            wall_contacts(particles, graph, memory.minimum_gap, walls, self.free, self._reach_ratio)

    def _listed(self) -> Edges:
        roughness = float(self.table["roughness_gap"].max())
        return list_edges(
            self.particles, self.walls, self._reach_ratio, self.skin, self.box, self.pair_fields, roughness
        )

    def _relist(self) -> None:
        """Make a new neighbour list; memory and present forces of pairs are carried over."""
        wrap(self.particles.position, self.box)
        old, order = self.edges, self._next_order()
        del self.edges, self._views
        self._tune_skin()
        fresh = self._listed()
        fresh.remember(old, order, _inverse(order))
        self._outside += old.uses_outside
        del old
        self._take_list(fresh)
        if self._lists % CHECK_EVERY == 0:
            self._accepted = 0.0

    def insert(self, fresh: Particles) -> np.ndarray:
        """Insert particles, which must not overlap others; `particles` is a new object afterwards.

        fresh    :func:`cfddem.particles.state.make_particles`; they get new ids
        returns  the new ids (n,)
        """
        count = self.particles.count
        ids = self._next_id + np.arange(fresh.count, dtype=np.int64)
        self._next_id += fresh.count
        joined, fresh = self.particles.copy(), fresh.copy()
        fresh.id[:] = ids
        joined.append(fresh)
        self._exchange(joined, np.append(np.arange(count), np.full(fresh.count, count)))
        return ids

    def remove(self, gone: np.ndarray) -> Particles:
        """Remove particles; `particles` is a new object afterwards.

        gone     (N,) bool, which rows of `particles`
        returns  the removed particles
        """
        gone = np.asarray(gone, bool)
        if gone.all():
            raise InputError("gone", int(gone.sum()), f"fewer than all {self.particles.count} particles")
        if self.bridges is not None:
            self.bridges.release(gone)
        taken: Particles = self.particles.copy(gone)
        if gone.any():
            self._exchange(self.particles.copy(~gone), np.flatnonzero(~gone))
        return taken

    def _exchange(self, made: Particles, order: np.ndarray) -> None:
        """Continue with other particles; the memory of a pair is kept if both its particles remain.

        order  old row of each new one; the number of old rows for an inserted particle
        """
        count, counting = self.particles.count, self.energies
        had = 0.0 if counting is None else counting.mechanical(self)
        old, start = self.edges, np.append(self.edges.start, self.edges.start[-1])
        place = np.full(count + 1, -1, np.int32)
        place[order] = np.arange(len(order), dtype=np.int32)
        self.particles = made
        if self.bridges is not None:
            self.bridges.take(made)
        wrap(made.position, self.box)
        fresh = self._listed()
        fresh.remember(old, order.astype(np.int32), place, start)
        self._outside += old.uses_outside
        self._take_list(fresh)
        self._accepted, self._listed_at = 0.0, self.steps
        springs = fresh.spring.copy()
        self.refresh()
        fresh.spring[:] = springs  # no time has passed in which contacts could slide
        if counting is not None:
            counting.fed += counting.mechanical(self) - had

    def _recall(self, earlier: ParticleSolver, fresh: Edges) -> None:
        """Take over the pair memory of an earlier run."""
        then, now = np.argsort(earlier.particles.id), np.argsort(self.particles.id)
        if not np.array_equal(earlier.particles.id[then], self.particles.id[now]):
            raise InputError("after", None, "a run over the same particles", "ids differ")
        if "resistance" not in earlier.edges and self.laws.film:
            raise InputError("after", None, "a run with films, as this one")
        order = np.empty(len(now), np.int32)
        order[now] = then
        fresh.remember(earlier.edges, order, _inverse(order))

    def _next_order(self) -> np.ndarray:
        """Sort the particles from time to time, so that near particles have near rows; returns the old rows."""
        self._lists += 1
        if not self._many or self._lists % self.sort_every:
            return np.arange(self.particles.count, dtype=np.int32)
        order = locality_order(self.particles.position, 2.0 * float(self.particles.radius.mean()))
        self.particles.reorder(order)
        return order

    def _tune_skin(self) -> None:
        """Choose the skin of the next list from the age of the last one."""
        age, self._listed_at = self.steps - self._listed_at, self.steps
        if self._skin_is_given or age == 0:
            return
        room = 0.5 * float(self.box.min()) - (2.0 + 0.5 * self._reach_ratio) * float(self.particles.radius.max())
        self.skin = tuned(self.skin, age, float(self.particles.radius.mean()), self._many, room)


def _copied(arrays: Any) -> dict[str, Any]:
    """Fields of a named tuple by name; arrays are copied."""
    return {name: each.copy() if isinstance(each, np.ndarray) else each for name, each in arrays._asdict().items()}


def _inverse(order: np.ndarray) -> np.ndarray:
    """New row of each old one."""
    place = np.empty_like(order)
    place[order] = np.arange(len(order), dtype=order.dtype)
    return place
