"""What the pre-run check says of vessels from surface files, thin walls and cells is what the run finds."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_case_walls import write_binary_stl
from test_case_walls_in_fluid import CONE, FED

from cfddem.analysis.report import report
from cfddem.backend.errors import InputError
from cfddem.case.gallery import gallery, gallery_files
from cfddem.case.schema import Case
from cfddem.io.reading import open_run
from cfddem.preflight.bed_estimate import mean_inlet_velocity
from cfddem.preflight.issue import Issue
from cfddem.preflight.summary import preflight
from cfddem.run import initial_particles
from cfddem.run.initial_particles import particles_of
from cfddem.run.runner import Run

TOLERANCE = 0.2
"""Difference of estimated bed height and pressure drop of a bubbling conical bed from those of its run, over them [-].

The height is that of the poured bed, the least that a bubbling bed has; at rest it is within half of this.
"""

FLOOR, SLOPE = 0.008, 0.2
"""Radius of the vessel at its floor [m], and the slope of its wall."""

VESSEL: dict[str, Any] = {
    "material.bead.density": 1320.0,
    "bed.diameter": 1.6e-3,
    "bed.count": 2000,
    "bed.start": "poured",
    "bed.start_corner": [0.0115, 0.0115, 0.022],
    "bed.start_size": [0.017, 0.017, 0.056],
    "bed.inlet_velocity": 1.6,
    "column.cell": 0.004,
    "run.until": 0.5,
    "run.reference_speed": 0.5,
}


def revolved(rings: list[tuple[float, float]], closed: bool = False, sides: int = 48) -> np.ndarray:
    """The closed surface of rings of radius and height about the axis x = y = 0.02 m (T, 3, 3).

    closed  the last ring meets the first, as in a tube; else discs close both ends
    """
    angle = 2.0 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
    axis = np.array([0.02, 0.02, 0.0])
    corners = [axis + radius * circle + np.array([0.0, 0.0, height]) for radius, height in rings]
    if closed:
        corners.append(corners[0])
    else:
        ends = [np.broadcast_to(axis + np.array([0.0, 0.0, rings[k][1]]), (sides, 3)) for k in (0, -1)]
        corners = [ends[0], *corners, ends[1]]
    triangles = []
    for low, high in pairwise(corners):
        after = [np.roll(each, -1, axis=0) for each in (low, high)]
        triangles += [np.stack([low, after[0], after[1]], axis=1), np.stack([low, after[1], high], axis=1)]
    found = np.concatenate(triangles)
    area = np.linalg.norm(np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), axis=1)
    return np.asarray(found[area > 0.0])


def case_with(folder: Path, surface: np.ndarray, wall: str = "", **given: Any) -> Case:
    """The case of a surface in the column of the conical bed."""
    write_binary_stl(folder / "part.stl", surface)
    table = f'[[wall]]\nshape = "surface"\nfile = "part.stl"\n{wall}\n'
    path = folder / "case.toml"
    path.write_text(re.sub(r"(?ms)^\[\[wall\]\].*?(?=^\[laws\])", table, CONE))
    return Case.from_toml(path, VESSEL | {key.replace("__", "."): value for key, value in given.items()})


def cone() -> np.ndarray:
    return revolved([(FLOOR, 0.0), (FLOOR + 0.06 * SLOPE, 0.06), (0.02, 0.08)])


def height_in_cone(volume: float) -> float:
    """Height to which a volume fills the vessel [m]."""
    return ((FLOOR**3 + 3.0 * SLOPE * volume / math.pi) ** (1.0 / 3.0) - FLOOR) / SLOPE


def numbers(case: Case) -> dict[str, float]:
    return {row.name: row.value for row in preflight(case).rows}


def errors(case: Case) -> list[Issue]:
    return [each for each in preflight(case).issues if each.severity == "error"]


def test_the_numbers_of_a_conical_vessel_are_those_of_its_cross_section(tmp_path: Path) -> None:
    """Height, cross-sections and pressure drop by the geometry of the cone."""
    case = case_with(tmp_path, cone(), 'solid = "outside"')
    found, solids = numbers(case), 2000 * math.pi / 6.0 * 1.6e-3**3
    height = height_in_cone(solids / 0.58)
    assert found["bed height"] == pytest.approx(height, rel=0.02)
    assert found["cross-section at the floor"] == pytest.approx(math.pi * FLOOR**2, rel=0.05)
    assert found["cross-section at the bed surface"] == pytest.approx(math.pi * (FLOOR + SLOPE * height) ** 2, rel=0.05)
    weight = 0.58 * (1320.0 - 1.2) * 9.81 * height
    assert found["pressure drop"] == pytest.approx(weight, rel=0.02)
    box = solids * (1320.0 - 1.2) * 9.81 / 0.04**2
    assert weight > 4.0 * box


def test_a_cone_that_goes_on_above_the_lid_is_warned_of_and_asked_about_if_it_is_in_millimetres() -> None:
    for length, asked in ((0.1733, None), (0.3, False), (173.3, True)):
        changed = gallery()["conical-spout"].with_(**{"vessel.length": length})
        found = [each for each in preflight(changed).issues if each.key == "vessel.length"]
        assert [each.severity for each in found] == ["warning"] * (asked is not None)
        assert [("did you mean 0.173 m" in each.remedy) for each in found] == [asked] * (asked is not None)


def test_a_bed_of_given_height_fills_the_part_of_the_column_that_walls_leave() -> None:
    """A plane in the middle halves the column, and the number of particles that fill it to a height."""
    liquid = gallery()["liquid-bed"]
    bed = liquid.model_dump(exclude_defaults=True)["bed"] | {"count": None, "height": 0.01, "start": "poured"}
    whole = liquid.with_(bed=bed)
    half = whole.with_(wall=[{"shape": "plane", "point": [0.005, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}])
    assert half.particle_count == pytest.approx(0.5 * whole.particle_count, abs=1)
    assert numbers(half)["bed height"] == pytest.approx(numbers(whole)["bed height"], rel=1e-3)


@pytest.mark.slow
def test_the_run_of_a_conical_vessel_has_the_height_and_pressure_drop_of_the_check(tmp_path: Path) -> None:
    case = case_with(tmp_path, cone(), 'solid = "outside"')
    Run.begin(case, tmp_path / "run").go()
    at_rest = open_run(tmp_path / "run").history["bed_height"][0]
    assert at_rest == pytest.approx(numbers(case)["bed height"], rel=0.5 * TOLERANCE)
    measured, expected = report(tmp_path / "run").measures, numbers(case)
    for name, measure in (("bed height", "bed_height"), ("pressure drop", "pressure_drop")):
        assert measured[measure].mean == pytest.approx(expected[name], rel=TOLERANCE), name


def test_a_closed_vessel_without_solid_is_refused_before_pouring_with_one_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = case_with(tmp_path, cone())
    (error,) = errors(case)
    assert error.key == "wall.0.solid" and 'set wall.0.solid = "outside" if it is their vessel' in error.remedy
    monkeypatch.setattr(initial_particles, "poured_bed", lambda *_, **__: pytest.fail("it pours"))
    with pytest.raises(InputError) as refusal:
        particles_of(case, np.empty(0), [], None)  # type: ignore[arg-type]
    assert str(refusal.value).startswith("wall.0.solid") and str(refusal.value).endswith(error.remedy)
    assert not errors(case_with(tmp_path, cone(), 'solid = "outside"'))
    (beside,) = errors(case_with(tmp_path, cone(), 'solid = "outside"', bed__start_corner=[0.0, 0.0, 0.0],
                                 bed__start_size=[0.006, 0.006, 0.04], bed__count=60))  # fmt: skip
    assert beside.key == "bed.start_corner" and "lie outside of the closed surface" in beside.reason


def test_a_surface_in_millimetres_without_scale_is_asked_about(tmp_path: Path) -> None:
    """Also where it passes through the column; with the scale, or in metres, nothing is asked."""
    (error,) = preflight(case_with(tmp_path, 1e3 * cone(), 'solid = "outside"')).issues
    assert error.severity == "error" and error.key == "wall.0.scale"
    assert "is the file in millimetres?" in error.reason and "scale = 0.001" in error.remedy
    through = preflight(case_with(tmp_path, 1e3 * (cone() - [0.0, 0.02, 0.0]), 'solid = "none"')).issues
    assert "is the file in millimetres?" in next(each.reason for each in through if each.key == "wall.0.scale")
    case = case_with(tmp_path, 1e3 * cone(), 'scale = 1e-3\nsolid = "outside"')
    assert not preflight(case).issues
    assert not preflight(case_with(tmp_path, cone(), 'solid = "outside"')).issues


def plate(thickness: float) -> np.ndarray:
    """A plate across the column, tilted by about 27 degrees."""
    low, high = np.array([-0.001, -0.001, 0.0285]), np.array([0.041, 0.041, 0.0285 + thickness])
    corners = np.array([[x, y, z + 0.5 * x] for x in (low[0], high[0]) for y in (low[1], high[1])
                        for z in (low[2], high[2])])  # fmt: skip
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return np.asarray(corners[np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])])


START = {"bed__start_corner": [0.0, 0.0, 0.07], "bed__start_size": [0.04, 0.04, 0.01], "bed__count": 100}


@pytest.mark.parametrize(
    ("surface", "said"),
    [
        (plate(0.0015), "thinner than a cell: fluid passes through"),
        (plate(0.012), ""),
        (revolved([(0.006, 0.02), (0.006, 0.06), (0.005, 0.06), (0.005, 0.02)], closed=True), "closes no cell"),
        (revolved([(0.014, 0.02), (0.014, 0.06), (0.004, 0.06), (0.004, 0.02)], closed=True), ""),
        (revolved([(0.006, 0.02), (0.006, 0.06)]), ""),
    ],
    ids=["thin plate", "thick plate", "thin tube", "thick tube", "rod"],
)
def test_a_wall_thinner_than_a_cell_is_warned_of(tmp_path: Path, surface: np.ndarray, said: str) -> None:
    found = [each for each in preflight(case_with(tmp_path, surface, **START)).issues if each.key == "wall.0.solid"]
    told = [(each.severity, said in each.reason, each.in_report) for each in found]
    assert told == ([("warning", True, True)] if said else [])


def test_the_report_of_a_bead_with_a_feed_and_a_thin_tube_warns_of_the_tube_and_compares_no_settling_sphere(
    tmp_path: Path,
) -> None:
    """The bead is one of many: neither settling speed nor equation of motion."""
    tube = revolved([(0.006, 0.02), (0.006, 0.05), (0.005, 0.05), (0.005, 0.02)], closed=True)
    fed = {"feed": FED["feed"], "bed__count": 1, "run__until": 0.003, "run__every": 0.001, "bed__inlet_velocity": 0.0}
    case = case_with(tmp_path, tube, **{**START, **fed, "bed__start": "suspended"})
    assert case.particle_count == 1 and not case.is_one_sphere
    Run.begin(case, tmp_path / "run").go()
    told = report(tmp_path / "run")
    assert open_run(tmp_path / "run").status == "finished"
    assert not [each for each in told.key_results if each.name == "settling speed"] and not told.laws
    assert next(each.value for each in told.key_results if each.name == "regime") != "sphere in motion"
    assert any("the wall closes no cell: the fluid passes through it" in each for each in told.warnings)


# ---------------------------------------------------------------- cells


def _of_cells(case: Case) -> list[str]:
    return [each.remedy for each in preflight(case).issues if each.key == "column.cell" and "memory" not in each.reason]


CELLS = (1e-4, 1e-3, 1.3e-3, 2e-3, 2.5e-3, 3e-3, 3.7e-3, 4e-3, 6.1e-3, 7.5e-3, 0.011, 0.02, 0.05)


@pytest.mark.parametrize("cells", [CELLS[::4], pytest.param(CELLS, marks=pytest.mark.slow)], ids=["few", "all"])
@pytest.mark.parametrize("name", [name for name, each in gallery().items() if each.fluid is not None])
def test_the_check_of_a_suggested_cell_suggests_nothing(name: str, cells: tuple[float, ...]) -> None:
    case = gallery()[name]
    for cell in cells:
        for remedy in _of_cells(case.with_(**{"column.cell": cell})):
            (edges,) = re.findall(r"(\[[^\]]*\]|[\d.e-]+) m fits", remedy)
            suggested = [float(each) for each in edges.strip("[]").split(", ")]
            given = suggested[0] if len(suggested) == 1 else suggested
            assert not _of_cells(case.with_(**{"column.cell": given})), (cell, remedy)


def test_a_cell_of_7_5_mm_suggests_8_mm_and_not_one_that_suggests_it() -> None:
    box = {"column.width": 0.2, "column.depth": 0.12, "column.height": 0.4, "bed.diameter": 0.003}
    case = Case.from_toml(gallery_files()["liquid-bed"], box)
    for cell in (0.0075, 0.00740741):
        assert _of_cells(case.with_(**{"column.cell": cell})) == ["0.008 m fits along x, y and z"]
    assert not _of_cells(case.with_(**{"column.cell": 0.008}))


def test_a_slot_reaches_as_far_as_the_vessel_is_open_and_a_note_says_that_it_is_one() -> None:
    """Mean velocity over the floor, a disc of radius R, of a slot of half width a: its share is that of the disc."""
    radius, half = 0.008, 0.004
    share = 2.0 * (math.asin(half / radius) + half / radius * math.sqrt(1.0 - (half / radius) ** 2)) / math.pi
    wall = [{"shape": "cylinder", "point": [0.02, 0.02, 0.0], "radius": radius}]
    slot = {"bed.inlet_velocity": 0.0, "bed.jet": {"velocity": 1.0, "width": 2.0 * half}, "wall": wall}
    case = Case.from_toml(gallery_files()["gas-bed"]).with_(
        **{"column.width": 0.04, "column.depth": 0.04, "column.height": 0.128, "column.cell": 0.004}, **slot
    )
    assert mean_inlet_velocity(case) == pytest.approx(share, rel=0.05)
    said = [str(each) for each in preflight(case).issues if each.key == "bed.jet"]
    assert len(said) == 1 and "a slot across the whole vessel, 6" in said[0] and "bed.jet.round = true" in said[0]
    nozzle = case.with_(**{"bed.jet.round": True})
    assert mean_inlet_velocity(nozzle) == pytest.approx((half / radius) ** 2, rel=0.05)
    round_column = case.with_(
        **{"wall": [], "column.width": 2.0 * radius, "column.depth": None, "column.shape": "cylinder"}
    )
    assert mean_inlet_velocity(round_column) == pytest.approx(share, rel=0.05)
    for other in (nozzle, case.with_(wall=[])):
        assert not [each for each in preflight(other).issues if each.key == "bed.jet"]
