"""How well two kinds of particles are mixed."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from cfddem.record.measures import Array, Cells, Mask


def lacey_index(marked: Mask, cells: Cells) -> float:
    r"""Mixing index of Lacey: how evenly marked particles are shared out among cells.

    .. math:: M = \frac{\sigma_0^2-\sigma^2}{\sigma_0^2-\sigma_r^2},\qquad \sigma_0^2 = p(1-p),\qquad
              \sigma_r^2 = p(1-p)\frac{C-1}{N-1}

    marked   (N,) true for one of the two kinds
    cells    from :func:`cfddem.record.measures.cells_of`; some ten particles in a cell are wanted
    returns  M [-]: 0 apart, 1 mixed at random (on average); NaN with one kind only, or one particle a cell

    sigma^2 is the variance of the marked share over the C occupied cells, weighted by their numbers; sigma_r^2 is
    what drawing at random leaves. Lacey, J. Appl. Chem. 4 (1954) 257.
    """
    kinds = np.asarray(marked, float)[cells.inside]
    count = np.bincount(cells.cell)
    occupied, total, share = count > 0, len(kinds), float(kinds.mean()) if len(kinds) else 0.0
    apart = share * (1.0 - share)
    if apart == 0.0 or occupied.sum() == total:
        return float("nan")
    local = np.bincount(cells.cell, kinds)[occupied] / count[occupied]
    variance = float((count[occupied] * (local - share) ** 2).sum() / total)
    random = apart * (int(occupied.sum()) - 1) / (total - 1)
    return (apart - variance) / (apart - random)


def neighbour_mixing_index(marked: Mask, position: Array, neighbours: int = 12) -> float:
    r"""Mixing index of nearest neighbours: how often the neighbours of a particle are of the other kind.

    .. math:: M = \frac{\langle\mathrm{share\ of\ unlike\ neighbours}\rangle}{2 N_a N_b / [N(N-1)]}

    marked      (N,) true for one of the two kinds
    position    (N, 3) [m]
    neighbours  of each particle that are asked
    returns     M [-]: 0 apart, 1 mixed at random, above 1 where unlikes are neighbours by order; needs no cells
    """
    kinds, total = np.asarray(marked, bool), len(marked)
    one = int(kinds.sum())
    if one in (0, total) or total <= neighbours:
        return float("nan")
    _, near = cKDTree(position).query(position, neighbours + 1)
    unlike = kinds[near] != kinds[:, None]  # the particle itself is among the near, and never unlike
    return float(unlike.sum() / (total * neighbours) / (2.0 * one * (total - one) / (total * (total - 1.0))))
