"""Positions, velocities and the memory of a contact belong to the same instant, and nothing else matters.

Vyas, Ottino, Lueptow & Umbanhowar, Comput. Phys. Commun. 310, 109524 (2025), doi:10.1016/j.cpc.2025.109524: a code
that moves the tangential spring with the velocity of the half step in the tangent plane of the full step makes
small spheres stick to large ones. Where a sphere touches two large ones the error is of first order in the step.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from impacts import STEP, Pair, until_apart
from solver_options import grouped

from cfddem.case.materials import Material
from cfddem.particles.interactions.contacts.linear import LINEAR
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from closures import contact

GRAVITY = 9.81
GRAIN = 0.25e-3
"""Radius of the small sphere [m]; it is of glass."""

SOLID = Material(density=2500, youngs_modulus=5e8, poisson=0.3, restitution=0.5)
STIFF = Laws(contact=LINEAR.with_parameters(normal_stiffness=1e4, tangential_stiffness=8235.0))
"""The springs of the case of Vyas et al., as it stands in the examples of LAMMPS [N/m]."""


def grain_and_large(
    position: list[float], ratio: float, half_distance: float, friction: float, laws: Laws, **options: object
) -> ParticleSolver:
    """A sphere and two fixed spheres, `ratio` times larger, with centres at x = -half_distance and half_distance."""
    solid = SOLID.model_copy(update={"friction": friction})
    centres = [[-half_distance, 0.0, 0.0], [half_distance, 0.0, 0.0]]
    made = make_particles(
        [position, *centres], [GRAIN, ratio * GRAIN, ratio * GRAIN], solid.density, fixed=[False, True, True]
    )
    return ParticleSolver(
        made, pair_table([solid]), laws=laws, gravity=(0.0, 0.0, -GRAVITY), **grouped(skin=ratio * GRAIN, **options)
    )  # type: ignore[arg-type]


@pytest.mark.parametrize("laws", [STIFF, Laws(contact="hertz")], ids=["linear", "hertz"])
@pytest.mark.parametrize("ratio", [3.0, 10.0, 20.0, 100.0])
def test_grain_rolls_out_of_a_groove(ratio: float, laws: Laws) -> None:
    """A sphere in the groove of two large spheres rolls off: energy to 2e-4, spin to 5e-5, and no deeper.

    The centre moves on a circle of radius b about the line of the large centres, the contacts lie b/(R + r) of the
    radius from the axis of the spin: v^2 (1 + 0.4 (R + r)^2/b^2) = 2 g b (cos theta_0 - cos theta). The overlap is
    what the weight, less the centrifugal force, asks of the two contacts. A spring moved in the wrong plane turns
    into the radial direction and takes the sphere 2 to 24 times deeper.
    """
    large, start = ratio * GRAIN, 0.2
    reach = math.sqrt((large + GRAIN) ** 2 - large**2)
    upright = reach / (large + GRAIN)
    run = grain_and_large([0.0, reach * math.sin(start), reach * math.cos(start)], ratio, large, 0.5, laws)
    angle = start
    while angle < 0.65:
        run.advance(1e-6, 200)
        assert run.time < 0.5, "the sphere sticks in the groove"
        _, y, z = run.particles.position[0]
        angle, speed = math.atan2(y, z), np.linalg.norm(run.particles.velocity[0])
        if angle > 0.3:
            energy = 2.0 * GRAVITY * reach * (math.cos(start) - math.cos(angle))
            assert (1.0 + 0.4 / upright**2) * speed**2 == pytest.approx(energy, rel=2e-4)
            assert -run.particles.spin[0, 0] * upright * GRAIN == pytest.approx(speed, rel=5e-5)
    push = 0.5 * run.particles.mass[0] * (GRAVITY * math.cos(angle) - speed**2 / reach) / upright
    stiffness = laws.contact_law.parameters.get("normal_stiffness")
    overlap = hertz_overlap(push, ratio) if stiffness is None else push / stiffness
    assert 0.0 < reach - math.hypot(y, z) <= 1.05 * overlap / upright


def hertz_overlap(force: float, ratio: float) -> float:
    """Overlap of the sphere and a large sphere [m]."""
    radius = contact.reduced(GRAIN, ratio * GRAIN)
    modulus = contact.reduced_modulus(SOLID.youngs_modulus, SOLID.poisson, SOLID.youngs_modulus, SOLID.poisson)
    return (force / contact.hertz_stiffness(modulus, radius)) ** (2.0 / 3.0)


@pytest.mark.parametrize("friction", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("ratio", [10.0, 30.0, 100.0])
def test_grain_falls_through_a_wide_gap(ratio: float, friction: float) -> None:
    """A gap of 1.1 sphere diameters between two large spheres never holds the sphere, however rough."""
    large = ratio * GRAIN
    half = large + 1.1 * GRAIN
    angle = 0.2  # above the horizontal, where it touches the left one at first
    place = [-half + (large + GRAIN) * math.cos(angle), 0.0, (large + GRAIN) * math.sin(angle)]
    run = grain_and_large(place, ratio, half, friction, STIFF, free=(1.0, 0.0, 1.0))
    while run.particles.position[0, 2] > -0.5 * large:
        run.advance(2e-6, 1000)
        assert run.time < 1.0, "the sphere sticks in the gap"


@pytest.mark.parametrize("friction", [0.1, 0.5, 2.0])
@pytest.mark.parametrize("ratio", [10.0, 30.0, 100.0])
def test_grain_rests_above_a_narrow_gap(ratio: float, friction: float) -> None:
    """A gap of 0.9 diameters holds the sphere; it comes to rest where it touches both, or wedged 2 % of r deeper."""
    large = ratio * GRAIN
    half = large + 0.9 * GRAIN
    height = math.sqrt((large + GRAIN) ** 2 - half**2)
    run = grain_and_large([0.01 * GRAIN, 0.0, height + 0.5 * GRAIN], ratio, half, friction, STIFF, free=(1.0, 0.0, 1.0))
    run.advance(2e-6, 250000)
    assert np.linalg.norm(run.particles.velocity[0]) <= 1e-6
    assert run.particles.position[0, 0] == pytest.approx(0.0, abs=2e-2 * GRAIN)
    assert height - 2e-2 * GRAIN <= run.particles.position[0, 2] <= height


GLASS = Material(
    density=2500, youngs_modulus=60e9, poisson=0.23, restitution=0.9, friction=0.3, friction_lubricated=0.1,
    roughness=134e-9,
)  # fmt: skip
DELRIN = Material(density=1400, youngs_modulus=2.8e9, poisson=0.35, restitution=0.97, friction=0.2, roughness=796e-9)


def oblique(film: bool) -> tuple[Pair, Laws]:
    """An unlike pair that meets at a slant and spins, dry or immersed."""
    pair = Pair(
        (GLASS, DELRIN), (2e-3, 5e-3), 0.3, slide=0.25, spin=((10.0, -50.0, 80.0), (5.0, 0.0, -20.0)),
        gap=1e-6 if film else 0.0, viscosity=2e-3 if film else 0.0,
    )  # fmt: skip
    return pair, Laws(film=film)


STATE = ("position", "velocity", "spin", "force", "torque")


def after_contact(run: ParticleSolver, pair: Pair) -> ParticleSolver:
    """The run once the contact is over."""
    return until_apart(run, STEP * pair.hertz_time)


@pytest.mark.parametrize("film", [False, True], ids=["dry", "film"])
def test_a_run_repeats_bit_by_bit(film: bool) -> None:
    """Twice the same run: every number of every body the same bits."""
    pair, laws = oblique(film)
    first, again = (after_contact(pair.simulation(laws), pair) for _ in range(2))
    for name in STATE:
        assert np.array_equal(getattr(first.particles, name), getattr(again.particles, name)), name


def moved(
    pair: Pair, laws: Laws, order: list[int], axes: np.ndarray, shift: float, **options: object
) -> ParticleSolver:
    """The same collision with its particles listed in another order, axes reflected, and elsewhere."""
    given = pair.simulation(laws).particles
    reflected = np.prod(axes) * axes  # spins are axial vectors
    made = make_particles(
        (given.position * axes + shift)[order],
        given.radius[order],
        given.density[order],
        velocity=(given.velocity * axes)[order],
        spin=(given.spin * reflected)[order],
        material=given.material[order],
        viscosity=pair.viscosity,
    )
    return ParticleSolver(made, pair.rows, laws=laws, **grouped(**{"skin": max(pair.radii), **options}))  # type: ignore[arg-type]


@pytest.mark.parametrize("film", [False, True], ids=["dry", "film"])
@pytest.mark.parametrize("order", [[0, 1], [1, 0]], ids=["same order", "swapped"])
@pytest.mark.parametrize("axes", [(1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, -1)], ids=str)
def test_order_and_mirror_do_not_matter(film: bool, order: list[int], axes: tuple[int, int, int]) -> None:
    """Particles listed the other way round, space reflected: the mirrored result to 1e-12."""
    pair, laws = oblique(film)
    signs = np.array(axes, float)
    plain = after_contact(pair.simulation(laws), pair).particles
    other = after_contact(moved(pair, laws, order, signs, 0.0), pair).particles
    for name in ("velocity", "spin"):
        expected = (getattr(plain, name) * (signs if name == "velocity" else np.prod(signs) * signs))[order]
        scale = np.abs(expected).max()
        assert getattr(other, name) == pytest.approx(expected, abs=1e-12 * scale), name


@pytest.mark.parametrize("shift", [0.1, 10.0])
def test_place_does_not_matter(shift: float) -> None:
    """Far from the origin the result changes by no more than the rounding of a position against the overlap."""
    pair, laws = oblique(False)
    plain = after_contact(pair.simulation(laws), pair).particles
    away = after_contact(moved(pair, laws, [0, 1], np.ones(3), shift), pair).particles
    overlap = contact.hertz_largest_overlap(pair.reduced_mass, pair.stiffness, pair.approach)
    rounding = np.finfo(float).eps * shift / overlap
    for name in ("velocity", "spin"):
        expected = getattr(plain, name)
        assert getattr(away, name) == pytest.approx(expected, abs=100.0 * rounding * np.abs(expected).max()), name


@pytest.mark.parametrize("film", [False, True], ids=["dry", "film"])
@pytest.mark.parametrize("order", [[0, 1], [1, 0]], ids=["same order", "swapped"])
def test_age_of_the_neighbour_list_does_not_matter(film: bool, order: list[int]) -> None:
    """A list found anew every few steps of a contact carries its memory: velocities and spins within 1e-3."""
    pair, laws = oblique(film)
    step = STEP * pair.hertz_time
    often = moved(pair, laws, order, np.ones(3), 0.0, skin=0.5 * pair.approach * pair.hertz_time)
    once = pair.simulation(laws)
    edges, lists = often.edges, 1
    for _ in range(400):
        often.advance(step)
        once.advance(step)
        lists += often.edges is not edges
        edges = often.edges
    assert lists > 5
    assert once.gap[0] > 0.0
    for name in ("velocity", "spin"):
        expected = getattr(once.particles, name)[order]
        assert getattr(often.particles, name) == pytest.approx(expected, abs=1e-3 * np.abs(expected).max()), name
