r"""Kernel of the smoothed particles, their neighbours, and the weights of pairs.

Wendland's C2 kernel with h = 1.5 dx and the reach 2 h. The Laplacian of f is the sum of a_ij (f_j - f_i) with

.. math:: a_{ij} = 2 V_j\,\frac{|r\cdot\nabla W|}{r^2 + 0.01 h^2}
"""

from __future__ import annotations

import math

import numpy as np

from cfddem.backend.compile import inline, serial

SMOOTHING, REACH = 1.5, 3.0
"""h and reach of the kernel [particle spacings]."""

MOST = 400
"""Most neighbours of a particle, on average."""


@inline
def slope(distance, h):
    """Derivative of the kernel with the distance, at most 0 [1/m4]."""
    q = distance / h
    if q >= 2.0:
        return 0.0
    part = 1.0 - 0.5 * q
    return -21.0 / (16.0 * math.pi * h**4) * 5.0 * q * part * part * part


@serial
def neighbours(points, count, reach):
    """Neighbours of the first `count` points within a reach: start of each row, and the indices."""
    low, cells = np.empty(3), np.empty(3, np.int64)
    for axis in range(3):
        low[axis] = points[:, axis].min()
        cells[axis] = int((points[:, axis].max() - low[axis]) / reach) + 1
    place = np.empty((len(points), 3), np.int64)
    head, following = np.full(cells[0] * cells[1] * cells[2], -1), np.full(len(points), -1)
    for n in range(len(points)):
        for axis in range(3):
            place[n, axis] = int((points[n, axis] - low[axis]) / reach)
        cell = (place[n, 0] * cells[1] + place[n, 1]) * cells[2] + place[n, 2]
        following[n] = head[cell]
        head[cell] = n
    start, others, used = np.zeros(count + 1, np.int64), np.empty(MOST * count, np.int64), 0
    for n in range(count):
        for a in range(max(place[n, 0] - 1, 0), min(place[n, 0] + 2, cells[0])):
            for b in range(max(place[n, 1] - 1, 0), min(place[n, 1] + 2, cells[1])):
                for c in range(max(place[n, 2] - 1, 0), min(place[n, 2] + 2, cells[2])):
                    other = head[(a * cells[1] + b) * cells[2] + c]
                    while other >= 0:
                        square = 0.0
                        for axis in range(3):
                            square += (points[other, axis] - points[n, axis]) ** 2
                        if other != n and square < reach * reach and used < len(others):
                            others[used] = other
                            used += 1
                        other = following[other]
        start[n + 1] = used
    return start, others[:used]


@serial
def weights(points, start, others, dx):
    """For each pair: a_ij [1/m2], and the volume times the gradient of the kernel at the first point [1/m]."""
    h, volume = SMOOTHING * dx, dx**3
    laplacian, gradient = np.empty(len(others)), np.empty((len(others), 3))
    for n in range(len(start) - 1):
        for pair in range(start[n], start[n + 1]):
            square = 0.0
            for axis in range(3):
                gradient[pair, axis] = points[n, axis] - points[others[pair], axis]
                square += gradient[pair, axis] ** 2
            distance = math.sqrt(square)
            steep = slope(distance, h)
            laplacian[pair] = -2.0 * volume * distance * steep / (square + 0.01 * h * h)
            for axis in range(3):
                gradient[pair, axis] *= volume * steep / max(distance, 1e-12)
    return laplacian, gradient


@serial
def row_sums(start, values):
    """Sum of the values of each row's pairs."""
    sums = np.zeros(len(start) - 1)
    for n in range(len(sums)):
        for pair in range(start[n], start[n + 1]):
            sums[n] += values[pair]
    return sums


@serial
def divergence(velocity, start, others, origin, signs, gradient, stretch):
    """Divergence of the velocity: sum of S_i (u_j - u_i) . grad W over the neighbours (n,) [1/s]."""
    sums = np.zeros(len(velocity))
    for n in range(len(velocity)):
        for pair in range(start[n], start[n + 1]):
            other = others[pair]
            for a in range(3):
                change = signs[other, a] * velocity[origin[other], a] - velocity[n, a]
                for b in range(3):
                    sums[n] += change * stretch[n, a, b] * gradient[pair, b]
    return sums


@serial
def gradient_of(pressure, start, others, origin, gradient, stretch, surface):
    """Gradient of pressure: S_i times the sum of (p_j - p_i) grad W; at the surface of (p_j + p_i) (n, 3) [Pa/m]."""
    sums = np.zeros((len(pressure), 3))
    for n in range(len(pressure)):
        x, y, z = 0.0, 0.0, 0.0
        own = pressure[n] if surface[n] else -pressure[n]
        for pair in range(start[n], start[n + 1]):
            both = pressure[origin[others[pair]]] + own
            x += both * gradient[pair, 0]
            y += both * gradient[pair, 1]
            z += both * gradient[pair, 2]
        for a in range(3):
            sums[n, a] = stretch[n, a, 0] * x + stretch[n, a, 1] * y + stretch[n, a, 2] * z
    return sums


@serial
def moment_across(points, start, others, gradient):
    """Second moment of the neighbours in the horizontal plane; 1 within the liquid (n,) [-]."""
    sums = np.zeros(len(start) - 1)
    for n in range(len(sums)):
        for pair in range(start[n], start[n + 1]):
            for axis in range(2):
                sums[n] += 0.5 * (points[others[pair], axis] - points[n, axis]) * gradient[pair, axis]
    return sums


def full_sum(dx: float) -> float:
    """Sum of a_ij of a particle within a full lattice [1/m2]."""
    side = np.arange(-3, 4) * dx
    points = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    order = np.argsort((points**2).sum(axis=1), kind="stable")
    start, others = neighbours(points[order], 1, REACH * dx)
    return float(weights(points[order], start, others, dx)[0].sum())
