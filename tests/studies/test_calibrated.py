"""Calibration of whole runs: restitution from cooling, friction from a heap, and what a fluidised bed does not tell.

The data are those of runs with known values and another random bed (seed 99).
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from cfddem.studies.calibration import Calibration, calibrate
from cfddem.studies.samples import variables

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "calibrate.md").read_text()

HEAP = """
[material.glass]
density = 2500.0
youngs_modulus = 6.0e10
contact_modulus = 2.0e6
poisson = 0.25
restitution = 0.6
friction = 0.4
rolling_friction = 0.2
[column]
width = 0.12
depth = 0.006
height = 0.06
cell = 0.003
front = "periodic"
ends = "closed"
[bed]
diameter = 2.0e-3
count = 250
start = "suspended"
start_corner = [0.045, 0.0, 0.0]
start_size = [0.03, 0.006, 0.045]
[laws]
rolling_resistance = "spring_dashpot"
surface = "smeared"
[run]
until = 0.5
every = 0.1
history_every = 0.01
average_from = 0.4
reference_speed = 0.6
"""

BED = """
[fluid]
density = 998.0
viscosity = 1.0e-3
[material.glass]
density = 2500.0
youngs_modulus = 6.0e10
contact_modulus = 2.0e5
poisson = 0.25
restitution = 0.9
friction = 0.2
roughness = 1.0e-6
[column]
width = 0.0075
height = 0.0325
cell = 0.0025
sides = "free_slip"
[bed]
diameter = 1.0e-3
count = 400
start = "suspended"
inlet_velocity = 0.037
[run]
until = 0.6
average_from = 0.3
every = 0.1
history_every = 0.005
particle_step = 2.0e-5
reference_speed = 0.05
"""


def search(folder: Path, case: str, data: dict[str, str], vary: list[str], trials: int) -> Calibration:
    """A calibration against data by name."""
    pytest.importorskip("optuna")
    (folder / "case.toml").write_text(case)
    for name, text in data.items():
        (folder / f"{name}.csv").write_text(text)
    files = [folder / f"{name}.csv" for name in data]
    return calibrate(folder / "case.toml", files, variables(vary), folder / "out", trials=trials)


@pytest.mark.slow
def test_restitution_is_found_from_a_cooling_box(tmp_path: Path) -> None:
    """The case and data of the page."""
    case, data = re.findall(r'write_text\("""(.*?)"""\)', PAGE, re.S)[:2]
    found = search(tmp_path, case, {"cooling": data}, ["material.glass.restitution=0.5..1"], 20)
    (estimate,) = found.estimates()
    assert abs(estimate["value"] - 0.8) <= 2.0 * estimate["error"] and estimate["identified"], estimate
    assert estimate["error"] < 0.03


@pytest.mark.slow
def test_friction_is_found_from_a_heap(tmp_path: Path) -> None:
    data = {"heap": "bed height [mm], error [mm]\n7.22, 0.1\n"}
    found = search(tmp_path, HEAP, data, ["material.glass.friction=0.05..0.6"], 16)
    (estimate,) = found.estimates()
    assert abs(estimate["value"] - 0.2) <= 2.0 * estimate["error"] and estimate["identified"], estimate
    assert estimate["error"] < 0.08


@pytest.mark.slow
def test_a_fluidised_bed_does_not_tell_the_restitution(tmp_path: Path) -> None:
    data = {
        "height": "bed height [mm], error [mm]\n9.69, 0.1\n", "drop": "pressure drop [Pa], error [Pa]\n54.82, 0.5\n",
    }  # fmt: skip
    vary = ["material.glass.restitution=0.5..1", "bed.diameter=0.8e-3..1.2e-3"]
    restitution, diameter = search(tmp_path, BED, data, vary, 20).estimates()
    assert not restitution["identified"] and "not identified" in restitution["verdict"]
    assert diameter["identified"] and abs(diameter["value"] - 1e-3) <= 2.0 * diameter["error"]
