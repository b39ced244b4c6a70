"""A fluid at rest without a fluid solver: falls, added mass beside a wall, and what it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from solver_options import grouped

from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.coupling.quiescent_fluid import QuiescentFluid
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures.added_mass import near_wall
from closures.balance import Sphere, speed_after
from closures.drag_single import schiller_naumann
from closures.registry import law_of
from scenarios.beds.settling import study as settling

GLASS = Material(density=2560.0, youngs_modulus=1e5, poisson=0.23)
DIAMETER, WATER, VISCOSITY = 5e-4, 1000.0, 8.9e-4


def sphere(velocity: float = 0.0, height: float = 1.0, **changes: object) -> ParticleSolver:
    one = make_particles([[0.0, 0.0, height]], 0.5 * DIAMETER, GLASS.density, velocity=[0.0, 0.0, velocity])
    return ParticleSolver(one, pair_table([GLASS]), **grouped(check_steps=False, **changes))  # type: ignore[arg-type]


def fall(history: str, step: float, until: float) -> tuple[np.ndarray, np.ndarray]:
    run = sphere()
    fluid = QuiescentFluid(run, WATER, VISCOSITY, law_of(schiller_naumann), history=history, gravity=(0.0, 0.0, -9.81))  # type: ignore[arg-type]
    speeds = [0.0]
    for _ in range(round(until / step)):
        fluid.advance(step)
        speeds.append(-float(run.particles.velocity[0, 2]))
    return step * np.arange(len(speeds)), np.array(speeds)


def test_a_fall_follows_the_equation_of_motion() -> None:
    times, speeds = fall("none", 2e-4, 0.1)
    sphere = Sphere(DIAMETER, GLASS.density, WATER, VISCOSITY, schiller_naumann, 9.81)
    for place in (50, 150, 500):
        assert speeds[place] == pytest.approx(speed_after(times[place], 0.0, sphere, added_mass=0.5), rel=2e-3)


def test_a_fall_with_memory_follows_the_full_convolution() -> None:
    """Within 0.5 % of the final speed."""
    case = settling.mordant().with_(**{"laws.drag": "schiller_naumann"})
    times, speeds = fall("mei_adrian", 5e-4, 0.15)
    exact = settling.equation_of_motion(case, times)
    assert np.abs(speeds - exact).max() < 5e-3 * exact[-1]


def test_added_mass_beside_a_wall_keeps_the_energy() -> None:
    """Without drag, (m + C m_f) v^2 is constant while the sphere approaches the wall."""
    radius = 0.5 * DIAMETER
    run, wall = sphere(-0.1, 6.0 * radius), Plane()
    fluid = QuiescentFluid(run, WATER, VISCOSITY, None, history="none", added_mass=wall)

    def energy() -> float:
        place, velocity = float(run.particles.position[0, 2]), float(run.particles.velocity[0, 2])
        return (GLASS.density + near_wall(place, radius) * WATER) * velocity**2

    start = energy()
    while run.particles.position[0, 2] > 1.05 * radius:
        fluid.advance(1e-5)
    assert energy() == pytest.approx(start, rel=1e-3)
    assert -run.particles.velocity[0, 2] < 0.1 * math.sqrt(1.0 - 0.2 * WATER / (GLASS.density + 0.7 * WATER))


def test_gravity_belongs_to_the_fluid() -> None:
    with pytest.raises(InputError, match="give it to the fluid"):
        QuiescentFluid(sphere(gravity=(0.0, 0.0, -9.81)), WATER, VISCOSITY, None)


def test_a_fluid_without_viscosity_is_refused() -> None:
    with pytest.raises(InputError, match="viscosity"):
        QuiescentFluid(sphere(), WATER, 0.0, None)


def test_a_restored_solver_continues_with_its_memory() -> None:
    """The checkpoint of the solver holds what the fluid remembers: the same bits."""
    runs = [sphere(), sphere()]
    fluids = [
        QuiescentFluid(run, WATER, VISCOSITY, law_of(schiller_naumann), gravity=(0.0, 0.0, -9.81)) for run in runs
    ]
    for _ in range(5):
        fluids[0].advance(1e-3)
    runs[1].restore(runs[0].checkpoint())
    for fluid in fluids:
        fluid.advance(1e-3)
    assert np.array_equal(runs[0].particles.velocity, runs[1].particles.velocity)


def test_a_fixed_sphere_stays() -> None:
    one = make_particles([[0.0, 0.0, 1.0]], 0.5 * DIAMETER, GLASS.density, fixed=True)
    run = ParticleSolver(one, pair_table([GLASS]), settings=SolverSettings(check_steps=False))
    QuiescentFluid(run, WATER, VISCOSITY, law_of(schiller_naumann), gravity=(0.0, 0.0, -9.81)).advance(1e-3, 5)
    assert run.particles.position[0, 2] == 1.0
