"""Many liquid bridges at once: momenta, stability, liquid; the same bits whatever the order and threads."""

from __future__ import annotations

import numpy as np
import pytest
from wet_spheres import RADIUS, SYRUP, TENSION, THIN, bridged, swarm

from cfddem.backend.compile import use_threads
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import specialise
from cfddem.features.spray import Spray, box
from cfddem.particles import listing
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.interactions.joint_solution import film_kick
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import kinetic_energy, make_particles, particles_in


def brake(run: ParticleSolver, span: float) -> None:
    """Give the particles the impulses of their bridges alone."""
    specialise(film_kick, run.choices)(run.system, span)


@pytest.mark.parametrize("span", [1e-6, 1e-4, 1e-2])
def test_bridges_keep_momenta_and_never_speed_up(span: float) -> None:
    """Stiff films: 5 Pa s would need steps of nanoseconds as forces. Angular momentum in open space."""
    run, bridges = swarm(300)
    made = run.particles
    assert bridges.count > 200
    momentum, energy = (made.mass[:, None] * made.velocity).sum(axis=0), kinetic_energy(made)
    scale = (made.mass[:, None] * np.abs(made.velocity)).sum()
    for _ in range(20):
        brake(run, span)
        assert kinetic_energy(made) <= energy * (1.0 + 1e-12)
        energy = kinetic_energy(made)
    assert np.abs((made.mass[:, None] * made.velocity).sum(axis=0) - momentum).max() < 1e-12 * scale

    draw = np.random.default_rng(3)
    places = 2.02 * RADIUS * np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 1, 0.1]])
    spheres = make_particles(
        places, RADIUS, 2500.0, velocity=draw.normal(0, 0.1, (4, 3)), spin=draw.normal(0, 50.0, (4, 3))
    )
    run, bridges = bridged(spheres, SYRUP, skin=RADIUS)
    assert bridges.count == 3

    def turning() -> np.ndarray:
        own = 0.4 * spheres.mass[:, None] * RADIUS**2 * spheres.spin
        return (np.cross(spheres.position, spheres.mass[:, None] * spheres.velocity) + own).sum(axis=0)  # type: ignore[no-any-return]

    before = turning()
    brake(run, span)
    assert np.abs(turning() - before).max() < 1e-12 * np.abs(before).max()


def by_id(run: ParticleSolver) -> np.ndarray:
    order = np.argsort(run.particles.id)
    return np.concatenate([run.particles.position[order], run.particles.velocity[order], run.particles.spin[order]])


def after(steps: int) -> tuple[ParticleSolver, Bridges]:
    """1 200 fast spheres, with new lists and re-sorted particles, that form and break bridges."""
    run, bridges = swarm(1200, THIN, speed=1.0, sort_every=1, skin=2e-5)
    run.advance(1e-6, steps)
    return run, bridges


@pytest.mark.slow
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


def test_the_same_bits_from_a_checkpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listing, "THREADING_PAYS", 1 << 60)
    run, bridges = after(160)
    kept = run.checkpoint()
    again, others = bridged(particles_in(kept["particles"]), THIN, 0.0, box=tuple(run.box), sort_every=1, skin=2e-5)
    again.restore(kept)
    for each in (run, again):
        each.advance(1e-6, 240)
    assert np.array_equal(by_id(again), by_id(run))
    assert (others.formed, others.broken, others.liquid) == (bridges.formed, bridges.broken, bridges.liquid)


def test_the_order_of_particles_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    """Re-sorted at every list or never: the same bits."""
    monkeypatch.setattr(listing, "THREADING_PAYS", 1)
    runs = [swarm(300, THIN, speed=1.0, sort_every=every, skin=2e-5)[0] for every in (1, 1 << 60)]
    for run in runs:
        run.advance(1e-6, 200)
    assert runs[0].lists.made > 3
    assert not np.array_equal(runs[0].particles.id, runs[1].particles.id)
    assert np.array_equal(by_id(runs[0]), by_id(runs[1]))


def formed_and_broken(steps: int) -> None:
    """Liquid over many steps in which bridges form and break, and a spray adds a tenth of it."""
    run, bridges = swarm(150, THIN, speed=1.0)
    liquid, step = bridges.liquid, 1e-6
    drop = 1e-4 * liquid
    spray = Spray(0.1 * liquid / (steps * step), drop, box(np.zeros(3), np.array(run.box)), seed=3)
    speed, draw = run.particles.velocity.std(), np.random.default_rng(5)
    for _ in range(steps // 100):
        run.advance(step, 100)
        spray(run.particles, run.time)
        if run.steps % 500 == 0:
            run.particles.velocity[:] = draw.normal(0.0, speed, run.particles.velocity.shape)  # stirred
    assert bridges.broken > steps // 50
    assert spray.landed == pytest.approx(1000, abs=2)
    assert bridges.liquid == pytest.approx(liquid + spray.volume, rel=1e-12)


def test_liquid_is_kept_where_bridges_form_and_break() -> None:
    formed_and_broken(5_000)


@pytest.mark.slow
def test_liquid_is_kept_over_a_hundred_thousand_steps() -> None:
    formed_and_broken(100_000)


def sheared(steps: int) -> None:
    """Syrup of 10 Pa s at the dry step, in a bed at a solid fraction of 0.6 that is sheared all the time."""
    laws = BridgeLaws(
        viscosity=10.0, surface_tension=TENSION, film="deforming", cut="constant", tangential="davis", minimum_gap=1e-6
    )
    run, bridges = swarm(200, laws, speed=0.05, solid=0.6)
    assert bridges.count > 3 * 200
    step, made = run.time_scales(0.1).recommended, run.particles
    rate, height = 20.0, float(run.box[2])
    for _ in range(steps // 50):
        made.velocity[:, 0] += 50 * step * rate * height * 5.0 * np.sin(2.0 * np.pi * made.position[:, 2] / height)
        run.advance(step, 50)
        speed = np.abs(made.velocity).max()
        assert speed < rate * height  # stays below what the force alone gives
    assert bridges.count > 3 * 200


@pytest.mark.slow
def test_syrup_is_stable_at_the_dry_step() -> None:
    sheared(2_000)


@pytest.mark.slow
def test_syrup_is_stable_over_a_hundred_thousand_steps() -> None:
    sheared(100_000)


@pytest.mark.slow
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
    assert bridges.count == 2  # the film of its neighbour is enough
    gone.position[:] = [[0, 10.0 * RADIUS, 0]]
    run.insert(gone)
    assert bridges.liquid == pytest.approx(liquid, rel=1e-14)
    assert set(bridges.bodies.reshape(-1).tolist()) == {1, 2, int(new[0])}
