"""A wall shape of a user, as docs/how-to/own-wall.md writes it: of a solver, in a case, and as a surface file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import make_dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
from command_line import call
from pydantic import Field

from cfddem.backend.errors import InputError
from cfddem.case.column_grid import grid_of
from cfddem.case.materials import Material
from cfddem.case.schema import Case
from cfddem.case.walls import SHAPES, CaseWall, forget_shape, register
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.meshes import Mesh, read_stl
from cfddem.particles.walls.wall import SolidSide, Wall
from cfddem.plotting.case_drawing import case_drawing
from cfddem.preflight.summary import preflight
from cfddem.run.simulation import Simulation
from closures import contact

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "own-wall.md").read_text(encoding="utf-8")
SHAPE, BEADS, CASE, FILE = re.findall(r"```python\n(.*?)```", PAGE, re.S)
RADIUS, HEIGHT, INNER, OUTER = 1e-3, 0.01, 0.002, 0.006
GLASS = Material(density=2500, youngs_modulus=1e7, poisson=0.25, restitution=0.5, friction=0.3)


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, Any]]:
    """Names of the page, run in an empty folder."""
    monkeypatch.chdir(tmp_path)
    if "ring" in SHAPES:  # of a test that runs the pages
        forget_shape("ring")
    names: dict[str, Any] = {}
    for block in (SHAPE, BEADS, CASE, FILE):
        exec(block, names)
    yield names
    forget_shape("ring")


def gap(wall: Wall, place: list[float]) -> float:
    """Gap between a bead and a wall [m]."""
    bead = make_particles([place], RADIUS, 2500.0)
    run = ParticleSolver(bead, pair_table([GLASS]), walls=[wall], settings=SolverSettings(skin=5.0 * RADIUS))
    return float(run.gap.min())


def test_gaps_are_those_of_a_ring(page: dict[str, Any]) -> None:
    """Above and below the plate, and beside both rims: distance to the nearest point, less the radius."""
    ring = page["Ring"](point=(0.0, 0.0, HEIGHT), inner=INNER, outer=OUTER)
    for distance, height in ((0.004, 0.002), (0.004, -0.002), (0.0, 0.002), (0.0005, -0.001), (0.0075, 0.001)):
        aside = max(INNER - distance, distance - OUTER, 0.0)
        expected = math.hypot(aside, height) - RADIUS
        assert gap(ring, [0.6 * distance, 0.8 * distance, HEIGHT + height]) == pytest.approx(expected, abs=1e-15)


def test_a_bead_rests_on_the_ring_and_another_falls_through_its_hole(page: dict[str, Any]) -> None:
    on_it, through = page["beads"].position
    stiffness = contact.hertz_stiffness(float(pair_table([GLASS])[0, 0]["contact_modulus"]), RADIUS)
    overlap = (2500.0 * 4.0 / 3.0 * math.pi * RADIUS**3 * 9.81 / stiffness) ** (2.0 / 3.0)
    assert on_it[2] == pytest.approx(HEIGHT + RADIUS - overlap, abs=1e-7)
    assert through[:2] == pytest.approx([0.0, 0.0], abs=1e-12) and through[2] < 0.0


def test_the_ring_stands_in_a_case_as_a_shape_and_as_a_file(page: dict[str, Any]) -> None:
    for case, rounding in ((page["case"], 1e-9), (page["case"].with_(wall=[page["file"]]), 2e-6)):
        simulation = Simulation(case)
        simulation.until(0.05)
        on_it, through = simulation.particles.position
        assert on_it[2] == pytest.approx(page["beads"].position[0, 2], abs=rounding)
        assert through[2] < 0.002, "on the floor"


def test_every_part_of_the_package_knows_the_shape(page: dict[str, Any]) -> None:
    """Its keys are read, refused, explained and written; checks see its place, and pictures draw it."""
    case = page["case"]
    assert Case.from_text(case.to_toml()) == case and "inner radius of a ring" in call("explain", "wall.inner").out
    with pytest.raises(InputError, match='inner: must be given for shape = "ring"'):
        case.with_(wall=[{"shape": "ring", "outer": 0.006}])
    with pytest.raises(InputError, match=r'inner = 0\.001: must be left out for shape = "plane"'):
        case.with_(wall=[{"shape": "plane", "inner": 0.001}])
    with pytest.raises(InputError, match="a ring has no inside"):
        case.with_(wall=[{**case.wall[0].model_dump(), "solid": "inside"}])
    (issue,) = preflight(case.with_(**{"wall.0.point": [0.1, 0.1, 0.01]})).issues
    assert issue.key == "wall.0.point" and "lies outside the column" in issue.reason
    in_fluid = case.with_(fluid={"density": 1000.0, "viscosity": 1e-3})
    assert in_fluid.thin_walls == case.wall and grid_of(in_fluid).walls
    drawn = len(case_drawing(case).axes[0].patches)
    assert drawn == len(case_drawing(case.with_(wall=[])).axes[0].patches) + 96


def test_a_shape_may_leave_the_fluid_alone_by_default(page: dict[str, Any]) -> None:
    """And of one that fails the check tells the error, not the largest value of the case."""
    liquid = {"density": 1000.0, "viscosity": 1e-3}
    for default in ("none", "inside"):
        alone = {
            "side": property(lambda _, default=default: SolidSide(default)),
            "corners": lambda _: np.zeros((0, 3, 3)),
        }
        register("ghost", type("Ghost", (page["Ring"],), alone))
        in_fluid = page["case"].with_(fluid=liquid, wall=[{**page["case"].wall[0].model_dump(), "shape": "ghost"}])
        issues = preflight(in_fluid).issues
        assert in_fluid.closes_cells(in_fluid.wall[0]) is (default == "inside") and not in_fluid.thin_walls
        told = [issue.reason for issue in issues if issue.key == "case"]
        assert len(told) == (default == "inside") and all("ValueError: zero-size array" in each for each in told)
        forget_shape("ghost")


def test_what_does_not_fit_is_refused_before_anything_changes(page: dict[str, Any]) -> None:
    """A taken name; a key without description, which no class has, or which other shapes have. One line each."""
    described = Annotated[float, Field(gt=0, description="inner radius [m]")]
    timed = make_dataclass("Timed", [("end", float)], bases=(page["Ring"],), frozen=True, kw_only=True)
    with pytest.raises(InputError, match=r"shape\.timed\.end: must be of another name"):
        register("timed", timed)
    disc = make_dataclass("Disc", [("thickness", float)], bases=(page["Ring"],), frozen=True, kw_only=True)
    for name, keys, message in (
        ("plane", {}, "shape = 'plane': must be a name that no other shape has"),
        ("ring", {"thickness": described}, "shape = 'ring': must be a name that no other shape has"),
        ("disc", {}, r"shape\.disc\.thickness: must be described in register; add thickness=Annotated"),
        ("disc", {"thickness": float}, r"shape\.disc\.thickness: must be described in register; give it as"),
        ("disc", {"thickness": described, "thick": described}, r"shape\.disc\.thick: must be a field of Disc, .*outer"),
        ("disc", {"thickness": described, "inner": described}, r"shape\.disc\.inner: must be left out of register"),
        ("disc", {"thickness": described, "point": described}, r"shape\.disc\.point: must be left out of register"),
    ):
        with pytest.raises(InputError, match=message) as refused:
            register(name, disc, **keys)
        assert "\n" not in str(refused.value)
    assert "disc" not in SHAPES and "thickness" not in CaseWall.model_fields and SHAPES["ring"] is page["Ring"]
    register("disc", disc, thickness=described)
    forget_shape("disc")
    assert page["case"].with_(wall=page["case"].wall) == page["case"]


def test_a_class_that_is_defined_again_replaces_itself(page: dict[str, Any]) -> None:
    """As where a cell of a notebook is run twice."""
    again: dict[str, Any] = {}
    exec(SHAPE, again)
    exec(CASE, again)
    assert SHAPES["ring"] is again["Ring"] is not page["Ring"]


def test_a_surface_is_written_as_it_is_read(tmp_path: Path) -> None:
    corners = np.random.default_rng(1).uniform(-1.0, 1.0, (7, 3, 3)).astype(np.float32).astype(float)
    mesh = Mesh(vertices=corners.reshape(-1, 3), triangles=np.arange(21).reshape(7, 3))
    mesh.to_stl(tmp_path / "seven.stl")
    assert np.array_equal(read_stl(tmp_path / "seven.stl"), mesh.vertices[mesh.triangles])
