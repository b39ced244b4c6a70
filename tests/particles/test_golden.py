"""Golden runs: final states agree with stored arrays to 1e-9."""

from __future__ import annotations

import numpy as np
import pytest
from golden.every_run import RUNS
from golden.registry import FOLDER

WITHIN = 1e-9
"""Largest difference, over the largest value of the array."""


LONG = {
    "bridges_static", "bridges_deforming", "bridges_pendular", "liquid_bed_counted", "collision_record_film",
    "periodic_fluid", "energies_dry_rolling", "own_minimum_gap_and_film", "mesh_film", "rolling_constant_torque",
    "collision_film_verlet", "collision_film_overlap_onset", "linear_contact_film", "linear_contact", "mesh_from_file",
    "rolling_spring_dashpot", "collision_wall_film_verlet", "collision_head_on_film", "cohesion", "rolling_on_a_floor",
    "settling_sphere", "collision_thick_film", "mesh_that_moves", "packed_bed", "periodic_box_film_verlet",
    "collision_rescaled_spring",
}  # fmt: skip
"""Runs with laws of their own, which take long to compile."""


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in RUNS])
def test_run_ends_as_it_did(name: str) -> None:
    """Every array agrees within 1e-9 of its largest value; integers exactly."""
    state = RUNS[name]()
    with np.load(FOLDER / f"{name}.npz") as stored:
        assert sorted(state) == sorted(stored.files)
        wrong = [said for array in sorted(state) if (said := _difference(array, state[array], stored[array]))]
    assert not wrong, "\n".join(wrong)


def test_every_stored_state_has_its_run() -> None:
    """Each stored file belongs to a run."""
    assert {path.stem for path in FOLDER.glob("*.npz")} == set(RUNS)


def _difference(name: str, now: np.ndarray, then: np.ndarray) -> str:
    """The difference in one line; empty if there is none."""
    if now.shape != then.shape or now.dtype.kind != then.dtype.kind:
        return f"{name}: {now.dtype}{now.shape}, was {then.dtype}{then.shape}"
    if now.dtype.kind != "f":
        return "" if np.array_equal(now, then) else f"{name}: {int((now != then).sum())} values are others"
    finite = np.isfinite(then)
    if not np.array_equal(now[~finite], then[~finite], equal_nan=True) or not np.isfinite(now[finite]).all():
        return f"{name}: other values are infinite or no numbers"
    scale = float(np.abs(then[finite]).max(initial=0.0))
    off = float(np.abs(now[finite] - then[finite]).max(initial=0.0))
    return "" if off <= WITHIN * scale else f"{name}: off by {off:.3g} where the largest is {scale:.3g}"
