"""Walls of a case inside a fluid: cells they close, the flow around them, feeds, and resumed runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from in_process_ranks import on_ranks
from test_case_walls import TETRAHEDRON, write_binary_stl

from cfddem.analysis.bed_laws import weight_over_floor
from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.features.feeds import Feeds
from cfddem.io import checkpoint
from cfddem.io.reading import open_run
from cfddem.preflight.summary import preflight
from cfddem.run.history import open_area, open_volume
from cfddem.run.runner import Run
from cfddem.run.simulation import Simulation

CONE = """
[fluid]
density = 1.2
viscosity = 1.8e-5

[material.bead]
density = 2500.0
youngs_modulus = 1e7
poisson = 0.25
restitution = 0.7
friction = 0.4

[column]
width = 0.04
height = 0.08
cell = 0.005

[bed]
diameter = 2e-3
count = 60
start = "suspended"
start_corner = [0.012, 0.012, 0.03]
start_size = [0.016, 0.016, 0.02]
inlet_velocity = 1.0

[[wall]]
shape = "cone"
point = [0.02, 0.02, 0.0]
radius = 0.008
top_radius = 0.02
length = 0.02
solid = "outside"

[laws]
lubrication = "none"
self_disturbance_correction = false

[run]
until = 0.01
"""
FED: dict[str, Any] = {
    "feed": [{"corner": [0.015, 0.015, 0.06], "size": [0.01, 0.01, 0.004], "rate": 4000.0, "velocity": [0, 0, -0.5]}],
    "outlet": [{"corner": [0.0, 0.0, 0.0], "size": [0.04, 0.04, 0.031]}],
    "wall.0.material": "bead",
}


def test_cells_outside_of_a_cone_are_solid_and_the_inlet_is_what_is_left() -> None:
    case = Case.from_text(CONE)
    grid = grid_of(case)
    x, y, z = grid.centres()
    across = np.hypot(x - 0.02, y - 0.02)
    assert np.array_equal(~grid.open, np.broadcast_to((z <= 0.02) & (across > 0.008 + 0.6 * z), grid.shape))
    rows = {row.name: row.value for row in preflight(case).rows}
    assert rows["wall 0: solid cells"] == (~grid.open).sum()
    simulation = Simulation(case)
    simulation.until(0.002)
    floor, lid = simulation.fluid.volume_flux(2)[0], simulation.fluid.volume_flux(2)[-1]
    assert floor[grid.open[0]] == pytest.approx(1.0) and not floor[~grid.open[0]].any()
    assert lid.sum() == pytest.approx(floor.sum(), rel=1e-6)
    assert not simulation.fluid.velocity[~grid.open][:, 2].any()


def test_floor_and_volume_are_those_of_the_open_cells() -> None:
    """Correlations for a bed on the whole floor are not compared."""
    case = Case.from_text(CONE)
    cells = grid_of(case).open
    assert open_area(case) == pytest.approx(0.005**2 * cells[0].sum())
    assert open_volume(case, 0.0, 0.08) == pytest.approx(0.005**3 * cells.sum())
    assert open_volume(case, 0.005, 0.0125) == pytest.approx(0.005**3 * (cells[1].sum() + 0.5 * cells[2].sum()))
    assert weight_over_floor(case) is None


def test_drag_beside_a_wall_that_moves_is_an_error_before_the_run() -> None:
    changes = {"laws.wall_drag": "nearest", "wall.0.solid": "none", "wall.0.velocity": [0.0, 0.0, 0.01]}
    found = {issue.key: issue for issue in preflight(Case.from_text(CONE, "cone.toml", changes)).issues}
    assert found["laws.wall_drag"].severity == "error" and "wall.0 moves" in str(found["laws.wall_drag"])
    assert "laws.wall_drag" not in {issue.key for issue in preflight(Case.from_text(CONE)).issues}


def test_a_closed_surface_in_a_fluid_is_solid_inside(tmp_path: Path) -> None:
    write_binary_stl(tmp_path / "part.stl", TETRAHEDRON)
    text = CONE.split("[[wall]]")[0] + '[[wall]]\nshape = "surface"\nfile = "part.stl"\nscale = 0.03\n'
    text += "point = [0.005, 0.005, 0.005]\n[run]\nuntil = 0.01\n"
    (tmp_path / "case.toml").write_text(text)
    grid = grid_of(Case.from_toml(tmp_path / "case.toml"))
    x, y, z = np.broadcast_arrays(*grid.centres())
    inside = (np.minimum(np.minimum(x, y), z) > 0.005) & (x + y + z < 0.045)
    assert np.array_equal(~grid.open, inside) and inside.sum() > 20
    write_binary_stl(tmp_path / "part.stl", TETRAHEDRON[1:] + 1e-3)
    found = preflight(Case.from_toml(tmp_path / "case.toml", {"run.until": 0.02})).issues
    assert [each.key for each in found if each.severity == "error"] == ["wall.0.solid"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"wall.0.velocity": [0.0, 0.0, 0.1]},
            "wall.0.solid = 'outside': must be none for a wall that leaves its place",
        ),
        ({**FED, "laws.added_mass": 0.5}, "laws.added_mass = 0.5: must be 0.0 where there is a feed in a fluid"),
    ],
    ids=str,
)
def test_what_a_fluid_cannot_have_is_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as refusal:
        Case.from_text(CONE, "c.toml", given)
    assert said in str(refusal.value)


@pytest.mark.parametrize(
    ("given", "severity", "said"),
    [
        ({"wall.0.spin": [0.0, 0.0, 1.0]}, "warning", "the fluid does not feel the motion"),
        ({"wall.0.point": [0.02, 0.02, 0.0605]}, None, ""),
        ({"wall.0.radius": 0.0, "wall.0.top_radius": 1e-3}, "error", "close the whole floor"),
        ({"wall.0.solid": "inside", "wall.0.radius": 1e-4, "wall.0.top_radius": 1e-4}, "warning", "closes no cell"),
    ],
    ids=str,
)
def test_the_pre_run_check_sees_walls_in_a_fluid(given: dict[str, Any], severity: str | None, said: str) -> None:
    found = [each for each in preflight(Case.from_text(CONE, "c.toml", given)).issues if each.key.startswith("wall")]
    assert [(each.severity, said in each.reason) for each in found] == ([] if severity is None else [(severity, True)])


def test_feeds_in_a_fluid_displace_none_and_resume_bit_for_bit(tmp_path: Path) -> None:
    """Beads that enter a liquid replace it: the flow hardly changes; a restored run has the same bits."""
    liquid = {"fluid.density": 1000.0, "fluid.viscosity": 1e-3, "bed.inlet_velocity": 0.0, "run.until": 0.02}
    straight = Simulation(Case.from_text(CONE, "c.toml", FED | liquid))
    fastest = []
    while straight.time < 0.006:
        straight.step()
        fastest.append(float(np.abs(straight.fluid.velocity).max()))
    assert straight.feature(Feeds).fed > 15
    through = 2e-3**3 * np.pi / 6.0 / straight.last_step / 0.005**2  # if one bead pushed the fluid out of one cell
    assert max(fastest) < 0.1 * through
    (tmp_path / "kept").mkdir()
    checkpoint.write(tmp_path / "kept", {"state": straight.checkpoint()})
    again = Simulation.restored(straight.case, checkpoint.newest(tmp_path / "kept")["state"])
    for each in (straight, again):
        each.until(0.012)
    assert np.array_equal(again.particles.position, straight.particles.position)
    assert np.array_equal(again.fluid.velocity, straight.fluid.velocity)
    Run.begin(straight.case, tmp_path / "run")
    solid = open_run(tmp_path / "run").fluid("solid")
    assert solid.any() and np.array_equal(solid > 0, ~grid_of(straight.case).open)
    now, then = again.feature(Feeds), straight.feature(Feeds)
    assert now.fed == then.fed > 30 and now.removed == then.removed


def test_two_ranks_share_walls_and_feeds_in_a_fluid() -> None:
    """Particles as in one process; the flow within rounding."""
    case = Case.from_text(CONE, "c.toml", FED)
    alone = Simulation(case)
    alone.until(0.002)

    def part(communicator: Any) -> tuple[np.ndarray, np.ndarray, int, np.ndarray]:
        simulation = Simulation(case, communicator=communicator)
        simulation.until(0.002)
        owned = simulation.owned
        return owned.id.copy(), owned.position.copy(), simulation.feature(Feeds).fed, simulation.fluid.whole("velocity")

    parts = on_ranks(2, part)
    ids = np.concatenate([each[0] for each in parts])
    places = np.concatenate([each[1] for each in parts])[np.argsort(ids)]
    assert {each[2] for each in parts} == {alone.feature(Feeds).fed} == {8}
    assert places == pytest.approx(alone.particles.position[np.argsort(alone.particles.id)], rel=1e-12)
    assert np.abs(parts[0][3] - alone.fluid.velocity).max() < 1e-12
