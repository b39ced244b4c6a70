r"""Projection: the pressure equation that continuity gives, and the correction of the velocity by the pressure.

With the mobility m of a face (velocity lost per pressure gradient, from the momentum balance) the corrected
velocity is u - m grad q, and continuity of every cell

.. math:: V\,\partial_t\varepsilon + \sum_f \pm A_f\, \varepsilon_f (u_f - m_f\, \partial_n q) = 0

is the pressure equation with face coefficients eps_f m_f A_f / h. An outlet has its pressure half a cell away.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import inline, prange, threaded, vector_inline
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.fields import CellFields, Stretches, refuse_nan
from cfddem.fluid.grid import LOW, UNIT, Array, Grid
from cfddem.fluid.momentum import line, strides
from cfddem.fluid.pressure.multigrid import ClosedRegions
from cfddem.fluid.pressure.ranks import pressure_equation


class Projection:
    """Corrects velocities and the pressure of a fluid so that continuity holds.

    boundaries  of its grid
    fields      with the mobility of faces and the new rate of change of the voidage
    stretches   of faces with an unknown velocity
    """

    def __init__(
        self, boundaries: Boundaries, fields: CellFields, stretches: Stretches, communicator: Communicator
    ) -> None:
        self.boundaries, self.fields, self.communicator = boundaries, fields, communicator
        grid = self.grid = boundaries.grid
        self._stretches = stretches
        closed_regions = ClosedRegions.of(grid, boundaries, communicator)
        self._equation = pressure_equation(grid, closed_regions, communicator, boundaries.periodic, boundaries.outlets)
        self._open, self._wet = grid.open.astype(float), _wet_rows(grid)
        self._areas = np.array([grid.face_area(d) for d in range(3)])
        self._inverse = 1.0 / np.array(grid.spacing)
        self._missing = np.zeros(grid.shape)  # fluid that each cell lacks [m3/s]

    def correct(self, velocity: Array, voidage: Array, limit: float, scale: float, fresh: bool, time: float) -> int:
        """Correct a velocity and the pressure; returns the iterations it took.

        velocity, voidage  padded
        limit  largest residual of a cell [m3/s]
        scale  largest volume flux [m3/s]
        fresh  whether the mobility is new, and with it the coefficients of the equation
        time   for messages [s]
        """
        grid, boundaries, fields, equation, missing = (
            self.grid, self.boundaries, self.fields, self._equation, self._missing,
        )  # fmt: skip
        flow = Flow(
            velocity, fields.mobility, voidage, fields.new_voidage_rate, self._open, self._wet, boundaries.halo.ends,
            self._areas, self._inverse,
        )  # fmt: skip
        assemble(flow, boundaries.cut.shares, fresh, (*equation.coefficients, missing))
        if fresh:
            equation.prepare()
        refuse_nan(grid, missing, time, self.communicator)
        if equation.closed_regions is not None:
            equation.closed_regions.refuse_imbalance(missing, scale, time)
        correction, iterations = equation.solve(missing, limit)
        if iterations:
            grid.inner(fields.correction)[:] = correction
            boundaries.fill_pressure(fields.correction, correction=True)
            subtract_gradient(self._stretches, velocity, fields.mobility, fields.correction, self._inverse)
            fields.owned("pressure")[:] += correction
        boundaries.fill_velocity(velocity)
        return iterations


def _wet_rows(grid: Grid) -> NDArray[np.int64]:
    """First row of each plane that has open cells, and the one after the last (nz, 2)."""
    wet: Any = grid.open.any(axis=2)  # local: rows of this rank
    end = wet.shape[1] - wet[:, ::-1].argmax(axis=1)  # local: rows of a plane
    return np.stack([wet.argmax(axis=1), end * wet.any(axis=1)], axis=1)  # local: a plane


class Flow(NamedTuple):
    """What the pressure equation is made of.

    velocity, mobility  padded faces
    voidage, rate       padded cells; rate is d eps/dt [1/s]
    open_cells          (nz, ny, nx) 1 where open
    wet                 (nz, 2) first row of each plane that has open cells, and the one after the last
    ends                (3, 2) where the box ends below and above along x, y, z
    areas, inverse      of faces normal to x, y, z [m2], and 1/spacing [1/m]
    """

    velocity: Array
    mobility: Array
    voidage: Array
    rate: Array
    open_cells: Array
    wet: Any
    ends: Any
    areas: Array
    inverse: Array


@inline
def open_face(shares, d, k, j, i):
    """Open share of a face; 1 without shares, which is known when the loop is compiled."""
    if len(shares) == 0:
        return 1.0
    return shares[0][d, k, j, i]


@inline
def open_cell(shares, k, j, i):
    """Open share of a cell, as `open_face`."""
    if len(shares) == 0:
        return 1.0
    return shares[1][k, j, i]


@inline
def through(flow, shares, d, low, high, x):
    """Open share of the face normal to d times its voidage.

    low, high  first cells of the two rows on both sides
    x          place in these rows
    """
    (k, j, i), (low_k, low_j, low_i) = high, low
    voidage = 0.5 * (flow.voidage[low_k, low_j, low_i + x] + flow.voidage[k, j, i + x])
    return voidage * open_face(shares, d, k, j, i + x)


@inline
def coefficient(flow, shares, d, low, high, x):
    """Coefficient of the face normal to d, see `through`."""
    k, j, i = high
    return through(flow, shares, d, low, high, x) * flow.mobility[d, k, j, i + x] * flow.areas[d] * flow.inverse[d]


@threaded
def assemble(flow, shares, fresh, equation):
    """Right-hand side of the pressure equation and, if fresh, its coefficients.

    flow      `Flow`
    shares    of faces and cells that smooth walls leave open; none without walls
    equation  ax, ay, az, anchor and b, all (nz, ny, nx)
    """
    ax, ay, az, anchor, b = equation
    nz, ny, nx = flow.open_cells.shape
    for k in prange(nz):
        for j in range(flow.wet[k, 0], flow.wet[k, 1]):
            row = k + LOW, j + LOW, LOW
            balance_row(flow, shares, row, flow.open_cells[k, j], b[k, j])
            if fresh:
                write_coefficients(flow, shares, 0, row, (0, nx), ax[k, j], anchor[k, j])
                write_coefficients(flow, shares, 1, row, (j, ny), ay[k, j], anchor[k, j])
                write_coefficients(flow, shares, 2, row, (k, nz), az[k, j], anchor[k, j])


@vector_inline
def balance_row(flow, shares, row, open_cells, b):
    """b = -(V d eps/dt + outflow of eps u) of the cells of a row [m3/s]; row is the first of them."""
    (k, j, i), velocity, areas = row, flow.velocity, flow.areas
    west, east, south, north = (k, j, i - 1), (k, j, i + 1), (k, j - 1, i), (k, j + 1, i)
    down, up = (k - 1, j, i), (k + 1, j, i)
    for x in range(b.size):
        outflow = flow.rate[k, j, i + x] * open_cell(shares, k, j, i + x) * areas[0] / flow.inverse[0]
        above = through(flow, shares, 0, row, east, x) * velocity[0, k, j, i + 1 + x]
        outflow += areas[0] * (above - through(flow, shares, 0, west, row, x) * velocity[0, k, j, i + x])
        above = through(flow, shares, 1, row, north, x) * velocity[1, k, j + 1, i + x]
        outflow += areas[1] * (above - through(flow, shares, 1, south, row, x) * velocity[1, k, j, i + x])
        above = through(flow, shares, 2, row, up, x) * velocity[2, k + 1, j, i + x]
        outflow += areas[2] * (above - through(flow, shares, 2, down, row, x) * velocity[2, k, j, i + x])
        b[x] = -outflow * open_cells[x]


@inline
def write_coefficients(flow, shares, d, row, place, out, anchor):
    """Write the coefficients of the low faces of a row of cells along d, and add to their anchors, x first.

    row    the first of the cells
    place  of the row among the rows along d, 0 along x, and the number of cells there
    """
    (k, j, i), (dk, dj, di), (number, count) = row, UNIT[d], place
    take_row(flow, shares, d, (k - dk, j - dj, i - di), row, out)
    if d == 0:
        anchor[:] = 0.0
    # An unknown velocity on a boundary face: an outlet, its pressure half a cell away.
    if flow.ends[d, 0] and number == 0:
        take_low_side(out[:1] if d == 0 else out, anchor)
    if count == 1:
        out[:] = 0.0
    if flow.ends[d, 1] and (d == 0 or number == count - 1):
        last = count - 1 if d == 0 else 0
        take_high_side(flow, shares, d, (k, j, i + last), (k + dk, j + dj, i + di + last), anchor[last:])


@vector_inline
def take_row(flow, shares, d, low, high, out):
    """Write the coefficients of the faces of a row."""
    for x in range(out.size):
        out[x] = coefficient(flow, shares, d, low, high, x)


@vector_inline
def take_low_side(coefficients, anchor):
    """Make coefficients of faces on a low side of the box anchors."""
    for x in range(coefficients.size):
        anchor[x] += 2.0 * coefficients[x]
        coefficients[x] = 0.0


@vector_inline
def take_high_side(flow, shares, d, low, high, anchor):
    """Add the anchors of faces on a high side of the box."""
    for x in range(anchor.size):
        anchor[x] += 2.0 * coefficient(flow, shares, d, low, high, x)


@threaded
def subtract_gradient(stretches, new, mobility, correction, inverse):
    """Subtract mobility times the gradient of the pressure correction from the velocity, on stretches of faces."""
    shape, steps = correction.shape, strides(correction.shape)
    new, mobility, correction = new.reshape(3, -1), mobility.reshape(3, -1), correction.reshape(-1)
    first, begins, counts = stretches
    for k in prange(shape[0]):
        for part in range(first[k], first[k + 1]):
            at, n = begins[part], counts[part]
            for d in range(3):
                right, left = line(correction, at, n), line(correction, at - steps[d], n)
                out, mobility_here = line(new[d], at, n), line(mobility[d], at, n)
                for i in range(n):
                    out[i] -= mobility_here[i] * ((right[i] - left[i]) * inverse[d])
