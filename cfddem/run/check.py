"""All that `cfddem check` finds out about a case: the pre-run check, its measured data, and several processes."""

from __future__ import annotations

from dataclasses import replace

from cfddem.backend.brick_shapes import Shape
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.preflight.checks import check_quantities
from cfddem.preflight.issue import Issue
from cfddem.preflight.overview import Row
from cfddem.preflight.summary import Preflight, preflight
from cfddem.preflight.weak_scaling import efficiency
from cfddem.run.division import WORTHWHILE, cost_of, expected_division, most_ranks, require_parallel
from cfddem.run.history import units_of

MOST_RANKS = 100_000
"""Largest number of processes that is checked."""


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
        result = result.with_errors(check_quantities(case, units_of(case)))
    return result if ranks is None or not result.rows else _with_ranks(result, case, ranks, shape)


def _with_ranks(result: Preflight, case: Case, ranks: int, shape: Shape | None) -> Preflight:
    """The result of a check, and whether several processes can share the case."""
    if not 1 <= ranks <= MOST_RANKS:
        raise InputError("ranks", ranks, f"1 to {MOST_RANKS}")
    try:
        require_parallel(case, ranks, shape)
    except InputError as failure:
        return result.with_errors(
            [Issue("error", failure.field, f"{failure.value} must be {failure.limit}", failure.remedy)]
        )
    count = case.particle_count
    share = f", about {count / ranks:.3g} particles each" if count >= ranks else "; some hold no particle"
    (x, y, z), work = expected_division(case, ranks, shape)
    chosen = "as given" if shape else "the least of all shapes"
    cost = cost_of(case)
    most = most_ranks(case, cost)
    rows = (
        Row("several processes", "ranks", ranks, "", f"can share the case{share}"),
        Row("several processes", "most / mean work", work, "", f"{x} x {y} x {z} bricks, {chosen}"),
        Row(
            "several processes",
            "efficiency",
            efficiency(cost, (x, y, z), work),
            "",
            "speed-up over ranks, by the model",
        ),
        Row("several processes", "recommended ranks", most, "", f"the most with {WORTHWHILE:.0%} efficiency"),
    )
    return replace(result, rows=(*result.rows, *rows))
