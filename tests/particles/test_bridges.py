"""Liquid bridges between particles: forces, energy, momenta, liquid; the same bits whatever the order and threads."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from wet_spheres import ANGLE, FILM, GRAIN, LIQUID, RADIUS, TENSION, bridged

from cfddem.backend.compile import serial
from cfddem.backend.errors import InputError
from cfddem.backend.law_set import specialise
from cfddem.particles.interactions.bridge import coat
from cfddem.particles.interactions.bridge_law import BridgeLaws
from cfddem.particles.interactions.bridge_solution import held_gap, resistance_integral, speed_after_bridge
from cfddem.particles.interactions.bridge_view import Bridges
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.interactions.slots import BridgeState
from cfddem.particles.solver import ParticleSolver, SolverSettings
from cfddem.particles.state import kinetic_energy, make_particles
from cfddem.particles.walls.shapes import Plane
from closures import bridge, capillary, capillary_pull, contact, lubrication


def pair(
    speed: float, gap: float = 3.0 * FILM, box: float | None = None, **laws: Any
) -> tuple[ParticleSolver, Bridges]:
    """Two spheres that approach each other head-on; perhaps across a periodic border."""
    reach = 2.0 * RADIUS + gap
    places = np.array([[0.0, 0.0, 0.0], [reach if box is None else box - reach, 0.0, 0.0]])
    sign = 1.0 if box is None else -1.0
    velocity = np.array([[0.5 * sign * speed, 0, 0], [-0.5 * sign * speed, 0, 0]])
    spheres = make_particles(places, RADIUS, GRAIN.density, velocity=velocity)
    given = BridgeLaws(**({"surface_tension": TENSION, "contact_angle": ANGLE} | laws))
    return bridged(spheres, given, box=(box, box, box), skin=2.0 * RADIUS, check_steps=False)


def slow(*values: Any) -> Any:
    """Parameters of a test whose loops take long to compile."""
    return pytest.param(*values, marks=pytest.mark.slow)


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
            broke_at = float(bridges.gaps()[0][0])
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
    longest = capillary.rupture_length(0.0, ANGLE, LIQUID)
    gaps = [*np.linspace(3.0, 2.0001, 5) * FILM, *np.linspace(1.9999, -0.1, 20) * FILM]
    gaps += [*np.linspace(0.0, 0.9999 * longest, 40), *np.linspace(1.0001, 1.5, 5) * longest]
    joined = False
    for gap in gaps:
        run.particles.position[1, 0] = run.particles.position[0, 0] + 2.0 * RADIUS + gap
        run.refresh()
        joined = gap < longest if joined else gap < 2.0 * FILM
        expected = capillary.pendular_pull(TENSION, ANGLE, 0.5 * RADIUS, LIQUID, gap) if joined else 0.0
        assert run.edges.bridge_force[0, 0] == pytest.approx(expected, rel=1e-9, abs=1e-20)
        assert (run.particles.force.sum(axis=0) == 0.0).all()
        if gap > 0.0:
            assert run.particles.force[0, 0] == run.edges.bridge_force[0, 0]
    assert (bridges.formed, bridges.broken) == (1, 1)


@pytest.mark.parametrize(("film", "tangential"), [("deforming", "davis"), slow("static", "nase")])
def test_resistances_are_those_of_the_laws(film: str, tangential: str) -> None:
    """Rates of the velocities along and across over a time that is short for both; and the spin that goes with it."""
    run, _ = pair(0.0, FILM, viscosity=2.0, film=film, tangential=tangential, cut="constant", minimum_gap=1e-6)
    made, span, reduced = run.particles, 1e-12, 0.5 * RADIUS
    made.velocity[:] = [[0.2, 0.3, 0.0], [0.0, 0.0, 0.0]]
    run.advance(span)
    share = {"static": bridge.static_share, "deforming": bridge.deforming_share}[film](FILM, 2.0 * FILM)
    along = lubrication.film_strength(2.0, reduced) * share / FILM
    law = {"davis": bridge.davis_tangential, "nase": bridge.nase_tangential}[tangential]
    across = law(2.0, reduced, FILM, 2.0 * FILM)
    pull = capillary.pendular_pull(TENSION, ANGLE, reduced, LIQUID, FILM)
    force = (made.velocity[0] - [0.2, 0.3, 0.0]) / (span * made.inverse_mass[0])
    assert force == pytest.approx([pull - 0.2 * along, -0.3 * across, 0.0], rel=1e-5)
    torque = made.spin[0, 2] / (span * made.inverse_inertia[0])
    assert torque == pytest.approx(-0.3 * across * (RADIUS + 0.5 * FILM), rel=1e-5)


@pytest.mark.parametrize(("cut", "kept"), [slow("zero", 0.0), slow("constant", 1.0)])
def test_below_the_minimum_gap_a_film_is_cut(cut: str, kept: float) -> None:
    """To nothing, or to what it is at h_min."""
    run, _ = pair(0.0, 0.1 * FILM, viscosity=2.0, film="deforming", cut=cut, pull="none", minimum_gap=0.5 * FILM)
    run.particles.velocity[0] = [0.2, 0.0, 0.0]
    run.advance(1e-12)
    share = bridge.deforming_share(0.5 * FILM, 2.0 * FILM)
    expected = kept * 0.2 * lubrication.film_strength(2.0, 0.5 * RADIUS) * share / (0.5 * FILM)
    assert run.particles.velocity[1, 0] / (1e-12 * run.particles.inverse_mass[1]) == pytest.approx(expected, rel=1e-5)


def _gauss(gap: float, film: float, viscosity: float, reduced_radius: float) -> float:
    """A user's resistance, without a potential: that of a static bridge."""
    return 6.0 * math.pi * viscosity * reduced_radius**2 * (1.0 - gap / film) ** 2 / gap if gap < film else 0.0


@pytest.mark.parametrize(
    ("film", "potential"), [slow("deforming", "deforming"), slow("static", "static"), slow(_gauss, "static")]
)
@pytest.mark.parametrize("step", [1e-7, 1e-5, 1e-3])
def test_a_pair_alone_moves_along_its_exact_solution(film: Any, potential: str, step: float) -> None:
    """m* du = -A dL for any step: the speed at every gap is that of the closed form, to round-off."""
    run, _ = pair(0.3, 1.99 * FILM, viscosity=0.2, film=film, pull="none", minimum_gap=1e-7)
    made, law = run.particles, {"static": bridge.static_potential, "deforming": bridge.deforming_potential}[potential]
    strength = lubrication.film_strength(0.2, 0.5 * RADIUS) * 2.0 / made.mass[0]

    def constant() -> float:
        gap = float(made.position[1, 0] - made.position[0, 0] - 2.0 * RADIUS)
        return float(made.velocity[1, 0] - made.velocity[0, 0]) + strength * law(gap, 2.0 * FILM)

    kept = constant()
    for _ in range(20):
        run.advance(step)
        assert constant() == pytest.approx(kept, abs=1e-9 * 0.3 + strength * 1e-11)
    assert made.velocity[0, 0] >= -1e-15 * 0.3, "turned back by more than round-off of the first speed"


@serial
def _imbalance(speed, gap, film, step, inverse_mass):  # type: ignore[no-untyped-def]
    """What the speed after a step leaves of its equation, over the speeds in it."""
    state = BridgeState(gap, film, 0.0, 0.5 * RADIUS, 1e-7, 0.2, 0.0, 0.0, 0.0, ())
    after = speed_after_bridge(speed, state, gap, step, inverse_mass)
    given = inverse_mass * resistance_integral(state, gap, step * after, held_gap(state))
    return abs(after + given - speed) / (abs(speed) + abs(after))


@pytest.mark.slow
@pytest.mark.parametrize("cut", ["constant", "zero"])
def test_the_speed_after_a_step_solves_its_equation(cut: str) -> None:
    """For any gap, speed, step and mass, also if the pair leaves its films within the step."""
    run, _ = pair(0.3, film="deforming", pull="none", cut=cut, minimum_gap=1e-7, viscosity=0.2)
    imbalance, draw = specialise(_imbalance, run.choices), np.random.default_rng(1)
    worst = 0.0
    for gap, speed, step, mass in 10.0 ** draw.uniform([-7.5, -6.0, -8.0, -8.0], [-4.5, 0.0, -3.0, -5.0], (5000, 4)):
        for sign in (1.0, -1.0):
            found = imbalance(sign * speed, gap, 2.0 * FILM, step, 1.0 / mass)
            worst = max(worst, found)
    assert worst < 1e-9


def test_slow_wet_spheres_stay_together_and_fast_ones_part() -> None:
    """The limit is the work of the bridge: m* v^2/2 = W(rupture) - W(formation)."""
    ends = (capillary.rupture_length(0.0, ANGLE, LIQUID), 2.0 * FILM)
    work = [capillary.pendular_energy(TENSION, ANGLE, 0.5 * RADIUS, LIQUID, gap) for gap in ends]
    critical = math.sqrt(4.0 * (work[0] - work[1]) / (GRAIN.density * 4.0 / 3.0 * math.pi * RADIUS**3))
    for ratio, broken in ((0.95, 0), (1.05, 1)):
        run, bridges = pair(ratio * critical)
        run.advance(step := run.time_scales(critical).recommended, int(4e-2 / step))
        assert bridges.formed > 0
        assert (bridges.broken > 0) == (broken > 0)


def test_a_bridge_that_parts_fast_is_longer() -> None:
    _, bridges = pair(-1.0, FILM, viscosity=0.1)
    room = float(bridges.gaps()[1][0])
    stretched = capillary.rupture_length(0.1 * 1.0 / TENSION, ANGLE, LIQUID)
    assert room + FILM == pytest.approx(stretched, rel=1e-9)


def test_a_bridge_longer_than_the_reach_of_films_stays_in_the_list() -> None:
    """Over new lists, until it breaks at the rupture length."""
    run, bridges = pair(-0.5, FILM, viscosity=0.1)
    run.lists.skin = 1e-5
    longest = 0.0
    while not bridges.broken and run.steps < 4000:
        run.advance(2e-6)
        if bridges.count:
            longest = float(bridges.gaps()[0][0])
    assert bridges.broken == 1
    assert run.lists.made > 5
    assert longest > 4.0 * FILM


def test_liquid_is_kept_and_shared() -> None:
    """A bridge takes the same from equal films; when it breaks each sphere has its share again."""
    run, bridges = pair(0.0, FILM)
    total = bridges.liquid
    assert bridges.count == 1
    assert bridges.thickness == pytest.approx(np.full(2, FILM * (1.0 - capillary.liquid_share(1.0, 1.0))), rel=0.01)
    run.particles.position[1, 0] += RADIUS
    run.refresh()
    assert bridges.count == 0
    assert bridges.thickness == pytest.approx(np.full(2, FILM), rel=1e-12)
    assert bridges.liquid == pytest.approx(total, rel=1e-15)


@pytest.mark.slow
def test_no_more_liquid_is_drawn_than_there_is() -> None:
    """A large wet sphere among many small dry ones, which all draw at once."""
    draw = np.random.default_rng(2)
    directions = draw.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    places = np.vstack([np.zeros((1, 3)), directions * 1.151 * RADIUS])
    spheres = make_particles(places, np.append(RADIUS, np.full(400, 0.15 * RADIUS)), 2500.0)
    run, bridges = bridged(spheres, BridgeLaws(share=lambda radius: 0.1), np.append(FILM, np.zeros(400)))
    assert bridges.count > 10
    assert run.particles.liquid.min() >= 0.0
    assert run.particles.liquid[0] < 1e-15 * bridges.liquid


def test_agglomerates_are_what_bridges_join() -> None:
    places = np.array([[0, 0, 0], [1.02, 0, 0], [2.04, 0, 0], [5, 0, 0], [5, 1.02, 0], [9, 9, 9]]) * 2.0 * RADIUS
    _, bridges = bridged(make_particles(places, RADIUS, 2500.0), BridgeLaws(), skin=RADIUS)
    named = bridges.agglomerates
    assert sorted(np.bincount(named)) == [1, 2, 3]
    assert named[0] == named[1] == named[2]
    assert named[3] == named[4]


@pytest.mark.parametrize(
    ("given", "said"),
    [({"surface_tension": -1.0}, "surface_tension"), ({"viscosity": math.nan}, "viscosity"),
     ({"contact_angle": 4.0}, "contact_angle"), ({"transition_pressure": 0.0}, "transition_pressure"),
     ({"pull": "pendul"}, "pendular"), ({"pull": "none", "film": "pitois", "share": "none"}, "pitois"),
     ({"cut": "none"}, "zero"), ({"wall_share": 2.0}, "wall_share")],
)  # fmt: skip
def test_an_impossible_liquid_is_refused_by_name(given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        pair(0.0, **given)


def test_an_impossible_film_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="film of particle 0"):
        coat(make_particles([[0, 0, 0]], RADIUS, 2500.0), -1.0)


@pytest.mark.slow
@pytest.mark.parametrize("pull", ["pendular", "willett", "rabinovich", "lambert"])
@pytest.mark.parametrize("gap", [0.0, FILM])
def test_a_bridge_without_liquid_does_not_pull(pull: str, gap: float) -> None:
    """A share of a user's own may be 0."""
    run, bridges = pair(0.0, gap, pull=pull, share=lambda radius: 0.0, rupture="film", film="pitois", viscosity=0.1)
    assert bridges.count == 1
    assert (run.particles.force[:, 1:] == 0.0).all()
    assert run.edges.bridge_force[0] == pytest.approx(np.zeros(3), abs=0.0)
    assert getattr(capillary_pull, f"{pull}_energy")(TENSION, ANGLE, RADIUS, 0.0, gap) == 0.0


def test_a_run_after_another_has_its_bridges() -> None:
    """What a bridge remembers, its resistance below h_min for instance, is that of its laws."""
    run, bridges = pair(0.0, FILM)
    again = ParticleSolver(run.particles, run.table, laws=run.laws, settings=SolverSettings(after=run))
    assert again.bridges is not None and again.bridges.volume.tolist() == bridges.volume.tolist()
    with pytest.raises(InputError, match="same liquid bridges"):
        ParticleSolver(
            run.particles, run.table, laws=Laws(bridge=BridgeLaws(viscosity=3.0)), settings=SolverSettings(after=run)
        )


@pytest.mark.slow
def test_fixed_wet_spheres_stay_where_they_are() -> None:
    """Two of them side by side at a wall have no bridges; one pulls a free sphere."""
    places = np.array([[0, 0, 1.0], [1.02, 0, 1.0], [0, 5.0, 1.0], [5.0, 0, 5.0], [6.02, 0, 5.0]]) * 2.0 * RADIUS
    places[:3, 2] = RADIUS + 0.5 * FILM
    spheres = make_particles(places, RADIUS, GRAIN.density, fixed=[True, True, True, True, False])
    laws = BridgeLaws(viscosity=1.0, surface_tension=TENSION, film="deforming", tangential="davis", minimum_gap=1e-6)
    run, bridges = bridged(spheres, laws, walls=[Plane()], energies=True, check_steps=False)
    assert bridges.count == 1
    run.advance(1e-6, 200)
    assert np.array_equal(run.particles.position[:4], places[:4])
    for field in ("velocity", "spin"):
        assert (run.particles[field][:4] == 0.0).all()
        assert np.isfinite(run.particles[field]).all()
    assert run.particles.velocity[4, 0] < 0.0
    assert run.energies is not None and np.isfinite(run.energies.totals).all()
