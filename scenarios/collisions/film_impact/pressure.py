r"""Pressure of the liquid and speed of the bead, solved as one; cavitation.

For each liquid cell, what leaves through its open faces and what the bead displaces add to zero:

.. math:: \sum_f A_f\,b_f\Big[u_f^* - \frac{\Delta t}{\rho\,\theta_f\Delta x}(p_{nb} - p_c)\Big] + J_c V = 0,
          \qquad V = V^* + \frac{\Delta t}{m}\sum_c J_c p_c

with the open area A, the resistance of a thin gap b, the distance theta to the surface, and the horizontal projection J
of the bead's surface within the cell. The matrix without V is symmetric and banded; V follows from two right-hand
sides.

Each liquid cell either has no void and a pressure above the floor, or the pressure of the floor and a void whose volume
grows or shrinks. The set of cells with voids is found by exchanging cells until every one satisfies its inequality.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cfddem.backend.compile import inline, serial
from scenarios.collisions.film_impact.grid import Cells, Faces, Grid

SHORTEST = 0.1
"""Least distance from the centre of a liquid cell to the surface, in cells."""


@dataclass
class Bead:
    """The moving bead: lowest point and speed, both positive upwards."""

    radius: float  # [m]
    mass: float  # [kg]; infinite for a prescribed speed
    gap: float  # height of the lowest point [m]
    velocity: float  # [m/s]
    force: float = 0.0  # of the liquid's pressure in the last step [N]


@dataclass
class Voids:
    """Voids of a liquid that cavitates."""

    floor: float  # lowest pressure, below 0 [Pa]
    volume: np.ndarray  # void in each cell [m3]
    unsettled: int = 0  # steps in which the cells with voids were not found
    work: float = 0.0  # that opened them, less what they gave back when they closed [J]


@inline
def distance(filled, liquid, i, j, k, m):
    """Distance from the centre of a liquid cell to the next pressure, in cells: 1, or to the surface.

    A plane surface at a distance s fills 1/2 + s - s^2/2 of the tent around this cell, and s^2/2 around the next.
    """
    if not (0 <= k < liquid.shape[0] and 0 <= m < liquid.shape[1]):
        return 0.5
    if liquid[k, m]:
        return 1.0
    below = 1.0 - math.sqrt(2.0 - 2.0 * min(max(filled[i, j], 0.5), 1.0))
    above = math.sqrt(2.0 * min(max(filled[k, m], 0.0), 0.5))
    return min(max(0.5 * (below + above), SHORTEST), 1.0)


@serial
def number_cells(liquid, number):
    """Number the liquid cells column by column; returns their count and the largest step between neighbours."""
    count, band = 0, 1
    for i in range(liquid.shape[0]):
        for j in range(liquid.shape[1]):
            number[i, j] = -1
            if liquid[i, j]:
                number[i, j] = count
                if i > 0 and number[i - 1, j] >= 0:
                    band = max(band, count - number[i - 1, j])
                count += 1
    return count, band


@serial
def assemble(number, cells, opening, mobility_u, edges, flow, rate, system):
    """Rows of the pressure equation.

    opening     open fraction of faces, as `Faces`; flow and edges likewise
    mobility_u  factor of velocity and pressure gradient by the resistance of thin gaps
    edges       pressure at the surface, where it crosses between the cells of a face
    rate        time step over density
    system      lower bands of the matrix, outflow of each cell, projected area of the bead; all are filled
    """
    (liquid, filled, dx, outer_open, _), (open_u, open_w), (u, w), (edge_u, edge_w) = cells, opening, flow, edges
    matrix, outflow, projected = system
    radial, vertical = liquid.shape
    for i in range(radial):
        ring = math.pi * dx * dx * (2.0 * i + 1.0)
        for j in range(vertical):
            c = number[i, j]
            if c < 0:
                continue
            projected[c] = ring * (open_w[i, j] - open_w[i, j + 1])
            for side in range(4):
                k, m = i + (side == 1) - (side == 0), j + (side == 3) - (side == 2)
                if k < 0 or m < 0 or (k == radial and not outer_open):
                    continue
                if side < 2:
                    face = max(i, k)
                    area = 2.0 * math.pi * face * dx * dx * open_u[face, j] * mobility_u[face, j]
                    flow = u[face, j] if side == 1 else -u[face, j]
                    edge = edge_u[face, j]
                else:
                    face = max(j, m)
                    area = ring * open_w[i, face]
                    flow = w[i, face] if side == 3 else -w[i, face]
                    edge = edge_w[i, face]
                outflow[c] += area * flow
                link = area * rate / (dx * distance(filled, liquid, i, j, k, m))
                matrix[0, c] += link
                if k < radial and m < vertical and number[k, m] >= 0:
                    if number[k, m] < c:
                        matrix[c - number[k, m], number[k, m]] = -link
                else:
                    outflow[c] -= link * edge


@serial
def correct(number, cells, opening, mobility_u, edges, flow, rate, p):
    """Subtract the pressure gradient on every open face of a liquid cell; closed faces have no flow."""
    (liquid, filled, dx, outer_open, _), (open_u, open_w), (u, w), (edge_u, edge_w) = cells, opening, flow, edges
    radial, vertical = liquid.shape
    for i in range(radial + 1):
        for j in range(vertical):
            left = i > 0 and liquid[i - 1, j]
            right = i < radial and liquid[i, j]
            if not (left or right):
                continue
            if i == 0 or (i == radial and not outer_open) or open_u[i, j] == 0.0:
                u[i, j] = 0.0
                continue
            low = p[number[i - 1, j]] if left else edge_u[i, j]
            high = p[number[i, j]] if right else edge_u[i, j]
            length = distance(filled, liquid, i - 1, j, i, j) if left else distance(filled, liquid, i, j, i - 1, j)
            u[i, j] = mobility_u[i, j] * (u[i, j] - rate * (high - low) / (dx * length))
    for i in range(radial):
        for j in range(vertical + 1):
            below = j > 0 and liquid[i, j - 1]
            above = j < vertical and liquid[i, j]
            if not (below or above):
                continue
            if j == 0 or open_w[i, j] == 0.0:
                w[i, j] = 0.0
                continue
            low = p[number[i, j - 1]] if below else edge_w[i, j]
            high = p[number[i, j]] if above else edge_w[i, j]
            length = distance(filled, liquid, i, j - 1, i, j) if below else distance(filled, liquid, i, j, i, j - 1)
            w[i, j] -= rate * (high - low) / (dx * length)


@dataclass
class Solved:
    """Pressure of one step."""

    pressure: np.ndarray  # in the liquid cells (radial, vertical); 0 elsewhere [Pa]
    force: float  # on the bead [N]
    plate: float  # on the plate [N]


def solve(
    grid: Grid, bead: Bead, flow: Faces, cells: Cells, mobility: np.ndarray, dt: float, voids: Voids | None = None,
    *, edges: Faces | None = None,
) -> Solved:  # fmt: skip
    """Make velocities and bead satisfy continuity; changes both.

    flow      radial and vertical velocity on the faces, before the pressure [m/s]
    mobility  factor of the radial faces by the resistance of thin gaps [-]
    voids     of a liquid that cavitates; their volume is updated
    edges     pressure of the surface on radial and horizontal faces [Pa]; without it 0
    """
    liquid = cells.liquid
    number = np.empty(liquid.shape, dtype=np.int64)
    count, band = number_cells(liquid, number)
    pressure = np.zeros(liquid.shape)
    if count == 0:
        bead.force = 0.0
        return Solved(pressure, 0.0, 0.0)
    matrix, outflow, projected = np.zeros((band + 1, count)), np.zeros(count), np.zeros(count)
    edges = Faces(*map(np.zeros_like, flow)) if edges is None else edges
    equation = (number, cells, grid.open, mobility, edges, flow, dt / cells.density)
    assemble(*equation, (matrix, outflow, projected))
    matrix[0, matrix[0] == 0.0] = 1.0
    share = dt / bead.mass
    if voids is None:
        p, bead.velocity = coupled(matrix, outflow, projected, bead.velocity, share)
    else:
        closing = voids.volume[liquid] / dt
        p, bead.velocity, growth, settled = with_voids(
            matrix, outflow, projected, bead.velocity, share, voids.floor, closing
        )
        voids.unsettled += not settled
        voids.volume[liquid] = np.maximum(voids.volume[liquid] + growth * dt, 0.0)
        voids.volume[~liquid] = 0.0
        voids.work -= float(p @ growth) * dt
    bead.force = float(projected @ p)
    correct(*equation, p)
    pressure[liquid] = p
    return Solved(pressure, bead.force, float(grid.ring @ pressure[:, 0]))


# ---------------------------------------------------------------- cavitation


EXCHANGES = 50
"""Largest number of exchanges between the two sets; then the last set is taken and the step counted."""


def coupled(
    matrix: np.ndarray, outflow: np.ndarray, projected: np.ndarray, velocity: float, share: float
) -> tuple[np.ndarray, float]:
    """Pressure and bead speed for which the outflow of every cell and the bead's displacement add to zero.

    matrix     lower bands of the pressure equation
    outflow    of each cell before the pressure [m3/s]
    projected  projected area of the bead in each cell [m2]
    velocity   of the bead before the pressure [m/s]
    share      time step over its mass [s/kg]
    """
    both = np.stack([-outflow, projected], axis=1)
    at_rest, moving = solve_banded(matrix, both).T
    speed = float((velocity + share * (projected @ at_rest)) / (1.0 + share * (projected @ moving)))
    return at_rest - speed * moving, speed


def with_voids(
    matrix: np.ndarray, outflow: np.ndarray, projected: np.ndarray, velocity: float, share: float, floor: float,
    closing: np.ndarray,
) -> tuple[np.ndarray, float, np.ndarray, bool]:  # fmt: skip
    """The same with a lowest pressure.

    floor    lowest pressure [Pa]
    closing  void of each cell over the time step [m3/s]
    returns  pressure, speed, the rate at which the void of each cell grows [m3/s], and whether every cell satisfies its
             inequality
    """
    void = closing > 0.0
    for _ in range(EXCHANGES):
        pressure, speed = _with_fixed(
            matrix, outflow + np.where(void, 0.0, closing), projected, velocity, share, floor * void
        )
        growth = np.where(void, _times(matrix, pressure) + outflow + projected * speed, -closing)
        opens, shuts = ~void & (pressure < floor), void & (growth < -closing)
        if not (opens.any() or shuts.any()):
            return pressure, speed, growth, True
        void = (void | opens) & ~shuts
    return pressure, speed, growth, False


def _with_fixed(
    matrix: np.ndarray, outflow: np.ndarray, projected: np.ndarray, velocity: float, share: float, fixed: np.ndarray
) -> tuple[np.ndarray, float]:
    """Pressure and bead speed with the pressure given in some cells, where `fixed` is not 0."""
    is_fixed = fixed != 0.0
    if not is_fixed.any():
        return coupled(matrix, outflow, projected, velocity, share)
    free = matrix.copy()
    free[:, is_fixed] = 0.0
    for band in range(1, len(matrix)):
        free[band, :-band][is_fixed[band:]] = 0.0
    free[0, is_fixed] = 1.0
    both = np.stack([-outflow - _times(matrix, fixed), projected], axis=1)
    both[is_fixed] = np.stack([fixed[is_fixed], np.zeros(is_fixed.sum())], axis=1)
    at_rest, moving = solve_banded(free, both).T
    speed = float((velocity + share * (projected @ at_rest)) / (1.0 + share * (projected @ moving)))
    return at_rest - speed * moving, speed


def _times(matrix: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Product of a symmetric matrix, given by its lower bands, with a vector."""
    product = matrix[0] * values
    for band in range(1, len(matrix)):
        product[band:] += matrix[band, :-band] * values[:-band]
        product[:-band] += matrix[band, :-band] * values[band:]
    return product


# ---------------------------------------------------------------- banded systems


@serial
def factorise(matrix, lower):
    """Cholesky factor, and whether all its pivots are above 0.

    matrix  lower bands (bands, n), entry [b, c] in row c + b
    lower   factor by columns (n, bands), entry [c, b] in row c + b
    """
    bands, count = matrix.shape
    for c in range(count):
        for b in range(bands):
            lower[c, b] = matrix[b, c] if c + b < count else 0.0
    for c in range(count):
        if not lower[c, 0] > 0.0:
            return False
        pivot = math.sqrt(lower[c, 0])
        for b in range(bands):
            lower[c, b] /= pivot
        for b in range(1, min(bands, count - c)):
            factor = lower[c, b]
            if factor != 0.0:
                for k in range(bands - b):
                    lower[c + b, k] -= factor * lower[c, b + k]
    return True


@serial
def substitute(lower, values):
    """Solve with the factor for each column of `values` (n, m), in place."""
    count, bands = lower.shape
    for m in range(values.shape[1]):
        for c in range(count):
            values[c, m] /= lower[c, 0]
            for b in range(1, min(bands, count - c)):
                values[c + b, m] -= lower[c, b] * values[c, m]
        for c in range(count - 1, -1, -1):
            for b in range(1, min(bands, count - c)):
                values[c, m] -= lower[c, b] * values[c + b, m]
            values[c, m] /= lower[c, 0]


def solve_banded(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution of a positive definite banded system.

    matrix   lower bands (bands, n), as for scipy.linalg.solveh_banded with lower=True
    right    right-hand sides (n, m)
    returns  solutions (n, m)
    """
    lower, solution = np.empty(matrix.shape[::-1]), np.array(right, dtype=float)
    if not factorise(matrix, lower):
        raise np.linalg.LinAlgError("the matrix of the pressure is not positive definite")
    substitute(lower, solution)
    return solution
