"""A tiny coupled run that is killed repeatedly at random instants, and comparisons of its end.

`python tests/disturbed_runs.py 100` kills it a hundred times, which takes a quarter of an hour, mostly to start
processes. `python tests/disturbed_runs.py 20 hot` takes another of `CASES`.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from cfddem import open_run
from cfddem.case.schema import Case
from cfddem.io import checkpoint
from cfddem.run.runner import Run

TINY = """
title = "Glass beads that sink in water"
[fluid]
density = 1000.0
viscosity = 2e-3
[material.glass]
density = 2500.0
youngs_modulus = 60e9
contact_modulus = 2e6
poisson = 0.25
restitution = 0.9
friction = 0.3
friction_lubricated = 0.1
roughness = 1e-6
[column]
width = 0.012
height = 0.018
cell = 0.003
[bed]
diameter = 2e-3
count = 160
start = "suspended"
inlet_velocity = 0.02
[run]
until = 0.024
every = 0.004
history_every = 0.001
reference_speed = 0.1
record_collisions = true
"""
"""It has films from the start and contacts after a few milliseconds, and takes a second."""

GAS = (
    TINY.replace("density = 1000.0", "density = 1.2", 1)
    .replace("viscosity = 2e-3", "viscosity = 1.8e-5", 1)
    .replace("inlet_velocity = 0.02", "inlet_velocity = 0.8")
    + """
particle_step = 1e-5
[laws]
drag = "beetstra"
lubrication = "none"
self_disturbance_correction = false
"""
)
"""Dry beads in air."""

WET = (
    GAS
    + """
[liquid]
viscosity = 5e-3
surface_tension = 0.02
liquid_fraction = 1e-3
wall_share = 0.5
wall_thickness = 1e-6
[spray]
rate = 1e-7
drop_volume = 1e-13
zone = "box"
corner = [0.0, 0.0, 0.009]
size = [0.012, 0.012, 0.009]
"""
)
"""Wet beads in air under a spray: bridges form and break, walls carry liquid."""

HOT = (
    WET
    + """
[heat]
particle_temperature = 316.0
fluid_temperature = 316.0
inlet_temperature = 343.15
conductivity = 0.028
fluid_heat_capacity = 1010.0
heat_capacity = { glass = 840.0 }
solid_conductivity = { glass = 1.0 }
spray_temperature = 298.0
[vapour]
fluid_fraction = 0.007
diffusivity = 2.9e-5
[evaporation]
full_thickness = 5.0e-6
"""
)
"""The same under hot air, which takes up the water."""

CASES = {"liquid": TINY, "gas": GAS, "wet": WET, "hot": HOT}
"""Cases by the words of the command line."""


def same_state(left: Path, right: Path) -> None:
    """The last checkpoints are equal bit for bit."""

    def compare(one: dict, other: dict, where: str) -> None:
        assert one.keys() == other.keys(), where
        for name, value in one.items():
            if isinstance(value, dict):
                compare(value, other[name], f"{where}.{name}")
            elif isinstance(value, np.ndarray):
                assert value.dtype == other[name].dtype and value.tobytes() == other[name].tobytes(), f"{where}.{name}"
            else:
                assert value == other[name], f"{where}.{name}"

    compare(checkpoint.newest(left)["simulation"], checkpoint.newest(right)["simulation"], "state")


def same_record(left: Path, right: Path) -> None:
    """Snapshots, history and collisions are equal, value by value."""
    one, other = open_run(left), open_run(right)
    assert one.times.tolist() == other.times.tolist() and one.steps.tolist() == other.steps.tolist()
    for place in range(len(one.times)):
        for name in one.fluid_fields:
            assert np.array_equal(one.fluid(name, place), other.fluid(name, place)), (place, name)
        fields, others = one.particles(place), other.particles(place)
        for name in fields:
            assert np.array_equal(fields[name], others[name]), (place, name)
    for columns, twins in ((one.history, other.history), (one.collisions, other.collisions)):
        assert columns.keys() == twins.keys()
        for name in columns:
            assert np.array_equal(columns[name], twins[name], equal_nan=True), name


def long_enough(kills: int, case: str = TINY) -> str:
    """The case with an end late enough for so many kills."""
    return case.replace("until = 0.024", f"until = {0.012 * kills:g}").replace("every = 0.004", "every = 0.002", 1)


def kill_and_go_on(folder: Path, kills: int, seed: int, case: str = TINY) -> int:
    """Kill a run at random instants, every other time while it loads, resume it after each, and at last let it finish.

    After every kill the folder can be opened and is complete up to its last snapshot.

    returns  number of kills before the run finished
    """
    run, instants, hits = folder / "run", random.Random(seed), 0
    (folder / "case.toml").write_text(long_enough(kills, case))
    for number in range(kills):
        process = _started(folder)
        if number % 2:
            time.sleep(instants.uniform(0.0, 3.0))
        else:
            before = _snapshots(run)
            while process.poll() is None and _snapshots(run) <= before:
                time.sleep(0.002)
            time.sleep(instants.uniform(0.0, 0.25))
        process.kill()
        _, said = process.communicate(timeout=900)
        if process.returncode != -signal.SIGKILL:
            assert process.returncode == 0, said
            return hits
        hits += 1
        if (run / "run.json").exists():
            seen = open_run(run)
            assert not seen.missing
            assert len(seen.history.get("time", ())) >= len(seen.times)
            for place in range(len(seen.times)):
                assert np.isfinite(seen.particles(place)["position"]).all()
    process = _started(folder)
    _, said = process.communicate(timeout=1800)  # also on a busy machine
    assert process.returncode == 0, said
    return hits


def _started(folder: Path) -> subprocess.Popen[str]:
    """Start or resume the run in a separate process."""
    begun = (folder / "run" / "run.json").exists()
    words = ["resume", "run"] if begun else ["run", "case.toml", "-o", "run"]
    command = [sys.executable, "-m", "cfddem", *words]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def _snapshots(run: Path) -> int:
    """Number of the last snapshot; a resumed run first drops snapshots after its checkpoint."""
    return max((int(each.stem) for each in (run / "data").glob("[0-9]*.h5")), default=-1)


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    case = CASES[sys.argv[2]] if len(sys.argv) > 2 else TINY
    with tempfile.TemporaryDirectory() as place:
        disturbed, whole = Path(place) / "disturbed", Path(place) / "whole"
        disturbed.mkdir()
        hit = kill_and_go_on(disturbed, count, count, case)
        Run.begin(Case.from_text(long_enough(count, case)), whole).go()
        same_state(disturbed / "run", whole)
        same_record(disturbed / "run", whole)
        print(f"killed {hit} times; the end is equal bit for bit")
