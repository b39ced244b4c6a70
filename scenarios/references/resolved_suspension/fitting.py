r"""Free numbers of the laws of agitation, fitted to the measured force on resolved spheres.

The closure writes the fluctuating force on a particle as

.. math:: F'' = a_d\,b\,u'' + a_i\,c\,\frac{du''}{dt},\qquad c = \frac{m\,(1+C)\,m_f}{m + C\,m_f},

b the drag coefficient and :math:`u''` the fluctuation of the fluid velocity that the particle sees, with variance R and
the autocorrelation of the run's process of two times, :math:`\tau_1 = 0.8\,\tau` and :math:`\tau_2 = 0.2\,\tau`,

.. math:: \rho(t) = \frac{\tau_1\,e^{-|t|/\tau_1} - \tau_2\,e^{-|t|/\tau_2}}{\tau_1-\tau_2} .

The autocovariance of F'' averaged over a window follows without simulation, and :math:`a_d`, :math:`a_i` and
:math:`\tau` are fitted to it by least squares. The drag on a particle's own fluctuation v' must first be added to the
measured force: F'' = F' + b v'.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from closures.added_mass import zuber
from closures.agitation import SHORT, pseudo_turbulence


def seen_fluctuation(solid_fraction: float, reynolds: float) -> tuple[float, float]:
    """Variance of the fluid velocity that particles see, along and across, over w^2 (Mehrabadi et al. 2015).

    >>> [round(each, 3) for each in seen_fluctuation(0.36, 45.0)]
    [0.477, 0.132]
    """
    along, across = (pseudo_turbulence(solid_fraction, reynolds, component) for component in (1.0, 0.0))
    return along, across


def inertia_coefficient(mass: float, displaced: float, solid_fraction: float) -> float:
    """Coefficient c of the fluid's acceleration, with Zuber's added mass."""
    added = zuber(1.0 - solid_fraction)
    return mass * (1.0 + added) * displaced / (mass + added * displaced)


def autocovariance(lags: np.ndarray, window: float, drag: float, inertia: float, time: float) -> np.ndarray:
    """Autocovariance of the force averaged over a window, for a seen velocity of unit variance.

    drag, inertia  a_d b and a_i c
    time           tau, in the unit of the lags
    """
    times = np.array([1.0 - SHORT, SHORT]) * time
    shares = np.array([1.0 - SHORT, -SHORT]) / (1.0 - 2.0 * SHORT)

    def twice_integrated(t: np.ndarray) -> np.ndarray:
        t = np.abs(np.asarray(t, float))[:, None]
        decay = np.exp(-t / times)
        velocity = (shares * (times**2 * decay + times * t)).sum(axis=1)
        acceleration = -(shares * decay).sum(axis=1)  # of minus the second derivative of the velocity's
        return np.asarray(drag**2 * velocity + inertia**2 * acceleration)

    ends = twice_integrated(lags + window) + twice_integrated(lags - window)
    return (ends - 2.0 * twice_integrated(lags)) / window**2


class Shares(NamedTuple):
    """Free numbers of pseudo-turbulence, common to all runs."""

    along: float  # a_d along the mean slip
    across: float  # a_d across it
    inertia: float  # a_i
    time: float  # tau over d/w


class Levels(NamedTuple):
    """Numbers of the law of free spheres, common to all runs."""

    along: float  # variance over w^2, along the mean slip
    across: float  # across it
    time: float  # tau over d/w


def fit_shares(rows: Sequence[dict[str, Any]]) -> Shares:
    """Fit one set of a_d, a_i and tau to several runs at once."""

    def model(numbers: np.ndarray, row: dict[str, Any], along: bool) -> np.ndarray:
        shares = Shares(*np.exp(numbers))
        variance = seen_fluctuation(row["solid_fraction"], row["reynolds"])[0 if along else 1]
        drag = shares.along if along else shares.across
        return variance * _of(row, drag, shares.inertia * row["inertia"], shares.time)

    starts = (np.log([0.5, 0.5, inertia, 1.0]) for inertia in (0.03, 0.3))
    return Shares(*(float(number) for number in np.exp(_fit_all(rows, model, starts))))


def fit_levels(rows: Sequence[dict[str, Any]]) -> Levels:
    """Fit the law of free spheres to several runs at once."""

    def model(numbers: np.ndarray, row: dict[str, Any], along: bool) -> np.ndarray:
        levels = Levels(*np.exp(numbers))
        return (levels.along if along else levels.across) * _of(row, 1.0, 0.0, levels.time)

    return Levels(*(float(number) for number in np.exp(_fit_all(rows, model, [np.log([0.1, 0.1, 1.0])]))))


def _of(row: dict[str, Any], drag: float, inertia: float, time: float) -> np.ndarray:
    """Autocovariance for a seen velocity of unit variance, at the lags and with the window of a run."""
    return autocovariance(np.array(row["lag"])[: len(row["seen_covariance_along"])], row["window"], drag, inertia, time)


def _fit_all(
    rows: Sequence[dict[str, Any]],
    model: Callable[[np.ndarray, dict[str, Any], bool], np.ndarray],
    starts: Iterable[np.ndarray],
) -> np.ndarray:
    """Numbers of a model for the autocovariances of all runs, each of which counts equally, over its variance."""

    def missed(numbers: np.ndarray) -> np.ndarray:
        parts = []
        for row in rows:
            for way in ("along", "across"):
                measured = np.array(row[f"seen_covariance_{way}"])
                parts.append((model(numbers, row, way == "along") - measured) / measured[0])
        return np.concatenate(parts)

    best = min((least_squares(missed, start) for start in starts), key=lambda fit: float(fit.cost))
    return np.asarray(best.x)
