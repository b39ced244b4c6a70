"""Loops of the filter kernel: weights, deposit, gather, diffusion between cells, and flux through faces."""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline, prange, serial, threaded

FOUR = 4
"""Components of a cell that are gathered together."""


@inline
def cell_and_share(coordinate, linear):
    """First cell of a particle along an axis, and its share in the next cell; coordinate in cells from the low wall."""
    start = math.floor(coordinate - 0.5 * linear)
    return start, linear * (coordinate - 0.5 * linear - start)


@threaded
def stencils(position, radius, offsets, linear, origin, inverse, home, cells, weights):
    """Cells of every particle, eight for each of its pieces, and the weight of each (N, m); home is padded by one."""
    pz, py, px = home.shape
    for n in prange(len(position)):
        for s in range(len(offsets)):
            i, a = cell_and_share((position[n, 0] + radius[n] * offsets[s, 0] - origin[0]) * inverse[0], linear)
            j, b = cell_and_share((position[n, 1] + radius[n] * offsets[s, 1] - origin[1]) * inverse[1], linear)
            k, c = cell_and_share((position[n, 2] + radius[n] * offsets[s, 2] - origin[2]) * inverse[2], linear)
            share = 1.0 / len(offsets)
            for corner in range(8):
                up, back, right = corner >> 2, corner >> 1 & 1, corner & 1
                x, y = min(max(i + 1 + right, 0), px - 1), min(max(j + 1 + back, 0), py - 1)
                z = min(max(k + 1 + up, 0), pz - 1)
                across = (b if back else 1.0 - b) * (a if right else 1.0 - a)
                cells[n, 8 * s + corner] = home[z, y, x]
                weights[n, 8 * s + corner] = share * (c if up else 1.0 - c) * across


@serial
def sort_into_slabs(position, origin, inverse, thickness, order, start):
    """Sort rows of particles into slabs of `thickness` cell layers, and find the first place of each slab."""
    slabs = len(start) - 1
    slab = np.empty(len(position), np.int64)
    for n in range(len(position)):
        slab[n] = min(max(math.floor((position[n, 2] - origin) * inverse) // thickness, 0), slabs - 1)
        start[slab[n] + 1] += 1
    for each in range(slabs):
        start[each + 1] += start[each]
    free = start[:-1].copy()
    for n in range(len(position)):
        order[free[slab[n]]] = n
        free[slab[n]] += 1


@threaded
def deposit(order, start, values, cells, weights, fields):
    """Fill even slabs together, then odd ones, then a last one that would touch the first across a periodic border."""
    slabs = len(start) - 1
    even = slabs - slabs % 2
    for phase in range(3):
        first, last = (phase, even) if phase < 2 else (even, slabs)
        for half in prange((last - first + 1) // 2):
            slab = first + 2 * half
            for place in range(start[slab], start[slab + 1]):
                _deposit_one(order[place], values, cells, weights, fields)


@serial
def _deposit_one(n, values, cells, weights, fields):
    """Add the values of one particle to its cells."""
    for s in range(cells.shape[1]):
        cell, weight = cells[n, s], weights[n, s]
        for m in range(values.shape[1]):
            fields[cell, m] += weight * values[n, m]


@threaded
def gather(cells, weights, field, values):
    """Weighted mean around every particle, with the weights of `_deposit_one`: field (cells, M) to values (N, m).

    M is m, rounded up to a multiple of FOUR.
    """
    wanted = values.shape[1]
    for n in prange(len(values)):
        for first in range(0, field.shape[1], FOUR):
            a, b, c, d = 0.0, 0.0, 0.0, 0.0
            for s in range(cells.shape[1]):
                here, weight = field[cells[n, s], first : first + FOUR], weights[n, s]
                a += weight * here[0]
                b += weight * here[1]
                c += weight * here[2]
                d += weight * here[3]
            values[n, first] = a
            if first + 1 < wanted:
                values[n, first + 1] = b
            if first + 2 < wanted:
                values[n, first + 2] = c
            if first + 3 < wanted:
                values[n, first + 3] = d


@threaded
def sweep(fields, out, strength, gate_x, gate_y, gate_z):
    """One sweep of diffusion through the open faces of all cells; all arrays are padded by one layer.

    Ghosts of `fields` are current; those of `out` are not written.
    """
    nz, ny, nx = fields.shape[1] - 2, fields.shape[2] - 2, fields.shape[3] - 2
    for plane in prange(fields.shape[0] * nz):
        m, k = plane // nz, plane % nz + 1
        field = fields[m]
        for j in range(1, ny + 1):
            for i in range(1, nx + 1):
                here = field[k, j, i]
                out[m, k, j, i] = here + (
                    strength[0] * gate_x[k, j, i] * (field[k, j, i - 1] - here)
                    + strength[0] * gate_x[k, j, i + 1] * (field[k, j, i + 1] - here)
                    + strength[1] * gate_y[k, j, i] * (field[k, j - 1, i] - here)
                    + strength[1] * gate_y[k, j + 1, i] * (field[k, j + 1, i] - here)
                    + strength[2] * gate_z[k, j, i] * (field[k - 1, j, i] - here)
                    + strength[2] * gate_z[k + 1, j, i] * (field[k + 1, j, i] - here)
                )


@serial
def _window(coordinate, linear, first, cells, periodic, weights):
    """Weights of a particle in a window of cells from `first` on; a weight behind a wall is put into the last cell."""
    weights[:] = 0.0
    start, share = cell_and_share(coordinate, linear)
    for step in range(2):
        cell = start + step
        if not periodic:
            cell = min(max(cell, 0), cells - 1)
        weights[cell - first] += share if step else 1.0 - share


@serial
def carry_all(position, moved, radius, volume, offsets, linear, origin, inverse, periodic, flux_x, flux_y, flux_z):
    """Volume [m3] that every particle carries through every face along a straight path.

    Esirkepov's split: along each axis the change of the one-dimensional weights, times the mean of the weights of the
    two other axes at both ends. The three fluxes together give exactly the change of the product.
    """
    nz, ny, nx = flux_x.shape[0], flux_x.shape[1], flux_y.shape[2]
    old_x, new_x, old_y = np.zeros(6), np.zeros(6), np.zeros(6)
    new_y, old_z, new_z = np.zeros(6), np.zeros(6), np.zeros(6)
    for n in range(len(position)):
        for s in range(len(offsets)):
            x = (position[n, 0] + radius[n] * offsets[s, 0] - origin[0]) * inverse[0]
            y = (position[n, 1] + radius[n] * offsets[s, 1] - origin[1]) * inverse[1]
            z = (position[n, 2] + radius[n] * offsets[s, 2] - origin[2]) * inverse[2]
            i, j, k = math.floor(x) - 2, math.floor(y) - 2, math.floor(z) - 2
            _window(x, linear, i, nx, periodic[0], old_x)
            _window(x + moved[n, 0] * inverse[0], linear, i, nx, periodic[0], new_x)
            _window(y, linear, j, ny, periodic[1], old_y)
            _window(y + moved[n, 1] * inverse[1], linear, j, ny, periodic[1], new_y)
            _window(z, linear, k, nz, periodic[2], old_z)
            _window(z + moved[n, 2] * inverse[2], linear, k, nz, periodic[2], new_z)
            part = volume[n] / len(offsets)
            _carry(part, i, j, k, nx, ny, nz, old_x, new_x, old_y, new_y, old_z, new_z, 0, flux_x)
            _carry(part, j, i, k, ny, nx, nz, old_y, new_y, old_x, new_x, old_z, new_z, 1, flux_y)
            _carry(part, k, i, j, nz, nx, ny, old_z, new_z, old_x, new_x, old_y, new_y, 2, flux_z)


@serial
def _carry(part, first, first_b, first_c, cells, cells_b, cells_c, old, new, old_b, new_b, old_c, new_c, axis, flux):
    """Add the volume that one piece carries through the faces normal to one axis."""
    for c in range(6):
        for b in range(6):
            across = (old_b[b] * old_c[c] + new_b[b] * new_c[c]) / 3.0
            across += (old_b[b] * new_c[c] + new_b[b] * old_c[c]) / 6.0
            if across == 0.0:
                continue
            passed = 0.0
            for a in range(5):
                passed -= part * (new[a] - old[a]) * across
                if passed == 0.0:
                    continue
                face, other, third = (first + a + 1) % cells, (first_b + b) % cells_b, (first_c + c) % cells_c
                if axis == 0:
                    flux[third, other, face] += passed
                elif axis == 1:
                    flux[third, face, other] += passed
                else:
                    flux[face, third, other] += passed
