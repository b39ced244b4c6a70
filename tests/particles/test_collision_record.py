"""The record of collisions: how close they came, which rows are kept where there are too many, and the regime map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from disturbed_runs import TINY

from cfddem.analysis.fluctuations import regime_map
from cfddem.analysis.report import report
from cfddem.analysis.report_text import lines
from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.case.schema import Case
from cfddem.particles.collision_events import COLLISION
from cfddem.particles.collision_record import CollisionRecord
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.plotting.curves import collisions
from cfddem.plotting.report_page import page
from cfddem.run.runner import Run
from closures.minimum_gap import elastohydrodynamic


def rows(count: int, seed: int = 0) -> np.ndarray:
    """Collisions with random names and times."""
    random = np.random.default_rng(seed)
    made = np.zeros(count, COLLISION)
    made["first"], made["second"] = random.integers(0, 1000, (2, count))
    made["begin"] = random.uniform(0.0, 1.0, count)
    made["stokes"], made["weight"] = random.lognormal(2.0, 1.0, count), 1.0
    return made


def fill(record: CollisionRecord, made: np.ndarray) -> None:
    """Write rows as the particle loop does."""
    record.room(len(made))[: len(made)] = made
    record.keep(len(made))


def test_too_many_rows_are_thinned_evenly_and_stand_for_all() -> None:
    made, record = rows(20_000), CollisionRecord(most=1_500)
    for part in np.array_split(made, 13):
        fill(record, part)
    kept = record.take()
    assert len(kept) <= 1_500
    assert set(kept["weight"]) == {16.0}
    assert kept["weight"].sum() == pytest.approx(20_000, rel=4.0 / np.sqrt(len(kept)))
    assert np.mean(np.log(kept["stokes"])) == pytest.approx(2.0, abs=4.0 / np.sqrt(len(kept)))
    assert len(record.table) == 0


def test_which_rows_are_kept_does_not_hang_on_when_they_came_or_on_a_restart() -> None:
    made = rows(20_000)
    whole, parts = CollisionRecord(most=1_500), CollisionRecord(most=1_500)
    fill(whole, made)
    for part in np.array_split(made, 7):
        fill(parts, part)
        again = CollisionRecord(most=1_500)
        again.put_back(parts.table)
        parts = again
    assert np.array_equal(whole.table, parts.table)


def test_few_rows_are_all_kept() -> None:
    record = CollisionRecord(most=1_500)
    fill(record, rows(1_500))
    assert np.array_equal(record.table, rows(1_500))


@pytest.mark.parametrize(("speed", "meets"), [(0.05, False), (0.5, True)])
def test_the_record_says_how_close_a_pair_came(speed: float, meets: bool) -> None:
    """Below St = ln(R*/h_min) the film stops the pair at R* exp(-St); the solids of the faster one meet."""
    material = Material(
        density=2500, youngs_modulus=60e9, contact_modulus=1e7, poisson=0.25, restitution=0.9, friction=0.0,
        roughness=1e-6,
    )  # fmt: skip
    radius, viscosity = 1e-3, 1e-2
    places = np.array([[0.0, 0.0, 0.0], [2.0 * radius + 0.51 * radius, 0.0, 0.0]])
    velocity = np.array([[0.0, 0.0, 0.0], [-speed, 0.0, 0.0]])
    pair = make_particles(places, radius, 2500.0, velocity=velocity, viscosity=viscosity)
    run = ParticleSolver(pair, pair_table([material]), laws=Laws(film=True), settings=SolverSettings(record=True))
    assert run.collisions is not None
    step = run.recommended_step(speed)
    run.advance(step, int(0.5 * radius / speed / step))
    for _ in range(200):
        run.advance(step, 500)
        if len(run.collisions.table):
            break
        if not meets and np.abs(pair.velocity[1, 0] - pair.velocity[0, 0]) < 1e-3 * speed:
            pair.velocity[1] = 2.0 * speed, 0.0, 0.0  # pull them apart, so that the collision ends
    (row,) = run.collisions.table
    strength = 6.0 * np.pi * viscosity * (0.5 * radius) ** 2
    stokes = 0.5 * 2500 * 4 / 3 * np.pi * radius**3 * speed / strength
    assert row["stokes"] == pytest.approx(stokes, rel=1e-3)
    assert (row["closest_gap"] < row["minimum_gap"]) == meets
    if not meets:
        assert row["closest_gap"] == pytest.approx(0.5 * radius * np.exp(-stokes), rel=0.02)
    assert row["roughness_gap"] == 1e-6 and row["weight"] == 1.0
    modulus = float(pair_table([material])[0, 0]["film_modulus"])
    deformed = elastohydrodynamic(viscosity, float(row["approach_speed"]), modulus, 0.5 * radius)
    assert row["elastohydrodynamic_gap"] == pytest.approx(deformed, rel=1e-12)


def test_the_map_counts_every_collision_once() -> None:
    """Four collisions at known places: densities times areas add up to one, and the solids meet where they do."""
    collisions = {
        "stokes": np.array([2.0, 2.0, 50.0, np.inf]),
        "weight": np.array([1.0, 3.0, 4.0, 1.0]),
        "elastohydrodynamic_gap": np.array([2e-9, 2e-9, 5e-6, 0.0]),
        "roughness_gap": np.full(4, 1e-6),
        "minimum_gap": np.array([1e-6, 1e-6, 5e-6, 0.0]),
        "closest_gap": np.array([2e-6, 5e-7, 4e-6, -1e-9]),
    }
    found = regime_map(collisions, per_decade=2)
    assert found.density.sum() * 0.5**2 == pytest.approx(1.0)
    assert (found.collisions, found.contact_fraction, found.deformed_fraction) == (8.0, 7.0 / 8.0, 0.5)
    assert found.median_stokes == 2.0
    assert found.contact[np.searchsorted(found.gap_ratio, 2e-3) - 1, np.searchsorted(found.stokes, 2.0) - 1] == 0.75
    assert np.nanmax(found.density) * 0.25 == pytest.approx(0.5)


def test_a_record_without_films_has_no_map() -> None:
    with pytest.raises(InputError, match=r"collisions = 1: must be some with a film"):
        regime_map({"stokes": np.array([np.inf])})


@pytest.mark.slow
def test_a_report_shows_the_map_where_collisions_were_recorded(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    Run.begin(Case.from_text(TINY.replace("until = 0.024", "until = 0.06")), folder).go()
    found = report(folder)
    met = found.collisions
    assert met["number"] >= 1.0 and met["median_stokes"] > 0.0 and 0.0 <= met["contact_fraction"] <= 1.0
    assert any("collisions with films: median St" in line for line in lines(found))
    assert "collisions in the averaging window" in page(folder, tmp_path / "page.html", found).read_text()
    assert collisions(folder, tmp_path / "map.png").stat().st_size > 10_000
