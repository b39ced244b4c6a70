"""What resists rolling: a constant torque, or a spring that yields and a dashpot.

Ai, Chen, Rotter & Ooi, Powder Technol. 206 (2011) 269, models A and C.
Twisting: Coulomb's limit under the pressure of Hertz.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from impacts import STEP, Pair, kinetic_energy

from cfddem import Case, Simulation
from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.particles.interactions.contacts.linear import LINEAR
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures import contact

GRAVITY, RADIUS, SLOWING = 9.81, 1e-3, 0.02
BALL = Material(density=2500, youngs_modulus=1e8, poisson=0.3, restitution=0.6, friction=0.5, rolling_friction=SLOWING)
CHOICES = {"constant torque": "constant_torque", "spring and dashpot": "spring_dashpot"}


def on_a_floor(speed: float, laws: Laws, lean: float = 0.0) -> ParticleSolver:
    """A sphere that rolls along x on a floor with the overlap that carries its weight.

    lean  of gravity towards x [rad]
    """
    weight = BALL.density * 4.0 / 3.0 * math.pi * RADIUS**3 * GRAVITY * math.cos(lean)
    stiffness = contact.hertz_stiffness(float(pair_table([BALL])[0, 0]["contact_modulus"]), RADIUS)
    overlap = (
        weight / laws.contact_law.parameters["normal_stiffness"]
        if laws.contact_law.name == "linear"
        else (weight / stiffness) ** (2.0 / 3.0)
    )
    sphere = make_particles(
        [[0.0, 0.0, RADIUS - overlap]],
        RADIUS,
        BALL.density,
        velocity=[[speed, 0.0, 0.0]],
        spin=[[0.0, speed / RADIUS, 0.0]],
    )
    down = (GRAVITY * math.sin(lean), 0.0, -GRAVITY * math.cos(lean))
    return ParticleSolver(sphere, pair_table([BALL]), walls=[Plane()], laws=laws, gravity=down)


def yield_angle(run: ParticleSolver) -> float:
    """Angle at which the rolling spring yields: overlap over 2.25 mu_r R* [rad]."""
    return -float(run.gap[0]) / (2.25 * SLOWING * RADIUS)


@pytest.mark.parametrize("linear", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["Hertz", "linear"])
@pytest.mark.parametrize("choice", CHOICES.values(), ids=CHOICES)
def test_rolling_sphere_slows_down_at_five_sevenths(choice: str, linear: bool) -> None:
    """Torque mu_r R m g against rolling without sliding: 7/5 m a = mu_r m g, so a = 5/7 mu_r g, within 0.1 %."""
    springs = LINEAR.with_parameters(normal_stiffness=1e4, tangential_stiffness=1e4) if linear else "hertz"
    run = on_a_floor(0.05, Laws(rolling=choice, contact=springs))
    step = 0.5 * run.time_scales(0.05).recommended
    run.advance(step, math.ceil(0.02 / step))
    begin, before = run.time, float(run.particles.velocity[0, 0])
    run.advance(step, math.ceil(0.1 / step))
    slowing = (before - float(run.particles.velocity[0, 0])) / (run.time - begin)
    assert slowing == pytest.approx(5.0 / 7.0 * SLOWING * GRAVITY, rel=1e-3)
    assert float(run.particles.spin[0, 1]) * RADIUS == pytest.approx(float(run.particles.velocity[0, 0]), rel=1e-3)


@pytest.mark.parametrize("choice", CHOICES.values(), ids=CHOICES)
def test_rolling_sphere_comes_to_rest_and_stays(choice: str) -> None:
    """It stops v^2/(2 a) further on, within 1 %; then it holds less than 1e-9 of its energy, and does not creep.

    Counted from when the rolling spring has been loaded, in which the dashpot takes part.
    """
    run = on_a_floor(0.01, Laws(rolling=choice))
    begun = float(kinetic_energy(run.particles)[0])
    step = 0.5 * run.time_scales(0.01).recommended
    run.advance(step, math.ceil(0.01 / step))
    begin, speed = float(run.particles.position[0, 0]), float(run.particles.velocity[0, 0])
    run.advance(step, math.ceil(0.4 / step))
    stopped = float(run.particles.position[0, 0])
    way = speed**2 / (2.0 * 5.0 / 7.0 * SLOWING * GRAVITY)
    turned_back = RADIUS * yield_angle(run) if choice == "spring_dashpot" else 0.0
    assert stopped - begin == pytest.approx(way - turned_back, rel=0.01)
    for _ in range(10):
        run.advance(step, math.ceil(0.01 / step))
        assert float(kinetic_energy(run.particles)[0]) < 1e-9 * begun
    assert float(run.particles.position[0, 0]) == pytest.approx(stopped, abs=1e-6 * RADIUS)


def test_sphere_rolls_down_a_slope_from_the_angle_of_rolling_friction() -> None:
    """On a slope with tan(angle) = 0.9 mu_r it stays, at 1.1 mu_r it rolls with 5/7 g (sin - mu_r cos)."""
    held, rolls = (on_a_floor(0.0, Laws(rolling="spring_dashpot"), math.atan(part * SLOWING)) for part in (0.9, 1.1))
    step = 0.5 * held.time_scales(0.05).recommended
    for run in (held, rolls):
        run.advance(step, math.ceil(0.1 / step))
    assert abs(float(held.particles.velocity[0, 0])) < 1e-6
    before, begin = float(rolls.particles.velocity[0, 0]), rolls.time
    rolls.advance(step, math.ceil(0.1 / step))
    lean = math.atan(1.1 * SLOWING)
    wanted = 5.0 / 7.0 * GRAVITY * (math.sin(lean) - SLOWING * math.cos(lean))
    assert (float(rolls.particles.velocity[0, 0]) - before) / (rolls.time - begin) == pytest.approx(wanted, rel=0.01)


@pytest.mark.parametrize(
    ("choice", "film"),
    [
        ("constant_torque", False), ("spring_dashpot", False),
        *(pytest.param(choice, True, marks=pytest.mark.slow) for choice in CHOICES.values()),
    ],
)  # fmt: skip
def test_a_pair_keeps_its_momentum(choice: str, film: bool) -> None:
    """Momentum and angular momentum of unlike spheres to 1e-12; both get the torque with opposite sign."""
    solid = BALL.model_copy(update={"rolling_friction": 0.3, "roughness": 1e-6})
    pair = Pair(
        (solid, solid),
        (1e-3, 3e-3),
        0.5,
        slide=0.3,
        spin=((300.0, -40.0, 500.0), (20.0, 90.0, -100.0)),
        gap=1e-6 if film else 0.0,
        viscosity=1e-3 if film else 0.0,
    )
    run = pair.simulation(Laws(film=film, rolling=choice))
    made = run.particles

    def sums() -> tuple[np.ndarray, np.ndarray]:
        inertia = 0.4 * made.mass * made.radius**2
        turning = np.cross(made.position, made.mass[:, None] * made.velocity).sum(axis=0) + inertia @ made.spin
        return made.mass @ made.velocity, turning

    surface = made.radius * np.linalg.norm(made.spin, axis=1)
    size = made.mass * np.maximum(np.linalg.norm(made.velocity, axis=1), surface)
    linear, angular = sums()
    largest = 0.0
    for _ in range(30):
        run.advance(STEP * pair.hertz_time, 4)
        largest = max(largest, float(np.abs(run.edges.moment).max()))
        now = sums()
        assert np.linalg.norm(now[0] - linear) <= 1e-12 * size.sum()
        assert np.linalg.norm(now[1] - angular) <= 1e-12 * (size @ made.radius)
    assert largest > 0.0


@pytest.mark.parametrize("choice", CHOICES.values(), ids=CHOICES)
def test_without_friction_only_rolling_is_braked(choice: str) -> None:
    """Spin across the normal is braked, towards a common spin; spin about it needs friction."""
    slick = BALL.model_copy(update={"friction": 0.0, "rolling_friction": 0.5, "restitution": 1.0})
    pair = Pair((slick, slick), (1e-3, 1e-3), 0.5, spin=((7.0, 50.0, 0.0), (0.0, 0.0, 0.0)))
    run = pair.simulation(Laws(rolling=choice))
    before = kinetic_energy(run.particles).sum()
    run.advance(STEP * pair.hertz_time, 80)
    spin = run.particles.spin
    assert spin[:, 0] == pytest.approx([7.0, 0.0], abs=1e-9)
    assert spin[:, 1].sum() == pytest.approx(50.0, rel=1e-12)
    assert abs(spin[0, 1] - spin[1, 1]) < 50.0
    assert kinetic_energy(run.particles).sum() < before


@pytest.mark.parametrize("choice", CHOICES.values(), ids=CHOICES)
def test_top_stops_by_friction_under_the_pressure_of_hertz(choice: str) -> None:
    """A sphere that spins about the vertical loses 3 pi/16 mu a m g / (2/5 m R^2) of its spin a second, then rests."""
    run = on_a_floor(0.0, Laws(rolling=choice))
    run.particles.spin[0] = 0.0, 0.0, 40.0
    run.refresh()
    slowing = (
        3.0 * math.pi / 16.0 * BALL.friction * math.sqrt(-float(run.gap[0]) * RADIUS) * GRAVITY / (0.4 * RADIUS**2)
    )
    step = 0.5 * run.time_scales(0.05).recommended
    run.advance(step, math.ceil(20.0 / slowing / step))
    assert float(run.particles.spin[0, 2]) == pytest.approx(40.0 - slowing * run.time, rel=1e-3)
    run.advance(step, math.ceil(25.0 / slowing / step))
    assert abs(float(run.particles.spin[0, 2])) < 1e-6


def test_unlike_solids_take_the_lower_coefficient() -> None:
    """Unless the table of pairs says otherwise."""
    rough = BALL.model_copy(update={"rolling_friction": 0.4})
    assert pair_table([BALL, rough])[0, 1]["rolling_friction"] == SLOWING
    assert pair_table([BALL, rough], {(0, 1): {"rolling_friction": 0.3}})[1, 0]["rolling_friction"] == 0.3
    with pytest.raises(InputError, match="rolling_friction"):
        Material(density=2500, youngs_modulus=1e8, poisson=0.3, rolling_friction=-0.1)


@pytest.mark.parametrize(("rolling", "kept"), [("none", 5.0 / 7.0), ("constant_torque", 0.0)])
def test_a_case_says_what_resists_rolling(rolling: str, kept: float) -> None:
    """A sphere set sliding on the floor of a dry case: it rolls on with 5/7 of its speed, or comes to rest."""
    case = Case(
        material={
            "glass": {
                "density": 2500.0, "youngs_modulus": 1e7, "poisson": 0.25, "friction": 0.5, "rolling_friction": 0.1,
            }
        },
        column={"width": 0.04, "height": 0.01, "cell": 0.01},
        bed={"diameter": 2e-3, "positions": [(0.005, 0.02, 0.001)], "initial_velocity": (0.1, 0.0, 0.0)},
        laws={"rolling_resistance": rolling},
        run={"until": 0.25},
    )  # fmt: skip
    simulation = Simulation(case)
    simulation.until(0.25)
    assert simulation.particles.velocity[0, 0] / 0.1 == pytest.approx(kept, abs=0.01)
