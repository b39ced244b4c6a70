"""The number of threads of a run."""

from __future__ import annotations

import math

from cfddem.case.column_grid import grid_of
from cfddem.case.feeds import fed_count
from cfddem.case.schema import Case

FEW_PARTICLES, FEW_CELLS = 5_000, 20_000
"""Up to so many particles and cells, a second thread gains nothing; 1 600 beads take 1.3 times as long on two."""


def threads_for(case: Case, given: int | None) -> int | None:
    """The number that the user has given; without it 1 for a small case, else None, which stands for all processors.

    The loops of a small case also compile faster for one thread.
    """
    if given is not None:
        return given
    cells = 0 if case.fluid is None else math.prod(grid_of(case).cells)
    is_small = case.particle_count + fed_count(case) <= FEW_PARTICLES and cells <= FEW_CELLS
    return 1 if is_small else None
