"""The time_scales of the particles, the step that is refused, and the particle that ends a run."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from solver_options import grouped

from cfddem.backend.errors import RunFailed, UnstableStep
from cfddem.case.materials import Material
from cfddem.particles.interactions.contacts.linear import LINEAR
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import make_particles
from cfddem.particles.time_scales import check_step
from cfddem.particles.walls.shapes import Plane
from scenarios.benchmarks import dense_bed

GLASS = Material(density=2500, youngs_modulus=10e6, poisson=0.25, restitution=0.9, friction=0.5, roughness=1e-7)
RADIUS = 0.5e-3


def pair(laws: Laws | None = None, overlap: float = 0.0, viscosity: float = 0.0) -> ParticleSolver:
    """Two spheres that touch."""
    places = [[0.0, 0.0, 0.0], [2.0 * RADIUS - overlap, 0.0, 0.0]]
    spheres = make_particles(places, RADIUS, GLASS.density, viscosity=viscosity)
    return ParticleSolver(spheres, pair_table([GLASS]), laws=laws)


def test_recommended_step_is_two_per_cent_of_the_hertz_time() -> None:
    """t_H = 2.868 (m*^2/(R* E*^2 v))^(1/5) of the fastest approach, Johnson (1985), eq. (11.24); within 1e-3."""
    mass = 0.5 * GLASS.density * 4.0 / 3.0 * math.pi * RADIUS**3
    modulus = 0.5 * GLASS.youngs_modulus / (1.0 - GLASS.poisson**2)
    hertz = 2.868 * (mass**2 / (0.5 * RADIUS * modulus**2 * 0.3)) ** 0.2
    assert pair().time_scales(0.3).recommended == pytest.approx(0.02 * hertz, rel=1e-3)


def test_fastest_particle_sets_the_clock() -> None:
    """A particle faster than the reference speed counts: t_H falls as v^(-1/5)."""
    run = pair()
    slow = run.time_scales(0.1).hertz
    run.particles.velocity[1, 0] = 3.2
    assert run.time_scales(0.1).hertz == pytest.approx(slow / 2.0, rel=1e-12)


def test_linear_spring_has_a_clock_of_its_own() -> None:
    """Half a period of the spring, pi sqrt(m*/k), whatever the speed."""
    mass = 0.5 * GLASS.density * 4.0 / 3.0 * math.pi * RADIUS**3
    time_scales = pair(
        Laws(contact=LINEAR.with_parameters(normal_stiffness=1e3, tangential_stiffness=5e2))
    ).time_scales()
    assert time_scales.hertz == pytest.approx(0.02 * math.pi * math.sqrt(mass / 1e3), rel=1e-12)


def test_unstable_step_is_refused_with_the_one_that_works() -> None:
    """The refusal names the criterion, its limit, and a step that passes; a step at the limit passes."""
    read = pair().time_scales(1.0)
    check_step(read.recommended, read)
    check_step(read.limit, read)
    with pytest.raises(UnstableStep) as refusal:
        check_step(1.01 * read.limit, read)
    text = str(refusal.value)
    assert "\n" not in text
    assert f"{read.limit:.3g}" in text
    works = re.search(r"take (\S+) s", text)
    assert works is not None
    check_step(float(works.group(1)), read)


def test_run_refuses_an_unstable_step_and_names_one_that_works() -> None:
    """Looked at when a step is first taken, and again after some lists; whoever wants to see it fail says so."""
    run = pair(overlap=1e-3 * RADIUS)
    limit = run.time_scales().limit
    with pytest.raises(UnstableStep, match="take"):
        run.advance(1.01 * limit)
    assert run.steps == 0
    run.advance(run.recommended_step())
    wild = pair(overlap=1e-3 * RADIUS)
    wild._checking = False
    wild.advance(1.01 * limit)


def test_wall_of_another_material_sets_the_clock() -> None:
    """A sphere pressed into a wall a hundred times stiffer has a stiffer contact than into its own material."""
    hard = GLASS.model_copy(update={"youngs_modulus": 1e9})
    limits = []
    for material in (0, 1):
        sphere = make_particles([[0.0, 0.0, 0.99 * RADIUS]], RADIUS, GLASS.density)
        run = ParticleSolver(sphere, pair_table([GLASS, hard]), walls=[Plane(material=material)])
        limits.append(run.time_scales().overlap)
    moduli = pair_table([GLASS, hard])["contact_modulus"]
    assert limits[1] / limits[0] == pytest.approx(math.sqrt(moduli[0, 0] / moduli[0, 1]), rel=1e-9)


def energy_gain(share: float) -> float:
    """Energy of two elastic pressed spheres that swing, over the first, after many steps of `share` limits."""
    elastic = GLASS.model_copy(update={"restitution": 1.0, "friction": 0.0})
    chain = [[2.0 * RADIUS * 0.98 * n, 0.0, 0.0] for n in range(8)]
    fixed = [True, *[False] * 6, True]
    spheres = make_particles(chain, RADIUS, GLASS.density, fixed=fixed)
    run = ParticleSolver(spheres, pair_table([elastic]), settings=SolverSettings(skin=10.0 * RADIUS, check_steps=False))
    run.particles.velocity[1:7, 0] = 1e-3 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    run.refresh()
    limit = run.time_scales().overlap
    energies = []
    for _ in range(600):
        run.advance(share * limit)
        energies.append(float(np.sum(run.particles.velocity**2)))
    return max(energies) / 6e-6


def test_limit_of_existing_overlaps_is_where_a_network_stays_stable() -> None:
    """A pressed elastic chain swings on below the overlap criterion's limit and explodes at three times it.

    Velocity Verlet breaks at omega dt = 2; the criterion allows 1 of a bound (Gershgorin) on omega.
    """
    assert energy_gain(1.0) < 1.2
    assert not energy_gain(3.0) < 100.0


def test_film_has_a_clock_only_as_an_explicit_force() -> None:
    """The lubricated drift has no limit; velocity Verlet breaks at dt = 2 m* h_min / (6 pi eta R*^2)."""
    run = pair(Laws(film=True), viscosity=1e-3)
    drift = run.time_scales(0.1)
    run.laws = Laws(film=True, integrator="verlet")  # the same pair: clocks need no loop of its steps
    verlet = run.time_scales(0.1)
    mass = 0.5 * GLASS.density * 4.0 / 3.0 * math.pi * RADIUS**3
    resistance = 6.0 * math.pi * 1e-3 * (0.5 * RADIUS) ** 2 / float(pair_table([GLASS])[0, 0]["roughness_gap"])
    assert drift.film == math.inf
    assert verlet.film == pytest.approx(2.0 * mass / resistance, rel=1e-12)


def test_no_particle_crosses_a_tenth_of_its_radius_in_a_step() -> None:
    """The crossing criterion keeps fast particles from tunnelling."""
    assert pair().time_scales(100.0).crossing == pytest.approx(0.1 * RADIUS / 100.0, rel=1e-12)


def test_step_of_the_standard_bed_passes() -> None:
    """The benchmark's own 1e-5 s is accepted in the settled bed."""
    check_step(dense_bed.STEP, dense_bed.bed(10_000).time_scales())


def lone(**options: object) -> ParticleSolver:
    """One sphere above a floor."""
    sphere = make_particles([[0.0, 0.0, 3.0 * RADIUS]], RADIUS, GLASS.density, velocity=[0.0, 0.0, -0.5])
    return ParticleSolver(sphere, pair_table([GLASS]), gravity=(0.0, 0.0, -9.81), **grouped(**options))  # type: ignore[arg-type]


def test_particle_that_is_no_number_ends_the_run() -> None:
    """One line: id, place, time, speed, step, remedy."""
    run = pair()
    run.particles.applied[1, 0] = np.nan
    run.refresh()
    with pytest.raises(RunFailed, match=r"^particle 1 at \(.*\) m, t = \S+ s, speed .* is NaN; .*halve"):
        run.advance(1e-6, 10)


def test_particle_that_leaves_the_domain_ends_the_run() -> None:
    """A hole in the walls is found, and the time is that of leaving."""
    room = ((-1e-2, -1e-2, -1e-2), (1e-2, 1e-2, 1e-2))
    run = lone(domain=room)
    with pytest.raises(RunFailed) as failure:
        run.advance(1e-5, 100_000)
    assert re.match(
        r"particle 0 at \(.*\) m, t = \S+ s, speed \S+ m/s, .* has left the domain .*; ", str(failure.value)
    )
    assert "\n" not in str(failure.value)
    falls = (-0.5 + math.sqrt(0.25 + 2 * 9.81 * 11.5e-3)) / 9.81
    assert run.time == pytest.approx(falls, rel=0.01)


@pytest.mark.parametrize("what", ["wall", "particle"])
def test_particle_that_is_pressed_through_ends_the_run(what: str) -> None:
    """An overlap beyond half a radius names the particle and what it went into."""
    if what == "wall":
        run = lone(walls=[Plane()])
        run.particles.applied[0, 2] = -50.0
        run.refresh()
    else:
        run = pair(overlap=RADIUS)
        run.particles.velocity[0, 0] = 50.0
    with pytest.raises(RunFailed, match=rf"^particle \d at .* is pressed into {what} \d by .*; take a smaller step"):
        run.advance(1e-6, 2000)


def test_a_sound_run_is_left_alone() -> None:
    """A bouncing sphere inside its domain passes the guard at every list."""
    run = lone(walls=[Plane()], domain=((-1e-2, -1e-2, 0.0), (1e-2, 1e-2, 2e-2)))
    run.advance(1e-5, 20_000)
    assert run.time == pytest.approx(0.2)
