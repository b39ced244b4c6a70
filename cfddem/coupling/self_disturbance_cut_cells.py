r"""What smooth walls, which cut cells, leave of the self-disturbance.

The flow of a particle is driven in the cells on which it deposits, and gathered from these. Beside a cut wall they may
lie at another distance from it than the particle: small cells are taken together with a larger one. So the flow is a
sum over pairs of its cells. Of each pair it is what a plane wall across an axis of the grid leaves, at the mean
distance of the open parts of both cells, weighted by the square of the normal n along this axis. Over what the particle
would drive far from walls this is the share of each mode, r^2 towards the wall and along it:

.. math:: u_k \to \left[r_t + nn\,(r_n - r_t)\right]\cdot u_k

Between cells at tabulated distances d, what the wall takes, times d, is linear: the effect of a wall falls as 1/d. The
force on a cell at a wall is carried by the wall within the cell. A slanting wall has 1/max|n| times the area of a face
there, so that the flow along it is less by max|n|. This holds for cells at a mean distance up to 0.75 cells, and fades
to nothing at 1.0, which is a choice. What a curved wall does beyond a plane one is left to the grid.

The solid fraction that a particle gathers of its own is a sum over pairs of its cells. What each cell gathers of itself
and of its neighbours is found with the kernel of the run, between all walls, once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np

from cfddem.backend.compile import inline, prange, threaded
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.kernel_loops import weight
from cfddem.coupling.self_disturbance_tables import lattice_of, tables_of
from cfddem.coupling.self_disturbance_walls import at_shares, cell_of, flow_beside, normal_first, shares_in_cell
from cfddem.fluid.cut_cells import contents
from cfddem.fluid.grid import Array
from cfddem.fluid.surfaces import Surface
from cfddem.particles.vectors import NOTHING, dot, of_row, plus, times

LEAST = 1e-12
"""Smallest square of a normal that counts [-]."""

AWAY = np.array([(0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5, 3.5, 4.5), (0.625, 1.0, 1.375, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)])
"""Mean distances in cells for which the flow is tabulated, of cells in one layer along a wall and in two. The cells at
the wall are half open, whole, or taken together with half a cell."""

APART = 6
"""Distance in cells at which a cell no longer gathers from another one, at most."""

NEVER = 1000
"""An axis that is not periodic begins again after this many times its cells, which is farther than any place."""

NEIGHBOURS = tuple(product((-1, 0, 1), repeat=3))
"""Steps along z, y, x from a cell to itself and its neighbours."""


class ConstantFields:
    """Fields of cells that do not change, laid out for particles to gather them.

    kernel  of the run
    fields  (m, nz, ny, nx)
    """

    def __init__(self, kernel: FilterKernel, fields: Array) -> None:
        self._kernel, self._fields = kernel, np.ascontiguousarray(fields)
        self._reach, self._layered = kernel.reach, kernel.layered(self._fields)

    @property
    def layered(self) -> Array:
        """In the cells that particles reach now, see `FilterKernel.layered`; they change where space is cut anew."""
        if self._reach is not self._kernel.reach:
            self._reach, self._layered = self._kernel.reach, self._kernel.layered(self._fields)
        return self._layered


class WallsOfCells:
    """What the smooth walls of a grid leave of flows that particles drive.

    kernel  of the run, on a grid with smooth walls
    kind    of the kernel
    """

    def __init__(self, kernel: FilterKernel, kind: int = 0) -> None:
        whole, lattice = kernel.grid.whole, lattice_of(kernel, kind)
        centres = [np.ravel(coordinate) for coordinate in np.broadcast_arrays(*whole.centres())]
        distance = np.maximum(contents(whole.walls, whole.spacing, *centres)[1], 0.0)
        normal = _normals(whole.walls, centres, min(whole.spacing))
        number = kernel.of_large_cells(kernel.grid.part(np.indices(whole.shape, dtype=float)[::-1]))
        fields = kernel.grid.part(np.concatenate([distance[None], normal]).reshape(-1, *whole.shape))
        self._kernel, self._fields = kernel, ConstantFields(kernel, np.concatenate([number, fields]))
        self._cell, self._periods = cell_of(kernel), periods_of(kernel)
        self._axes = np.array(whole.cells) > 1
        flow = tables_of(*lattice).flow
        self._free = np.ascontiguousarray(np.moveaxis(flow, (0, 1), (3, 4)))
        alone = [np.moveaxis(normal_first(flow, axis), 2, 0).swapaxes(1, 2) for axis in range(3)]
        lost = []
        for axis, far in enumerate(alone):
            half, full, more = (flow_beside(axis, "smooth", *lattice, share) for share in (0.5, 1.0, 1.5))
            in_layer = [half[0, 0], full[0, 0], more[0, 0], half[0, 1], full[0, 1], more[0, 1], *full[0, 2:]]
            across = [half[1, 0], full[1, 0], more[1, 0], *full[1, 1:-1]]
            lost.append(np.array([_lost(far[0], in_layer, AWAY[0]), _lost(far[1], across, AWAY[1])]))
        self._tables = tuple(
            np.stack([by_apart(table, axis) for axis, table in enumerate(tables)]) for tables in (alone, lost)
        )

    def left(self, position: Array, flow: Array) -> Array:
        """The modes of flows (N, MODES, 3) that particles at these places (N, 3) [m] drive or gather, beside walls."""
        kernel, left = self._kernel, np.empty_like(flow)
        stencil = kernel.stencil(position, np.zeros(len(position)))
        pairs, normal = np.empty((len(position), 2, 16)), np.empty((len(position), 3))
        at_wall = 0.5 * (AWAY[0, 2] + AWAY[0, 3]) * min(kernel.grid.spacing)
        _sort_pairs(stencil, kernel.corners, self._fields.layered, self._periods, at_wall, pairs, normal)
        _leave(position, (pairs, normal), (self._cell, self._axes), (self._free, *self._tables), flow, left)
        return left


class SolidsOfCells:
    """The solid fraction that particles gather of their own volume, on a grid with smooth walls.

    kernel  of the run
    passes  how often the gathered volume has passed the second stage of the kernel: 1 or 2
    kind    of the kernel
    """

    def __init__(self, kernel: FilterKernel, passes: int, kind: int = 0) -> None:
        numbers = np.indices(kernel.grid.whole.shape, dtype=float)[::-1]  # along x, y, z
        place = kernel.of_large_cells(kernel.grid.part(numbers))
        exchanged = kernel.of_large_cells(_exchanged(kernel, passes, kind))
        self._kernel, self._fields = kernel, ConstantFields(kernel, np.concatenate([place, exchanged]))
        self._periods = periods_of(kernel)

    def of(self, position: Array, volume: Array) -> Array:
        """Of particles at these places (N, 3) [m] with these volumes (N,) [m3]; (N,) [-]."""
        kernel, own = self._kernel, np.empty(len(volume))
        stencil = kernel.stencil(position, np.zeros(len(position)))
        share = volume / kernel.grid.cell_volume
        _pairs(stencil, kernel.corners, self._fields.layered, self._periods, share, own)
        return own


def _normals(surface: Surface, centres: list[Array], spacing: float) -> Array:
    """Normals of the wall, into the fluid, at points x, y, z of one shape (3, n); 0 where the distance has no slope."""
    slope = np.empty((3, centres[0].size))
    for d in range(3):
        step = [1e-3 * spacing * (d == e) for e in range(3)]
        high, low = (surface.distance(*(c + side * s for c, s in zip(centres, step))) for side in (1.0, -1.0))
        slope[d] = high - low
    x, y, z = slope
    normal: Array = slope / np.sqrt(np.maximum(x * x + y * y + z * z, 1e-300))
    return normal


def periods_of(kernel: FilterKernel) -> Array:
    """Cells after which x, y, z begin again (3,)."""
    counts = np.array(kernel.grid.whole.cells, float)
    return np.where(kernel.periodic, counts, NEVER * counts)


def _exchanged(kernel: FilterKernel, passes: int, kind: int) -> Array:
    """What every cell gathers of a unit that is deposited on each of `NEIGHBOURS` (27, nz, ny, nx) [-].

    Cells that are too far apart to gather from each other are found together.
    """
    whole, (sweeps, _) = kernel.grid.whole, kernel.stages[kind]
    apart, turns = min(passes * sweeps, APART) + 2, []
    for count, periodic in zip(whole.shape, kernel.periodic[::-1]):
        number, rest = np.arange(count), count % apart if periodic else 0
        turns.append(np.where(number < count - rest, number % apart, number - count + rest + apart))
    (z, y, x), counts = np.ix_(*turns), [int(turn.max()) + 1 for turn in turns]  # local: every rank knows the whole box
    turn = ((z * counts[1] + y) * counts[2] + x).astype(np.uint16)
    exchanged, cells = np.zeros((len(NEIGHBOURS), *kernel.grid.shape)), math.prod(kernel.grid.shape)
    of_neighbours = np.stack([
        kernel.grid.part(np.roll(turn, [-step for step in steps], axis=(0, 1, 2))).ravel() for steps in NEIGHBOURS
    ]).ravel()  # fmt: skip
    order = np.argsort(of_neighbours, kind="stable")
    begins = np.searchsorted(of_neighbours[order], np.arange(math.prod(counts) + 1))
    for number in np.unique(turn):
        fields = kernel.of_deposits(kernel.grid.part(turn == number).astype(float)[None])
        for _ in range(passes if sweeps else 0):
            fields = kernel.smooth(fields, kernel.stages[kind])
        here = order[begins[number] : begins[number + 1]]
        exchanged.reshape(-1)[here] = fields.reshape(-1)[here % cells]
    return exchanged


@inline
def _step(here, there, period):
    """From a number of cells to the nearest image of another one, after so many cells: -1, 0 or 1."""
    apart = there - here
    apart -= period * np.rint(apart / period)
    return 1 if apart > 0.5 else (-1 if apart < -0.5 else 0)


@threaded
def _pairs(stencil, corners, around, periods, volume, own):
    """Sum over pairs of the cells of each particle.

    around   of cells: number along x, y, z of the large cell, and what it gathers of `NEIGHBOURS` (cells, 3 + 27)
    periods  cells after which x, y, z begin again (3,)
    volume   over that of a cell (N,)
    """
    for n in prange(len(volume)):
        total, first = 0.0, stencil.first[n, 0]
        a, b, c = stencil.shares[n, 0, 0], stencil.shares[n, 0, 1], stencil.shares[n, 0, 2]
        for i in range(8):
            here = around[first + corners[i]]
            for j in range(8):
                there = around[first + corners[j]]
                x, y = _step(here[0], there[0], periods[0]), _step(here[1], there[1], periods[1])
                z = _step(here[2], there[2], periods[2])
                total += weight(i, a, b, c) * weight(j, a, b, c) * here[3 + 9 * (z + 1) + 3 * (y + 1) + x + 1]
        own[n] = volume[n] * total


@threaded
def _sort_pairs(stencil, corners, around, periods, at_wall, pairs, normal):
    """Find the mean normal of the wall in the cells of each particle (N, 3), and the weights of pairs of these cells
    and their mean distance from the wall [m], by how far they lie apart along z, y, x: first of those at the wall, then
    of the others (N, 2, 16).

    around   of cells: number along x, y, z of the large cell, distance and normal (cells, 7)
    periods  cells after which x, y, z begin again (3,)
    at_wall  largest distance of cells at the wall [m]
    """
    for n in prange(len(pairs)):
        first, toward = stencil.first[n, 0], NOTHING
        a, b, c = stencil.shares[n, 0, 0], stencil.shares[n, 0, 1], stencil.shares[n, 0, 2]
        pairs[n] = 0.0
        for i in range(8):
            here, of_here = around[first + corners[i]], weight(i, a, b, c)
            toward = plus(toward, times(of_here, (here[4], here[5], here[6])))
            for j in range(8):
                there, share = around[first + corners[j]], of_here * weight(j, a, b, c)
                x, y = abs(_step(here[0], there[0], periods[0])), abs(_step(here[1], there[1], periods[1]))
                away = 0.5 * (here[3] + there[3])
                apart = 4 * abs(_step(here[2], there[2], periods[2])) + 2 * y + x + (8 if away > at_wall else 0)
                pairs[n, 0, apart] += share
                pairs[n, 1, apart] += share * away
        for apart in range(16):
            pairs[n, 1, apart] /= max(pairs[n, 0, apart], LEAST)
        toward = times(1.0 / math.sqrt(max(dot(toward, toward), LEAST)), toward)
        normal[n, 0], normal[n, 1], normal[n, 2] = toward


def _lost(far: Array, beside: Sequence[Array], away: Array) -> Array:
    """What a wall takes of the flow far from it, times the distance (distances, MODES, 3, 2, 2)."""
    taken = [distance * (far - near) for distance, near in zip(away, beside)]
    return np.stack(taken + taken[-1:] * (len(away) - len(taken)))


PIECE = 64
"""Particles that share an array for sums over pairs."""


@threaded
def _leave(position, around, lattice, tables, flow, left):
    """Write what walls leave of the modes of every particle (N, MODES, 3).

    around   pairs and normals, of `_sort_pairs`
    lattice  of `cell_of`, and whether there are several cells along each axis
    tables   flow far from walls by distance along z, y, x (2, 2, 2, 3, MODES); `by_apart` of the same, and of what
             walls take times the distance
    """
    count = len(position)
    for piece in prange((count + PIECE - 1) // PIECE):
        room = np.empty((3, 3 * flow.shape[1])), np.empty(flow.shape[1])
        for n in range(piece * PIECE, min((piece + 1) * PIECE, count)):
            _leave_one(n, position, around, lattice, tables, flow, room, left)


@inline
def _leave_one(n, position, around, lattice, tables, flow, room, left):
    """`_leave` of one particle; room for flows beside walls across each axis, and through the wall."""
    ((origin, inverse, linear), axes), (of_free, alone, lost), (pairs, normals) = lattice, tables, around
    sums, through = room
    normal, count, modes = of_row(normals, n), 0.0 + axes[0] + axes[1] + axes[2], flow.shape[1]
    on_axis = dot(normal, normal) < 0.5  # where the distance has no slope
    narrow = 1.0 if on_axis else max(abs(normal[0]), abs(normal[1]), abs(normal[2]))
    for axis in range(3):
        if on_axis or normal[axis] != 0.0:
            _over_pairs(n, pairs, axis, inverse[axis], narrow, alone, lost, sums)
        else:
            sums[axis] = 0.0
    shares = shares_in_cell(n, position, origin, inverse, linear)
    through[:] = 0.0
    for d in range(3):
        first, second = (1 if d == 0 else 0), (1 if d == 2 else 2)
        one, other = normal[first] ** 2, normal[second] ** 2
        if on_axis:
            one, other = axes[first] / count, axes[second] / count
        one, other = one if one > LEAST else 0.0, other if other > LEAST else 0.0
        squares, at, next_at = LEAST + one + other, _place(first, d, modes), _place(second, d, modes)
        for k in range(modes):
            along = one * sums[first, at + k] + other * sums[second, next_at + k]
            free = max(at_shares(of_free[..., d, k], shares), 1e-300)
            lengthwise = math.sqrt(max(along / (squares * free), 0.0))
            left[n, k, d] = lengthwise * flow[n, k, d]
            through[k] += normal[d] * (math.sqrt(max(sums[d, k] / free, 0.0)) - lengthwise) * flow[n, k, d]
    for k in range(modes):
        for d in range(3):
            left[n, k, d] += through[k] * normal[d]


@inline
def _place(axis, d, modes):
    """Where the modes of flow along d begin beside a wall across an axis: those along the axis come first."""
    return 0 if d == axis else modes * (1 + d - (1 if d > axis else 0))


def by_apart(table: Array, axis: int) -> Array:
    """A table (2, ..., MODES, 3, 2, 2) by distance along the normal of a wall, mode, direction and distance along it,
    as (8, ..., 3 MODES): by 4 z + 2 y + x of distances along the axes, and in the order of `_place`."""
    first, second = (d for d in range(3) if d != axis)
    cells = []
    for apart in range(8):
        steps = apart & 1, apart >> 1 & 1, apart >> 2
        part = table[steps[axis], ..., steps[first], steps[second]][..., [axis, first, second]]
        cells.append(part.swapaxes(-1, -2).reshape(*part.shape[:-2], -1))
    return np.stack(cells)


@inline
def _over_pairs(n, pairs, axis, inverse, narrow, alone, lost, sums):
    """Write the modes of flow of a particle beside a wall across an axis, in the order of `_place`.

    narrow  part of the flow along the wall that its slant leaves in the cells at it
    """
    modes = sums.shape[1] // 3
    sums[axis] = 0.0
    for apart in range(16):
        share = pairs[n, 0, apart]
        if share > 0.0:
            away, cells = pairs[n, 1, apart] * inverse, apart % 8
            slant = 1.0 - (1.0 - narrow) * min(max((AWAY[0, 3] - away) / (AWAY[0, 3] - AWAY[0, 2]), 0.0), 1.0)
            distances, row = AWAY[(cells >> axis) & 1], 0
            while row < len(distances) - 2 and away > distances[row + 1]:
                row += 1
            inside = min(max(away, distances[0]), distances[-1])
            part = (inside - distances[row]) / (distances[row + 1] - distances[row])
            length, near = max(away, distances[0]), min(away / distances[0], 1.0)
            for i in range(3 * modes):
                low, high = lost[axis, cells, row, i], lost[axis, cells, row + 1, i]
                left = (alone[axis, cells, i] - (low + part * (high - low)) / length) * near
                sums[axis, i] += (share if i < modes else share * slant) * left
