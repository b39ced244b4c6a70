"""Commands for collisions with unusual ends and domains: a result, or one line that says what to change."""

from __future__ import annotations

import json

import pytest
from command_line import call


@pytest.mark.parametrize("against", ["sphere", "wall"])
def test_collide_gives_the_same_result_with_a_late_end(against: str) -> None:
    """`cfddem collide --material glass --viscosity 0.001 --velocity 0.5 --until 0.1 --against ...`: all values equal."""
    words = ("collide", "--material", "glass", "--viscosity", "0.001", "--velocity", "0.5", "--against", against)
    left, followed = (call(*words, *more, "--json") for more in ((), ("--until", "0.1")))
    assert (followed.code, followed.err) == (0, "")
    assert json.loads(followed.out) == json.loads(left.out)
