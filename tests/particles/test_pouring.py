"""Beds poured between walls: all spheres are inside, lie still, and the same seed gives the same bed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import call
from example_case import TEXT

from cfddem.backend.errors import InputError, RunFailed, RunStopped
from cfddem.case.materials import Material
from cfddem.case.schema import Case
from cfddem.io.reading import open_run
from cfddem.particles.initial.filling import loose_places
from cfddem.particles.initial.packing import from_table
from cfddem.particles.initial.pouring import AT_REST, Place, Spheres, poured_bed
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.walls.shapes import Cylinder, Plane
from cfddem.particles.walls.wall import Wall
from cfddem.run.initial_particles import in_the_box
from cfddem.run.runner import Run

GRAIN = Material(density=2500, youngs_modulus=10e6, poisson=0.25, restitution=0.7, friction=0.3)
DIAMETER = 1e-3
CUP = [Plane(), Cylinder(radius=4 * DIAMETER)]
AROUND, SIZE = (-4e-3, -4e-3, 0.0), (8e-3, 8e-3, 5e-3)


@pytest.mark.parametrize("sizes", [np.array([1.0]), np.array([1.0, 0.45, 0.2])], ids=["equal", "three sizes"])
def test_spheres_start_apart_and_inside(sizes: np.ndarray) -> None:
    """No two spheres touch, and none touches a wall; small ones share the place of a large one."""
    diameters = from_table(300, DIAMETER * sizes, np.ones(len(sizes)), seed=1)
    places = loose_places(diameters, CUP, AROUND, SIZE, seed=2)
    radius = 0.5 * diameters
    assert (np.hypot(places[:, 0], places[:, 1]) + radius < 4e-3).all()
    assert (places[:, 2] > radius).all()
    apart = np.linalg.norm(places[:, None] - places[None], axis=2) + np.eye(300)
    assert (apart > radius[:, None] + radius[None]).all()
    assert np.array_equal(places, loose_places(diameters, CUP, AROUND, SIZE, seed=2))


def test_box_without_room_is_refused() -> None:
    """Too narrow for a sphere, or closed above before all spheres are in."""
    with pytest.raises(InputError, match=r"size\[0\]"):
        loose_places(np.full(3, 1e-2), CUP, AROUND, SIZE, seed=1)
    lid = [*CUP, Plane(point=(0.0, 0.0, 3e-3), normal=(0.0, 0.0, -1.0))]
    with pytest.raises(InputError, match="places for the largest sphere"):
        loose_places(np.full(300, DIAMETER), lid, AROUND, SIZE, seed=1)


def test_bed_in_a_cup_lies_still() -> None:
    """Below the stated limit without damping; the largest overlap is that of the contacts."""
    bed = poured_bed(Spheres(pair_table([GRAIN]), np.full(200, DIAMETER), 2500.0), Place(CUP, AROUND, SIZE), seed=1)
    position = bed.particles.position
    assert bed.energy < AT_REST
    assert 0.0 < bed.largest_overlap < 0.01
    assert (np.hypot(position[:, 0], position[:, 1]) < 3.5e-3 * (1.0 + bed.largest_overlap)).all()
    assert np.array_equal(bed.particles.id, np.arange(200))
    weight = 9.81 * bed.particles.mass.sum()
    assert -bed.run.wall_force[:, 2].sum() == pytest.approx(weight, rel=1e-2)


def test_walls_that_move_later_are_at_rest_while_a_bed_is_poured() -> None:
    """A belt under the bed does not carry it away."""
    belt: list[Wall] = [Plane(velocity=(1.0, 0.0, 0.0)), CUP[1]]
    bed = poured_bed(Spheres(pair_table([GRAIN]), np.full(30, DIAMETER), 2500.0), Place(belt, AROUND, SIZE), seed=1)
    assert not bed.run.walls.velocity.any()


def test_a_shallow_bed_on_a_wide_floor_comes_to_rest() -> None:
    """Nothing slows a sphere that rolls on a flat floor; particles that roll in balance do not keep a bed from rest."""
    width = 14 * DIAMETER
    sides: list[Wall] = [Plane(), Plane(normal=(1.0, 0.0, 0.0)), Plane(normal=(0.0, 1.0, 0.0))]
    sides += [
        Plane(point=(width, 0.0, 0.0), normal=(-1.0, 0.0, 0.0)),
        Plane(point=(0.0, width, 0.0), normal=(0.0, -1.0, 0.0)),
    ]
    bed = poured_bed(
        Spheres(pair_table([GRAIN]), np.full(120, DIAMETER), 2500.0),
        Place(sides, (0.0, 0.0, 0.0), (width, width, 0.02)),
        seed=1,
    )
    assert bed.energy < AT_REST
    assert bed.particles.position[:, 2].max() < 2.0 * DIAMETER


def test_the_energy_of_a_fall_from_above_the_floor_counts_all_of_it() -> None:
    """Spheres start in a box of 5 mm, 0.2 m above their cup: no more than the energy of that fall is ever left."""
    left: list[float] = []
    high = (-4e-3, -4e-3, 0.2)
    bed = poured_bed(Spheres(pair_table([GRAIN]), np.full(30, DIAMETER), 2500.0), Place(CUP, high, SIZE), seed=1,
        progress=lambda _, share: left.append(share),
    )  # fmt: skip
    assert 0.5 < max(left) <= 1.0 + 1e-9
    assert bed.particles.position[:, 2].max() < 4.0 * DIAMETER


DRY = """
title = "Dry spheres"
material.glass = { density = 2500.0, youngs_modulus = 1.0e7, poisson = 0.25, restitution = 0.9, friction = 0.3 }
column = { width = 0.05, height = 0.1, cell = 0.005 }
bed = { diameter = 2.0e-3, count = 300, seed = 1 }
run = { until = 1.0e-3, every = 5.0e-4 }
"""


@pytest.mark.parametrize(("count", "width"), [(300, 0.05), (3000, 0.2)], ids=["shallow", "wide"])
def test_shallow_beds_without_a_fluid_run(count: int, width: float, tmp_path: Path) -> None:
    """`cfddem run`: 300 spheres, or 3 000 in a wide column, cover a part of the floor; they rest before the run."""
    (tmp_path / "dry.toml").write_text(DRY)
    words = ("--set", f"bed.count={count}", "--set", f"column.width={width}")
    done = call("run", str(tmp_path / "dry.toml"), "-o", str(tmp_path / "run"), *words)
    assert done.code == 0, done.err
    assert open_run(tmp_path / "run").history["largest_speed"].max() < 1e-4


def test_a_bed_that_does_not_rest_names_what_a_case_can_change() -> None:
    with pytest.raises(RunFailed) as refused:
        poured_bed(
            Spheres(pair_table([GRAIN]), np.full(200, DIAMETER), 2500.0), Place(CUP, AROUND, SIZE), seed=1, patience=0.5
        )
    message = str(refused.value)
    assert "limit 3e-08" in message and "laws.rolling_resistance" in message and "bed.start" in message
    assert "patience" not in message


def test_particles_poured_across_a_periodic_side_are_brought_back() -> None:
    """A position beyond a periodic side, be it by round-off, is the same place within the column."""
    case = Case.from_text(TEXT).with_(**{"column.sides": "periodic"})
    width = case.column.width
    places = np.array([[-5.8e-8, 0.5 * width, 1e-3], [1.25 * width, width, 2e-3], [0.3 * width, -0.0, 3e-3]])
    inside = in_the_box(places, case)
    assert ((inside >= 0.0) & (inside <= width)).all()
    assert np.allclose(
        inside, [[width - 5.8e-8, 0.5 * width, 1e-3], [0.25 * width, 0.0, 2e-3], [0.3 * width, 0.0, 3e-3]]
    )
    assert np.array_equal(in_the_box(places, Case.from_text(TEXT)), places)


def test_ctrl_c_while_a_bed_is_poured_leaves_a_message_and_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("cfddem.run.build.particles_of", interrupted)
    with pytest.raises(RunStopped, match="before the first step; the same command begins anew"):
        Run.begin(Case.from_text(TEXT), tmp_path / "run")
    assert not (tmp_path / "run").exists()
    stopped = call("run", "spouted-bed", "-o", str(tmp_path / "spout"))
    assert stopped.code == 130
    assert (
        stopped.err.splitlines()[-1] == "cfddem: stopped by SIGINT before the first step; the same command begins anew"
    )
    assert not (tmp_path / "spout").exists()
