"""Loops of the multigrid: sweeps, residual, transfer between levels, and the steps of conjugate gradients."""

from __future__ import annotations

from cfddem.backend.compile import prange, serial, threaded, vector_inline
from cfddem.fluid.halo import neighbours


@vector_inline
def _relax_plane(k, colour, backward, x, b, ax, ay, az, inverse, new):
    """Relax the cells of one colour in a plane; whole rows are computed, which vectorises, and half is kept."""
    nz, ny, nx = x.shape
    below, above = neighbours(k, nz)
    # Of one colour only the first and the last row can be neighbours (periodic y): backward takes the last one first.
    last, _ = neighbours(0, ny)
    for count in range(ny):
        j = (last if count == 0 else count - 1) if backward else count
        front, back = neighbours(j, ny)
        here, west, rhs, invert = x[k, j], ax[k, j], b[k, j], inverse[k, j]
        south, north, down, up = x[k, front], x[k, back], x[below, j], x[above, j]
        a_south, a_north, a_down, a_up = ay[k, j], ay[k, back], az[k, j], az[above, j]
        for i in range(nx):
            new[i] = (rhs[i] + a_south[i] * south[i] + a_north[i] * north[i]) + (a_down[i] * down[i] + a_up[i] * up[i])
        for i in range(1, nx - 1):
            new[i] = (new[i] + west[i] * here[i - 1] + west[i + 1] * here[i + 1]) * invert[i]
        parity = (k + j + colour) & 1
        # The ends of a row can be neighbours across a periodic boundary: one after the other.
        for count_end in range(min(2, nx)):
            i = nx - 1 if (count_end == 1) != backward else 0
            if (i & 1) == parity:
                left, right = neighbours(i, nx)
                sides = west[i] * here[left] + west[right] * here[right]
                here[i] = (new[i] + sides) * invert[i]
        for i in range(1, nx - 1):
            here[i] = new[i] if (i & 1) == parity else here[i]


@threaded
def smooth_colour(x, b, ax, ay, az, inverse, rows, colour, backward):
    """Relax the cells of one colour in place; rows (nz, nx) are overwritten."""
    nz = x.shape[0]
    # Of an odd number of planes the last has the colour of the first, its neighbour if periodic: it goes alone.
    together = nz - (nz & 1)
    for part in range(2):
        alone = (part == 0) == backward
        begin, end = (together, nz) if alone else (0, together)
        if begin < end:
            for k in prange(begin, end):
                _relax_plane(k, colour, backward, x, b, ax, ay, az, inverse, rows[k])


@serial
def colour_of(half, backward):
    """Colour that is relaxed in a half of a sweep."""
    return (half + 1) & 1 if backward else half & 1


@serial
def smooth(x, b, ax, ay, az, inverse, rows, sweeps, backward):
    """Gauss-Seidel by colours in place; backward is the exact transpose of forward; rows (nz, nx) are overwritten."""
    for half in range(2 * sweeps):
        smooth_colour(x, b, ax, ay, az, inverse, rows, colour_of(half, backward), backward)


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
def restrict(b, image, factors, shift, coarse_b):
    """Residual b - image of a level, summed over the cells that make one coarse cell.

    shift  along x, y, z; cell k lies in the coarse cell (k + shift) // factor
    """
    nz, ny, nx = b.shape
    fx, fy, fz = factors[0], factors[1], factors[2]
    for kc in prange(coarse_b.shape[0]):
        for jc in range(coarse_b.shape[1]):
            for ic in range(coarse_b.shape[2]):
                total = 0.0
                for k in range(max(kc * fz - shift[2], 0), min(kc * fz - shift[2] + fz, nz)):
                    for j in range(max(jc * fy - shift[1], 0), min(jc * fy - shift[1] + fy, ny)):
                        for i in range(max(ic * fx - shift[0], 0), min(ic * fx - shift[0] + fx, nx)):
                            total += b[k, j, i] - image[k, j, i]
                coarse_b[kc, jc, ic] = total


@threaded
def prolong(coarse_x, factors, shift, x):
    """Add the coarse correction to every cell below it; `shift` as of `restrict`."""
    nz, ny, nx = x.shape
    for k in prange(nz):
        for j in range(ny):
            source = coarse_x[(k + shift[2]) // factors[2], (j + shift[1]) // factors[1]]
            for i in range(nx):
                x[k, j, i] += source[(i + shift[0]) // factors[0]]


@threaded
def apply(x, ax, ay, az, diagonal, out, sums):
    """out = L x; sums[k] is the part of x.Lx in plane k."""
    for k in prange(x.shape[0]):
        total = 0.0
        for j in range(x.shape[1]):
            row = out[k, j]
            _apply_row(k, j, x, ax, ay, az, diagonal, row)
            for i in range(row.size):
                total += x[k, j, i] * row[i]
        sums[k] = total


@threaded
def descend(length, direction, image, x, residual, largest):
    """x += length direction, residual -= length image; largest[k] is the largest residual in plane k."""
    for k in prange(x.shape[0]):
        most = 0.0
        for j in range(x.shape[1]):
            for i in range(x.shape[2]):
                x[k, j, i] += length * direction[k, j, i]
                left = residual[k, j, i] - length * image[k, j, i]
                residual[k, j, i] = left
                most = max(most, abs(left))
        largest[k] = most
