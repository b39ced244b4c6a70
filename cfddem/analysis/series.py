"""Statistics of time series: stationarity, means with errors, power spectra.

Pure functions of arrays. Values must be evenly spaced in time; :func:`even` interpolates them so.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError

Array = NDArray[np.float64]
FEWEST = 16
"""Fewest values from which an error is estimated."""

ROUNDING = 1e-12
"""Relative difference below which values are equal: a packed bed is constant to rounding [-]."""


def even(time: Array, values: Array, count: int | None = None) -> tuple[float, Array]:
    """Interpolate a series linearly at even intervals.

    time     (n,) ascending [s]
    values   (n,), any unit
    count    of values to return; n if None
    returns  interval [s], values (count,)
    """
    if len(time) != len(values) or len(time) < 2 or not (np.diff(time) > 0.0).all():
        raise InputError("time", None, "ascending, at least two instants, one for each value")
    instants = np.linspace(time[0], time[-1], count or len(time))
    return float(instants[1] - instants[0]), np.interp(instants, time, values)


class Average(NamedTuple):
    """A mean and its standard error, same unit as the values."""

    mean: float
    error: float  # NaN with fewer than 16 values
    block: int  # values per block
    independent: float  # number of uncorrelated values with the same error
    enough: bool  # false if the record is too short for its correlation time; the error is then a lower bound

    def __str__(self) -> str:
        return f"{self.mean:.4g} +- {self.error:.2g}"


def block_average(values: Array) -> Average:
    r"""Mean of a stationary, correlated series with its standard error, by blocking.

    .. math:: s_B^2 = \frac{\mathrm{var}(\mathrm{block\ means})}{n_B},\qquad
              \mathrm{smallest\ } B = 2^k:\ B^3 > 2n\,(s_B/s_1)^4

    values   (n,), any unit
    returns  Average; if blocks of an eighth of the record are still too short, the error is a lower bound, about
             15 % low for a record worth 20 independent values

    The block length is doubled until block means are uncorrelated (Flyvbjerg & Petersen, J. Chem. Phys. 91 (1989) 461),
    with the criterion of Lee et al., Phys. Rev. E 83 (2011) 066706.
    """
    series = np.asarray(values, float)
    count, mean = len(series), float(series.mean()) if len(series) else float("nan")
    if count < FEWEST:
        return Average(mean, float("nan"), 0, float("nan"), False)
    first = square = float(series.var(ddof=1) / count)
    block, means, enough = 1, series, first == 0.0
    while not enough:
        square = float(means.var(ddof=1) / len(means))
        enough = block**3 > 2.0 * count * (square / first) ** 2
        if enough or len(means) < FEWEST:
            break
        means = means[: len(means) // 2 * 2].reshape(-1, 2).mean(axis=1)
        block *= 2
    independent = count * first / square if square else float(count)
    return Average(mean, float(np.sqrt(square)), block, independent, enough)


class Stationarity(NamedTuple):
    """Whether a series is stationary after its start-up, and where the start-up ends."""

    stationary: bool
    start: int  # index of the first value after the start-up
    drift: float  # mean of the second half minus that of the first, after the start-up, same unit as the values
    error: float  # standard error of the drift, same unit


def stationarity(values: Array, limit: float = 3.0) -> Stationarity:
    r"""Where the start-up of a series ends, and whether the rest drifts.

    .. math:: \mathrm{start} = \arg\min_d \frac{1}{(n-d)^2}\sum_{i\ge d}(x_i-\bar x_d)^2

    values   (n,), any unit
    limit    largest ratio of drift to its error for a stationary series [-]
    returns  Stationarity

    The start-up is cut where the standard error of the mean of the rest is smallest (MSER: White, Simulation 69 (1997)
    323), on means of five values. The cut leaves at least a quarter of the record: the variance of less than a period
    of a wave says nothing. The series is not stationary if the start-up exceeds half of the record, if the two halves
    of the rest differ by more than `limit` standard errors, or if the rest is too short for an error.
    """
    series = np.asarray(values, float)
    batch = 5 if len(series) >= 10 * FEWEST else 1
    means = series[: len(series) // batch * batch].reshape(-1, batch).mean(axis=1)
    count = len(means)
    if count < FEWEST:
        return Stationarity(False, 0, float("nan"), float("nan"))
    if np.ptp(series) <= ROUNDING * float(np.abs(series).max()):
        return Stationarity(True, 0, 0.0, 0.0)
    left = np.arange(count, 0, -1.0)
    tail, square = np.cumsum(means[::-1])[::-1], np.cumsum(((means - means.mean()) ** 2)[::-1])[::-1]
    spread = square - left * (tail / left - means.mean()) ** 2
    cut = int(np.argmin((np.maximum(spread, 0.0) / left**2)[: 3 * count // 4 + 1]))
    start = cut * batch
    rest = series[start:]
    first, second = np.array_split(rest, 2)
    drift = second.mean() - first.mean()
    # without detrending, a trend within a half would look like a long correlation time and enlarge the error
    error = math.hypot(*(block_average(_less_its_line(half)).error for half in (first, second)))
    rounding = ROUNDING * float(np.abs(rest).max())
    stationary = cut <= count // 2 and bool(abs(drift) <= limit * error + rounding)
    return Stationarity(stationary, start, float(drift), error)


def drift_of(time: Array, values: Array) -> tuple[float, float]:
    r"""How far a series drifts over its whole duration, and the standard error of that.

    .. math:: \mathrm{drift} = b\,T,\qquad s = \sqrt{12}\,s_{\bar r}

    time     (n,) ascending [s]
    values   (n,), any unit
    returns  drift and error, same unit; NaN with fewer than 16 values

    b is the slope of the straight line through all values, T their duration, and s_r the standard error of the mean of
    the values less the line.
    """
    if len(values) < FEWEST:
        return float("nan"), float("nan")
    since = (time - time.mean()) / (time[-1] - time[0])
    drift = _slope(since, values)
    return drift, float(np.sqrt(12.0)) * block_average(values - drift * since).error


def _less_its_line(values: Array) -> Array:
    """A series less the straight line through it, by least squares."""
    since: Array = np.arange(len(values), dtype=float) - 0.5 * (len(values) - 1)
    rest: Array = values - values.mean() - _slope(since, values) * since
    return rest


def _slope(since: Array, values: Array) -> float:
    """Slope of the straight line through a series, by least squares, over a time whose mean is 0."""
    return float(since @ (values - values.mean()) / ((since @ since) or 1.0))


class Spectrum(NamedTuple):
    """Power spectrum of a fluctuation."""

    frequency: Array  # [Hz]
    density: Array  # unit of the values squared per Hz
    main: float  # frequency of the highest peak [Hz]; NaN for a constant series


def spectrum(values: Array, interval: float, segments: int = 3) -> Spectrum:
    """Power spectrum of a series by Welch's method, with its main frequency.

    values    (n,), any unit
    interval  between two values [s]
    segments  of the record, overlapping by half: more give a smoother, fewer a finer spectrum
    returns   Spectrum; the main frequency is interpolated by a parabola through the peak

    The uncertainty of the main frequency is about one over the duration of a segment.
    """
    series = np.asarray(values, float)
    if interval <= 0.0 or len(series) < FEWEST:
        raise InputError("values", len(series), f"at least {FEWEST} values at a positive interval")
    from scipy.signal import welch  # imported here: it takes a quarter of the start of a command

    length = max(FEWEST, 2 * len(series) // (segments + 1))
    frequency, density = welch(series, 1.0 / interval, nperseg=length, nfft=4 * length, detrend="linear")
    peak = int(np.argmax(density[1:-1])) + 1
    if density[peak] <= 1e-24 * max(float(np.mean(series**2)), 1e-300) * interval:
        return Spectrum(frequency, density, float("nan"))
    left, top, right = np.log(np.maximum(density[peak - 1 : peak + 2], 1e-300))
    bend = left - 2.0 * top + right
    shift = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return Spectrum(frequency, density, float((peak + np.clip(shift, -0.5, 0.5)) * frequency[1]))


class MeanFrequency(NamedTuple):
    """Mean frequency of an oscillation and its standard error."""

    frequency: float  # [Hz]; NaN with fewer than two whole periods
    error: float  # from the scatter of the periods, taken as independent [Hz]; NaN with fewer than three
    periods: int  # whole periods in the record


def mean_frequency(values: Array, interval: float, band: float = 0.5) -> MeanFrequency:
    r"""Mean frequency of an irregular oscillation, from the times between its crests.

    .. math:: f = \frac{n}{t_n - t_0},\qquad s_f = \frac{f\,s_T}{\bar T\sqrt n}

    values    (n,), any unit
    interval  between two values [s]
    band      half width of the band around the trend that a crest must leave, over the standard deviation [-]
    returns   MeanFrequency

    A period begins where the series rises out of the band after it has been below. The error says what a short record
    is worth: the peak of a spectrum has none.
    """
    series = np.asarray(values, float)
    if interval <= 0.0 or len(series) < FEWEST:
        raise InputError("values", len(series), f"at least {FEWEST} values at a positive interval")
    series = _less_its_line(series)
    level = band * float(series.std())
    side = np.where(series > level, 1, np.where(series < -level, -1, 0))
    outside = np.flatnonzero(side)
    begins = outside[1:][(side[outside[1:]] == 1) & (side[outside[:-1]] == -1)] * interval
    lengths = np.diff(begins)
    count = len(lengths)
    if count < 2:
        return MeanFrequency(float("nan"), float("nan"), count)
    mean = float(lengths.mean())
    error = float(lengths.std(ddof=1)) / mean**2 / np.sqrt(count) if count > 2 else float("nan")
    return MeanFrequency(1.0 / mean, error, count)
