r"""What smooth walls, which cut cells, leave of the self-disturbance.

The flow of a particle is driven in the cells on which it deposits, and gathered from these. Beside a cut wall they may
lie at another distance from it than the particle: small cells are taken together with a larger one. So the shares are
those of cells. A cell has the root of what a plane wall at the mean distance of its open part leaves of each mode,
towards the wall and along it, and the normal of the wall. A particle gathers them as it gathers the fluid:

.. math:: u_k \to \left[r_t + (r_n - r_t)\,nn\right]\cdot u_k

Between tabulated distances d the logarithm of a share, times d, is linear: the effect of a wall falls as 1/d. Nearer
than half a cell a share falls as d. What a curved wall does beyond a plane one is left to the grid.

The solid fraction that a particle gathers of its own is a sum over pairs of its cells. What each cell gathers of itself
and of its neighbours is found with the kernel of the run, between all walls, once.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from cfddem.backend.compile import inline, prange, threaded
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.kernel_loops import gather, weight
from cfddem.coupling.self_disturbance_tables import MODES, lattice_of
from cfddem.coupling.self_disturbance_walls import PLACES, flow_beside
from cfddem.fluid.cut_cells import contents
from cfddem.fluid.grid import Array
from cfddem.fluid.surfaces import Surface

LEAST = 1e-12
"""Smallest share of a mode that counts [-]."""

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
        towards, along = np.zeros((2, MODES, distance.size))
        axes = [axis for axis in range(3) if whole.cells[axis] > 1]
        sloped = normal.any(axis=0)  # local: three components; not on the axis of a vessel, nor far from walls
        for axis in axes:
            roots = _roots(distance / whole.spacing[axis], flow_beside(axis, False, *lattice))
            weight = np.where(sloped, normal[axis] ** 2, 1.0 / len(axes))
            towards += weight * roots[:, axis]
            along += weight * 0.5 * (roots.sum(axis=1) - roots[:, axis])  # local: three components
        fields = np.concatenate([towards, along, normal]).reshape(-1, *whole.shape)
        self._kernel, self._fields = kernel, ConstantFields(kernel, kernel.grid.part(fields))

    def left(self, position: Array, flow: Array) -> Array:
        """The modes of flows (N, MODES, 3) that particles at these places (N, 3) [m] drive or gather, beside walls."""
        kernel, stencil = self._kernel, self._kernel.stencil(position, np.zeros(len(position)))
        layered = self._fields.layered
        values = np.empty((len(position), layered.shape[1]))
        gather(*stencil, kernel.corners, layered, values)
        towards, along, normal = values[:, :MODES], values[:, MODES : 2 * MODES], values[:, 2 * MODES :]
        x, y, z = normal.T
        normal = normal / np.sqrt(np.maximum(x * x + y * y + z * z, LEAST))[:, None]
        through = sum(flow[:, :, d] * normal[:, None, d] for d in range(3))
        left: Array = along[:, :, None] * flow + ((towards - along) * through)[:, :, None] * normal[:, None, :]
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
        counts = np.array(kernel.grid.whole.cells, float)
        self._periods = np.where(kernel.periodic, counts, NEVER * counts)

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


def _roots(distance: Array, shares: Array) -> Array:
    """Roots of the shares that a wall leaves at distances in cells (n,), of `flow_beside`; (MODES, 3, n)."""
    shares = np.maximum(shares[PLACES // 2 :: PLACES], LEAST)  # at the centres of cells
    at = np.arange(len(shares)) + 0.5
    strength = -np.log(shares) * at[:, None, None]
    away = np.maximum(distance, at[0])
    row = np.clip((away - at[0]).astype(int), 0, len(at) - 2)
    part = np.minimum(away - at[row], 1.0)[:, None, None]
    lost = (strength[row] + part * (strength[row + 1] - strength[row])) / away[:, None, None]
    roots = np.exp(-0.5 * lost) * np.sqrt(np.minimum(distance / at[0], 1.0))[:, None, None]
    return np.moveaxis(roots, 0, -1)


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
