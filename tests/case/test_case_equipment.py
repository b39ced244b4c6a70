"""Runs with walls, feeds and outlets of a case: they do what they say, resume bit for bit, and run on ranks."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from in_process_ranks import on_ranks
from test_case_walls import HOPPER, TETRAHEDRON, write_binary_stl

from cfddem.analysis import measures
from cfddem.analysis.report import report
from cfddem.backend.errors import InputError, RunFailed
from cfddem.case.schema import Case
from cfddem.features.feeds import Feeds
from cfddem.io import checkpoint
from cfddem.io.reading import open_run
from cfddem.run.history import bed_height, bed_solids
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation

FULL = (
    HOPPER
    + """
[[wall]]
shape = "surface"
file = "parts/tip.stl"
scale = 0.01
point = [0.025, 0.025, 0.005]
velocity = [0.1, 0.0, 0.0]
begin = 0.005
end = 0.02

[[wall]]
shape = "plane"
point = [0.0, 0.0, 0.001]
amplitude = [0.0, 0.0, 5e-4]
frequency = 100.0
"""
)
SOON: dict[str, Any] = {
    "run.until": 0.04, "bed.initial_velocity": [0.0, 0.0, -1.0], "run.reference_speed": 2.0,
    "outlet.0.size": [0.06, 0.06, 0.085],
}  # fmt: skip


def full_case(folder: Path, **more: Any) -> Case:
    (folder / "parts").mkdir(parents=True, exist_ok=True)
    write_binary_stl(folder / "parts" / "tip.stl", TETRAHEDRON)
    (folder / "h.toml").write_text(FULL)
    return Case.from_toml(folder / "h.toml", SOON | more)


def state(simulation: Simulation) -> dict[str, np.ndarray]:
    """Everything that must be the same, particles in the order of ids."""
    particles = simulation.owned
    order = np.argsort(particles.id)
    found = {name: particles[name][order] for name in ("id", "position", "velocity", "spin", "radius", "force")}
    walls = simulation.particle_solver.walls
    counts = [simulation.feature(Feeds).fed, simulation.feature(Feeds).waiting, *simulation.feature(Feeds).removed]
    return found | {"walls": walls.shift.copy(), "turned": walls.turned.copy(), "counts": np.array(counts)}


def same(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> bool:
    return all(np.array_equal(array, other[name]) for name, array in one.items())


def test_feed_outlet_and_moving_walls_do_what_the_case_says(tmp_path: Path) -> None:
    simulation = Simulation(full_case(tmp_path))
    simulation.until(0.04)
    equipment, walls = simulation.feature(Feeds), simulation.particle_solver.walls
    assert equipment.fed + equipment.waiting == int(400.0 * 0.04)
    left, mass = equipment.removed
    assert left > 0 and mass == pytest.approx(left * 2500.0 * np.pi / 6.0 * 4e-3**3)
    assert simulation.particles.count == 100 + equipment.fed - left
    flying = simulation.particles.landed == 0  # neither in the height nor in the volume of the bed
    assert 0 < flying.sum() < equipment.fed
    assert bed_height(simulation) < measures.bed_height(simulation.particles.position, simulation.particles.radius)
    assert bed_solids(simulation) == pytest.approx(simulation.particles.volume[~flying].sum(), rel=1e-12)
    assert walls.shift[-2] == pytest.approx([0.1 * 0.015, 0.0, 0.0])
    assert walls.shift[-1] == pytest.approx([0.0, 0.0, 5e-4 * np.sin(2.0 * np.pi * 4.0)], abs=1e-15)
    simulation.until(0.0425)
    assert walls.shift[-1][2] == pytest.approx(5e-4, rel=1e-9)
    assert simulation.limiting in ("wall oscillation", "collision")


def test_a_run_resumes_bit_for_bit_without_its_surface_file(tmp_path: Path) -> None:
    """The folder has a copy of the file; feeds, outlets and walls continue as if never stopped."""
    straight = Run.begin(full_case(tmp_path / "a"), tmp_path / "straight")
    straight.go()
    text = (tmp_path / "a" / "h.toml").read_text()
    stopped = Run.begin(full_case(tmp_path / "a"), tmp_path / "stopped", text=text)
    shutil.rmtree(tmp_path / "a")
    assert (tmp_path / "stopped" / "surfaces" / "wall_2.stl").is_file()
    for time in (0.008, 0.016, 0.024):
        stopped.simulation.until(time)
    restored = checkpoint_through_a_file(stopped.simulation, tmp_path / "kept")
    restored.until(0.032)
    restored.until(0.04)
    for time in (0.008, 0.016, 0.024, 0.032, 0.04):
        stopped.simulation.until(time)
    assert same(state(restored), state(stopped.simulation))
    (tmp_path / "straight").rename(tmp_path / "moved")
    assert 'file = "surfaces/wall_2.stl"' in (tmp_path / "moved" / "case.toml").read_text()
    again = Run.resume(tmp_path / "moved", until=0.044)
    assert Path(again.simulation.case.wall[2].file or "").parts[-2:] == ("surfaces", "wall_2.stl")
    again.go()
    run = open_run(tmp_path / "moved")
    assert run.status == "finished"
    found = report(run.folder)
    assert found.ledger["particles_lost"] == 0.0 and found.preflight["status"] != "error"
    (answer,) = (each for each in found.key_results if each.name == "particles")
    counts = (run.history[name][-1] for name in ("fed_count", "removed_count"))
    assert "100 at the start; {:.0f} fed".format(*counts) in answer.verdict and "removed" in answer.verdict
    surface = tmp_path / "moved" / "surfaces" / "wall_2.stl"
    surface.rename(tmp_path / "elsewhere.stl")
    surface.symlink_to(tmp_path / "elsewhere.stl")
    with pytest.raises(InputError, match="files outside of it are not read"):
        Run.resume(tmp_path / "moved", until=0.048)


def checkpoint_through_a_file(simulation: Simulation, folder: Path) -> Simulation:
    folder.mkdir()
    checkpoint.write(folder, {"simulation": simulation.checkpoint()})
    return Simulation.restored(simulation.case, checkpoint.newest(folder)["simulation"])


def test_ranks_share_a_case_with_walls_feeds_and_outlets(tmp_path: Path) -> None:
    """Two ranks give the bits of one."""
    case = full_case(tmp_path)
    alone = Simulation(case)
    alone.until(0.03)

    def part(communicator: Any) -> tuple[dict[str, np.ndarray], int]:
        simulation = Simulation(case, communicator=communicator)
        simulation.until(0.03)
        return state(simulation), simulation.steps

    parts = on_ranks(2, part)
    names = ("id", "position", "velocity", "spin", "radius", "force")
    joined = {name: np.concatenate([found[name] for found, _ in parts]) for name in names}
    order = np.argsort(joined["id"])
    expected = state(alone)
    for name in names:
        assert np.array_equal(joined[name][order], expected[name]), name
    for found, _ in parts:
        assert np.array_equal(found["counts"], expected["counts"]) and np.array_equal(found["walls"], expected["walls"])


def test_fed_particles_of_a_mixture_have_their_species() -> None:
    text = HOPPER.replace("diameter = 4e-3\ncount = 100\n", "").replace(
        "[[wall]]\nshape = \"cone\"",
        "[bed.species.large]\ndiameter = 4e-3\ncount = 60\n[bed.species.small]\ndiameter = 2e-3\ncount = 1\n"
        "[[wall]]\nshape = \"cone\"",
    ).replace("rate = 400.0", 'rate = 2000.0\nspecies = "small"')  # fmt: skip
    simulation = Simulation(Case.from_text(text, "h.toml", {"run.until": 0.01}))
    simulation.until(0.01)
    species = simulation.particles.species
    assert (species == 1).sum() == 1 + simulation.feature(Feeds).fed > 15
    assert simulation.particles.radius[species == 1] == pytest.approx(1e-3)


def test_walls_behind_which_particles_would_start_are_refused() -> None:
    text = HOPPER.replace('start = "suspended"', "positions = [[0.03, 0.03, 0.1], [0.0575, 0.03, 0.1]]")
    text = text.replace("count = 100\n", "").replace("start_corner = [0.015, 0.015, 0.09]\n", "")
    text = text.replace("start_size = [0.03, 0.03, 0.1]\n", "")
    Simulation(Case.from_text(text))
    with pytest.raises(InputError, match=r"position of particle 1: must be away from walls; .*wall.1"):
        Simulation(Case.from_text(text, "h.toml", {"wall.1.radius": 0.0265}))


def test_a_run_whose_last_particles_leave_says_so() -> None:
    fall = {"outlet.0.size": [0.06, 0.06, 0.17], "feed.0.begin": 0.1}
    simulation = Simulation(Case.from_text(HOPPER, "h.toml", fall))
    with pytest.raises(RunFailed, match="the last particles have reached outlet"):
        simulation.until(0.2)
