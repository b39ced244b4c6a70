"""Agglomerates: which particles liquid bridges join, and how large they are.

Every function takes the numbers of the joined particles; a bridge to a wall joins no agglomerate.
"""

from __future__ import annotations

from typing import NamedTuple

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


# ---------------------------------------------------------------- sizes of agglomerates


class AgglomerateSizes(NamedTuple):
    """Sizes of all agglomerates, as numbers of particles; a particle without a bridge is one of size 1."""

    mean_by_particle: float  # size of the agglomerate that a particle belongs to, mean over particles
    largest: int
    joined: float  # share of the particles that have a bridge to another


def size_distribution(belongs: Numbers) -> tuple[Numbers, Numbers]:
    """The sizes that occur, and how many agglomerates have each (k,), (k,).

    belongs  of :func:`~cfddem.particles.agglomerates.agglomerates`, or the field `agglomerate` of a snapshot, whose
             numbers have gaps

    >>> [each.tolist() for each in size_distribution(np.array([0, 0, 7, 0, 9]))]
    [[1, 3], [2, 1]]
    """
    _, members = np.unique(belongs, return_counts=True)
    return np.unique(members, return_counts=True)


def summary(first: Numbers, second: Numbers, count: int) -> AgglomerateSizes:
    """Sizes of the agglomerates of a state.

    >>> summary(np.array([0, 3]), np.array([1, 1]), 5)
    AgglomerateSizes(mean_by_particle=2.2, largest=3, joined=0.6)
    """
    if count == 0:
        return AgglomerateSizes(float("nan"), 0, float("nan"))
    members = np.bincount(agglomerates(first, second, count)).astype(float)  # local: numbers of all ranks
    alone = float(np.count_nonzero(members == 1.0))  # local: likewise
    return AgglomerateSizes(
        mean_by_particle=float((members * members).sum()) / count,  # local: likewise
        largest=int(members.max()),  # local: likewise
        joined=1.0 - alone / count,
    )


def carried_liquid(
    liquid: NDArray[np.float64], first: Numbers, second: Numbers, volume: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Liquid of each particle: its film, and half of each bridge to another particle (N,) [m3].

    liquid         in the film of each particle (N,) [m3]
    first, second  rows of the particles that each bridge joins (n,)
    volume         of the liquid in each bridge (n,) [m3]
    """
    carried = liquid.astype(float)
    np.add.at(carried, first, 0.5 * volume)
    np.add.at(carried, second, 0.5 * volume)
    return carried
