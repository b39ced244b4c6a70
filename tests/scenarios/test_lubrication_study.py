"""The lubrication study: its beds, the count of collisions with and without films, and its table."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cfddem.analysis.bed_laws import expansion_laws
from cfddem.preflight.summary import preflight
from scenarios.beds.lubrication_study.study import SEEDS, SETTINGS, VOIDAGE, Outcome, bed, folder_of, mean, meetings
from scenarios.beds.lubrication_study.validation import measures, profiles, rows


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda setting: setting.name)
def test_every_bed_has_the_same_expected_voidage(setting) -> None:
    case = bed(setting, 3)
    assert expansion_laws(case)["Richardson-Zaki"] == pytest.approx(VOIDAGE, rel=1e-9)
    assert case.bed.seed == 3 and case.solid.contact_modulus == setting.modulus
    assert preflight(case).status != "error"


def test_no_two_runs_share_a_folder() -> None:
    folders = {folder_of(Path(), setting, seed) for setting in SETTINGS for seed in SEEDS}
    assert len(folders) == len(SETTINGS) * len(SEEDS)


def collisions(stokes: float, **columns: list[float]) -> dict[str, np.ndarray]:
    """Rows of a record in which all solids meet."""
    count = len(columns["begin"])
    usual = {
        "stokes": np.full(count, stokes), "weight": np.ones(count), "closest_gap": np.full(count, -1e-9),
        "minimum_gap": np.zeros(count), "restitution": np.ones(count), "approach_speed": np.full(count, 0.01),
    }  # fmt: skip
    return usual | {name: np.array(values) for name, values in columns.items()}


def test_touches_of_a_pair_that_never_separated_are_one_collision() -> None:
    """At 0.01 m/s a pair comes back from a reach of 0.5 mm after 0.1 s."""
    touches = collisions(
        math.inf, first=[1, 2, 1, 1, 5], second=[2, 1, 3, 2, -1], begin=[0.0, 0.05, 0.06, 0.5, 0.7],
        end=[0.01, 0.06, 0.07, 0.51, 0.71],
    )  # fmt: skip
    assert meetings(touches, 5e-4) == 3.0
    assert meetings(touches, 5e-5) == 4.0


def test_with_films_collisions_are_those_in_which_solids_touch() -> None:
    rows = collisions(3.0, first=[1, 1, 4], second=[2, 2, 5], begin=[0.0, 0.1, 0.2], end=[0.05, 0.15, 0.3])
    rows["closest_gap"], rows["minimum_gap"] = np.array([1e-7, 1e-5, 0.0]), np.full(3, 1e-6)
    rows["weight"] = np.array([2.0, 2.0, 2.0])
    assert meetings(rows, 5e-4) == 4.0


def made_up(height: float) -> Outcome:
    return Outcome(height, 1e-5, 1.0, 6.0, 10.0, 0.5, np.array([0.6, 0.7, 1.0]), np.array([0.002, 0.006, 0.01]))


def test_the_table_gives_errors_over_seeds_and_judges_the_stiffness_of_contacts(tmp_path: Path) -> None:
    found = {setting: [made_up(0.02 if setting.modulus < 2e5 else 0.0204), made_up(0.02)] for setting in SETTINGS}
    assert mean(found[SETTINGS[1]], "bed_height")[:2] == pytest.approx((0.0202, 0.0002))
    assert math.isnan(mean(found[SETTINGS[1]][:1], "bed_height").error)
    table = rows(found)
    judged = [row for row in table if row.limit is not None]
    assert len(judged) == 8 and all(row.verdict == "holds" for row in judged)
    assert [row.value for row in judged] == pytest.approx([1.01] * 8)
    for name, draw in (("measures.png", measures), ("profiles.png", profiles)):
        draw(found, tmp_path / name)
        assert (tmp_path / name).stat().st_size > 10_000
