"""The regime map of collisions: Stokes number against the ratio of elastohydrodynamic gap to roughness.

The Stokes number compares the inertia of a pair with the resistance of its film. The gap ratio h_eps/h_sigma decides
the minimum gap: above 1 the film pressure deforms the solids and keeps them apart, below 1 asperities set the gap.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError

Array = NDArray[np.float64]

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
    columns = {name: np.asarray(collisions[name])[kept] for name in _COLUMNS}
    stokes, weight = columns["stokes"], columns["weight"]
    gap_ratio = columns["elastohydrodynamic_gap"] / columns["roughness_gap"]
    contact = columns["closest_gap"] < columns["minimum_gap"]
    edges = _edges(stokes, per_decade), _edges(gap_ratio, per_decade)
    counted, in_contact = (
        np.histogram2d(gap_ratio, stokes, bins=(edges[1], edges[0]), weights=each)[0]
        for each in (weight, weight * contact)
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


_COLUMNS = ("stokes", "weight", "elastohydrodynamic_gap", "roughness_gap", "closest_gap", "minimum_gap")


def _edges(values: Array, per_decade: int) -> Array:
    """Edges of cells that hold all values, at whole fractions of a decade."""
    low, high = np.floor(np.log10(values.min()) * per_decade), np.floor(np.log10(values.max()) * per_decade) + 1.0
    return np.asarray(10.0 ** (np.arange(low, high + 0.5) / per_decade))
