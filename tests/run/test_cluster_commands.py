"""Commands on several ranks under MPI: the files of one process, and what is refused."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from cluster import HERE, environment, needs_mpi
from command_line import cfddem

from cfddem.backend.launch import launch_command
from cfddem.cli.information import _processes
from cfddem.io import checkpoint
from cfddem.io.reading import open_run

pytestmark = needs_mpi

TEXT = """
title = "Beads that fall in a box"
[material.glass]
density = 2500.0
youngs_modulus = 60e9
contact_modulus = 2e6
poisson = 0.25
restitution = 0.8
friction = 0.3
[column]
width = 0.024
depth = 0.009
height = 0.03
cell = 0.003
sides = "no_slip"
[bed]
start = "suspended"
diameter = 1e-3
count = 400
[run]
until = 0.01
every = 0.005
history_every = 0.001
record_collisions = true
"""

BED = """
title = "Beads in water"
fluid = {density = 998.0, viscosity = 1e-3}
material.glass = {density = 2500.0, youngs_modulus = 6e10, contact_modulus = 1e7, poisson = 0.23, roughness = 1e-7}
column = {width = 0.03, depth = 0.015, height = 0.04, cell = 0.005}
bed = {diameter = 2e-3, count = 300, start = "suspended", inlet_velocity = 0.03}
run = {until = 0.01, every = 0.005, history_every = 0.002}
"""


def particles(run: Path) -> dict[str, np.ndarray]:
    """The particles of the newest checkpoint, by id."""
    found = checkpoint.newest(run)["simulation"]["particles"]["particles"]
    order = np.argsort(found["id"])
    return {name: each[order] for name, each in found.items()}


def assert_same_particles(one: Path, other: Path) -> None:
    """All fields have the same bits."""
    first, second = particles(one), particles(other)
    assert first.keys() == second.keys()
    for name in first:
        assert np.array_equal(first[name], second[name]), name


def assert_same_files(one: Path, other: Path) -> None:
    """Snapshots with the same bits, and histories that differ by rounding."""
    names = sorted(each.name for each in (one / "data").iterdir())
    assert names == sorted(each.name for each in (other / "data").iterdir())
    for name in names:
        with h5py.File(one / "data" / name) as first, h5py.File(other / "data" / name) as second:
            assert first["particles"].keys() == second["particles"].keys()
            for field in first["particles"]:
                assert np.array_equal(first["particles"][field][()], second["particles"][field][()]), field
            events = [np.sort(each["collisions/begin"][()]) for each in (first, second)]
            assert np.array_equal(*events)
    with h5py.File(one / "history.h5") as first, h5py.File(other / "history.h5") as second:
        assert first.keys() == second.keys()
        for column in first:
            assert first[column][()] == pytest.approx(second[column][()], rel=1e-12, nan_ok=True), column


@pytest.mark.slow  # as plain tests: a bed on two ranks, and ranks in one process that go on with another number
def test_files_of_ranks_are_those_of_one_process_and_any_number_goes_on(tmp_path: Path) -> None:
    """Snapshots, recorded collisions, history, report; then two ranks, and one, go on from a checkpoint of three."""
    home = tmp_path
    (home / "case.toml").write_text(TEXT)
    assert cfddem("run", "case.toml", "-o", "one", folder=home).returncode == 0
    done = cfddem("run", "case.toml", "-o", "three", "--ranks", "3", folder=home)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("written to three") == 1 and "finished" in done.stdout
    assert_same_files(home / "one", home / "three")
    assert_same_particles(home / "one", home / "three")
    assert open_run(home / "three").about["provenance"]["ranks"] == 3
    for folder, ranks in (("one", "1"), ("three", "2")):
        done = cfddem("resume", folder, "--until", "0.012", "--ranks", ranks, "--log", "log.txt", folder=home)
        assert done.returncode == 0, done.stderr
    assert_same_particles(home / "one", home / "three")
    for folder in ("one", "three"):
        done = cfddem("resume", folder, "--until", "0.014", folder=home)
        assert done.returncode == 0, done.stderr
    assert_same_particles(home / "one", home / "three")
    assert_same_files(home / "one", home / "three")


def test_a_bed_on_ranks_is_that_of_one_process(tmp_path: Path) -> None:
    """Fluid, particles and history agree within the tolerance of the pressure; one process goes on from two."""
    (tmp_path / "bed.toml").write_text(BED)
    for folder, ranks in (("one", "1"), ("two", "2")):
        done = cfddem("run", "bed.toml", "-o", folder, "--ranks", ranks, folder=tmp_path)
        assert done.returncode == 0, done.stderr
        done = cfddem("resume", folder, "--until", "0.014", folder=tmp_path)
        assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "one/history.h5") as first, h5py.File(tmp_path / "two/history.h5") as second:
        assert first.keys() == second.keys()
        for column in set(first) - {"momentum_imbalance", "volume_imbalance"}:
            assert second[column][()] == pytest.approx(first[column][()], rel=1e-4, nan_ok=True), column
        imbalance = [second[f"{each}_imbalance"][1:].max() for each in ("momentum", "volume")]  # after the first step
        assert max(imbalance) < 1e-9
    names = [sorted(each.name for each in (tmp_path / folder / "data").iterdir()) for folder in ("one", "two")]
    assert names[0] == names[1]
    last = [tmp_path / folder / "data" / names[0][-1] for folder in ("one", "two")]
    with h5py.File(last[0]) as first, h5py.File(last[1]) as second:
        for block in ("fluid", "particles"):
            assert first[block].keys() == second[block].keys()
        assert np.array_equal(first["particles/id"][()], second["particles/id"][()])
        moved = np.abs(second["particles/Points"][()] - first["particles/Points"][()])
        assert moved.max() < 1e-7  # single precision


def test_more_ranks_than_can_share_the_cells_are_refused(tmp_path: Path) -> None:
    """Before anything runs, once, with exit code 2; and a number of ranks that the launcher has not started."""
    (tmp_path / "bed.toml").write_text(BED)
    done = cfddem("run", "bed.toml", "-o", "run", "--ranks", "3", folder=tmp_path)
    assert done.returncode == 2 and done.stderr.count("ranks = 3: must be at most 2 x 1 x 2 for 6 x 3 x 8 cells") == 1
    assert not (tmp_path / "run").exists()
    done = subprocess.run(
        launch_command(2, [sys.executable, "-m", "cfddem", "run", "bed.toml", "--ranks", "3"]),
        env=environment() | {"PYTHONPATH": str(HERE.parent)}, cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2 and "--ranks = 3: must be 2" in done.stderr
    assert os.listdir(tmp_path) == ["bed.toml"]


def test_the_doctor_tries_two_ranks() -> None:
    """Messages, a sum, and a fluid step whose pressure is that of one process."""
    answer = _processes(quick=False)
    assert answer.ok, answer.text
    assert "between neighbours" in answer.text and "pressure as in one process" in answer.text
