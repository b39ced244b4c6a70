r"""Lattice Boltzmann flow solver: D3Q19, two relaxation times, solid weights in every cell.

Each cell holds 19 populations :math:`f_i`, stored without their values at rest. A step streams and then collides,

.. math:: f_i(x + c_i, t + 1) = f_i + (1 - B)\,(\Omega_i + S_i) + B\,\Omega^s_i .

:math:`B` is the solid weight of the cell (0 in fluid, 1 in solid). :math:`\Omega` relaxes the even and the odd part of
the populations to the incompressible equilibrium of He & Luo (1997) at their own rates. :math:`S` is the body force of
Guo, Zheng & Shi (2002), its odd part at the odd rate. :math:`\Omega^s` is the solid operator of Noble & Torczynski
(1998): non-equilibrium bounce-back at the velocity of the solid. It changes the momentum of the cell by exactly
:math:`B (u_s - m)`, :math:`m = \sum_i c_i f_i`. Units are those of the lattice: cell, step, and density of the fluid 1.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import inline, prange, threaded

_HALF = np.array(
    [
        (1, 0, 0), (0, 1, 0), (0, 0, 1),
        (1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1),
    ]
)  # fmt: skip
VELOCITIES = np.vstack([[(0, 0, 0)], np.stack([_HALF, -_HALF], axis=1).reshape(-1, 3)])
"""Lattice velocities (19, 3): rest first, then pairs of opposite directions; components in the order x, y, z."""

WEIGHTS = np.array([1 / 3] + [1 / 18] * 6 + [1 / 36] * 12)
"""Weights of the equilibrium (19,)."""

CHUNK = 32
"""Cells that are collided together: a fixed number, which compiles to vector instructions without remainder."""

_CX, _CY, _CZ = (np.ascontiguousarray(VELOCITIES[:, axis]) for axis in range(3))
_X, _Y, _Z = (VELOCITIES[:, axis].astype(float) for axis in range(3))
_REST = WEIGHTS[0]


def rates(viscosity: float, magic: float) -> tuple[float, float]:
    """Even and odd relaxation rate of a lattice viscosity.

    The even rate sets the viscosity. The odd rate keeps the product of both relaxation times at `magic`, so that
    the position of a solid surface does not depend on the viscosity (Ginzburg & d'Humieres 2003).
    """
    even = 3.0 * viscosity
    return 1.0 / (even + 0.5), 1.0 / (magic / even + 0.5)


def at_rest(shape: tuple[int, int, int]) -> np.ndarray:
    """Populations (19, z, y, x + 2) of fluid at rest; the first and last column repeat the opposite end."""
    nx, ny, nz = shape
    return np.zeros((19, nz, ny, nx + 2))


def equilibrium(velocity: np.ndarray) -> np.ndarray:
    """Populations (19,) of fluid that moves evenly."""
    along = VELOCITIES @ velocity
    return np.asarray(WEIGHTS * (3.0 * along + 4.5 * along**2 - 1.5 * velocity @ velocity))


@threaded
def stream_and_collide(old, new, weight, target, force, even_rate, odd_rate):  # type: ignore[no-untyped-def]
    """One step of all cells, from post-collision populations `old` to post-collision populations `new`.

    weight  B (z, y, x)
    target  B u_s (3, z, y, x)
    force   body force per cell (3,)
    """
    nz, ny, nx = weight.shape
    for z in prange(nz):
        f, m, c = np.zeros((19, CHUNK)), np.zeros((8, CHUNK)), np.zeros((9, CHUNK))
        for y in range(ny):
            for start in range(0, nx, CHUNK):
                count = min(CHUNK, nx - start)
                _gather(old, f, m, z, y, start, count)
                _mix(m, c, weight[z, y, start:], target[:, z, y, start:], force, even_rate, odd_rate, count)
                _collide(f, m, c, force)
                for i in range(19):
                    row, values = new[i, z, y, start + 1 :], f[i]
                    for x in range(count):
                        row[x] = values[x]
            for i in range(19):
                new[i, z, y, 0] = new[i, z, y, nx]
                new[i, z, y, nx + 1] = new[i, z, y, 1]


@inline
def _gather(old, f, m, z, y, start, count):  # type: ignore[no-untyped-def]
    """Populations that arrive in a piece of a row, their sum and momentum."""
    _, nz, ny, _ = old.shape
    m[:4] = 0.0
    density, mx, my, mz = m[0], m[1], m[2], m[3]
    for i in range(19):
        row, values = old[i, (z - _CZ[i]) % nz, (y - _CY[i]) % ny, start + 1 - _CX[i] :], f[i]
        for x in range(count):
            values[x] = row[x]
    for i in range(19):
        cx, cy, cz, values = _X[i], _Y[i], _Z[i], f[i]
        for x in range(CHUNK):
            density[x] += values[x]
            mx[x] += cx * values[x]
            my[x] += cy * values[x]
            mz[x] += cz * values[x]


@inline
def _mix(m, c, weight, target, force, even_rate, odd_rate, count):  # type: ignore[no-untyped-def]
    """What all directions share in the collision of a piece of a row, per cell.

    m  sum of the populations and momentum; then velocity of the fluid in rows 1 to 3, of the solid in rows 4 to 6
    c  coefficients: of the even and odd populations (0, 1), of the squares of both velocities (2, 3), of the square of
       velocity and force (4), the isotropic part (5), and the vector of the odd part (6, 7, 8)
    """
    density, ux, uy, uz, sx, sy, sz, b = m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7]
    gx, gy, gz = target[0], target[1], target[2]
    for x in range(count):
        b[x] = weight[x]
    for x in range(count):
        sx[x] = gx[x]
    for x in range(count):
        sy[x] = gy[x]
    for x in range(count):
        sz[x] = gz[x]
    keep_even, keep_odd, fluid, solid, both, common, px, py, pz = c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8]
    fx, fy, fz = force[0], force[1], force[2]
    odd_force, even_force = 1.0 - 0.5 * odd_rate, 1.0 - 0.5 * even_rate
    for x in range(CHUNK):
        share = 1.0 / (b[x] + 1e-30)
        px[x], py[x], pz[x] = sx[x], sy[x], sz[x]
        sx[x] *= share
        sy[x] *= share
        sz[x] *= share
        ux[x] += 0.5 * fx
        uy[x] += 0.5 * fy
        uz[x] += 0.5 * fz
        free = 1.0 - b[x]
        keep_even[x] = 1.0 - free * even_rate
        keep_odd[x] = 1.0 - free * odd_rate - 2.0 * b[x]
        fluid[x] = free * even_rate - b[x]
        solid[x] = b[x]
        both[x] = 2.0 * free * even_force
        squares = 1.5 * (ux[x] * ux[x] + uy[x] * uy[x] + uz[x] * uz[x])
        solid_squares = 1.5 * (sx[x] * sx[x] + sy[x] * sy[x] + sz[x] * sz[x])
        power = 1.5 * both[x] * (ux[x] * fx + uy[x] * fy + uz[x] * fz)
        common[x] = fluid[x] * (density[x] - squares) + b[x] * (density[x] - solid_squares) - power
        follow, push = free * odd_rate + b[x], free * odd_force - 0.5 * b[x]
        px[x] += follow * ux[x] + push * fx
        py[x] += follow * uy[x] + push * fy
        pz[x] += follow * uz[x] + push * fz


@inline
def _relax(there, back, w, along, parts):  # type: ignore[no-untyped-def]
    """Both populations of a pair of opposite directions after the collision.

    along  velocities of fluid and solid, momentum and force along the pair
    parts  of the collision in the cell, see `_mix`
    """
    (cu, cs, cp, cf), (even_kept, odd_kept, fluid, solid, both, common) = along, parts
    even = 0.5 * even_kept * (there + back)
    even += w * (common + 4.5 * (cu * (fluid * cu + both * cf) + solid * cs * cs))
    odd = 0.5 * odd_kept * (there - back) + 3.0 * w * cp
    return even + odd, even - odd


@inline
def _along(f, i, m, c, axis, push):  # type: ignore[no-untyped-def]
    """Collide the pair of directions i and i + 1, along an axis."""
    there, back, u, s, p = f[i], f[i + 1], m[1 + axis], m[4 + axis], c[6 + axis]
    even_kept, odd_kept, fluid, solid, both, common = c[0], c[1], c[2], c[3], c[4], c[5]
    for x in range(CHUNK):
        there[x], back[x] = _relax(
            there[x], back[x], 1.0 / 18.0, (u[x], s[x], p[x], push),
            (even_kept[x], odd_kept[x], fluid[x], solid[x], both[x], common[x]),
        )  # fmt: skip


@inline
def _across(f, i, m, c, axis, other, sign, push):  # type: ignore[no-untyped-def]
    """Collide the pair of directions i and i + 1, along an axis plus or minus another."""
    there, back = f[i], f[i + 1]
    u, s, p, v, t, q = m[1 + axis], m[4 + axis], c[6 + axis], m[1 + other], m[4 + other], c[6 + other]
    even_kept, odd_kept, fluid, solid, both, common = c[0], c[1], c[2], c[3], c[4], c[5]
    for x in range(CHUNK):
        there[x], back[x] = _relax(
            there[x], back[x], 1.0 / 36.0, (u[x] + sign * v[x], s[x] + sign * t[x], p[x] + sign * q[x], push),
            (even_kept[x], odd_kept[x], fluid[x], solid[x], both[x], common[x]),
        )  # fmt: skip


@inline
def _collide(f, m, c, force):  # type: ignore[no-untyped-def]
    """Collision of a piece of a row, in place; the directions as in VELOCITIES."""
    rest, even_kept, common = f[0], c[0], c[5]
    for x in range(CHUNK):
        rest[x] = even_kept[x] * rest[x] + _REST * common[x]
    fx, fy, fz = force[0], force[1], force[2]
    _along(f, 1, m, c, 0, fx)
    _along(f, 3, m, c, 1, fy)
    _along(f, 5, m, c, 2, fz)
    _across(f, 7, m, c, 0, 1, 1.0, fx + fy)
    _across(f, 9, m, c, 0, 1, -1.0, fx - fy)
    _across(f, 11, m, c, 0, 2, 1.0, fx + fz)
    _across(f, 13, m, c, 0, 2, -1.0, fx - fz)
    _across(f, 15, m, c, 1, 2, 1.0, fy + fz)
    _across(f, 17, m, c, 1, 2, -1.0, fy - fz)


@threaded
def momentum_of(old, share, momentum):  # type: ignore[no-untyped-def]
    """Momentum of cells (3, z, y, x) after streaming, before the collision, in the rows that solids touch."""
    _, nz, ny, nx = momentum.shape
    for z in prange(nz):
        m = np.zeros((3, CHUNK))
        mx, my, mz = m[0], m[1], m[2]
        for y in range(ny):
            if share[z, y].max() == 0.0:
                continue
            for start in range(0, nx, CHUNK):
                count = min(CHUNK, nx - start)
                m[:] = 0.0
                for i in range(1, 19, 2):
                    there = old[i, (z - _CZ[i]) % nz, (y - _CY[i]) % ny, start + 1 - _CX[i] :]
                    back = old[i + 1, (z + _CZ[i]) % nz, (y + _CY[i]) % ny, start + 1 + _CX[i] :]
                    cx, cy, cz = _X[i], _Y[i], _Z[i]
                    for x in range(count):
                        odd = there[x] - back[x]
                        mx[x] += cx * odd
                        my[x] += cy * odd
                        mz[x] += cz * odd
                for axis in range(3):
                    row, values = momentum[axis, z, y, start:], m[axis]
                    for x in range(count):
                        row[x] = values[x]
