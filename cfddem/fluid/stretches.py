"""Where fields have fluid: loops over faces work on stretches of the planes, and leave out what lies beyond walls."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation

from cfddem.fluid.grid import HIGH, LOW, Array

WORTH = 40
"""So many places without fluid take as long as another stretch."""


class Stretches(NamedTuple):
    """Parts of the planes of padded fields that are laid out flat. A plane of a box has one: a long loop is faster than
    short ones over its rows, and what it writes between them is not used."""

    first: Any  # (planes + 1,) number of the first stretch of each plane
    at: Any  # (m,) where each begins
    count: Any  # (m,) places in it

    @classmethod
    def over(cls, wanted: Any) -> Stretches:
        """The stretches that have all wanted places of a padded field (nz, ny, nx)."""
        at, size = np.flatnonzero(wanted), wanted[0].size
        apart, planes = np.diff(at, prepend=0), np.diff(at // size, prepend=-1)
        begins = np.flatnonzero((apart > WORTH) | (planes > 0))
        ends = np.append(begins, at.size)[1:] - 1
        first = np.searchsorted(at[begins], np.arange(len(wanted) + 1) * size)
        return cls(first, at[begins], at[ends] + 1 - at[begins])


class FluidStretches(NamedTuple):
    """The stretches of the faces of a fluid."""

    solved: Stretches  # with an unknown velocity
    whole: Stretches  # of these, those whose convection and stress are not of walls
    around: Stretches  # solved ones and all beside them

    @classmethod
    def of(cls, solved: Array, near_walls: Any) -> FluidStretches:
        """Those of a fluid.

        solved      1 where a face has an unknown velocity, padded (3, nz, ny, nx)
        near_walls  true where walls give convection and stress, padded (3, nz, ny, nx)
        """
        own, n = np.zeros(solved.shape, bool), HIGH - 1
        own[:, LOW:-n, LOW:-n, LOW:-n] = solved[:, LOW:-n, LOW:-n, LOW:-n] > 0.0  # others are ghosts
        faces, whole = own.any(axis=0), (own & ~near_walls).any(axis=0)  # local: three components
        beside = binary_dilation(faces, np.ones((3, 3, 3), bool))
        return cls(*(Stretches.over(wanted) for wanted in (faces, whole, beside)))
