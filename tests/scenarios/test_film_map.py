"""The map of films: its beds have the numbers of the design, and its page says what its data say."""

from __future__ import annotations

import doctest
import math
import sys
from pathlib import Path

import pytest
from command_line import HOME

from cfddem.analysis.bed_laws import expansion_laws
from cfddem.preflight.summary import preflight
from closures.agitation import free_spheres
from closures.registry import law_of
from scenarios.validation.film_map import study
from scenarios.validation.film_map.design import DRY, ROUGHNESS, Point, Run, bed, is_corner, plan, points, stokes_of
from scenarios.validation.film_map.effects import Beds, Estimate, change, compared, mean, read_beds, write_beds
from scenarios.validation.film_map.study import draw

sys.path.insert(0, str(HOME / "docs" / "tools"))
import film_map as page


@pytest.mark.parametrize(
    "point",
    [pytest.param(point, id=point.name, marks=[pytest.mark.slow] * (n % 4 > 0)) for n, point in enumerate(points())],
)
def test_beds_have_the_numbers_of_the_design(point: Point) -> None:
    """Reynolds number and solid fraction by Richardson and Zaki, density ratio; all within the range of agitation."""
    for name, (lowest, highest) in law_of(free_spheres).ranges.items():
        assert lowest < getattr(point, name) <= highest
    for film in (DRY, *ROUGHNESS):
        case = bed(point, film, 2)
        velocity = case.bed.inlet_velocity
        assert isinstance(velocity, float) and isinstance(case.required_fluid.viscosity, float)
        reynolds = case.required_fluid.density * velocity * case.bed.diameter / case.required_fluid.viscosity
        assert reynolds == pytest.approx(point.reynolds, rel=1e-6)
        assert stokes_of(case, velocity) == pytest.approx(point.stokes, rel=1e-6)
        assert expansion_laws(case)["Richardson-Zaki"] == pytest.approx(1.0 - point.solid_fraction, rel=1e-6)
        assert case.solid.density / case.required_fluid.density == pytest.approx(point.density_ratio)
        assert case.has_films == (film != DRY) and case.bed.seed == 2
        assert (case.agitation != "none") == point.agitated
        said = preflight(case)
        assert said.status != "error"
        assert {each.key for each in said.issues if each.severity == "warning"} == set(
            () if point.agitated else ("laws.agitation",)
        ), "of waves, without agitation"


def test_beds_with_and_without_films_differ_in_the_film_alone() -> None:
    point = Point(60.0, 0.42, 2.5)
    dry, rough = (bed(point, film, 1) for film in (DRY, "rough"))
    changed = {"title": dry.title, "laws.lubrication": "none", "material.sphere.roughness": ROUGHNESS["smooth"]}
    assert rough.with_(**changed) == dry


def test_the_coarse_design_is_complete_first_with_two_seeds() -> None:
    asked = list(plan())
    assert len(asked) == len(set(asked)) == len({run.name for run in asked})
    corners = {point for point in points() if is_corner(point)}
    assert len(corners) == 8
    assert sorted({run.point.stokes for run in asked[: 4 * 3 * 2]}) == pytest.approx([10.0, 560.0 / 3.0])
    first = set(asked[: 8 * 3 * 2])
    assert first == {
        Run(point, film, seed) for point in corners for film in (DRY, "smooth", "rough") for seed in (1, 2)
    }
    assert all(run._replace(film=DRY) in asked for run in asked)
    assert {run.point for run in asked} == set(points())


def made_up() -> Beds:
    """Means of two points from two seeds, one film of which has one seed alone."""
    beds: Beds = {}
    for point in (Point(30.0, 0.25, 1.5), Point(120.0, 0.42, 7.0)):
        for seed in (1, 2):
            for number, film in enumerate((DRY, "smooth", "rough")):
                if (film, seed) != ("rough", 2):
                    means = {"bed_height": 0.02 + 0.0001 * number * seed, "collisions": 8.0 - 2.0 * number}
                    means |= {
                        "granular_temperature": 1e-5,
                        "dissipation": 1e-9 * (1.0 + number),
                    }
                    films = {"stokes": 2.0 * seed, "solids_meet": 0.4, "gap_ratio": 0.1, "dissipated": 0.001}
                    beds[Run(point, film, seed)] = means | (films if film != DRY else {})
    return beds


def test_changes_are_taken_seed_by_seed() -> None:
    """Heights of 20.1 and 20.2 mm beside 20 mm: 0.5 and 1 %; a film with one seed has no error."""
    beds, (point, other) = made_up(), (Point(30.0, 0.25, 1.5), Point(120.0, 0.42, 7.0))
    found = change(beds, point, "smooth", "bed_height")
    assert found == pytest.approx(Estimate(0.0075, 0.0025, 2))
    assert change(beds, point, "smooth", "collisions") == Estimate(-0.25, 0.0, 2)
    rough = change(beds, point, "rough", "bed_height")
    assert rough is not None and rough.seeds == 1 and math.isnan(rough.error)
    assert mean(beds, point, "smooth", "stokes") == Estimate(3.0, 1.0, 2)
    assert change(beds, point, "soft", "bed_height") is None and mean(beds, point, DRY, "stokes") is None
    assert compared(beds) == [(point, "smooth"), (point, "rough"), (other, "smooth"), (other, "rough")]


def test_the_file_of_the_beds_can_be_read_back_and_drawn(tmp_path: Path) -> None:
    beds = made_up()
    write_beds(beds, tmp_path / "beds.csv")
    lines = (tmp_path / "beds.csv").read_text().splitlines()
    assert "viscosity [Pa s]" in lines[0] and "bed_height [m]" in lines[0] and len(lines) == 1 + len(beds)
    found = read_beds(lines)
    assert found.keys() == beds.keys() and all(found[run] == pytest.approx(beds[run]) for run in beds)
    draw(beds, tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 20_000


def test_the_table_has_changes_with_errors_and_the_balance_of_energy(monkeypatch: pytest.MonkeyPatch) -> None:
    beds = {run: means | {"largest_remainder": 2e-3 if run.seed == 2 else 1e-4} for run, means in made_up().items()}
    found = {row.quantity: row for row in study.rows(beds)}
    height = found["Re30-phi0.25-ratio1.5, smooth: bed height, relative change by films"]
    assert height.value == pytest.approx(0.0075) and height.note == "standard error 0.0025 over 2 seeds"
    assert found["Re30-phi0.25-ratio1.5, rough: bed height, relative change by films"].note == "one seed"
    (balance,) = [row for row in found.values() if row.limit is not None]
    assert balance.value == 2e-3 and balance.verdict == "FAILS"


def test_the_page_says_what_its_data_say() -> None:
    """Written again from the stored data, it is what it is."""
    assert page.PAGE.read_text() == page.page_of(page.stored())


def test_a_map_of_few_beds_says_nothing() -> None:
    text = page.page_of(made_up())
    assert "12 beds make its first part" in text and "| $St_U$ = 10:" not in text


def test_statements_of_the_page_follow_the_data(monkeypatch: pytest.MonkeyPatch) -> None:
    assert doctest.testmod(page).failed == 0
    monkeypatch.setattr(page, "is_known", lambda beds: True)
    text = page.page_of(made_up())
    assert "10 of 273 beds have run" in text and "| $St_U$ = 10:" in text
    # 0.75 +- 0.25 by two seeds may be chance
    assert "| +0.75 ± 0.25 |" in text and "up in 0 and down in 0 of 2 beds" in text
    smooth = [pair for pair in compared(made_up()) if pair[1] == "smooth"]
    assert page.clear(made_up(), smooth, "collisions").startswith("up in 0 and down in 2 of 2 beds")
