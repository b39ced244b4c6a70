"""Thin walls of a case: a tube and a plate with the fluid on both sides, for particles where they are."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from test_vessel import TEXT

from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.schema import Case
from cfddem.fluid.boundaries import Boundaries
from cfddem.particles.state import make_particles
from cfddem.particles.walls.arrays import near_walls, wall_arrays
from cfddem.preflight.summary import preflight
from cfddem.run.build import boundaries_of, walls_of

TUBE = {"shape": "cylinder", "point": [0.08, 0.08, 0.02], "radius": 0.026, "length": 0.08, "solid": "thin"}
PLATE = {"shape": "plate", "point": [0.0, 0.083, 0.1], "edges": [[0.16, 0.0, 0.0], [0.0, 0.0, 0.05]]}

SHEET = {"shape": "plate", "point": [0.16, 0.02, 0.1], "edges": [[0.0, 0.1, 0.0], [0.0, 0.0, 0.05]]}


def made(*walls: dict[str, Any], **given: Any) -> Case:
    return Case.from_text(TEXT, "c.toml", {"wall": list(walls)} | {k.replace("__", "."): v for k, v in given.items()})


def test_a_tube_and_a_plate_close_faces_and_no_cells():
    """In a cone and in a box: as many faces as the tube has on the grid, and those of the plate."""
    for vessel in ({"shape": "cone", "radius": 0.03, "length": 0.1733}, None):
        text = TEXT if vessel else re.sub(r"(?ms)^\[vessel\].*?(?=^\[patch)", "", TEXT)
        case = Case.from_text(text, "c.toml", {"wall": [TUBE, PLATE]})
        grid = grid_of(case)
        cut = Boundaries(grid, boundaries_of(case)).cut
        x, y, z = np.broadcast_arrays(*grid.centres())
        inside = (np.hypot(x - 0.08, y - 0.08) < 0.026) & (z > 0.02) & (z < 0.1)
        for d in (0, 1):
            tube = inside ^ np.roll(inside, 1, axis=2 - d)
            thin = grid.inner(cut.thin[d]) > 0.0
            assert (thin == tube)[z < 0.1].all() and tube.sum() == 12 * 8
        plate = grid.inner(cut.thin[1])[10:15] > 0.0
        assert plate.any() and set(np.unique(np.nonzero(plate)[1])) == {8}
        assert (case.closes_cells(case.wall[0]), case.closes_cells(case.wall[1])) == (False, False)
        assert np.allclose(case.wall[1].form.extent(), [[0.0, 0.083, 0.1], [0.16, 0.083, 0.15]])
        assert not [each for each in preflight(case).issues if each.severity == "error"]


def test_particles_touch_a_plate_from_both_sides():
    wall = wall_arrays(walls_of(made(PLATE))[-1:])
    places = np.array([[0.08, 0.083 + 0.003, 0.12], [0.08, 0.083 - 0.003, 0.12], [0.08, 0.083, 0.16]])
    assert set(near_walls(make_particles(places, 0.0031, 1.0), wall, 0.0, 0.0)[0]) == {0, 1}
    assert not len(near_walls(make_particles(places, 0.0029, 1.0), wall, 0.0, 0.0)[0])


def test_a_cone_of_triangles_has_its_ends():
    cone = made({**TUBE, "shape": "cone", "top_radius": 0.04}).wall[0]
    corners = cone.form.corners().reshape(-1, 3)
    away = np.hypot(corners[:, 0] - 0.08, corners[:, 1] - 0.08)
    assert np.allclose(away, np.where(corners[:, 2] > 0.05, 0.04, 0.026))


@pytest.mark.parametrize(
    ("walls", "given", "said"),
    [
        ([{**TUBE, "solid": None}], {}, "wall.0.solid.*thin, inside, outside or none"),
        ([{**TUBE, "caps": True}], {}, "solid = 'thin'.*none, or left out"),
        ([{**TUBE, "velocity": [0.1, 0.0, 0.0]}], {}, "wall.0.solid.*none for a wall that leaves its place"),
        ([{**PLATE, "spin": [0.0, 0.0, 1.0]}], {}, "wall.0.solid.*none for a wall that leaves its place"),
        ([{**PLATE, "solid": "inside"}], {}, "a plate has no inside"),
        ([{**PLATE, "edges": [[0.1, 0.0, 0.0], [0.2, 0.0, 0.0]]}], {}, "two edges in different directions"),
        ([{**PLATE, "edges": None}], {}, 'edges: must be given for shape = "plate"'),
        ([{**PLATE, "radius": 0.1}], {}, 'radius = 0.1.*left out for shape = "plate"'),
        ([TUBE], {"vessel": None, "patch": {}, "column.shape": "cylinder"}, "column.shape.*a box beside thin walls"),
        ([TUBE, {**TUBE, "solid": "inside"}], {}, 'wall.1.solid.*"none" or "thin" in a vessel'),
        ([TUBE, SHEET], {"vessel": None, "column.sides": "periodic"}, r"wall.1.point.*0 and 0.16 m along x.*from 0.16"),
        ([{**SHEET, "point": [0.0, 0.02, 0.1]}], {"vessel": None, "column.sides": "periodic"}, "wall.0.point.*along x"),
        ([PLATE], {"vessel": None, "column.sides": "periodic"}, "wall.0.point.*along x; it reaches from 0 to 0.16 m"),
        ([{**TUBE, "length": 0.3}], {"vessel": None, "patch": {}, "column.ends": "periodic"}, "wall.0.point.*along z"),
    ],
    ids=["unsaid", "caps", "moves", "spins", "inside", "parallel", "no edges", "radius", "round", "closed", "at a side",
         "at the other side", "between sides", "through the lid"],
)  # fmt: skip
def test_thin_walls_that_cannot_be_are_refused_in_a_line(walls, given, said):
    walls = [{key: value for key, value in wall.items() if value is not None} for wall in walls]
    text = re.sub(r"(?ms)^\[vessel\].*?(?=^\[patch)", "", TEXT) if "vessel" in given else TEXT
    given = {key: value for key, value in given.items() if key != "vessel"}
    text = re.sub(r"(?ms)^\[patch.nozzle\].*?(?=^\[bed)", "", text) if "patch" in given else text
    with pytest.raises(InputError, match=said) as refusal:
        Case.from_text(text, "c.toml", {"wall": walls} | {k: v for k, v in given.items() if k != "patch"})
    assert len(str(refusal.value)) < 400


def test_the_check_says_how_large_a_tube_is_for_the_fluid():
    """24 of the cells are within a radius of 2.75 cells, 16 within 2.5 cells."""
    for radius, cells in ((0.0275, 24), (0.025, 16)):
        (row,) = [each for each in preflight(made({**TUBE, "radius": radius})).rows if "by its cells" in each.name]
        assert row.value == pytest.approx(cells * 1e-4 / (np.pi * radius**2))


def test_a_narrow_tube_is_warned_of():
    found = [each for each in preflight(made({**TUBE, "radius": 0.015})).issues if each.key == "wall.0.radius"]
    assert [each.severity for each in found] == ["warning"] and "3 cells across the opening" in found[0].reason
