"""Laws outside of their ranges: the check says how much the result changes."""

from __future__ import annotations

import math
from typing import Any

import pytest
from example_case import TEXT

from cfddem.case.schema import Case
from cfddem.preflight.bed_estimate import estimate_bed
from cfddem.preflight.law_ranges import effect_of_bridge, effect_of_drag, outside, state_of
from cfddem.preflight.summary import preflight
from closures.capillary_pull import lambert_energy, willett_energy
from closures.registry import REGISTRY, Law, law_of, load_built_in_laws


def effect(law: str, **given: Any) -> str:
    case = Case.from_text(TEXT, "bed.toml", {"laws.drag": law, **given})
    assert case.laws.drag_law is not None
    return effect_of_drag(case, case.laws.drag_law, estimate_bed(case))


def test_the_effect_on_the_bed_height_is_that_of_a_run_with_the_other_law() -> None:
    """The estimate of the check by each law gives the heights that the sentence compares."""
    said = effect("tenneti")
    heights = {}
    for law in ("tenneti", "tang", "ergun"):
        heights[law] = estimate_bed(Case.from_text(TEXT, "bed.toml", {"laws.drag": law})).height
    lowest, highest = (100.0 * (heights["tenneti"] / heights[law] - 1.0) for law in ("ergun", "tang"))
    assert f"and the bed height by -19 % (single laws {lowest:+.0f} to {highest:+.0f} %)" in said


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"bed.fixed": True, "bed.start": "poured"}, "its drag and the pressure drop differ by -45 %"),
        (
            {"bed.inlet_velocity": 0.0, "bed.start": "suspended", "column.ends": "closed"},
            "and the settling velocity by",
        ),
        (
            {"fluid.density": 1.2, "fluid.viscosity": 1.8e-5, "bed.inlet_velocity": 3.0},
            "and the velocity of minimum fluidisation by",
        ),
    ],
    ids=["fixed", "settling", "gas"],
)
def test_the_result_is_the_one_that_the_case_is_about(given: dict[str, Any], said: str) -> None:
    assert said in effect("tenneti", **given)


@pytest.mark.parametrize("further", [{"laws.history": "mei_adrian"}, {"laws.added_mass": 0.5}, {}])
def test_a_law_of_agitation_is_not_fitted_with_further_forces(further: dict[str, Any]) -> None:
    case = Case.from_text(TEXT, "bed.toml", {"laws.agitation": "free_spheres", **further})
    found = [each for each in preflight(case).issues if "fitted without added mass and history" in each.reason]
    assert [each.key for each in found] == ["laws.agitation"] * bool(further)


def test_several_arguments_are_one_sentence() -> None:
    case = Case.from_text(TEXT, "bed.toml", {"bed.fixed": True, "bed.start": "poured", "laws.drag": "tenneti"})
    (found,) = (each for each in preflight(case).issues if each.key == "laws.drag")
    assert "is for reynolds 0 to 300 and voidage 0.5 to 1, but the bed has 579 and 0.42" in found.reason


def test_a_law_of_single_spheres_is_not_compared_with_in_a_dense_bed() -> None:
    load_built_in_laws()
    case = Case.from_text(TEXT, "bed.toml")
    state = state_of(case, estimate_bed(case))
    assert "for single spheres" in outside(REGISTRY["drag"]["clift"], state)
    assert not outside(REGISTRY["drag"]["clift"], state | {"voidage": 1.0})
    assert not outside(REGISTRY["drag"]["di_felice"], state)


def test_an_unknown_error_is_said_to_be_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    load_built_in_laws()
    only = {"tenneti": REGISTRY["drag"]["tenneti"]}
    monkeypatch.setitem(REGISTRY, "drag", only)
    assert "the error is not known" in effect("tenneti")


def test_a_law_with_other_arguments_has_no_estimate() -> None:
    case = Case.from_text(TEXT, "bed.toml")
    other = Law("mine", "drag", "", {}, lambda reynolds, voidage, diameter_ratio: 1.0)
    assert effect_of_drag(case, other, estimate_bed(case)) == ""


def test_a_law_that_never_carries_the_bed_is_not_called_a_wrong_unit() -> None:
    """Beyond its range, the drag of Tang's law falls with the velocity: no velocity of minimum fluidisation."""
    given = {"fluid.density": 1.2, "fluid.viscosity": 1.8e-5, "bed.inlet_velocity": 2.5, "laws.drag": "tang"}
    case = Case.from_text(TEXT, "bed.toml", given)
    assert math.isnan(estimate_bed(case).onset)
    assert not any("SI units" in each.remedy for each in preflight(case).issues)


def test_the_effect_of_a_large_bridge_is_that_of_its_energy() -> None:
    at = (1.0, math.radians(30.0), 0.5e-3, 1e-11, 2e-4)
    ratio = 100.0 * (willett_energy(*at) / lambert_energy(*at) - 1.0)
    assert f"differs by {ratio:+.0f} % from that by Lambert" in effect_of_bridge(*at[1:])
    assert law_of(willett_energy).kind == "capillary"
