"""Compiled loops of a scalar in the fluid: fluxes through faces, the balance of cells, and implicit exchange."""

from __future__ import annotations

import math

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, prange, serial, threaded
from cfddem.fluid.grid import LOW
from cfddem.fluid.momentum import carried, inside, line, strides
from closures.heat_transfer import zehner_schluender


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
def cell_rates(flux, diffusivity, inverse, growth, rate):
    """Outflow of every cell, and the rate at which its value can change: a step below its inverse is bounded [1/s].

    A limited value on a face lies between the cells on both sides, so that what leaves a cell counts twice.
    """
    shape, steps = diffusivity.shape, strides(diffusivity.shape)
    diffusivity, growth, rate = diffusivity.reshape(-1), growth.reshape(-1), rate.reshape(-1)
    flux = flux.reshape(3, -1)
    spread = 4.0 * (inverse[0] ** 2 + inverse[1] ** 2 + inverse[2] ** 2)
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        d_here, grows, out = line(diffusivity, at, n), line(growth, at, n), line(rate, at, n)
        for i in range(n):
            grows[i], out[i] = 0.0, spread * d_here[i]
        for d in range(3):
            low, high = line(flux[d], at, n), line(flux[d], at + steps[d], n)
            for i in range(n):
                grows[i] += (high[i] - low[i]) * inverse[d]
                out[i] += 2.0 * (max(high[i], 0.0) + max(-low[i], 0.0)) * inverse[d]


@threaded
def diffusivities(voidage, molecular, straight, diffusivity):
    """Diffusivity of the fluid between the particles, from its molecular one [m2/s]: times eps, or by the law."""
    voidage, diffusivity = voidage.reshape(-1), diffusivity.reshape(-1)
    for n in prange(len(voidage)):
        diffusivity[n] = molecular * (voidage[n] if straight else zehner_schluender(voidage[n]))


@threaded
def through_faces(value, flux, diffusivity, gate, inverse, unlimited, through):
    """What flow and diffusion carry through every face, per area; sides of the box are set by `through_sides`."""
    shape, steps = value.shape, strides(value.shape)
    value, diffusivity = value.reshape(-1), diffusivity.reshape(-1)
    flux, gate, through = flux.reshape(3, -1), gate.reshape(3, -1), through.reshape(3, -1)
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        for d in range(3):
            far_low, low = line(value, at - 2 * steps[d], n), line(value, at - steps[d], n)
            high, far_high = line(value, at, n), line(value, at + steps[d], n)
            d_low, d_high = line(diffusivity, at - steps[d], n), line(diffusivity, at, n)
            f, is_open, out = line(flux[d], at, n), line(gate[d], at, n), line(through[d], at, n)
            for i in range(n):
                spread = 0.5 * is_open[i] * (d_low[i] + d_high[i]) * inverse[d]
                moved = carried(f[i], far_low[i], low[i], high[i], far_high[i], unlimited)
                out[i] = moved - spread * (high[i] - low[i])


@serial
def through_sides(value, flux, diffusivity, places, rules, inverse, through):
    """Set what is carried through the faces of sides and solid cells.

    places   (m, 4) axis, flat index of the face, of its cell, and +1 where the way into the cell is along the axis
    rules    (m, 6) value that an inflow brings, NaN for that of the cell; coefficient [m/s], infinite for a given value
             on the face; value outside; given flux; share of the area; 1 where it is in series with the half cell
    through  (3, size), per area along the axis
    """
    for n in range(len(places)):
        axis, face, cell, inward = places[n]
        brought, coefficient, outside, given, share, in_series = rules[n]
        own, f = value[cell], flux[axis, face]
        enters = f * inward > 0.0 and not math.isnan(brought)
        if in_series != 0.0:
            half = 2.0 * diffusivity[cell] * inverse[axis]
            coefficient = half if math.isinf(coefficient) else coefficient * half / (coefficient + half)
        through[axis, face] = f * (brought if enters else own)
        if coefficient != 0.0 or given != 0.0:
            through[axis, face] += inward * share * (coefficient * (outside - own) + given)


@threaded
def balance(value, stored, growth, through, second, step, inverse, new):
    """Value after a step from what went through the faces, (2, 3, ...), the second with this weight."""
    shape, steps = value.shape, strides(value.shape)
    value, stored, growth, new = value.reshape(-1), stored.reshape(-1), growth.reshape(-1), new.reshape(-1)
    through = through.reshape(2, 3, -1)
    for k in prange(LOW, shape[0] - LOW):
        at, n = inside(k, shape, 0)
        old, e, grows, out = line(value, at, n), line(stored, at, n), line(growth, at, n), line(new, at, n)
        for i in range(n):
            out[i] = e[i] * old[i]
        for d in range(3):
            a_low, a_high = line(through[0, d], at, n), line(through[0, d], at + steps[d], n)
            b_low, b_high = line(through[1, d], at, n), line(through[1, d], at + steps[d], n)
            for i in range(n):
                left = (1.0 - second) * (a_high[i] - a_low[i]) + second * (b_high[i] - b_low[i])
                out[i] -= step * inverse[d] * left
        for i in range(n):
            out[i] /= e[i] - step * grows[i]


@inline
def mean_of_decay(stiffness):
    """Mean of exp(-t z) over t from 0 to 1."""
    return -math.expm1(-stiffness) / stiffness if stiffness > 1e-8 else 1.0 - 0.5 * stiffness


@threaded
def relax(value, stored, coefficient, target, step, missed):
    """Relax the values of cells towards a target, exactly; adds the mean of target less value over the step.

    coefficient  over the capacity of the fluid [1/s]
    """
    value, stored, missed = value.reshape(-1), stored.reshape(-1), missed.reshape(-1)
    coefficient, target = coefficient.reshape(-1), target.reshape(-1)
    for n in prange(len(value)):
        stiffness = step * coefficient[n] / stored[n]
        mean = (target[n] - value[n]) * mean_of_decay(stiffness)
        value[n] += stiffness * mean
        missed[n] += mean
