"""The neighbour lists of a run, one after the other: sorting of rows, width of the skin, memory of pairs.

Also the state of particles and pairs by ids, from which lists are made again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.compile import MANY_ROWS
from cfddem.backend.errors import InputError
from cfddem.backend.portions import Portions, rows_by_id, rows_by_rank, slices
from cfddem.model.fields import Field
from cfddem.particles.bricks import Bricks
from cfddem.particles.ghosts import DividedDomain, SingleDomain, joined_rows
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.neighbours import list_edges, locality_order, pair_reach, wrap
from cfddem.particles.pair_graph import Edges
from cfddem.particles.state import Particles, rows_of
from cfddem.particles.walls.arrays import restored_walls
from cfddem.particles.walls.nearest_point import Walls

THREADING_PAYS = MANY_ROWS
"""Number of particles from which loops run on all threads."""

LISTING_COST = 8.0
"""Cost of a new list over the cost that a skin of one radius adds to a step; 7 to 9 in a bubbling bed, dry or wet."""

FIRST_SKIN = (0.1, 0.02)
"""Skin of the first list over the mean radius; for few particles and for many."""

NARROWEST, WIDEST = 0.01, 0.6
"""Bounds of the tuned skin over the mean radius."""


class NeighbourLists:
    """Makes the neighbour lists of a run.

    pair_fields   what each pair remembers
    table         pair table
    box           (3,) length of the periodic box; infinite along open axes [m]
    communicator  of the run
    division      of space among the ranks; None in one process
    balance       cut it anew when the work becomes unequal
    skin          of all lists; tuned during the run if None [m]
    sort_every    sort the particles by position at every this many lists, if they are many

    made       number of lists since the first
    listed_at  step of the run at which the last list was made
    listing_cost  as `LISTING_COST`; more where steps cost less
    many       there are so many particles that loops run on all threads
    """

    def __init__(
        self,
        pair_fields: Sequence[Field],
        table: np.ndarray,
        box: np.ndarray,
        *,
        communicator: Communicator,
        division: Bricks | None,
        balance: bool = False,
        skin: float | None,
        sort_every: int,
    ) -> None:
        self.pair_fields, self.table, self.box, self.communicator = pair_fields, table, box, communicator
        if communicator.size > 1 and division is None:
            raise InputError("division", None, "given in a run of several processes")
        self.ghosts = SingleDomain() if division is None else DividedDomain(division, communicator, balance)
        self.skin, self.sort_every, self._is_tuned = skin or 0.0, sort_every, skin is None
        self.made, self.listed_at, self.many = -1, 0, False
        self.listing_cost = LISTING_COST
        self._mean_radius = 0.0

    def own(self, particles: Particles) -> Particles:
        """Those of the particles that belong to this rank."""
        wrap(particles.position, self.box)
        return self.ghosts.own(particles)

    def count(self, particles: Particles) -> None:
        """Take note of how many and how large the particles of all ranks are; called where particles come or go."""
        radius = particles.radius[: particles.owned]
        # rounded, so that the skin does not depend on the order of the sum
        self._mean_radius = float(f"{self.communicator.mean(radius):.6g}")
        self.many = self.communicator.sum(len(radius)) >= THREADING_PAYS

    def first(self, particles: Particles, walls: Walls, reach_ratio: float, earlier: Any, laws: Laws) -> Edges:
        """The first list of a run.

        earlier  run whose pair memory is taken over, or None
        laws     of this run
        others   as of `renewed`
        """
        self.count(particles)
        if self._is_tuned:
            self.skin = FIRST_SKIN[self.many] * self._mean_radius
        if earlier is not None:
            refuse_other(particles, earlier, laws, self.communicator)
        edges = self.renewed(particles, walls, reach_ratio, np.full(particles.count, -1, np.int32), None, steps=0)
        if earlier is not None:
            remember_earlier(edges, particles, earlier, self.communicator)
        return edges

    def renewed(
        self,
        particles: Particles,
        walls: Walls,
        reach_ratio: float,
        old_row: np.ndarray,
        old: Edges | None,
        *,
        steps: int | None = None,
    ) -> Edges:
        """A new list. Particles change ranks, are sorted from time to time, and get new ghosts.

        particles    of this rank, without ghosts
        reach_ratio  reach of films and bridges over the reduced radius [-]
        old_row      (N,) int32, row of each particle in the old list; -1 for new particles
        old          the list whose memory is carried over, None if there is none
        steps        made by the run so far; None for a list out of turn: nothing is sorted or cut, the skin stays
        """
        wrap(particles.position, self.box)
        old_row = self.ghosts.migrate(particles, old_row, old, cut=steps is not None)
        largest = self.communicator.largest(particles.radius, default=0.0)
        if steps is not None:
            old_row = old_row[self._sort(particles)]
            age, self.listed_at = steps - self.listed_at, steps
            if self._is_tuned and age > 0:
                room = 0.5 * min(self.box) - (2.0 + 0.5 * reach_ratio) * largest
                self.skin = tuned(self.skin, age, self._mean_radius, room, self.listing_cost)
        reach = pair_reach(largest, reach_ratio, self.skin)
        old_row = np.append(old_row, self.ghosts.renew(particles, reach, self.box))
        roughness = float(self.table["roughness_gap"].max())  # local: every rank has the table
        fresh = list_edges(
            particles, walls, reach_ratio, self.skin, self.box, self.pair_fields, roughness, self.communicator
        )
        if old is not None:
            fresh.carry_over(old, old_row)
        self.ghosts.recall(fresh)
        return fresh

    def _sort(self, particles: Particles) -> np.ndarray:
        """Sort the particles from time to time, so that near particles have near rows; returns the old rows."""
        self.made += 1
        if not self.many or self.made % self.sort_every or not particles.count:
            return np.arange(particles.count, dtype=np.int32)
        order = locality_order(particles.position, 2.0 * self._mean_radius)
        particles.reorder(order)
        return order

    def checkpoint(self) -> dict[str, Any]:
        """What the next list depends on."""
        return {"skin": self.skin, "lists": self.made, "listed_at": self.listed_at}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from a `checkpoint()`; then `count` the particles."""
        self.skin, self.made = float(state["skin"]), int(state["lists"])
        self.listed_at = int(state["listed_at"])


def refuse_other(particles: Particles, earlier: Any, laws: Laws, communicator: Communicator) -> None:
    """Refuse an earlier run over other particles, without films where this run has them, or with other bridges.

    particles  of this rank, as those of the earlier run are
    laws       of this run
    """
    then, now = earlier.particles.id[: earlier.particles.owned], particles.id[: particles.owned]
    if sorted(communicator.joined(then).tolist()) != sorted(communicator.joined(now).tolist()):
        raise InputError("after", None, "a run over the same particles", "ids differ")
    if "resistance" not in earlier.edges and laws.film:
        raise InputError("after", None, "a run with films, as this one")
    if laws.bridge not in (None, earlier.laws.bridge):
        raise InputError("after", None, "a run with the same liquid bridges", "what bridges remember depends on them")


def remember_earlier(edges: Edges, particles: Particles, earlier: Any, communicator: Communicator) -> None:
    """Let the pairs of this rank take over what they remember from an earlier run, where other ranks may own them."""
    mine = np.flatnonzero(earlier.edges.first < earlier.particles.owned)
    bodies = communicator.joined(earlier.edges.ends(earlier.particles.id, mine))
    kept = {name: communicator.joined(array[mine]) for name, array in earlier.edges.lasting().items()}
    rows = rows_of(bodies.reshape(-1), particles.id, np.argsort(particles.id)).reshape(-1, 2)
    edges.recall(kept | {"bodies": bodies}, rows)


def tuned(skin: float, age: int, radius: float, room: float, cost: float = LISTING_COST) -> float:
    """The skin at which new lists and pairs that do not touch cost the same [m].

    The life of a list grows with the skin, and so does the number of pairs in it.

    skin    of the last list [m]
    age     steps for which it lasted, above 0
    radius  mean of the particles [m]
    room    widest skin that the periodic box allows [m]
    cost    as `LISTING_COST`
    """
    best = radius * math.sqrt(cost * skin / (radius * age))
    best = min(max(best, 0.5 * skin), 2.0 * skin)
    return min(max(best, NARROWEST * radius), WIDEST * radius, max(skin, 0.99 * room))


# ---------------------------------------------------------------- the state by ids, without rows
#
# For a checkpoint that any number of ranks goes on from. A neighbour list is not stored. It follows from where the
# particles and walls were when it was made, so that any number of ranks makes the same list again, with the same bits
# in the next steps.


def named_state(
    particles: Particles, edges: Edges, origin: np.ndarray, communicator: Communicator = SERIAL
) -> dict[str, Any]:
    """The state of all ranks: arrays in one process, else `Portions` of them.

    origin   (N, 3) position of each particle when the list was made [m]
    returns  "particles" and "origin" by id, "pairs" and their "bodies" (see `Edges.ends`), and "touch" of the pairs
             with walls, whose names are "touch_bodies"
    """
    rows, mine = slice(particles.owned), np.flatnonzero(edges.first < particles.owned)
    at_walls = mine[mine >= edges.between_particles]

    def by_id(values: np.ndarray) -> np.ndarray | Portions:
        return rows_by_id(values[rows], particles.id[rows], communicator)

    def by_rank(values: np.ndarray) -> np.ndarray | Portions:
        return rows_by_rank(values, communicator)

    lasting = [name for name, field in edges.fields.items() if field.role != "scratch"]
    return {
        "particles": {name: by_id(array) for name, array in particles.lasting().items()},
        "origin": by_id(origin),
        "pairs": {name: by_rank(edges[name][mine]) for name in lasting},
        "bodies": by_rank(edges.ends(particles.id, mine)),
        "touch": by_rank(edges.touch[at_walls - edges.between_particles]),
        "touch_bodies": by_rank(edges.ends(particles.id, at_walls)),
    }


def restored_list(
    state: Mapping[str, Any],
    particles: Particles,
    edges: Edges,
    lists: NeighbourLists,
    walls: Mapping[str, np.ndarray],
    reach_ratio: float,
) -> tuple[Particles, Edges, np.ndarray]:
    """The particles of this rank, their pairs, and the positions at which the list was made.

    state             of a solver, of one rank or of several; the same on all ranks. That of several may hold arrays
                      that are read where they are indexed
    particles, edges  with the fields of the run
    walls             as they were when the list was made
    reach_ratio       as of `NeighbourLists.renewed`
    errors            InputError if the list does not contain a pair of the state: the state is of another case
    """
    particles.drop_ghosts()
    if "edges" in state:
        particles.restore(state["particles"])
        edges = edges.restored(state["edges"])
        if lists.communicator.size == 1:
            return particles, edges, state["origin"]
        state = named_state(particles, edges, state["origin"])
    return _listed_again(state, particles, lists, restored_walls(walls), reach_ratio)


def _listed_again(
    state: Mapping[str, Any], particles: Particles, lists: NeighbourLists, walls: Walls, reach_ratio: float
) -> tuple[Particles, Edges, np.ndarray]:
    """See `restored_list`, for a `named_state()`."""
    mine = _own_rows(state, lists)
    now, ids = mine["position"], mine["id"]  # in ascending order
    particles.restore(
        {name: values for name, values in mine.items() if name != "origin"} | {"position": mine["origin"]}
    )
    particles = lists.own(particles)
    lists.count(particles)
    edges = lists.renewed(particles, walls, reach_ratio, np.full(particles.count, -1, np.int32), None)
    origin, own = particles.position.copy(), slice(particles.owned)
    particles.position[own] = now[np.searchsorted(ids, particles.id[own])]
    lists.ghosts.refresh("motion")
    order = np.argsort(particles.id)
    for names, values in (("bodies", state["pairs"]), ("touch_bodies", {"touch": state["touch"]})):
        for part in slices(len(state[names]), 16):
            bodies = np.asarray(state[names][part]).reshape(-1, 2)
            _give(edges, particles, order, bodies, {name: np.asarray(array[part]) for name, array in values.items()})
    return particles, edges, origin


def _own_rows(state: Mapping[str, Any], lists: NeighbourLists) -> dict[str, np.ndarray]:
    """Fields of the particles of this rank, with "origin", of a `named_state()` that is read in portions."""
    fields = {**state["particles"], "origin": state["origin"]}
    portions = []
    for part in slices(len(state["origin"]), sum(math.prod(array.shape[1:]) for array in fields.values())):
        mine = lists.ghosts.owns(np.asarray(state["origin"][part]))
        portions.append({name: np.asarray(values[part])[mine] for name, values in fields.items()})
    return joined_rows(portions)


def _give(
    edges: Edges, particles: Particles, order: np.ndarray, bodies: np.ndarray, values: Mapping[str, np.ndarray]
) -> None:
    """Give the pairs of this rank their values, by the names of their bodies; `order` sorts the particles by id."""
    rows = rows_of(bodies.reshape(-1), particles.id, order).reshape(-1, 2)
    places = edges.between(rows, bodies)
    owned = ((rows >= 0) & (rows < particles.owned)).any(axis=1)  # local: two bodies
    if (owned & (places < 0)).any():  # local: each rank checks its own pairs
        raise InputError("checkpoint", None, "one of this case", "its pairs are not those of these particles and walls")
    listed = np.flatnonzero(places >= 0)
    for name, array in values.items():
        if name == "touch":
            edges.touch[places[listed] - edges.between_particles] = array[listed]
        else:
            edges[name][places[listed]] = array[listed]
