"""The small gas bed in other steps and cells: its blocks, its table, and what is prescribed of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cfddem.fluid.cell_counts import cell_counts
from cfddem.preflight.bed_estimate import estimate_bed
from cfddem.preflight.step_estimate import estimate_steps
from scenarios.validation.gas_bed_steps import SLUG, VARIANTS, Means, Value, bed, blocked, study, table


def test_the_names_of_the_runs_are_their_steps_and_cells() -> None:
    for variant in VARIANTS:
        case = bed().with_(**variant.changes)
        step, cell = (float(part.split()[0]) for part in variant.name.split(", ")[:2])
        assert estimate_steps(case, estimate_bed(case)).fluid == pytest.approx(1e-3 * step)
        across = case.column.width / cell_counts(case.column.size, case.column.cell)[0]
        assert across == pytest.approx(cell * case.bed.diameter, rel=3e-3)
        assert case.surface == "sharp"


def test_an_error_is_that_of_whole_slugs() -> None:
    """A wave of one slug has a mean without error; the last block, which is not whole, counts for the mean alone."""
    time = np.arange(0.0, 9.5 * SLUG, SLUG / 100.0)
    blocks = (time / SLUG + 1e-9).astype(int)
    wave = blocked(np.sin(2.0 * math.pi * time / SLUG), blocks)
    assert wave.error == pytest.approx(0.0, abs=1e-12) and wave.mean > 0.01
    assert blocked(blocks.astype(float), blocks).error == pytest.approx(np.std(range(9), ddof=1) / 3.0)


def test_every_mean_stands_beside_that_of_the_bed_as_it_is_over_the_same_time() -> None:
    first, second = (Means(*(Value(share * size, 0.1) for size in (0.02, 0.9, 0.3, 1.0))) for share in (1.0, 1.1))
    rows = table({VARIANTS[0]: (first, first), VARIANTS[2]: (second, first)})
    assert [row.reference for row in rows] == [None] * 4 + [0.02, 0.9, 0.3, 1.0]
    assert rows[4].quantity == "0.5 ms, 1.71 d, 2.2 s: mean height" and rows[4].value == pytest.approx(0.022)
    assert table({VARIANTS[2]: (second, None)})[0].reference is None


def test_no_run_begins_after_the_hours(tmp_path: Path) -> None:
    assert study(tmp_path, lambda doing: None, hours=-1.0) == [] and not list(tmp_path.iterdir())
