"""The particle solver: particles, walls and laws put together and moved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cfddem.errors import InputError
from cfddem.particles.bridges import Bridges
from cfddem.particles.clocks import Clocks, check_step, clocks
from cfddem.particles.encounters import ENCOUNTER
from cfddem.particles.energies import Energies
from cfddem.particles.forces import VERLET, Laws
from cfddem.particles.guard import guard
from cfddem.particles.meshes import meet_walls
from cfddem.particles.motion import march, march_threaded
from cfddem.particles.near_walls import assemble, check_walls
from cfddem.particles.neighbours import list_edges, locality_order, wrap
from cfddem.particles.pairs import Edges, gaps, remember, shifts, wall_forces
from cfddem.particles.skin import FIRST_SKIN, tuned
from cfddem.particles.state import Bodies
from cfddem.particles.surfaces import Walls
from cfddem.particles.vectors import flat
from cfddem.particles.walls import Wall
from cfddem.record.collisions import CollisionRecord
from cfddem.stopwatch import Stopwatch

THREADING_PAYS = 1000
"""From this many particles on, loops run on all threads; on one they still work on several pairs at once."""

CHECK_EVERY = 20
"""The time step is looked at again at every so many lists."""

_NO_ROWS, _NO_VECTORS = np.zeros(0, ENCOUNTER), np.zeros((0, 3))


class ParticleSolver:
    """Particles in time.

    bodies   the particles, :func:`cfddem.particles.state.bodies`
    table    pair table, :func:`cfddem.materials.pair_table`
    walls    :class:`cfddem.particles.walls.Plane`, `Box`, `Cylinder`, `Cone`, `Mesh`
    laws     which laws hold between two bodies
    gravity  [m/s2]
    free     1 along axes in which positions may change, 0 where they are held
    box      length of the periodic box, which begins at 0; None along open axes [m]
    domain   corners of the room that no centre may leave; all of space if not given [m]
    skin     allowance of the neighbour list; found and tuned in the run if not given [m]
    sort_every  re-sort many particles by place at every so many lists
    record   keep a record of encounters, in `collisions`
    bridges  liquid bridges between the particles, :class:`cfddem.particles.bridges.Bridges`
    energies  count energy by channel, in `energies`; costs time
    check_steps  refuse time steps above the stability limit
    after    an earlier run over the same particles and walls, whose pairs are remembered
    """

    def __init__(
        self,
        bodies: Bodies,
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
        self.bodies = bodies
        self.table = table
        self.walls = assemble(walls)
        self._walled = True if walls else None
        self.laws = laws or Laws()
        self.laws.check()
        if energies and bridges is not None:
            raise InputError("energies", True, "false with liquid bridges", "what these do is not counted")
        self._loop_laws = self.laws.for_loops()
        self.gravity, self.free = gravity, free
        self._skin_is_given = skin is not None
        self.skin = FIRST_SKIN[self._many] * float(bodies.radius.mean()) if skin is None else skin
        self.domain = None if domain is None else np.array(domain, float)
        self.sort_every = sort_every
        self._lists, self._listed_at = -1, 0
        self._checking, self._accepted = check_steps, 0.0
        self._next_id = int(bodies.id.max(initial=-1)) + 1
        self.box = np.array([np.inf if length is None else length for length in box])
        check_walls(walls, self.box, len(table))
        self.time, self.steps = 0.0, 0
        self._outside = 0
        self.collisions = CollisionRecord() if record else None
        self.bridges = bridges
        self.wall = Stopwatch()
        wrap(self.bodies.position, self.box)
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
    def views(self) -> tuple[Bodies, Edges, Walls, np.ndarray]:
        """Bodies, edges and walls as compiled loops take them, and what to add to separations across borders."""
        return self._views

    @property
    def _many(self) -> bool:
        return self.bodies.count >= THREADING_PAYS

    @property
    def _reach_ratio(self) -> float:
        reach = self.laws.cutoff_ratio if self.laws.film else 0.0
        return reach if self.bridges is None else max(reach, self.bridges.reach_ratio)

    @property
    def gap(self) -> np.ndarray:
        """Gap of every listed pair [m]."""
        return gaps(self.edges, self.bodies, self.walls, self.box)

    @property
    def outside(self) -> int:
        """How often laws of one's own, minimum gap or film, were asked outside of their range."""
        return self._outside + int(self.edges.outside.sum())

    def refresh(self) -> None:
        """Find the forces at the present places, as after a change of state from outside."""
        self._march(0.0, 0)

    @property
    def wall_force(self) -> np.ndarray:
        """Force of all particles on each wall by contact (walls, 3) [N]; the lubricated drift's films apart."""
        return wall_forces(self.edges, self.walls)

    def clocks(self, reference_speed: float = 0.0) -> Clocks:
        """Largest steps that the particles' physics allows now.

        reference_speed  fastest approach to be expected [m/s]
        """
        return clocks(self.bodies, self.edges, self.walls, self.gap, self.table, self.laws, reference_speed)

    def _limits(self) -> Clocks:
        """The clocks by which a step is refused: where films may stop what comes near, only contacts that exist."""
        read = self.clocks()
        return replace(read, impact=math.inf, film=math.inf, crossing=math.inf) if self.laws.film else read

    def recommended_step(self, reference_speed: float = 0.0) -> float:
        """Time step to take: 2 % of the Hertz time, less where stability asks for it [s].

        reference_speed  fastest approach to be expected [m/s]
        """
        return self.clocks(reference_speed).recommended

    def advance(self, step: float, steps: int = 1) -> None:
        """Move by a number of equal time steps.

        step   [s]
        steps  how many

        Raises UnstableStep where the step is above what contacts allow, and RunFailed, naming the particle,
        where one is no number any more, has left or was pressed through.
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
        """Move by a number of steps in which bridges do nothing."""
        self.wall.start()
        counting, first = self.energies, True
        while steps > 0:
            if self._checking and step > self._accepted:
                check_step(step, self._limits())
                self._accepted = step
            if counting is not None:
                counting.before(self, step, first)
            done, farthest, noted = self._march(step, steps if counting is None else 1)
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
                guard(self.bodies, self.edges, gap, self.domain, self.time, step, self.walls.wall)
            if moved_far:
                self._relist()
            self.wall.lap("neighbour lists")

    def checkpoint(self) -> dict[str, Any]:
        """Copies of everything the next step depends on, age and order of the list included."""
        counted = {} if self.energies is None else {"energies": self.energies.checkpoint()}
        return {
            **counted,
            "bodies": _copied(self.bodies),
            "edges": _copied(self.edges),
            "walls": _copied(self.walls),
            **({} if self.bridges is None else {"bridges": self.bridges.checkpoint()}),
            "origin": self._origin.copy(),
            "clock": {
                "time": self.time, "steps": self.steps, "skin": self.skin,
                "lists": self._lists, "listed_at": self._listed_at, "accepted": self._accepted,
                "outside": self._outside,
            },
        }  # fmt: skip

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a `checkpoint()` of a solver made for the same bodies, walls and laws, to the same bits."""
        for own, kept in zip(self.bodies, state["bodies"].values()):
            own[:] = kept
        walls = dict(zip(self.walls._fields, self.walls)) | state["walls"]
        self.walls = type(self.walls)(**{name: np.array(each) for name, each in walls.items()})
        edges: dict[str, Any] = {
            name: np.array(each) if np.ndim(each) else int(each)
            for name, each in ({"outside": self.edges.outside} | state["edges"]).items()
        }
        clock = state["clock"]
        self.time, self.steps, self.skin = float(clock["time"]), int(clock["steps"]), float(clock["skin"])
        self._next_id = max(self._next_id, int(self.bodies.id.max()) + 1)
        self._lists, self._listed_at = int(clock["lists"]), int(clock["listed_at"])
        self._accepted, self._outside = float(clock.get("accepted", 0.0)), int(clock.get("outside", 0))
        travel = self.walls.travel.copy()
        if self.bridges is not None:
            self.bridges.restore(state["bridges"])
        self._take_list(Edges(**edges))
        self._origin[:] = state["origin"]
        self.walls.travel[:] = travel
        self.edges.touch[:] = state["edges"]["touch"]
        if self.energies is not None:
            self.energies.restore(state["energies"])

    def _march(self, step: float, steps: int) -> tuple[int, float, int]:
        record, large = self.collisions, self._many
        films, verlet = bool(self.laws.film), self.laws.integrator == VERLET

        def compiled(there: bool) -> bool | None:
            """Many particles run in a loop compiled for what there is, few in one for all that may be."""
            return True if there or not large else None

        laws = self._loop_laws.without_the_absent() if large else self._loop_laws
        log = _NO_ROWS if record is None else record.room(len(self.edges.first))
        return (march_threaded if large else march)(  # type: ignore[no-any-return]
            *self._views[:3], self._walled, compiled(films), compiled(films and verlet), compiled(record is not None),
            self._views[3], self.table, laws, self.free, self.gravity, step, steps, self._origin.reshape(-1),
            0.5 * self.skin, self.time, log,
        )  # fmt: skip

    def _take_list(self, edges: Edges) -> None:
        """Use a list from here on: the places it was made at, and the arrays as loops take them."""
        self.edges = edges
        self._origin = self.bodies.position.copy()
        self._views = (flat(self.bodies), flat(edges), flat(self.walls), shifts(self.box).reshape(-1))
        self.walls.travel[:] = 0.0
        if self.bridges is not None:
            self.bridges.take(self.bodies)
        if self._walled:
            meet_walls(*self._views[:3], self.free, self._reach_ratio)

    def _listed(self) -> Edges:
        record, roughness = self.collisions is not None, float(self.table["roughness_gap"].max())
        ratio, rolling = self._reach_ratio, bool(self.laws.rolling)
        counted = self._loop_laws.minimum_gap is not None or self._loop_laws.lubrication is not None
        return list_edges(self.bodies, self.walls, ratio, self.skin, self.box, record, roughness, rolling, counted)

    def _relist(self) -> None:
        """Find the pairs anew; what they remember and the forces at hand are carried over."""
        wrap(self.bodies.position, self.box)
        old, order = self.edges._replace(impulse=_NO_VECTORS), self._next_order()
        del self.edges, self._views
        self._tune_skin()
        fresh = self._listed()
        remember(old, fresh, order, _inverse(order))
        self._outside += int(old.outside.sum())
        del old
        self._take_list(fresh)
        if self._lists % CHECK_EVERY == 0:
            self._accepted = 0.0

    def insert(self, fresh: Bodies) -> np.ndarray:
        """Add particles, which must not overlap others; `bodies` is another object from then on.

        fresh    :func:`cfddem.particles.state.bodies`; their ids are given anew
        returns  the ids they got (n,)
        """
        count = self.bodies.count
        ids = self._next_id + np.arange(fresh.count, dtype=np.int64)
        self._next_id += fresh.count
        joined = Bodies(*(np.concatenate(pair) for pair in zip(self.bodies, fresh._replace(id=ids))))
        self._exchange(joined, np.append(np.arange(count), np.full(fresh.count, count)))
        return ids

    def remove(self, gone: np.ndarray) -> Bodies:
        """Take particles out; `bodies` is another object from then on.

        gone     (N,) bool, which rows of `bodies`
        returns  the particles that were taken out
        """
        gone = np.asarray(gone, bool)
        if gone.all():
            raise InputError("gone", int(gone.sum()), f"fewer than all {self.bodies.count} particles")
        taken = Bodies(*(array[gone] for array in self.bodies))
        if gone.any():
            self._exchange(Bodies(*(array[~gone] for array in self.bodies)), np.flatnonzero(~gone))
        return taken

    def _exchange(self, made: Bodies, order: np.ndarray) -> None:
        """Go on with other particles; what pairs remember is kept where both are still there.

        order  old row of each new one; the number of old rows for a newcomer, who remembers nothing
        """
        count, counting = self.bodies.count, self.energies
        had = 0.0 if counting is None else counting.mechanical(self)
        old = self.edges._replace(start=np.append(self.edges.start, self.edges.start[-1]))
        place = np.full(count + 1, -1, np.int32)
        place[order] = np.arange(len(order), dtype=np.int32)
        self.bodies = made
        wrap(made.position, self.box)
        fresh = self._listed()
        remember(old, fresh, order.astype(np.int32), place)
        self._outside += int(old.outside.sum())
        self._take_list(fresh)
        self._accepted, self._listed_at = 0.0, self.steps
        springs = fresh.spring.copy()
        self.refresh()
        fresh.spring[:] = springs  # no time has passed in which contacts could slide
        if counting is not None:
            counting.fed += counting.mechanical(self) - had

    def _recall(self, earlier: ParticleSolver, fresh: Edges) -> None:
        """Take over what the pairs of an earlier run remember."""
        then, now = np.argsort(earlier.bodies.id), np.argsort(self.bodies.id)
        if not np.array_equal(earlier.bodies.id[then], self.bodies.id[now]):
            raise InputError("after", None, "a run over the same particles", "ids differ")
        if len(earlier.edges.resistance) == 0 and self.laws.film:
            raise InputError("after", None, "a run with films, as this one")
        order = np.empty(len(now), np.int32)
        order[now] = then
        remember(earlier.edges, fresh, order, _inverse(order))

    def _next_order(self) -> np.ndarray:
        """Re-sort the particles now and then, so that near particles have near rows; returns the old rows."""
        self._lists += 1
        if not self._many or self._lists % self.sort_every:
            return np.arange(self.bodies.count, dtype=np.int32)
        order = locality_order(self.bodies.position, 2.0 * float(self.bodies.radius.mean()))
        self.bodies.reorder(order)
        return order

    def _tune_skin(self) -> None:
        """Choose the skin of the next list by how long the last one has lasted."""
        age, self._listed_at = self.steps - self._listed_at, self.steps
        if self._skin_is_given or age == 0:
            return
        room = 0.5 * float(self.box.min()) - (2.0 + 0.5 * self._reach_ratio) * float(self.bodies.radius.max())
        self.skin = tuned(self.skin, age, float(self.bodies.radius.mean()), self._many, room)


def _copied(arrays: Any) -> dict[str, Any]:
    """The fields of a tuple of arrays and numbers by name, arrays as copies."""
    return {name: each.copy() if isinstance(each, np.ndarray) else each for name, each in arrays._asdict().items()}


def _inverse(order: np.ndarray) -> np.ndarray:
    """Where each row of an order went."""
    place = np.empty_like(order)
    place[order] = np.arange(len(order), dtype=order.dtype)
    return place
