"""Values beyond all scales, missing tables, and a sum that is too much: what the pre-run check says of them."""

from __future__ import annotations

import pytest

from cfddem.backend.errors import InputError
from cfddem.case.gallery import gallery, gallery_files
from cfddem.case.schema import Case
from cfddem.cli.explain_pages import key_lines, matching
from cfddem.preflight.summary import preflight

GALLERY = gallery()


# ---------------------------------------------------------------- values beyond all scales, missing tables


@pytest.mark.parametrize("name", GALLERY)
def test_a_density_of_1e300_is_one_line_without_inf_or_nan(name: str) -> None:
    """And so is every other number of a case that overflows, 1e-300 included."""
    for key in ("fluid.density", "fluid.viscosity", "run.until", "run.every", "column.cell"):
        for value in (1e300, 1e21, 1e-31):
            if key.startswith("fluid") and GALLERY[name].fluid is None:
                continue
            result = preflight(GALLERY[name].with_(**{key: value}))
            (issue,) = result.issues
            assert issue.severity == "error" and issue.key == key and not result.rows
            assert f"{value:g} is too large or too small" in issue.reason


@pytest.mark.parametrize("value", [1e19, 1e12, 1e-29])
def test_extreme_values_that_are_accepted_are_told_without_inf_or_nan(value: float) -> None:
    for name in ("sedimentation", "settling", "liquid-bed", "segregation"):
        for key in ("fluid.density", "fluid.viscosity", "run.until"):
            words = " ".join(str(each) for each in preflight(GALLERY[name].with_(**{key: value})).issues).split()
            assert not {"inf", "-inf", "nan"} & set(words), words


def test_a_seed_and_rounding_of_components_are_free() -> None:
    assert preflight(GALLERY["settling"].with_(**{"bed.seed": 10**24})).status == "ok"
    assert preflight(GALLERY["settling"].with_(**{"laws.gravity": [0.0, 6e-33, -9.81]})).status == "ok"


@pytest.mark.parametrize("name", GALLERY)
def test_a_missing_table_or_its_missing_line_is_one_short_line(name: str) -> None:
    """Without its first line the keys of a table fall to the table above; one error says so, not one for each key."""
    text = gallery_files()[name].read_text()
    headers = [line for line in text.split("\n") if line.startswith("[") and not line.startswith(("[[", "[bed."))]
    for header in headers:
        for changed in (text.replace(f"{header}\n", "", 1), _without_table(text, header)):
            try:
                Case.from_text(changed, "case.toml")
            except InputError as failure:
                lines = str(failure).split("\n")
                assert len(lines) == 1, str(failure)
                assert all(len(each) < 260 for each in lines), str(failure)
    missing = str(_refusal(text.replace("[run]", "", 1)))
    assert "must be below a line [run], as " in missing and missing.endswith("the line is missing")


def _without_table(text: str, header: str) -> str:
    """The text without a table: from its header to the next one."""
    before, _, after = text.partition(f"\n{header}")
    _, bracket, rest = after.partition("\n[")
    return before + bracket + rest


def _refusal(text: str) -> InputError:
    with pytest.raises(InputError) as refusal:
        Case.from_text(text, "case.toml")
    return refusal.value


def test_a_material_that_many_species_name_is_missed_once() -> None:
    text = gallery_files()["segregation"].read_text().replace('material = "graphite"', 'material = "glas"')
    message = str(_refusal(text.replace('material = "glass"', 'material = "glas"').replace("seed = 1", "sed = 1")))
    assert message.count("bed.species.") == 1 and "1 more keys name it, too" in message, message


# ---------------------------------------------------------------- drag beside several walls


def test_the_sum_of_the_drag_beside_all_walls_is_warned_of() -> None:
    """Measured spheres fall at 0.735 to 0.893 of their largest speed with the sum, at 0.990 to 1.023 with "nearest"."""
    settling = GALLERY["settling"]
    walls = {"column.sides": "no_slip", "laws.wall_drag": "all"}
    (issue,) = (each for each in preflight(settling.with_(**walls)).issues if each.key == "laws.wall_drag")
    assert issue.severity == "warning" and issue.in_report and "ten Cate" in issue.reason
    assert "0.73 to 0.89" in issue.reason and '"nearest"' in issue.remedy
    for changes in ({**walls, "laws.wall_drag": "nearest"}, {"laws.wall_drag": "none"}):
        assert "laws.wall_drag" not in {each.key for each in preflight(settling.with_(**changes)).issues}
    assert "0.73 to 0.89" in " ".join(" ".join(key_lines(matching("laws.wall_drag"))).split())


def test_drag_beside_solid_cells_that_the_grid_counts_again_is_warned_of() -> None:
    """Beside flat sides of the box and smooth walls it is taken out."""
    settling = GALLERY["settling"].with_(**{"column.sides": "no_slip", "laws.wall_drag": "nearest"})
    for case in (GALLERY["settling"], settling.with_(vessel={"shape": "cylinder"})):
        assert not [each for each in preflight(case).issues if each.key == "laws.wall_drag"]
    round_column = preflight(settling.with_(**{"column.shape": "cylinder"})).issues
    (issue,) = (each for each in round_column if each.key == "laws.wall_drag")
    assert issue.severity == "warning" and "up to 8 %" in issue.reason and "none" in issue.remedy


# ---------------------------------------------------------------- lengths in mm, inlets that are missing


@pytest.mark.parametrize(
    ("name", "key", "value", "where", "said"),
    [
        ("wurster", "bed.diameter", 4.0, "bed.diameter", "did you mean 0.004 m"),
        ("wurster", "bed.height", 40.0, "bed.height", "40 m is above the lid at 0.24 m"),
        ("wurster", "wall.0.radius", 22.0, "wall.0", "no part of the cylinder lies in the column"),
        ("wurster", "patch.jet.diameter", 32.0, "patch.jet", "its diameter is 32 m"),
        ("wurster", "evaporation.full_thickness", 5.0, "evaporation.full_thickness", "more than the radius"),
        ("gas-bed", "bed.inlet_velocity", 0.0, "bed.inlet_velocity", "no fluid enters"),
    ],
)
def test_a_wrong_length_or_a_missing_inlet_is_told_at_its_key(
    name: str, key: str, value: float, where: str, said: str
) -> None:
    told = [issue for issue in preflight(GALLERY[name].with_(**{key: value})).issues if issue.severity != "note"]
    assert any(issue.key == where and said in issue.reason for issue in told), told
