"""Loops of the multigrid: sweeps, residual, transfer between levels, and the steps of conjugate gradients."""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline, prange, threaded, vector_inline
from cfddem.backend.exact_sums import FINE
from cfddem.fluid.halo import neighbours


@inline
def _cells_in(coarse, factor, shift, count):
    """First cell of those in a coarse cell along an axis, and the one after the last, among so many cells."""
    first = coarse * factor - shift
    return max(first, 0), min(first + factor, count)


@threaded
def coarsen(fine, factors, farther, coupled, coarse):
    """Coefficients and anchors of coarse cells: sums of the fine ones, divided by how much farther they reach.

    fine, coarse  coefficients along x, y, z, and anchors
    farther  how much the side with a known pressure is away, in fine cells
    coupled  (3,) whether there are several coarse cells along x, y, z
    """
    for kc in prange(coarse[0].shape[0]):
        _coarsen_plane(kc, fine, factors, farther, coupled, coarse)


@inline
def _coarsen_plane(kc, fine, factors, farther, coupled, coarse):
    """`coarsen` in one plane."""
    (ax, ay, az, anchor), (coarse_ax, coarse_ay, coarse_az, coarse_anchor) = fine, coarse
    nz, ny, nx = ax.shape
    first_plane, end_plane = _cells_in(kc, factors[2], 0, nz)
    for jc in range(coarse_ax.shape[1]):
        first_row, end_row = _cells_in(jc, factors[1], 0, ny)
        for ic in range(coarse_ax.shape[2]):
            first, end = _cells_in(ic, factors[0], 0, nx)
            west = south = below = anchored = 0.0
            for k in range(first_plane, end_plane):
                for j in range(first_row, end_row):
                    west += ax[k, j, first]
                    for i in range(first, end):
                        south += ay[k, j, i] if j == first_row else 0.0
                        below += az[k, j, i] if k == first_plane else 0.0
                        anchored += anchor[k, j, i]
            coarse_ax[kc, jc, ic] = west / factors[0] if coupled[0] else 0.0
            coarse_ay[kc, jc, ic] = south / factors[1] if coupled[1] else 0.0
            coarse_az[kc, jc, ic] = below / factors[2] if coupled[2] else 0.0
            coarse_anchor[kc, jc, ic] = anchored / farther


@threaded
def take_diagonal(ax, ay, az, anchor, relaxation, diagonal, inverse, wet):
    """Diagonal of L, and the relaxation of sweeps over it, zero in solid cells; and of each plane the first row that
    has other ones, and the one after the last (nz, 2)."""
    nz, ny, nx = ax.shape
    for k in prange(nz):
        above = neighbours(k, nz)[1]
        wet[k, 0], wet[k, 1] = ny, 0
        for j in range(ny):
            back = neighbours(j, ny)[1]
            for i in range(nx):
                right = neighbours(i, nx)[1]
                total = ax[k, j, i] + ay[k, j, i] + az[k, j, i] + anchor[k, j, i]
                total = total + ax[k, j, right] + ay[k, back, i] + az[above, j, i]
                diagonal[k, j, i] = total
                inverse[k, j, i] = relaxation / total if total > 0.0 else 0.0
            for i in range(nx):
                if diagonal[k, j, i] > 0.0:
                    wet[k, 0], wet[k, 1] = min(wet[k, 0], j), j + 1
                    break


@inline
def _relaxed(kept, before, invert, balanced):
    """A value after relaxation, which keeps a part of the one before: nothing in a solid cell, so that zero stays."""
    return balanced + (kept * before if invert > 0.0 else 0.0)


@vector_inline
def _relax_plane(k, colour, backward, x, b, matrix, new):
    """Relax the cells of one colour in a plane; whole rows are computed, which vectorises, and half is kept."""
    ax, ay, az, inverse, wet, kept = matrix
    nz, ny, nx = x.shape
    below, above = neighbours(k, nz)
    # Of one colour only the first and the last row can be neighbours (periodic y): backward takes the last one first.
    begin, end = wet[k, 0], wet[k, 1]
    for count in range(begin, end):
        j = (end - 1 if count == begin else count - 1) if backward else count
        front, back = neighbours(j, ny)
        here, west, rhs, invert = x[k, j], ax[k, j], b[k, j], inverse[k, j]
        south, north, down, up = x[k, front], x[k, back], x[below, j], x[above, j]
        a_south, a_north, a_down, a_up = ay[k, j], ay[k, back], az[k, j], az[above, j]
        for i in range(nx):
            new[i] = (rhs[i] + a_south[i] * south[i] + a_north[i] * north[i]) + (a_down[i] * down[i] + a_up[i] * up[i])
        for i in range(1, nx - 1):
            new[i] = (new[i] + west[i] * here[i - 1] + west[i + 1] * here[i + 1]) * invert[i]
        if kept != 0.0:
            _relax_row(kept, here, invert, new)
        parity = (k + j + colour) & 1
        # The ends of a row can be neighbours across a periodic boundary: one after the other.
        for count_end in range(min(2, nx)):
            i = nx - 1 if (count_end == 1) != backward else 0
            if (i & 1) == parity:
                left, right = neighbours(i, nx)
                new[i] = (new[i] + west[i] * here[left] + west[right] * here[right]) * invert[i]
                here[i] = new[i] if kept == 0.0 else _relaxed(kept, here[i], invert[i], new[i])
        for i in range(1, nx - 1):
            here[i] = new[i] if (i & 1) == parity else here[i]


@vector_inline
def _relax_row(kept, here, invert, new):
    """Add what relaxation keeps of the values inside a row."""
    for i in range(1, new.size - 1):
        new[i] = _relaxed(kept, here[i], invert[i], new[i])


@threaded
def smooth(x, b, matrix, rows, first, halves, backward):
    """Gauss-Seidel by colours in place; backward is the exact transpose of forward; rows (nz, nx) are overwritten.

    matrix  coefficients along x, y, z, relaxation over the diagonal, wet rows, and what relaxation keeps of a value
    first   colour of the first half of a sweep
    halves  number of halves, of both colours in turn
    """
    nz = x.shape[0]
    # Of an odd number of planes the last has the colour of the first, its neighbour if periodic: it goes alone.
    together = nz - (nz & 1)
    for half in range(halves):
        for part in range(2):
            alone = (part == 0) == backward
            begin, end = (together, nz) if alone else (0, together)
            if begin < end:
                for k in prange(begin, end):
                    _relax_plane(k, first + half, backward, x, b, matrix, rows[k])


@vector_inline
def _apply_row(k, j, x, ax, ay, az, diagonal, out):
    """out = L x along one row."""
    nz, ny, nx = x.shape
    (below, above), (front, back) = neighbours(k, nz), neighbours(j, ny)
    here, west, diag = x[k, j], ax[k, j], diagonal[k, j]
    south, north, down, up = x[k, front], x[k, back], x[below, j], x[above, j]
    a_south, a_north, a_down, a_up = ay[k, j], ay[k, back], az[k, j], az[above, j]
    for i in range(nx):
        out[i] = (diag[i] * here[i] - a_south[i] * south[i] - a_north[i] * north[i]) - (
            a_down[i] * down[i] + a_up[i] * up[i]
        )
    for i in range(1, nx - 1):
        out[i] -= west[i] * here[i - 1] + west[i + 1] * here[i + 1]
    for end in range(min(2, nx)):
        i = nx - 1 if end == 1 else 0
        left, right = neighbours(i, nx)
        out[i] -= west[i] * here[left] + west[right] * here[right]


@threaded
def residual(x, b, ax, ay, az, diagonal, wet, left):
    """left = b - L x in the wet rows."""
    for k in prange(x.shape[0]):
        for j in range(wet[k, 0], wet[k, 1]):
            _apply_row(k, j, x, ax, ay, az, diagonal, left[k, j])
            _subtract_from(b[k, j], left[k, j])


@vector_inline
def _subtract_from(whole, row):
    """row = whole - row"""
    for i in range(row.size):
        row[i] = whole[i] - row[i]


@vector_inline
def _add(values, row):
    """row += values"""
    for i in range(row.size):
        row[i] += values[i]


@threaded
def restrict(values, wet, factors, shift, rows, coarse):
    """Sum the values of a level over the cells that make one coarse cell; rows are overwritten.

    wet    rows that have values, as `take_diagonal` finds them
    shift  along x, y, z; cell k lies in the coarse cell (k + shift) // factor
    """
    nz, ny, nx = values.shape
    for kc in prange(coarse.shape[0]):
        total = rows[kc]
        first_plane, end_plane = _cells_in(kc, factors[2], shift[2], nz)
        for jc in range(coarse.shape[1]):
            first_row, end_row = _cells_in(jc, factors[1], shift[1], ny)
            total[:] = 0.0
            for k in range(first_plane, end_plane):
                for j in range(max(first_row, wet[k, 0]), min(end_row, wet[k, 1])):
                    _add(values[k, j], total)
            for ic in range(coarse.shape[2]):
                first, end = _cells_in(ic, factors[0], shift[0], nx)
                coarse[kc, jc, ic] = 0.0
                for i in range(first, end):
                    coarse[kc, jc, ic] += total[i]


@threaded
def prolong(coarse_x, wet, factors, shift, rows, x):
    """Add the coarse correction to every cell below it in wet rows; `shift` as of `restrict`; rows are overwritten."""
    nz, ny, nx = x.shape
    for kc in prange(coarse_x.shape[0]):
        correction = rows[kc]
        first_plane, end_plane = _cells_in(kc, factors[2], shift[2], nz)
        for jc in range(coarse_x.shape[1]):
            first_row, end_row = _cells_in(jc, factors[1], shift[1], ny)
            for i in range(nx):
                correction[i] = coarse_x[kc, jc, (i + shift[0]) // factors[0]]
            for k in range(first_plane, end_plane):
                for j in range(max(first_row, wet[k, 0]), min(end_row, wet[k, 1])):
                    _add(correction, x[k, j])


@threaded
def apply(x, ax, ay, az, diagonal, wet, out):
    """out = L x in the wet rows."""
    for k in prange(x.shape[0]):
        for j in range(wet[k, 0], wet[k, 1]):
            _apply_row(k, j, x, ax, ay, az, diagonal, out[k, j])


@threaded
def descend(length, direction, image, wet, x, residual, largest):
    """x += length direction, residual -= length image; largest[k] is the largest residual in plane k."""
    for k in prange(x.shape[0]):
        most = 0.0
        for j in range(wet[k, 0], wet[k, 1]):
            for i in range(x.shape[2]):
                x[k, j, i] += length * direction[k, j, i]
                left = residual[k, j, i] - length * image[k, j, i]
                residual[k, j, i] = left
                most = max(most, abs(left))
        largest[k] = most


@threaded
def largest_products(a, b, wet, rows, largest):
    """Largest magnitude of a b in each plane of two cell fields (nz, ny, nx); rows (2, nz, nx) are overwritten."""
    for k in prange(a.shape[0]):
        rows[0, k] = 0.0
        for j in range(wet[k, 0], wet[k, 1]):
            _take_largest(a[k, j], b[k, j], rows[0, k])
        most = 0.0
        for i in range(a.shape[2]):
            most = max(most, rows[0, k, i])
        largest[k] = most


@threaded
def split_products(a, b, wet, unit, rows, parts):
    """Sums of the two whole numbers of a b in each plane of two cell fields, and how many are not finite (nz, 3)."""
    for k in prange(a.shape[0]):
        rows[0, k] = rows[1, k] = 0.0
        for j in range(wet[k, 0], wet[k, 1]):
            _add_split(a[k, j], b[k, j], unit, rows[0, k], rows[1, k])
        parts[k] = 0
        for i in range(a.shape[2]):  # sums over a row of the plane are below 2^53
            if abs(rows[0, k, i]) < math.inf:
                parts[k, 0] += np.int64(rows[0, k, i])
                parts[k, 1] += np.int64(rows[1, k, i])
            else:
                parts[k, 2] += 1


@vector_inline
def _take_largest(a, b, row):
    """row = max(row, |a b|)"""
    for i in range(row.size):
        row[i] = max(row[i], abs(a[i] * b[i]))


@vector_inline
def _add_split(a, b, unit, whole, fine):
    """Add the whole numbers of a b, as floats."""
    for i in range(whole.size):
        scaled = a[i] * b[i] * unit
        rounded = np.rint(scaled)
        whole[i] += rounded
        fine[i] += np.rint((scaled - rounded) * FINE)
