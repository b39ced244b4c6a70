"""Spray: where drops land, how much, and that nothing but the seed decides."""

from __future__ import annotations

import numpy as np
import pytest
from in_process_ranks import on_ranks

from cfddem.backend.errors import InputError
from cfddem.features.spray import Spray, box, cone
from cfddem.model.fields import Field
from cfddem.particles.state import Particles, make_particles

DROP = 1e-13
ZONE = box(np.zeros(3), np.array([1.0, 1.0, 0.5]))


def wet(count: int = 200, seed: int = 1) -> Particles:
    draw = np.random.default_rng(seed)
    made = make_particles(draw.uniform(0.0, 1.0, (count, 3)), draw.choice([1e-3, 2e-3], count), 2500.0)
    made.declare(Field("liquid", "m3"))
    return made


def spray(seed: int = 3) -> Spray:
    return Spray(1e-9, DROP, ZONE, seed, begin=0.1, end=1.1)


def test_all_drops_land_in_the_zone_and_by_projected_area() -> None:
    particles, nozzle = wet(), spray()
    for time in np.linspace(0.0, 2.0, 41):
        nozzle(particles, float(time))
    assert nozzle.landed == 10_000 and nozzle.missed == 0
    assert particles.liquid.sum() == pytest.approx(10_000 * DROP, rel=1e-12) == nozzle.volume
    inside = ZONE(particles.position)
    assert not particles.liquid[~inside].any()
    large = inside & (particles.radius > 1.5e-3)
    area = particles.radius**2
    expected = area[large].sum() / area[inside].sum()
    share = particles.liquid[large].sum() / particles.liquid.sum()
    assert share == pytest.approx(expected, abs=4.0 * np.sqrt(expected * (1.0 - expected) / 10_000))
    mean = 10_000 * area[inside] / area[inside].sum()
    spread = (particles.liquid[inside] / DROP - mean) / np.sqrt(mean)
    assert np.mean(spread**2) == pytest.approx(1.0, abs=0.4), "independent drops: chi square per particle"


def test_the_order_of_particles_and_the_length_of_steps_do_not_matter() -> None:
    one, other, first, second = wet(), wet(), spray(), spray()
    order = np.random.default_rng(5).permutation(other.count)
    other.reorder(order)
    first(one, 0.5)
    for time in (0.2, 0.3, 0.45, 0.5):
        second(other, time)
    assert np.array_equal(one.liquid[order], other.liquid)
    assert not np.array_equal(one.liquid, _after(spray(seed=4)))


def _after(nozzle: Spray) -> np.ndarray:
    particles = wet()
    nozzle(particles, 0.5)
    return particles.liquid


def test_a_resumed_spray_continues_with_the_same_drops() -> None:
    whole, part, first = wet(), wet(), spray()
    first(whole, 1.0)
    begun, resumed = spray(), spray()
    begun(part, 0.4)
    resumed.restore(begun.checkpoint())
    resumed(part, 1.0)
    assert np.array_equal(whole.liquid, part.liquid)


def test_drops_that_find_no_particle_are_missed() -> None:
    particles, nozzle = wet(), Spray(1e-9, DROP, box(np.full(3, 2.0), np.ones(3)), 1)
    nozzle(particles, 1.0)
    assert (nozzle.landed, nozzle.missed) == (0, 10_000)
    assert not particles.liquid.any()


def test_ranks_share_a_spray() -> None:
    whole = _after(spray())

    def part(communicator: object) -> np.ndarray:
        particles, nozzle = wet(), spray()
        nozzle.communicator = communicator
        particles.keep(np.flatnonzero(np.arange(particles.count) % 3 == communicator.rank))  # type: ignore[attr-defined]
        nozzle(particles, 0.5)
        return np.stack([particles.id, particles.liquid])

    parts = np.concatenate(on_ranks(3, part), axis=1)
    assert np.array_equal(parts[1][np.argsort(parts[0])], whole)


def test_a_cone_opens_by_its_full_angle() -> None:
    inside = cone(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0]), np.radians(90.0), 0.5)
    assert inside(np.array([[0.29, 0.0, 0.7], [0.31, 0.0, 0.7], [0.0, 0.0, 1.1], [0.0, 0.0, 0.45]])).tolist() == [
        True,
        False,
        False,
        False,
    ]


@pytest.mark.parametrize(("rate", "drop"), [(-1.0, DROP), (np.nan, DROP), (1e-9, 0.0)])
def test_a_spray_without_sense_is_refused(rate: float, drop: float) -> None:
    with pytest.raises(InputError):
        Spray(rate, drop, ZONE, 1)
