r"""What walls leave of the self-disturbance: the flow of a force beside a wall of the grid, over that far from walls.

A wall stops a part of the flow that a particle drives in the cells, all the more the closer it is and the longer the
waves. A law of the drag beside walls contains this effect, so it must not act on the slip a second time. The flow
beside a wall is known, as that far from walls is. Along the wall it is a sum over waves. From the wall up, the
eigenvectors of the discrete Stokes equations are found for every wave, between the wall and a distant plane without
friction. A stream function at the faces, with :math:`w = K\psi` and :math:`u = D\psi`, satisfies continuity:

.. math:: \left[K^2(K^2 + L_w) + D^T(K^2 + L_u)D\right]\phi = \Lambda\left[K^2 + D^TD\right]\phi

with the Laplacians L of the velocity w towards the wall and u along it, and the square K^2 of the wave number along the
wall. Each eigenvector belongs to the mode of the self-disturbance that has its rate.

A particle that moves gathers at one distance from the wall what it has deposited at another. The response between two
places is about the geometric mean of those at each: a mode gets the root of its share when it is driven, and again when
it is gathered.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache, lru_cache
from itertools import product
from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import eig, eigh

from cfddem.backend.compile import inline, prange, threaded
from cfddem.coupling.kernel import FilterKernel
from cfddem.coupling.self_disturbance_tables import CELLS, MODES, lattice_of, mode_of, solid_table, tables_of
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.grid import Array

PLACES = 4
"""Tabulated distances from the wall within a cell, of solids."""

FARTHEST = 5
"""Last tabulated distance in cells; beyond it the effect of the wall falls as the inverse distance."""


LAYERS = slice(PLACES // 2, None, PLACES)
"""Centres of cells among the tabulated distances."""


WallOf = Literal["side", "slips", "smooth"]
"""A side of the grid, one along which the fluid slips, or a smooth wall, whose shear rate is of second order."""


class _Side(NamedTuple):
    """A side of the grid that stops the self-disturbance."""

    axis: int
    place: float  # [m]
    inward: float  # 1 or -1 per spacing of the cells [1/m]
    slips: bool  # whether the fluid slips along it


class WallsOfGrid:
    """Sides of the grid that stop the self-disturbance: all but periodic and closed sides, and outlets.

    kernel      of the run; the tables are found once for each grid
    boundaries  of the fluid
    kind        of the kernel
    """

    def __init__(self, kernel: FilterKernel, boundaries: Boundaries, kind: int = 0) -> None:
        lattice, self._cell = lattice_of(kernel, kind), cell_of(kernel)
        self._sides = []
        for side in _sides(kernel, boundaries):
            alone = normal_first(tables_of(*lattice).flow, side.axis)
            self._sides.append(
                (
                    side,
                    (flow_beside(side.axis, "slips" if side.slips else "side", *lattice), np.ascontiguousarray(alone)),
                )
            )

    def left(self, position: Array) -> Array:
        """Root of the share of the modes of particles at these places (N, 3) [m] that the walls leave (N, MODES, 3)."""
        left = np.ones((len(position), MODES, 3))
        for side, flow in self._sides:
            _leave_flow(position, side.axis, side.place, side.inward, flow, self._cell, left)
        return np.sqrt(left)


class OwnSolids:
    """The solid fraction that particles gather of their own volume.

    kernel      of the run
    passes      how often the gathered volume has passed the second stage of the kernel: 1 or 2
    boundaries  of the fluid, whose walls throw it back; None to leave them out
    kind        of the kernel
    """

    def __init__(self, kernel: FilterKernel, passes: int, boundaries: Boundaries | None, kind: int = 0) -> None:
        lattice = lattice_of(kernel, kind, passes)
        self._cell = cell_of(kernel)
        self._table, sides = solid_table(*lattice), [] if boundaries is None else _sides(kernel, boundaries)
        self._sides = [(side, solid_beside(side.axis, *lattice)) for side in sides]

    def of(self, position: Array, volume: Array) -> Array:
        """Of particles at these places (N, 3) [m] with these volumes (N,) [m3]; (N,) [-]."""
        own = np.empty((len(volume), 1))
        _own_solids(position, volume, self._table, *self._cell, own)
        for side, shares in self._sides:
            _leave(position, side.axis, side.place, side.inward, shares[:, None], own)
        return own[:, 0]


def _sides(kernel: FilterKernel, boundaries: Boundaries) -> Iterator[_Side]:
    """The sides that stop the self-disturbance, among the cells of a kernel."""
    grid = kernel.grid.whole
    for side in boundaries.box.sides:
        is_open = np.any(boundaries.box.open_share(side) > 0.0)  # local: every rank has the whole box
        if is_open and grid.cells[side.axis] > 1 and not side.outlet.any():  # local: likewise
            slips = bool((side.mirror > 0.0).all())  # local: likewise
            place = grid.origin[side.axis] + (grid.size[side.axis] if side.high else 0.0)
            yield _Side(side.axis, place, side.inward / grid.spacing[side.axis], slips)


def cell_of(kernel: FilterKernel) -> tuple[Array, Array, float]:
    """Origin and inverse spacing of the grid, and 1 for a linear mapping, 0 for another one."""
    return np.array(kernel.grid.whole.origin), 1.0 / np.array(kernel.grid.spacing), float(kernel.mapping == "linear")


@inline
def shares_in_cell(n, position, origin, inverse, linear):
    """Along x, y, z, the share that a particle gathers from the neighbours of the cells on which it has deposited."""
    x = (position[n, 0] - origin[0]) * inverse[0] - 0.5
    y = (position[n, 1] - origin[1]) * inverse[1] - 0.5
    z = (position[n, 2] - origin[2]) * inverse[2] - 0.5
    a, b, c = linear * (x - math.floor(x)), linear * (y - math.floor(y)), linear * (z - math.floor(z))
    return 2.0 * a * (1.0 - a), 2.0 * b * (1.0 - b), 2.0 * c * (1.0 - c)


@inline
def at_shares(table, shares):
    """A table (2, 2, 2) by distance in cells between deposit and gather, averaged with these shares."""
    a, b, c = shares
    near = (1.0 - b) * ((1.0 - a) * table[0, 0, 0] + a * table[0, 0, 1])
    near += b * ((1.0 - a) * table[0, 1, 0] + a * table[0, 1, 1])
    far = (1.0 - b) * ((1.0 - a) * table[1, 0, 0] + a * table[1, 0, 1])
    far += b * ((1.0 - a) * table[1, 1, 0] + a * table[1, 1, 1])
    return (1.0 - c) * near + c * far


@threaded
def _own_solids(position, volume, table, origin, inverse, linear, own):
    for n in prange(len(volume)):
        own[n, 0] = volume[n] * at_shares(table, shares_in_cell(n, position, origin, inverse, linear))


@threaded
def _leave(position, axis, place, inward, shares, left):
    """Multiply values of every particle (N, m) by the shares of a wall (places, m) at its distance."""
    last = len(shares) - 1
    for n in prange(len(position)):
        away = max((position[n, axis] - place) * inward, 0.0) * PLACES
        row, beyond = min(int(away), last - 1), max(away / last, 1.0)
        part = min(away - row, 1.0)
        for m in range(left.shape[1]):
            share = shares[row, m] + part * (shares[row + 1, m] - shares[row, m])
            left[n, m] *= 1.0 + (share - 1.0) / beyond


@threaded
def _leave_flow(position, axis, place, inward, flow, cell, left):
    """Multiply the modes of every particle (N, MODES, 3) by the share that a wall leaves.

    flow  of cells beside the wall, of `flow_beside`, and far from walls, `normal_first`
    cell  of `cell_of`
    """
    (beside, alone), (origin, inverse, linear) = flow, cell
    last = beside.shape[1] - 1
    for n in prange(len(position)):
        away = (position[n, axis] - place) * inward - 0.5
        inside = min(max(away, 0.0), float(last))
        row = min(int(inside), last - 1)
        part, beyond = inside - row, max((away + 0.5) / (last + 0.5), 1.0)
        x, y, z = shares_in_cell(n, position, origin, inverse, linear)
        first, second = y if axis == 0 else x, y if axis == 2 else z
        across = (x if axis == 0 else (y if axis == 1 else z)) if away < last else 0.0
        for k in range(left.shape[1]):
            for d in range(3):
                flow_here = (1.0 - part) ** 2 * _along(beside[0, row, k, d], first, second)
                flow_here += part**2 * _along(beside[0, row + 1, k, d], first, second)
                flow_here += 2.0 * part * (1.0 - part) * _along(beside[1, row, k, d], first, second)
                of_cells = (1.0 - across) * _along(alone[d, k, 0], first, second)
                of_cells += across * _along(alone[d, k, 1], first, second)
                left[n, k, d] *= 1.0 + (flow_here / max(of_cells, 1e-300) - 1.0) / beyond


@inline
def _along(table, first, second):
    """A table (2, 2) by distance along a wall, averaged with these shares of the neighbours."""
    near = (1.0 - second) * table[0, 0] + second * table[0, 1]
    return (1.0 - first) * near + first * ((1.0 - second) * table[1, 0] + second * table[1, 1])


@lru_cache(maxsize=16)
def solid_beside(axis: int, spacing: tuple[float, ...], strength: tuple[float, ...], sweeps: int) -> Array:
    """Own solid fraction beside a wall, by distance from it, over that far from walls (places,) [-]; see
    `flow_beside`."""
    order = _normal_first(axis)
    spaces, strengths = tuple(spacing[d] for d in order), tuple(strength[d] for d in order)
    normal = _Normal(_cells_along(spaces)[0], spaces[0], "slips")
    solid = np.zeros(len(normal.weights))
    for _, squares, weight in _waves_along(spaces, math.prod(spacing)):
        modes = normal.smoothed(_left_across(squares, spaces, strengths), strengths[0], sweeps)
        solid += weight * (modes * normal.weights).sum(axis=1)  # local: of a table
    shares: Array = solid / _alone(solid_table(spacing, strength, sweeps), len(solid), axis)
    return shares[: PLACES * FARTHEST + 1]


Three = tuple[float, ...]
"""One of each direction."""


def _normal_first(axis: int) -> list[int]:
    """The normal of a wall, and the two directions along it."""
    return [axis, *(d for d in range(3) if d != axis)]


def _cells_along(spaces: Three) -> list[int]:
    """Number of cells along directions with these spacings [m]."""
    return [round(CELLS * max(spaces) / space) for space in spaces]


def _left_across(squares: list[float], spaces: Three, strengths: Three) -> float:
    """What one sweep of the second stage leaves of a wave along a wall [-]."""
    return 1.0 - sum(s * h**2 * square for square, h, s in zip(squares, spaces[1:], strengths[1:]))


def _waves_along(spaces: Three, volume: float) -> Iterator[tuple[list[float], list[float], float]]:
    """Waves along a wall: phase over a cell, squares of the wave number [1/m2], and weight in the sum [1/m3].

    spaces  of the cells, normal to the wall first [m]
    volume  of a cell [m3]
    """
    counts = _cells_along(spaces)[1:]
    for numbers in product(*(range(count // 2 + 1) for count in counts)):
        waves = [2.0 * math.pi * n / count for n, count in zip(numbers, counts)]
        squares = [(2.0 * math.sin(0.5 * wave) / h) ** 2 for wave, h in zip(waves, spaces[1:])]
        weight = math.prod(1.0 if 2 * n in (0, count) else 2.0 for n, count in zip(numbers, counts))
        yield waves, squares, weight / (math.prod(counts) * volume)


@lru_cache(maxsize=16)
def flow_beside(
    axis: int, wall: WallOf, spacing: tuple[float, ...], strength: tuple[float, ...], sweeps: int, share: float = 1.0
) -> Array:
    """Flow by a force in one of the first cells from a wall, per force and times the viscosity (2, FARTHEST, MODES, 3,
    2, 2) [1/m].

    It is that of cells that lie 0 or 1 farther from the wall, and 0 or 1 apart along each of the other two axes.

    axis      of its normal
    wall      how the fluid meets it
    spacing   of the cells [m]
    strength  of each sweep of the kernel's second stage along x, y, z
    share     of the cells at a smooth wall that is open; above 1 if they are taken together with the next ones
    """
    order = _normal_first(axis)
    spaces, strengths = tuple(spacing[d] for d in order), tuple(strength[d] for d in order)
    ends = (
        min((2.0 * math.sin(math.pi / n) / h) ** 2 for n, h in zip(_cells_along(spacing), spacing)),
        sum(4.0 / h**2 for h in spacing),
    )
    driven = _driven_flow((wall, share), spaces, strengths, sweeps, math.prod(spacing), ends)
    flow = np.empty_like(driven)
    flow[:, :, :, order] = driven
    return flow


def normal_first(table: Array, axis: int) -> Array:
    """A table (..., 2, 2, 2) by distance along z, y, x, by that along the normal of a wall and the other two axes."""
    return np.moveaxis(table, [-1 - d for d in _normal_first(axis)], [-3, -2, -1])


@lru_cache(maxsize=16)
def _driven_flow(
    wall: tuple[WallOf, float],
    spaces: Three,
    strengths: Three,
    sweeps: int,
    volume: float,
    ends: tuple[float, float],
) -> Array:
    """As `flow_beside`, with the normal of the wall as first direction. Of cubic cells it is the same for all walls.

    wall               and share, as of `flow_beside`
    spaces, strengths  likewise, normal to the wall first
    volume             of a cell [m3]
    ends               least and largest rate over the viscosity [1/m2]
    """
    normal = _Normal(_cells_along(spaces)[0], spaces[0], *wall)
    flow = np.zeros((2, FARTHEST, MODES, 3, 2, 2))

    @cache
    def of_wave(square: float, smoothing: float) -> tuple[Array, ...]:
        """Rates, and the flow normal to the wall and along it, each gathered and driven."""
        modes = normal.smoothed(smoothing, strengths[0], sweeps)[LAYERS]
        (rates, stream, pushed), towards = normal.stokes(square), math.sqrt(square) * modes @ normal.mean
        along = modes @ normal.slope
        return rates, towards @ stream, pushed @ towards.T, along @ stream, pushed @ along.T

    def add(d: int, gathered: Array, driven: Array, rates: Array, weight: Array) -> None:
        """Add the flow of eigenvectors that a force along d drives (n, layers) at rates over the viscosity (n,)."""
        mode, driven = mode_of(rates.real, *ends), driven.T
        for k in range(MODES):
            here, there, rate = gathered[:, mode == k], driven[:, mode == k], rates[mode == k]
            pairs = here[:-1] * there[:-1], 0.5 * (here[:-1] * there[1:] + here[1:] * there[:-1])
            for apart, pair in enumerate(pairs):
                response = (pair / rate).sum(axis=1).real  # local: of a table
                flow[apart, :, k, d] += np.multiply.outer(response, weight)

    for waves, squares, count in _waves_along(spaces, volume):
        weight = count * np.multiply.outer(*([1.0, math.cos(wave)] for wave in waves))
        square, smoothing = sum(squares), _left_across(squares, spaces, strengths)
        modes = normal.smoothed(smoothing, strengths[0], sweeps)[LAYERS]
        if square > 0.0:
            rates, towards, pushed, lengthwise, pushed_along = of_wave(square, smoothing)
            add(0, towards, pushed, rates, weight)
        for d, wave, along in zip((1, 2), waves, squares):
            share, staggered = along / square if square > 0.0 else 0.0, weight * math.cos(0.5 * wave) ** 2
            if square > 0.0:
                add(d, lengthwise, pushed_along, rates, staggered * share)
            sliding, vectors, slid = normal.sliding
            apart = sliding + square
            moving = apart.real > 1e-9 * ends[0]  # all but the fluid as a whole, over a wall without friction
            add(d, (modes @ vectors)[:, moving], (slid @ modes.T)[moving], apart[moving], staggered * (1.0 - share))
    return flow


def _alone(table: Array, places: int, axis: int) -> Array:
    """A table by distance between deposit and gather, far from a wall, at the tabulated distances from it."""
    place = np.arange(places) / PLACES - 0.5
    part = place - np.floor(place)
    near, far = normal_first(table, axis)[:, 0, 0]
    blend: Array = near + 2.0 * part * (1.0 - part) * (far - near)
    return blend


def _at_smooth_wall(share: float) -> tuple[Array, Array]:
    """Shear rates at a smooth wall and on the far side of the cells at it, times the spacing: weights of the velocities
    there and in the next cells. They are of a parabola with both means, see :mod:`cfddem.fluid.near_walls`.

    share  of the cells at the wall that is open
    """
    distance = np.array([0.5 * share, share + 0.5])
    depth = np.array([share**3, (share + 1.0) ** 3 - share**3]) / (3.0 * np.array([share, 1.0]) * distance)
    curvature = np.array([1.0, -1.0]) / (distance * (depth[1] - depth[0]))
    shear = np.array([1.0 / distance[0], 0.0]) + depth[0] * curvature
    return shear, shear - 2.0 * share * curvature


class _Normal:
    """Operators along the normal of a wall, from the wall up to a distant plane without friction.

    cells, spacing  along the normal
    wall, share     as of `flow_beside`
    """

    def __init__(self, cells: int, spacing: float, wall: WallOf, share: float = 1.0) -> None:
        self.spacing = spacing
        slope = (np.eye(cells, cells - 1) - np.eye(cells, cells - 1, -1)) / spacing  # faces to cells
        self.mean = 0.5 * (np.eye(cells, cells - 1) + np.eye(cells, cells - 1, -1))
        even = slope @ slope.T
        self._along, self._towards = even.copy(), slope.T @ slope  # Laplacians of both velocities, times the volumes
        self._along[0, 0] += 2.0 / spacing**2 if wall == "side" else 0.0
        if wall == "smooth":
            shear, beyond = _at_smooth_wall(share)
            self._along[:2, :2] += np.array([shear - beyond - (1.0, -1.0), beyond - (-1.0, 1.0)]) / spacing**2
            self._towards[0, 0] += (1.0 / share - 1.0) / spacing**2
        self._cells, self._faces = np.eye(cells), np.eye(cells - 1)  # volumes
        self._cells[0, 0], self._faces[0, 0] = share, 0.5 + 0.5 * share
        self.slope = np.linalg.inv(self._cells) @ slope
        self._even_rates, self._even = np.linalg.eigh(even)
        self.sliding = self._eigenvectors(self._along, self._cells)
        places = np.arange(PLACES * (FARTHEST + 1))[:, None] / PLACES - 0.5
        self.weights = np.maximum(1.0 - np.abs(np.maximum(places, 0.0) - np.arange(cells)), 0.0)

    def smoothed(self, others: float, strength: float, sweeps: int) -> Array:
        """Weights of the cells at all places after the second stage of the kernel; others is its share across."""
        factors = (others - strength * self.spacing**2 * self._even_rates) ** sweeps
        smoothed: Array = (self.weights @ self._even * factors) @ self._even.T
        return smoothed

    def _eigenvectors(self, matrix: Array, mass: Array) -> tuple[Array, Array, Array]:
        """Rates, eigenvectors, and what forces drive of each; complex for smooth walls."""
        if np.allclose(self._along, self._along.T, rtol=1e-12, atol=0.0):  # local: of modes
            rates, vectors = eigh(matrix, mass)
            return rates, vectors, vectors.T
        rates, vectors = eig(matrix, mass)
        return rates, vectors, np.linalg.inv(mass @ vectors)

    def stokes(self, square: float) -> tuple[Array, Array, Array]:
        """Rates over the viscosity and stream functions of the flow with the wave number squared along the wall, and
        what forces drive of each."""
        mass = square * self._faces + self.slope.T @ self._cells @ self.slope
        towards = square * (square * self._faces + self._towards)
        along = self.slope.T @ (square * self._cells + self._along) @ self.slope
        return self._eigenvectors(towards + along, mass)
