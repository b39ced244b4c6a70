"""Contact of two unlike materials in a case: `[pair.a.b]`."""

from __future__ import annotations

from typing import Any

import pytest

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.preflight.summary import preflight
from cfddem.run.build import materials_of

TWO = """
[material.glass]
density = 2500.0
youngs_modulus = 1e8
poisson = 0.3
friction = 0.4
roughness = 2e-6
[material.steel]
density = 7800.0
youngs_modulus = 1e9
poisson = 0.3
friction = 0.2
[pair.glass.steel]
friction = 0.15
[column]
width = 0.02
height = 0.1
cell = 0.005
[bed]
material = "glass"
diameter = 2e-3
count = 10
[run]
until = 0.1
"""


def test_a_pair_replaces_what_follows_from_its_materials() -> None:
    """What is given holds for both orders; the rest is mixed, and lubricated friction follows dry friction."""
    case = Case.from_text(TWO, "x.toml", {"pair.glass.steel.roughness": 3e-6, "pair.glass.steel.restitution": 0.5})
    table = materials_of(case)
    for row in (table[0, 1], table[1, 0]):
        assert (row["friction"], row["friction_lubricated"], row["roughness_gap"]) == (0.15, 0.15, 3e-6)
        assert row["restitution"] == 0.5 and row["damping_ratio"] > 0.0
    assert (table[0, 0]["friction"], table[1, 1]["friction"], table[1, 1]["restitution"]) == (0.4, 0.2, 1.0)
    without = materials_of(Case.from_text(TWO.replace("[pair.glass.steel]\nfriction = 0.15\n", "")))
    assert (without[0, 1]["friction"], without[0, 1]["roughness_gap"]) == (0.2, 1e-6)
    assert Case.from_text(case.to_toml()) == case


@pytest.mark.parametrize(
    ("text", "given", "said"),
    [
        ("stel", {}, "x.toml:13: pair.glass.stel: must be a pair of materials: one of glass, steel (did you mean"),
        ("glass", {}, "x.toml:13: pair.glass.glass: must be two unlike materials; give the values in [material.glass]"),
        ("steel]\n[pair.steel.glass", {}, "must be given once; [pair.steel.glass] is the same pair"),
        ("steel", {"pair.glass.steel.friction": -1.0}, "pair.glass.steel.friction = -1.0: must be at least 0"),
        ("steel", {"pair.glass.steel.frction": 0.1}, "did you mean 'friction'?"),
    ],
)
def test_a_wrong_pair_is_one_line(text: str, given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as refusal:
        Case.from_text(TWO.replace("pair.glass.steel", f"pair.glass.{text}"), "x.toml", given)
    assert said in str(refusal.value) and "\n" not in str(refusal.value)


def test_an_unused_value_of_a_pair_is_a_warning() -> None:
    found = preflight(Case.from_text(TWO, "x.toml", {"pair.glass.steel.rolling_friction": 0.1})).issues
    assert [each.key for each in found if "unused" in each.reason] == ["pair.glass.steel.rolling_friction"]
