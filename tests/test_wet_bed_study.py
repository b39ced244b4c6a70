"""The study of Mueller's wet bed: its states, and its table from made-up means."""

from __future__ import annotations

import math

import pytest

from cfddem.preflight.summary import refuse_errors
from scenarios.beds.wet_bed import validation
from scenarios.beds.wet_bed.validation import ANGLES, Means, directions, over_packings, rows, state


def test_the_pulls_of_the_states_are_as_their_names_say() -> None:
    """Bond numbers over the weight of a seed: 2 pi R sigma cos(theta) over it."""
    dry, *wet = (state(name) for name in ANGLES)
    assert dry.liquid is None
    weight = 1000.0 * math.pi / 6.0 * 1.2e-3**3 * 9.81
    for case, expected in zip(wet, (0.74, 2.19, 4.24)):
        assert case.liquid is not None and case.bed.count == 9240
        pull = 2.0 * math.pi * 0.6e-3 * 0.02 * math.cos(math.radians(case.liquid.contact_angle))
        assert pull / weight == pytest.approx(expected, rel=0.02)
        refuse_errors(case)


def test_the_table_has_errors_and_ratios() -> None:
    assert over_packings([2.0, 2.0, 2.0]) == (2.0, 0.0)
    dry = [Means(0.05, 0.01, 100.0, 1e-3, 0.01)] * 3
    wet = [Means(0.05, 0.01, 100.0 * each, 5e-4, 0.01) for each in (1.9, 2.0, 2.1)]
    found = {name: dry if name == "dry" else wet for name in ANGLES}
    table = {row.quantity: row for row in directions(found, {name: 0.3 + 0.1 * (name != "dry") for name in ANGLES})}
    row = table["weak: pressure deviation larger than dry, logarithm of the ratio"]
    assert row.value == pytest.approx(math.log(2.0)) and "0.029" in row.note
    assert table["weak: temperature smaller than dry, logarithm of the ratio"].value == pytest.approx(math.log(2.0))
    assert table["strong: minimum fluidisation over that of the dry bed"].value == pytest.approx(4.0 / 3.0)
    assert [row.unit for row in rows("dry", dry)] == ["m", "m", "Pa", "m2/s2", "m"]
    assert validation.UNTIL == 10.1 and len(validation.SEEDS) == 3
