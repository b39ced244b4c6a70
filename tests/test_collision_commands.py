"""Commands for collisions with unusual ends and domains: a result, or one line that says what to change."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from command_line import call

from cfddem.backend.errors import RunFailed
from scenarios.collisions.film_impact import cavitation, impact


@pytest.mark.parametrize("against", ["sphere", "wall"])
def test_collide_gives_the_same_result_with_a_late_end(against: str) -> None:
    """`cfddem collide --material glass --viscosity 0.001 --velocity 0.5 --until 0.1`: all values equal."""
    words = ("collide", "--material", "glass", "--viscosity", "0.001", "--velocity", "0.5", "--against", against)
    left, followed = (call(*words, *more, "--json") for more in ((), ("--until", "0.1")))
    assert (followed.code, followed.err) == (0, "")
    assert json.loads(followed.out) == json.loads(left.out)


def test_film_impact_in_a_narrow_domain_is_refused_in_one_line() -> None:
    """`cfddem film-impact --domain 0.1 --velocity 0.3`."""
    refused = call("film-impact", "--domain", "0.1", "--velocity", "0.3")
    assert (refused.code, refused.out, refused.err.count("\n")) == (2, "", 1)
    assert "domain = 0.1: must be at least 0.8" in refused.err


def test_a_pressure_without_a_solution_ends_an_impact_with_its_place_and_a_remedy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def singular(*_: Any) -> None:
        raise np.linalg.LinAlgError("the matrix of the pressure is not positive definite")

    monkeypatch.setattr(cavitation, "solve_banded", singular)
    with pytest.raises(RunFailed, match=r"t = 0 s, with the bead 0.0004 m above .* use a larger domain, or more cells"):
        impact(cells=5)
