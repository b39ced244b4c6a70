"""Where the liquid touches the bead: the wetted radius from the volume of liquid tracked by the particles.

The gap under the bead is full out to the radius within which there is as much liquid as open volume. All cells there
are liquid, with or without a particle in them, so that suction passes through a gap thinner than their spacing.
"""

from __future__ import annotations

import math

import numpy as np

from scenarios.collisions.film_impact.grid import Grid

MISSING = 0.5
"""The outermost wetted column may lack this share of its volume, summed from the axis [-]."""


def wetted_columns(grid: Grid, column: np.ndarray, radius: float, missing: float = MISSING) -> int:
    """Number of columns from the axis whose gap is full.

    column   volume of the liquid in each column [m3]
    radius   of the bead [m]
    missing  share of its volume that the outermost wetted column may lack
    """
    below = min(int(radius / grid.dx), grid.radial)
    room = (grid.ring * grid.dx)[:below] * grid.open_cell[:below].sum(axis=1)
    lacking = np.cumsum(room - column[:below])
    full = np.flatnonzero(lacking <= missing * room)
    return int(full[-1]) + 1 if len(full) else 0


def guessed_columns(grid: Grid, share: float, radius: float, gap: float, film: float) -> int:
    """The same from a guess instead: a share of the radius of an undisturbed layer of twice its depth, for comparison.

    .. math:: r_w = s \\sqrt{2 R (2 d - z_0 - d)} = s \\sqrt{D (d - z_0)}
    """
    return int(share * math.sqrt(max(2.0 * radius * (film - gap), 0.0)) / grid.dx)
