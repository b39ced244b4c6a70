"""The number of threads of a run for which the user gives none."""

from __future__ import annotations

import math

from cfddem.case.column_grid import grid_of
from cfddem.case.feeds import fed_count
from cfddem.case.schema import Case

FEW_PARTICLES, FEW_CELLS = 5_000, 20_000
"""Up to so many particles and cells, a second thread gains nothing; 1 600 beads take 1.3 times as long on two."""


def threads_for(case: Case) -> int | None:
    """One for a small case, whose loops compile faster for it; None, which stands for all processors, for others."""
    cells = 0 if case.fluid is None else math.prod(grid_of(case).cells)
    is_small = case.particle_count + fed_count(case) <= FEW_PARTICLES and cells <= FEW_CELLS
    return 1 if is_small else None
