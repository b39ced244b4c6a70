"""Many films at once: momentum, energy, gaps, and one stiff film among seven soft ones."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from scenarios.validation.particles.granular_beds import films_alone, shear


@pytest.mark.parametrize(
    ("fraction", "step"),
    [
        (0.5, 5e-9),
        (0.5, 1e-7),
        (0.6, 5e-7),
        (0.5, 5e-7),
        (0.5, 5e-6),
    ],
)
def test_films_never_raise_kinetic_energy(fraction: float, step: float) -> None:
    """Films alone, in 1 Pa s: kinetic energy falls in every single step, to 1e-15 of itself; contacts are taken away.

    A film time m* h_min/(6 pi eta R*^2) is 5.5e-9 s.
    """
    crowd = films_alone(fraction, 60, step, count=400)
    assert (np.diff(crowd.energy) <= 1e-15 * crowd.energy[:-1]).all()


@pytest.mark.parametrize("step", [5e-9, 5e-7, 5e-6])
def test_films_leave_momentum_and_take_energy(step: float) -> None:
    """Momentum to round-off at 1, 100 and 1 000 film times a step; all rises of energy below 1 % of the first."""
    crowd = films_alone(0.5, 60, step, count=400)
    change = np.diff(crowd.energy)
    assert crowd.momentum < 1e-13
    assert crowd.energy[-1] < 0.5 * crowd.energy[0]
    assert change[change > 0.0].sum() < 0.01 * crowd.energy[0]


def test_dense_suspension_is_sheared_at_the_hertz_step() -> None:
    """100 um spheres in 1 Pa s at a solid fraction of 0.5 between two layers: gaps stay open, speeds bounded."""
    crowd = shear(0.5, 1000, count=500)
    assert crowd.smallest_gap > 0.0
    assert crowd.speed < 3.0
    assert crowd.energy[-1] < 2.0 * np.median(crowd.energy)


@pytest.mark.slow
def test_thousand_spheres_are_sheared_for_long() -> None:
    """The same with 1 000 spheres over 1e5 steps."""
    crowd = shear(0.5, 100_000)
    assert crowd.steps == 100_000
    assert crowd.smallest_gap > 0.0
    assert crowd.speed < 3.0
    assert crowd.energy[-10:].max() < 2.0 * np.median(crowd.energy)


@pytest.mark.slow
def test_thousand_spheres_settle_under_a_lid_and_shear() -> None:
    """Solid fraction 0.6 under a lid that presses by 20 Pa and drags by 10 Pa."""
    crowd = shear(0.6, 100_000, press=20.0)
    assert crowd.smallest_gap > 0.0
    assert crowd.speed < 1.0
    assert crowd.energy[-10:].max() < 2.0 * np.median(crowd.energy)


RADIUS, DENSITY, SPEED, ROUGH = 1e-3, 2500.0, 0.1, 1e-6
BEAD = Material(
    density=DENSITY, youngs_modulus=1e12, contact_modulus=1e8, poisson=0.25, restitution=0.97, roughness=ROUGH
)
SOFT_GAP = 0.25 * RADIUS


def crowd_of_nine() -> tuple[np.ndarray, np.ndarray]:
    """A striker, a sphere, and seven at rest around that at half the film's reach (9, 3) [m], velocities [m/s]."""
    far = 2.0 * RADIUS + 0.02 * RADIUS
    near = 2.0 * RADIUS + SOFT_GAP
    around = [[-1.0, 0.0, 0.0]]
    for level, turns in ((-0.5, 3), (0.5, 3)):
        for turn in range(turns):
            angle = 2.0 * math.pi * turn / turns + (0.5 if level > 0 else 0.0)
            side = math.sqrt(1.0 - level**2)
            around.append([level, side * math.cos(angle), side * math.sin(angle)])
    places = np.vstack([[far, 0.0, 0.0], np.zeros(3), near * np.array(around)])
    velocity = np.zeros((9, 3))
    velocity[0, 0] = -SPEED
    return places, velocity


def exact_rebound(viscosity: float, leave: float) -> tuple[float, float]:
    """Rebound speed of the striker against its target at a gap, over SPEED, and the smallest gap [m].

    The equations of motion of all nine at once, as one stiff system: film -6 pi eta R*^2/max(h, h_min) v_n,
    contact of Hertz and Tsuji below h_min, weighed by the lever h/h_min.
    """
    row = pair_table([BEAD])[0, 0]
    places, velocity = crowd_of_nine()
    mass = DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3
    reduced, minimum, cutoff = 0.5 * RADIUS, float(row["roughness_gap"]), 0.5 * RADIUS
    film = 6.0 * math.pi * viscosity * reduced**2
    spring = 4.0 / 3.0 * float(row["contact_modulus"]) * math.sqrt(reduced)
    tsuji = float(row["damping_ratio"]) * math.sqrt(0.5 * mass * spring)
    one, other = np.triu_indices(9, 1)

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        x, v = state.reshape(2, 9, 3)
        apart = x[one] - x[other]
        distance = np.linalg.norm(apart, axis=1)
        normal, gap = apart / distance[:, None], distance - 2.0 * RADIUS
        speed = np.sum((v[one] - v[other]) * normal, axis=1)
        overlap = np.maximum(minimum - gap, 0.0)
        share = np.clip(gap / minimum, 0.0, 1.0)
        solid = spring * overlap**1.5 - tsuji * overlap**0.25 * speed
        wet = np.where(gap < cutoff, -film / np.maximum(gap, minimum) * speed, 0.0)
        force = ((1.0 - share) * solid * (overlap > 0.0) + share * wet)[:, None] * normal
        total = np.zeros((9, 3))
        np.add.at(total, one, force)
        np.subtract.at(total, other, force)
        return np.concatenate([v.ravel(), (total / mass).ravel()])

    def gone(_: float, state: np.ndarray) -> float:
        apart = state[:3] - state[3:6]
        speed = (state[27:30] - state[30:33]) @ apart
        return float(np.linalg.norm(apart) - 2.0 * RADIUS - leave) if speed > 0.0 else -leave

    gone.terminal, gone.direction = True, 1.0  # type: ignore[attr-defined]
    start = np.concatenate([places.ravel(), velocity.ravel()])
    found = solve_ivp(rates, (0.0, 0.02), start, "LSODA", rtol=1e-9, atol=1e-13, max_step=2e-6, events=gone)
    apart = found.y[:3] - found.y[3:6]
    distance = np.linalg.norm(apart, axis=0)
    assert found.status == 1
    last = (found.y[27:30, -1] - found.y[30:33, -1]) @ apart[:, -1] / distance[-1]
    return float(last) / SPEED, float(distance.min() - 2.0 * RADIUS)


@pytest.mark.parametrize("stokes", [20.0, 60.0])
def test_stiff_film_among_seven_soft_ones_keeps_its_restitution(stokes: float) -> None:
    """Rebound at the 2 % Hertz step within 5e-3 of the converged solution of all nine spheres; no gap is negative
    but in the solution's own overlap."""
    mass = DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3
    viscosity = 0.5 * mass * SPEED / (6.0 * math.pi * (0.5 * RADIUS) ** 2 * stokes)
    leave = 0.02 * RADIUS
    exact, _ = exact_rebound(viscosity, leave)
    places, velocity = crowd_of_nine()
    spheres = make_particles(places, RADIUS, DENSITY, velocity=velocity, viscosity=viscosity)
    run = ParticleSolver(spheres, pair_table([BEAD]), laws=Laws(film=True))
    step = run.time_scales(SPEED).recommended
    before = (0.0, 0.0)
    ours = math.nan
    for _ in range(20_000):
        run.advance(step)
        apart = run.particles.position[0] - run.particles.position[1]
        distance = float(np.linalg.norm(apart))
        now = (
            distance - 2.0 * RADIUS,
            float((run.particles.velocity[0] - run.particles.velocity[1]) @ apart) / distance,
        )
        if now[1] > 0.0 and now[0] > leave:
            ours = float(np.interp(leave, [before[0], now[0]], [before[1], now[1]])) / SPEED
            break
        before = now
    assert exact > 0.3
    assert ours == pytest.approx(exact, abs=5e-3)
