"""Adhesion of dry solids: Johnson, Kendall & Roberts, Proc. R. Soc. A 324 (1971) 301, in closed forms and in motion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from impacts import Pair, kinetic_energy, normal_speed

from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.particles.interactions.contact_law import contact_named
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from closures.cohesion import jkr_contact_radius, jkr_force, jkr_pull_off, jkr_sticking_speed, jkr_stretch

DUST = Material(density=2500, youngs_modulus=1e8, poisson=0.3, restitution=1.0, surface_energy=0.02)
RADIUS = 50e-6
LAWS = Laws(contact="jkr")


def scales(material: Material = DUST) -> tuple[float, float, float]:
    """w [J/m2], R* [m] and E* [Pa] of two of these spheres."""
    row = pair_table([material])[0, 0]
    return float(row["work_of_adhesion"]), 0.5 * RADIUS, float(row["contact_modulus"])


def test_force_against_overlap_satisfies_the_law() -> None:
    """Overlap from contact radius returns to 1e-12; least force -3/2 pi w R*, -5/9 of it where the contact breaks."""
    w, radius, modulus = scales()
    stretch = jkr_stretch(w, radius, modulus)
    overlaps = np.linspace(-stretch, 20.0 * stretch, 20_001)
    width = np.array([jkr_contact_radius(overlap, w, radius, modulus) for overlap in overlaps])
    force = np.array([jkr_force(a, w, radius, modulus) for a in width])
    assert (
        np.abs(width**2 / radius - np.sqrt(2.0 * math.pi * w * width / modulus) - overlaps).max() < 1e-12 * stretch * 20
    )
    assert force.min() == pytest.approx(-jkr_pull_off(w, radius), rel=1e-5)
    assert force[0] == pytest.approx(-5.0 / 9.0 * jkr_pull_off(w, radius), rel=1e-6)
    deep = jkr_contact_radius(1e6 * stretch, w, radius, modulus)
    hertz = 4.0 / 3.0 * modulus * math.sqrt(radius) * (1e6 * stretch) ** 1.5
    assert jkr_force(deep, w, radius, modulus) == pytest.approx(hertz, rel=1e-3)


def met(speed: float, slide: float = 0.0, material: Material = DUST) -> ParticleSolver:
    """Two spheres that have met, long after an elastic impact would have ended."""
    pair = Pair((material, material), (RADIUS, RADIUS), speed, slide=slide, gap=1e-9)
    run = pair.simulation(LAWS)
    step = 0.002 * pair.hertz_time
    run.advance(step, 3000)
    return run


@pytest.mark.parametrize("part", [0.7, 0.95])
def test_slow_spheres_stick(part: float) -> None:
    """Without any damping, spheres slower than Thornton & Ning's speed stay together."""
    w, radius, modulus = scales()
    mass = DUST.density * 4.0 / 3.0 * math.pi * RADIUS**3
    run = met(part * jkr_sticking_speed(0.5 * mass, w, radius, modulus))
    assert run.gap[0] < jkr_stretch(w, radius, modulus)
    assert run.edges.minimum_gap[0] > 0.0


@pytest.mark.parametrize("part", [1.05, 1.5, 4.0])
def test_fast_spheres_part_with_the_rest_of_their_energy(part: float) -> None:
    """They leave with v^2 = v0^2 - vs^2, within 1 % of v0^2."""
    w, radius, modulus = scales()
    mass = DUST.density * 4.0 / 3.0 * math.pi * RADIUS**3
    sticking = jkr_sticking_speed(0.5 * mass, w, radius, modulus)
    run = met(part * sticking)
    assert run.gap[0] > jkr_stretch(w, radius, modulus)
    assert (normal_speed(run) / sticking) ** 2 == pytest.approx(part**2 - 1.0, abs=0.01 * part**2)


@pytest.mark.parametrize(("part", "holds"), [(0.95, True), (1.05, False)])
def test_contact_stands_the_pull_of_the_law(part: float, holds: bool) -> None:
    """Pulled slowly, a damped contact breaks between 0.95 and 1.05 of 3/2 pi w R*."""
    material = DUST.model_copy(update={"restitution": 0.2})
    w, radius, modulus = scales(material)
    run = met(1e-3, material=material)
    step = 0.002 * Pair((material, material), (RADIUS, RADIUS), 1e-3).hertz_time
    pull = part * jkr_pull_off(w, radius)
    for share in np.linspace(0.0, 1.0, 200):
        run.particles.applied[:, 0] = share * pull * np.array([-1.0, 1.0])
        run.advance(step, 40)
    run.advance(step, 20_000)
    together = len(run.gap) > 0 and run.gap[0] < jkr_stretch(w, radius, modulus)
    assert together == holds


def test_adhesive_pair_keeps_its_momentum() -> None:
    """Momentum and angular momentum of an oblique impact to 1e-12."""
    rough = DUST.model_copy(update={"friction": 0.4})
    pair = Pair((rough, rough), (RADIUS, 2.0 * RADIUS), 0.05, slide=0.03, spin=((0.0, 30.0, 200.0), (10.0, 0.0, 0.0)))
    run = pair.simulation(LAWS)
    made = run.particles
    inertia = 0.4 * made.mass * made.radius**2

    def angular() -> np.ndarray:
        return np.cross(made.position, made.mass[:, None] * made.velocity).sum(axis=0) + inertia @ made.spin

    begun, size = angular(), float(made.mass @ np.linalg.norm(made.velocity, axis=1))
    energy = float(kinetic_energy(made).sum())
    for _ in range(40):
        run.advance(0.02 * pair.hertz_time, 5)
        assert np.linalg.norm(made.mass @ made.velocity) <= 1e-12 * size
        assert np.linalg.norm(angular() - begun) <= 1e-12 * size * RADIUS
    assert float(kinetic_energy(made).sum()) < energy


def test_a_solid_without_surface_energy_touches_as_in_hertz_law() -> None:
    """Dust on a wall that nothing adheres to: finite forces, equal to those of Hertz."""
    smooth = Material(density=2500, youngs_modulus=1e8, poisson=0.3)
    row, jkr, hertz = pair_table([DUST, smooth])[0, 1], contact_named("jkr"), contact_named("hertz")
    assert row["work_of_adhesion"] == 0.0
    for overlap in (1e-12, 1e-9, 1e-6):
        expected = hertz.evaluate(hertz.force, overlap, 1e-12, RADIUS, row)
        assert jkr.evaluate(jkr.force, overlap, 1e-12, RADIUS, row) == pytest.approx(expected, rel=1e-9)
    falling = make_particles([[0.0, 0.0, 1.001 * RADIUS]], RADIUS, 2500.0, velocity=[[0.0, 0.0, -0.05]])
    run = ParticleSolver(falling, pair_table([DUST, smooth]), walls=[Plane(material=1)], laws=LAWS)
    run.advance(run.recommended_step(0.05), 400)
    assert run.particles.velocity[0, 2] == pytest.approx(0.05, rel=1e-3)


def test_cohesion_with_films_is_refused() -> None:
    """Adhesion is that of dry solids."""
    with pytest.raises(InputError, match="contact = 'jkr'"):
        Pair((DUST, DUST), (RADIUS, RADIUS), 0.1).simulation(Laws(film=True, contact="jkr"))
