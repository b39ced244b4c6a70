"""Liquid bridges in the particle engine: their force, energy, momentum and liquid; agglomerates that grow."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cfddem.errors import InputError
from cfddem.materials import Material, pair_table
from cfddem.particles.forces import Laws
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import bodies
from closures import capillary, contact
from scenarios.wet_bridges import NEVER, Bridges
from scenarios.wet_tumbler import advance, tumble

RADIUS, FILM, TENSION, ANGLE = 0.5e-3, 25e-6, 0.07, 0.26
GRAIN = Material(density=2500, youngs_modulus=1e7, poisson=0.25, restitution=1.0)


def pair(speed: float, gap: float = 3.0 * FILM, viscosity: float = 0.0, box: float | None = None) -> Bridges:
    """Two spheres that approach each other head-on, the second held by nothing; perhaps across a periodic border."""
    reach = 2.0 * RADIUS + gap
    places = [[0.0, 0.0, 0.0], [reach if box is None else box - reach, 0.0, 0.0]]
    sign = 1.0 if box is None else -1.0
    spheres = bodies(places, RADIUS, GRAIN.density, velocity=[[0.5 * sign * speed, 0, 0], [-0.5 * sign * speed, 0, 0]])
    run = ParticleSolver(
        spheres, pair_table([GRAIN]), laws=Laws(), box=(box, box, box), skin=2.0 * RADIUS, sort_every=NEVER
    )
    return Bridges(run, np.full(2, FILM), TENSION, ANGLE, viscosity)


def energy(bridges: Bridges) -> float:
    made = bridges.run.bodies
    return 0.5 * float((made.mass * (made.velocity**2).sum(axis=1)).sum())


@pytest.mark.parametrize("box", [None, 8e-3])
@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_a_bridge_takes_the_work_between_where_it_forms_and_where_it_breaks(speed: float, box: float | None) -> None:
    """Elastic dry spheres lose W(rupture) - W(formation), Pitois et al.'s pull integrated over the gap."""
    bridges = pair(speed, box=box)
    before, formed_at, broke_at, liquid = energy(bridges), math.nan, math.nan, 0.0
    step = 0.25 * bridges.run.clocks(speed).recommended
    for _ in range(100_000):
        advance(bridges, None, step, 1)
        if bridges.formed and not bridges.broken:
            broke_at = float(bridges.gap[0])
            if math.isnan(formed_at):
                formed_at, liquid = broke_at, float(bridges.volume[0])
        if bridges.broken:
            break
    reduced = contact.reduced(RADIUS, RADIUS)
    work = [capillary.pendular_energy(TENSION, ANGLE, reduced, liquid, gap) for gap in (formed_at, broke_at)]
    assert (bridges.formed, bridges.broken) == (1, 1)
    assert 0.9 * FILM < 0.5 * formed_at <= FILM
    assert broke_at == pytest.approx(capillary.rupture_length(0.0, ANGLE, liquid), rel=0.05)
    assert before - energy(bridges) == pytest.approx(work[1] - work[0], rel=0.02)


def test_the_force_of_a_bridge_is_the_law_at_every_gap_and_nothing_else() -> None:
    """No force before the films overlap, the law's own jump where they do, and none after the bridge has broken."""
    bridges = pair(0.0)
    made = bridges.run.bodies
    share = capillary.liquid_share(RADIUS, RADIUS)
    liquid = 2.0 * share * 4.0 / 3.0 * math.pi * ((RADIUS + FILM) ** 3 - RADIUS**3)
    longest = capillary.rupture_length(0.0, ANGLE, liquid)
    gaps = [*np.linspace(3.0, 2.0001, 5) * FILM, *np.linspace(1.9999, -0.1, 20) * FILM]
    gaps += [*np.linspace(0.0, 0.9999 * longest, 40), *np.linspace(1.0001, 1.5, 5) * longest]
    joined = False
    for gap in gaps:
        made.position[1, 0] = made.position[0, 0] + 2.0 * RADIUS + gap
        bridges.update()
        joined = gap < longest if joined else gap < 2.0 * FILM
        expected = capillary.pendular_pull(TENSION, ANGLE, 0.5 * RADIUS, liquid, gap) if joined else 0.0
        assert bridges.force[0, 0] == pytest.approx(expected, rel=1e-9, abs=1e-18)
        assert (bridges.force.sum(axis=0) == 0.0).all()
    assert (bridges.formed, bridges.broken) == (1, 1)


def test_slow_wet_spheres_stay_together_and_fast_ones_part() -> None:
    """The limit is the work of the bridge: m* v^2/2 = W(rupture) - W(formation)."""
    liquid = 2.0 * capillary.liquid_share(RADIUS, RADIUS) * 4.0 / 3.0 * math.pi * ((RADIUS + FILM) ** 3 - RADIUS**3)
    ends = (capillary.rupture_length(0.0, ANGLE, liquid), 2.0 * FILM)
    work = [capillary.pendular_energy(TENSION, ANGLE, 0.5 * RADIUS, liquid, gap) for gap in ends]
    mass = GRAIN.density * 4.0 / 3.0 * math.pi * RADIUS**3
    critical = math.sqrt(4.0 * (work[0] - work[1]) / mass)
    for ratio, broken in ((0.95, 0), (1.05, 1)):
        bridges = pair(ratio * critical)
        step = bridges.run.clocks(critical).recommended
        for _ in range(int(4e-2 / step / 4)):
            advance(bridges, None, step, 4)
            if bridges.broken:
                break
        assert (bridges.formed, bridges.broken) == (1, broken)


def test_a_bridge_that_parts_fast_is_longer() -> None:
    slow, fast = (float(pair(0.0, FILM, viscosity).room[0]) for viscosity in (0.0, 1.0))
    assert slow == fast  # at rest
    parting = pair(-1.0, FILM, 0.1)
    parting.update()
    stretched = 1.0 + math.sqrt(0.1 * 1.0 / TENSION)
    assert float(parting.room[0]) + FILM == pytest.approx((slow + FILM) * stretched, rel=1e-9)


def test_liquid_is_kept_and_shared() -> None:
    """A bridge takes the same from equal films; when it breaks each sphere has its share again."""
    bridges = pair(0.0, FILM)
    total = bridges.liquid
    assert len(bridges.volume) == 1
    assert bridges.film == pytest.approx(np.full(2, FILM * (1.0 - capillary.liquid_share(1.0, 1.0))), rel=0.01)
    bridges.run.bodies.position[1, 0] += 10.0 * RADIUS
    bridges.update()
    assert len(bridges.volume) == 0
    assert bridges.film == pytest.approx(np.full(2, FILM), rel=1e-12)
    assert bridges.liquid == pytest.approx(total, rel=1e-15)


def test_agglomerates_are_what_bridges_join() -> None:
    places = np.array([[0, 0, 0], [1.02, 0, 0], [2.04, 0, 0], [5, 0, 0], [5, 1.02, 0], [9, 9, 9]]) * 2.0 * RADIUS
    run = ParticleSolver(bodies(places, RADIUS, 2500.0), pair_table([GRAIN]), skin=RADIUS, sort_every=NEVER)
    named = Bridges(run, np.full(6, FILM), TENSION, ANGLE, 0.0).agglomerates
    assert sorted(np.bincount(named)) == [1, 2, 3]
    assert named[0] == named[1] == named[2]
    assert named[3] == named[4]


def test_stirred_spheres_keep_momentum_number_and_liquid() -> None:
    result = tumble(0.05, 150, until=0.03, samples=10)
    assert result.momentum_error < 1e-12
    assert result.liquid_error < 1e-12
    assert result.spheres == 150
    assert result.formed > 50
    assert result.formed - result.broken == len(result.bridge_set.first)
    assert result.mean_size[-1] > 1.3


def test_the_same_seed_gives_the_same_run() -> None:
    one, other = (tumble(0.05, 60, until=0.004, samples=2) for _ in range(2))
    assert np.array_equal(one.bridge_set.run.bodies.position, other.bridge_set.run.bodies.position)


@pytest.mark.parametrize(
    "given", [{"capillary_number": 0.0}, {"until": math.nan}, {"film_spread": 1.0}, {"film": -1.0}]
)
def test_an_impossible_tumbler_is_refused_by_name(given: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(given))):
        tumble(**({"count": 50} | given))  # type: ignore[arg-type]


@pytest.mark.slow
def test_agglomerates_grow_as_the_capillary_number_falls() -> None:
    results = [tumble(number, 500, until=0.15) for number in (0.3, 0.05, 0.01)]
    sizes = [result.late(result.mean_size) for result in results]
    assert sizes[1] > 1.3 * sizes[0]
    assert sizes[2] > 1.3 * sizes[1]
