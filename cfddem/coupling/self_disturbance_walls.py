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
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from cfddem.backend.compile import prange, threaded
from cfddem.coupling.kernel import FilterKernel, ParticleCellMap
from cfddem.coupling.self_disturbance_tables import CELLS, MODES, Tables, mode_of, spacing_of, tables_of
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.grid import Array

PLACES = 4
"""Tabulated distances from the wall within a cell."""

FARTHEST = 5
"""Last tabulated distance in cells; beyond it the effect of the wall falls as the inverse distance."""


class WallShares(NamedTuple):
    """Shares of the self-disturbance that are left beside a wall, by distance from it."""

    flow: Array  # of every mode of a force along x, y, z (places, MODES, 3) [-]
    solid: Array  # own solid fraction over that far from walls (places,) [-]


class WallsOfGrid:
    """Sides of the grid that stop the self-disturbance: all but periodic sides and outlets.

    kernel      of the run; the tables are found once for each grid
    boundaries  of the fluid
    """

    def __init__(self, kernel: FilterKernel, boundaries: Boundaries) -> None:
        grid = kernel.grid.whole
        self._sides = []
        for side in boundaries.box.sides:
            if grid.cells[side.axis] > 1 and not side.outlet.any():  # local: every rank has the whole box
                slips = bool((side.mirror > 0.0).all())  # local: likewise
                shares = shares_beside(side.axis, slips, spacing_of(kernel), tuple(kernel.strength), kernel.sweeps)
                place = grid.origin[side.axis] + (grid.size[side.axis] if side.high else 0.0)
                self._sides.append((side.axis, place, side.inward / grid.spacing[side.axis], shares))

    def left(self, cell_map: ParticleCellMap) -> WallShares:
        """What the walls leave to particles: root of the share of their modes (N, MODES, 3), share of solids (N,)."""
        count = len(cell_map.position)
        left = WallShares(np.ones((count, MODES, 3)), np.ones(count))
        for axis, place, inward, shares in self._sides:
            _leave(cell_map.position, axis, place, inward, *shares, *left)
        return left._replace(flow=np.sqrt(left.flow))


@threaded
def _leave(position, axis, place, inward, flow, solid, modes, own):
    """Multiply the shares of modes and of own solid fractions by those at the distance of every particle."""
    last = len(solid) - 1
    for n in prange(len(position)):
        away = max((position[n, axis] - place) * inward, 0.0) * PLACES
        row, beyond = min(int(away), last - 1), max(away / last, 1.0)
        part = min(away - row, 1.0)
        own[n] *= 1.0 + (solid[row] + part * (solid[row + 1] - solid[row]) - 1.0) / beyond
        for k in range(modes.shape[1]):
            for d in range(3):
                share = flow[row, k, d] + part * (flow[row + 1, k, d] - flow[row, k, d])
                modes[n, k, d] *= 1.0 + (share - 1.0) / beyond


@lru_cache(maxsize=16)
def shares_beside(
    axis: int, slips: bool, spacing: tuple[float, ...], strength: tuple[float, ...], sweeps: int
) -> WallShares:
    """Shares beside a wall.

    axis      of its normal
    slips     whether the fluid slips along it
    spacing   of the cells [m]
    strength  of each sweep of the kernel's second stage along x, y, z
    """
    free, counts = tables_of(spacing, strength, sweeps), np.rint(CELLS * max(spacing) / np.array(spacing)).astype(int)
    across, normal = [d for d in range(3) if d != axis], _Normal(int(counts[axis]), spacing[axis], slips)
    ends = (
        min((2.0 * math.sin(math.pi / n) / h) ** 2 for n, h in zip(counts, spacing)),
        sum(4.0 / h**2 for h in spacing),
    )
    flow, solid = np.zeros((len(normal.weights), MODES, 3)), np.zeros(len(normal.weights))

    def add(d: int, driven: Array, rates: Array, weight: float) -> None:
        """Add the flow of eigenvectors that a force along d drives (places, n) at rates over the viscosity (n,)."""
        mode = mode_of(rates, *ends)
        for k in range(MODES):
            flow[:, k, d] += weight * (driven[:, mode == k] ** 2 / rates[mode == k]).sum(axis=1)  # local: of a table

    for numbers in product(*(range(counts[e] // 2 + 1) for e in across)):
        waves = [2.0 * math.pi * n / counts[e] for n, e in zip(numbers, across)]
        squares = [(2.0 * math.sin(0.5 * wave) / spacing[e]) ** 2 for wave, e in zip(waves, across)]
        square = sum(squares)
        weight = math.prod(1.0 if 2 * n in (0, counts[e]) else 2.0 for n, e in zip(numbers, across))
        weight /= math.prod(int(counts[e]) for e in across) * math.prod(spacing)
        smoothing = 1.0 - sum(strength[e] * spacing[e] ** 2 * each for each, e in zip(squares, across))
        given = normal.smoothed(smoothing, strength[axis], sweeps)
        solid += weight * (given * normal.weights).sum(axis=1)  # local: of a table
        if square > 0.0:
            rates, stream = normal.stokes(square)
            add(axis, math.sqrt(square) * given @ normal.mean @ stream, rates, weight)
            lengthwise = given @ normal.slope @ stream
        for d, wave, along in zip(across, waves, squares):
            share, staggered = along / square if square > 0.0 else 0.0, weight * math.cos(0.5 * wave) ** 2
            if square > 0.0:
                add(d, lengthwise, rates, staggered * share)
            apart = normal.rates + square
            moving = apart > 1e-9 * ends[0]  # all but the fluid as a whole, over a wall without friction
            add(d, (given @ normal.vectors)[:, moving], apart[moving], staggered * (1.0 - share))
    return _over(flow, solid, free, axis)


def _over(flow: Array, solid: Array, free: Tables, axis: int) -> WallShares:
    """Flow and solid fraction beside the wall over those far from it, at the same places within a cell."""
    place = np.arange(len(solid)) / PLACES - 0.5
    part = place - np.floor(place)
    apart = 2.0 * part * (1.0 - part)

    def alone(table: Array) -> Array:
        """A table by distance between deposit and gather, at all places."""
        near, far = table[..., 0, 0, 0], np.moveaxis(table, -1 - axis, -3)[..., 1, 0, 0]
        return near + np.multiply.outer(apart, far - near)

    of_flow = np.moveaxis(alone(free.flow), 1, 2)
    return WallShares(flow / of_flow, solid / alone(free.solid))


class _Normal:
    """Operators along the normal of a wall, from the wall up to a distant plane without friction.

    cells, spacing  along the normal
    slips           whether the fluid slips along the wall
    """

    def __init__(self, cells: int, spacing: float, slips: bool) -> None:
        self.spacing = spacing
        self.slope = (np.eye(cells, cells - 1) - np.eye(cells, cells - 1, -1)) / spacing  # faces to cells
        self.mean = 0.5 * (np.eye(cells, cells - 1) + np.eye(cells, cells - 1, -1))
        even = self.slope @ self.slope.T
        self._along = even.copy()  # Laplacian of the velocity along the wall
        self._along[0, 0] += 0.0 if slips else 2.0 / spacing**2
        self._towards = self.slope.T @ self.slope
        self._even_rates, self._even = np.linalg.eigh(even)
        self.rates, self.vectors = np.linalg.eigh(self._along)
        places = np.arange(PLACES * FARTHEST + 1)[:, None] / PLACES - 0.5
        self.weights = np.maximum(1.0 - np.abs(np.maximum(places, 0.0) - np.arange(cells)), 0.0)

    def smoothed(self, others: float, strength: float, sweeps: int) -> Array:
        """Weights of the cells at all places after the second stage of the kernel; others is its share across."""
        factors = (others - strength * self.spacing**2 * self._even_rates) ** sweeps
        smoothed: Array = (self.weights @ self._even * factors) @ self._even.T
        return smoothed

    def stokes(self, square: float) -> tuple[Array, Array]:
        """Rates over the viscosity and stream functions of the flow with the wave number squared along the wall."""
        identity = np.eye(len(self._towards))
        mass = square * identity + self._towards
        along = square * self._towards + self.slope.T @ self._along @ self.slope
        rates, stream = eigh(square * (square * identity + self._towards) + along, mass)
        return rates, stream
