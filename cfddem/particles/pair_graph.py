"""The pair graph: which bodies are near each other, and what each pair remembers.

An edge joins two particles, or a particle and a piece of a wall. Edges of particles come first, edges of walls follow.
Each pair has one edge. With films, pairs too far apart to touch before the next list follow those that may touch.

The first body of a pair is the particle with the lower id. The list of the edges of a particle begins with pairs that
may touch, sorted by the ids of the other particles; walls follow, by wall and then by triangle; pairs that cannot touch
come last. So forces, and their sum over the edges of a particle, have the same bits for any order of the rows.

What a pair remembers is declared by the laws of a run as fields (:mod:`cfddem.model.fields`). New lists, checkpoints
and the arrays of compiled loops are made from the declarations.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.compile import get_num_threads, inline, prange, serial, threaded
from cfddem.backend.named import named_arrays
from cfddem.model.fields import Field, Table
from cfddem.particles.state import Particles
from cfddem.particles.vectors import at, dot, flat, minus, plus, times
from cfddem.particles.walls.nearest_point import (
    NORMAL,
    TOUCH,
    Walls,
    in_frame,
    nearest,
    touched,
    touched_distance,
)


class Graph(NamedTuple):
    """Which bodies each of n edges joins, as compiled loops take it."""

    first: np.ndarray  # (n,) uint32, particle; unsigned, so that compiled loops need not check for negative rows
    second: np.ndarray  # (n,) uint32, particle; piece of a wall in the edges after `between_particles`
    image: np.ndarray  # (n,) uint8, across which borders of a periodic box the pair reaches
    between_particles: int
    near: int  # edges of particles that may touch before the next list; those after it have films alone
    touch: np.ndarray  # (particle-wall edges, 18) geometry of sphere and wall: columns in `nearest_point`
    start: np.ndarray  # (N + 1,) int64, where the edges of a particle begin in `incident`
    incident: (
        np.ndarray
    )  # int32, by id of the other body: edge k where the particle is first, -1 - k where it is second


class Edges(Table):
    """The edges: which bodies they join (`Graph`), and the declared fields of each pair."""

    graph: Graph

    def __init__(self, graph: Graph, fields: Iterable[Field], values: Mapping[str, Any] | None = None) -> None:
        object.__setattr__(self, "graph", graph)
        super().__init__(fields, len(graph.first), values)

    def __getattr__(self, name: str) -> Any:
        graph = self.__dict__.get("graph")
        return getattr(graph, name) if name in Graph._fields else super().__getattr__(name)

    @property
    def flat_graph(self) -> Graph:
        """The graph as loops take it."""
        return flat(self.graph)

    @property
    def memory(self) -> Any:
        """The declared fields as loops take them: vectors one after the other; nothing is copied."""
        return named_arrays("Memory", tuple(self.fields))(*(array.reshape(-1) for array in self.arrays.values()))

    def uses_outside(self, owned: int) -> int:
        """Uses of laws outside of their range that have been counted for edges whose first body is owned."""
        return int(self.outside[self.first < owned].sum()) if "outside" in self else 0  # local: of this rank

    def checkpoint(self) -> dict[str, Any]:
        """Copies of the graph and of everything that pairs remember."""
        graph = {name: np.copy(array) if np.ndim(array) else array for name, array in self.graph._asdict().items()}
        return graph | super().checkpoint()

    def restored(self, kept: Mapping[str, Any]) -> Edges:
        """Edges with the same fields and the graph and values of a `checkpoint()`."""
        values: dict[str, Any] = {
            name: int(kept[name]) if np.ndim(kept[name]) == 0 else np.array(kept[name]) for name in Graph._fields
        }
        edges = Edges(Graph(**values), self.fields.values())
        edges.restore({name: array for name, array in kept.items() if name not in Graph._fields})
        return edges

    def carry_over(self, old: Edges, old_row: np.ndarray) -> None:
        """Take over what each pair remembers from an earlier list.

        old_row  (N,) int32, row that the particle of each new row had in the old list; -1 for new particles
        """
        source = np.empty(self.rows, np.int64)
        _find.over(self.rows)(old.flat_graph, self.flat_graph, old_row, source)
        new = np.flatnonzero(source < 0)
        for name, field in self.fields.items():
            if field.role == "scratch" or name not in old or not old.rows:
                continue
            if field.dtype is float:
                width = max(math.prod(field.shape), 1)
                _take.over(self.rows)(old[name].reshape(-1), source, width, self[name].reshape(-1))
                continue
            initial = self[name][new]
            np.take(old[name], source, axis=0, out=self[name], mode="wrap")  # faster than to choose the known ones
            self[name][new] = initial

    def ends(self, ids: np.ndarray, edges: Any = slice(None)) -> np.ndarray:
        """Names of the two bodies of some edges: ids of particles, -1 - w for piece w of the walls (n, 2).

        ids    of the particles (N,)
        edges  rows of the edges; all of them if not given
        """
        second, walls = self.second[edges].astype(np.int64), np.arange(self.rows)[edges] >= self.between_particles
        second = np.where(walls, -1 - second, ids[np.where(walls, 0, second)])
        return np.stack([ids[self.first[edges]], second], axis=1)

    def of(self, rows: np.ndarray, ids: np.ndarray) -> dict[str, np.ndarray]:
        """What the pairs of some particles remember, with the names of their "bodies", for another list.

        rows  of the particles; negative numbers are left out
        ids   of all particles (N,)
        """
        places = [self.incident[self.start[row] : self.start[row + 1]] for row in rows[rows >= 0]]
        incident = np.concatenate([np.zeros(0, np.int64), *places])
        mine = np.unique(np.where(incident < 0, -1 - incident, incident))
        return {name: array[mine] for name, array in self.lasting().items()} | {"bodies": self.ends(ids, mine)}

    def recall(self, pairs: Mapping[str, np.ndarray], rows: np.ndarray) -> None:
        """Take over what pairs remembered in another list; see `of`.

        rows  of their bodies in this list; -1 for particles that are not in it, and for walls (n, 2)
        """
        places = self.between(rows, pairs["bodies"])
        listed = np.flatnonzero(places >= 0)
        for name, array in self.lasting().items():
            if name in pairs:  # an earlier run may remember less
                array[places[listed]] = pairs[name][listed]

    def between(self, rows: np.ndarray, bodies: np.ndarray) -> np.ndarray:
        """Edges of pairs; -1 where there is none (n,).

        rows    of their bodies; -1 for particles that are not in this list, and for walls (n, 2)
        bodies  names of their bodies, see `ends` (n, 2)
        """
        places = np.empty(len(bodies), np.int64)
        _find_named(self.flat_graph, rows, bodies, places)
        return places


HOME = 13
"""Image of a pair within the box: 9 (x + 1) + 3 (y + 1) + (z + 1), in boxes."""


_LAST, _1, _2 = np.uint64(3 * 26), np.uint64(1), np.uint64(2)
_IMAGES = np.moveaxis(np.indices((3, 3, 3)), 0, -1).reshape(27, 3) - 1.0


def shifts(box: np.ndarray) -> np.ndarray:
    """Shift of the separation of a pair for each of its 27 images (27, 3) [m]."""
    whole: np.ndarray = np.where(np.isfinite(box), box, 0.0)
    return _IMAGES * whole


def make_edges(
    fields: Iterable[Field],
    first: np.ndarray,
    second: np.ndarray,
    image: np.ndarray,
    between_particles: int,
    ids: np.ndarray,
    near: int | None = None,
) -> Edges:
    """Edges with their fields at initial values.

    fields                of each pair
    first, second, image  (n,) as in :class:`Graph`; pairs are turned so that the lower id is first
    between_particles     number of edges that join two particles
    ids                   of the particles (N,)
    near                  leading edges between particles that may touch; all of them if not given
    """
    pairs = int(between_particles)
    touch = np.zeros((len(first) - pairs, TOUCH))
    near = pairs if near is None else int(near)
    incidence = _incidence(first, second, image, near, pairs, ids)
    graph = Graph(first, second, image, pairs, near, touch, *incidence)
    return Edges(graph, fields)


THICKEST = 0.02
"""Upper limit of the minimum gap over the reduced radius, unless asperities are larger."""


MOST_PIECES = 16
"""The edges are listed in no more pieces at a time, each of which needs a number for every particle."""


def _incidence(
    first: np.ndarray, second: np.ndarray, image: np.ndarray, near: int, between_particles: int, ids: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Let the lower id of each pair be first, and list the edges of each particle by the id of the other body."""
    count, threads = len(ids), min(get_num_threads(), MOST_PIECES)
    # in the order of the lists: near pairs, walls, far pairs; pairs in a piece for each thread
    close = np.linspace(0, near, threads + 1).astype(np.int64)
    far = np.linspace(near, between_particles, (threads if near < between_particles else 0) + 1).astype(np.int64)
    begin = np.concatenate([close[:-1], [between_particles], far[:-1]])
    end = np.concatenate([close[1:], [len(first)], far[1:]])
    edges, pieces = len(first) + between_particles, _Pieces(ids, between_particles, begin, end, threads)
    place, start = np.zeros((len(begin), count + 1), np.uint32), np.zeros(count + 1, np.int64)
    incident, key = np.empty(edges, np.int32), np.empty(edges, np.int64)
    _list_edges.over(count)(first, second, image, pieces, place, start, incident, key)
    return start, incident


class _Pieces(NamedTuple):
    ids: np.ndarray  # of the particles
    between_particles: int
    begin: np.ndarray  # first edge of each piece
    end: np.ndarray
    walls: int  # which piece is of edges at walls


@threaded
def _list_edges(first, second, image, edges, place, start, incident, key):
    """Turn pairs, and list the edges of each particle, piece by piece of the edges.

    place  where a piece puts its next edge of a particle
    key    ids of the other bodies
    """
    ids, between_particles, begin, end, walls = edges
    pieces, count = len(begin), len(ids)
    for piece in prange(pieces):
        for k in range(begin[piece], end[piece]):
            place[piece, first[k]] += np.uint32(1)
            if k < between_particles:
                place[piece, second[k]] += np.uint32(1)
                if ids[first[k]] > ids[second[k]]:
                    first[k], second[k] = second[k], first[k]
                    image[k] = 2 * HOME - image[k]
    for i in prange(count):
        for piece in range(pieces):
            start[i + 1] += place[piece, i]
    for i in range(count):
        start[i + 1] += start[i]
    for i in prange(count):
        total = start[i]
        for piece in range(pieces):
            number = np.int64(place[piece, i])
            place[piece, i] = total
            total += number
    for piece in prange(pieces):
        for k in range(begin[piece], end[piece]):
            i = first[k]
            incident[place[piece, i]] = k
            if k < between_particles:
                j = second[k]
                key[place[piece, i]] = ids[j]
                incident[place[piece, j]], key[place[piece, j]] = -1 - k, ids[i]
                place[piece, j] += np.uint32(1)
            place[piece, i] += np.uint32(1)
    for i in prange(count):
        _sort(incident, key, start[i], place[walls - 1, i])
        _sort(incident, key, place[walls, i], start[i + 1])


@inline
def _sort(incident, key, begin, end):
    """Sort a part of a list of edges by the ids of the other bodies, `key`."""
    for last in range(begin + 1, end):
        edge, other, place = incident[last], key[last], last
        while place > begin and key[place - 1] > other:
            incident[place], key[place] = incident[place - 1], key[place - 1]
            place -= 1
        incident[place], key[place] = edge, other


@inline
def _edge_of(edges, i, j, wall):
    """Edge of particle i and of particle j, or piece j of the walls; -1 without one. The lower id is particle i."""
    if i < 0 or j < 0:
        return -1
    for place in range(edges.start[i], edges.start[i + 1]):
        edge = edges.incident[place]
        if edge >= 0 and edges.second[edge] == j and (edge >= edges.between_particles) == wall:
            return edge
    return -1


@threaded
def _find(old, new, old_row, source):
    """Find the old edge of each new one; -1 for new pairs."""
    for k in prange(len(new.first)):
        wall = k >= new.between_particles
        i, j = old_row[new.first[k]], new.second[k] if wall else old_row[new.second[k]]
        source[k] = _edge_of(old, i, j, wall)


@threaded
def _take(old, source, width, values):
    """Take over rows of numbers from an earlier list, where there is an earlier row."""
    for k in prange(len(source)):
        if source[k] >= 0:
            for column in range(width):
                values[width * k + column] = old[width * source[k] + column]


@serial
def _find_named(edges, rows, bodies, places):
    """Find the edges of pairs by the rows of their particles and the names of their walls; -1 where there is none."""
    for n in range(len(places)):
        wall, i = bodies[n, 1] < 0, rows[n, 0]
        j = -1 - bodies[n, 1] if wall else rows[n, 1]
        places[n] = _edge_of(edges, i, j, wall)


def gaps(edges: Edges, particles: Particles, walls: Walls, box: np.ndarray) -> np.ndarray:
    """Gap of every edge (n,) [m]."""
    result = np.empty(len(edges.first))
    _gaps.over(edges.rows)(edges.flat_graph, particles.view, flat(walls), shifts(box).reshape(-1), result)
    return result


@threaded
def _gaps(edges, particles, walls, shift, result):
    for k in prange(len(result)):
        if k < edges.between_particles:
            _, distance, radii = of_two_spheres(k, particles, edges, shift)
            result[k] = distance - radii
        else:
            i, w = edges.first[k], np.int64(edges.second[k])
            place = in_frame(walls, walls.wall[w], at(particles.position, i))
            result[k] = nearest(walls.kind, walls.shape, w, place)[1] - particles.radius[i]


@inline
def places_of(i, edges):
    """Places in `incident` of the edges of particle i; unsigned, so that loops need not check for negative rows."""
    return range(np.uint64(edges.start[i]), np.uint64(edges.start[i + 1]))


@inline
def edge_role(incident):
    """Row of an incident edge, and 1 where the particle is its first body, -1 where it is its second."""
    second = np.int64(incident) >> 63
    return np.uint64(np.int64(incident) ^ second), -1.0 if incident < 0 else 1.0


@inline
def between(i, j, image, position, shift):
    """Separation from particle j to the image of particle i."""
    # the three digits of the image by integer arithmetic, which is faster than a table
    code = np.int64(image)
    x = (code * 57) >> 9
    y = (((code - 9 * x) * 11) >> 5) & 3  # two bits are all, which the compiler would not know by itself
    z = (code - 9 * x - 3 * y) & 3
    away = (shift[_LAST] * (x - 1.0), shift[_LAST + _1] * (y - 1.0), shift[_LAST + _2] * (z - 1.0))
    return plus(minus(at(position, i), at(position, j)), away)


@inline
def of_two_spheres(k, particles, edges, shift):
    """Separation from the second sphere of a pair to the first, its length, and the sum of the radii."""
    i, j = edges.first[k], edges.second[k]
    separation = between(i, j, edges.image[k], particles.position, shift)
    return separation, math.sqrt(dot(separation, separation)), particles.radius[i] + particles.radius[j]


@inline
def geometry(k, system):
    """Separation from the second body to the first, its length, and the gap."""
    particles, edges = system.particles, system.edges
    if k < edges.between_particles:
        separation, distance, radii = of_two_spheres(k, particles, edges, system.shift)
        return separation, distance, distance - radii
    distance = touched_distance(edges, k)
    return times(distance, touched(edges, k, NORMAL)), distance, distance - particles.radius[edges.first[k]]
