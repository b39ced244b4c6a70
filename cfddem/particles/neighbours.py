"""Neighbour lists: all pairs that may interact before any particle has moved by half the skin.

Particles are binned by size class, each class in a grid of its own cells, so that a few large particles do
not widen the search among small ones. Every particle searches the cells of each class once and keeps the
neighbours in later rows; lists are sorted, and the same for any number of threads.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.compile import CHUNKS, inline, prange, serial, threaded
from cfddem.backend.errors import InputError
from cfddem.model.fields import Field
from cfddem.particles.pair_graph import HOME, THICKEST, Edges, Graph, make_edges, of_two_spheres, shifts
from cfddem.particles.state import Particles
from cfddem.particles.vectors import at
from cfddem.particles.walls.arrays import near_walls
from cfddem.particles.walls.nearest_point import Walls

FEW = 64
"""Up to this many particles every pair is checked."""

USUAL_PAIRS = 8
"""Listed pairs per particle for which memory is allocated before they are counted."""

CLASS_RATIO = 2.0
"""Radii within this factor are in one size class."""


class FoundPairs(NamedTuple):
    """Pairs that a search finds, with an equal part of the arrays for every piece of the particles."""

    first: np.ndarray  # row of the particle
    second: np.ndarray  # row of its neighbour
    image: np.ndarray  # of the periodic box in which the neighbour is


class Cells(NamedTuple):
    """Particles sorted into the cells of their size class."""

    largest: np.ndarray  # (C,) largest radius of each class [m]
    low: np.ndarray  # (3,) lower corner of all grids [m]
    width: np.ndarray  # (C, 3) of a cell [m]
    number: np.ndarray  # (C, 3) int64, cells along each axis
    offset: np.ndarray  # (C,) int64, first cell of each class in `start`
    start: np.ndarray  # (all cells + 1,) int64, where the particles of a cell begin in `member`
    member: np.ndarray  # (N,) int32, rows of particles


def list_edges(
    particles: Particles,
    walls: Walls,
    cutoff_ratio: float,
    skin: float,
    box: np.ndarray,
    fields: Iterable[Field] = (),
    roughness: float = 0.0,
    communicator: Communicator = SERIAL,
) -> Edges:
    """A new pair graph of all pairs closer than the reach of the film plus a skin.

    cutoff_ratio  reach of a film over the reduced radius; 0 for dry contacts [-]
    skin          allowance for motion until the next list [m]
    box           (3,) length of the periodic box; infinite along axes that are open [m]
    fields        of each pair
    roughness     largest gap at which asperities hold a pair apart [m]
    communicator  of the run
    """
    reach = pair_reach(communicator.largest(particles.radius, default=0.0), cutoff_ratio, skin)
    for axis in range(3):
        if box[axis] < 2.0 * reach:
            raise InputError("box", float(box[axis]), f"at least {2.0 * reach:.3g} m, twice the reach of a pair")
    find = _among_few if particles.count <= FEW else _among_many
    pieces = find(particles, cutoff_ratio, skin, box)
    first, second, image = (np.concatenate([piece[column] for piece in pieces]) for column in range(3))
    del pieces
    pairs = near = len(first)
    if cutoff_ratio > 0.0:
        first, second, image, near = near_first(first, second, image, particles, box, skin + roughness)
    particle, wall = near_walls(particles, walls, cutoff_ratio, skin)
    if len(wall):
        first, second = np.concatenate([first, particle]), np.concatenate([second, wall])
        image = np.concatenate([image, np.full(len(wall), HOME, np.uint8)])
    return make_edges(fields, first, second, image, pairs, particles.id, near)


def near_first(
    first: np.ndarray, second: np.ndarray, image: np.ndarray, particles: Particles, box: np.ndarray, allowance: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Sort the pairs that may touch before the next list to the front.

    allowance  skin and height of asperities [m]
    returns    first, second and image in the new order, and the number of pairs that may touch
    """
    pairs = first, second, image
    place, sorted_pairs = np.empty(len(first), np.int64), tuple(np.empty_like(array) for array in pairs)
    graph = Graph(*pairs, len(first), len(first), *(np.zeros(0, kind) for kind in (float, np.int64, np.int32)))
    near = _find_near(particles.view, graph, shifts(box).reshape(-1), allowance, place)
    for old, new in zip(pairs, sorted_pairs):
        new[place] = old
    return *sorted_pairs, near


@serial
def _find_near(particles, edges, shift, allowance, place):
    """Find the place of each pair where those that may touch come first, and their number."""
    near = 0
    for k in range(len(place)):
        i, j = edges.first[k], edges.second[k]
        _, distance, radii = of_two_spheres(k, particles, edges, shift)
        reach = allowance + THICKEST * particles.radius[i] * particles.radius[j] / radii
        place[k] = 1 if distance - radii < reach else 0
        near += place[k]
    ahead, behind = 0, near
    for k in range(len(place)):
        is_near = place[k] == 1
        place[k] = ahead if is_near else behind
        ahead += is_near
        behind += not is_near
    return near


def pair_reach(largest: float, cutoff_ratio: float, skin: float) -> float:
    """Largest distance of the centres of a listed pair [m].

    largest  radius [m]
    """
    return 2.0 * largest + 0.5 * cutoff_ratio * largest + skin


_Pieces = list[tuple[np.ndarray, np.ndarray, np.ndarray]]


def _among_few(particles: Particles, cutoff_ratio: float, skin: float, box: np.ndarray) -> _Pieces:
    """Pairs within reach, by checking every pair; nothing is compiled."""
    i, j = np.triu_indices(particles.count, 1)
    loose = (particles.inverse_mass[i] + particles.inverse_mass[j] > 0.0) & (i < particles.owned)
    i, j = i[loose], j[loose]
    touch = particles.radius[i] + particles.radius[j]
    near = touch + cutoff_ratio * particles.radius[i] * particles.radius[j] / touch + skin
    apart = (particles.position[i] - particles.position[j])[:, None, :] + shifts(box)[None, :, :]
    shifted = shifts(np.ones(3)) != 0.0
    within = np.einsum("pid,pid->pi", apart, apart) < near[:, None] ** 2
    within &= ~(shifted & np.isinf(box)).any(axis=1)  # local: axes; there is one image along an open one
    pair, image = np.nonzero(within)
    return [(i[pair].astype(np.uint32), j[pair].astype(np.uint32), image.astype(np.uint8))]


def _among_many(particles: Particles, cutoff_ratio: float, skin: float, box: np.ndarray) -> _Pieces:
    """Pairs within reach, searched cell by cell, in pieces one after the other.

    Memory is allocated for a usual number of pairs in each piece; if that is too small, the search is repeated.
    """
    cells = bin_particles(particles.position, particles.radius, cutoff_ratio, skin, box)
    room = USUAL_PAIRS * (particles.count // CHUNKS + 1)
    counts = np.zeros(CHUNKS, np.int64)
    while True:
        first, second, image = (np.empty(CHUNKS * room, kind) for kind in (np.uint32, np.uint32, np.uint8))
        _search(particles.view, cells, cutoff_ratio, skin, box, counts, FoundPairs(first, second, image))
        needed = int(counts.max())  # local: pairs found by this rank
        if needed <= room:
            begins = room * np.arange(CHUNKS)
            return [(first[a:b], second[a:b], image[a:b]) for a, b in zip(begins, begins + counts)]
        room = needed


def bin_particles(position: np.ndarray, radius: np.ndarray, cutoff_ratio: float, skin: float, box: np.ndarray) -> Cells:
    """Sort particles into the cells of their size class.

    position  (N, 3), inside the box along periodic axes [m]
    radius    (N,) [m]
    """
    smallest, widest = float(radius.min()), float(radius.max())  # local: cells of this rank
    if widest < CLASS_RATIO * smallest:
        size_class, largest = np.zeros(len(radius), np.int64), np.array([widest])
    else:
        size_class = np.floor(np.log(radius / smallest) / np.log(CLASS_RATIO) + 1e-9).astype(np.int64)
        kinds, size_class = np.unique(size_class, return_inverse=True)
        largest = np.array([radius[size_class == kind].max() for kind in range(len(kinds))])  # local: cells
    periodic = np.isfinite(box)
    extremes = (np.min, np.max)
    bottom, top = (np.array([extreme(axis) for axis in position.T]) for extreme in extremes)  # local: of this rank
    low = np.where(periodic, 0.0, bottom)
    span = np.where(periodic, box, np.maximum(top - low, smallest))
    wanted = 2.0 * largest + 0.5 * cutoff_ratio * largest + skin
    most = max(64.0, 4.0 * len(radius)) ** (1.0 / 3.0)
    wanted = np.maximum(wanted, math.prod(span) ** (1.0 / 3.0) / most)
    number = np.clip(np.floor(span / wanted[:, None]).astype(np.int64), 1, 1 << 20)
    ends = np.cumsum(number[:, 0] * number[:, 1] * number[:, 2])
    offset = np.append(0, ends[:-1])
    start, member = np.zeros(int(ends[-1]) + 1, np.int64), np.empty(len(radius), np.int32)
    _sort_into_cells(position, size_class, low, span / number, number, offset, start, member)
    return Cells(largest, low, span / number, number, offset, start, member)


@serial
def _sort_into_cells(position, size_class, low, width, number, offset, start, member):
    """Find the cell of each particle, and list the particles cell by cell, in each cell in the order of rows."""
    cell = np.empty(len(size_class), np.int64)
    for i in range(len(cell)):
        c = size_class[i]
        where = 0
        for axis in range(3):
            step = int((position[i, axis] - low[axis]) / width[c, axis])
            where = where * number[c, axis] + min(max(step, 0), number[c, axis] - 1)
        cell[i] = offset[c] + where
        start[cell[i] + 1] += 1
    for place in range(1, len(start)):
        start[place] += start[place - 1]
    for i in range(len(cell)):
        member[start[cell[i]]] = i
        start[cell[i]] += 1
    for place in range(len(start) - 1, 0, -1):
        start[place] = start[place - 1]
    start[0] = 0


@threaded
def _search(particles, cells, cutoff_ratio, skin, box, counts, pairs):
    """Write the neighbours of each owned particle in later rows, ascending; count all, store what fits."""
    count, room = particles.owned, len(pairs.first) // CHUNKS
    for chunk in prange(CHUNKS):
        base = chunk * room
        end, total = base + room, base
        for i in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            begin = total
            radius, here = particles.radius[i], at(particles.position, i)
            for c in range(len(cells.largest)):
                largest = cells.largest[c]
                reach = radius + largest + cutoff_ratio * radius * largest / (radius + largest) + skin
                x0, x1 = _range(here[0], reach, 0, c, cells, box)
                y0, y1 = _range(here[1], reach, 1, c, cells, box)
                z0, z1 = _range(here[2], reach, 2, c, cells, box)
                for x in range(x0, x1 + 1):
                    ix, shift_x = _wrap(x, cells.number[c, 0])
                    for y in range(y0, y1 + 1):
                        iy, shift_y = _wrap(y, cells.number[c, 1])
                        column = cells.offset[c] + (ix * cells.number[c, 1] + iy) * cells.number[c, 2]
                        z = z0
                        while z <= z1:  # neighbouring cells of a column hold neighbouring particles
                            iz, shift_z = _wrap(z, cells.number[c, 2])
                            last = min(z1 - z + iz, cells.number[c, 2] - 1)
                            z += last - iz + 1
                            for place in range(cells.start[column + iz], cells.start[column + last + 1]):
                                j = cells.member[place]
                                if j <= i:
                                    continue
                                there = at(particles.position, j)
                                dx = here[0] - there[0] - (shift_x * box[0] if shift_x != 0 else 0.0)
                                dy = here[1] - there[1] - (shift_y * box[1] if shift_y != 0 else 0.0)
                                dz = here[2] - there[2] - (shift_z * box[2] if shift_z != 0 else 0.0)
                                square = dx * dx + dy * dy + dz * dz
                                if square >= reach * reach:
                                    continue
                                touch = radius + particles.radius[j]
                                near = touch + cutoff_ratio * radius * particles.radius[j] / touch + skin
                                if square < near * near and particles.inverse_mass[i] + particles.inverse_mass[j] > 0.0:
                                    if total < end:
                                        code = HOME - 9 * shift_x - 3 * shift_y - shift_z
                                        _insert(pairs, begin, total - begin, i, j, code)
                                    total += 1
        counts[chunk] = total - base


@inline
def _range(coordinate, reach, axis, c, cells, box):
    """Cells within reach along one axis; beyond the ends of a periodic box they are wrapped later."""
    low = int(np.floor((coordinate - reach - cells.low[axis]) / cells.width[c, axis]))
    high = int(np.floor((coordinate + reach - cells.low[axis]) / cells.width[c, axis]))
    number = cells.number[c, axis]
    if np.isinf(box[axis]):
        return min(max(low, 0), number - 1), min(max(high, 0), number - 1)
    # a cell is searched once for each image of the box that it represents
    return max(low, -number), min(high, 2 * number - 1)


@inline
def _wrap(cell, number):
    """Cell inside the box, and the number of boxes by which it was shifted."""
    if cell < 0:
        return cell + number, -1
    if cell >= number:
        return cell - number, 1
    return cell, 0


@inline
def _insert(pairs, base, number, i, j, code):
    """Keep the neighbours of i in ascending order."""
    second, image, place = pairs.second, pairs.image, base + number
    while place > base and second[place - 1] > j:
        second[place], image[place] = second[place - 1], image[place - 1]
        place -= 1
    second[place], image[place] = j, code
    pairs.first[base + number] = i


def wrap(position: np.ndarray, box: np.ndarray) -> None:
    """Bring positions back into a periodic box, in place."""
    for axis in np.flatnonzero(np.isfinite(box)):
        position[:, axis] -= box[axis] * np.floor(position[:, axis] / box[axis])


def locality_order(position: np.ndarray, width: float) -> np.ndarray:
    """Rows in an order in which near particles have near rows: along a Morton curve through cells.

    position  (N, 3) [m]
    width     of a cell [m]
    returns   (N,) int32
    """
    low = np.array([axis.min() for axis in position.T])  # local: the order of rows concerns this rank
    cell = np.minimum(((position - low) / width).astype(np.int64), (1 << 20) - 1)
    key, most = np.zeros(len(position), np.int64), int(cell.max())  # local: likewise
    for bit in range(most.bit_length()):
        for axis in range(3):
            key |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(key, kind="stable").astype(np.int32)
