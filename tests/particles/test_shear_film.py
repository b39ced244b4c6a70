"""Films that resist sliding, rolling and twisting: against theory, and what they must never change.

Exact resistance of two spheres: the recurrences of Jeffrey & Onishi (1984) in scenarios/validation/particles.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from in_process_ranks import on_ranks
from test_ghosts import WET, assert_same_bits, divided, finished, joined, settings, state
from test_momentum import angular_momentum, momentum

from cfddem.backend.communicator import Communicator
from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.interactions.shear_film import logarithm
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import kinetic_energy, make_particles
from cfddem.particles.walls.shapes import Plane
from closures import tangential_lubrication as film
from scenarios.validation.particles import few_spheres

GLASS = Material(density=2500, youngs_modulus=60e9, poisson=0.23, restitution=0.97, friction=0.3, roughness=1e-9)
FULL = Laws(film=True, film_motions="full")
ALONG, ACROSS = np.array([1.0, 2.0, 2.0]) / 3.0, np.array([2.0, -2.0, 1.0]) / 3.0
AROUND = np.cross(ALONG, ACROSS)


def film_matrix(ratio: float) -> np.ndarray:
    """Force and couple on both spheres by their slip and roll, from the closures: R1 = eta = L = 1 (4, 4).

    Rows and columns: velocities of both, then spins times the normal, all against the first sphere's motion.
    """
    reduced, asymmetry = ratio / (1.0 + ratio), (1.0 - ratio) / (1.0 + ratio)
    shear, roll = film.shear_resistance(1.0, reduced, asymmetry), film.roll_resistance(1.0, reduced)
    both = film.shear_roll_resistance(1.0, reduced, asymmetry)
    slip, turn = np.array([1.0, -1.0, 1.0, ratio]), np.array([0.0, 0.0, 1.0, -1.0])
    matrix: np.ndarray = (
        shear * np.outer(slip, slip)
        + roll * np.outer(turn, turn)
        + both * (np.outer(slip, turn) + np.outer(turn, slip))
    )
    return matrix


@pytest.mark.parametrize("ratio", [0.1, 0.7, 1.0, 3.0, 20.0])
def test_resistances_are_the_leading_terms_of_jeffrey_and_onishi(ratio: float) -> None:
    """Y^A, Y^B and Y^C of the first sphere, from the two motions of the gap, within 1e-12."""
    matrix, exact = film_matrix(ratio), few_spheres.leading(ratio)
    assert matrix[0, 0] == pytest.approx(6.0 * math.pi * exact.force_by_own, rel=1e-12)
    assert matrix[0, 1] == pytest.approx(-6.0 * math.pi * exact.force_by_other, rel=1e-12)
    assert matrix[2, 0] == pytest.approx(4.0 * math.pi * exact.couple_by_own, rel=1e-12)
    assert matrix[2, 1] == pytest.approx(-4.0 * math.pi * exact.couple_by_other, rel=1e-12)
    assert matrix[2, 2] == pytest.approx(8.0 * math.pi * exact.turn_by_own, rel=1e-12)
    assert matrix[2, 3] == pytest.approx(8.0 * math.pi * exact.turn_by_other, rel=1e-12)


def test_resistances_at_a_wall_are_those_of_goldman_cox_and_brenner() -> None:
    """Coefficients of ln(a/h), 8/15, 1/10, 2/15 and 2/5, over 6 pi eta a, 8 pi eta a^2, 6 pi eta a^2, 8 pi eta a^3."""
    shear, both = film.shear_resistance(1.0, 1.0, -1.0), film.shear_roll_resistance(1.0, 1.0, -1.0)
    roll = film.roll_resistance(1.0, 1.0)
    assert shear / (6.0 * math.pi) == pytest.approx(8.0 / 15.0)
    assert (shear + both) / (8.0 * math.pi) == pytest.approx(1.0 / 10.0)
    assert (shear + both) / (6.0 * math.pi) == pytest.approx(2.0 / 15.0)
    assert (shear + 2.0 * both + roll) / (8.0 * math.pi) == pytest.approx(2.0 / 5.0)


PUBLISHED = few_spheres.Resistance(0.9983, 0.2737, -0.2390, -0.0017, 0.7028, -0.0274)
"""Constants beside the logarithms for equal spheres, Jeffrey & Onishi (1984), tables 3 to 7."""


def test_recurrences_give_the_published_constants() -> None:
    """Exact functions less their singular terms at xi = 1e-6, within the printed digit; single spheres far apart."""
    found, singular = few_spheres.resistance(1e-6), few_spheres.leading(1.0)
    for value, coefficient, constant in zip(found, singular, PUBLISHED):
        assert value - coefficient * math.log(1e6) == pytest.approx(constant, abs=1.01e-4)
    apart = few_spheres.resistance(200.0, 0.5)
    assert np.array(apart) == pytest.approx([1.0, 0.0, 0.0, 0.0, 1.0, 0.0], abs=1e-2)


def test_the_page_tabulates_what_the_film_leaves_out() -> None:
    """Exact resistance less Stokes' and the film's, up to a gap of 0.05 radii, within the printed digit."""
    page = (Path(__file__).parents[2] / "docs" / "theory.md").read_text()
    table = re.findall(r"^\| 0\.0\d* \|.*$", page, re.MULTILINE)
    rows = [[float(each) for each in row.split("|")[1:-1]] for row in table]
    assert [row[0] for row in rows] == [1e-4, 1e-3, 0.01, 0.02, 0.05]
    for gap, *printed in rows:
        film_alone = np.array(few_spheres.leading(1.0)) * math.log(1.0 / gap)
        assert few_spheres.resistance(gap) - film_alone - [1, 0, 0, 0, 1, 0] == pytest.approx(printed, abs=6e-4)


@pytest.mark.parametrize("ratio", [1.0, 0.25, 4.0])
def test_exact_resistance_follows_the_logarithm(ratio: float) -> None:
    """Slope against ln(1/xi) between 1e-4 and 1e-3 within 1 % of the leading coefficient; 3 % for the large sphere."""
    near, far = (few_spheres.resistance(gap, ratio) for gap in (1e-4, 1e-3))
    slopes = (np.array(near) - far) / math.log(10.0)
    assert slopes == pytest.approx(np.array(few_spheres.leading(ratio)), rel=0.03 if ratio < 1.0 else 0.01)


def test_logarithm_of_the_loops() -> None:
    """Within 4e-15 of the library's, from 1e-12 to 1e6."""
    for value in 10.0 ** np.random.default_rng(1).uniform(-12.0, 6.0, 1000):
        assert logarithm.py_func(value) == pytest.approx(math.log(value), abs=4e-15, rel=4e-16)


# ---------------------------------------------------------------- in the particle solver


def pair(radii: tuple[float, float], gap: float, velocity: Any, spin: Any, viscosity: float = 1.0) -> ParticleSolver:
    """Two spheres, the first in direction `ALONG` from the second."""
    places = [ALONG * (sum(radii) + gap), np.zeros(3)]
    spheres = make_particles(places, radii, GLASS.density, velocity=velocity, spin=spin, viscosity=viscosity)
    return ParticleSolver(spheres, pair_table([GLASS]), laws=FULL, settings=SolverSettings(check_steps=False))


@pytest.mark.parametrize("radii", [(1e-3, 1e-3), (1e-3, 4e-3)])
def test_forces_of_the_solver_are_those_of_the_theory(radii: tuple[float, float]) -> None:
    """Force and couple by sliding and turning in a short step, within 1 % of the slope of Jeffrey & Onishi."""
    step, ratio = 1e-12, radii[1] / radii[0]
    lead = few_spheres.leading(ratio)
    measured = []
    for gap in (1e-4 * radii[0], 1e-3 * radii[0]):
        moved = pair(radii, gap, [ACROSS, 0.0 * ACROSS], 0.0)
        moved.advance(step)
        turned = pair(radii, gap, 0.0, [AROUND, 0.0 * AROUND])
        turned.advance(step)
        mass, inertia = moved.particles.mass, 0.4 * moved.particles.mass * moved.particles.radius**2
        force = -mass[0] * (moved.particles.velocity[0] - ACROSS) @ ACROSS / step / (6.0 * math.pi * radii[0])
        couple = np.abs(inertia[0] * moved.particles.spin[0] @ AROUND) / step / (4.0 * math.pi * radii[0] ** 2)
        torque = inertia[0] * (AROUND - turned.particles.spin[0]) @ AROUND / step / (8.0 * math.pi * radii[0] ** 3)
        other = np.abs(inertia[1] * turned.particles.spin[1] @ AROUND) / step / (8.0 * math.pi * radii[0] ** 3)
        measured.append([force, couple, torque, other])
    slopes = (np.array(measured[0]) - measured[1]) / math.log(10.0)
    expected = [lead.force_by_own, lead.couple_by_own, lead.turn_by_own, lead.turn_by_other]
    assert slopes == pytest.approx(expected, rel=0.01)


def cluster(viscosity: float) -> ParticleSolver:
    """Forty unequal spheres with small gaps in motion, in open space."""
    draw = np.random.default_rng(3)
    grid = np.array([[x, y, z] for x in range(4) for y in range(5) for z in range(2)], float)
    radii = draw.choice([0.46e-3, 0.495e-3], len(grid))
    places = 1e-3 * grid + draw.uniform(-4e-6, 4e-6, grid.shape)
    spheres = make_particles(
        places, radii, GLASS.density, velocity=draw.normal(0.0, 0.01, grid.shape),
        spin=draw.normal(0.0, 20.0, grid.shape), viscosity=viscosity,
    )  # fmt: skip
    return ParticleSolver(spheres, pair_table([GLASS]), laws=FULL, settings=SolverSettings(check_steps=False))


@pytest.mark.parametrize("viscosity", [1e-3, 1.0, 1e3, 1e6])
def test_many_films_keep_momentum_and_never_give_energy(viscosity: float) -> None:
    """Momentum and angular momentum within 1e-12 of their parts, energy falls in each step, from soft to very stiff."""
    run = cluster(viscosity)
    mass, speed = run.particles.mass, np.linalg.norm(run.particles.velocity, axis=1)
    linear, angular = momentum(run.particles), angular_momentum(run.particles)
    start = energy = kinetic_energy(run.particles)
    for _ in range(30):
        run.advance(1e-6)
        assert (run.gap > run.edges.minimum_gap).all()
        left = kinetic_energy(run.particles)
        assert left < energy
        energy = left
    assert energy < (0.999 if viscosity == 1e-3 else 0.5) * start
    assert np.abs(momentum(run.particles) - linear).max() <= 1e-12 * mass @ speed
    assert np.abs(angular_momentum(run.particles) - angular).max() <= 1e-12 * (mass @ speed) * 5e-3


def test_a_rigid_turn_of_a_pair_is_not_resisted() -> None:
    """Two spheres that turn as one body about their centre of mass keep their motion within 1e-6."""
    radii, spin = (1e-3, 2e-3), 5.0 * AROUND
    mass = np.array(radii) ** 3
    centre = mass[0] / mass.sum() * ALONG * (sum(radii) + 1e-6)
    places = [ALONG * (sum(radii) + 1e-6), np.zeros(3)]
    run = pair(radii, 1e-6, [np.cross(spin, place - centre) for place in places], [spin, spin])
    before = run.particles.copy()
    run.advance(1e-9, 10)
    assert np.abs(run.particles.spin - before.spin).max() <= 1e-6 * 5.0
    assert np.abs(run.particles.velocity - before.velocity).max() <= 1e-6 * np.abs(before.velocity).max()


def test_choices_that_exclude_each_other() -> None:
    """Without films, and with films as forces."""
    for laws in (Laws(film_motions="full"), Laws(film=True, integrator="verlet", film_motions="full")):
        with pytest.raises(InputError, match="film_motions"):
            laws.check()


# ---------------------------------------------------------------- slow: other sets of laws


@pytest.mark.slow
@pytest.mark.parametrize("motions", ["full", "full_twist"])
def test_a_sphere_at_a_wall(motions: str) -> None:
    """Slopes of force and couple against ln(a/h) within 1 % of Goldman, Cox & Brenner; twist as in contact."""
    radius, step = 1e-3, 1e-12
    found = []
    for gap in (1e-7, 1e-6):
        row = []
        for velocity, spin in ((ACROSS, 0.0), (0.0, AROUND)):
            place, turning = [ALONG * (radius + gap)], spin + 3.0 * ALONG
            sphere = make_particles(place, radius, GLASS.density, velocity=velocity, spin=turning, viscosity=1.0)
            laws = FULL._replace(film_motions=motions)
            run = ParticleSolver(sphere, pair_table([GLASS]), walls=[Plane(normal=tuple(ALONG))], laws=laws)
            run.advance(step)
            mass, inertia = run.particles.mass[0], 0.4 * run.particles.mass[0] * radius**2
            pushed = -mass * (run.particles.velocity[0] - velocity) / step / (6.0 * math.pi * radius)
            turned = -inertia * (run.particles.spin[0] - turning) / step / (8.0 * math.pi * radius**2)
            row += [pushed @ ACROSS, turned @ AROUND]
            twist = turned @ ALONG / (3.0 * radius)
            expected = 0.5 * film.APERY if motions == "full_twist" else 0.0
            assert twist == pytest.approx(expected, rel=0.02, abs=1e-6)
        found.append(row)
    slopes = (np.array(found[0]) - found[1]) / math.log(10.0)
    # the couple of sliding acts against the turn that would roll the sphere on, and the other way round
    assert slopes[0] == pytest.approx(8.0 / 15.0, rel=0.01)
    assert abs(slopes[1]) == pytest.approx(1.0 / 10.0, rel=0.01)
    assert abs(slopes[2]) == pytest.approx(2.0 / 15.0 * radius, rel=0.01)
    assert slopes[3] == pytest.approx(2.0 / 5.0 * radius, rel=0.01)
    assert slopes[1] * slopes[2] > 0.0


@pytest.mark.slow
def test_work_of_all_films_is_the_change_of_energy() -> None:
    """Kinetic energy lost within round-off of what both kinds of film have taken."""
    spheres = cluster(1.0).particles
    run = ParticleSolver(
        spheres, pair_table([GLASS]), laws=FULL, settings=SolverSettings(energies=True, check_steps=False)
    )
    start = kinetic_energy(run.particles)
    run.advance(1e-6, 50)
    assert run.energies is not None
    totals = dict(zip(run.energies.channels, run.energies.totals))
    assert totals["film"] > 0.0 and totals["film_shear"] > 0.1 * totals["film"]
    lost = totals["film"] + totals["film_shear"]
    assert start - kinetic_energy(run.particles) == pytest.approx(lost, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("walls", [False, True])
def test_bits_on_ranks_and_resumed(walls: bool) -> None:
    """A box of unequal spheres in one process, on two and three ranks, and resumed half way: the same bits."""
    spheres, given = settings(True, walls)
    given["laws"] = WET._replace(film_motions="full_twist")
    length = float(spheres.position[:, 0].max())
    whole = finished(spheres.copy(), given, 200)
    assert whole.lists.made > 2 and (whole.edges.shear_resistance > 0.0).any()
    expected = joined([state(whole)])
    begun = finished(spheres.copy(), given, 100)
    resumed = finished(spheres.copy(), given, 0)
    resumed.restore(begun.checkpoint())
    resumed.advance(2e-6, 100)
    assert_same_bits(joined([state(resumed)]), expected)
    for ranks in (2, 3):

        def program(communicator: Communicator, ranks: int = ranks) -> dict[str, np.ndarray]:
            division = divided(ranks, 0, length)
            return state(finished(spheres.copy(), given, 200, communicator=communicator, division=division))

        assert_same_bits(joined(on_ranks(ranks, program)), expected)


@pytest.mark.slow
def test_bits_on_threads() -> None:
    """The dense bed of 10 000 spheres on one and on two threads."""
    from scenarios.benchmarks.dense_bed import STEP, bed

    before, states = use_threads(None), []
    try:
        for threads in (1, 2):
            use_threads(threads)
            run = bed(10_000, True, motions="full")
            run.particles.spin[:] = np.random.default_rng(1).normal(0.0, 100.0, run.particles.spin.shape)
            run.advance(STEP, 100)
            states.append((run.particles.position.copy(), run.particles.velocity.copy(), run.particles.spin.copy()))
    except InputError:
        pytest.skip("this machine has one thread")
    finally:
        use_threads(before)
    assert all(np.array_equal(one, other) for one, other in zip(*states))


@pytest.mark.slow
@pytest.mark.parametrize("press", [0.0, 20.0])
def test_films_dissipate_the_work_of_shear(press: float) -> None:
    """Within 0.1 %, at a solid fraction of 0.5 between plates and under a lid; much of it by sliding and rolling."""
    from scenarios.validation.sheared_films.study import sheared

    found = sheared(0.5, "full", press)
    assert found.dissipated == pytest.approx(1.0, abs=1e-3)
    assert found.sliding > 0.35


@pytest.mark.slow
@pytest.mark.parametrize("solid_fraction", [0.3, 0.55])
def test_the_viscosity_of_films_is_the_same_at_four_times_the_step(solid_fraction: float) -> None:
    """Within 3 %, over a strain of 0.1 from rest."""
    from scenarios.validation.sheared_films.study import sheared

    one, four = (sheared(solid_fraction, strain=0.1, steps_in_one=steps).viscosity for steps in (1.0, 4.0))
    assert four == pytest.approx(one, rel=0.03)
