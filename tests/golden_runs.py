"""Small runs of all features, and their final states: what a change of the code must not alter.

`python -m tests.golden_runs hashes [RUN ...]` prints a hash of the bits of each run, for two versions on one machine;
`python -m tests.golden_runs freeze [RUN ...]` writes the states to `tests/data/golden`, which `test_golden.py` compares
with, for any machine. Freeze only what has changed on purpose.

Only the first part of this file, up to the runs, knows how states are asked for.
"""

from __future__ import annotations

import hashlib
import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.case.materials import Material
from cfddem.case.schema import Case
from cfddem.fluid.conditions import FreeSlip, Inlet, NoSlip, Outlet, Periodic, discs, rectangle
from cfddem.fluid.grid import Grid
from cfddem.fluid.solver import FluidSolver
from cfddem.io import checkpoint
from cfddem.particles import feeding
from cfddem.particles.initial.packing import random_packing
from cfddem.particles.interactions.bridge import Bridges
from cfddem.particles.interactions.bridge_loops import CONSTANT, DAVIS, DEFORMING, EVEN, NASE, STATIC, BridgeLaws
from cfddem.particles.interactions.contacts.linear import LINEAR
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Box, Cone, Cylinder, Mesh, Plane, Wall
from cfddem.run.simulation import Simulation
from closures.registry import REGISTRY, law
from scenarios.benchmarks import dense_bed

State = dict[str, np.ndarray]

HERE = Path(__file__).parent
FOLDER = HERE / "data" / "golden"
SCENARIOS = HERE.parent / "scenarios"

RUNS: dict[str, Callable[[], State]] = {}
"""All runs by name."""

TIGHT = 1e-11
"""Tolerance of the pressure: so tight that what is left of it does not hide a change."""

FORGOTTEN = 1e-6
"""Springs below this part of the largest are left out: whether they are there may depend on rounding."""

PARTICLES = ("position", "velocity", "spin", "force", "torque")


def golden(function: Callable[[], State]) -> Callable[[], State]:
    """Count a function among the runs."""
    RUNS[function.__name__] = function
    return function


# ---------------------------------------------------------------- how runs are made


def particles(
    position: Any, radius: Any, materials: Sequence[Material], *, of: Any = 0, film: float = 0.0, **state: Any
) -> ParticleSolver:
    """A run of particles alone.

    position, radius  [m]
    materials  of the pair table
    of         material of each particle
    film       viscosity of the fluid between them; none at 0 [Pa s]
    state      velocity, spin, fixed of the particles; liquid = (thickness, laws) of bridges; all else of the solver
    """
    density = np.array([each.density for each in materials])[np.broadcast_to(of, (len(position),))]
    own = {name: state.pop(name) for name in ("velocity", "spin", "fixed") if name in state}
    made = make_particles(np.asarray(position, float), radius, density, material=of, viscosity=film, **own)
    if "liquid" in state:
        state["bridges"] = Bridges(made, *state.pop("liquid"))
    choices = {"film": film > 0.0} | state.pop("laws", {})
    return ParticleSolver(made, pair_table(materials), laws=Laws(**choices), **state)


def stirred_dense_bed(film: bool, speed: float = 0.3) -> ParticleSolver:
    """The standard bed of 1 000 spheres, with random velocities and spins."""
    run, draw = dense_bed.bed(1000, film), np.random.default_rng(1)
    velocity, spin = draw.normal(0.0, speed, (1000, 3)), draw.normal(0.0, 100.0, (1000, 3))
    run.particles.velocity[:], run.particles.spin[:] = velocity[run.particles.id], spin[run.particles.id]
    run.refresh()
    return run


def coupled(text: str | Path, steps: int = 2, **changes: Any) -> Simulation:
    """A case after a few fluid steps.

    text     of the case, or its file among the scenarios
    changes  of the case, with __ for the point: bed__count=3
    """
    values = {name.replace("__", "."): value for name, value in changes.items()}
    case = Case.from_toml(text, values) if isinstance(text, Path) else Case.from_text(text, "case", values)
    return go_on(begun(Simulation(case)), steps)


def begun(simulation: Simulation) -> Simulation:
    """The simulation with a tight tolerance of the pressure."""
    if simulation.fluid is not None:
        simulation.fluid.tolerance = TIGHT
    return simulation


def go_on(simulation: Simulation, steps: int) -> Simulation:
    """Make some fluid steps."""
    for _ in range(steps):
        simulation.step()
    return simulation


def kept_and_restored(simulation: Simulation) -> Simulation:
    """The simulation as a file gives it back."""
    with tempfile.TemporaryDirectory() as folder:
        checkpoint.write(Path(folder), {"simulation": simulation.checkpoint()})
        return begun(Simulation.restored(simulation.case, checkpoint.newest(Path(folder))["simulation"]))


def own_law(kind: str, function: Callable[..., float]) -> Callable[..., float]:
    """A function as a user-defined law, registered once."""
    known = REGISTRY[kind].get(function.__name__)
    return known.function if known else law(kind, "a golden run")(function)


# ---------------------------------------------------------------- how states are read


def particle_state(run: ParticleSolver) -> State:
    """Particles in the order of their ids, in the first image of a periodic box; and what pairs remember."""
    made, order = run.particles, np.argsort(run.particles.id)
    state = {name: getattr(made, name)[order] for name in PARTICLES}
    state["id"] = made.id[order]
    state["time"] = np.array([run.time])
    for axis in np.flatnonzero(np.isfinite(run.box)):
        state["position"][:, axis] %= run.box[axis]
    if run.walls.wall.size:
        state["wall_force"] = run.wall_force
    if run.laws.film:
        state["film_rate"] = made.film_rate[order]
        state["film_minimum_gap"] = _thickest(run, order)
    return state | _pairs(run)


def _thickest(run: ParticleSolver, order: np.ndarray) -> np.ndarray:
    """Largest minimum gap of the films that each particle has, in order [m]."""
    edges, between, most = run.edges, run.edges.between_particles, np.zeros(run.particles.count)
    values = np.where(edges.resistance > 0.0, edges.minimum_gap, 0.0)
    np.maximum.at(most, edges.first, values)
    np.maximum.at(most, edges.second[:between], values[:between])
    return most[order]


def _pairs(run: ParticleSolver) -> State:
    """Springs and rolling springs of pairs by their ids; -1 - n for piece n of the walls."""
    edges, ids, between = run.edges, run.particles.id, run.edges.between_particles
    first = ids[edges.first]
    second = np.append(ids[edges.second[:between]], -1 - edges.second[between:].astype(np.int64))
    swapped = (second >= 0) & (first > second)
    names = np.stack([np.where(swapped, second, first), np.where(swapped, first, second)], axis=1)
    sign, state = np.where(swapped, -1.0, 1.0)[:, None], {}
    for name in ("spring", "roll"):
        values = edges[name] if name in edges else np.zeros((0, 3))
        if len(values) == len(names):
            size = np.linalg.norm(values, axis=1)
            there = np.flatnonzero(size > FORGOTTEN * size.max(initial=0.0))
            there = there[np.lexsort(names[there].T[::-1])]
            state[f"{name}_pair"], state[name] = names[there], (sign * values)[there]
    return state


def fluid_state(simulation: Simulation) -> State:
    """Velocity, pressure and voidage of the cells."""
    assert simulation.fluid is not None
    return field_state(simulation.fluid)


def field_state(fluid: FluidSolver) -> State:
    """Velocity, pressure and voidage of a fluid solver."""
    return {
        "fluid_velocity": np.array(fluid.velocity),
        "pressure": np.array(fluid.pressure),
        "voidage": np.array(fluid.voidage),
    }


def state_of(simulation: Simulation) -> State:
    """Particles and fluid, and the fluid's force on each particle."""
    made = simulation.particles
    state = particle_state(simulation.particle_solver) | {"applied": made.applied[np.argsort(made.id)]}
    return state if simulation.fluid is None else state | fluid_state(simulation)


def counted(run: ParticleSolver) -> State:
    """Energy by channel, and what is stored."""
    assert run.energies is not None
    return {"energies": np.array(run.energies.totals), "mechanical": np.array([run.energies.mechanical(run)])}


def collisions(run: ParticleSolver) -> State:
    """The record of collisions, a column a field, in the order of their ends and ids."""
    assert run.collisions is not None
    table = run.collisions.table
    table = table[np.lexsort((table["second"], table["first"], table["end"]))]
    return {f"encounter_{name}": table[name].copy() for name in table.dtype.names or ()}


def liquid(run: ParticleSolver) -> State:
    """Liquid in films and in bridges."""
    bridges = run.bridges
    assert bridges is not None
    order = np.argsort(run.particles.id)
    return {
        "film_thickness": bridges.film[order],
        "bridge_pair": np.stack([bridges.joined.first, bridges.joined.second], axis=1),
        "bridge_volume": bridges.joined.volume.copy(),
        "bridge_counts": np.array([bridges.formed, bridges.broken]),
    }


def different(one: State, other: State) -> State:
    """Largest difference of two states that must be the same bits."""
    assert one.keys() == other.keys()
    most = max(float(np.abs(one[name].astype(float) - other[name]).max(initial=0.0)) for name in one)
    return {"difference": np.array([most])}


# ---------------------------------------------------------------- two particles

RADIUS = 0.5e-3
BEAD = Material(
    density=2500, youngs_modulus=60e9, contact_modulus=1e8, poisson=0.25, restitution=0.9, friction=0.3,
    friction_lubricated=0.1, rolling_friction=0.05, roughness=1e-6,
)  # fmt: skip
STEEL = Material(density=7800, youngs_modulus=210e9, contact_modulus=5e8, poisson=0.3, restitution=0.8, friction=0.2)


def pair(gap: float, speed: float, slide: float = 0.0, **options: Any) -> ParticleSolver:
    """Two unequal beads that approach each other along x, not far from touching."""
    return particles(
        [[0.0, 0.0, 0.0], [2.2 * RADIUS + gap, 0.0, 0.0]],
        [RADIUS, 1.2 * RADIUS],
        [BEAD],
        velocity=[[speed, slide, 0.0], [-speed, 0.0, 0.5 * slide]],
        spin=[[0.0, 3.0 * slide / RADIUS, 50.0], [10.0, 0.0, -slide / RADIUS]],
        check_steps=False,
        **options,
    )


def bounced(run: ParticleSolver, step: float = 2e-7, steps: int = 100) -> State:
    """The state after a number of steps."""
    run.advance(step, steps)
    return particle_state(run)


@golden
def collision_dry() -> State:
    return bounced(pair(1.03e-6, 0.1))


@golden
def collision_head_on_film() -> State:
    return bounced(pair(1e-5, 0.1, film=1e-3))


@golden
def collision_thick_film() -> State:
    return bounced(pair(2e-5, 0.1, film=0.05), steps=400)


@golden
def collision_oblique() -> State:
    return bounced(pair(1.03e-6, 0.1, 0.05))


@golden
def collision_oblique_film() -> State:
    return bounced(pair(3e-6, 0.1, 0.2, film=1e-3))


@golden
def collision_film_overlap_onset() -> State:
    return bounced(pair(3e-6, 0.1, 0.2, film=1e-3, laws={"friction_onset": "overlap"}))


@golden
def collision_film_verlet() -> State:
    return bounced(pair(1e-5, 0.1, 0.2, film=1e-3, laws={"integrator": "verlet"}))


@golden
def collision_film_short_reach() -> State:
    return bounced(pair(1e-5, 0.1, 0.2, film=1e-3, laws={"cutoff_ratio": 0.01}))


@golden
def collision_rescaled_spring() -> State:
    return bounced(pair(1.03e-6, 0.1, 0.05, laws={"spring": "rescaled"}))


@golden
def collision_two_materials() -> State:
    run = particles(
        [[0.0, 0.0, 0.0], [2.0 * RADIUS + 1.03e-6, 0.0, 0.0]], RADIUS, [BEAD, STEEL], of=[0, 1],
        velocity=[[0.1, 0.05, 0.0], [-0.1, 0.0, 0.0]], film=1e-3, check_steps=False,
    )  # fmt: skip
    return bounced(run)


def against_wall(film: float = 0.0, wall: Wall | None = None, **options: Any) -> ParticleSolver:
    """A bead that meets a floor of steel askew."""
    return particles(
        [[0.0, 0.0, RADIUS + 2e-6]], RADIUS, [BEAD, STEEL], velocity=[[0.05, 0.02, -0.1]], spin=[[0.0, 30.0, 20.0]],
        film=film, walls=[wall or Plane(material=1)], check_steps=False, **options,
    )  # fmt: skip


@golden
def collision_wall() -> State:
    return bounced(against_wall())


@golden
def collision_wall_film() -> State:
    return bounced(against_wall(1e-3))


@golden
def collision_wall_film_verlet() -> State:
    return bounced(against_wall(1e-3, laws={"integrator": "verlet"}))


@golden
def collision_sliding_wall() -> State:
    return bounced(against_wall(1e-3, Plane(material=1, velocity=(0.1, 0.0, 0.05))))


@golden
def linear_contact() -> State:
    laws = {"contact": LINEAR.with_parameters(normal_stiffness=1e5, tangential_stiffness=3e4)}
    return bounced(pair(1.03e-6, 0.1, 0.05, laws=laws))


@golden
def linear_contact_film() -> State:
    laws = {"contact": LINEAR.with_parameters(normal_stiffness=1e5, tangential_stiffness=3e4)}
    return bounced(pair(1.03e-6, 0.1, 0.05, film=1e-3, laws=laws))


@golden
def own_minimum_gap_and_film() -> State:
    """User-defined laws in place of the built-in ones."""

    def golden_gap(approach_speed: float, reduced_radius: float) -> float:
        return 1e-3 * reduced_radius * (1.0 + 10.0 * approach_speed)

    def golden_film(gap: float, viscosity: float, reduced_radius: float) -> float:
        return 4.0 * math.pi * viscosity * reduced_radius**2 / (gap + 1e-7)

    laws = {"minimum_gap": own_law("minimum_gap", golden_gap), "lubrication": own_law("lubrication", golden_film)}
    run = pair(1e-5, 0.1, 0.2, film=1e-3, laws=laws)
    return bounced(run) | {"outside": np.array([run.outside])}


# ---------------------------------------------------------------- swarms


def swarm(
    count: int = 150, materials: Sequence[Material] = (BEAD,), solid: float = 0.5, speed: float = 0.3, **options: Any
) -> ParticleSolver:
    """Unequal spheres close together that move and spin in all directions; in a periodic box if none is given."""
    draw = np.random.default_rng(1)
    size = RADIUS * draw.uniform(0.7, 1.3, count)
    places, box = random_packing(2.0 * size, solid, 1)
    given = {"box": tuple(box)} if "walls" not in options else {}
    velocity, spin = draw.normal(0.0, speed, (count, 3)), draw.normal(0.0, 100.0, (count, 3))
    of = np.arange(count) % len(materials)
    return particles(places, size, materials, of=of, velocity=velocity, spin=spin, **given | options)


def after(run: ParticleSolver, steps: int = 20, step: float = 1e-6) -> State:
    """The state after a few steps."""
    run.advance(step, steps)
    return particle_state(run)


@golden
def periodic_box() -> State:
    return after(swarm(materials=(BEAD, STEEL)), 100)


@golden
def periodic_box_film() -> State:
    return after(swarm(materials=(BEAD, STEEL), film=1e-3), 40)


@golden
def periodic_box_film_verlet() -> State:
    return after(swarm(film=1e-3, laws={"integrator": "verlet"}), 40)


@golden
def dense_bed_dry() -> State:
    return after(stirred_dense_bed(False), step=1e-5)


@golden
def dense_bed_film() -> State:
    return after(stirred_dense_bed(True), step=1e-5)


@golden
def rolling_constant_torque() -> State:
    return after(swarm(laws={"rolling": "constant_torque"}), 40)


@golden
def rolling_spring_dashpot() -> State:
    return after(swarm(laws={"rolling": "spring_dashpot", "rolling_damping": 0.4}), 40)


@golden
def rolling_on_a_floor() -> State:
    run = against_wall(laws={"rolling": "spring_dashpot"}, gravity=(0.0, 0.0, -9.81))
    return bounced(run)


@golden
def cohesion() -> State:
    """Fine dust that sticks to itself and to a floor."""
    dust = Material(density=2500, youngs_modulus=1e8, poisson=0.3, restitution=0.7, friction=0.3, surface_energy=0.02)
    size, draw = 50e-6, np.random.default_rng(2)
    places = (np.indices((3, 3, 3)).reshape(3, -1).T + 0.501) * 2.0 * size
    places = places + draw.uniform(-0.01, 0.01, places.shape) * size
    run = particles(
        places, size, [dust], velocity=draw.normal(0.0, 0.05, places.shape), walls=[Plane()],
        laws={"contact": "jkr"}, check_steps=False,
    )  # fmt: skip
    return after(run, 60, 1e-7)


def wet(laws: BridgeLaws, steps: int = 20) -> State:
    """Spheres with liquid on them."""
    run = swarm(solid=0.45, liquid=(25e-6, laws))
    return after(run, steps, 1e-6) | liquid(run)


@golden
def bridges_pendular() -> State:
    return wet(BridgeLaws(viscosity=0.1, surface_tension=0.07, contact_angle=0.26))


@golden
def bridges_deforming() -> State:
    laws = BridgeLaws(
        viscosity=5.0, surface_tension=0.07, contact_angle=0.26, film=DEFORMING, tangential=DAVIS, minimum_gap=1e-6
    )
    return wet(laws)


@golden
def bridges_static() -> State:
    laws = BridgeLaws(
        viscosity=0.5, surface_tension=0.07, film=STATIC, cut=CONSTANT, tangential=NASE, pull=EVEN,
        minimum_gap=1e-6, every=4,
    )  # fmt: skip
    return wet(laws)


@golden
def energies() -> State:
    floor = Box(low=(-1.0, -1.0, -0.66e-3), high=(1.0, 1.0, 1.0), velocity=(0.3, 0.0, 1.0))
    run = swarm(film=1e-3, walls=[floor], energies=True)
    return after(run, 40) | counted(run)


@golden
def energies_dry_rolling() -> State:
    run = swarm(gravity=(0.0, 0.0, -9.81), laws={"rolling": "constant_torque"}, energies=True)
    return after(run, 40) | counted(run)


@golden
def encounter_record() -> State:
    run = swarm(60, speed=1.0, solid=0.3, record=True)
    return after(run, 400) | collisions(run)


@golden
def encounter_record_film() -> State:
    """The encounter of two, from reach to reach, with the energy that it took."""
    run = pair(0.9 * RADIUS, 1.0, 0.2, film=1e-3, record=True, energies=True)
    return bounced(run, 1e-6, 1500) | collisions(run) | counted(run)


@golden
def held_along_an_axis() -> State:
    """Some spheres that nothing moves, and positions that change in a plane only."""
    fixed = np.arange(150) % 10 == 0
    return after(swarm(film=1e-3, free=(1.0, 1.0, 0.0), fixed=fixed))


# ---------------------------------------------------------------- walls


def near_walls(walls: Sequence[Wall], film: float = 0.0, steps: int = 60, **options: Any) -> State:
    """A small heap of spheres among walls."""
    draw = np.random.default_rng(3)
    places = (np.indices((4, 4, 4)).reshape(3, -1).T - 1.5) * 2.04 * RADIUS
    places = places + draw.uniform(-0.01, 0.01, places.shape) * RADIUS
    run = particles(
        places, RADIUS, [BEAD, STEEL], velocity=draw.normal(0.0, 0.4, places.shape),
        spin=draw.normal(0.0, 100.0, places.shape), film=film, walls=walls, gravity=(0.0, 0.0, -9.81), **options,
    )  # fmt: skip
    return after(run, steps)


HALF = 4.067 * RADIUS
"""Half of the edge of the heap, with a little room."""


@golden
def walls_planes() -> State:
    floor = Plane(point=(0.0, 0.0, -HALF), velocity=(0.1, 0.0, 0.0), material=1)
    side = Plane(point=(-HALF, 0.0, 0.0), normal=(1.0, 0.0, 0.01))
    return near_walls([floor, side, Plane(point=(0.0, HALF, 0.0), normal=(0.0, -1.0, 0.0), velocity=(0.0, -0.2, 0.0))])


@golden
def walls_box_film() -> State:
    return near_walls([Box(low=(-HALF,) * 3, high=(HALF,) * 3, material=1)], film=1e-3)


@golden
def walls_cylinder() -> State:
    round_ = Cylinder(
        point=(0.0, 0.0, -HALF), radius=5.335 * RADIUS, length=2.0 * HALF, caps=True, spin=(0.0, 0.0, 20.0), material=1
    )
    return near_walls([round_])


@golden
def walls_cylinder_film() -> State:
    tube = Cylinder(point=(0.0, 0.0, -HALF), radius=5.335 * RADIUS, length=1.5 * HALF)
    peg = Cylinder(
        point=(0.0, -0.8 * HALF, 0.0), axis=(0, 1, 0), radius=0.43 * RADIUS, length=1.2 * HALF, caps=True, outside=True
    )
    return near_walls([tube, peg], film=1e-3)


HOPPER = Cone(point=(0.0, 0.0, -7.06 * RADIUS), radius=1.75 * RADIUS, top_radius=13.75 * RADIUS, length=12.0 * RADIUS)


@golden
def walls_cone() -> State:
    return near_walls([HOPPER, Plane(point=(0.0, 0.0, -HALF), material=1)])


@golden
def walls_cone_film() -> State:
    return near_walls([HOPPER], film=1e-3)


def plate(bend: float = 0.1, side: int = 4, half: float = 1.5 * HALF) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a plate below the heap, a little uneven."""
    x, y = np.meshgrid(*(np.linspace(-half, half, side + 1),) * 2, indexing="ij")
    z = -HALF + bend * RADIUS * (np.cos(3.0 * x / half) * np.cos(2.0 * y / half) - 1.0)
    corners = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    a, b, c, d = (each.ravel() for each in (corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), faces


def write_stl(path: Path, vertices: np.ndarray, triangles: np.ndarray) -> None:
    """A surface as text."""
    lines = ["solid plate"]
    for corners in vertices[triangles]:
        points = [f"vertex {x:.9e} {y:.9e} {z:.9e}" for x, y, z in corners]
        lines += ["facet normal 0 0 1", "outer loop", *points, "endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid plate", ""]))


@golden
def mesh_from_file() -> State:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plate.stl"
        vertices, triangles = plate()
        write_stl(path, 1e3 * vertices, triangles)
        wall = Mesh.from_stl(path, scale=1e-3, material=1)
    return near_walls([wall])


@golden
def mesh_that_moves() -> State:
    vertices, triangles = plate(0.02)
    return near_walls([Mesh(vertices=vertices, triangles=triangles, velocity=(0.0, 0.1, 0.2), spin=(5.0, 3.0, 30.0))])


@golden
def mesh_film() -> State:
    vertices, triangles = plate(0.02)
    return near_walls([Mesh(vertices=vertices, triangles=triangles, velocity=(0.0, 0.0, 0.05))], film=1e-3)


# ---------------------------------------------------------------- particles that come and go


@golden
def feeding_and_removing() -> State:
    run = swarm(solid=0.55)
    run.advance(1e-6, 20)
    gone = run.remove(run.particles.id % 7 == 3)
    run.advance(1e-6, 10)
    ids = run.insert(gone)
    run.advance(1e-6, 10)
    return particle_state(run) | {"given": np.asarray(ids)}


@golden
def feed_and_outlet() -> State:
    run = particles([[0.0, 0.0, 0.02]], RADIUS, [BEAD], gravity=(0.0, 0.0, -9.81), walls=[Plane(point=(0, 0, 0.01))])
    sizes = np.random.default_rng(5)
    corner, size = (0.0, 0.0, 0.02), (3e-3, 3e-3, 1e-3)
    feed = feeding.Feed(
        1e5,
        corner,
        size,
        lambda n, _: sizes.uniform(0.7e-3, 1.2e-3, n),
        BEAD.density,
        velocity=(0.0, 0.0, -1.0),
        seed=1,
    )
    outlet = feeding.ParticleOutlet(low=(-np.inf, -np.inf, 0.0195))
    for _ in range(12):
        feed(run)
        run.advance(2e-6, 50)
        outlet(run)
    return particle_state(run) | {"moved": np.array([feed.entered, len(feed.waiting), outlet.left, outlet.mass])}


@golden
def followed_by_another_run() -> State:
    """A run over the particles of an earlier one, whose pairs it remembers."""
    first = swarm()
    first.advance(1e-6, 30)
    places = first.particles
    run = ParticleSolver(places, first.table, laws=Laws(), gravity=(0.0, 0.0, -9.81), box=tuple(first.box), after=first)
    return after(run)


@golden
def resumed_particles() -> State:
    """Many wet spheres, stopped and gone on with: the same bits as those that were not stopped."""
    straight, stopped, again = (stirred_dense_bed(True) for _ in range(3))
    straight.advance(1e-5, 20)
    stopped.advance(1e-5, 10)
    again.restore(stopped.checkpoint())
    again.advance(1e-5, 10)
    return different(particle_state(again), particle_state(straight))


# ---------------------------------------------------------------- particles and fluid

BEADS = """
[fluid]
density = 997.0
viscosity = 8.354e-4
[material.alumina]
density = 3585.9
youngs_modulus = 3.0e11
contact_modulus = 1.0e6
poisson = 0.3
restitution = 0.9
friction = 0.1
friction_lubricated = 0.05
roughness = 1.0e-6
[column]
width = 0.024
height = 0.048
cell = 0.006
sides = "free_slip"
[bed]
diameter = 3.087e-3
count = 400
seed = 1
start = "suspended"
initial_velocity = [0.02, 0.01, 0.03]
inlet_velocity = 0.157033
[laws]
drag = "wen_yu"
lubrication = "nijssen"
[run]
until = 1.0
particle_step = 4.0e-5
fluid_step = 1.0e-3
reference_speed = 0.1
"""

SEEDS = """
[fluid]
density = 1.13
viscosity = 1.68144e-5
[material.seed]
density = 1000.0
youngs_modulus = 1.2e8
contact_modulus = 1.0e6
poisson = 0.3
restitution = 0.986
friction = 0.1
[material.wall]
density = 1000.0
youngs_modulus = 1.2e8
contact_modulus = 1.0e6
poisson = 0.3
[column]
width = 0.0144
height = 0.0192
cell = 0.0024
material = "wall"
[bed]
material = "seed"
diameter = 1.2e-3
count = 500
seed = 1
start = "suspended"
inlet_velocity = [[0.0, 0.1], [0.1, 0.66]]
[laws]
drag = "beetstra"
lubrication = "none"
self_disturbance_correction = false
[run]
until = 1.0
particle_step = 1.0e-5
fluid_step = 2.0e-4
reference_speed = 0.4
"""

MIXTURE = """
[fluid]
density = 1000.0
viscosity = 1e-3
[material.glass]
density = 2500.0
youngs_modulus = 60e9
contact_modulus = 2e6
poisson = 0.25
restitution = 0.9
friction = 0.3
[material.plastic]
density = 1500.0
youngs_modulus = 2e9
contact_modulus = 2e6
poisson = 0.3
restitution = 0.8
friction = 0.2
[column]
width = 0.012
height = 0.024
cell = 0.003
[bed]
start = "suspended"
inlet_velocity = 0.05
[bed.species.beads]
material = "glass"
diameter = 1e-3
count = 200
[bed.species.pellets]
material = "plastic"
diameter = 2e-3
spread = 0.05
count = 40
[laws]
drag = "beetstra_polydisperse"
lubrication = "none"
[run]
until = 1.0
particle_step = 1e-5
fluid_step = 3e-4
reference_speed = 0.1
"""


@golden
def settling_sphere() -> State:
    return state_of(
        coupled(
            SCENARIOS / "beds" / "settling" / "case.toml",
            4,
            column__width=0.016,
            column__height=0.024,
            bed__positions=[[0.0083, 0.0079, 0.0171]],
        )
    )


@golden
def packed_bed() -> State:
    small = {"column__width": 0.006, "column__height": 0.012, "bed__count": 450}
    return state_of(coupled(SCENARIOS / "beds" / "packed_bed" / "case.toml", **small))


@golden
def liquid_bed() -> State:
    return state_of(coupled(BEADS))


@golden
def liquid_bed_all_forces() -> State:
    changes = {f"laws__{name}": True for name in ("lift", "torque", "viscous_stress")}
    return state_of(coupled(BEADS, laws__added_mass=0.5, **changes))


@golden
def liquid_bed_model_b() -> State:
    changes = {
        "laws__model": "B",
        "laws__mapping": "centroid",
        "laws__convection": "central",
        "laws__kernel_width": 0.0,
    }
    return state_of(coupled(BEADS, column__sides="periodic", **changes))


@golden
def liquid_bed_divided() -> State:
    return state_of(coupled(BEADS, column__sides="no_slip", laws__mapping="divided"))


@golden
def liquid_bed_counted() -> State:
    """Energies counted, collisions recorded."""
    simulation = coupled(BEADS, run__energy_budget=True, run__record_collisions=True)
    assert simulation.energy is not None
    row = simulation.energy.row()
    ledger = {"ledger": np.array([row[name] for name in sorted(row)])}
    return state_of(simulation) | counted(simulation.particle_solver) | collisions(simulation.particle_solver) | ledger


@golden
def closed_box_in_layers() -> State:
    """A closed box and a viscosity that changes with height."""
    layers = [[0.0, 1e-3], [0.024, 5e-3]]
    return state_of(coupled(BEADS, column__ends="closed", bed__inlet_velocity=0.0, fluid__viscosity_profile=layers))


@golden
def periodic_fluid() -> State:
    return state_of(coupled(BEADS, column__sides="periodic", column__ends="periodic", bed__inlet_velocity=0.0))


@golden
def gas_bed_cylinder() -> State:
    """In a round column that is closed, whose corner cells are solid."""
    middle, places = 0.0072, (np.indices((10, 10, 6)).reshape(3, -1).T + 0.53) * 1.25e-3
    places = places[np.hypot(places[:, 0] - middle, places[:, 1] - middle) < middle - 0.61e-3]
    text = SEEDS.replace("count = 500", f"positions = {places.tolist()}").replace('"suspended"', '"placed"')
    closed = {"column__shape": "cylinder", "column__ends": "closed", "bed__inlet_velocity": 0.0}
    return state_of(coupled(text, bed__initial_velocity=[0.1, 0.2, -0.3], **closed))


@golden
def gas_bed_flat() -> State:
    flat = {"column__depth": 0.006, "column__cell": [0.0024, 0.006, 0.0024], "column__front": "periodic"}
    flat |= {"column__height": 0.0096, "bed__start": "packed"}
    jet = {"velocity": 1.0, "width": 0.003}
    return state_of(coupled(SEEDS, column__sides="no_slip", bed__jet=jet, bed__count=450, **flat))


@golden
def gas_bed_of_many() -> State:
    """So many that loops run on all threads and particles are sorted by place."""
    changes = {
        "column__height": 0.0144,
        "bed__start": "packed",
        "bed__count": 1150,
        "bed__initial_velocity": [0.3, 0.2, 0.1],
    }
    return state_of(coupled(SEEDS, **changes))


@golden
def mixture() -> State:
    return state_of(coupled(MIXTURE))


@golden
def resumed() -> State:
    """A coupled run that is stopped, kept in a file and gone on with: the same bits as one that is not stopped."""
    straight = state_of(coupled(BEADS, 4))
    again = state_of(go_on(kept_and_restored(coupled(BEADS, 2)), 2))
    return again | different(again, straight)


@golden
def dry_case() -> State:
    """A case without a fluid."""
    text = SEEDS.split("[material.seed]", 1)[1].replace("inlet_velocity = [[0.0, 0.1], [0.1, 0.66]]", "")
    text = text.replace(
        'drag = "beetstra"\nlubrication = "none"\nself_disturbance_correction = false', 'contact = "hertz"'
    )
    return state_of(coupled("[material.seed]" + text, bed__initial_velocity=[0.1, 0.2, -0.3]))


@golden
def fluid_alone() -> State:
    """Through a hole in the floor around a solid block, with sub-grid viscosity, a source and a lid that slides."""
    block = rectangle((0.003, 0.002, 0.003), (0.006, 0.005, 0.006))
    inlet = Inlet(0.2, where=discs([(0.004, 0.004)], diameter=0.004))
    sides = {"x_low": NoSlip((0.0, 0.1, 0.05)), "x_high": FreeSlip(), "y_low": Periodic(), "y_high": Periodic()}
    grid = Grid.of_size((0.008, 0.008, 0.01), 0.001, solid=block)
    fluid = FluidSolver(
        grid,
        {**sides, "z_low": [NoSlip(), inlet], "z_high": Outlet()},
        density=1.2, viscosity=1.8e-5, smagorinsky=0.1, gravity=(0.0, 0.0, -9.81), tolerance=TIGHT,
    )  # fmt: skip
    source = np.random.default_rng(6).normal(0.0, 1.0, (*grid.shape, 3)) * ~block(*grid.centres())[..., None]
    for _ in range(4):
        fluid.step(5e-4, source=source)
    return field_state(fluid)


# ---------------------------------------------------------------- hashes and files


def digest(state: State) -> str:
    """Hash of all bits of a state."""
    made = hashlib.sha256()
    for name in sorted(state):
        values = np.ascontiguousarray(state[name])
        made.update(f"{name} {values.dtype.str} {values.shape}".encode())
        made.update(values.tobytes())
    return made.hexdigest()


def main(words: Sequence[str]) -> int:
    """The command: hashes or freeze, and perhaps names of runs."""
    names = list(words[1:]) or list(RUNS)
    if not words or words[0] not in ("hashes", "freeze") or not set(names) <= set(RUNS):
        print(f"usage: python -m tests.golden_runs hashes|freeze [RUN ...]\nruns: {', '.join(RUNS)}", file=sys.stderr)
        return 2
    for name in names:
        state = RUNS[name]()
        print(digest(state), name, flush=True)
        if words[0] == "freeze":
            FOLDER.mkdir(parents=True, exist_ok=True)
            np.savez_compressed(FOLDER / f"{name}.npz", **state)  # type: ignore[arg-type]
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
