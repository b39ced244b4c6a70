"""The pair graph: who is near whom, and what each pair remembers.

An edge joins two particles, or a particle and a wall. Edges of particles come first, sorted by their first
particle and then their second; edges of walls follow. Each neighbour is found once. With films, pairs too
far apart to touch before the next list follow those that may.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cfddem.kernels import inline, kernel
from cfddem.particles.state import Bodies
from cfddem.particles.surfaces import NORMAL, TOUCH, Walls, in_frame, nearest, touched, touched_distance
from cfddem.particles.vectors import at, dot, flat, minus, plus, times


class Edges(NamedTuple):
    """The arrays of n edges, as compiled loops take them."""

    first: np.ndarray  # (n,) uint32, particle; unsigned, so that compiled loops need not look for negative rows
    second: np.ndarray  # (n,) uint32, particle; piece of a wall in the edges after `between_particles`
    image: np.ndarray  # (n,) uint8, across which borders of a periodic box the pair reaches
    between_particles: int
    near: int  # edges of particles that may touch before the next list; those after it have films alone
    spring: np.ndarray  # (n, 3) tangential displacement of the contact [m]
    approach_speed: np.ndarray  # (n,) largest approach speed of this encounter [m/s]
    minimum_gap: (
        np.ndarray
    )  # (n,) gap below which solids are in contact: h_min of a film, the reach of adhesion; else 0 [m]
    accounted_gap: np.ndarray  # (n,) gap up to which the film's impulse has been given [m]
    force: np.ndarray  # (n, 3) on the first body [N]
    couple: np.ndarray  # (n, 3) torque per radius, the same on both bodies [N]
    roll: np.ndarray  # (n, 3) angle of the rolling spring, (0, 3) where nothing resists rolling [rad]
    moment: np.ndarray  # (n, 3) torque against rolling on the first body, its opposite on the second [N m]
    resistance: np.ndarray  # (n,) of the film, without lever; 0 out of its reach [kg/s]
    impulse: np.ndarray  # (n, 3) of the film in this step, on the first body [N s]
    hard: np.ndarray  # (n,) bool, where the film changes so much in this step that its equation is solved with care
    entry: np.ndarray  # (n, 9) of the encounter, NaN outside one: see `ENTRY`; (0, 9) where none are recorded
    touch: np.ndarray  # (particle-wall edges, 18) how sphere and wall stand: columns in `surfaces`
    start: np.ndarray  # (N + 1,) int64, where the edges of a particle begin in `incident`
    incident: np.ndarray  # int32, edge k where the particle is first, -1 - k where it is second
    outside: np.ndarray  # (n,) int64, how often laws of one's own were asked outside of their range; else (0,)


ENTRY, CLOSEST, LOST = 9, 5, 6
"""Columns of `Edges.entry`: time, normal speed and tangential velocity at the begin; the closest gap since; energy lost
to film, dashpot and friction since, NaN where energies are not counted."""

HOME = 13
"""Image of a pair that does not reach across a periodic border: 9 (x + 1) + 3 (y + 1) + (z + 1), in boxes."""


_LAST, _1, _2 = np.uint64(3 * 26), np.uint64(1), np.uint64(2)


def shifts(box: np.ndarray) -> np.ndarray:
    """What to add to the separation of a pair for each of its 27 images (27, 3) [m]."""
    whole = np.where(np.isfinite(box), box, 0.0)
    steps = np.arange(-1.0, 2.0)
    return np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(27, 3) * whole


def edges(
    first: np.ndarray,
    second: np.ndarray,
    image: np.ndarray,
    between_particles: int,
    count: int,
    *,
    near: int | None = None,
    film: bool,
    record: bool = False,
    rolling: bool = False,
    counted: bool = False,
) -> Edges:
    """A fresh graph over `count` particles; pairs that have never met.

    first, second, image  (n,) as in :class:`Edges`
    between_particles     number of edges that join two particles
    near                  leading edges between particles that may touch; all of them if not given
    film                  keep what films remember
    record                keep the begin of encounters, for a record of them
    rolling               keep what resists rolling
    counted               count how often laws of one's own are asked outside of their range
    """
    number = len(first)
    films = number if film else 0
    start, incident = _incidence(first, second, between_particles, count)
    return Edges(
        first,
        second,
        image,
        int(between_particles),
        int(between_particles) if near is None else near,
        np.zeros((number, 3)),
        np.zeros(films),
        np.zeros(number),
        np.full(films, np.inf),
        np.zeros((number, 3)),
        np.zeros((number, 3)),
        np.zeros((number if rolling else 0, 3)),
        np.zeros((number if rolling else 0, 3)),
        np.zeros(films),
        np.zeros((films, 3)),
        np.zeros(films, bool),
        np.full((number if record else 0, ENTRY), np.nan),
        np.zeros((number - int(between_particles), TOUCH)),
        start,
        incident,
        np.zeros(number if counted else 0, np.int64),
    )


THICKEST = 0.02
"""No minimum gap is larger than this share of the reduced radius, but where asperities are."""


def near_first(
    first: np.ndarray, second: np.ndarray, image: np.ndarray, bodies: Bodies, box: np.ndarray, allowance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Put the pairs that may touch before the next list before those that cannot.

    allowance  skin and height of asperities [m]
    returns    first, second and image in the new order, and the number of pairs that may touch
    """
    apart = bodies.position[first] - bodies.position[second] + shifts(box)[image]
    radii = bodies.radius[first] + bodies.radius[second]
    gap = np.sqrt(np.einsum("ij,ij->i", apart, apart)) - radii
    far = gap >= allowance + THICKEST * bodies.radius[first] * bodies.radius[second] / radii
    order = np.argsort(far, kind="stable")
    return first[order], second[order], image[order], int(np.count_nonzero(~far))


@kernel
def _incidence(first, second, between_particles, count):
    """List the edges of each particle in ascending order."""
    start = np.zeros(count + 1, np.int64)
    for k in range(len(first)):
        start[first[k] + 1] += 1
        if k < between_particles:
            start[second[k] + 1] += 1
    for i in range(count):
        start[i + 1] += start[i]
    incident = np.empty(start[count], np.int32)
    filled = start[:-1].copy()
    for k in range(len(first)):
        i = first[k]
        incident[filled[i]] = k
        filled[i] += 1
        if k < between_particles:
            j = second[k]
            incident[filled[j]] = -1 - k
            filled[j] += 1
    return start, incident


@kernel
def remember(old, new, old_row, new_row):
    """Carry the memory of each pair from an old list to a new one.

    old_row  (N,) where the particle of each new row stood in the old list
    new_row  (N,) the inverse
    """
    for k in range(len(new.first)):
        i, j = new.first[k], new.second[k]
        a = old_row[i]
        for place in range(old.start[a], old.start[a + 1]):
            edge = old.incident[place]
            before = edge if edge >= 0 else -1 - edge
            if k < new.between_particles:
                other = old.second[before] if edge >= 0 else old.first[before]
                same = before < old.between_particles and new_row[other] == j
            else:
                same = before >= old.between_particles and old.second[before] == j
            if same:
                sign = 1.0 if edge >= 0 else -1.0
                for axis in range(3):
                    new.spring[k, axis] = sign * old.spring[before, axis]
                    new.force[k, axis] = sign * old.force[before, axis]
                    new.couple[k, axis] = old.couple[before, axis]
                if len(new.roll) > 0:
                    for axis in range(3):
                        new.roll[k, axis] = sign * old.roll[before, axis]
                        new.moment[k, axis] = sign * old.moment[before, axis]
                new.minimum_gap[k] = old.minimum_gap[before]
                if len(new.resistance) > 0:
                    new.approach_speed[k] = old.approach_speed[before]
                    new.accounted_gap[k] = old.accounted_gap[before]
                    new.resistance[k] = old.resistance[before]
                if len(new.entry) > 0:
                    for column in range(ENTRY):
                        turned = sign if 2 <= column < CLOSEST else 1.0  # a velocity of the first body
                        new.entry[k, column] = turned * old.entry[before, column]


def gaps(edges: Edges, bodies: Bodies, walls: Walls, box: np.ndarray) -> np.ndarray:
    """Gap of every edge (n,) [m]."""
    result = np.empty(len(edges.first))
    _gaps(flat(edges), flat(bodies), flat(walls), shifts(box).reshape(-1), result)
    return result


@kernel
def _gaps(edges, bodies, walls, shift, result):
    for k in range(len(result)):
        if k < edges.between_particles:
            result[k] = geometry(k, bodies, edges, shift)[2]
        else:
            i, w = edges.first[k], np.int64(edges.second[k])
            place = in_frame(walls, walls.wall[w], at(bodies.position, i))
            result[k] = nearest(walls.kind, walls.shape, w, place)[1] - bodies.radius[i]


@inline
def between(i, j, image, position, shift):
    """Separation from particle j to particle i, across a periodic border where the image says so."""
    # the three digits of the image by whole numbers: faster than to look them up
    code = np.int64(image)
    x = (code * 57) >> 9
    y = ((code - 9 * x) * 11) >> 5
    z = code - 9 * x - 3 * y
    away = (shift[_LAST] * (x - 1.0), shift[_LAST + _1] * (y - 1.0), shift[_LAST + _2] * (z - 1.0))
    return plus(minus(at(position, i), at(position, j)), away)


@inline
def geometry(k, bodies, edges, shift):
    """Separation from the second body to the first, its length, and the gap."""
    i, j = edges.first[k], edges.second[k]
    if k < edges.between_particles:
        separation = between(i, j, edges.image[k], bodies.position, shift)
        distance = math.sqrt(dot(separation, separation))
        return separation, distance, distance - bodies.radius[i] - bodies.radius[j]
    distance = touched_distance(edges, k)
    return times(distance, touched(edges, k, NORMAL)), distance, distance - bodies.radius[i]


def wall_forces(edges: Edges, walls: Walls) -> np.ndarray:
    """Force of the particles on each wall, less the impulses of lubricated drifts (M, 3) [N]."""
    result = np.zeros((len(walls.sweep), 3))
    np.subtract.at(result, walls.wall[edges.second[edges.between_particles :]], edges.force[edges.between_particles :])
    return result
