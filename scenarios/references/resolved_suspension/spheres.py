r"""Rigid spheres on the lattice: solid weights, and the implicit exchange of momentum with the fluid.

A sphere covers a share :math:`\epsilon = \min(1, \max(0, 1/2 + R - r))` of a cell at a distance r from its centre. The
solid weight of a cell follows Noble & Torczynski (1998),

.. math:: B = \frac{\epsilon\,\theta}{1 - \epsilon + \theta},\qquad \theta = 3\nu,

so that friction in partly covered cells is proportional to the viscosity. Spheres that share a cell share its weight.

The fluid inside a sphere moves with it. The sphere itself carries only the excess of its mass over that fluid,
:math:`m_e = m - m_f`. Its velocity V and spin after a step solve

.. math:: m_e (V - V_0) = \sum_c B_c\,(m_c + F - V - \omega\times r_c) + P

and the matching equation of angular momentum. :math:`m_c` is the momentum that arrives in a cell, F the body force,
P the impulse of weight, contacts and films. The system is linear and is solved exactly for every sphere. It is stable
for every density ratio above 1, and momentum is conserved to round-off.
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline, prange, threaded

SUMS = 16
"""Sums over the cells of a sphere: weight, first moments (3), second moments (6), impulse (3), its moment (3)."""


@inline
def _covered(radius, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Share of a cell that a sphere covers, from the distance of the cell to the centre [cells]."""
    return min(1.0, max(0.0, 0.5 + radius - math.sqrt(dx * dx + dy * dy + dz * dz)))


@inline
def _weight(covered, share, softness):  # type: ignore[no-untyped-def]
    """Solid weight of a sphere in a cell: its part of what all solids cover, as friction against the viscosity."""
    return covered / share if share >= 1.0 else covered * softness / (1.0 - share + softness)


@inline
def _span(centre, radius, off):  # type: ignore[no-untyped-def]
    """First and last cell along an axis within the surface of a sphere, at a squared distance `off` aside."""
    room = (radius + 0.5) ** 2 - off
    if room <= 0.0:
        return 0, -1
    half = math.sqrt(room)
    return math.ceil(centre - half), math.floor(centre + half)


@threaded
def cover(positions, radius, share):  # type: ignore[no-untyped-def]
    """Add the share of every cell that spheres cover to `share` (z, y, x), plane by plane."""
    nz, ny, nx = share.shape
    for z in prange(nz):
        for s in range(len(positions)):
            cx, cy, cz = positions[s, 0], positions[s, 1], positions[s, 2]
            dz = z - cz
            dz -= nz * round(dz / nz)
            first, last = _span(cy, radius, dz * dz)
            for y in range(first, last + 1):
                dy = y - cy
                begin, end = _span(cx, radius, dz * dz + dy * dy)
                row = share[z, y % ny]
                for x in range(begin, end + 1):
                    row[x % nx] += _covered(radius, x - cx, dy, dz)


@threaded
def gather(positions, radius, share, softness, momentum, force, sums):  # type: ignore[no-untyped-def]
    """Sums over the cells of every sphere (spheres, SUMS): weights, their moments, and the momentum that arrives.

    share     part of each cell that all solids cover together; may be above 1
    momentum  of every cell before the collision (3, z, y, x)
    """
    nz, ny, nx = share.shape
    for s in prange(len(positions)):
        cx, cy, cz = positions[s, 0], positions[s, 1], positions[s, 2]
        total = np.zeros(SUMS)
        low, high = _span(cz, radius, 0.0)
        for z in range(low, high + 1):
            dz = z - cz
            first, last = _span(cy, radius, dz * dz)
            for y in range(first, last + 1):
                dy = y - cy
                begin, end = _span(cx, radius, dz * dz + dy * dy)
                for x in range(begin, end + 1):
                    dx = x - cx
                    b = _weight(_covered(radius, dx, dy, dz), share[z % nz, y % ny, x % nx], softness)
                    if b == 0.0:
                        continue
                    mx = momentum[0, z % nz, y % ny, x % nx] + force[0]
                    my = momentum[1, z % nz, y % ny, x % nx] + force[1]
                    mz = momentum[2, z % nz, y % ny, x % nx] + force[2]
                    total[0] += b
                    total[1] += b * dx
                    total[2] += b * dy
                    total[3] += b * dz
                    total[4] += b * dx * dx
                    total[5] += b * dy * dy
                    total[6] += b * dz * dz
                    total[7] += b * dx * dy
                    total[8] += b * dy * dz
                    total[9] += b * dz * dx
                    total[10] += b * mx
                    total[11] += b * my
                    total[12] += b * mz
                    total[13] += b * (dy * mz - dz * my)
                    total[14] += b * (dz * mx - dx * mz)
                    total[15] += b * (dx * my - dy * mx)
        sums[s] = total


@threaded
def impose(positions, velocity, spin, radius, share, softness, weight, target):  # type: ignore[no-untyped-def]
    """Add B and B u_s of all spheres to `weight` (z, y, x) and `target` (3, z, y, x), plane by plane."""
    nz, ny, nx = share.shape
    for z in prange(nz):
        for s in range(len(positions)):
            cx, cy, cz = positions[s, 0], positions[s, 1], positions[s, 2]
            vx, vy, vz = velocity[s, 0], velocity[s, 1], velocity[s, 2]
            wx, wy, wz = spin[s, 0], spin[s, 1], spin[s, 2]
            dz = z - cz
            dz -= nz * round(dz / nz)
            first, last = _span(cy, radius, dz * dz)
            for y in range(first, last + 1):
                dy = y - cy
                begin, end = _span(cx, radius, dz * dz + dy * dy)
                for x in range(begin, end + 1):
                    dx = x - cx
                    column = x % nx
                    b = _weight(_covered(radius, dx, dy, dz), share[z, y % ny, column], softness)
                    weight[z, y % ny, column] += b
                    target[0, z, y % ny, column] += b * (vx + wy * dz - wz * dy)
                    target[1, z, y % ny, column] += b * (vy + wz * dx - wx * dz)
                    target[2, z, y % ny, column] += b * (vz + wx * dy - wy * dx)


def exchange(
    sums: np.ndarray,
    velocity: np.ndarray,
    spin: np.ndarray,
    excess_mass: float,
    excess_inertia: float,
    impulse: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and spin of free spheres after a step, from the linear system of the implicit exchange.

    impulse  linear and angular, of all but the fluid (spheres, 6)
    """
    count = len(sums)
    matrix = np.zeros((count, 6, 6))
    right = sums[:, 10:16] + impulse
    right[:, :3] += excess_mass * velocity
    right[:, 3:] += excess_inertia * spin
    matrix[:, range(3), range(3)] = sums[:, :1] + excess_mass
    x, y, z = sums[:, 1], sums[:, 2], sums[:, 3]
    for row, column, value in ((0, 4, z), (0, 5, -y), (1, 3, -z), (1, 5, x), (2, 3, y), (2, 4, -x)):
        matrix[:, row, column] = matrix[:, column, row] = value  # sum of B (omega x r), and its transpose
    xx, yy, zz, xy, yz, zx = sums[:, 4:10].T
    matrix[:, 3, 3], matrix[:, 4, 4], matrix[:, 5, 5] = (part + excess_inertia for part in (yy + zz, zz + xx, xx + yy))
    for row, column, value in ((3, 4, -xy), (3, 5, -zx), (4, 5, -yz)):
        matrix[:, row, column] = matrix[:, column, row] = value
    solved = np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
    return np.ascontiguousarray(solved[:, :3]), np.ascontiguousarray(solved[:, 3:])
