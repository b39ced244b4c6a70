r"""Resistance that depends on direction, in the implicit step of every particle.

A particle has a resistance B, a symmetric tensor, and the cells of a fluid know one conductance b for it: the largest
resistance in any direction. Over a step h the particle receives what :mod:`cfddem.coupling.transfer` gives a
conductance, in each principal direction with the resistance there. With :math:`\Lambda = hB/C`,

.. math:: J = h\,B\,D^{-1}\left[(2+\Lambda)(u-v) - (1+\Lambda)\frac{hf}{C}\right],\qquad D = 2 + 2\Lambda + \Lambda^2

at the velocity u of the fluid that is foreseen: that before the step and half of the change du of the last one, since
drag sees the mean of a heavy fluid over the step. What else it changes acts through b* on both sides, so that the fluid
stays stable, and its equations keep one conductance for all directions. Its change in this step is du', with

.. math:: m\,du' = F - \tfrac12 b^*\,du' + \tfrac12 (b^* - B^*)\,du

for fluid of the mass m (over h) and a force F. So du' settles where the fluid feels B* alone, by a factor
(b* - B*)/(2m + b*) in each step. A light fluid, whose drag sees more of du', keeps a part of the excess.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import closures.compiled  # noqa: F401  lets compiled loops call laws by their names
from cfddem.backend.compile import inline, prange, threaded
from cfddem.fluid.grid import Array
from cfddem.fluid.momentum import implicitness
from cfddem.particles.vectors import NOTHING, minus, of_row, plus, solved, through, times


class Directions(NamedTuple):
    """How the resistance of every particle depends on direction."""

    lacks: Array  # what it lacks of the conductance, a symmetric tensor (N, 3, 3) [kg/s]
    slip: Array  # foreseen u less v before the step, with all that acts through the resistance (N, 3) [m/s]


def slip_of(force: Array, conductance: Array, lacks: Array) -> Array:
    """Slip at which the resistance has these forces (N, 3) [m/s]."""
    slip = np.empty_like(force)
    _slip_of(force, conductance, lacks, slip)
    return slip


def implicit_force(slip: Array, conductance: Array, lacks: Array, capacity: Array, step: float) -> Array:
    """Implicit force of the resistance at a slip alone (N, 3) [N]; b* times the slip where nothing lacks."""
    force = np.empty_like(slip)
    _implicit_force(slip, conductance, lacks, capacity, step, force)
    return force


@inline
def _resistance(conductance, lacks, n):
    """Rows of the resistance of a particle."""
    b, lack = conductance[n], lacks[n]
    return (
        (b - lack[0, 0], -lack[0, 1], -lack[0, 2]),
        (-lack[1, 0], b - lack[1, 1], -lack[1, 2]),
        (-lack[2, 0], -lack[2, 1], b - lack[2, 2]),
    )


@threaded
def _slip_of(force, conductance, lacks, slip):
    for n in prange(len(force)):
        slip[n, 0], slip[n, 1], slip[n, 2] = solved(_resistance(conductance, lacks, n), of_row(force, n))


@inline
def _denominator(matrix):
    """2 + 2 M + M^2 of a symmetric matrix."""
    x = plus(times(2.0, matrix[0]), through(matrix, matrix[0]))
    y = plus(times(2.0, matrix[1]), through(matrix, matrix[1]))
    z = plus(times(2.0, matrix[2]), through(matrix, matrix[2]))
    return (x[0] + 2.0, x[1], x[2]), (y[0], y[1] + 2.0, y[2]), (z[0], z[1], z[2] + 2.0)


@inline
def _force(n, slip, gain, conductance, lacks, share):
    """Mean force over the step; gain is h f/C, and share h/C."""
    resistance = _resistance(conductance, lacks, n)
    stiffness = times(share, resistance[0]), times(share, resistance[1]), times(share, resistance[2])
    change = minus(slip, gain)
    wanted = plus(plus(slip, change), through(stiffness, change))
    return through(resistance, solved(_denominator(stiffness), wanted))


@threaded
def _implicit_force(slip, conductance, lacks, capacity, step, force):
    for n in prange(len(slip)):
        mean = _force(n, of_row(slip, n), NOTHING, conductance, lacks, step / capacity[n])
        force[n, 0], force[n, 1], force[n, 2] = mean


@threaded
def direct(directions, conductance, capacity, step, begin, coefficients):
    """Change v* so that the particle receives by direction what it does, see above.

    begin         v and disturbance (N, 3)
    coefficients  b*, v*, and b* and b* v* of `implicit_coefficients` for the conductance alone
    """
    for n in prange(len(conductance)):
        _direct_one(n, directions, conductance, capacity, step, begin, coefficients)


@inline
def _direct_one(n, directions, conductance, capacity, step, begin, coefficients):
    (value, disturbance), (implicit, target, carried) = begin, coefficients
    share, slip = step / capacity[n], of_row(directions.slip, n)
    start = plus(of_row(value, n), of_row(disturbance, n))
    gain = times(1.0 / implicitness(share * conductance[n]), minus(of_row(target, n), start))  # h f/C
    force = _force(n, slip, gain, conductance, directions.lacks, share)
    new = minus(plus(start, slip), times(1.0 / max(implicit[n], 1e-300), force))
    target[n, 0], target[n, 1], target[n, 2] = new
    carried[n, 1], carried[n, 2], carried[n, 3] = times(implicit[n], new)
