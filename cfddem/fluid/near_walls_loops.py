"""Loops over the faces near smooth walls: convection and viscous stress of cut momentum cells, and their stiff part.

Faces are taken in blocks, along each direction in turn, so that several are computed at once. All fields are flat when
a loop takes them: of one that is reshaped within it the compiler does not know what memory it shares with others.
"""

from __future__ import annotations

import numpy as np

from cfddem.backend.compile import prange, threaded, vector_inline
from cfddem.fluid.momentum import carried, implicitness

FULL = 0.5
"""Share of a momentum cell below which its convection acts on so much fluid."""

EMPTY = 0.01
"""As `FULL`, for the change of the fluid that the cell holds."""

BLOCK = 64
"""Most faces that are computed together."""


@threaded
def shut(at, share, flux):
    """Take the open parts of some faces from the flux through all of them, a padded component, flat."""
    for n in prange(at.size):
        flux[at[n]] *= share[n]


@threaded
def cut_transport(faces, velocity, flux, viscosity, density, central, rate):
    """Write div(eps mu grad u) - div(rho eps u u) per volume of the fluid on the faces of a component near walls.

    faces      `cfddem.fluid.near_walls.Faces` of the component
    velocity   padded component; flux (3, ...) eps u times the open share of a face; viscosity eps mu of cells
    rate       written
    """
    steps, u, mu, width = faces.steps, velocity, viscosity, faces.place.shape[1]
    for block in prange(len(faces.place)):
        pattern, terms, sums = faces.pattern[block], np.empty((8, width)), np.zeros((3, width))
        _gather(faces, block, pattern, steps, u, mu, terms)
        for e in range(3):
            if e == faces.axis:
                _take_centres(faces, block, steps[e], 2 * steps[2], flux[e], terms)
            else:
                _take_edges(faces, block, (steps[e], steps[faces.axis]), 2 * steps[2], flux[e], mu, terms)
            _balance(faces, (block, pattern, e), steps, u, central, terms, sums)
        _per_volume(faces, pattern, terms, density, sums)
        place, within = faces.place[block], rate[2 * steps[2] :]
        for i in range(width):
            within[place[i]] = sums[0, i]


@vector_inline
def _gather(faces, block, pattern, steps, u, mu, terms):
    """Write what all directions use: velocities of the faces of a block and of the next ones, viscosities beside."""
    at, farther, back, first = faces.place[block], faces.farther[pattern], steps[faces.axis], 2 * steps[2]
    # places count from `first`, the first face that all neighbours can have, in all slices
    here, left, right = u[first:], mu[first - back :], mu[first:]
    velocity, other, m_left, m_right = terms[0], terms[1], terms[2], terms[3]
    for i in range(velocity.size):
        p = at[i]
        velocity[i], other[i], m_left[i], m_right[i] = here[p], u[p + farther[i]], left[p], right[p]


@vector_inline
def _take_centres(faces, block, step, first, flux, terms):
    """Write viscosity and flux on the momentum faces of a block along its own axis, which are centres of cells."""
    at, low, here, high = faces.place[block], flux[first - step :], flux[first:], flux[first + step :]
    m_left, m_right, m_low, m_high, inward, outward = terms[2], terms[3], terms[4], terms[5], terms[6], terms[7]
    for i in range(at.size):
        p = at[i]
        m_low[i], m_high[i] = m_left[i], m_right[i]
        inward[i], outward[i] = 0.5 * (low[p] + here[p]), 0.5 * (here[p] + high[p])


@vector_inline
def _take_edges(faces, block, steps, first, flux, mu, terms):
    """As `_take_centres`, along another axis, where momentum faces lie around edges of the grid."""
    at, (step, back) = faces.place[block], steps
    f_left_low, f_left_high = flux[first - back :], flux[first - back + step :]
    f_right_low, f_right_high = flux[first:], flux[first + step :]
    m_left_low, m_left_high = mu[first - back - step :], mu[first - back + step :]
    m_right_low, m_right_high = mu[first - step :], mu[first + step :]
    m_left, m_right, m_low, m_high, inward, outward = terms[2], terms[3], terms[4], terms[5], terms[6], terms[7]
    for i in range(at.size):
        p, beside = at[i], m_left[i] + m_right[i]
        m_low[i] = 0.25 * (m_left_low[p] + m_right_low[p] + beside)
        m_high[i] = 0.25 * (m_left_high[p] + m_right_high[p] + beside)
        inward[i], outward[i] = 0.5 * (f_left_low[p] + f_right_low[p]), 0.5 * (f_left_high[p] + f_right_high[p])


@vector_inline
def _balance(faces, which, steps, u, central, terms, sums):
    """Add the parts of both momentum faces of a block along e: stress, convection, growth of the fluid."""
    stress, away, growth = sums[0], sums[1], sums[2]
    block, pattern, e = which
    at, step, first = faces.place[block], steps[e], 2 * steps[2]
    low2, low, high, high2 = u[first - 2 * step :], u[first - step :], u[first + step :], u[first + 2 * step :]
    here, farther, m_low, m_high, inward, outward = terms[0], terms[1], terms[4], terms[5], terms[6], terms[7]
    next_low, next_high = faces.next[pattern, e, 0], faces.next[pattern, e, 1]
    w, inverse = faces.weight[pattern, e], faces.inverse[e]
    w0, w1, w2, w3, w4, w5, w6, w7 = w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7]
    for i in range(stress.size):
        p, u2 = at[i], here[i]
        u1, u3 = low[p], high[p]
        pull_low = w0[i] * u1 + w1[i] * u2 + w2[i] * u[p + next_low[i]] + w3[i] * farther[i]
        pull_high = w4[i] * u2 + w5[i] * u3 + w6[i] * farther[i] + w7[i] * u[p + next_high[i]]
        stress[i] += m_high[i] * pull_high - m_low[i] * pull_low
        value_low = carried(inward[i], low2[p], u1, u2, u3, central)
        value_high = carried(outward[i], u1, u2, u3, high2[p], central)
        away[i] += inverse * ((value_high - outward[i] * u2) - (value_low - inward[i] * u2))
        growth[i] += inverse * (outward[i] - inward[i])
    if len(faces.constant) > 0:  # walls slide
        c_low, c_high = faces.constant[pattern, e, 0], faces.constant[pattern, e, 1]
        for i in range(stress.size):
            stress[i] += m_high[i] * c_high[i] - m_low[i] * c_low[i]


@vector_inline
def _per_volume(faces, pattern, terms, density, sums):
    """Take the pull of the wall into the stress of a block, and convection and growth per volume."""
    stress, away, growth = sums[0], sums[1], sums[2]
    here, farther, left, right = terms[0], terms[1], terms[2], terms[3]
    share, own, other = faces.share[pattern], faces.pull[pattern, 0], faces.pull[pattern, 1]
    constant = faces.pull[pattern, 2]
    for i in range(stress.size):
        pull = constant[i] + own[i] * here[i] + other[i] * farther[i]
        convection = away[i] / max(share[i], FULL) + here[i] * growth[i] / max(share[i], EMPTY)
        stress[i] -= 0.5 * (left[i] + right[i]) * pull + density * convection


@threaded
def hold_near_walls(faces, viscosity, voidage, velocities, mobility, resistance, fluid, step):
    """Take the stiff part of the stress near walls into a predicted component, implicitly, as `predict` takes drag.

    viscosity   eps mu, and voidage in the middle of the step, padded
    velocities  padded components: at the start of the step, of the stage before, the predicted one
    mobility    padded component
    resistance  of the stiff faces, stiff part of the stress over the velocity [kg/m3/s], written in the first stage
    fluid       its density [kg/m3], and 1 in model B
    step        [s], and the weight of the stress of the stage before, 0 in the first stage
    """
    back, first = faces.steps[faces.axis], 2 * faces.steps[2]
    old, stage, new = velocities
    old, stage, new, mobility, mu, eps = old[first:], stage[first:], new[first:], mobility[first:], viscosity, voidage
    count = faces.stiff_at.size
    for block in prange((count + BLOCK - 1) // BLOCK):
        begin, end = block * BLOCK, min((block + 1) * BLOCK, count)
        at, of_block, results = faces.stiff_at[begin:end], resistance[begin:end], np.empty((2, end - begin))
        if step[1] == 0.0:  # both stages have the same mobility, and with it the same pressure equation
            _resist(at, faces.stiff[begin:end], mu[first - back :], mu[first:], of_block)
        fields = eps[first - back :], eps[first:], old, stage, new, mobility
        _held(at, fields, of_block, fluid, step, results)
        for i in range(at.size):
            new[at[i]], mobility[at[i]] = results[0, i], results[1, i]


@vector_inline
def _resist(at, stiff, mu_left, mu_right, resistance):
    """Write the resistance of a block."""
    for i in range(at.size):
        p = at[i]
        resistance[i] = stiff[i] * (0.5 * (mu_right[p] + mu_left[p]))


@vector_inline
def _held(at, fields, resistance, fluid, step, results):
    """Write velocity and mobility of a block."""
    (eps_left, eps_right, old, stage, new, mobility), (density, model_b), (step, weight) = fields, fluid, step
    velocity, lost = results[0], results[1]
    for i in range(at.size):
        p, stiffness = at[i], resistance[i]
        at_face, before, moved = 0.5 * (eps_right[p] + eps_left[p]), old[p], mobility[p]
        explicit = (1.0 - weight) * before + weight * stage[p]  # as the explicit stress, of both stages
        theta = implicitness(stiffness * step / (density * at_face))
        loose = step * (at_face + model_b * (1.0 - at_face))
        slow = 1.0 / (loose + step * theta * stiffness * moved)
        velocity[i] = (loose * new[p] + step * stiffness * moved * (explicit - (1.0 - theta) * before)) * slow
        lost[i] = moved * loose * slow
