"""A wall shape of a user, as docs/how-to/own-wall.md writes it: of exact pieces, and of triangles in a case."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cfddem.case.materials import Material
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Mesh, Wall
from cfddem.particles.walls.stl import read_stl
from cfddem.run.simulation import Simulation
from closures import contact

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "own-wall.md").read_text(encoding="utf-8")
SHAPE, BEADS, CASE = re.findall(r"```python\n(.*?)```", PAGE, re.S)
RADIUS, HEIGHT, INNER, OUTER = 1e-3, 0.01, 0.002, 0.006
GLASS = Material(density=2500, youngs_modulus=1e7, poisson=0.25, restitution=0.5, friction=0.3)


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Names of the page, run in an empty folder."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for block in (SHAPE, BEADS, CASE):
        exec(block, names)
    return names


def gap(wall: Wall, place: list[float]) -> float:
    """Gap between a bead and a wall [m]."""
    bead = make_particles([place], RADIUS, 2500.0)
    run = ParticleSolver(bead, pair_table([GLASS]), walls=[wall], skin=5.0 * RADIUS)
    return float(run.gap.min())


def test_gaps_are_those_of_a_ring(page: dict[str, Any]) -> None:
    """Above and below the plate, and beside both rims: distance to the nearest point, less the radius."""
    ring = page["Ring"](height=HEIGHT, inner=INNER, outer=OUTER)
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


def test_the_same_ring_of_triangles_stands_in_a_case(page: dict[str, Any]) -> None:
    simulation = Simulation(page["case"])
    simulation.until(0.05)
    on_it, through = simulation.particles.position
    assert on_it[2] == pytest.approx(page["beads"].position[0, 2], abs=2e-6)
    assert through[2] < 0.002, "on the floor"


def test_a_surface_is_written_as_it_is_read(tmp_path: Path) -> None:
    corners = np.random.default_rng(1).uniform(-1.0, 1.0, (7, 3, 3)).astype(np.float32).astype(float)
    mesh = Mesh(vertices=corners.reshape(-1, 3), triangles=np.arange(21).reshape(7, 3))
    mesh.to_stl(tmp_path / "seven.stl")
    assert np.array_equal(read_stl(tmp_path / "seven.stl"), mesh.vertices[mesh.triangles])
