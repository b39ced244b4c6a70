"""Compiled loops of a scalar in the fluid: fluxes through faces, the balance of cells, and implicit exchange."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, prange, serial, threaded
from cfddem.fluid.grid import LOW
from cfddem.fluid.momentum import carried, inside, line, strides
from closures.heat_transfer import zehner_schluender


@threaded
def followed_voidage(stored, voidage, rate, is_open, step, lost):
    """Stored voidage less that of the fluid at the beginning of the step [s], to `lost` in open cells.

    stored, voidage, rate [1/s], lost  padded
    """
    for k in prange(is_open.shape[0]):
        for j in range(is_open.shape[1]):
            for i in range(is_open.shape[2]):
                at = k + LOW, j + LOW, i + LOW
                lost[at] = (stored[at] - (voidage[at] - step * rate[at])) * is_open[k, j, i]


@threaded
def volume_fluxes(velocity, voidage, lost, gate, strength, flux):
    """eps u through every face, with the correction that lets the stored voidage follow that of the fluid.

    lost      stored voidage less that of the fluid, padded
    gate      (3, ...) 1 between two open cells
    strength  of the correction along x, y, z [m/s]
    """
    shape, steps = voidage.shape, strides(voidage.shape)
    voidage, lost = voidage.reshape(-1), lost.reshape(-1)
    velocity, gate, flux = velocity.reshape(3, -1), gate.reshape(3, -1), flux.reshape(3, -1)
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        for d in range(3):
            here, below = line(voidage, at, n), line(voidage, at - steps[d], n)
            more, less = line(lost, at, n), line(lost, at - steps[d], n)
            u, is_open, out = line(velocity[d], at, n), line(gate[d], at, n), line(flux[d], at, n)
            for i in range(n):
                out[i] = 0.5 * (here[i] + below[i]) * u[i] + strength[d] * is_open[i] * (less[i] - more[i])


@threaded
def cell_flows(flux, inverse, growth, outflow):
    """Net outflow of every cell to `growth`, and twice what leaves it to `outflow` [1/s].

    A limited value on a face lies between the cells on both sides, so that what leaves a cell counts twice.
    """
    shape, steps = growth.shape, strides(growth.shape)
    flat_growth, flat_outflow, flux = growth.reshape(-1), outflow.reshape(-1), flux.reshape(3, -1)
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        grows, out = line(flat_growth, at, n), line(flat_outflow, at, n)
        for i in range(n):
            grows[i] = out[i] = 0.0
        for d in range(3):
            low, high = line(flux[d], at, n), line(flux[d], at + steps[d], n)
            for i in range(n):
                grows[i] += (high[i] - low[i]) * inverse[d]
                out[i] += 2.0 * (max(high[i], 0.0) + max(-low[i], 0.0)) * inverse[d]


@threaded
def least_stored(stored, growth, is_open, step, least):
    """The least of the stored voidage of every cell in the step [s], to `least` (nz, ny, nx) [-]; its net outflow
    `growth` becomes 0 in solid cells.
    """
    for k in prange(is_open.shape[0]):
        for j in range(is_open.shape[1]):
            for i in range(is_open.shape[2]):
                at = k + LOW, j + LOW, i + LOW
                growth[at] *= is_open[k, j, i]
                least[k, j, i] = min(stored[at], stored[at] - step * growth[at])


@threaded
def cell_rates(outflow, diffusivity, spread, of_walls, least, is_open, rate):
    """Rate at which the value of every cell can change: a step below its inverse is bounded (nz, ny, nx) [1/s].

    spread  by a diffusivity of 1 m2/s [1/m2]
    """
    for k in prange(is_open.shape[0]):
        for j in range(is_open.shape[1]):
            for i in range(is_open.shape[2]):
                at = k + LOW, j + LOW, i + LOW
                fastest = outflow[at] + spread[k, j, i] * diffusivity[at] + of_walls[k, j, i]
                rate[k, j, i] = fastest * is_open[k, j, i] / least[k, j, i]


@threaded
def diffusivities(voidage, molecular, straight, diffusivity):
    """Diffusivity of the fluid between the particles, from its molecular one [m2/s]: times eps, or by the law."""
    voidage, diffusivity = voidage.reshape(-1), diffusivity.reshape(-1)
    for n in prange(len(voidage)):
        diffusivity[n] = molecular * (voidage[n] if straight else zehner_schluender(voidage[n]))


class Carried(NamedTuple):
    """What moves a scalar in a step, padded but for the sides.

    places   (m, 4) axis, flat index of the face, of its cell, and +1 where the way into the cell is along the axis
    rules    (m, 6) value that an inflow brings, NaN for that of the cell; coefficient [m/s], infinite for a given value
             on the face; value outside; given flux; share of the area; 1 where it is in series with the half cell
    through  (2, 3, ...) what goes through every face, per area along its axis, in both stages
    """

    stored: np.ndarray  # voidage [-]
    growth: np.ndarray  # net outflow [1/s]
    flux: np.ndarray  # of the fluid (3, ...) [m/s]
    diffusivity: np.ndarray  # [m2/s]
    aperture: np.ndarray  # (3, ...) share of a face that is open, between two open cells
    places: np.ndarray
    rules: np.ndarray
    through: np.ndarray
    inverse: np.ndarray  # of the spacing along x, y, z [1/m]


@inline
def entering(coefficient, outside, source, in_series, own, half):
    """What enters a cell through a wall, per area.

    coefficient, outside, source, in_series  see `Carried`
    own   value of the cell
    half  coefficient between the wall and the value of the cell [m/s]
    """
    if in_series != 0.0:
        coefficient = half if math.isinf(coefficient) else coefficient * half / (coefficient + half)
    return coefficient * (outside - own) + source


@threaded
def carry(value, carried_by, stage, unlimited):
    """What flow and diffusion carry through every face, sides of the box included, in a stage of `finish`."""
    shape, steps = value.shape, strides(value.shape)
    _, _, flux, diffusivity, aperture, places, rules, both, inverse = carried_by
    value, diffusivity = value.reshape(-1), diffusivity.reshape(-1)
    flux, aperture, through = flux.reshape(3, -1), aperture.reshape(3, -1), both[stage].reshape(3, -1)
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        for d in range(3):
            far_low, low = line(value, at - 2 * steps[d], n), line(value, at - steps[d], n)
            high, far_high = line(value, at, n), line(value, at + steps[d], n)
            d_low, d_high = line(diffusivity, at - steps[d], n), line(diffusivity, at, n)
            f, share, out = line(flux[d], at, n), line(aperture[d], at, n), line(through[d], at, n)
            for i in range(n):
                spread = 0.5 * share[i] * (d_low[i] + d_high[i]) * inverse[d]
                moved = carried(f[i], far_low[i], low[i], high[i], far_high[i], unlimited)
                out[i] = moved - spread * (high[i] - low[i])
    for n in range(len(places)):
        axis, face, cell, inward = places[n]
        brought, coefficient, outside, source, share, in_series = rules[n]
        own, through_side = value[cell], flux[axis, face]
        enters = through_side * inward > 0.0 and not math.isnan(brought)
        through[axis, face] = through_side * (brought if enters else own)
        half = 2.0 * diffusivity[cell] * inverse[axis]
        through[axis, face] += inward * share * entering(coefficient, outside, source, in_series, own, half)


@threaded
def leave(carried_by, stage, left):
    """What leaves every cell through its faces, per time, in a stage: the mean of both in the second one (padded)."""
    shape, steps, second = left.shape, strides(left.shape), 0.5 * stage
    left, both, inverse = left.reshape(-1), carried_by.through.reshape(2, 3, -1), carried_by.inverse
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        out = line(left, at, n)
        for i in range(n):
            out[i] = 0.0
        for d in range(3):
            a_low, a_high = line(both[0, d], at, n), line(both[0, d], at + steps[d], n)
            b_low, b_high = line(both[1, d], at, n), line(both[1, d], at + steps[d], n)
            for i in range(n):
                leaving = (1.0 - second) * (a_high[i] - a_low[i]) + second * (b_high[i] - b_low[i])
                out[i] += inverse[d] * leaving


@threaded
def finish(old, carried_by, step, new):
    """The balance of every cell in one of Heun's two stages.

    old  before the step [s]
    new  what leaves the cell, then its value after the step
    """
    shape, stored, growth = old.shape, carried_by.stored.reshape(-1), carried_by.growth.reshape(-1)
    old, new = old.reshape(-1), new.reshape(-1)
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        was, e, grows, out = line(old, at, n), line(stored, at, n), line(growth, at, n), line(new, at, n)
        for i in range(n):
            out[i] = (e[i] * was[i] - step * out[i]) / (e[i] - step * grows[i])


@serial
def add_flows(carried_by, start, step, flows):
    """Add what came in along its axis through the face of every side in a step, above that of the value `start`."""
    flux, through = carried_by.flux.reshape(3, -1), carried_by.through.reshape(2, 3, -1)
    for n in range(len(flows)):
        axis, face, _, inward = carried_by.places[n]
        mean = 0.5 * (through[0, axis, face] + through[1, axis, face])
        flows[n] += step * inward * (mean - start * flux[axis, face])


@serial
def sort_flows(carried_by, flows, area, wall, capacity, sums):
    """What came in through inlets, outlets and walls, and the fluid that left, of every face of a side (4, m).

    area, wall  of the face [m2], and whether it is a wall (m,)
    """
    flux = carried_by.flux.reshape(3, -1)
    for n in range(len(flows)):
        axis, face, _, inward = carried_by.places[n]
        into = flux[axis, face] * inward
        sums[:, n] = 0.0
        sums[2 if wall[n] else (1 if into < 0.0 else 0), n] = flows[n] * area[n] * capacity
        if not wall[n] and into < 0.0:
            sums[3, n] = into * area[n]


@inline
def mean_of_decay(stiffness):
    """Mean of exp(-t z) over t from 0 to 1."""
    return -math.expm1(-stiffness) / stiffness if stiffness > 1e-8 else 1.0 - 0.5 * stiffness


@threaded
def relax(value, stored, coefficient, target, step, missed):
    """Relax the values of cells towards a target, exactly; adds the mean of target less value over the step.

    coefficient  over the capacity of the fluid [1/s]
    """
    shape = value.shape
    value, stored, missed = value.reshape(-1), stored.reshape(-1), missed.reshape(-1)
    coefficient, target = coefficient.reshape(-1), target.reshape(-1)
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        now, e, rate = line(value, at, n), line(stored, at, n), line(coefficient, at, n)
        towards, less = line(target, at, n), line(missed, at, n)
        for i in range(n):
            stiffness = step * rate[i] / e[i]
            mean = (towards[i] - now[i]) * mean_of_decay(stiffness)
            now[i] += stiffness * mean
            less[i] += mean


@threaded
def take_exchange(coefficient, product, value, capacity, rate, target, missed):
    """Coefficient over capacity [1/s], and value of the particles in every cell; that of the fluid without particles.

    coefficient, product  (nz, ny, nx); others padded
    """
    for k in prange(coefficient.shape[0]):
        for j in range(coefficient.shape[1]):
            for i in range(coefficient.shape[2]):
                at, b = (k + LOW, j + LOW, i + LOW), coefficient[k, j, i]
                rate[at], missed[at] = b / capacity, 0.0
                target[at] = product[k, j, i] / b if b > 0.0 else value[at]
