"""Walls, feeds and outlets in a case file: their keys, errors, and what the pre-run check says of them."""

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.case.walls import CaseWall
from cfddem.model.triangles import inside_surface
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.walls.meshes import read_stl
from cfddem.particles.walls.motion import Motion
from cfddem.preflight.summary import Preflight, preflight
from cfddem.run.initial_particles import particles_of

HOPPER = """
[material.bead]
density = 2500.0
youngs_modulus = 1e8
poisson = 0.25
restitution = 0.7
friction = 0.4

[column]
width = 0.06
height = 0.2
cell = 0.01

[bed]
diameter = 4e-3
count = 100
start = "suspended"
start_corner = [0.015, 0.015, 0.09]
start_size = [0.03, 0.03, 0.1]

[[wall]]
shape = "cone"
point = [0.03, 0.03, 0.04]
radius = 0.01
top_radius = 0.025
length = 0.03

[[wall]]
shape = "cylinder"
point = [0.03, 0.03, 0.069]
radius = 0.025
length = 0.131

[[feed]]
corner = [0.02, 0.02, 0.18]
size = [0.02, 0.02, 0.01]
rate = 400.0
velocity = [0.0, 0.0, -0.5]

[[outlet]]
corner = [0.0, 0.0, 0.0]
size = [0.06, 0.06, 0.03]

[run]
until = 0.2
"""

TETRAHEDRON = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])[
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
]


def write_text_stl(path: Path, corners: np.ndarray) -> Path:
    """An STL file in text form."""
    facets = "".join(
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {x} {y} {z}\n" for x, y, z in each)
        + " endloop\nendfacet\n"
        for each in corners
    )
    path.write_text(f"solid part\n{facets}endsolid part\n")
    return path


def cube() -> np.ndarray:
    """The triangles of a cube with edges of 1 (12, 3, 3)."""
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return corners[np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])]


def write_binary_stl(path: Path, corners: np.ndarray) -> Path:
    """An STL file in binary form."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    table = np.zeros(len(corners), record)
    table["corners"] = corners
    path.write_bytes(b"part".ljust(80) + len(corners).to_bytes(4, "little") + table.tobytes())
    return path


def made(text: str = HOPPER, **given: Any) -> Case:
    return Case.from_text(text, "h.toml", {name.replace("__", "."): value for name, value in given.items()})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"wall.0.top_radius": -1.0}, "--set wall.0.top_radius = -1.0: must be above 0"),
        ({"wall.1.radius": 0.0}, "--set wall.1.radius = 0.0: must be above 0"),
        ({"wall.1.top_radius": 0.01}, 'wall.1.top_radius = 0.01: must be left out for shape = "cylinder"'),
        ({"wall.0.shape": "surface"}, 'wall.0.length = 0.03: must be left out for shape = "surface"'),
        ({"wall.1.material": "steel"}, "wall.1.material = 'steel': must be one of bead"),
        ({"wall.1.axis": [0.0, 0.0, 0.0]}, "wall.1.axis = (0.0, 0.0, 0.0): must be a direction other than zero"),
        ({"wall.2.radius": 1.0}, "wall.2.radius = 1.0: must be written as wall.NUMBER.KEY with a number from 0 to 1"),
        ({"wall.1.amplitude": [0.0, 0.0, 1e-3]}, "h.toml:28: wall.1.frequency = 0.0: must be other than 0"),
        ({"wall.1.begin": 0.1}, "wall.1.begin = 0.1: must be left out for a wall at rest"),
        ({"wall.1.velocity": [1.0, 0.0, 0.0], "wall.1.begin": 0.2, "wall.1.end": 0.1}, "wall.1.end = 0.1"),
        ({"wall.1.solid": "inside"}, "wall.1.solid = 'inside': must be left out in a case without a fluid"),
        ({"fluid.density": 1.2, "fluid.viscosity": 1e-5}, "wall.0.solid: must be given in a case with a fluid"),
        ({"feed.0.mass_rate": 1.0}, "feed.0.rate = 400.0: must be given, or mass_rate, and only one of them"),
        ({"feed.0.end": 0.1, "feed.0.begin": 0.1}, "feed.0.end = 0.1: must be after the beginning, 0.1 s"),
        ({"feed.0.species": "bead"}, "feed.0.species = 'bead': must be left out for a bed of one species"),
        ({"outlet.0.size": [0.06, 0.06, 0.3]}, "must be inside the column, 0 to 0.06, 0.06, 0.2 m; the box ends at"),
        ({"bed.start_size": [0.06, 0.03, 0.1]}, "bed.start_corner = (0.015, 0.015, 0.09): must be inside the column"),
        ({"bed.start": "packed"}, "bed.start = 'packed': must be \"poured\", \"suspended\" or \"placed\" where walls"),
    ],
    ids=str,
)  # fmt: skip
def test_an_input_error_is_one_line_with_file_line_and_key(given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as refusal:
        Case.from_text(HOPPER, "h.toml", given)
    assert said in str(refusal.value) and "\n" not in str(refusal.value)


def test_the_line_of_a_table_among_several_is_named() -> None:
    with pytest.raises(InputError, match=r"^h.toml:31: wall.1.radius"):
        Case.from_text(HOPPER.replace("radius = 0.025\nlength = 0.131", "radius = -1.0\nlength = 0.131"), "h.toml")


def test_a_case_with_walls_survives_its_own_text_and_changes_by_number() -> None:
    case = made(wall__1__spin=[0.0, 0.0, 2.0])
    assert Case.from_text(case.to_toml()) == case
    assert case.with_(**{"wall.1.radius": 0.02}).wall[1].radius == 0.02
    assert case.reference_speed == 0.5, "the speed of the feed; the wall turns at 0.05 m/s"
    assert made(wall__1__spin=[0.0, 0.0, 100.0]).reference_speed == pytest.approx(2.5)


@pytest.mark.parametrize(
    ("given", "severity", "key", "said"),
    [
        ({"wall.0.point": [0.2, 0.2, 0.1]}, "error", "wall.0.point", "lies outside the column"),
        ({"feed.0.rate": 1e6}, "error", "feed.0.rate", "fall out of the box in time to make room"),
        ({"feed.0.rate": 2e4}, "warning", "feed.0.rate", "fall out of the box in time to make room"),
        ({"feed.0.corner": [0.024, 0.0, 0.18], "feed.0.size": [0.01, 0.001, 0.01], "wall.1.caps": True}, "error",
         "feed.0.corner", "only 0 % of the box is half a diameter away from walls"),
        ({"wall.1.caps": True, "outlet.0.size": [0.05, 0.05, 0.03]}, "error", "outlet.0.corner", "lies behind walls"),
        ({"outlet.0.size": [0.06, 0.06, 0.2]}, "warning", "outlet.0", "removes particles where feed.0 inserts them"),
        ({"column.sides": "periodic"}, "error", "wall.0", "not the same all along the periodic sides"),
        ({"feed.0.begin": 0.3}, "warning", "feed.0.begin", "not before the end of the run"),
    ],
    ids=str,
)  # fmt: skip
def test_the_pre_run_check_sees(given: dict[str, Any], severity: str, key: str, said: str) -> None:
    found = {each.key: each for each in preflight(Case.from_text(HOPPER, "h.toml", given)).issues}
    assert key in found, found
    assert found[key].severity == severity and said in found[key].reason


def test_the_hopper_itself_has_no_issues() -> None:
    assert preflight(made()).status == "ok"


def test_planes_are_checked_against_the_column() -> None:
    text = HOPPER.replace("[[feed]]", '[[wall]]\nshape = "plane"\npoint = [0.0, 0.0, 0.3]\n[[feed]]')
    assert next(each.key for each in preflight(made(text)).issues) == "wall.2.normal"
    down = preflight(made(text, wall__2__normal=[0.0, 0.0, -1.0])).issues
    assert [(each.severity, each.key) for each in down] == [("warning", "wall.2.point")]


# ---------------------------------------------------------------- surfaces


def test_surface_files_are_read_in_both_forms(tmp_path: Path) -> None:
    for file in (write_text_stl(tmp_path / "a.stl", TETRAHEDRON), write_binary_stl(tmp_path / "b.stl", TETRAHEDRON)):
        assert np.array_equal(read_stl(file), TETRAHEDRON)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "No such file"),
        (b"", "not a text that begins with solid"),
        (b"solid x\nendsolid x\n", "it has 0 corners"),
        (b"solid x\nvertex 1 2 3\n", "it has 1 corners"),
        (b"solid x\nvertex 1 2 3\nvertex 1 2 y\nvertex 1 2 3\n", "a corner is not three numbers"),
        (b"solid x\nvertex 1 2 3\nvertex 1 2 nan\nvertex 1 2 3\n", "a corner is not finite"),
        (b"x" * 80 + (7).to_bytes(4, "little") + b"y" * 50, "its length does not fit"),
        (b"solid x\n" + b"vertex 1 2 3\n" * 3, "triangles"),
    ],
    ids=str,
)
def test_a_file_that_is_no_surface_is_an_error_of_the_check(tmp_path: Path, content: bytes | None, said: str) -> None:
    """One line with the key; paths are relative to the case file."""
    if content is not None:
        (tmp_path / "part.stl").write_bytes(content)
    wall = '[[wall]]\nshape = "surface"\nfile = "part.stl"\n'
    (tmp_path / "h.toml").write_text(HOPPER + wall)
    case = Case.from_toml(tmp_path / "h.toml")
    assert case.wall[2].file == str(tmp_path / "part.stl")
    if said == "triangles":
        return  # without an area; the solver refuses it
    errors = [each for each in preflight(case).issues if each.severity == "error"]
    assert [each.key for each in errors] == ["wall.2.file"] and said in errors[0].reason


def test_a_file_in_another_unit_is_seen(tmp_path: Path) -> None:
    """A part in millimetres without scale lies outside the column; one that is too fine is a warning."""
    write_text_stl(tmp_path / "part.stl", 20.0 * TETRAHEDRON + 10.0)
    (tmp_path / "h.toml").write_text(HOPPER + '[[wall]]\nshape = "surface"\nfile = "part.stl"\n')
    path = tmp_path / "h.toml"
    assert "outside the column" in preflight(Case.from_toml(path)).issues[0].reason
    assert preflight(Case.from_toml(path, {"wall.2.scale": 1e-3})).status == "ok"
    tiny = preflight(Case.from_toml(path, {"wall.2.scale": 1e-6, "wall.2.point": [0.03, 0.03, 0.1]}))
    assert [(each.severity, each.key) for each in tiny.issues] == [("warning", "wall.2.file")]


def test_particles_outside_of_a_closed_vessel_are_refused(tmp_path: Path) -> None:
    """A cube that fills most of its column is a vessel, a small one an obstacle, an open one has no inside."""
    path = tmp_path / "vessel.toml"

    def found(corners: np.ndarray, positions: list[list[float]], width: float) -> Preflight:
        write_text_stl(tmp_path / "part.stl", corners)
        text = HOPPER[: HOPPER.index("[[wall]]")].partition("count = 100")[0]
        text = text.replace("width = 0.06", f"width = {width}").replace("height = 0.2", f"height = {width}")
        wall = "[[wall]]\nshape = 'surface'\nfile = 'part.stl'\n[run]\nuntil = 0.1\n"
        path.write_text(f"{text}positions = {positions}\n{wall}")
        return preflight(Case.from_toml(path))

    inside, outside = [0.01, 0.01, 0.01], [0.1, 0.1, 0.1]
    vessel, obstacle = 0.2 * cube(), 0.05 * cube()
    for corners, positions, width, place in (
        (vessel, [inside, [0.19, 0.21, 0.21]], 0.22, "(0.19, 0.21, 0.21) m it is outside"),
        (vessel, [[0.21, 0.21, 0.21]], 0.22, "(0.21, 0.21, 0.21) m it is outside"),
        (obstacle, [inside, outside, [0.2, 0.1, 0.1]], 0.22, "(0.01, 0.01, 0.01) m it is inside"),
    ):
        (error,) = (each for each in found(corners, positions, width).issues if each.severity == "error")
        assert "part.stl' is closed, and at " + place in error.reason
        with pytest.raises(InputError, match=re.escape(place)):
            particles_of(Case.from_toml(path), np.empty(0), [], Laws())
    (warning,) = found(obstacle, [outside], 0.22).issues
    assert warning.severity == "warning" and "outside of this closed surface" in warning.reason
    assert not found(0.003 * cube(), [outside], 0.22).issues  # too small for a vessel
    opened = found(vessel[2:], [inside, [0.21, 0.21, 0.21]], 0.22)
    assert not opened.issues and "open: particles may start on both sides" in str(opened)


# ---------------------------------------------------------------- geometry and motion


def test_distances_are_those_of_the_shapes() -> None:
    points = np.array([[0.5, 0.0, 0.5], [2.0, 0.0, 0.5], [0.0, 0.0, 2.0], [1.5, 0.0, 1.5]])
    rod: dict[str, Any] = {"shape": "cylinder", "radius": 1.0, "length": 1.0}
    corner = math.hypot(0.5, 0.5)
    for wall, expected in (
        (CaseWall(shape="plane", point=(0.0, 0.0, 1.0)), [-0.5, -0.5, 1.0, 0.5]),
        (CaseWall(shape="cylinder", radius=1.0), [0.5, -1.0, 1.0, -0.5]),
        (CaseWall(shape="cylinder", radius=1.0, outside=True), [-0.5, 1.0, -1.0, 0.5]),
        (CaseWall(**rod), [0.5, 1.0, math.sqrt(2.0), corner]),
        (CaseWall(**rod, caps=True), [0.5, -1.0, -1.0, -0.5]),
        (CaseWall(**rod, caps=True, outside=True), [-0.5, 1.0, 1.0, corner]),
        (CaseWall(shape="cone", radius=1.0, top_radius=1.0, length=1.0), [0.5, 1.0, math.sqrt(2.0), corner]),
    ):
        assert wall.form.distance(points) == pytest.approx(expected), wall
    box = CaseWall(shape="cylinder", radius=1.0, length=2.0, axis=(0.0, 1.0, 0.0)).form.extent()
    assert box is not None and box.tolist() == [[-1.0, 0.0, -1.0], [1.0, 2.0, 1.0]]


def test_points_inside_a_closed_surface_are_found() -> None:
    points = np.random.default_rng(1).uniform(-0.2, 1.2, (500, 3))
    expected = (points > 0.0).all(axis=1) & (points.sum(axis=1) < 1.0)
    assert np.array_equal(inside_surface(TETRAHEDRON, points), expected)
    with pytest.raises(InputError, match="closed"):
        inside_surface(TETRAHEDRON[:3], points)


def test_a_motion_begins_ends_and_oscillates() -> None:
    gate = Motion(0, velocity=(1.0, 0.0, 0.0), begin=0.1, end=0.3)
    assert [gate.displacement(time)[0] for time in (0.0, 0.1, 0.2, 0.5)] == pytest.approx([0.0, 0.0, 0.1, 0.2])
    shaken = Motion(0, amplitude=(0.0, 0.0, 2e-3), frequency=10.0)
    assert [shaken.displacement(time)[2] for time in (0.025, 0.05, 0.075)] == pytest.approx([2e-3, 0.0, -2e-3])


@pytest.mark.parametrize(
    ("given", "leaves"),
    [
        ({"shape": "plane", "velocity": (1.0, 0.0, 0.0)}, False),
        ({"shape": "plane", "velocity": (1.0, 0.0, 1e-3)}, True),
        ({"shape": "plane", "amplitude": (0.0, 0.0, 1e-3), "frequency": 1.0}, True),
        ({"shape": "cylinder", "radius": 1.0, "length": 1.0, "spin": (0.0, 0.0, 3.0)}, False),
        ({"shape": "cylinder", "radius": 1.0, "length": 1.0, "spin": (0.0, 0.0, 3.0), "centre": (1.0, 0.0, 0.0)}, True),
        ({"shape": "cylinder", "radius": 1.0, "velocity": (0.0, 0.0, 3.0)}, False),
        ({"shape": "surface", "file": "x.stl", "spin": (0.0, 0.0, 3.0)}, True),
    ],
    ids=str,
)
def test_walls_that_move_along_themselves_stay_in_place(given: dict[str, Any], leaves: bool) -> None:
    assert CaseWall(**given).leaves_its_place is leaves
