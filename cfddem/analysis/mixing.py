"""Mixing indices of particles of several species."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from cfddem.analysis.measures import Array, Cells, Mask


def lacey_index(marked: Mask, cells: Cells) -> float:
    r"""Mixing index of Lacey: how evenly marked particles are distributed over cells.

    .. math:: M = \frac{\sigma_0^2-\sigma^2}{\sigma_0^2-\sigma_r^2},\qquad \sigma_0^2 = p(1-p),\qquad
              \sigma_r^2 = p(1-p)\frac{C-1}{N-1}

    marked   (N,) true for particles of one species
    cells    from :func:`cfddem.analysis.measures.cells_of`; a cell should hold about ten particles or more
    returns  M [-]: 0 segregated, 1 randomly mixed on average; NaN with one species only, or one particle per cell

    sigma^2 is the variance of the marked fraction over the C occupied cells, weighted by their particle numbers;
    sigma_r^2 is its value in a random mixture. Lacey, J. Appl. Chem. 4 (1954) 257.
    """
    kinds = np.asarray(marked, float)[cells.inside]
    count = np.bincount(cells.cell)
    occupied, total, share = count > 0, len(kinds), float(kinds.mean()) if len(kinds) else 0.0
    segregated = share * (1.0 - share)
    if segregated == 0.0 or occupied.sum() == total:
        return float("nan")
    local = np.bincount(cells.cell, kinds)[occupied] / count[occupied]
    variance = float((count[occupied] * (local - share) ** 2).sum() / total)
    random = segregated * (int(occupied.sum()) - 1) / (total - 1)
    return (segregated - variance) / (segregated - random)


def neighbour_mixing_index(species: NDArray[np.integer], position: Array, neighbours: int = 12) -> float:
    r"""Mixing index of nearest neighbours: fraction of neighbours of another species, over that of a random mixture.

    .. math:: M = \frac{\langle\mathrm{fraction\ of\ unlike\ neighbours}\rangle}
              {1-\sum_s N_s(N_s-1)/[N(N-1)]}

    species     (N,) number of the species of each particle
    position    (N, 3) [m]
    neighbours  number of nearest neighbours of each particle
    returns     M [-]: 0 segregated, 1 randomly mixed, above 1 in an ordered mixture; NaN with one species only

    Needs no cells. Neighbours across periodic sides are not found.
    """
    kinds, total = np.asarray(species), len(species)
    counts = np.unique(kinds, return_counts=True)[1].astype(float)
    if len(counts) < 2 or total <= neighbours:
        return float("nan")
    _, near = cKDTree(position).query(position, neighbours + 1)
    unlike = kinds[near] != kinds[:, None]  # each particle is among its own neighbours, and never unlike
    random = 1.0 - float((counts * (counts - 1.0)).sum()) / (total * (total - 1.0))
    return float(unlike.sum() / (total * neighbours) / random)
