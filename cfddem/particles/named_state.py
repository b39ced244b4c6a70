"""State of the particles and their pairs by ids, without rows: for a checkpoint that any number of ranks goes on from.

A neighbour list is not stored. It follows from where particles and walls were when it was made, so that any number of
ranks makes the same list again, with the same bits in the next steps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import InputError
from cfddem.backend.portions import Portions, rows_by_id, rows_by_rank, slices
from cfddem.particles.ghosts import joined_rows
from cfddem.particles.listing import NeighbourLists
from cfddem.particles.pair_graph import Edges
from cfddem.particles.state import Particles, rows_of
from cfddem.particles.walls.arrays import restored_walls
from cfddem.particles.walls.nearest_point import Walls


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
