"""The regime map of a bed: how hard its encounters are, and on what their surfaces meet.

Along one axis the Stokes number says how much of the approach the film takes; along the other the gap h_eps at which
the film's pressure deforms the solids stands over the roughness h_sigma. Where it is above 1 it is h_min over
h_sigma, and pressure keeps the solids apart; below 1 asperities set h_min.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.errors import InputError

Array = NDArray[np.float64]

PER_DECADE = 6
"""Cells of the map in a decade of either number."""


class RegimeMap(NamedTuple):
    """Encounters over Stokes number and h_eps/h_sigma."""

    stokes: Array  # (n + 1,) borders of the cells [-]
    thickness: Array  # (m + 1,) borders of the cells, h_eps/h_sigma [-]
    density: Array  # (m, n) share of the encounters over the cell's decades in both directions [-]
    met: Array  # (m, n) share of a cell's encounters in which the solids met; NaN where there are none [-]
    encounters: float  # that the map counts
    solids_meet: float  # share of them in which the solids met [-]
    deformed: float  # share of them with a film that deforms the solids [-]
    median_stokes: float  # [-]


def regime_map(encounters: Mapping[str, Array], per_decade: int = PER_DECADE) -> RegimeMap:
    """The map of a record of encounters.

    encounters  columns of the record (n,), as :attr:`cfddem.record.reading.Run.collisions`
    per_decade  cells in a decade of either number
    returns     RegimeMap
    errors      InputError where no encounter in it was an approach on a film
    """
    stokes = np.asarray(encounters.get("stokes", np.zeros(0)), float)
    kept = np.isfinite(stokes) & (stokes > 0.0)
    if not kept.any():
        raise InputError(
            "encounters", len(stokes), "some that approach on a film", "run.collisions = true in a case with films"
        )
    columns = {name: np.asarray(encounters[name])[kept] for name in _COLUMNS}
    stokes, weight = columns["stokes"], columns["weight"]
    thickness = columns["elastohydrodynamic_gap"] / columns["roughness_gap"]
    solids_meet = columns["closest_gap"] < columns["minimum_gap"]
    borders = _borders(stokes, per_decade), _borders(thickness, per_decade)
    counted, met = (
        np.histogram2d(thickness, stokes, bins=(borders[1], borders[0]), weights=each)[0]
        for each in (weight, weight * solids_meet)
    )
    order, total = np.argsort(stokes), float(weight.sum())
    return RegimeMap(
        stokes=borders[0],
        thickness=borders[1],
        density=counted / total * per_decade**2,
        met=np.where(counted > 0.0, met / np.where(counted > 0.0, counted, 1.0), np.nan),
        encounters=total,
        solids_meet=float((weight * solids_meet).sum()) / total,
        deformed=float((weight * (thickness > 1.0)).sum()) / total,
        median_stokes=float(stokes[order][np.searchsorted(np.cumsum(weight[order]), 0.5 * total)]),
    )


_COLUMNS = ("stokes", "weight", "elastohydrodynamic_gap", "roughness_gap", "closest_gap", "minimum_gap")


def _borders(values: Array, per_decade: int) -> Array:
    """Borders of cells that hold all values, at whole parts of a decade."""
    low, high = np.floor(np.log10(values.min()) * per_decade), np.floor(np.log10(values.max()) * per_decade) + 1.0
    return np.asarray(10.0 ** (np.arange(low, high + 0.5) / per_decade))
