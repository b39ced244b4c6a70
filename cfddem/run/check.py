"""All that `cfddem check` finds out about a case: the pre-run check, its measured data, and several processes."""

from __future__ import annotations

from cfddem.backend.brick_shapes import Shape
from cfddem.case.schema import Case
from cfddem.preflight.checks import check_quantities
from cfddem.preflight.summary import Preflight, preflight


def check(case: Case, ranks: int | None = None, shape: Shape | None = None) -> Preflight:
    """Check a case before it runs. Nothing is run or written.

    ranks    number of processes that are to share the run
    shape    of them along x, y, z; that with the least work if None
    returns  `status` ("ok", "warning" or "error"), `issues` (severity, key, reason, remedy) and `rows` (name, value,
             unit, note); `print` shows all as `cfddem check` does

    >>> from cfddem import gallery
    >>> case = gallery()["liquid-bed"]
    >>> check(case).status, check(case.with_(**{"bed.inlet_velocity": 0.7})).status
    ('ok', 'error')
    """
    result = preflight(case)
    if case.compare:
        from cfddem.run.history import units_of  # loads the compiler, which other checks lack

        result = result.with_errors(check_quantities(case, units_of(case)))
    if ranks is None or not result.rows:
        return result
    from cfddem.run.division import with_ranks  # likewise

    return with_ranks(result, case, ranks, shape)
