"""Bubbles: connected regions of high voidage, their size and position, and their number against height."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from cfddem.backend.errors import InputError

Array = NDArray[np.float64]

BUBBLE = np.dtype([("centroid", "f8", 3), ("volume", "f8"), ("diameter", "f8")])
"""A bubble: centroid (x, y, z) [m], volume [m3], diameter of a sphere (in a flat bed, of a disc) of that size [m]."""


def find_bubbles(
    voidage: Array,
    spacing: Sequence[float],
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    threshold: float = 0.8,
    surface: float | None = None,
    smallest: int = 4,
    flat: bool = False,
    periodic: tuple[bool, bool] = (False, False),
) -> np.ndarray:
    """Find the connected regions of a bed whose voidage exceeds a threshold.

    voidage    (nz, ny, nx), 0 in cells to leave out [-]
    spacing    hx, hy, hz of a cell [m]
    origin     lowest corner of the box [m]
    threshold  voidage at the boundary of a bubble [-]
    surface    height of the bed [m]; cells above it are ignored; the whole box if None
    smallest   fewest cells of a bubble
    flat       the bed is thin in y: the diameter is that of a disc with the area of the bubble
    periodic   whether x and y are periodic; a bubble can extend across a periodic side
    returns    rows of dtype BUBBLE, lowest first

    Regions that touch the surface, or the top of the box, belong to the freeboard and are left out. Cells are connected
    through faces.
    """
    if voidage.ndim != 3 or not 0.0 < threshold < 1.0:
        raise InputError("voidage, threshold", (voidage.shape, threshold), "a field (nz, ny, nx), and between 0 and 1")
    high = voidage > threshold
    top = len(voidage) if surface is None else int(np.clip((surface - origin[2]) / spacing[2], 0, len(voidage)))
    high[top:] = False
    labels, count = label(high)
    if count == 0:
        return np.zeros(0, BUBBLE)
    labels, count = _joined_across(labels, count, periodic)
    cells = np.bincount(labels.ravel(), minlength=count + 1)
    free = np.ones(count + 1, bool)
    free[0] = False
    free[np.unique(labels[top - 1])] = False
    chosen = np.flatnonzero(free & (cells >= smallest))
    bubbles = np.zeros(len(chosen), BUBBLE)
    bubbles["volume"] = cells[chosen] * np.prod(spacing)
    bubbles["centroid"] = _centroids(labels, chosen, spacing, origin, (*periodic, False))
    if flat:
        depth = voidage.shape[1] * spacing[1]
        bubbles["diameter"] = np.sqrt(4.0 * bubbles["volume"] / (np.pi * depth))
    else:
        bubbles["diameter"] = np.cbrt(6.0 * bubbles["volume"] / np.pi)
    return bubbles[np.argsort(bubbles["centroid"][:, 2])]


def _joined_across(labels: NDArray[np.int32], count: int, periodic: tuple[bool, bool]) -> tuple[np.ndarray, int]:
    """Merge regions that are connected across a periodic side."""
    first, second = [np.zeros(0, int)], [np.zeros(0, int)]
    for axis, repeats in ((2, periodic[0]), (1, periodic[1])):
        if repeats:
            low, high = labels.take(0, axis).ravel(), labels.take(-1, axis).ravel()
            both = (low > 0) & (high > 0)
            first.append(low[both])
            second.append(high[both])
    rows, columns = np.concatenate(first), np.concatenate(second)
    if len(rows) == 0:
        return labels, count
    meet = coo_array((np.ones(len(rows)), (rows, columns)), shape=(count + 1, count + 1))
    regions, region_of = connected_components(meet, directed=False)
    return region_of[labels], regions - 1  # label 0 is connected to nothing and remains 0


def _centroids(
    labels: np.ndarray,
    chosen: np.ndarray,
    spacing: Sequence[float],
    origin: Sequence[float],
    periodic: tuple[bool, ...],
) -> Array:
    k, j, i = np.nonzero(labels)
    row = np.full(int(labels.max()) + 1, -1)
    row[chosen] = np.arange(len(chosen))
    row = row[labels[k, j, i]]
    kept = row >= 0
    weight = np.bincount(row[kept], minlength=len(chosen))
    centroid = np.empty((len(chosen), 3))
    for axis, index in enumerate((i, j, k)):
        cells = labels.shape[2 - axis]
        place = index[kept] + 0.5
        if periodic[axis]:  # about the circular mean, so that a bubble across the side is not split
            angle = 2.0 * np.pi * place / cells
            sine, cosine = (np.bincount(row[kept], part, len(chosen)) for part in (np.sin(angle), np.cos(angle)))
            middle = cells * np.arctan2(sine, cosine) / (2.0 * np.pi)
            apart = place - middle[row[kept]]
            place = middle[row[kept]] + apart - cells * np.rint(apart / cells)
        mean = np.bincount(row[kept], place, len(chosen)) / weight
        centroid[:, axis] = origin[axis] + spacing[axis] * (mean % cells if periodic[axis] else mean)
    return centroid


class BubbleProfile(NamedTuple):
    """Bubbles against height, in slabs; NaN in slabs without bubbles."""

    number: Array  # (n,) mean number at an instant [-]
    diameter: Array  # (n,) mean [m]
    error: Array  # (n,) standard error of the mean diameter, for independent bubbles [m]


def bubble_profile(snapshots: Sequence[np.ndarray], edges: Array) -> BubbleProfile:
    """Number and size of bubbles against height, averaged over instants.

    snapshots  rows of dtype BUBBLE of each instant
    edges      (n + 1,) ascending, of the slabs [m]
    returns    BubbleProfile
    """
    rows = np.concatenate([np.zeros(0, BUBBLE), *snapshots])
    height, diameter = rows["centroid"][:, 2], rows["diameter"]
    count, _ = np.histogram(height, edges)
    total, _ = np.histogram(height, edges, weights=diameter)
    squares, _ = np.histogram(height, edges, weights=diameter**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / count
        variance = np.maximum(squares / count - mean**2, 0.0) * count / (count - 1)
        error = np.sqrt(variance / count)
    return BubbleProfile(count / max(len(snapshots), 1), mean, error)
