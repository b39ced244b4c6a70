r"""Projection: the pressure equation that continuity gives, and the correction of the velocity by the pressure.

With the mobility m of a face (velocity lost per pressure gradient, from the momentum balance) the corrected
velocity is u - m grad q, and continuity of every cell

.. math:: V\,\partial_t\varepsilon + \sum_f \pm A_f\, \varepsilon_f (u_f - m_f\, \partial_n q) = 0

is the pressure equation with face coefficients eps_f m_f A_f / h. An outlet has its pressure half a cell away.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import inline, prange, threaded
from cfddem.fluid.boundaries import Boundaries
from cfddem.fluid.checks import refuse_nan
from cfddem.fluid.fields import CellFields
from cfddem.fluid.grid import LOW, UNIT, Array
from cfddem.fluid.momentum import inside, line, strides
from cfddem.fluid.pressure.ranks import pressure_equation
from cfddem.fluid.pressure.regions import ClosedRegions


class Projection:
    """Corrects velocities and the pressure of a fluid so that continuity holds.

    boundaries  of its grid
    fields      with the mobility of faces and the new rate of change of the voidage
    """

    def __init__(self, boundaries: Boundaries, fields: CellFields, communicator: Communicator) -> None:
        self.boundaries, self.fields, self.communicator = boundaries, fields, communicator
        grid = self.grid = boundaries.grid
        closed_regions = ClosedRegions.of(grid, boundaries, communicator)
        self._equation = pressure_equation(grid, closed_regions, communicator, boundaries.periodic, boundaries.outlets)
        self._open = grid.open.astype(float)
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
            velocity, fields.mobility, voidage, fields.new_voidage_rate, self._open, boundaries.halo.ends, self._areas,
            self._inverse,
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
            subtract_gradient(velocity, fields.mobility, fields.correction, self._inverse)
            fields.owned("pressure")[:] += correction
        boundaries.fill_velocity(velocity)
        return iterations


class Flow(NamedTuple):
    """What the pressure equation is made of.

    velocity, mobility  padded faces
    voidage, rate       padded cells; rate is d eps/dt [1/s]
    open_cells          (nz, ny, nx) 1 where open
    ends                (3, 2) where the box ends below and above along x, y, z
    areas, inverse      of faces normal to x, y, z [m2], and 1/spacing [1/m]
    """

    velocity: Array
    mobility: Array
    voidage: Array
    rate: Array
    open_cells: Array
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


@threaded
def assemble(flow, shares, fresh, equation):
    """Right-hand side of the pressure equation and, if fresh, its coefficients.

    flow      `Flow`
    shares    of faces and cells that smooth walls leave open; none without walls
    equation  ax, ay, az, anchor and b, all (nz, ny, nx)
    """
    nz, ny, nx = flow.open_cells.shape
    for k in prange(nz):
        for j in range(ny):
            for i in range(nx):
                balance_cell(flow, shares, fresh, equation, k, j, i)


@inline
def balance_cell(flow, shares, fresh, equation, k, j, i):
    """b = -(V d eps/dt + outflow of eps u) of a cell [m3/s] and, if fresh, its coefficients and anchor."""
    velocity, mobility, voidage, areas, inverse = flow.velocity, flow.mobility, flow.voidage, flow.areas, flow.inverse
    (nz, ny, nx), ends = flow.open_cells.shape, flow.ends
    ax, ay, az, anchor, b = equation
    kk, jj, ii = k + LOW, j + LOW, i + LOW
    outflow, anchored = flow.rate[kk, jj, ii] * open_cell(shares, kk, jj, ii) * areas[0] / inverse[0], 0.0
    here = voidage[kk, jj, ii]
    for d in range(3):
        dk, dj, di = UNIT[d]
        below = 0.5 * (voidage[kk - dk, jj - dj, ii - di] + here) * open_face(shares, d, kk, jj, ii)
        above = 0.5 * (here + voidage[kk + dk, jj + dj, ii + di])
        above *= open_face(shares, d, kk + dk, jj + dj, ii + di)
        outflow += areas[d] * (above * velocity[d, kk + dk, jj + dj, ii + di] - below * velocity[d, kk, jj, ii])
        if fresh:
            a_below = below * mobility[d, kk, jj, ii] * areas[d] * inverse[d]
            a_above = above * mobility[d, kk + dk, jj + dj, ii + di] * areas[d] * inverse[d]
            place, cells = (i, nx) if d == 0 else ((j, ny) if d == 1 else (k, nz))
            # An unknown velocity on a boundary face: an outlet, its pressure half a cell away.
            if ends[d, 0] and place == 0:
                anchored += 2.0 * a_below
                a_below = 0.0
            if ends[d, 1] and place == cells - 1:
                anchored += 2.0 * a_above
            if cells == 1:
                a_below = 0.0
            if d == 0:
                ax[k, j, i] = a_below
            elif d == 1:
                ay[k, j, i] = a_below
            else:
                az[k, j, i] = a_below
    b[k, j, i] = -outflow * flow.open_cells[k, j, i]
    if fresh:
        anchor[k, j, i] = anchored


@threaded
def subtract_gradient(new, mobility, correction, inverse):
    """Subtract mobility times the gradient of the pressure correction from the velocity."""
    shape, steps = correction.shape, strides(correction.shape)
    new, mobility, correction = new.reshape(3, -1), mobility.reshape(3, -1), correction.reshape(-1)
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        for d in range(3):
            right, left = line(correction, at, n), line(correction, at - steps[d], n)
            out, mobility_here = line(new[d], at, n), line(mobility[d], at, n)
            for i in range(n):
                out[i] -= mobility_here[i] * ((right[i] - left[i]) * inverse[d])
