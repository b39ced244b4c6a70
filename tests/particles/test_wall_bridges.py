"""Liquid bridges at walls of every kind: one for each particle and wall, however finely the wall is divided."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wet_spheres import ANGLE, FILM, GRAIN, RADIUS, TENSION, THIN, bridged, swarm

from cfddem.backend.errors import InputError
from cfddem.particles.interactions import wall_liquid
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.meshes import Mesh
from cfddem.particles.walls.shapes import Box, Cone, Cylinder, Plane
from cfddem.particles.walls.wall import Wall
from closures import bridge, capillary, lubrication
from closures.liquid_film import film_volume

LAWS = replace(THIN, contact_angle=ANGLE)
WET_WALLS = replace(LAWS, wall_share=0.5, wall_film=1e-5, wall_patch=2.0 * RADIUS)
GAP = 0.5 * FILM


def sheet(cells: int, size: float = 8e-3) -> Mesh:
    """A square of triangles in the plane z = 0."""
    ticks = np.linspace(-0.5 * size, 0.5 * size, cells + 1)
    corners = np.array([[x, y, 0.0] for x in ticks for y in ticks])
    quads = [(cells + 1) * i + j for i in range(cells) for j in range(cells)]
    halves = [t for c in quads for t in ((c, c + cells + 1, c + 1), (c + cells + 1, c + cells + 2, c + 1))]
    return Mesh(vertices=corners, triangles=np.array(halves))


def above(
    wall: Wall, place: Any, laws: BridgeLaws = LAWS, velocity: Any = (0.0, 0.0, 0.0), **options: Any
) -> tuple[ParticleSolver, Bridges]:
    """A wet sphere at a wall."""
    sphere = make_particles([place], RADIUS, GRAIN.density, velocity=np.array([velocity]))
    return bridged(sphere, laws, walls=[wall], skin=RADIUS, check_steps=False, **options)


KINDS: dict[str, tuple[Wall, Any, Any]] = {
    "plane": (Plane(), (0.0, 0.0, RADIUS + GAP), (0, 0, 1)),
    "box": (Box(low=(-4e-3,) * 3, high=(4e-3,) * 3), (0.0, 4e-3 - RADIUS - GAP, 0.0), (0, -1, 0)),
    "cylinder": (Cylinder(radius=4e-3, length=8e-3), (4e-3 - RADIUS - GAP, 0.0, 4e-3), (-1, 0, 0)),
    "cone": (
        Cone(radius=3e-3, top_radius=3e-3, length=8e-3), (0.0, 3e-3 - RADIUS - GAP, 4e-3), (0, -1, 0)
    ),
    "mesh": (sheet(3), (1e-4, 2e-4, RADIUS + GAP), (0, 0, 1)),
}  # fmt: skip


@pytest.mark.parametrize("kind", [pytest.param(kind, marks=[pytest.mark.slow] * (kind == "mesh")) for kind in KINDS])
def test_a_wall_pulls_as_a_sphere_of_infinite_radius(kind: str) -> None:
    """R* = R, half of the liquid of the sphere; it breaks at its rupture length, and the sphere gets all back."""
    wall, place, normal = KINDS[kind]
    run, bridges = above(wall, place)
    liquid, volume = bridges.liquid, 0.5 * film_volume(RADIUS, FILM)
    assert bridges.count == 1
    assert bridges.volume[0] == pytest.approx(volume, rel=1e-12)
    pull = capillary.pendular_pull(TENSION, ANGLE, RADIUS, volume, GAP)
    assert run.particles.force[0] == pytest.approx(-pull * np.array(normal), rel=1e-9, abs=1e-9 * pull)
    assert run.wall_force[0] == pytest.approx(pull * np.array(normal), rel=1e-9, abs=1e-9 * pull)
    longest = capillary.rupture_length(0.0, ANGLE, volume)
    for gap, count in ((0.99 * longest, 1), (1.01 * longest, 0)):
        run.particles.position[0] = place + (gap - GAP) * np.array(normal)
        run.refresh()
        assert bridges.count == count
    assert bridges.broken == 1
    assert run.particles.liquid[0] == pytest.approx(liquid, rel=1e-14)


def test_a_finer_triangulation_changes_nothing() -> None:
    """A sphere that slides and rolls over a sheet of triangles, against the plane: positions within 1e-6 of its way."""
    ends = []
    for wall in (Plane(), sheet(1), sheet(3), sheet(16)):
        run, bridges = above(wall, (-1e-3, 0.3e-3, RADIUS + GAP), velocity=(0.5, 0.1, -0.05))
        run.advance(2e-6, 1500)
        assert (bridges.formed, bridges.broken, bridges.count) == (1, 0, 1)
        ends.append(np.concatenate([run.particles.position[0], 1e-3 * run.particles.velocity[0]]))
    way = np.linalg.norm(ends[0][:3] - [-1e-3, 0.3e-3, RADIUS + GAP])
    assert way > 4e-4
    for end in ends[1:]:
        assert np.abs(end - ends[0]).max() < 1e-6 * way


@pytest.mark.slow
def test_liquid_passes_between_particles_and_walls_and_is_kept() -> None:
    """Wet spheres that bounce in a box with wet walls; triangles as its floor."""
    run, bridges = swarm(
        120, WET_WALLS, speed=1.0, box=(None, None, None),
        walls=[Box(low=(-5e-5,) * 3, high=(6.3e-3,) * 3), replace(sheet(5, 2e-2))], skin=1e-4,
    )  # fmt: skip
    liquid = bridges.liquid
    run.advance(1e-6, 3000)
    at_walls = bridges.bodies[:, 1] < 0
    assert at_walls.sum() > 5
    assert bridges.gained_by_walls != 0.0
    assert int(run.walls.patch_count[0]) > 10
    assert bridges.liquid == pytest.approx(liquid, rel=1e-12)
    kept = run.checkpoint()
    again, others = swarm(
        120, WET_WALLS, speed=1.0, box=(None, None, None),
        walls=[Box(low=(-5e-5,) * 3, high=(6.3e-3,) * 3), replace(sheet(5, 2e-2))], skin=1e-4,
    )  # fmt: skip
    again.restore(kept)
    for each in (run, again):
        each.advance(1e-6, 300)
    assert np.array_equal(run.particles.velocity, again.particles.velocity)
    assert bridges.liquid == others.liquid


@pytest.mark.slow
def test_a_bridge_draws_a_disc_of_the_wall_and_returns_half() -> None:
    """At most what the patch has; the rest of the wall keeps its film."""
    run, bridges = above(Plane(), (0.0, 0.0, RADIUS + GAP), WET_WALLS)
    own = 0.5 * film_volume(RADIUS, FILM)
    drawn = 0.5 * np.pi * RADIUS**2 * 1e-5
    assert bridges.volume[0] == pytest.approx(own + drawn, rel=1e-12)
    assert bridges.gained_by_walls == pytest.approx(-drawn, rel=1e-12)
    assert run.edges.bridge_film[0] == pytest.approx(FILM + 1e-5, rel=1e-9)
    run.particles.position[0, 2] += RADIUS
    run.refresh()
    assert bridges.count == 0
    assert bridges.gained_by_walls == pytest.approx(0.5 * (own - drawn), rel=1e-12)


@pytest.mark.slow
def test_a_dry_sphere_on_a_wet_wall_is_resisted_by_what_the_wall_gives() -> None:
    """Below h_min, as Pitois' law has it there for the volume drawn from the wall."""
    laws = replace(WET_WALLS, film="pitois", tangential="none", cut="constant", minimum_gap=5e-6)
    run, bridges = above(Plane(), (0.0, 0.0, RADIUS + 2e-6), laws, film=0.0)
    drawn = 0.5 * np.pi * RADIUS**2 * 1e-5
    expected = lubrication.film_strength(laws.viscosity, RADIUS) * bridge.pitois_share(5e-6, RADIUS, drawn) / 5e-6
    assert bridges.volume[0] == pytest.approx(drawn, rel=1e-12)
    assert run.edges.bridge_resistance[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.slow
def test_a_wall_that_is_wetted_worse_leaves_more_liquid_on_the_particle() -> None:
    laws = replace(WET_WALLS, redistribution="contact_angle", wall_contact_angle=1.2)
    run, bridges = above(Plane(), (0.0, 0.0, RADIUS + GAP), laws)
    volume, gained = bridges.volume[0], bridges.gained_by_walls
    run.particles.position[0, 2] += RADIUS
    run.refresh()
    share = math.cos(1.2) / (math.cos(1.2) + math.cos(ANGLE))
    assert bridges.gained_by_walls - gained == pytest.approx(share * volume, rel=1e-12)
    assert share < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["belt", "drum"])
def test_liquid_of_a_wall_moves_with_its_surface(kind: str) -> None:
    """A belt and a drum stay in place while their surfaces move: a bridge returns liquid where the wall is then."""
    wall: Wall = Plane(velocity=(1.0, 0.0, 0.0))
    place: Any = np.array([0.8e-3, 0.0, RADIUS + GAP])
    inward = np.array([0.0, 0.0, 1.0])
    if kind == "drum":
        wall = Cylinder(point=(0, 0, -4e-3), radius=4e-3, length=8e-3, spin=(0.0, 0.0, 250.0))
        inward = -np.array([np.cos(0.2), np.sin(0.2), 0.0])
        place = (RADIUS + GAP - 4e-3) * inward + [0.0, 0.0, 1e-4]
    run, bridges = above(wall, place, replace(WET_WALLS, viscosity=0.0, film="none", tangential="none", cut="zero"))
    assert bridges.count == 1 and int(run.walls.patch_count[0]) == 1
    for steps, patches in ((500, 1), (1500, 2)):
        run.particles.position[0], run.particles.velocity[0] = place + RADIUS * inward, 0.0
        run.refresh()
        assert bridges.count == 0
        run.particles.force[:] = 0.0
        run.advance(1e-6, steps)
        run.particles.position[0] = place
        run.refresh()
        assert bridges.count == 1
        assert int(run.walls.patch_count[0]) == patches


@pytest.mark.slow
def test_patches_that_are_too_small_are_refused() -> None:
    with pytest.raises(InputError, match="wall_patch"):
        above(Plane(), (0.0, 0.0, RADIUS + GAP), replace(WET_WALLS, wall_patch=0.1 * RADIUS))


@pytest.mark.slow
def test_more_patches_than_there_is_room_for_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Never written beyond the arrays."""
    monkeypatch.setattr(wall_liquid, "PATCHES_OF_A_PARTICLE", 0)
    with pytest.raises(InputError, match="wall_patch"):
        above(Plane(), (0.0, 0.0, RADIUS + GAP), WET_WALLS)


@pytest.mark.slow
def test_energies_do_not_depend_on_the_triangulation() -> None:
    """A bridge that passes from triangle to triangle takes along the energy that is counted for it."""
    found = []
    for wall in (Plane(), sheet(16)):
        run, bridges = above(wall, (-1e-3, 0.3e-3, RADIUS + GAP), velocity=(0.5, 0.1, -0.05), energies=True)
        run.advance(2e-6, 1500)
        assert bridges.count == 1
        assert run.energies is not None
        found.append(dict(zip(run.energies.channels, run.energies.totals)))
    assert found[0]["bridge"] > 0.0
    for name in ("bridge", "bridges_formed", "bridges_broken"):
        assert found[1][name] == pytest.approx(found[0][name], rel=1e-5, abs=1e-6 * found[0]["bridge"])
