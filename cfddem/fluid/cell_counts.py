"""How cells divide a box. Importing this module compiles nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from cfddem.backend.errors import InputError


def cell_counts(size: Sequence[float], cell: float | Sequence[float]) -> tuple[int, int, int]:
    """Number of cells along x, y, z that fill a box exactly.

    size    edge lengths of the box along x, y, z [m]
    cell    edge of a cube, or three edges [m]; must divide the box to within 1e-6
    errors  InputError where the cells do not fit the box
    """
    lengths = np.asarray(size, dtype=float)
    widths = np.broadcast_to(np.asarray(cell, dtype=float), (3,))
    if lengths.shape != (3,) or not (np.isfinite(lengths).all() and (lengths > 0).all()):
        raise InputError("grid.size", tuple(lengths), "three positive lengths in m")
    if not (np.isfinite(widths).all() and (widths > 0).all()):
        raise InputError("grid.cell", tuple(widths), "positive, in m")
    counts = np.maximum(np.rint(lengths / widths), 1.0)
    for name, length, width, count in zip("xyz", lengths, widths, counts):
        if abs(count * width - length) > FIT * length:
            limit = f"a whole fraction of the box, {length:g} m along {name}"
            raise InputError("grid.cell", float(width), limit, suggested_cells(lengths.tolist(), widths.tolist()))
    return int(counts[0]), int(counts[1]), int(counts[2])


FIT = 1e-6
"""Largest difference between the length of a box and that of its cells, over the length [-]."""

FARTHEST, FINEST = 2.0, 1000
"""Ratio of a cube to single edges beyond which the edges are suggested; most cells along an edge that are tried."""


def suggested_cells(
    lengths: Sequence[float], widths: Sequence[float], suits: Callable[[float], bool] = lambda _: True
) -> str:
    """The cell nearest to a given one that fits a box along x, y and z, in words; three edges where no cube is near.

    lengths, widths  edges of the box and of the cell (3,) [m]
    suits            whether an edge may be suggested

    >>> suggested_cells((0.2, 0.12, 0.2), (0.0075, 0.0075, 0.0075))
    '0.008 m fits along x, y and z'
    >>> suggested_cells((0.2, 0.1234567, 0.2), (0.0075, 0.0075, 0.0075))
    '[0.00740741, 0.00771604, 0.00740741] m fits'
    """
    edges = [_nearest_edge(length, width, suits) for length, width in zip(lengths, widths)]
    wanted, shortest = min(map(float, edges)), min(lengths)
    if max(widths) <= min(widths) * (1.0 + FIT):
        counts = range(1, math.ceil(min(FARTHEST * shortest / wanted, FINEST)) + 1)
        cubes = [edge for edge in (shortest / count for count in counts) if _fits(edge, lengths) and suits(edge)]
        nearest = min(cubes, key=lambda edge: abs(math.log(edge / wanted)), default=0.0)
        if wanted / FARTHEST <= nearest <= wanted * FARTHEST:
            return f"{_short(nearest, lengths)} m fits along x, y and z"
    return f"[{', '.join(edges)}] m fits"


def _nearest_edge(length: float, width: float, suits: Callable[[float], bool]) -> str:
    """The edge of a cell nearest to a given one, or the next larger one that suits, which fits a length."""
    most = max(round(min(length / width, FINEST)), 1)
    count = next((count for count in range(most, 0, -1) if suits(length / count)), most)
    return _short(length / count, (length,))


def _fits(width: float, lengths: Sequence[float]) -> bool:
    return all(
        abs(round(length / width) * width - length) <= FIT * length and length >= 0.5 * width for length in lengths
    )


def _short(width: float, lengths: Sequence[float]) -> str:
    """A width with as few digits as fit the lengths."""
    texts = (f"{width:.{digits}g}" for digits in range(2, 17))
    return next((text for text in texts if _fits(float(text), lengths)), repr(width))
