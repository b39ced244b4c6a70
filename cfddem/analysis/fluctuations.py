r"""Collisions from their record, their regime map, and dispersion from positions.

For a Maxwellian distribution of velocities with the granular temperature T, the normal speeds of impact have the
density :math:`\frac{v}{2T}\,e^{-v^2/4T}` and the mean :math:`\sqrt{\pi T}`.

The Stokes number compares the inertia of a pair with the resistance of its film. The gap ratio h_eps/h_sigma decides
the minimum gap: above 1 the film pressure deforms the solids and keeps them apart, below 1 asperities set the gap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError

Array = NDArray[np.float64]


class Impacts(NamedTuple):
    """Collisions between particles within a time."""

    rate: float  # collisions of one particle per time [1/s]
    contact_rate: float  # those in which the solids touch [1/s]
    mean_speed: float  # normal speed of approach, mean [m/s]
    edges: Array  # (n + 1,) of the bins of the speed [m/s]
    density: Array  # (n,) probability density of the speed [s/m]


def impacts(collisions: Mapping[str, Array], begin: float, end: float, particles: int, bins: int = 40) -> Impacts:
    """Rate and speeds of the collisions that ended within a time.

    collisions  columns of the record (n,), as :attr:`cfddem.io.reading.RunData.collisions`
    begin, end  [s]
    particles   number of particles
    bins        of the distribution of speeds
    returns     Impacts; NaN where there are no collisions

    A collision begins where the film of the pair begins, or at contact without films; its speed is that of the approach
    there.
    """
    if not end > begin:
        raise InputError("end", end, f"after begin, {begin:g} s")
    nothing = np.zeros(0)
    columns = {name: np.asarray(collisions.get(name, nothing), float) for name in _COLUMNS}
    kept = (columns["end"] >= begin) & (columns["end"] < end) & (columns["second"] >= 0.0)
    kept &= columns["approach_speed"] > 0.0
    speed, weight = columns["approach_speed"][kept], columns["weight"][kept]
    touched = (columns["closest_gap"] < columns["minimum_gap"])[kept] | ~np.isfinite(columns["stokes"][kept])
    per_particle = 2.0 / (particles * (end - begin))
    total = float(weight.sum())
    if total == 0.0:
        return Impacts(0.0, 0.0, float("nan"), np.zeros(bins + 1), np.full(bins, np.nan))
    counted, edges = np.histogram(speed, bins, (0.0, float(np.quantile(speed, 0.999)) or 1.0), weights=weight)
    return Impacts(
        rate=per_particle * total,
        contact_rate=per_particle * float((weight * touched).sum()),
        mean_speed=float((weight * speed).sum()) / total,
        edges=edges,
        density=counted / (total * np.diff(edges)),
    )


_COLUMNS = ("end", "second", "approach_speed", "weight", "closest_gap", "minimum_gap", "stokes")


def maxwellian_impact_speed(speed: Array, granular_temperature: float) -> Array:
    """Probability density of the normal speed of impact in a Maxwellian gas of equal spheres [s/m].

    speed                 [m/s]
    granular_temperature  T [m2/s2]

    >>> speed = np.linspace(0.0, 1.0, 10_001)
    >>> round(float(np.trapezoid(speed * maxwellian_impact_speed(speed, 1e-2), speed)), 5)     # sqrt(pi T)
    0.17725
    """
    speed = np.asarray(speed, float)
    return np.asarray(speed / (2.0 * granular_temperature) * np.exp(-(speed**2) / (4.0 * granular_temperature)))


class Spreading(NamedTuple):
    """Mean square displacement of particles, less that of their mean."""

    lag: Array  # (L,) [s]
    square: Array  # (L, 3) of the displacement along x, y, z [m2]


def spreading(
    time: Array, position: Array, box: Sequence[float | None] = (None, None, None), lags: int = 20
) -> Spreading:
    """Mean square displacement over all starts and particles, for even times.

    time      (T,) evenly spaced [s]
    position  (T, N, 3) of the same particles in the same order [m]
    box       lengths of periodic directions, None for others [m]; a particle moves by less than half between times
    lags      number of lags, from one interval on; at most T - 1
    """
    paths = np.array(position, float)
    for axis, length in enumerate(box):
        if length is not None:
            moved = np.diff(paths[..., axis], axis=0)
            moved -= length * np.rint(moved / length)
            paths[1:, :, axis] = paths[0, :, axis] + np.cumsum(moved, axis=0)
    paths -= paths.mean(axis=1, keepdims=True)
    several = range(1, min(lags, len(paths) - 1) + 1)
    square = np.array([((paths[lag:] - paths[:-lag]) ** 2).mean(axis=(0, 1)) for lag in several])
    return Spreading(np.array(several) * float(np.diff(time).mean()), square.reshape(-1, 3))


def dispersion(spreading: Spreading, after: float = 0.0) -> Array:
    r"""Coefficients of dispersion along x, y, z: half of the slope of the mean square displacement [m2/s].

    .. math:: D_i = \tfrac12\,\frac{d\langle\Delta x_i^2\rangle}{dt}

    after    lags to use begin here; take several correlation times of the velocity [s]
    returns  (3,) [m2/s]; NaN with fewer than two lags
    """
    late = spreading.lag >= after
    if late.sum() < 2:
        return np.full(3, np.nan)
    return np.asarray(0.5 * np.polyfit(spreading.lag[late], spreading.square[late], 1)[0])


# ---------------------------------------------------------------- the regime map of collisions


PER_DECADE = 6
"""Cells of the map per decade, in both directions."""


class RegimeMap(NamedTuple):
    """Collisions over Stokes number and gap ratio h_eps/h_sigma."""

    stokes: Array  # (n + 1,) edges of the cells [-]
    gap_ratio: Array  # (m + 1,) edges of the cells, h_eps/h_sigma [-]
    density: Array  # (m, n) fraction of the collisions per square decade [-]
    contact: Array  # (m, n) fraction of the collisions of a cell with solid contact; NaN in empty cells [-]
    collisions: float  # number of collisions in the map
    contact_fraction: float  # fraction of all collisions with solid contact [-]
    deformed_fraction: float  # fraction of all collisions whose film deforms the solids [-]
    median_stokes: float  # [-]


def regime_map(collisions: Mapping[str, Array], per_decade: int = PER_DECADE) -> RegimeMap:
    """The regime map of recorded collisions.

    collisions  columns of the record (n,), as :attr:`cfddem.io.reading.RunData.collisions`
    per_decade  cells per decade, in both directions
    returns     RegimeMap
    errors      InputError if no collision has a film
    """
    stokes = np.asarray(collisions.get("stokes", np.zeros(0)), float)
    kept = np.isfinite(stokes) & (stokes > 0.0)
    if not kept.any():
        raise InputError(
            "collisions", len(stokes), "some with a film", "set run.record_collisions = true in a case with films"
        )
    columns = {name: np.asarray(collisions[name])[kept] for name in _REGIME_COLUMNS}
    stokes, weight = columns["stokes"], columns["weight"]
    gap_ratio = columns["elastohydrodynamic_gap"] / columns["roughness_gap"]
    contact = columns["closest_gap"] < columns["minimum_gap"]
    edges = _edges(stokes, per_decade), _edges(gap_ratio, per_decade)
    counted, in_contact = (
        np.histogram2d(gap_ratio, stokes, bins=(edges[1], edges[0]), weights=weights)[0]
        for weights in (weight, weight * contact)
    )
    order, total = np.argsort(stokes), float(weight.sum())
    return RegimeMap(
        stokes=edges[0],
        gap_ratio=edges[1],
        density=counted / total * per_decade**2,
        contact=np.where(counted > 0.0, in_contact / np.where(counted > 0.0, counted, 1.0), np.nan),
        collisions=total,
        contact_fraction=float((weight * contact).sum()) / total,
        deformed_fraction=float((weight * (gap_ratio > 1.0)).sum()) / total,
        median_stokes=float(stokes[order][np.searchsorted(np.cumsum(weight[order]), 0.5 * total)]),
    )


_REGIME_COLUMNS = ("stokes", "weight", "elastohydrodynamic_gap", "roughness_gap", "closest_gap", "minimum_gap")


def _edges(values: Array, per_decade: int) -> Array:
    """Edges of cells that hold all values, at whole fractions of a decade."""
    low, high = np.floor(np.log10(values.min()) * per_decade), np.floor(np.log10(values.max()) * per_decade) + 1.0
    return np.asarray(10.0 ** (np.arange(low, high + 0.5) / per_decade))
