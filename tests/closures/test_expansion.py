"""Published laws of bed expansion: known values, their ranges, and what a report and a check say of them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from made_up_run import BED, made_up

from cfddem.analysis.report import report
from cfddem.case.schema import Case
from cfddem.preflight.expansion import expansions
from cfddem.preflight.summary import preflight
from closures import bed
from closures.balance import voidage_of_slip

HEAVY = (
    BED.replace("density = 2500.0", "density = 3585.9")
    .replace("diameter = 2e-3", "diameter = 3.087e-3")
    .replace("count = 2000", "count = 1000")
    .replace("density = 1000.0", "density = 997.0")
    .replace("viscosity = 1e-3", "viscosity = 8.354e-4")
    .replace("inlet_velocity = 0.05", "inlet_velocity = 0.157033")
    .replace("width = 0.02", "width = 0.04")
    .replace("cell = 0.005", "cell = 0.008")
    .replace("height = 0.06", "height = 0.12")
)
"""Alumina beads in water, Re_t = 1862."""


def voidages(text: str) -> dict[str, float]:
    return {each.law: each.voidage for each in expansions(Case.from_text(text)).every}


def test_the_slip_form_has_the_limits_of_creeping_and_of_inertial_flow() -> None:
    assert 0.6 * bed.slip_ratio_garside(0.6, 0.0) == pytest.approx(0.6**5.14, rel=1e-12)
    assert bed.exponent_garside(0.0) == pytest.approx(5.14, abs=0.05)  # of the same paper
    assert bed.slip_ratio_garside(0.6, 1e12) == pytest.approx(0.8 * 0.6**1.28, rel=1e-9)
    below, above = (bed.slip_ratio_garside(0.85 + side, 1e12) for side in (-1e-9, 1e-9))
    assert above == pytest.approx(below, rel=1e-3)
    for voidage in (0.45, 0.6, 0.8, 0.9):
        for reynolds in (0.1, 20.0, 1862.0):
            ratio = voidage * bed.slip_ratio_garside(voidage, reynolds)
            slip = partial(bed.slip_ratio_garside, reynolds=reynolds)
            assert voidage_of_slip(ratio, slip) == pytest.approx(voidage)


def test_the_two_parameter_law_passes_through_the_resolved_suspensions() -> None:
    for reynolds, ratio, exponent in ((1.02, 0.92, 4.2), (5.0, 0.86, 4.0), (20.0, 0.88, 3.6), (2000.0, 0.8, 2.39)):
        assert bed.velocity_ratio_two_parameters(reynolds) == pytest.approx(ratio, rel=1e-12)
        assert bed.exponent_two_parameters(reynolds) == pytest.approx(exponent, rel=1e-12)


def test_the_law_of_hirata_and_bulos_joins_the_bed_at_rest_and_the_terminal_velocity() -> None:
    assert bed.expanded_voidage_hirata_bulos(0.0, 0.5, 100.0, 0.05, 0.42) == 0.42
    assert bed.expanded_voidage_hirata_bulos(0.5, 0.5, 100.0, 0.05, 0.42) == pytest.approx(1.0)


def test_heavy_beads_have_the_published_range_of_voidages() -> None:
    found = voidages(HEAVY)
    assert found["Richardson-Zaki"] == pytest.approx(0.613, abs=5e-4)
    assert found["Khan-Richardson"] == pytest.approx(0.617, abs=5e-4)
    assert found["Garside"] == pytest.approx(0.651, abs=5e-4)
    assert found["Garside's slip form"] == pytest.approx(0.662, abs=5e-4)
    assert found["two-parameter Richardson-Zaki"] == pytest.approx(0.673, abs=5e-4)


def test_only_laws_that_hold_at_this_reynolds_number_and_width_are_compared() -> None:
    free, stuck = (expansions(Case.from_text(HEAVY.replace("free_slip", sides))) for sides in ("free_slip", "no_slip"))
    assert [each.law for each in free.held] == ["Richardson-Zaki", "Garside", "Khan-Richardson", "Garside's slip form"]
    assert [each.law for each in stuck.held] == [*(each.law for each in free.held), "Hirata-Bulos"]
    outside = {each.law: each.outside for each in free.every}
    assert outside["two-parameter Richardson-Zaki"] == "Re_t 1.86e+03 is outside of 1.02 to 20"
    assert outside["Hirata-Bulos"] == "d/D 0 is outside of 0.001 to 0.2"
    slow = expansions(Case.from_text(HEAVY.replace("viscosity = 8.354e-4", "viscosity = 0.06")))
    assert 1.02 < slow.reynolds < 20.0 and "two-parameter Richardson-Zaki" in {each.law for each in slow.held}
    narrow = expansions(Case.from_text(HEAVY.replace("free_slip", "no_slip").replace("width = 0.04", "width = 0.024")))
    assert [each.law for each in narrow.held] == ["Khan-Richardson", "Hirata-Bulos"]


@pytest.mark.parametrize(("above", "holds"), [(-0.005, True), (0.03, None), (0.06, False)])
def test_a_bed_of_heavy_beads_is_judged_only_beyond_the_scatter_of_published_beds(
    tmp_path: Path, above: float, holds: bool | None
) -> None:
    voidage = voidages(HEAVY)["Garside's slip form"] + above
    found = report(made_up(tmp_path / "run", HEAVY, bed_voidage=voidage))
    answer = next(each for each in found.key_results if each.name == "bed voidage")
    assert answer.holds is holds and ("published beds scatter by 0.03 to 0.04" in answer.verdict) == (holds is None)
    assert (
        "scatter by 0.03 to 0.04 in voidage at Re_t above 500, here 1862. Outside of their ranges: " in found.laws_note
    )
    assert "two-parameter Richardson-Zaki 0.673 (Re_t 1.86e+03 is outside" in found.laws_note


def test_the_check_tells_that_published_beds_of_heavy_beads_scatter() -> None:
    notes = [str(each) for each in preflight(Case.from_text(HEAVY)).issues if each.key == "bed.inlet_velocity"]
    assert len(notes) == 1 and "here 1862; their laws give 0.613 to 0.662 for this bed" in notes[0]
    light = preflight(Case.from_text(BED.replace("diameter = 2e-3", "diameter = 1e-3").replace("0.05", "0.02")))
    assert not [each for each in light.issues if "scatter" in each.reason]
