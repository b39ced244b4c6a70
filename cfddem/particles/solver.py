"""The particle solver: particles, walls and laws, advanced in time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import specialise
from cfddem.backend.stopwatch import Stopwatch
from cfddem.particles.bricks import Bricks
from cfddem.particles.collision_events import COLLISION, collision_row
from cfddem.particles.collision_events import FIELDS as RECORD_FIELDS
from cfddem.particles.collision_record import CollisionRecord
from cfddem.particles.energy_count import Energies
from cfddem.particles.ghosts import StepsWithGhosts
from cfddem.particles.guard import guard
from cfddem.particles.integrate import integrate
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.interactions.pair_loops import PIECE, PLACES, PackedFields, loop_choices
from cfddem.particles.listing import NeighbourLists, named_state, restored_list
from cfddem.particles.pair_graph import Edges, gaps, shifts
from cfddem.particles.particle_feature import ParticleFeature
from cfddem.particles.state import Particles
from cfddem.particles.system import System
from cfddem.particles.time_scales import TimeScales, check_step, refusing, time_scales
from cfddem.particles.vectors import flat
from cfddem.particles.walls.arrays import check_walls, checkpoint_walls, restored_walls, wall_arrays
from cfddem.particles.walls.mesh_contacts import pairs_at_walls, wall_contacts
from cfddem.particles.walls.wall import Wall

CHECK_EVERY = 20
"""The time step is checked again at every this many neighbour lists."""

_NO_ROWS = np.zeros(0, COLLISION)
_NO_LOOP: Any = None

Kind = TypeVar("Kind", bound=ParticleFeature)


def _no_rows(pairs: int) -> np.ndarray:
    """No room for collisions: none is recorded."""
    return _NO_ROWS


@dataclass(frozen=True)
class SolverSettings:
    """How particles are advanced, and what is recorded.

    free         1 along axes along which positions may change, else 0
    domain       opposite corners of the region that no centre may leave; unlimited if not given [m]
    skin         allowance of the neighbour list; tuned during the run if not given [m]
    sort_every   sort particles by position at every this many lists, from 1000 particles on
    record       record collisions, in `collisions`
    energies     count energy by channel, in `energies`; slows the run down
    check_steps  refuse time steps above the stability limit
    after        an earlier run over the same particles and walls, whose pair memory is taken over
    gpu          make the steps on a graphics processor; contacts and films, not bridges
    """

    free: tuple[float, float, float] = (1.0, 1.0, 1.0)
    domain: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    skin: float | None = None
    sort_every: int = 5
    record: bool = False
    energies: bool = False
    check_steps: bool = True
    after: ParticleSolver | None = None
    gpu: bool = False


@dataclass(frozen=True)
class Sharing:
    """How ranks share the particles.

    communicator  path to sums, extremes and decisions over all ranks
    division      of space among the ranks; needed if there are several. All ranks pass all particles, or each its own
    balance       cut it anew when the work becomes unequal
    """

    communicator: Communicator = SERIAL
    division: Bricks | None = None
    balance: bool = False


class ParticleSolver:
    """Particles advanced in time.

    particles  :func:`cfddem.particles.state.make_particles`
    table    pair table, :func:`cfddem.particles.material_pairs.pair_table`
    walls    :class:`cfddem.particles.walls.shapes.Plane`, `Box`, `Cylinder`, `Cone`, and `meshes.Mesh`
    laws     laws between two particles and between particles and walls
    gravity  [m/s2]
    box      length of the periodic box, which begins at 0; None along open axes [m]
    settings  how they are advanced, and what is recorded
    sharing  how ranks share them
    """

    system: System

    def __init__(
        self,
        particles: Particles,
        table: np.ndarray,
        *,
        walls: Sequence[Wall] = (),
        laws: Laws | None = None,
        gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        box: tuple[float | None, float | None, float | None] = (None, None, None),
        settings: SolverSettings = SolverSettings(),
        sharing: Sharing = Sharing(),
    ) -> None:
        self.table, record = table, settings.record
        self.communicator = communicator = sharing.communicator
        self.walls = wall_arrays(walls)
        self.laws = laws or Laws()
        self.laws.check()
        if settings.energies:
            Energies.check(self.laws)
        recorded = (*RECORD_FIELDS, *self.laws.bridges.collision_memory) if record else ()
        self.pair_fields = [*self.laws.fields(), *recorded]
        kept_apart = self.laws.kept_apart | {field.name for field in recorded}
        triangles = len(self.walls.cell_member) > 0
        choices = self.laws.choices() | {"TRIANGLES": triangles, "RECORD": record}
        self.parameters = self.laws.parameters(gravity, settings.free)
        packed = PackedFields(self.laws.contact_fields, [field for field in self.pair_fields if field.name in PLACES])
        self.choices: Mapping[str, Any] = choices | loop_choices(
            self.pair_fields, packed, choices, kept_apart, self.parameters
        )
        self._packed = packed.room()
        self._loop, self._threads, self.film_counts = _NO_LOOP, False, np.zeros(4)
        self._touch_walls = specialise(wall_contacts, self.choices)
        self.free = settings.free
        self.domain = None if settings.domain is None else np.array(settings.domain, float)
        self._checking, self._accepted = settings.check_steps, 0.0
        self._next_id = communicator.largest(particles.id, default=-1) + 1
        self.box = np.array([np.inf if length is None else length for length in box])
        check_walls(walls, self.box, len(table))
        self.time, self.steps, self.held = 0.0, 0, False
        self.last_step = 0.0  # [s]
        self.features: list[ParticleFeature] = [Bridges(self, self.laws.bridge)] if self.laws.bridge else []
        self._rows_for: Callable[[int], np.ndarray] = _no_rows
        if record:
            kept = CollisionRecord(dtype=collision_row(self.laws.bridges.collision_fields), communicator=communicator)
            self._rows_for = kept.room
            self.features.append(kept)
        self.timers = Stopwatch()
        self.lists = NeighbourLists(
            self.pair_fields, table, self.box, communicator=communicator, division=sharing.division,
            balance=sharing.balance, skin=settings.skin, sort_every=settings.sort_every,
        )  # fmt: skip
        self._on_gpu = settings.gpu
        if settings.gpu:
            self._loop = self._steps_on_gpu(settings.energies)
            self.lists.listing_cost = self._loop.listing_cost
        for field in self.laws.particle_fields():
            particles.declare(field)
        self.particles = self.lists.own(particles)
        self._reach = self._find_reach()  # of the list, over R* [-]
        self._take_list(self.lists.first(self.particles, self.walls, self._reach, settings.after, self.laws))
        self._outside = 0
        self.refresh()
        self.features += [Energies(self)] if settings.energies else []

    def find(self, kind: type[Kind]) -> Kind | None:
        """The feature of a kind; None if this run has none."""
        return next((feature for feature in self.features if isinstance(feature, kind)), None)

    def feature(self, kind: type[Kind]) -> Kind:
        """The feature of a kind, such as `Bridges`; InputError if this run has none."""
        if feature := self.find(kind):
            return feature
        raise InputError(kind.name, None, "a particle solver that has them", "see its laws, and SolverSettings")

    @property
    def bridges(self) -> Bridges | None:
        """The liquid bridges; None where particles carry no liquid."""
        return self.find(Bridges)

    @property
    def bridge_count(self) -> int:
        """Number of liquid bridges."""
        return self.bridges.count if self.bridges else 0

    @property
    def collisions(self) -> CollisionRecord | None:
        """The record of collisions, with `record`."""
        return self.find(CollisionRecord)

    @property
    def energies(self) -> Energies | None:
        """The energy account, with `energies`."""
        return self.find(Energies)

    def _find_reach(self, after: Particles | None = None) -> float:
        """Reach that the next list must have; `after` a change to these particles."""
        reach = self.laws.cutoff_ratio if self.laws.film else 0.0
        return max(reach, *(feature.reach_ratio(self, after) for feature in self.features), 0.0)

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Gravity [m/s2]; a new value acts from the next forces on."""
        return self.parameters.gravity

    @gravity.setter
    def gravity(self, gravity: tuple[float, float, float]) -> None:
        self.parameters = self.parameters._replace(gravity=self.laws.parameters(gravity).gravity)
        self.system = self.system._replace(parameters=self.parameters)

    @property
    def gap(self) -> np.ndarray:
        """Gap of every listed pair [m]."""
        return gaps(self.edges, self.particles, self.walls, self.box)

    @property
    def outside(self) -> int:
        """Number of uses of a user's law, minimum gap or film, outside of its range."""
        return self._outside + self.edges.uses_outside(self._owned)

    @property
    def largest_film_rate(self) -> float:
        """Largest damping rate of a film now, its resistance over the reduced mass of its pair [1/s]."""
        edges, inverse, pairs = self.edges, self.particles.inverse_mass, self.edges.between_particles
        weight = inverse[edges.first]
        weight[:pairs] += inverse[edges.second[:pairs]]
        return self.communicator.largest(edges.resistance * weight, default=0.0) if self.laws.film else 0.0

    def refresh(self) -> None:
        """Find the forces at the present positions, for instance after a change of state from outside."""
        self._integrate(0.0, 0)

    @property
    def wall_force(self) -> np.ndarray:
        """Force of contacts and of the pull of bridges on each wall, without the impulses of films (walls, 3) [N]."""
        edges, result = self.edges, np.zeros((len(self.walls.sweep), 3))
        at_walls = slice(edges.between_particles, None)
        for name in ("force", "bridge_force"):
            if name in edges:
                np.subtract.at(result, self.walls.wall[edges.second[at_walls]], edges[name][at_walls])
        return result

    def time_scales(self, reference_speed: float = 0.0) -> TimeScales:
        """Largest time steps that the particles allow now.

        reference_speed  expected fastest approach [m/s]
        """
        return time_scales(
            self.particles, self.edges, self.walls, self.gap, self.table, self.laws, reference_speed, self.communicator
        )

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
        self.timers.start()
        if self.held:
            self.steps, self.time = self.steps + steps, self.time + steps * step
            return
        if any(feature.outgrows(self, self._reach) for feature in self.features):  # local: the same on all ranks
            self._relist()
        first, at_once = True, 1 if any(feature.every_step for feature in self.features) else steps  # local: a choice
        while steps > 0:
            if self._checking and step > self._accepted:
                check_step(step, refusing(self.time_scales(), self.laws.film))
                self._accepted = step
            for feature in self.features:
                feature.before(self, step, first)
            done, farthest, noted = self._integrate(step, min(steps, at_once))
            self.last_step = step
            self.timers.lap("pairs and motion")
            steps -= done
            for feature in self.features:
                feature.after(self, step, steps == 0, noted)
                if feature.every_step:
                    self.timers.lap(feature.name)
            first = False
            self.steps += done
            self.time += done * step
            moved_far = not farthest < (0.5 * self.lists.skin) ** 2
            if moved_far or steps == 0:  # no pair can have passed through each other between two lists
                gap = self.gap if moved_far else None
                guard(self.particles, self.edges, gap, self.domain, self.time, step, self.walls.wall, self.communicator)
            if moved_far:
                self._relist()
            self.timers.lap("neighbour lists")

    def hold(self) -> None:
        """Let the particles stay where they are from now on, with the forces between them; `advance` counts time."""
        particles = self.particles
        if self.communicator.any(particles.inverse_mass > 0.0):  # pairs of fixed particles are not listed
            self._relist()
        for name in ("velocity", "spin", "inverse_mass", "inverse_inertia"):
            self.particles[name][...] = 0.0
        self.held = True

    def checkpoint(self) -> dict[str, Any]:
        """Copies of everything that the next step depends on; of several ranks, by ids and in `Portions`."""
        if self.communicator.size > 1:
            state = named_state(self.particles, self.edges, self._origin, self.communicator)
        else:
            kept = self.particles.checkpoint(), self.edges.checkpoint(), self._origin.copy()
            state = dict(zip(("particles", "edges", "origin"), kept))
        outside = self.communicator.sum([self.outside])
        return state | {
            "walls": checkpoint_walls(self.walls),
            "listed_walls": self._listed_walls,
            "features": {feature.name: feature.checkpoint() for feature in self.features},
            "lists": self.lists.checkpoint(),
            "counters": {
                "time": self.time, "steps": self.steps, "accepted": self._accepted, "outside": outside,
                "reach": self._reach,
                "film_steps": self.film_counts[0], "film_iterations": self.film_counts[1],
            },
        }  # fmt: skip

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()` of a solver with the same particles, walls and laws, with the same bits.

        The numbers of ranks then and now may differ.
        """
        walls, listed_walls = state["walls"], state.get("listed_walls", state["walls"])
        self.lists.restore(state["lists"])
        counters = state["counters"]
        self._reach = float(counters["reach"])
        restored = restored_list(state, self.particles, self.edges, self.lists, listed_walls, self._reach)
        self.particles, edges, origin = restored
        self.lists.count(self.particles)
        self.time, self.steps = float(counters["time"]), int(counters["steps"])
        self._next_id = max(self._next_id, self.communicator.largest(self.particles.id, default=-1) + 1)
        self._accepted = float(counters["accepted"])
        self.film_counts[:2] = float(counters["film_steps"]), float(counters["film_iterations"])
        self._outside = int(counters["outside"]) if self.communicator.rank == 0 else 0
        self.walls, touch = restored_walls(walls), edges.touch.copy()
        self._take_list(edges)
        self._origin[:], self._listed_walls = origin, listed_walls
        self.walls.travel[:], self.edges.touch[:] = walls["travel"], touch
        for feature in self.features:
            feature.restore(state["features"][feature.name])

    def _integrate(self, step: float, steps: int) -> tuple[int, float, int]:
        return self._loop_in_use()(  # type: ignore[no-any-return]
            self.system, step, steps, self._origin.reshape(-1), 0.5 * self.lists.skin, self.time,
            self._rows_for(len(self.edges.first)),
        )  # fmt: skip

    def _loop_in_use(self) -> Any:
        """The loop for the processor and the threads in use."""
        threads = self.lists.many and use_threads(None) > 1  # one thread gains nothing from loops for all
        if not self._on_gpu and (self._loop is _NO_LOOP or self._threads != threads):
            self._threads, self._loop = threads, specialise(integrate, self.choices, threads)
            if self.communicator.size > 1:
                self._loop = StepsWithGhosts(self.choices, self._threads, self.lists.ghosts, self.communicator)
        return self._loop

    def _steps_on_gpu(self, energies: bool) -> Any:
        from cfddem.particles.on_gpu import StepsOnGpu

        return StepsOnGpu(self.choices, energies=energies, ranks=self.communicator.size)

    def _take_list(self, edges: Edges) -> None:
        """Use a new neighbour list: note the positions it was made at, and make the arrays that loops take."""
        self.edges, self._owned = edges, self.particles.owned
        for feature in self.features:
            self.walls = feature.with_room(self.walls, edges)
        pieces = -(-edges.between_particles // PIECE)
        packed = self._packed._replace(wait=np.ones(pieces, np.uint8))
        self._origin: np.ndarray = self.particles.position.copy()
        self._listed_walls = checkpoint_walls(self.walls)
        self.system = System(
            self.particles.view_with(self.laws.particle_fields()), edges.flat_graph, edges.memory, flat(self.walls),
            shifts(self.box).reshape(-1), self.table, self.parameters, self.film_counts, packed,
        )  # fmt: skip
        self.walls.travel[:] = 0.0
        if len(self.walls.kind):
            self._touch_walls(pairs_at_walls.py_func(self.system), self._reach)

    def _relist(self) -> None:
        """Make a new neighbour list; memory and present forces of pairs are carried over."""
        self._reach = self._find_reach()
        self.particles.drop_ghosts()
        self._renew(np.arange(self.particles.count, dtype=np.int32), self.steps)
        if self.lists.made % CHECK_EVERY == 0:
            self._accepted = 0.0

    def _renew(self, old_row: np.ndarray, steps: int | None = None) -> None:
        """Make a new neighbour list; arguments as of `NeighbourLists.renewed`."""
        self._outside += self.edges.uses_outside(self._owned)
        fresh = self.lists.renewed(self.particles, self.walls, self._reach, old_row, self.edges, steps=steps)
        self._take_list(fresh)

    def insert(self, fresh: Particles) -> np.ndarray:
        """Insert particles, which must not overlap others; `particles` is a new object afterwards.

        fresh    :func:`cfddem.particles.state.make_particles`; they get new ids
        returns  the new ids (n,)
        """
        ids = self._next_id + np.arange(fresh.count, dtype=np.int64)
        self._next_id += fresh.count
        fresh, count = fresh.copy(), self.particles.owned
        fresh.id[:] = ids
        joined = self.particles.copy(slice(count))
        added = joined.append(self.lists.own(fresh))
        for feature in self.features:
            feature.inserted(self, joined, added)
        self._exchange(joined, np.append(np.arange(count), np.full(len(added), -1)))
        return ids

    def remove(self, gone: np.ndarray) -> Particles:
        """Remove particles; `particles` is a new object afterwards.

        gone     (N,) bool, which rows of `particles`; ghosts are left out
        returns  the removed particles
        """
        gone = np.asarray(gone, bool)[: self.particles.owned]
        number = self.communicator.count(gone)
        if self.communicator.all(gone):
            raise InputError("gone", number, f"fewer than all {number} particles")
        for feature in self.features:
            feature.removing(self, gone)
        taken: Particles = self.particles.copy(np.flatnonzero(gone))
        if number:
            stay = np.flatnonzero(~gone)
            self._exchange(self.particles.copy(stay), stay)
        return taken

    def _exchange(self, particles: Particles, old_row: np.ndarray) -> None:
        """Continue with other particles; the memory of a pair is kept if both its particles remain.

        old_row  row of each before; -1 for an inserted particle
        """
        for feature in self.features:
            feature.before_exchange(self)
        self._reach = self._find_reach(particles)
        self.particles = particles
        self.lists.count(particles)
        self._renew(old_row.astype(np.int32))
        self._accepted, self.lists.listed_at = 0.0, self.steps
        springs = self.edges.spring.copy()
        self.refresh()
        self.edges.spring[:] = springs  # no time has passed in which contacts could slide
        for feature in self.features:
            feature.after_exchange(self)
