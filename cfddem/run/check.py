"""All that `cfddem check` finds out about a case: the pre-run check, its measured data, and several processes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from cfddem.backend.brick_shapes import Shape
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.preflight.checks import check_quantities
from cfddem.preflight.issue import Issue
from cfddem.preflight.overview import Row
from cfddem.preflight.summary import Preflight, preflight
from cfddem.preflight.weak_scaling import (
    CALL,
    DRY,
    WITH_FILMS,
    WRITTEN,
    Machine,
    RunCost,
    efficiency,
    memory_of_a_rank,
    seconds_of_a_snapshot,
    time_of_a_rank,
)
from cfddem.run.division import WORTHWHILE, cost_of, expected_shares, most_ranks, require_parallel

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
        from cfddem.run.history import units_of  # loads the compiler, which other checks lack

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
    return replace(result, rows=(*result.rows, *_rows(case, ranks, shape)))


def _rows(case: Case, ranks: int, shape: Shape | None) -> Iterator[Row]:
    """What several processes make of a case, by the model."""
    group, count, cost = "several processes", case.particle_count, cost_of(case)
    share = f", about {count / ranks:.3g} particles each" if count >= ranks else "; some hold no particle"
    shares = expected_shares(case, ranks, shape)
    x, y, z = shares.shape
    yield Row(group, "ranks", ranks, "", f"can share the case{share}")
    bricks = f"with ghosts; {x} x {y} x {z} bricks, {'as given' if shape else 'the least work'}"
    yield Row(group, "most / mean particles", shares.particles, "", bricks)
    if case.fluid:
        yield Row(group, "most / mean cells", shares.cells, "", "with a layer around them")
    spent = time_of_a_rank(cost, shares)
    lost, total = max((part for part in spent if part != "work"), key=spent.__getitem__), sum(spent.values())
    yield Row(group, "efficiency", efficiency(cost, shares), "", "speed-up over ranks, by the model")
    yield Row(group, "largest loss", spent[lost] / total, "", f"of the time: {lost}")
    for name, value, unit, note in _inputs(cost):
        yield Row(group, name, value, unit, note)
    memory, at_the_start = memory_of_a_rank(cost, shares)
    yield Row(group, "memory of a rank", memory / 1e9, "GB", "at most")
    yield Row(group, "memory of rank 0 at the start", at_the_start / 1e9, "GB", "it makes all particles")
    rate = f"{cost.snapshot / 1e9:.3g} GB at {WRITTEN / 1e6:.3g} MB/s, by rank 0"
    yield Row(group, "time of a snapshot", seconds_of_a_snapshot(cost), "s", rate)
    most = most_ranks(case, cost)
    yield Row(group, "recommended ranks", most, "", f"the most with {WORTHWHILE:.0%} efficiency")


def _inputs(cost: RunCost) -> Iterator[tuple[str, float, str, str]]:
    """What the model takes for machine and run: name, value, unit and note."""
    (exchanges, sums), machine = WITH_FILMS if cost.films else DRY, Machine()
    steps = f"in a particle step, {exchanges:g} of them with neighbours"
    yield "work of one process", cost.seconds, "s", f"{cost.cell_seconds / cost.seconds:.0%} of it for cells"
    yield "message", 1e6 * machine.latency, "us", f"and {machine.bandwidth / 1e9:g} GB/s for each rank"
    yield "sum over all ranks", 1e6 * machine.reduction, "us", f"times log2 p, and {1e6 * CALL:g} us of the processor"
    yield "exchanges and sums", exchanges + sums, "", steps
