"""Vessels of a case from surface files, and boxes: one surface for particles and fluid; one line for what is none."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import call
from example_case import GLASS
from test_case_walls import write_binary_stl
from test_check_of_vessels import revolved

from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.case.vessel import start_box, vessel_of
from cfddem.fluid.cut_cells import open_share
from cfddem.io.folder import keep_files, text_with_kept_files
from cfddem.particles.initial.filling import clear_of_walls
from cfddem.particles.state import make_particles
from cfddem.particles.walls.arrays import near_walls, wall_arrays
from cfddem.preflight.summary import preflight
from cfddem.run.build import laws_of, materials_of, walls_of
from cfddem.run.initial_particles import particles_of

TEXT = (
    """
[fluid]
density = 1.2
viscosity = 1.8e-5

[column]
width = 0.04
height = 0.08
cell = 0.004

[vessel]
shape = "surface"
file = "part.stl"

[bed]
diameter = 1.6e-3
count = 300
start = "suspended"
inlet_velocity = 0.5

[run]
until = 0.01
reference_speed = 0.5
"""
    + GLASS
)

CONE = [(0.008, 0.0), (0.018, 0.05), (0.018, 0.08)]
"""Radii and heights of the rings of a cone below a cylinder, whose ends are floor and lid of the column [m]."""


def outwards(corners: np.ndarray) -> np.ndarray:
    """Triangles of a closed surface with their normals outwards."""
    volume = np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return corners if volume > 0.0 else corners[:, ::-1]


def cone() -> np.ndarray:
    return outwards(revolved(CONE))


def made(folder: Path, corners: np.ndarray | None = None, **given: Any) -> Case:
    write_binary_stl(folder / "part.stl", cone() if corners is None else corners)
    (folder / "case.toml").write_text(TEXT)
    return Case.from_toml(folder / "case.toml", {key.replace("__", "."): value for key, value in given.items()})


def box(**given: Any) -> Case:
    vessel = {"shape": "box", "size": [0.02, 0.012]} | given
    return Case.from_text(TEXT, "c.toml", {"vessel": vessel})


# ---------------------------------------------------------------- one surface for particles and fluid


def test_floor_and_lid_of_a_surface_have_their_own_areas_and_a_mass_flow_the_speed_of_its_side(tmp_path):
    """Polygons of the file's sides within circles of 8 and 18 mm, 5 times as much."""
    lid = {"kind": "inlet", "side": "lid", "mass_flow": 0.001}
    case = made(tmp_path, patch={"drain": {"kind": "outlet"}, "top": lid})
    assert case.area_of("lid") / case.area_of("floor") == pytest.approx((18.0 / 8.0) ** 2, rel=1e-4)
    assert case.area_of("lid") == pytest.approx(math.pi * 0.018**2, rel=0.03)
    assert case.patches["top"].highest == pytest.approx(0.001 / 1.2 / case.area_of("lid"), rel=1e-9)


def test_a_cone_from_a_file_is_the_cone_of_a_line(tmp_path: Path) -> None:
    """Open shares of cells, volume of the bed and area of the floor, within those of a polygon of 48 sides."""
    drawn = made(tmp_path)
    line = [[height, radius] for radius, height in CONE]
    round_one = Case.from_text(TEXT, "c.toml", {"vessel": {"shape": "chain", "line": line}})
    shares = [np.asarray(open_share(grid_of(each)), float) for each in (drawn, round_one)]
    lack = (2.0 * math.pi / 48) ** 2 / 6.0
    assert shares[0].sum() == pytest.approx(shares[1].sum() * (1.0 - lack), rel=1e-3)
    assert np.abs(shares[0] - shares[1]).max() < 0.02
    assert drawn.floor_area == pytest.approx(round_one.floor_area * (1.0 - lack), rel=1e-3)
    volumes = [vessel_of(each).volumes[-1] for each in (drawn, round_one)]
    assert volumes[0] == pytest.approx(volumes[1], rel=0.02)


def test_vessels_without_a_line_have_the_reference_speed_of_a_box(tmp_path: Path) -> None:
    """Where the case gives none; a turning round wall has that of its rim."""
    for case in (made(tmp_path, run__reference_speed=None), box().with_(**{"run.reference_speed": None})):
        assert case.reference_speed == pytest.approx(2.0 * 0.5)
        assert not [each for each in preflight(case).issues if each.severity == "error"]


def test_particles_and_fluid_are_as_far_from_the_surface(tmp_path: Path) -> None:
    """A sphere that just reaches the surface of the fluid touches the wall of the particles, and no smaller one."""
    case = made(tmp_path)
    wall = wall_arrays(walls_of(case)[2:3])
    places = np.random.default_rng(2).uniform([0.01, 0.01, 0.005], [0.03, 0.03, 0.075], (400, 3))
    away = -case.beyond_the_side(places)
    places, away = places[away > 1e-4], away[away > 1e-4]
    touching = near_walls(make_particles(places, away * (1.0 + 1e-6), 1.0), wall, 0.0, 0.0)[0]
    assert set(touching) == set(range(len(places)))
    assert not len(near_walls(make_particles(places, away * (1.0 - 1e-6), 1.0), wall, 0.0, 0.0)[0])


def test_particles_start_inside_of_a_surface_or_box_and_clear_of_it(tmp_path: Path) -> None:
    for case in (made(tmp_path), box(turn=30.0), made(tmp_path, bed__start="poured", bed__inlet_velocity=0.0)):
        corner, size = start_box(case)
        ends = np.array(np.meshgrid(*([low, low + edge] for low, edge in zip(corner[:2], size[:2])), 0.07)).reshape(
            3, -1
        )
        assert (case.beyond_the_side(ends.T) < 1e-3).all()
        walls = walls_of(case)
        spheres = particles_of(case, materials_of(case), walls, laws_of(case))
        assert (case.beyond_the_side(spheres.position, 0.8e-3) <= 0.02 * 0.8e-3).all()
        if case.bed.start == "suspended":
            assert clear_of_walls(spheres.position, 0.8e-3 * (1.0 - 1e-6), walls).all()


def test_a_turned_box_has_its_area_and_its_cells() -> None:
    case = box(turn=30.0)
    assert case.floor_area == pytest.approx(0.02 * 0.012)
    assert open_share(grid_of(case)).sum() * grid_of(case).cell_volume == pytest.approx(0.02 * 0.012 * 0.08, rel=5e-3)
    assert not [each for each in preflight(case).issues if each.severity == "error"]


@pytest.mark.parametrize("ending", [".ply", ".vtp"])
def test_a_vessel_may_be_in_other_formats_and_in_millimetres(tmp_path: Path, ending: str) -> None:
    """It is that of the STL file; a run folder has its copy."""
    import pyvista

    corners = cone()
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    surface = pyvista.PolyData.from_regular_faces(1e3 * corners.reshape(-1, 3), faces).clean()
    surface.save(tmp_path / f"part{ending}")
    case = made(tmp_path, vessel__file=f"part{ending}", vessel__scale=1e-3)
    assert case.floor_area == pytest.approx(made(tmp_path).floor_area, rel=1e-5)
    keep_files(case, tmp_path)
    assert (tmp_path / "surfaces" / f"vessel{ending}").is_file()
    assert f'file = "surfaces/vessel{ending}"' in text_with_kept_files(case)


def test_check_draws_a_surface_vessel(tmp_path: Path) -> None:
    made(tmp_path)
    drawn = call("check", str(tmp_path / "case.toml"), "--picture", str(tmp_path / "case.png"))
    assert drawn.code == 0 and (tmp_path / "case.png").stat().st_size > 5000
    assert "cells cut by the vessel" in drawn.out


# ---------------------------------------------------------------- what is no vessel


@pytest.mark.parametrize(
    ("surface", "given", "said"),
    [
        (cone()[1:], {}, r"vessel.file.*3 edges have not, one at .* close the holes"),
        (cone()[:, ::-1], {}, r"vessel.file.*inside out; reverse its triangles"),
        (np.concatenate([cone(), np.add(0.5 * cone()[:, ::-1], [0.02, 0.01, 0.03])]), {}, r"file.*not pass through"),
        (np.concatenate([cone(), np.add(0.5 * cone(), [0.01, 0.01, 0.03])]), {}, r"vessel.file.*one vessel.*2 parts"),
        (1e3 * cone(), {}, r"vessel.scale.*1e\+03 times its size;? scale = 0.001 reads a file in millimetres"),
        (np.add(cone(), [0.01, 0.0, 0.0]), {}, r"vessel.point.*lies in the column.*move it, or widen the column"),
        (np.add(cone(), [0.0, 0.0, 0.004]), {}, r'column.ends.*does not reach from the floor.*from 0.004 to 0.084 m'),
        (None, {"vessel.file": "none.stl"}, r"vessel.file.*none.stl'.*a readable surface file"),
        (None, {"vessel.file": "part.step"}, r"vessel.file.*part.step'.*must be a surface file, \*.stl, \*.ply or"),
        (None, {"vessel.spin": 3.0}, r'vessel.spin = 3.*left out for shape = .*"cylinder" or "cone" or "chain"'),
        (None, {"vessel.radius": 0.01}, r'vessel.radius = 0.01.*left out for shape = "surface"'),
        (None, {"vessel": {"shape": "box", "size": [0.05, 0.01]}}, r"vessel.size = .*within the column, 0.04 m by"),
        (None, {"vessel": {"shape": "box"}}, r'vessel.size: must be given for shape = "box"'),
        (None, {"column.ends": "periodic"}, r"column.ends.*not upright"),
    ],
    ids=["hole", "inside out", "crossing", "nested", "mm", "beyond", "raised", "missing", "format", "spin", "radius",
         "wide", "no size", "periodic"],
)  # fmt: skip
def test_what_is_no_vessel_is_refused_in_a_line(tmp_path: Path, surface: Any, given: Any, said: str) -> None:
    """By the check, or already when the case is read; a run says the same."""
    try:
        case = made(tmp_path, surface, **given)
        (error,) = [each for each in preflight(case).issues if each.severity == "error"]
        words = f"{error.key}: {error.reason} {error.remedy}"
        with pytest.raises(InputError, match=said):
            grid_of(case)
    except InputError as refusal:
        words = str(refusal)
    assert re.search(said, words) and len(words) < 400, words


def test_the_commands_say_it_in_a_line(tmp_path: Path) -> None:
    made(tmp_path, cone()[1:])
    for words in (("check",), ("run", "-o", str(tmp_path / "out"))):
        answer = call(words[0], str(tmp_path / "case.toml"), *words[1:])
        said = " ".join((answer.out + answer.err).split())
        assert answer.code == 2 and "close the holes" in said and "Traceback" not in said
