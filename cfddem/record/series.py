"""What is measured on a series in time: when it has become stationary, means with errors, spectra, residence times.

Pure functions of arrays. Values are evenly spaced in time; :func:`even` makes them so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid
from scipy.signal import detrend, welch

from cfddem.errors import InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
FEWEST = 16
"""Values below which a series says nothing about its own error."""


def even(time: Array, values: Array, count: int | None = None) -> tuple[float, Array]:
    """A series at even intervals, by linear interpolation.

    time     (n,) rising [s]
    values   (n,), any unit
    count    of values to return; as many as there are if None
    returns  interval [s], values (count,)
    """
    if len(time) != len(values) or len(time) < 2 or not (np.diff(time) > 0.0).all():
        raise InputError("time", None, "rising, at least two instants, one for each value")
    instants = np.linspace(time[0], time[-1], count or len(time))
    return float(instants[1] - instants[0]), np.interp(instants, time, values)


class Average(NamedTuple):
    """A mean and its standard error, same unit as the values."""

    mean: float
    error: float  # NaN with fewer than 16 values
    block: int  # values that count as one
    independent: float  # how many values without memory would be as sure
    enough: bool  # false where the record is too short for its memory: the error is then a lower bound

    def __str__(self) -> str:
        return f"{self.mean:.4g} +- {self.error:.2g}"


def block_average(values: Array) -> Average:
    r"""Mean of a stationary series with its standard error, which the memory of the series enlarges.

    .. math:: s_B^2 = \frac{\mathrm{var}(\mathrm{block\ means})}{n_B},\qquad
              \mathrm{smallest\ } B = 2^k:\ B^3 > 2n\,(s_B/s_1)^4

    values   (n,), any unit
    returns  Average; where not even an eighth of the record is a block long enough its error is a lower bound, some
             15 % low for a record worth 20 independent values

    Blocks are doubled until their means have forgotten each other (Flyvbjerg & Petersen, J. Chem. Phys. 91 (1989) 461);
    which length is enough after Lee et al., Phys. Rev. E 83 (2011) 066706.
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
    """From which value on a series is stationary, and whether it is at all."""

    stationary: bool
    start: int  # index of the first value after the start-up
    drift: float  # mean of the second half less that of the first, after the start-up, same unit as the values
    error: float  # standard error of the drift, same unit


def stationarity(values: Array, limit: float = 3.0) -> Stationarity:
    r"""Where the start-up of a series ends, and whether it still drifts after that.

    .. math:: \mathrm{start} = \arg\min_d \frac{1}{(n-d)^2}\sum_{i\ge d}(x_i-\bar x_d)^2

    values   (n,), any unit
    limit    drift over its error that is taken for a trend [-]
    returns  Stationarity

    The start-up is cut where the mean of the rest is known best (MSER: White, Simulation 69 (1997) 323), on means of
    five values. It is not stationary if that asks for more than half of the record, if the two halves of the rest
    differ by more than `limit` standard errors, or if the rest is too short for an error.
    """
    series = np.asarray(values, float)
    batch = 5 if len(series) >= 10 * FEWEST else 1
    means = series[: len(series) // batch * batch].reshape(-1, batch).mean(axis=1)
    count = len(means)
    if count < FEWEST:
        return Stationarity(False, 0, float("nan"), float("nan"))
    left = np.arange(count, 0, -1.0)
    tail, square = np.cumsum(means[::-1])[::-1], np.cumsum(((means - means.mean()) ** 2)[::-1])[::-1]
    spread = square - left * (tail / left - means.mean()) ** 2
    cut = int(np.argmin((np.maximum(spread, 0.0) / left**2)[: count - 4]))
    start = cut * batch
    rest = series[start:]
    first, second = np.array_split(rest, 2)
    drift = second.mean() - first.mean()
    # a trend within a half would pass for long memory, and hide itself behind the error it makes
    error = float(np.hypot(block_average(detrend(first)).error, block_average(detrend(second)).error))
    rounding = 1e-12 * float(np.abs(rest).max())  # a packed bed does not move at all
    stationary = cut <= count // 2 and bool(abs(drift) <= limit * error + rounding)
    return Stationarity(stationary, start, float(drift), error)


class Spectrum(NamedTuple):
    """Power of a fluctuation over its frequency."""

    frequency: Array  # [Hz]
    density: Array  # unit of the values squared, over Hz
    main: float  # frequency of the highest peak [Hz]; NaN where nothing fluctuates


def spectrum(values: Array, interval: float, segments: int = 3) -> Spectrum:
    """Power spectrum of a series by Welch's method, and its main frequency.

    values    (n,), any unit
    interval  between two values [s]
    segments  into which the record is cut, overlapping by half: more are smoother, fewer finer
    returns   Spectrum; the main frequency lies between the grid of frequencies, by a parabola through the peak

    The main frequency is no surer than one over the length of a segment.
    """
    series = np.asarray(values, float)
    if interval <= 0.0 or len(series) < FEWEST:
        raise InputError("values", len(series), f"at least {FEWEST} values at a positive interval")
    length = max(FEWEST, 2 * len(series) // (segments + 1))
    frequency, density = welch(series, 1.0 / interval, nperseg=length, nfft=4 * length, detrend="linear")
    peak = int(np.argmax(density[1:-1])) + 1
    if density[peak] <= 1e-24 * max(float(np.mean(series**2)), 1e-300) * interval:
        return Spectrum(frequency, density, float("nan"))
    left, top, right = np.log(np.maximum(density[peak - 1 : peak + 2], 1e-300))
    bend = left - 2.0 * top + right
    shift = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return Spectrum(frequency, density, float((peak + np.clip(shift, -0.5, 0.5)) * frequency[1]))


def crossing_frequency(values: Array, interval: float) -> float:
    """How often a series rises through its mean: a frequency that needs few periods.

    values    (n,), any unit
    interval  between two values [s]
    returns   f [Hz], from the first to the last crossing; NaN with fewer than two
    """
    side = np.asarray(values) > np.mean(values)
    rises = np.flatnonzero(~side[:-1] & side[1:])
    return float((len(rises) - 1) / ((rises[-1] - rises[0]) * interval)) if len(rises) > 1 else float("nan")


def residence_times(time: Array, inside: Mask) -> Array:
    """How long particles stayed in a region, for every visit that begins and ends within the record.

    time     (T,) of the snapshots, rising [s]
    inside   (T, N) true where a particle is in the region
    returns  (visits,) [s]; entry and exit are taken halfway between two snapshots

    Visits that outlast the record are missing, so their mean is low; :func:`mean_residence_time` is not.
    """
    instants, there = np.asarray(time, float), np.asarray(inside, bool)
    change = np.diff(there.astype(np.int8), axis=0).T  # by particle, so that visits of one come one after the other
    middle = 0.5 * (instants[1:] + instants[:-1])
    particle, step = np.nonzero(change)
    enters = change[particle, step] > 0
    paired = enters[:-1] & ~enters[1:] & (particle[:-1] == particle[1:])
    return np.asarray((middle[step[1:]] - middle[step[:-1]])[paired])


def mean_residence_time(time: Array, inside: Mask) -> float:
    """Mean stay in a region in a stationary flow: what is in it, over what leaves it in a second.

    time     (T,) of the snapshots, rising [s]
    inside   (T, N) true where a particle is in the region
    returns  [s]; infinite where nothing leaves
    """
    there = np.asarray(inside, bool)
    held = float(trapezoid(there.sum(axis=1), np.asarray(time, float)))
    leaving = int((there[:-1] & ~there[1:]).sum())
    return held / leaving if leaving else float("inf")
