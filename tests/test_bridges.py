"""Liquid bridges in the engine: force, energy, momenta, liquid; the same bits whatever the order and threads."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from cfddem.particles.initial.packing import random_packing
from cfddem.particles.interactions.bridge import Bridges
from cfddem.particles.interactions.bridge_loops import DAVIS, DEFORMING, EVEN, NASE, STATIC, BridgeLaws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import Particles, kinetic_energy, make_particles, particles_in
from closures import bridge, capillary, contact, lubrication

RADIUS, FILM, TENSION, ANGLE = 0.5e-3, 25e-6, 0.07, 0.26
GRAIN = Material(density=2500, youngs_modulus=1e7, poisson=0.25, restitution=1.0, friction=0.3)
LIQUID = 2.0 * capillary.liquid_share(RADIUS, RADIUS) * 4.0 / 3.0 * math.pi * ((RADIUS + FILM) ** 3 - RADIUS**3)
"""In a bridge of two spheres whose films were untouched."""


def bridged(
    spheres: Particles, laws: BridgeLaws, film: float = FILM, **options: object
) -> tuple[ParticleSolver, Bridges]:
    """A run of dry spheres with liquid on them."""
    bridges = Bridges(spheres, film, laws)
    return ParticleSolver(spheres, pair_table([GRAIN]), bridges=bridges, **options), bridges  # type: ignore[arg-type]


def pair(
    speed: float, gap: float = 3.0 * FILM, box: float | None = None, **laws: float
) -> tuple[ParticleSolver, Bridges]:
    """Two spheres that approach each other head-on; perhaps across a periodic border."""
    reach = 2.0 * RADIUS + gap
    places = np.array([[0.0, 0.0, 0.0], [reach if box is None else box - reach, 0.0, 0.0]])
    sign = 1.0 if box is None else -1.0
    spheres = make_particles(
        places, RADIUS, GRAIN.density, velocity=[[0.5 * sign * speed, 0, 0], [-0.5 * sign * speed, 0, 0]]
    )  # type: ignore[arg-type]
    given = BridgeLaws(**({"surface_tension": TENSION, "contact_angle": ANGLE} | laws))  # type: ignore[arg-type]
    return bridged(spheres, given, box=(box, box, box), skin=2.0 * RADIUS)


@pytest.mark.parametrize("box", [None, 8e-3])
@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_a_bridge_takes_the_work_between_where_it_forms_and_where_it_breaks(speed: float, box: float | None) -> None:
    """Elastic dry spheres lose W(rupture) - W(formation), Pitois et al.'s pull integrated over the gap."""
    run, bridges = pair(speed, box=box)
    before, formed_at, broke_at = kinetic_energy(run.particles), math.nan, math.nan
    step = 0.25 * run.time_scales(speed).recommended
    for _ in range(100_000):
        run.advance(step)
        if bridges.count:
            broke_at = float(bridges.gaps(run.box)[0][0])
            formed_at = broke_at if math.isnan(formed_at) else formed_at
        if bridges.broken:
            break
    reduced = contact.reduced(RADIUS, RADIUS)
    work = [capillary.pendular_energy(TENSION, ANGLE, reduced, LIQUID, gap) for gap in (formed_at, broke_at)]
    assert (bridges.formed, bridges.broken) == (1, 1)
    assert 0.9 * FILM < 0.5 * formed_at <= FILM
    assert broke_at == pytest.approx(capillary.rupture_length(0.0, ANGLE, LIQUID), rel=0.05)
    assert before - kinetic_energy(run.particles) == pytest.approx(work[1] - work[0], rel=0.02)


def test_the_pull_is_the_law_at_every_gap_and_nothing_else() -> None:
    """No pull before the films overlap, the law's own jump where they do, and none after the bridge has broken."""
    run, bridges = pair(0.0)
    made = run.particles
    longest = capillary.rupture_length(0.0, ANGLE, LIQUID)
    gaps = [*np.linspace(3.0, 2.0001, 5) * FILM, *np.linspace(1.9999, -0.1, 20) * FILM]
    gaps += [*np.linspace(0.0, 0.9999 * longest, 40), *np.linspace(1.0001, 1.5, 5) * longest]
    joined = False
    for gap in gaps:
        made.position[1, 0] = made.position[0, 0] + 2.0 * RADIUS + gap
        made.velocity[:] = 0.0
        bridges.update(run.views[1], run.box)
        bridges.kick(run.box, 1e-9, backwards=False)
        joined = gap < longest if joined else gap < 2.0 * FILM
        expected = capillary.pendular_pull(TENSION, ANGLE, 0.5 * RADIUS, LIQUID, gap) if joined else 0.0
        impulse = made.mass[:, None] * made.velocity
        assert impulse[0, 0] == pytest.approx(1e-9 * expected, rel=1e-9, abs=1e-27)
        assert (impulse.sum(axis=0) == 0.0).all()
    assert (bridges.formed, bridges.broken) == (1, 1)


@pytest.mark.parametrize(("film", "tangential"), [(DEFORMING, DAVIS), (STATIC, NASE)])
def test_resistances_are_those_of_the_laws(film: int, tangential: int) -> None:
    """Rates of the velocities along and across over a time that is short for both; and the spin that goes with it."""
    run, bridges = pair(0.0, FILM, viscosity=2.0, film=film, tangential=tangential, pull=EVEN)
    made, span, reduced = run.particles, 1e-12, 0.5 * RADIUS
    made.velocity[:] = [[0.2, 0.3, 0.0], [0.0, 0.0, 0.0]]
    bridges.kick(run.box, span, backwards=False)
    share = (bridge.static_share, bridge.deforming_share)[film](FILM, 2.0 * FILM)
    along = lubrication.film_strength(2.0, reduced) * share / FILM
    law = (bridge.davis_tangential, bridge.nase_tangential)[tangential]
    across = law(2.0, reduced, FILM, 2.0 * FILM)
    pull = bridge.constant_capillary(TENSION, reduced)
    force = (made.velocity[0] - [0.2, 0.3, 0.0]) / (span * made.inverse_mass[0])
    assert force == pytest.approx([pull - 0.2 * along, -0.3 * across, 0.0], rel=1e-5)
    torque = made.spin[0, 2] / (span * made.inverse_inertia[0])
    assert torque == pytest.approx(-0.3 * across * (RADIUS + 0.5 * FILM), rel=1e-5)


@pytest.mark.parametrize("cut", [0, 1])
def test_below_the_minimum_gap_a_film_is_cut(cut: int) -> None:
    """To nothing, or to what it is at h_min."""
    run, bridges = pair(0.0, 0.1 * FILM, viscosity=2.0, film=DEFORMING, cut=cut, pull=-1, minimum_gap=0.5 * FILM)
    run.particles.velocity[0] = [0.2, 0.0, 0.0]
    bridges.kick(run.box, 1e-12, backwards=False)
    share = bridge.deforming_share(0.5 * FILM, 2.0 * FILM)
    expected = cut * 0.2 * lubrication.film_strength(2.0, 0.5 * RADIUS) * share / (0.5 * FILM)
    assert run.particles.velocity[1, 0] / (1e-12 * run.particles.inverse_mass[1]) == pytest.approx(expected, rel=1e-5)


def test_slow_wet_spheres_stay_together_and_fast_ones_part() -> None:
    """The limit is the work of the bridge: m* v^2/2 = W(rupture) - W(formation)."""
    ends = (capillary.rupture_length(0.0, ANGLE, LIQUID), 2.0 * FILM)
    work = [capillary.pendular_energy(TENSION, ANGLE, 0.5 * RADIUS, LIQUID, gap) for gap in ends]
    critical = math.sqrt(4.0 * (work[0] - work[1]) / (GRAIN.density * 4.0 / 3.0 * math.pi * RADIUS**3))
    for ratio, broken in ((0.95, 0), (1.05, 1)):
        run, bridges = pair(ratio * critical, every=4)
        step = run.time_scales(critical).recommended
        for _ in range(int(4e-2 / step / 4)):
            run.advance(step, 4)
            if bridges.broken:
                break
        assert (bridges.formed, bridges.broken) == (1, broken)


def test_a_bridge_that_parts_fast_is_longer() -> None:
    run, bridges = pair(-1.0, FILM, viscosity=0.1)
    room = float(bridges.gaps(run.box)[1][0])
    stretched = capillary.rupture_length(0.1 * 1.0 / TENSION, ANGLE, LIQUID)
    assert room + FILM == pytest.approx(stretched, rel=1e-9)


def test_liquid_is_kept_and_shared() -> None:
    """A bridge takes the same from equal films; when it breaks each sphere has its share again."""
    run, bridges = pair(0.0, FILM)
    total = bridges.liquid
    assert bridges.count == 1
    assert bridges.film == pytest.approx(np.full(2, FILM * (1.0 - capillary.liquid_share(1.0, 1.0))), rel=0.01)
    run.particles.position[1, 0] += 10.0 * RADIUS
    bridges.update(run.views[1], run.box)
    assert bridges.count == 0
    assert bridges.film == pytest.approx(np.full(2, FILM), rel=1e-12)
    assert bridges.liquid == pytest.approx(total, rel=1e-15)


def test_agglomerates_are_what_bridges_join() -> None:
    places = np.array([[0, 0, 0], [1.02, 0, 0], [2.04, 0, 0], [5, 0, 0], [5, 1.02, 0], [9, 9, 9]]) * 2.0 * RADIUS
    _, bridges = bridged(make_particles(places, RADIUS, 2500.0), BridgeLaws(), skin=RADIUS)
    named = bridges.agglomerates
    assert sorted(np.bincount(named)) == [1, 2, 3]
    assert named[0] == named[1] == named[2]
    assert named[3] == named[4]


SYRUP = BridgeLaws(
    viscosity=5.0, surface_tension=TENSION, contact_angle=ANGLE, film=DEFORMING, tangential=DAVIS, minimum_gap=1e-6
)


def swarm(
    count: int, laws: BridgeLaws = SYRUP, speed: float = 0.1, **options: object
) -> tuple[ParticleSolver, Bridges]:
    """Unequal wet spheres that move in all directions in a periodic box, with their films close to each other."""
    draw = np.random.default_rng(1)
    size = RADIUS * draw.uniform(0.8, 1.2, count)
    places, box = random_packing(2.0 * (size + 0.3 * FILM), 0.45, 1)
    velocity = draw.normal(0.0, speed, places.shape)
    spheres = make_particles(places, size, GRAIN.density, velocity=velocity, spin=draw.normal(0.0, 50.0, places.shape))
    return bridged(spheres, laws, box=tuple(box), **options)


def test_bridges_keep_momenta_and_never_speed_up() -> None:
    """Stiff films: 5 Pa s would need steps of nanoseconds as forces. Angular momentum in open space."""
    run, bridges = swarm(300)
    made = run.particles
    assert bridges.count > 200
    momentum, energy = (made.mass[:, None] * made.velocity).sum(axis=0), kinetic_energy(made)
    scale = (made.mass[:, None] * np.abs(made.velocity)).sum()
    resist = bridges.laws._replace(pull=-1)
    bridges.laws = resist
    for _ in range(50):
        bridges.kick(run.box, 1e-3, backwards=False)
        assert kinetic_energy(made) <= energy * (1.0 + 1e-12)
        energy = kinetic_energy(made)
    assert np.abs((made.mass[:, None] * made.velocity).sum(axis=0) - momentum).max() < 1e-12 * scale

    draw = np.random.default_rng(3)
    places = 2.02 * RADIUS * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 1, 0.1]])
    spheres = make_particles(
        places, RADIUS, 2500.0, velocity=draw.normal(0, 0.1, (4, 3)), spin=draw.normal(0, 50.0, (4, 3))
    )
    run, bridges = bridged(spheres, SYRUP, skin=RADIUS)

    def turning() -> np.ndarray:
        own = 0.4 * spheres.mass[:, None] * RADIUS**2 * spheres.spin
        return (np.cross(spheres.position, spheres.mass[:, None] * spheres.velocity) + own).sum(axis=0)

    before = turning()
    bridges.kick(run.box, 1e-3, backwards=False)
    assert np.abs(turning() - before).max() < 1e-12 * np.abs(before).max()


def by_id(run: ParticleSolver) -> np.ndarray:
    order = np.argsort(run.particles.id)
    return np.concatenate([run.particles.position[order], run.particles.velocity[order], run.particles.spin[order]])


THIN = BridgeLaws(viscosity=0.05, surface_tension=TENSION, film=DEFORMING, tangential=DAVIS, minimum_gap=1e-6, every=4)


def after(steps: int) -> tuple[ParticleSolver, Bridges]:
    """1 200 fast spheres, with new lists and re-sorted particles, that form and break bridges."""
    run, bridges = swarm(1200, THIN, speed=1.0, sort_every=1, skin=2e-5)
    run.advance(1e-6, steps)
    return run, bridges


def test_the_same_bits_on_one_thread_and_on_two() -> None:
    before, states = use_threads(None), []
    try:
        for threads in (1, 2):
            use_threads(threads)
            run, bridges = after(400)
            states.append(by_id(run))
    except InputError:
        pytest.skip("this machine has one thread")
    finally:
        use_threads(before)
    assert bridges.broken > 50
    assert run.lists.made > 5
    assert np.array_equal(*states)


def test_the_same_bits_from_a_checkpoint() -> None:
    run, bridges = after(160)
    kept = run.checkpoint()
    same = particles_in(kept["particles"])
    again, others = bridged(same, THIN, box=tuple(run.box), sort_every=1, skin=2e-5)
    again.restore(kept)
    for each in (run, again):
        each.advance(1e-6, 240)
    assert np.array_equal(by_id(again), by_id(run))
    assert (others.formed, others.broken, others.liquid) == (bridges.formed, bridges.broken, bridges.liquid)


def test_the_order_of_particles_does_not_matter_to_bridges() -> None:
    """Impulses follow one another in the order of ids, so re-sorting changes round-off of contacts alone."""
    runs = [swarm(1200, sort_every=every, skin=2e-5)[0] for every in (1, 1 << 60)]
    for run in runs:
        run.advance(1e-6, 100)
    assert np.abs(by_id(runs[0]) - by_id(runs[1])).max() < 1e-9 * np.abs(by_id(runs[0])).max()


def test_spheres_come_and_go() -> None:
    """Bridges of removed spheres break and give them half of the liquid; inserted spheres bring theirs, or are dry."""
    places = np.array([[0, 0, 0], [1.02, 0, 0], [2.04, 0, 0]]) * 2.0 * RADIUS
    run, bridges = bridged(make_particles(places, RADIUS, 2500.0), BridgeLaws(surface_tension=TENSION), skin=RADIUS)
    liquid = bridges.liquid
    assert bridges.count == 2
    with pytest.raises(InputError, match="fewer than all 3"):
        run.remove(np.ones(3, bool))
    assert (bridges.count, bridges.broken, bridges.liquid) == (2, 0, liquid)
    gone = run.remove(np.array([True, False, False]))
    assert (bridges.count, bridges.broken) == (1, 1)
    assert bridges.liquid + gone.liquid.sum() == pytest.approx(liquid, rel=1e-14)
    new = run.insert(make_particles([[0, 0, 0]], RADIUS, 2500.0))
    assert run.particles.liquid[run.particles.id == new[0]] == 0.0
    run.advance(1e-7)
    assert bridges.count == 2  # the film of its neighbour is enough
    gone.position[:] = [[0, 10.0 * RADIUS, 0]]
    run.insert(gone)
    assert bridges.liquid == pytest.approx(liquid, rel=1e-14)
    assert set(bridges.joined.first) | set(bridges.joined.second) == {1, 2, int(new[0])}


@pytest.mark.parametrize(
    ("given", "said"),
    [({"surface_tension": -1.0}, "surface_tension"), ({"viscosity": math.nan}, "viscosity"),
     ({"every": 0}, "every"), ({"transition_pressure": 0.0}, "transition_pressure")],
)  # fmt: skip
def test_an_impossible_liquid_is_refused_by_name(given: dict[str, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        pair(0.0, **given)
    with pytest.raises(InputError, match="film of particle 0"):
        bridged(make_particles([[0, 0, 0]], RADIUS, 2500.0), BridgeLaws(), film=-1.0)
