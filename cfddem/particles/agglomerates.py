"""Agglomerates: which particles liquid bridges join."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

Numbers = NDArray[np.integer]


def agglomerates(first: Numbers, second: Numbers, count: int) -> Numbers:
    """Number of the agglomerate of each particle (N,), counted from 0.

    first, second  rows of the particles that each bridge joins (n,)
    count          number of particles N

    >>> agglomerates(np.array([0, 3]), np.array([1, 1]), 5).tolist()
    [0, 0, 1, 0, 2]
    """
    joined = coo_matrix((np.ones(len(first)), (first, second)), shape=(count, count))
    return np.asarray(connected_components(joined, directed=False)[1])
