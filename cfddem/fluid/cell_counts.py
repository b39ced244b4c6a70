"""How cells divide a box. Importing this module compiles nothing."""

from __future__ import annotations

from collections.abc import Sequence

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
        if abs(count * width - length) > 1e-6 * length:
            raise InputError(
                "grid.cell",
                float(width),
                f"a whole fraction of the box, {length:g} m along {name}",
                f"{length / count:.6g} m fits {int(count)} times",
            )
    return int(counts[0]), int(counts[1]), int(counts[2])
