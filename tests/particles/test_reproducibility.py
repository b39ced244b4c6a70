"""The same bits on any number of threads, and the same physics whatever the list and the order of particles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cfddem.backend.compile import use_threads
from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.meshes import Mesh
from cfddem.particles.walls.shapes import Cylinder, Plane
from cfddem.particles.walls.wall import Wall

GLASS = Material(
    density=2500,
    youngs_modulus=10e6,
    poisson=0.25,
    restitution=0.8,
    friction=0.5,
    roughness=1e-6,
    friction_lubricated=0.1,
)
RADIUS = 0.5e-3
SIDE = 12 * 2.2 * RADIUS
BELOW = Plane(point=(0.0, 0.0, -1e-3))
DRUM = Cylinder(point=(0.5 * SIDE, 0.5 * SIDE, 0.0), radius=1e-2, spin=(0.0, 0.0, 20.0))
CLOSE_DRUM = replace(DRUM, radius=9.15e-3)
"""The outermost spheres begin 0.02 to 0.1 mm from it."""

CORNERS = ((0.0, 0.0, -0.9), (13.2, 0.0, -0.9), (13.2, 13.2, -0.9), (0.0, 13.2, -0.9), (6.6, 6.6, -0.1))
ROOF = Mesh(
    vertices=np.array(CORNERS) * 1e-3,
    triangles=np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]),
    spin=(0.0, 0.0, 20.0),
)  # fmt: skip


def rain(
    film: bool,
    skin: float | None = None,
    sort_every: int = 5,
    walls: tuple[Wall, ...] = (Plane(),),
    fall: float = 0.0,
) -> ParticleSolver:
    """1 440 spheres of several sizes that fall on a floor in a periodic box or a drum, with and without water.

    fall  mean velocity at the beginning [m/s]
    """
    generator = np.random.default_rng(4)
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in (12, 12, 10)), indexing="ij"), axis=-1).reshape(-1, 3)
    position = (cells + 0.5 + 0.1 * generator.uniform(-1, 1, cells.shape)) * 2.2 * RADIUS
    radius = RADIUS * generator.uniform(0.6, 1.0, len(cells))
    grains = make_particles(
        position,
        radius,
        GLASS.density,
        velocity=generator.normal(0.0, 0.1, cells.shape) - np.array([0.0, 0.0, fall]),
        spin=generator.normal(0.0, 50.0, cells.shape),
        viscosity=1e-3 if film else 0.0,
    )
    return ParticleSolver(
        grains,
        pair_table([GLASS]),
        walls=walls,
        laws=Laws(film=film),
        gravity=(0.0, 0.0, -9.81),
        box=(SIDE, SIDE, None) if walls == (Plane(),) else (None, None, None),
        settings=SolverSettings(skin=skin, sort_every=sort_every),
    )


def by_id(run: ParticleSolver) -> dict[str, np.ndarray]:
    """State of the particles in the order of their ids."""
    order = np.argsort(run.particles.id)
    return {name: getattr(run.particles, name)[order] for name in ("position", "velocity", "spin", "force", "torque")}


@pytest.mark.parametrize(
    ("film", "steps", "walls", "fall"),
    [
        (False, 1000, (BELOW, CLOSE_DRUM), 1.0),
        *(
            pytest.param(film, steps, walls, 0.0, marks=pytest.mark.slow)
            for film, steps, walls in (
                (False, 8000, (BELOW, DRUM)),
                (False, 10_000, (Plane(),)),
                (True, 2000, (Plane(),)),
                (True, 10_000, (BELOW, DRUM)),
                (True, 5000, (BELOW, DRUM, ROOF)),
            )
        ),
    ],
)
def test_bits_do_not_depend_on_the_number_of_threads(
    film: bool, steps: int, walls: tuple[Wall, ...], fall: float
) -> None:
    """Positions, velocities, spins and forces on one and on two threads are equal bit for bit."""
    states = []
    for threads in (1, 2):
        before = use_threads(None)
        try:
            use_threads(threads)
        except ValueError:
            pytest.skip("this machine has one thread")
        run, touched = rain(film, walls=walls, fall=fall), np.zeros(len(walls), bool)
        for _ in range(20):
            run.advance(2e-6, steps // 20)
            touched |= np.abs(run.wall_force).max(axis=1) > 0.0
        states.append(by_id(run))
        use_threads(before)
    for name, values in states[0].items():
        assert np.array_equal(values, states[1][name]), name
    assert run.edges.between_particles > 300 and len(run.edges.first) - run.edges.between_particles > 40
    assert run.lists.made > 5 and (film or touched.all())


@pytest.mark.parametrize("film", [False, True])
def test_list_and_order_change_nothing_but_rounding(film: bool) -> None:
    """Another skin and another sorting interval move nothing by more than rounding that has grown for 500 steps."""
    runs = [rain(film), rain(film, skin=0.3 * RADIUS, sort_every=1), rain(film, sort_every=1000)]
    for run in runs:
        run.advance(2e-6, 500)
    reference = by_id(runs[0])
    for run in runs[1:]:
        other = by_id(run)
        assert np.abs(other["position"] - reference["position"]).max() < 1e-9 * RADIUS
        assert np.abs(other["velocity"] - reference["velocity"]).max() < 1e-9


def test_count_and_names_survive() -> None:
    """No particle is lost or named twice by sorting and listing."""
    run = rain(False)
    run.advance(2e-6, 2000)
    assert np.array_equal(np.sort(run.particles.id), np.arange(run.particles.count))
