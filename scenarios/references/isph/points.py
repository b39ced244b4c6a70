"""Places of liquid particles in a quarter of the film, and their images in the mirror planes."""

from __future__ import annotations

import numpy as np


def lattice(counts: tuple[int, int, int], dx: float) -> np.ndarray:
    """Points at the centres of a block of cells, corner at the origin (n, 3) [m]."""
    x, y, z = ((np.arange(count) + 0.5) * dx for count in counts)
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)


def images(points: np.ndarray, size: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Images in the mirror planes at 0 and at the size along each axis, and at their edges.

    points   (n, 3) [m]
    size     of the box; infinite along an axis without mirrors (3,) [m]
    reach    distance from a plane up to which a point has an image [m]
    returns  all places, those of the points first (m, 3) [m]; the point of each (m,); signs of its velocity (m, 3)
    """
    places, origin, signs = points, np.arange(len(points)), np.ones_like(points)
    for axis in np.flatnonzero(np.isfinite(size)):
        near = (places[:, axis] < reach, places[:, axis] > size[axis] - reach)
        copies = []
        for close, plane in zip(near, (0.0, size[axis])):
            copy, turned = places[close].copy(), signs[close].copy()
            copy[:, axis] = 2.0 * plane - copy[:, axis]
            turned[:, axis] *= -1.0
            copies.append((copy, origin[close], turned))
        places = np.concatenate([places, *(each[0] for each in copies)])
        origin = np.concatenate([origin, *(each[1] for each in copies)])
        signs = np.concatenate([signs, *(each[2] for each in copies)])
    return places, origin, signs


def reflected(points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """The points, those that have crossed a mirror plane back inside (n, 3) [m]."""
    inside = np.abs(points)
    return np.where(inside > size, 2.0 * np.where(np.isfinite(size), size, 0.0) - inside, inside)
