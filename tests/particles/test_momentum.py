"""What a pair of particles can never change by itself: its momentum, linear and angular."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from impacts import STEP, Pair

from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.state import Particles

GLASS = Material(
    density=2500, youngs_modulus=60e9, poisson=0.23, restitution=0.97, friction=0.3, friction_lubricated=0.1,
    roughness=134e-9,
)  # fmt: skip
DELRIN = Material(
    density=1400, youngs_modulus=2.8e9, poisson=0.35, restitution=0.9, friction=0.2, friction_lubricated=0.1,
    roughness=796e-9,
)  # fmt: skip
SOFT = Material(density=1100, youngs_modulus=1e6, poisson=0.45, restitution=0.6, friction=1.0)


def momentum(made: Particles) -> np.ndarray:
    """Sum of m v [kg m/s]."""
    return made.mass @ made.velocity


def angular_momentum(made: Particles) -> np.ndarray:
    """Sum of x cross m v and I spin, about the origin [kg m2/s]."""
    inertia = 0.4 * made.mass * made.radius**2
    return np.cross(made.position, made.mass[:, None] * made.velocity).sum(axis=0) + inertia @ made.spin


def largest_change(pair: Pair, laws: Laws, step: float, chunks: int, steps: int) -> tuple[float, float]:
    """Largest change of momentum over sum m|v|, and of angular momentum over sum m|v|R, during a run.

    |v| is the faster of the centre and the surface.
    """
    run = pair.simulation(laws, record=laws.film)  # the loops of recorded collisions, which other tests share
    surface = run.particles.radius * np.linalg.norm(run.particles.spin, axis=1)
    size = run.particles.mass * np.maximum(np.linalg.norm(run.particles.velocity, axis=1), surface)
    linear, angular = momentum(run.particles), angular_momentum(run.particles)
    change = np.zeros(2)
    met = turned = False
    for _ in range(chunks):
        run.advance(step, steps)
        met |= bool((run.gap < (run.edges.minimum_gap if laws.film else 0.0)).any())
        turned |= not np.allclose(run.particles.spin, pair.spin)
        moved = np.linalg.norm(momentum(run.particles) - linear) / size.sum()
        swung = np.linalg.norm(angular_momentum(run.particles) - angular) / (size @ run.particles.radius)
        change = np.maximum(change, [moved, swung])
    assert met, "the particles never touched"
    assert turned, "friction never acted"
    return float(change[0]), float(change[1])


@pytest.mark.parametrize(
    "laws", [Laws(), Laws(spring="rescaled"), Laws(integrator="verlet")], ids=["total", "rescaled", "verlet"]
)
@pytest.mark.parametrize("materials", [(GLASS, GLASS), (GLASS, DELRIN), (SOFT, GLASS)], ids=["glass", "unlike", "soft"])
@pytest.mark.parametrize("ratio", [1.0, 0.1, 7.0])
def test_dry_oblique_contact_keeps_momentum(laws: Laws, materials: tuple[Material, Material], ratio: float) -> None:
    """Momentum to 1e-12 of sum m|v|, angular momentum to 1e-12 of sum m|v|R: levers add up to the distance."""
    pair = Pair(materials, (1e-3, ratio * 1e-3), 0.5, slide=0.4, spin=((90.0, -30.0, 200.0), (5.0, 40.0, -100.0)))
    moved, swung = largest_change(pair, laws, STEP * pair.hertz_time, 20, 5)
    assert moved <= 1e-12
    assert swung <= 1e-12


@pytest.mark.parametrize(
    ("integrator", "onset"),
    [
        ("drift", "film"),
        ("verlet", "film"),
        ("verlet", "overlap"),
        pytest.param("drift", "overlap", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("materials", [(GLASS, GLASS), (GLASS, DELRIN)], ids=["glass", "unlike"])
@pytest.mark.parametrize("ratio", [1.0, 0.2])
def test_immersed_oblique_contact_keeps_momentum(
    integrator: str, onset: str, materials: tuple[Material, Material], ratio: float
) -> None:
    """The same through film, lever, contact and film again, from twice the reach of the lever to beyond the contact."""
    pair = Pair(
        materials,
        (5e-3, ratio * 5e-3),
        0.3,
        slide=0.2,
        spin=((0.0, 3.0, 20.0), (2.0, 0.0, 0.0)),
        gap=2e-5,
        viscosity=5e-3,
    )
    laws = Laws(film=True, integrator=integrator, friction_onset=onset)
    moved, swung = largest_change(pair, laws, STEP * pair.hertz_time, 30, 40)
    assert moved <= 1e-12
    assert swung <= 1e-12


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    angle=st.floats(0.0, 75.0),
    ratio=st.floats(-1.0, 1.0),
    friction=st.floats(0.01, 2.0),
    spin=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6),
    modulus=st.floats(7.0, 11.0),
    film=st.booleans(),
    integrator=st.sampled_from(["drift", "verlet"]),
)
def test_momentum_of_any_pair(
    angle: float, ratio: float, friction: float, spin: list[float], modulus: float, film: bool, integrator: str
) -> None:
    """Momentum and angular momentum to 1e-12, whatever the size ratio, spins, stiffness and direction."""
    solid = Material(
        density=2500, youngs_modulus=10**modulus, poisson=0.3, restitution=0.9, friction=friction, roughness=1e-7
    )
    turning = np.reshape(spin, (2, 3)) * 100.0 / np.array([[1.0], [10**ratio]]) + [0.0, 0.0, 1e-3]
    pair = Pair(
        (solid, solid),
        (2e-3, 2e-3 * 10**ratio),
        0.2,
        slide=0.2 * math.tan(math.radians(angle)),
        spin=tuple(map(tuple, turning)),  # type: ignore[arg-type]
        gap=1e-6 if film else 0.0,
        viscosity=1e-3,
    )
    step = STEP * pair.hertz_time
    steps = math.ceil((pair.gap / 0.2 / step + 100) / 10)
    moved, swung = largest_change(pair, Laws(film=film, integrator=integrator), step, 10, steps)
    assert moved <= 1e-12
    assert swung <= 1e-12
