r"""The response of a model to its parameters: a smooth fit to many runs, its best point, and what the data identify.

Each measured point i has a polynomial of second order in the parameters, fitted to the runs near the best one. The
best parameters minimise

.. math:: \chi^2(\theta) = \sum_i \frac{(y_i(\theta) - m_i)^2}{s_i^2 + r_i^2}

with the scatter r of the runs about the fit. Their covariance has three parts: errors of the data, scatter of the runs,
which is correlated between points, and the given ranges, which bound what the data do not say.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Array = NDArray[np.float64]

PER_TERM = 2
"""Runs for each term of a polynomial, at least."""

UNKNOWN = 0.2
"""Standard error over the range from which a parameter is not identified; that of a flat distribution is 0.289."""

FLAT = 12.0**-0.5
"""Standard deviation of a flat distribution over its range."""

TIED = 0.9
"""Correlation from which two parameters cannot be told apart."""


class Response(NamedTuple):
    """Best parameters and their errors, as shares of the ranges."""

    best: Array  # (p,)
    error: Array  # (p,) standard errors
    correlation: Array  # (p, p)
    chi2: float  # at the best point, per degree of freedom, with errors of data and runs
    scatter: Array  # (m,) of the runs about the fit, unit of the data
    computed: Array  # (m,) of the fit at the best point
    order: int  # of the polynomial: 2, or 1 with few runs

    @property
    def identified(self) -> NDArray[np.bool_]:
        """Whether the data say where each parameter lies in its range (p,)."""
        return np.asarray(self.error < UNKNOWN)

    def tied(self) -> list[tuple[int, int, float]]:
        """Pairs of parameters that cannot be told apart, with their correlation."""
        pairs = itertools.combinations(range(len(self.best)), 2)
        return [(a, b, float(self.correlation[a, b])) for a, b in pairs if abs(self.correlation[a, b]) > TIED]


def fewest_runs(parameters: int) -> int:
    """Runs that a fit needs at least."""
    return PER_TERM * (parameters + 1)


def response(shares: Array, computed: Array, measured: Array, error: Array, weight: Array) -> Response | None:
    """Fit the response of a model, and find its best point.

    shares    parameters of each run as shares of their ranges (n, p)
    computed  values of each run (n, m)
    measured  (m,)
    error     standard errors of the data (m,)
    weight    of each point (m,)
    returns   None with fewer runs than :func:`fewest_runs`
    """
    runs, parameters = shares.shape
    if runs < fewest_runs(parameters):
        return None
    squares = (weight * ((computed - measured) / error) ** 2).sum(axis=1)
    centre = shares[int(np.argmin(squares))]
    order = 2 if runs >= PER_TERM * _terms(parameters, 2) + 1 else 1
    nearness = _nearness(shares, centre, min(runs, 3 * _terms(parameters, order)))
    basis, roots = _basis(shares - centre, order), np.sqrt(nearness)[:, None]
    coefficients = np.linalg.lstsq(roots * basis, roots * computed, rcond=None)[0]
    residuals = computed - basis @ coefficients
    free = max(nearness.sum() - _terms(parameters, order), 1.0)
    covariance = (nearness[:, None] * residuals).T @ residuals / free
    scatter = np.sqrt(np.diag(covariance))
    spread = np.sqrt((error**2 + scatter**2) / weight)

    def values(point: Array) -> Array:
        return np.asarray((_basis((point - centre)[None], order) @ coefficients)[0])

    fit = least_squares(lambda point: (values(point) - measured) / spread, centre.clip(1e-6, 1.0 - 1e-6), bounds=(0, 1))
    slope = fit.jac * spread[:, None]
    degrees = max(len(measured) - parameters, 1)
    chi2 = float((fit.fun**2).sum()) / degrees
    gain = np.linalg.pinv((nearness[:, None] * basis).T @ basis) @ (nearness[:, None] * basis).T
    leverage = float(((_basis((fit.x - centre)[None], order)[0] @ gain) ** 2).sum())
    chance = float((scatter**2 / spread**2).sum()) * _gram(_slopes(fit.x - centre, order) @ gain)
    noise = np.diag(error**2) + (1.0 + leverage) * covariance
    matrix = _covariance(slope, spread, chance, noise, max(1.0, chi2))
    deviation = np.sqrt(np.diag(matrix))
    correlation = matrix / np.outer(deviation, deviation)
    return Response(fit.x, np.minimum(deviation, FLAT), correlation, chi2, scatter, values(fit.x), order)


def _covariance(slope: Array, spread: Array, chance: Array, noise: Array, factor: float) -> Array:
    """Covariance of the best parameters (p, p), for a flat distribution over the range before the data.

    slope   d y_i / d theta_k (m, p)
    spread  by which points were weighted (m,)
    chance  information that the slopes have by the scatter of the runs alone (p, p)
    noise   covariance of data and runs (m, m)
    factor  by which the noise is too small to explain the differences
    """
    scaled = slope / spread[:, None]
    before = 12.0 * np.eye(slope.shape[1])  # inverse variance of a flat distribution between 0 and 1
    sizes, axes = np.linalg.eigh(_gram(scaled.T) - chance)
    inverse = np.linalg.inv(axes * np.maximum(sizes, 0.0) @ axes.T + before)
    gain = inverse @ (scaled / spread[:, None]).T
    return np.asarray(factor * gain @ noise @ gain.T + inverse @ before @ inverse)


def _gram(rows: Array) -> Array:
    return np.asarray(rows @ rows.T)


def _terms(parameters: int, order: int) -> int:
    return 1 + parameters + (parameters * (parameters + 1) // 2 if order == 2 else 0)


def _basis(points: Array, order: int) -> Array:
    """Terms of a polynomial (n, terms)."""
    columns = [np.ones(len(points)), *points.T]
    if order == 2:
        columns += [points[:, a] * points[:, b] for a in range(points.shape[1]) for b in range(a, points.shape[1])]
    return np.stack(columns, axis=1)


def _nearness(shares: Array, centre: Array, count: int) -> Array:
    """Weight of each run (n,): a bell whose width reaches the `count` nearest runs."""
    distance = np.sqrt(((shares - centre) ** 2).sum(axis=1))
    width = max(float(np.sort(distance)[count - 1]), 1e-6)
    return np.asarray(np.exp(-0.5 * (distance / width) ** 2))


def _slopes(point: Array, order: int) -> Array:
    """Derivatives of the terms of a polynomial (p, terms)."""
    step = 1e-6 * np.eye(len(point))
    return np.asarray((_basis(point + step, order) - _basis(point - step, order)) / 2e-6)
