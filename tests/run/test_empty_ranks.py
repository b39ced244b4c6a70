"""Ranks without a particle: forces, feeds, snapshots, measures and checkpoints are those of one process."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from cluster import needs_mpi
from command_line import call, cfddem
from example_case import MIXTURE
from golden.beds import BEADS
from in_process_ranks import on_ranks
from test_coupling_ranks import ALL_FORCES, TIGHT, case_of

from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.portions import collected
from cfddem.fluid.pressure import ranks as shared
from cfddem.io.reading import open_run
from cfddem.particles import ghosts
from cfddem.run import history
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation

STEPS = 6
SMALL: dict[str, Any] = {
    "column__depth": 0.016, "column__cell": 0.002, "bed__count": None, "bed__start": "placed",
    "bed__initial_velocity": [0.3, 0.0, 0.0],
}  # fmt: skip
ALONE, THREE = [[0.0112, 0.008, 0.02]], [[0.002, 0.006, 0.02], [0.0055, 0.006, 0.02], [0.002, 0.010, 0.02]]
"""Near the lower end of x, across which space is divided; the second of three crosses the first border."""

EQUIPMENT = """
[[feed]]
corner = [0.017, 0.006, 0.030]
size = [0.005, 0.005, 0.005]
rate = 500.0
velocity = [0.0, 0.0, -0.1]
[[outlet]]
corner = [0.0, 0.0, 0.0]
size = [0.004, 0.016, 0.048]
"""
WET = """
[liquid]
viscosity = 5e-3
surface_tension = 0.02
pull = "pendular"
film = "deforming"
liquid_fraction = 0.002
[spray]
rate = 1e-7
drop_volume = 1e-12
zone = "box"
corner = [0.0, 0.0, 0.01]
size = [0.0112, 0.016, 0.02]
"""
GAS: dict[str, Any] = {
    "fluid__density": 1.13, "fluid__viscosity": 1.7e-5, "bed__inlet_velocity": 0.5, "laws__lubrication": "none",
    "laws__drag": "beetstra",
}  # fmt: skip

FEW = {
    "one bead with memory and all forces": case_of(
        BEADS, **SMALL, bed__positions=ALONE, laws__added_mass=0.5, laws__history="mei_adrian", run__energy_budget=True,
        laws__agitation="pseudo_turbulence", **ALL_FORCES,
    ),
    "three beads with a fluctuating force and drag beside walls": case_of(
        BEADS, **SMALL, bed__positions=THREE, laws__agitation="lattanzi", laws__surface="smeared",
        laws__wall_drag="nearest", laws__mapping="divided", laws__drag="beetstra_polydisperse",
    ),
    "feeds and outlets": case_of(
        BEADS + EQUIPMENT, **SMALL | {"bed__initial_velocity": [0.0, 0.0, 0.0]}, bed__positions=THREE
    ),
    "three wet beads under a spray": case_of(BEADS + WET, **SMALL | GAS, bed__positions=THREE),
    "no fluid": case_of(
        BEADS, **SMALL, bed__positions=ALONE, fluid=None, bed__inlet_velocity=0.0, run__record_collisions=True
    ),
    "two of a mixture": case_of(
        MIXTURE, bed__species__beads__count=1, bed__species__pellets__count=1, bed__start_corner=[0.0, 0.0, 0.001],
        bed__start_size=[0.012, 0.012, 0.006],
    ),
}  # fmt: skip


@pytest.fixture(autouse=True)
def _small_grids_are_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several levels of these small grids are divided, too; space is not cut anew, which would fill all ranks."""
    monkeypatch.setattr(shared, "SMALL", 100)
    monkeypatch.setattr(ghosts, "IMBALANCE", math.inf)


def after(
    steps: int, name: str, communicator: Communicator = SERIAL, state: dict[str, Any] | None = None
) -> tuple[dict[str, np.ndarray], dict[str, float], dict[str, Any], list[int]]:
    """Particles by id, a row of the history, a checkpoint, and the numbers of particles of this rank."""
    if communicator.size > 1 and "three" in name:  # beads that cross borders along x
        communicator.shape = (communicator.size, 1, 1)
    simulation = Simulation(FEW[name], communicator=communicator, state=state)
    if simulation.has_fluid:
        simulation.fluid.tolerance = TIGHT
    counts = [simulation.owned.count]
    for _ in range(steps):
        simulation.step()
        counts.append(simulation.owned.count)
    order = np.argsort(simulation.whole("id"))
    fields = {name: simulation.whole(name)[order] for name in ("id", "position", "velocity", "spin", "force")}
    return fields, history.row(simulation), collected(simulation.checkpoint(), communicator), counts


def assert_same(one: tuple[Any, ...], other: tuple[Any, ...]) -> None:
    """Particles and history to within the tolerance of the pressure."""
    for name, values in one[0].items():
        assert other[0][name] == pytest.approx(values, rel=1e-8, abs=1e-8 * np.abs(values).max()), name
    for name, value in one[1].items():
        if not name.endswith("imbalance"):
            assert other[1][name] == pytest.approx(value, rel=1e-6, abs=1e-12, nan_ok=True), name
        else:
            assert abs(other[1][name]) < 1e-8, name


@cache
def in_one_process(name: str) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Particles and a row of the history after all steps."""
    return after(STEPS, name)[:2]


@pytest.mark.parametrize(
    ("name", "ranks"),
    [pytest.param(name, 2, marks=[pytest.mark.slow] * ("fluctuating" in name)) for name in FEW]
    + [pytest.param(name, 3, marks=[pytest.mark.slow] * ("mixture" not in name)) for name in FEW],
)
def test_ranks_without_a_particle_share_a_case(name: str, ranks: int) -> None:
    """Against one process, and half the way each on these ranks and on one."""
    alone = in_one_process(name)
    found = on_ranks(ranks, lambda communicator: after(STEPS, name, communicator))
    assert any(0 in counts for *_, counts in found), "every rank has particles"
    assert "three" not in name or any(counts[0] != counts[-1] for *_, counts in found), "none changes its rank"
    for each in found:
        assert_same(alone, each)
    state = on_ranks(ranks, lambda communicator: after(STEPS // 2, name, communicator))[0][2]
    assert_same(alone, after(STEPS - STEPS // 2, name, state=state))
    for each in on_ranks(ranks, lambda communicator: after(STEPS - STEPS // 2, name, communicator, state)):
        assert_same(alone, each)


def test_a_folder_of_ranks_without_a_particle_is_that_of_one_process(tmp_path: Path) -> None:
    """Snapshots and history; begun on two ranks, resumed on three."""
    case = FEW["one bead with memory and all forces"].with_(
        **{"run.until": 0.004, "run.every": 0.002, "run.history_every": 0.001}
    )
    Run.begin(case, tmp_path / "one").go()
    Run.resume(tmp_path / "one", until=0.006).go()
    on_ranks(2, lambda communicator: Run.begin(case, tmp_path / "many", communicator=communicator).go())
    on_ranks(3, lambda communicator: Run.resume(tmp_path / "many", until=0.006, communicator=communicator).go())
    one, many = open_run(tmp_path / "one"), open_run(tmp_path / "many")
    assert many.status == "finished" and len(many.snapshots) == len(one.snapshots) == 4
    for column, values in one.history.items():
        if not column.endswith("imbalance"):
            assert many.history[column] == pytest.approx(values, rel=1e-4, abs=1e-9, nan_ok=True), column
    for name in sorted(each.name for each in (tmp_path / "one" / "data").iterdir()):
        with h5py.File(tmp_path / "one/data" / name) as first, h5py.File(tmp_path / "many/data" / name) as second:
            for field in first["particles"]:
                values = first["particles"][field][()]
                assert second["particles"][field][()] == pytest.approx(values, rel=1e-4, abs=1e-9), field


FEED = "\n[[feed]]\ncorner = [0.002, 0.002, 0.03]\nsize = [0.005, 0.005, 0.005]\nrate = 1500.0\n"


@needs_mpi
@pytest.mark.slow
@pytest.mark.parametrize(("more", "fed"), [("", 0), (FEED, 3)], ids=["one bead", "with a feed"])
def test_settling_runs_on_two_ranks(tmp_path: Path, more: str, fed: int) -> None:
    """The case of the gallery, one bead; the same with a feed, which begins on a rank without a particle."""
    assert cfddem("new", "settling", folder=tmp_path).returncode == 0
    (tmp_path / "settling.toml").write_text((tmp_path / "settling.toml").read_text() + more)
    words = ["settling.toml", "--ranks", "2", "--set", "run.until=0.002", "-o", "two"]
    if fed:  # the added mass and the history force need the past of a particle
        words += ["--set", "laws.added_mass=0", "--set", "laws.history=none"]
    done = cfddem("run", *words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    run = open_run(tmp_path / "two")
    assert run.status == "finished" and run.history["particle_count"][-1] == 1.0 + fed
    assert cfddem("resume", "two", "--until", "0.003", "--ranks", "3", folder=tmp_path).returncode == 0


@pytest.mark.parametrize("ranks", [2, 3])
def test_check_says_that_ranks_hold_no_particle(ranks: int) -> None:
    done = call("check", "settling", "--ranks", str(ranks))
    assert done.code == 0 and "ok: no errors" in done.out
    assert "can share the case; some hold no particle" in " ".join(done.out.split())
