"""The law of agitation that was measured on free spheres: where it is the default, and the fit behind it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from closures.agitation import free_spheres
from closures.registry import law_of
from scenarios.beds.liquid_bed.study import FluidisedBed, Study
from scenarios.references.resolved_suspension import matrix
from scenarios.references.resolved_suspension.fitting import autocovariance, fit_levels, fit_shares, seen_fluctuation
from scenarios.references.resolved_suspension.measures import Series, even_window
from scenarios.references.resolved_suspension.study import stored
from scenarios.references.resolved_suspension.suspension import Point
from scenarios.validation.agitation import study
from scenarios.validation.agitation.study import case_of, fits, fitted
from scenarios.validation.targets import validate


def liquid_bed(**changes: Any) -> Case:
    """The liquid bed of the gallery."""
    return Case.from_toml(
        gallery_files()["liquid-bed"], {name.replace("__", "."): value for name, value in changes.items()}
    )


def test_the_measured_law_is_the_default_within_its_range() -> None:
    assert liquid_bed().agitation == law_of(free_spheres)


@pytest.mark.parametrize(
    "changes",
    [
        {"bed__inlet_velocity": 0.2},  # Re_m = 200
        {"bed__inlet_velocity": 0.002},  # Re_m = 2
        {"bed__inlet_velocity": 0.0},
        {"fluid__density": 1.2, "fluid__viscosity": 1.2e-6},  # the same Reynolds number, in a gas
        {"laws__drag": "none"},
        {"material__glass__density": 1100.0},
        {"laws__agitation": "none"},
    ],
    ids=str,
)
def test_elsewhere_there_is_no_agitation_by_default(changes: dict[str, Any]) -> None:
    assert liquid_bed(**changes).agitation == "none"


def test_a_law_that_is_asked_for_is_used_outside_its_range_too() -> None:
    case = liquid_bed(bed__inlet_velocity=0.2, laws__agitation="free_spheres")
    assert case.agitation == law_of(free_spheres)


def test_a_lone_sphere_is_not_agitated() -> None:
    assert free_spheres(0.0, 40.0, 1.0, 2.5) == 0.0
    assert free_spheres(0.1, 40.0, 0.0, 2.5) == pytest.approx(0.5 * free_spheres(0.2, 40.0, 0.0, 2.5), rel=1e-12)


def synthetic(variance: tuple[float, float], time: float, drag: float = 1.0) -> dict[str, Any]:
    """A row of a run whose force has the autocovariance of the closure."""
    lags = np.linspace(0.0, 3.0, 60)
    made = {"lag": lags.tolist(), "window": 0.25, "inertia": 0.5, "solid_fraction": 0.3, "reynolds": 40.0}
    for name, each in zip(("along", "across"), variance):
        made[f"seen_covariance_{name}"] = (each * autocovariance(lags, 0.25, drag, 0.0, time)).tolist()
    return made


def test_the_fits_recover_the_numbers_of_a_synthetic_force() -> None:
    levels = fit_levels([synthetic((0.09, 0.05), 1.1)] * 2)
    assert levels == pytest.approx((0.09, 0.05, 1.1), rel=1e-4)
    shares = fit_shares([synthetic(seen_fluctuation(0.3, 40.0), 0.9, drag=0.6)])
    assert shares.along == pytest.approx(0.6, rel=1e-3)
    assert shares.across == pytest.approx(0.6, rel=1e-3)
    assert shares.time == pytest.approx(0.9, rel=1e-3)
    assert shares.inertia < 1e-2


def test_a_suspension_is_even_until_its_wave_grows() -> None:
    point = Point(2.5, 0.3, 20.0, diameter=6, box=3.0)
    every = round(point.diameter / point.slip / 16)
    step, height = every * point.slip / point.diameter, np.linspace(0.0, point.cells, 400, endpoint=False)
    series = Series(every)
    for k in range(round(20.0 / step)):
        wave = 0.0 if k * step < 12.0 else 0.5
        phase = 2.0 * math.pi / point.cells * height
        moved = height + wave * point.cells / (2.0 * math.pi) * np.sin(phase)
        series.position.append(np.stack([0.0 * moved, 0.0 * moved, moved], axis=1))
        series.slip.append(np.zeros(3))
    start, end = even_window(point, series)
    assert start == pytest.approx(5.0, abs=0.1)
    assert end == pytest.approx(12.0, abs=1.1)


def test_the_numbers_of_the_laws_are_the_fit_to_half_of_the_stored_runs() -> None:
    assert [row.quantity for row in fits() if row.verdict == "FAILS"] == []


def test_every_other_point_is_fitted_but_none_of_the_later_ones() -> None:
    chosen = {matrix.name(Point(**{**row["point"], "seed": 1})): fitted(row) for row in stored()}
    for number, point in enumerate(matrix.POINTS):
        assert chosen[matrix.name(point)] == (number % 2 == 0 and point.reynolds < 100.0)


def test_the_unresolved_box_has_the_slip_and_reynolds_number_of_the_resolved_run() -> None:
    point = Point(3.6, 0.36, 45.0)
    row = {"solid_fraction": 0.36, "reynolds": 40.0, "drag_factor": 15.0}
    case = case_of(point, row)
    assert case.fluid is not None
    slip, phi = 0.05, row["solid_fraction"]
    reynolds = (1.0 - phi) * slip * case.bed.diameter * case.fluid.density / case.fluid.viscosity
    assert reynolds == pytest.approx(40.0, rel=1e-12)
    weight = math.pi / 6.0 * case.bed.diameter**3 * 2.6 * case.fluid.density * abs(case.laws.gravity[2])
    drag = 3.0 * math.pi * case.fluid.viscosity * case.bed.diameter * 15.0 * slip
    assert weight == pytest.approx(drag, rel=1e-12)  # the drag on a sphere, and its share of the pressure gradient


def test_the_study_is_one_command_and_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With runs that give the resolved values and beds in balance, all limits hold; the second time nothing is run."""
    computed: list[str] = []

    def box(row: dict[str, Any], **forces: Any) -> dict[str, Any]:
        computed.append(matrix.name(Point(**row["point"])) + ", further forces" * bool(forces))
        return row

    def fluidised(described: Study, velocity: float, **changes: Any) -> FluidisedBed:
        computed.append(changes["laws.agitation"])
        voidage = study.PUBLISHED.get(velocity, 0.6)
        voidage += 0.001 * (changes["bed.seed"] - 1.0)
        return FluidisedBed(velocity, 1.0, 1.0, voidage, voidage, voidage, 0.59, 0.61, 3.0, 0.02, 0.01, voidage)

    monkeypatch.setattr(study, "run", box)
    monkeypatch.setattr(study, "fluidise", fluidised)
    assert validate("agitation", tmp_path)
    table = json.loads((tmp_path / "agitation" / "table.json").read_text())
    rows = {row["quantity"]: row for row in table["rows"]}
    assert rows["density ratio 7, solid fraction 0.45: collision rate"]["value"] == pytest.approx(1.0, rel=1e-12)
    assert rows["alginate at 9 mm/s: voidage"]["limit"] == 0.015
    packings = rows["alumina at 120 mm/s, without agitation: voidage"]
    assert packings["value"] == pytest.approx(0.601, rel=1e-12) and packings["note"].endswith("error 0.00058")
    assert len(computed) == len(set(computed) - {"none", "free_spheres"}) + 30
    before = len(computed)
    assert validate("agitation", tmp_path) and len(computed) == before
