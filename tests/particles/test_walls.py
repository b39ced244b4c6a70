"""Walls of every kind carry, drag, turn back and lubricate a sphere as their shape says, edges of meshes unseen."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from solver_options import grouped

from cfddem.backend.communicator import SERIAL
from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.case.walls import CaseWall
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.meshes import Mesh
from cfddem.particles.walls.shapes import Box, Cone, Cylinder, Plane
from cfddem.particles.walls.wall import Wall
from cfddem.run import history
from cfddem.run.wall_loads import wall_load_columns, wall_loads
from closures import contact

RADIUS, GRAVITY = 1e-3, 9.81
SOLID = Material(density=2500, youngs_modulus=1e8, poisson=0.3, friction=0.5, roughness=1e-7)
STEP = 2e-6
MASS = SOLID.density * 4.0 / 3.0 * math.pi * RADIUS**3


def sphere(
    place: list[float], walls: list[Wall], *, solid: Material = SOLID, film: float = 0.0, velocity: object = 0.0,
    gravity: tuple[float, float, float] = (0.0, 0.0, -GRAVITY),
) -> ParticleSolver:  # fmt: skip
    """One sphere and walls; `film` is the viscosity [Pa s]."""
    made = make_particles([place], RADIUS, solid.density, velocity=velocity, viscosity=film)  # type: ignore[arg-type]
    return ParticleSolver(
        made,
        pair_table([solid]),
        walls=walls,
        laws=Laws(film=film > 0.0),
        gravity=gravity,
        settings=SolverSettings(
            record=film > 0.0
        ),  # recording changes no motion; all spheres with films share one set of loops
    )


def overlap(force: float, solid: Material = SOLID) -> float:
    """Overlap of a sphere that is pressed on a wall [m]."""
    stiffness = contact.hertz_stiffness(float(pair_table([solid])[0, 0]["contact_modulus"]), RADIUS)
    return (force / stiffness) ** (2.0 / 3.0)


def sheet(count: int, fold: float = 0.0, size: float = 0.02) -> Mesh:
    """A square of 2 count^2 triangles about the origin, folded along x = 0; slopes are `fold` [-]."""
    x = np.linspace(-0.5 * size, 0.5 * size, count + 1)
    along, across = (grid.ravel() for grid in np.meshgrid(x, x, indexing="ij"))
    row = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    a, b, c, d = (part.ravel() for part in (row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(vertices=np.stack([along, across, fold * np.abs(along)], axis=1), triangles=triangles)


def trace(wall: Wall, film: float) -> np.ndarray:
    """State of a sphere that slides, rolls and crosses many edges of the sheet."""
    run = sphere([-0.004, -0.0031, RADIUS], [wall], velocity=[0.1, 0.07, 0.0], film=film)
    made, states = run.particles, []
    for _ in range(200):
        run.advance(STEP, 100)
        states.append(np.concatenate([made.position[0], made.velocity[0], made.spin[0], made.force[0]]))
    return np.array(states)


@pytest.mark.parametrize("film", [0.0, 1e-3], ids=["dry", "film"])
def test_a_flat_mesh_is_a_plane(film: float) -> None:
    """Over 2, 98 and 3200 triangles, from slip to roll: the state on a plane bit by bit, every edge unseen."""
    plane = trace(Plane(), film)
    for count in (1, 7, 40):
        assert np.array_equal(trace(sheet(count), film), plane)


def test_a_plane_from_a_file_is_a_plane(tmp_path: Path) -> None:
    """STL written and read back: the trajectory of the analytic plane to 1e-12."""
    pyvista = pytest.importorskip("pyvista")
    file = tmp_path / "floor.stl"
    pyvista.Plane(i_size=0.02, j_size=0.02, i_resolution=9, j_resolution=4).triangulate().save(file)
    plane, mesh = trace(Plane(), 0.0), trace(Mesh.from_stl(file), 0.0)
    assert np.abs(mesh - plane).max() <= 1e-12 * np.abs(plane).max()


@pytest.mark.parametrize("fold", [-0.3, -0.02, -0.002, 0.002, 0.02, 0.3])
@pytest.mark.parametrize(
    "way", [pytest.param((1.0, 0.0), marks=pytest.mark.slow, id="straight"), pytest.param((0.8, 0.6), id="slant")]
)
def test_force_does_not_jump_at_a_fold(fold: float, way: tuple[float, float]) -> None:
    """Over ridges and grooves of any angle: the force changes with the distance, however short the steps."""
    wall, depth = sheet(6, fold), overlap(MASS * GRAVITY)
    run = sphere([0.0, 0.0, RADIUS], [wall], solid=SOLID.model_copy(update={"friction": 0.0}))

    def forces(count: int) -> np.ndarray:
        found = []
        for s in np.linspace(-0.06e-3, 0.06e-3, count):
            x = s * way[0]
            height = fold * abs(x) + RADIUS * math.sqrt(1.0 + fold**2) - depth
            height = min(height, RADIUS - depth) if fold < 0.0 else height
            run.particles.position[0] = [x, 0.0011 + s * way[1], height]
            run.refresh()
            found.append(run.particles.force[0] + [0.0, 0.0, MASS * GRAVITY])
        return np.array(found)

    coarse, fine = (np.linalg.norm(np.diff(forces(count), axis=0), axis=1).max() for count in (3001, 30001))
    scale = np.linalg.norm(forces(101), axis=1).max()
    assert fine <= 0.2 * coarse + 1e-12 * scale
    assert fine <= 0.02 * scale, (coarse, fine, scale)


def cup(low: float, high: float) -> Mesh:
    """The six sides of a cube as twelve triangles."""
    pyvista = pytest.importorskip("pyvista")
    cube = pyvista.Box((low, high) * 3).triangulate()
    return Mesh(vertices=np.array(cube.points, float), triangles=cube.faces.reshape(-1, 4)[:, 1:])


def test_a_corner_of_a_mesh_carries_as_three_walls() -> None:
    """Pressed into a corner of a mesh a sphere rests as in a box of planes, each side holding its part of the weight.

    The overlaps are those of Hertz' law within the 1 % by which the dashpot of a time step sees its own kick.
    """
    solid = SOLID.model_copy(update={"friction": 0.0, "restitution": 0.2})
    pull = np.array([-1.0, -2.0, -3.0])
    box = Box(low=(0.0, 0.0, 0.0), high=(0.01, 0.01, 0.01))
    places = []
    for wall in (cup(0.0, 0.01), box):
        run = sphere([RADIUS, RADIUS, RADIUS], [wall], solid=solid, gravity=tuple(pull))
        run.advance(STEP, 20000)
        depth = [overlap(MASS * abs(part), solid) for part in pull]
        assert RADIUS - run.particles.position[0] == pytest.approx(depth, rel=1e-2)
        places.append(run.particles.position[0].copy())
        assert run.wall_force[0] == pytest.approx(MASS * pull, rel=1e-6)
    assert places[0] == pytest.approx(places[1], rel=1e-12)


def test_a_sphere_turns_about_edge_and_corner_of_a_mesh() -> None:
    """Outside a cube the force is along the line to the nearest point of edge and corner, once, not per triangle."""
    cube = cup(-0.005, 0.0)
    run = sphere([0.0, 0.0, 1.0], [cube], gravity=(0.0, 0.0, 0.0))
    depth = 1e-6
    expected = contact.hertz_force(contact.hertz_stiffness(float(run.table[0, 0]["contact_modulus"]), RADIUS), depth)
    for direction in ((1.0, 0.0, 1.0), (1.0, 0.0, 2.0), (1.0, 1.0, 1.0), (3.0, 1.0, 2.0)):
        normal = np.array(direction) / np.linalg.norm(direction)
        foot = np.where(normal > 0.0, 0.0, -0.002)
        again = sphere(list(foot + (RADIUS - depth) * normal), [cube], gravity=(0.0, 0.0, 0.0))
        assert again.particles.force[0] == pytest.approx(expected * normal, rel=1e-6, abs=1e-9 * expected)


def test_a_crossing_is_one_collision() -> None:
    """In the record a sphere that meets a mesh and crosses its edges has one collision, with the wall's number."""
    run = sphere(
        [-0.004, 0.0003, 2.2 * RADIUS], [Plane(point=(0.0, 0.0, -1.0)), sheet(7)], velocity=[1.0, 0.0, -0.5], film=1e-3,
        gravity=(0.0, 0.0, 0.0),
    )  # fmt: skip
    run.advance(STEP, 10000)
    assert run.collisions is not None
    table = run.collisions.table
    assert len(table) == 1
    assert table["second"][0] == -2
    assert table["approach_speed"][0] == pytest.approx(0.5, rel=1e-3)


def test_a_sphere_swings_in_a_cylinder() -> None:
    """Rolling without slip in a trough: T = 2 pi sqrt(1.4 (b - R)/g) (1 + a^2/16) and the energy to 1e-4."""
    wide, start = 10.0 * RADIUS, 0.1
    arm = wide - RADIUS
    run = sphere(
        [0.0, (arm + overlap(MASS * GRAVITY)) * math.sin(start), -(arm + overlap(MASS * GRAVITY)) * math.cos(start)],
        [Cylinder(axis=(1.0, 0.0, 0.0), radius=wide)],
    )  # fmt: skip
    made = run.particles

    def energy() -> float:
        speeds = np.sum(made.velocity**2) + 0.4 * RADIUS**2 * np.sum(made.spin**2)
        return 0.5 * float(speeds) + GRAVITY * float(made.position[0, 2] + arm)

    whole, crossings, before = energy(), [], made.position[0, 1]
    while len(crossings) < 3:
        run.advance(STEP, 50)
        now = made.position[0, 1]
        if before > 0.0 >= now or before < 0.0 <= now:
            crossings.append(run.time - 50 * STEP * now / (now - before))
            assert energy() == pytest.approx(whole, abs=1e-4 * 0.5 * GRAVITY * arm * start**2)
        before = now
    period = 2.0 * math.pi * math.sqrt(1.4 * arm / GRAVITY) * (1.0 + start**2 / 16.0)
    assert crossings[2] - crossings[0] == pytest.approx(period, rel=1e-4)


@pytest.mark.parametrize(("friction", "share"), [(0.0, 1.0), (0.9, 5.0 / 7.0)], ids=["slides", "rolls"])
def test_a_sphere_goes_down_a_cone(friction: float, share: float) -> None:
    """Along the side of a hopper of 30 degrees: g cos(30 deg), or 5/7 of it where it rolls, within 1e-3."""
    slope = math.radians(30.0)
    cone = Cone(radius=0.0, top_radius=0.05 * math.tan(slope), length=0.05)
    solid = SOLID.model_copy(update={"friction": friction, "restitution": 0.3})
    depth = overlap(MASS * GRAVITY * math.sin(slope), solid)
    down, inward = (
        np.array([-math.sin(slope), 0.0, -math.cos(slope)]),
        np.array([-math.cos(slope), 0.0, math.sin(slope)]),
    )
    start = -0.045 / math.cos(slope) * down + (RADIUS - depth) * inward
    run = sphere(list(start), [cone], solid=solid)
    run.advance(STEP, 25000)
    run_way = float((run.particles.position[0] - start) @ down)
    assert run_way == pytest.approx(0.5 * share * GRAVITY * math.cos(slope) * run.time**2, rel=1e-3)


def test_a_turning_drum_drags_a_sphere() -> None:
    """At the bottom of a turning drum a sphere first slips: v = mu g t sideways, R w = 5/2 mu g t, within 1 %."""
    solid = SOLID.model_copy(update={"restitution": 0.3, "friction": 0.2})
    drum = Cylinder(axis=(1.0, 0.0, 0.0), radius=0.05, length=0.02, caps=True, spin=(30.0, 0.0, 0.0))
    run = sphere([0.01, 0.0, -(0.05 - RADIUS + overlap(MASS * GRAVITY))], [drum], solid=solid)
    run.advance(STEP, 5000)
    gained = 0.2 * GRAVITY * run.time
    assert run.particles.velocity[0, 1] == pytest.approx(gained, rel=1e-2)
    assert RADIUS * run.particles.spin[0, 0] == pytest.approx(2.5 * gained, rel=1e-2)


MOVING = {
    "plane": Plane(point=(0.0, 0.0, -0.01), velocity=(0.0, 0.0, 0.5)),
    "mesh": Mesh(
        vertices=np.array([[-0.02, -0.02, -0.01], [0.03, -0.02, -0.01], [0.0, 0.03, -0.01]]),
        triangles=np.array([[0, 1, 2]]),
        velocity=(0.0, 0.0, 0.5),
    ),
    "rod": Cylinder(
        point=(0.0, 0.0, -0.03), radius=0.01, length=0.02, caps=True, outside=True, velocity=(0.0, 0.0, 0.5)
    ),
    "paddle": Mesh(
        vertices=np.array([[0.02, -0.01, -0.01], [-0.02, -0.01, -0.01], [0.0, 0.02, -0.01]]),
        triangles=np.array([[0, 1, 2]]),
        spin=(0.0, 5.0, 0.0),
        centre=(0.1, 0.0, -0.01),
    ),
}


@pytest.mark.parametrize("kind", MOVING)
def test_a_moving_wall_gives_momentum(kind: str) -> None:
    """A wall that comes from ten radii away strikes on time, and sends off at twice its speed what its force gave."""
    solid = SOLID.model_copy(update={"friction": 0.0})
    run = sphere([0.0, 0.0, RADIUS], [MOVING[kind]], solid=solid, gravity=(0.0, 0.0, 0.0))
    given, struck = np.zeros(3), np.inf
    for _ in range(6000):
        run.advance(5e-6)
        given -= run.wall_force[0] * 5e-6
        if struck == np.inf and given.any():
            struck = run.time
    angle = math.atan2(0.01, 0.1) if kind == "paddle" else 0.0
    assert struck == pytest.approx(angle / 5.0 if kind == "paddle" else 0.02, rel=2e-3)
    assert MASS * run.particles.velocity[0] == pytest.approx(given, abs=1e-6 * MASS)
    assert np.linalg.norm(run.particles.velocity[0]) == pytest.approx(1.0, rel=2e-2 if kind == "paddle" else 2e-3)


def case_with_a_paddle() -> SimpleNamespace:
    """What the loads on walls read of a case: one wall that spins, without a column around it."""
    paddle = CaseWall(shape="cylinder", axis=(0.0, 1.0, 0.0), radius=1.0, spin=(0.0, 5.0, 0.0))
    open_space = SimpleNamespace(ends="periodic", sides="periodic", front=None, size=(0.0, 0.0, 0.0))
    return SimpleNamespace(
        wall=(paddle,), column=open_space, line=None, vessel=None, has_fluid=False,
        run=SimpleNamespace(wall_forces=False),
    )  # fmt: skip


def test_the_power_and_torque_of_a_paddle_are_what_the_sphere_gains() -> None:
    """Over an elastic strike: the power sums up to the kinetic energy, the torque to the angular momentum."""
    solid = SOLID.model_copy(update={"friction": 0.0})
    run = sphere([0.0, 0.0, RADIUS], [MOVING["paddle"]], solid=solid, gravity=(0.0, 0.0, 0.0))
    case = case_with_a_paddle()
    simulation = SimpleNamespace(particle_solver=run, case=case, communicator=SERIAL)
    assert set(wall_loads(simulation)) == set(wall_load_columns(case))  # type: ignore[arg-type]
    run.advance(STEP, 9900)
    given = dict.fromkeys(wall_load_columns(case), 0.0)  # type: ignore[arg-type]
    for _ in range(400):
        run.advance(STEP)
        given = {name: total + wall_loads(simulation)[name] * STEP for name, total in given.items()}  # type: ignore[arg-type]
    place, velocity = run.particles.position[0], run.particles.velocity[0]
    assert np.linalg.norm(velocity) > 0.9
    assert given["wall_0_power"] == pytest.approx(0.5 * MASS * velocity @ velocity, rel=2e-3)
    momentum = MASS * np.cross(place - np.array([0.1, 0.0, -0.01]), velocity)[1]
    assert given["wall_0_torque"] == pytest.approx(-momentum, rel=2e-3)
    assert [given[f"wall_0_force_{axis}"] for axis in "xyz"] == pytest.approx(-MASS * velocity, abs=1e-6 * MASS)


def test_the_film_of_a_paddle_is_in_its_force_and_torque() -> None:
    """The film alone takes the sphere along, without contact: the loads sum up to its momentum."""
    run = sphere([0.0, 0.0, RADIUS], [MOVING["paddle"]], film=1.0, gravity=(0.0, 0.0, 0.0))
    case = case_with_a_paddle()
    simulation = SimpleNamespace(particle_solver=run, case=case, communicator=SERIAL)
    given = dict.fromkeys(wall_load_columns(case), 0.0)  # type: ignore[arg-type]
    for _ in range(2500):
        run.advance(10.0 * STEP)
        given = {name: total + wall_loads(simulation)[name] * 10.0 * STEP for name, total in given.items()}  # type: ignore[arg-type]
    place, velocity = run.particles.position[0], run.particles.velocity[0]
    assert np.linalg.norm(velocity) > 0.1 and not run.wall_force.any()
    assert [given[f"wall_0_force_{axis}"] for axis in "xyz"] == pytest.approx(-MASS * velocity, abs=2e-3 * MASS)
    momentum = MASS * np.cross(place - np.array([0.1, 0.0, -0.01]), velocity)[1]
    assert given["wall_0_torque"] == pytest.approx(-momentum, rel=5e-3)


def test_a_film_that_stops_a_sphere_is_in_the_load_of_the_walls(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without contact: the load of the history, over the steps, is the momentum that the sphere has lost."""
    monkeypatch.setattr(history, "open_area", lambda _: 2.0)
    run = sphere([0.0, 0.0, 1.1 * RADIUS], [Plane()], film=1.0, gravity=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, -0.01))
    simulation, given = SimpleNamespace(particle_solver=run, case=None), 0.0
    for _ in range(500):
        run.advance(STEP)
        given += 2.0 * history.wall_load(simulation) * STEP  # type: ignore[arg-type]
    lost = MASS * (run.particles.velocity[0, 2] + 0.01)
    assert lost > 0.5 * 0.01 * MASS and not run.wall_force.any()
    assert given == pytest.approx(lost, rel=1e-3)


@pytest.mark.parametrize("wall", [Box(low=(-0.02, -0.02, 0.0), high=(0.02, 0.02, 0.02)), sheet(5, size=0.04)], ids=str)
def test_a_floor_carries_the_weight(wall: Wall) -> None:
    """Forty-nine spheres come to rest: the floor carries their weight to 1e-4."""
    solid = SOLID.model_copy(update={"restitution": 0.2})
    x = 2.2 * RADIUS * np.arange(-3, 4)
    place = np.stack([*(grid.ravel() for grid in np.meshgrid(x, x)), np.full(49, 1.05 * RADIUS)], axis=1)
    made = make_particles(place, RADIUS, solid.density)
    run = ParticleSolver(made, pair_table([solid]), walls=[wall], gravity=(0.0, 0.0, -GRAVITY))
    run.advance(5e-6, 20000)
    assert run.wall_force[0] == pytest.approx([0.0, 0.0, -49.0 * MASS * GRAVITY], rel=1e-4, abs=1e-9)


WET = {
    "plane": (Plane(), (0.0, 0.0, 1.0)),
    "box": (Box(low=(-0.05, -0.05, 0.0), high=(0.05, 0.05, 0.1)), (0.0, 0.0, 1.0)),
    "inside a cylinder": (Cylinder(point=(0.0, 0.0, 0.05), axis=(0.0, 1.0, 0.0), radius=0.05), (0.0, 0.0, 1.0)),
    "outside a cylinder": (Cylinder(point=(0, 0, -0.05), axis=(0, 1, 0), radius=0.05, outside=True), (0.0, 0.0, 1.0)),
    "tube": (Cylinder(point=(0, -0.05, 0.05), axis=(0, 1, 0), radius=0.05, length=0.1), (0.0, 0.0, 1.0)),
    "end of a rod": (Cylinder(point=(0, 0, -1), radius=0.05, length=1.0, caps=True, outside=True), (0.0, 0.0, 1.0)),
    "cone": (Cone(point=(0.0, 0.0, -0.1), radius=0.1, top_radius=0.2, length=0.2), (-2.0, 0.0, 1.0)),
    "mesh": (sheet(7), (0.0, 0.0, 1.0)),
}


@pytest.mark.parametrize("kind", WET)
def test_a_film_stops_a_slow_sphere_at_every_wall(kind: str) -> None:
    """From h_co = R on the film alone stops a sphere at h_co exp(-St), within 1e-3."""
    wall, direction = WET[kind]
    normal = np.array(direction) / np.linalg.norm(direction)
    foot = np.array([0.15, 0.0, 0.0]) if kind == "cone" else np.zeros(3)
    viscosity, number = 0.01, 3.0
    speed = number * 6.0 * math.pi * viscosity * RADIUS**2 / MASS
    run = sphere(
        list(foot + 2.001 * RADIUS * normal), [wall], velocity=-speed * normal, film=viscosity, gravity=(0.0, 0.0, 0.0)
    )
    run.advance(0.002 * RADIUS / speed, 20000)
    gap = float((run.particles.position[0] - foot) @ normal) - RADIUS
    assert gap == pytest.approx(RADIUS * math.exp(-number), rel=1e-3)


def test_walls_repeat_in_a_periodic_box() -> None:
    """A floor and a trough along the periodic axis are taken; a wall across it is refused."""
    made = make_particles([[0.01, 0.0, 0.0]], RADIUS, SOLID.density)
    along = {"box": (0.02, None, None), "skin": 1e-4}
    for wall in (Plane(point=(0.0, 0.0, -RADIUS)), Cylinder(axis=(1.0, 0.0, 0.0), radius=0.02)):
        ParticleSolver(made, pair_table([SOLID]), walls=[wall], **grouped(**along))  # type: ignore[arg-type]
    for wall in (Plane(normal=(1.0, 0.0, 0.0)), Cylinder(radius=0.02), sheet(2)):
        with pytest.raises(InputError, match="periodic"):
            ParticleSolver(made, pair_table([SOLID]), walls=[wall], **grouped(**along))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Plane(normal=(0.0, 0.0, 0.0)), "normal"),
        (lambda: Plane(spin=(1.0, 0.0, 0.0)), "along the normal"),
        (lambda: Cylinder(radius=-1.0), "radius"),
        (lambda: Cylinder(radius=1.0, caps=True), "no length"),
        (lambda: Cylinder(radius=1.0, spin=(1.0, 0.0, 0.0)), "about the axis"),
        (lambda: Cone(top_radius=1.0, length=0.0), "length"),
        (lambda: Box(low=(0.0, 0.0, 0.0), high=(1.0, 0.0, 1.0)), "high"),
        (lambda: Mesh(vertices=np.zeros((3, 3)), triangles=np.array([[0, 1, 2]])), "area"),
        (lambda: Mesh.from_stl("nowhere.stl"), "readable"),
        (lambda: sphere([0.0, 0.0, 1.0], [Plane(material=3)]), "material of wall 0"),
    ],
)
def test_a_wall_that_cannot_be_is_refused(make: object, words: str) -> None:
    """One line that names the field."""
    with pytest.raises(InputError, match=words):
        make()  # type: ignore[operator]
