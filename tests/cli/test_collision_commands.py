"""Commands for collisions with unusual ends and domains: a result, or one line that says what to change."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import call, parsed

from cfddem.backend.errors import RunFailed
from cfddem.case.materials import Material
from scenarios.collisions.film_impact import impact, pressure
from scenarios.collisions.immersed_pair import MATERIALS, collide


@pytest.mark.parametrize("against", ["sphere", "wall"])
def test_collide_gives_the_same_result_with_a_late_end(against: str) -> None:
    """`cfddem collide --material glass --viscosity 0.001 --velocity 0.5 --until 0.1`: all values equal."""
    words = ("collide", "--material", "glass", "--viscosity", "0.001", "--velocity", "0.5", "--against", against)
    left, followed = (call(*words, *more, "--json") for more in ((), ("--until", "0.1")))
    assert (followed.code, followed.err) == (0, "")
    assert json.loads(followed.out) == json.loads(left.out)


def test_collisions_are_calibrated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Restitution and roughness from four rebounds that were computed with 0.9 and 0.4 um, within three errors."""
    monkeypatch.chdir(tmp_path)
    solid = Material(**MATERIALS["glass"].model_dump() | {"roughness": 4e-7, "restitution": 0.9})
    rows = [f"{st}, {collide(solid, velocity=0.1, stokes=st).restitution}, 0.01" for st in (30, 60, 200, 600)]
    Path("e.csv").write_text("\n".join(["St [-], e [-], error [-]", *rows, ""]))
    line = (
        "calibrate",
        "--collide",
        "glass",
        "--match",
        "e.csv",
        "--vary",
        "restitution=0.7..1",
        "--set",
        "velocity=0.1",
    )
    found = parsed(call(*line, "--vary", "roughness=1e-7..1e-6 log", "--trials", "20", "-o", "fit", "--json").out)
    for row, true in zip(found["estimates"], (0.9, 4e-7)):
        assert row["identified"] and abs(row["value"] - true) < 3.0 * row["error"] + 0.02 * true, row
    assert (tmp_path / "fit" / "calibration.png").stat().st_size > 10_000
    for wrong, said in (
        (("--vary", "restituton=0.7..1"), "did you mean 'restitution'"),
        (("--vary", "stokes=1..10"), "come from the data"),
        (("--vary", "roughness=-2..-1"), "roughness"),
    ):
        refused = call("calibrate", "--collide", "glass", "--match", "e.csv", "--set", "velocity=0.1", *wrong)
        assert refused.code == 2 and said in refused.err and refused.err.count("\n") == 1, refused.err
    assert "--collide" in call("calibrate", "liquid-bed", *line[1:]).err


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

    monkeypatch.setattr(pressure, "solve_banded", singular)
    with pytest.raises(RunFailed, match=r"t = 0 s, with the bead 0.0004 m above .* use a larger domain, or more cells"):
        impact(cells=5)
