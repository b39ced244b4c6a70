"""Loops of the filter kernel: weights, deposit, gather, diffusion between cells, and flux through faces."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.compile import inline, prange, serial, threaded
from cfddem.fluid.grid import Array

CORNERS = 8
"""Cells on which a particle deposits, or a piece of it. They are counted along x first, then y, then z."""


CROWD_CELLS, CROWD_LARGE = 64.0, 8.0
"""Most particles that deposit on one cell: as many as fill so many cells, and so many that are larger than cells. These
lie in the 27 cells around it, and in solid cells whose nearest open cell it is; twice as many, for safety."""


@inline
def cell_and_share(coordinate, linear):
    """First cell of a particle along an axis, and its share in the next cell; coordinate in cells from the low wall."""
    start = math.floor(coordinate - 0.5 * linear)
    return start, linear * (coordinate - 0.5 * linear - start)


class Axes(NamedTuple):
    """The cells that the particles of a rank reach, along x, y, z.

    Coordinates count the cells of the whole grid, so that weights have the same bits on every rank.
    """

    origin: Array  # lowest corner of the whole grid (3,) [m]
    inverse: Array  # cells in a metre (3,) [1/m]
    cells: NDArray[np.int64]  # of this rank, with ghosts (3,)
    first: NDArray[np.int64]  # number of the first of them in the whole grid (3,)
    period: NDArray[np.int64]  # cells of the whole grid where it repeats beyond the ghosts, 0 elsewhere (3,)


@inline
def _within_layers(place, linear, axes, d):
    """As `cell_and_share`, from a place [m] along axis d, of the cells of a rank; `linear` as there.

    The cells have a layer on both sides, where farther particles are put, the first one below the last.
    """
    start, share = cell_and_share((place - axes.origin[d]) * axes.inverse[d], linear)
    cells, period = axes.cells[d], axes.period[d]
    start -= axes.first[d]
    if period > 0:
        low = (cells - period) // 2
        start = low + (start - low) % period
    if start >= cells:
        return cells - 1, 1.0
    return (start, share) if start >= -1 else (-1, 0.0)


@threaded
def stencils(position, radius, offsets, linear, axes, first, shares):
    """First cell of every piece of every particle, and its shares in the next cell along x, y, z (N, pieces, 3).

    axes   to whose cells a layer around all of them is added
    first  flat index of the cell among these (N, pieces)
    """
    row, column = axes.cells[0] + 2, axes.cells[1] + 2
    for n in prange(len(position)):
        for s in range(len(offsets)):
            i, a = _within_layers(position[n, 0] + radius[n] * offsets[s, 0], linear, axes, 0)
            j, b = _within_layers(position[n, 1] + radius[n] * offsets[s, 1], linear, axes, 1)
            k, c = _within_layers(position[n, 2] + radius[n] * offsets[s, 2], linear, axes, 2)
            first[n, s] = ((k + 1) * column + j + 1) * row + i + 1
            shares[n, s, 0], shares[n, s, 1], shares[n, s, 2] = a, b, c


@serial
def sort_into_slabs(position, origin, inverse, thickness, order, start):
    """Sort rows of particles into slabs of `thickness` cell layers, and find the first place of each slab."""
    slabs = len(start) - 1
    slab = np.empty(len(position), np.int64)
    for n in range(len(position)):
        slab[n] = min(max(math.floor((position[n, 2] - origin) * inverse) // thickness, 0), slabs - 1)
        start[slab[n] + 1] += 1
    for earlier in range(slabs):
        start[earlier + 1] += start[earlier]
    free = start[:-1].copy()
    for n in range(len(position)):
        order[free[slab[n]]] = n
        free[slab[n]] += 1


@inline
def weight(corner, a, b, c):
    """Weight of one of the eight cells that a piece touches."""
    up, back, right = corner >> 2, corner >> 1 & 1, corner & 1
    return (c if up else 1.0 - c) * ((b if back else 1.0 - b) * (a if right else 1.0 - a))


@inline
def _cells(first, corners):
    """Flat indices of the cells of a piece; corners as of `deposit`."""
    return (
        first + corners[0], first + corners[1], first + corners[2], first + corners[3],
        first + corners[4], first + corners[5], first + corners[6], first + corners[7],
    )  # fmt: skip


@inline
def _weights(n, s, shares):
    """Weights of the cells of piece s of particle n."""
    a, b, c = shares[n, s, 0], shares[n, s, 1], shares[n, s, 2]
    return (
        weight(0, a, b, c), weight(1, a, b, c), weight(2, a, b, c), weight(3, a, b, c),
        weight(4, a, b, c), weight(5, a, b, c), weight(6, a, b, c), weight(7, a, b, c),
    )  # fmt: skip


@inline
def _plus(a, factor, b):
    """a + factor b, cell by cell."""
    return (
        a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2], a[3] + factor * b[3],
        a[4] + factor * b[4], a[5] + factor * b[5], a[6] + factor * b[6], a[7] + factor * b[7],
    )  # fmt: skip


@inline
def _mean(weights, cells, fields, m):
    """Weighted mean of component m of the cells."""
    return (
        weights[0] * fields[cells[0], m] + weights[1] * fields[cells[1], m]
        + weights[2] * fields[cells[2], m] + weights[3] * fields[cells[3], m]
        + weights[4] * fields[cells[4], m] + weights[5] * fields[cells[5], m]
        + weights[6] * fields[cells[6], m] + weights[7] * fields[cells[7], m]
    )  # fmt: skip


@serial
def largest_deposits(values, volume, cell_volume, largest):
    """Largest of each of the values (N, m), and how large the sums in a cell can be (2, m); NaN if a value is."""
    for n in range(len(values)):
        crowd = CROWD_CELLS * cell_volume / volume[n] + CROWD_LARGE if volume[n] > 0.0 else math.inf
        for m in range(values.shape[1]):
            size = abs(values[n, m])
            if size > largest[0, m] or size != size:
                largest[0, m] = size
            if size > 0.0:
                largest[1, m] = max(largest[1, m], crowd * size)


@threaded
def deposit(slabs, values, unit, first, shares, corners, lanes, fields):
    """Add values (N, m), in whole numbers of 1/unit (m,), to fields (cells, m): even slabs together, then odd ones.

    slabs    rows of particles in the order of slabs, and the first place of each slab
    corners  distance of the cells from the first in flat arrays; unsigned, since no index counts from the end
    lanes    number of threads, which take the slabs in turns: a bed fills the lower ones alone
    """
    order, start = slabs
    for phase in range(2):
        for lane in prange(lanes):
            for slab in range(phase + 2 * lane, len(start) - 1, 2 * lanes):
                _deposit_rows(order[start[slab] : start[slab + 1]], values, unit, first, shares, corners, fields)


@serial
def _deposit_rows(rows, values, unit, first, shares, corners, fields):
    """Add the values of some particles to their cells."""
    for n in rows:
        for s in range(first.shape[1]):
            cells, weights = _cells(first[n, s], corners), _weights(n, s, shares)
            for m in range(values.shape[1]):
                _add(values[n, m] * unit[m] / first.shape[1], weights, cells, fields, m)


@inline
def _add(value, weights, cells, fields, m):
    """Add the shares of a value to component m of the cells, in whole numbers."""
    fields[cells[0], m] += np.int64(np.rint(weights[0] * value))
    fields[cells[1], m] += np.int64(np.rint(weights[1] * value))
    fields[cells[2], m] += np.int64(np.rint(weights[2] * value))
    fields[cells[3], m] += np.int64(np.rint(weights[3] * value))
    fields[cells[4], m] += np.int64(np.rint(weights[4] * value))
    fields[cells[5], m] += np.int64(np.rint(weights[5] * value))
    fields[cells[6], m] += np.int64(np.rint(weights[6] * value))
    fields[cells[7], m] += np.int64(np.rint(weights[7] * value))


@threaded
def collect(order, begins, cells, deposits, fields):
    """Sums over the deposits (n, m) that each cell receives, from the first cell to the last: fields (m, cells)."""
    for cell in prange(cells[0], cells[1]):
        for m in range(fields.shape[0]):
            total = 0
            for place in range(begins[cell], begins[cell + 1]):
                total += deposits[order[place], m]
            fields[m, cell] = total


@threaded
def spread(homes, cells, fields, layered):
    """Values of the home of each cell, from the first to the last: fields (m, cells) to layered (n, m); the adjoint of
    `collect`."""
    for cell in prange(cells[0], cells[1]):
        for m in range(fields.shape[0]):
            layered[cell, m] = fields[m, homes[cell]]


@threaded
def gather(first, shares, corners, fields, values):
    """Weighted mean around every particle, with the weights of `deposit`: fields (cells, m) to values (N, m)."""
    part = 1.0 / first.shape[1]
    for n in prange(len(values)):
        for m in range(values.shape[1]):
            values[n, m] = 0.0
        for s in range(first.shape[1]):
            _add_mean(n, part, _weights(n, s, shares), _cells(first[n, s], corners), fields, values)


@threaded
def gather_of_kinds(kinds, first, shares, corners, fields, values):
    """As `gather`, of the fields of each particle's kind: those of kind 0 come first, (cells, kinds m) to (N, m)."""
    part, count = 1.0 / first.shape[1], values.shape[1]
    for n in prange(len(values)):
        begin = kinds[n] * count
        for m in range(count):
            values[n, m] = 0.0
        for s in range(first.shape[1]):
            weights, cells = _weights(n, s, shares), _cells(first[n, s], corners)
            for m in range(count):
                values[n, m] += part * _mean(weights, cells, fields, begin + m)


@inline
def _add_mean(n, share, weights, cells, fields, values):
    """Add a share of the weighted means of all components."""
    for m in range(values.shape[1]):
        values[n, m] += share * _mean(weights, cells, fields, m)


@threaded
def gather_with_slope(first, shares, corners, field, inverse, values):
    """Weighted mean of a field (cells, 1) around every particle, and its derivatives along x, y, z [1/m]: (N, 4)."""
    part = 1.0 / first.shape[1]
    for n in prange(len(values)):
        for m in range(4):
            values[n, m] = 0.0
        for s in range(first.shape[1]):
            a, b, c, cells = shares[n, s, 0], shares[n, s, 1], shares[n, s, 2], _cells(first[n, s], corners)
            values[n, 0] += part * _mean(_weights(n, s, shares), cells, field, 0)
            for up in range(2):  # b and c, a and c, a and b are the shares across x, y, z
                for right in range(2):
                    across = part * (c if up else 1.0 - c) * (b if right else 1.0 - b)
                    at = 4 * up + 2 * right
                    values[n, 1] += across * inverse[0] * (field[cells[at + 1], 0] - field[cells[at], 0])
                    across = part * (c if up else 1.0 - c) * (a if right else 1.0 - a)
                    at = 4 * up + right
                    values[n, 2] += across * inverse[1] * (field[cells[at + 2], 0] - field[cells[at], 0])
                    across = part * (b if up else 1.0 - b) * (a if right else 1.0 - a)
                    at = 2 * up + right
                    values[n, 3] += across * inverse[2] * (field[cells[at + 4], 0] - field[cells[at], 0])


@threaded
def gather_over_steps(at_earlier, at_last, at_now, corners, fields, values):
    """As `gather`, the mean of particles at the stencils of three places, with the weights 1/4, 1/2 and 1/4."""
    (earlier, shares_earlier), (last, shares_last), (now, shares_now) = at_earlier, at_last, at_now
    quarter = 0.25 / now.shape[1]
    for n in prange(len(values)):
        for m in range(values.shape[1]):
            values[n, m] = 0.0
        for s in range(now.shape[1]):
            old, mid, new = _weights(n, s, shares_earlier), _weights(n, s, shares_last), _weights(n, s, shares_now)
            if earlier[n, s] == last[n, s] and last[n, s] == now[n, s]:  # mostly so; then cells are read once
                together = _plus(_plus(old, 2.0, mid), 1.0, new)
                _add_mean(n, quarter, together, _cells(now[n, s], corners), fields, values)
            else:
                _add_mean(n, quarter, old, _cells(earlier[n, s], corners), fields, values)
                _add_mean(n, 2.0 * quarter, mid, _cells(last[n, s], corners), fields, values)
                _add_mean(n, quarter, new, _cells(now[n, s], corners), fields, values)


@serial
def ends_of(fields):
    """First and last plane of fields (m, nz, ny, nx) that are not zero everywhere; the first lies after the last if
    all are."""
    first, last = fields.shape[1], -1
    for m in range(fields.shape[0]):
        for k in range(first):
            if _some(fields[m, k]):
                first = k
                break
        for k in range(fields.shape[1] - 1, last, -1):
            if _some(fields[m, k]):
                last = k
                break
    return first, last


@inline
def _some(plane):
    """Whether a value is not zero."""
    for j in range(plane.shape[0]):
        for i in range(plane.shape[1]):
            if plane[j, i] != 0.0:
                return True
    return False


@threaded
def sweep(fields, out, planes, strength, gate_x, gate_y, gate_z, shares):
    """One sweep of diffusion through the open faces of the cells; all arrays are padded by one layer.

    Ghosts of `fields` are current; those of `out` are not written.

    planes  first and last plane along z that is swept, of the padded arrays
    shares  open share of the group of every cell (nz, ny, nx); (0, 0, 0) where every cell is a group
    """
    (low, high), ny, nx = planes, fields.shape[2] - 2, fields.shape[3] - 2
    count, in_groups = high + 1 - low, len(shares) > 0
    for plane in prange(fields.shape[0] * count):
        m, k = plane // count, plane % count + low
        field = fields[m]
        for j in range(1, ny + 1):
            for i in range(1, nx + 1):
                here = field[k, j, i]
                change = (
                    strength[0] * gate_x[k, j, i] * (field[k, j, i - 1] - here)
                    + strength[0] * gate_x[k, j, i + 1] * (field[k, j, i + 1] - here)
                    + strength[1] * gate_y[k, j, i] * (field[k, j - 1, i] - here)
                    + strength[1] * gate_y[k, j + 1, i] * (field[k, j + 1, i] - here)
                    + strength[2] * gate_z[k, j, i] * (field[k - 1, j, i] - here)
                    + strength[2] * gate_z[k + 1, j, i] * (field[k + 1, j, i] - here)
                )
                out[m, k, j, i] = here + (change / shares[k - 1, j - 1, i - 1] if in_groups else change)


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


class Paths(NamedTuple):
    """Spheres that move along straight paths."""

    position: Array  # at the beginning (N, 3) [m]
    moved: Array  # (N, 3) [m]
    radius: Array  # (N,) [m]
    volume: Array  # (N,) [m3]


@serial
def carry_all(paths, unit, offsets, linear, axes, periodic, fluxes):
    """Volume, in whole numbers of 1/unit [m3], that every particle carries through every face along its path.

    Esirkepov's split: along each axis the change of the one-dimensional weights, times the mean of the weights of the
    two other axes at both ends. The three fluxes together give exactly the change of the product.

    fluxes  through the faces normal to x, y, z
    """
    position, moved, radius, volume = paths
    flux_x, flux_y, flux_z = fluxes
    nz, ny, nx = flux_x.shape[0], flux_x.shape[1], flux_y.shape[2]
    cells, old, new = (nx, ny, nz), (np.zeros(6), np.zeros(6), np.zeros(6)), (np.zeros(6), np.zeros(6), np.zeros(6))
    for n in range(len(position)):
        for s in range(len(offsets)):
            x = (position[n, 0] + radius[n] * offsets[s, 0] - axes.origin[0]) * axes.inverse[0]
            y = (position[n, 1] + radius[n] * offsets[s, 1] - axes.origin[1]) * axes.inverse[1]
            z = (position[n, 2] + radius[n] * offsets[s, 2] - axes.origin[2]) * axes.inverse[2]
            place, first = (x, y, z), (math.floor(x) - 2, math.floor(y) - 2, math.floor(z) - 2)
            for d in range(3):
                _window(place[d], linear, first[d], cells[d], periodic[d], old[d])
                there = place[d] + moved[n, d] * axes.inverse[d]
                _window(there, linear, first[d], cells[d], periodic[d], new[d])
            part = volume[n] / len(offsets)
            _carry(unit, part, first, cells, old, new, 0, flux_x)
            _carry(unit, part, first, cells, old, new, 1, flux_y)
            _carry(unit, part, first, cells, old, new, 2, flux_z)


@serial
def _carry(unit, part, first, cells, old, new, axis, flux):
    """Add the volume that one piece carries through the faces normal to one axis.

    first  cell of the windows along x, y, z, whose weights are `old` and `new`
    """
    one, other = (1 if axis == 0 else 0), (1 if axis == 2 else 2)  # the axes across
    old_a, new_a, old_b, new_b, old_c, new_c = old[axis], new[axis], old[one], new[one], old[other], new[other]
    for c in range(6):
        for b in range(6):
            across = (old_b[b] * old_c[c] + new_b[b] * new_c[c]) / 3.0
            across += (old_b[b] * new_c[c] + new_b[b] * old_c[c]) / 6.0
            if across == 0.0:
                continue
            passed = 0.0
            for a in range(5):
                passed -= part * (new_a[a] - old_a[a]) * across
                if passed == 0.0:
                    continue
                face = (first[axis] + a + 1) % cells[axis]
                beside, third = (first[one] + b) % cells[one], (first[other] + c) % cells[other]
                if axis == 0:
                    flux[third, beside, face] += np.int64(np.rint(passed * unit))
                elif axis == 1:
                    flux[third, face, beside] += np.int64(np.rint(passed * unit))
                else:
                    flux[face, third, beside] += np.int64(np.rint(passed * unit))
