"""Notes and warnings of the pre-run check that a user can act on, and values that look like other units."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from command_line import call
from example_case import TEXT
from made_up_run import BED, made_up

from cfddem.analysis import run_warnings
from cfddem.analysis.report import report
from cfddem.backend.errors import InputError
from cfddem.case.gallery import gallery, gallery_files
from cfddem.case.schema import Case
from cfddem.preflight.summary import preflight


def test_a_note_needs_no_action_and_stands_before_the_word_ok() -> None:
    lines = preflight(gallery()["gas-bed"]).issue_lines()
    assert lines[0].startswith("note: ") and lines[-1] == "ok: no errors, no warnings"
    assert "2600000 Pa" in " ".join(lines), "a modulus is no power of ten where it has few digits"


def test_the_modulus_of_the_remedy_is_enough() -> None:
    """Load and speed ask for different moduli; the larger one is given, so that one change is enough."""
    soft = {
        "bed.count": 8000,
        "column.height": 0.6,
        "run.reference_speed": 0.5,
        "material.alumina.contact_modulus": 5e5,
    }
    key = "material.alumina.contact_modulus"
    (first,) = (each for each in preflight(Case.from_text(TEXT, "b.toml", soft)).issues if each.key == key)
    enough = float(re.search(r"at least (\S+) Pa", first.remedy)[1])  # type: ignore[index]
    again = preflight(Case.from_text(TEXT, "b.toml", soft | {key: enough})).issues
    assert not [each for each in again if each.key == key], again


def test_a_bed_that_lies_on_soft_contacts_gets_a_warning_where_collisions_overlap_more() -> None:
    key, case = "material.alumina.contact_modulus", {"run.reference_speed": 0.15}
    lying = {"bed.inlet_velocity": 1e-3, key: 3e5}
    for given, severity in ((lying, "warning"), ({key: 5e5}, "note")):
        (found,) = (each for each in preflight(Case.from_text(TEXT, "b.toml", case | given)).issues if each.key == key)
        assert found.severity == severity and "under collisions at the reference speed" in found.reason


def test_a_long_run_with_hard_contacts_is_told_the_modulus_that_saves_time() -> None:
    hard = {"material.glass.contact_modulus": 6e10, "run.particle_step": None}
    (note,) = preflight(Case.from_toml(gallery_files()["liquid-bed"], hard)).issues
    assert note.severity == "note" and "the run takes about" in note.reason
    short = hard | {"run.until": 0.05, "run.average_from": 0.0}
    assert not preflight(Case.from_toml(gallery_files()["liquid-bed"], short)).issues


@pytest.mark.parametrize(
    ("name", "given", "key", "said"),
    [
        ("wet-bed", {"liquid.surface_tension": 72.0}, "liquid.surface_tension", "did you mean 0.072 N/m (72 mN/m)?"),
        ("liquid-bed", {"material.glass.roughness": 1.0}, "material.glass.roughness", "the limit is 5 %"),
        ("liquid-bed", {"run.history_every": 10.0}, "run.history_every", "leaves no means"),
        ("hopper", {"wall.0.radius": 0.002}, "wall.0.radius", "an opening of 0.004 m is narrower than a particle"),
        ("coating", {"run.until": 0.1}, "spray.begin", "nothing is sprayed"),
        ("coating", {"spray.drop_volume": 1e-22}, "spray.drop_volume", "makes 8.2e+13 drops, more than 1e+09"),
        ("wet-bed", {"liquid.liquid_fraction": 1.5}, "liquid.liquid_fraction", "is more liquid than solid"),
    ],
)  # fmt: skip
def test_values_in_other_units_are_found_in_gallery_cases(
    name: str, given: dict[str, Any], key: str, said: str
) -> None:
    issues = preflight(Case.from_toml(gallery_files()[name], given)).issues
    assert [key] == [each.key for each in issues if said in each.reason], issues


def test_a_report_says_that_a_spray_misses_the_particles(tmp_path: Path) -> None:
    zones = {
        "nozzle": "nozzle = [0.01, 0.01, 0.05]\nangle = 40.0\nlength = 0.02",
        "corner": 'zone = "box"\ncorner = [0.0, 0.0, 0.05]\nsize = [0.02, 0.02, 0.01]',
    }
    for (key, zone), (missed, warned) in product(zones.items(), ((9e-9, True), (1e-10, False))):
        spray = (
            "[liquid]\nviscosity = 5e-3\nsurface_tension = 0.07\nthickness = 1e-6\n"
            f"[spray]\nrate = 1e-8\ndrop_volume = 1e-13\n{zone}\n[run]"
        )
        folder = made_up(
            tmp_path / f"{key}{missed}", BED.replace("[run]", spray), liquid_missed=missed, liquid_sprayed=1e-8 - missed
        )
        said = [each for each in report(folder).warnings if "found no particle in its zone" in each]
        assert [each.startswith("90 % of the spray") and f"spray.{key}" in each for each in said] == [True] * warned


def test_a_value_of_a_case_cannot_be_set_and_a_key_is_found_by_its_nearest_name() -> None:
    case = gallery()["liquid-bed"]
    with pytest.raises(InputError, match=r"density = 3\.0: must be left as it is; case\.with_"):
        case.fluid.density = 3.0  # type: ignore[misc, union-attr]
    assert "did you mean 'bed.diameter'" in call("explain", "bed.diametr")[2]


def test_the_height_of_a_single_falling_sphere_is_no_mean(tmp_path: Path) -> None:
    """Where a bed height drifts, the report names the curves; a sphere that falls has no bed."""
    found = report(made_up(tmp_path / "bed", trend=0.01))
    (drifts,) = found.actions["run longer, or average over another window"]
    assert "window: bed height; run longer" in drifts and "curves over time (cfddem view --history)" in drifts
    sphere = Case.from_text(BED.replace("count = 2000", "count = 1"))
    assert not list(run_warnings._series_warnings(sphere, {"bed_height": found.measures["bed_height"]}))
