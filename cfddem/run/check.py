"""All that `cfddem check` finds out about a case: the pre-run check, its measured data, and several processes."""

from __future__ import annotations

from collections.abc import Iterator

from cfddem.backend.communicator import Shape
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case, require_case
from cfddem.preflight.checks import check_quantities
from cfddem.preflight.issue import Issue
from cfddem.preflight.summary import Preflight, preflight

MOST_PLACES = 200_000
"""Particles above which the check makes no lattice."""


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
    require_case(case)
    result = preflight(case)
    if case.compare:
        from cfddem.run.history import units_of  # loads the compiler, which checks of plain columns lack

        result = result.with_errors(check_quantities(case, units_of(case)))
    if result.status != "error":
        result = result.with_errors(_check_lattice(case))
    if ranks is None or not result.rows:
        return result
    from cfddem.run.division import with_ranks  # likewise

    return with_ranks(result, case, ranks, shape)


def _check_lattice(case: Case) -> Iterator[Issue]:
    """Check that the lattice of a suspended start has room beside a round wall; a box is checked without it."""
    round_wall = (case.line or case.vessel) and not case.wall
    if case.bed.start != "suspended" or case.bed.species or not round_wall or case.particle_count > MOST_PLACES:
        return
    from cfddem.run.initial_particles import suspended_places  # likewise

    try:
        suspended_places(case)
    except InputError as failure:
        yield Issue("error", failure.field, f"{failure.value} must be {failure.limit}", failure.remedy)
