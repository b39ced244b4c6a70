"""A sphere on a wet wall: the motion against an independent solution, energy, limits, and what is refused."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from command_line import parsed

from cfddem.backend.errors import InputError
from cfddem.case.materials import Material
from closures import capillary, layer
from scenarios.collisions.wet_wall import impact, sticking_velocity
from scenarios.collisions.wet_wall.materials import Ball, Liquid
from scenarios.references.wet_wall.checks import LIQUIDS, SPHERES, independent

exact = partial(impact, solver="equations")

CASES = [  # sphere, liquid, film, half-filling angle, speed, angle, spin, friction
    ("glass_1.74", "water", 100e-6, 35.0, 0.4, 0.0, 0.0, 0.0),
    ("glass_1.74", "water", 200e-6, 45.0, 0.5, 0.0, 0.0, 0.0),
    ("glass_1.74", "water", 200e-6, 45.0, 2.0, 0.0, 0.0, 0.0),
    ("glass_0.91", "water", 100e-6, 45.0, 0.65, 0.0, 0.0, 0.0),
    ("glass_1.74", "tween", 100e-6, 35.0, 1.0, 0.0, 0.0, 0.0),
    ("alumina_1.74", "glycerol_51", 200e-6, 43.0, 2.0, 0.0, 0.0, 0.0),
    ("alumina_1.74", "tween", 100e-6, 35.0, 1.0, 15.0, 0.0, 0.16),
    ("alumina_1.74", "tween", 100e-6, 35.0, 1.0, 40.0, -960.0, 0.16),
    ("alumina_1.74", "tween", 100e-6, 35.0, 1.0, 80.0, 200.0, 0.16),
    ("alumina_1.74", "glycerol_35", 100e-6, 34.0, 1.0, 30.0, -500.0, 0.14),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]}-{case[1]}-{case[4]}-{case[5]}")
def test_an_impact_agrees_with_an_independent_solution(case: tuple[Any, ...]) -> None:
    """Limit 0.005 in both restitutions; both solutions are converged, so they agree far better."""
    sphere, liquid, film, filled, speed, angle, spin, friction = case
    ours = exact(sphere, liquid, film, speed, angle=angle, spin=spin, friction=friction)
    assert ours.half_filling_angle == filled
    e, e_t, omega = independent(*case)
    assert ours.restitution == pytest.approx(e, abs=2e-6)
    if angle:
        assert ours.restitution_tangential == pytest.approx(e_t, abs=2e-5)
        assert ours.spin == pytest.approx(omega, rel=1e-5, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("case", [CASES[0], CASES[5], CASES[7]], ids=lambda case: f"{case[0]}-{case[1]}")
def test_the_particle_engine_agrees_with_the_equations(case: tuple[Any, ...]) -> None:
    """A bridge of the engine between a particle and a wall: times 0.5 %, restitutions 0.005, spin 1 %."""
    sphere, liquid, film, _, speed, angle, spin, friction = case
    given: dict[str, Any] = {"angle": angle, "spin": spin, "friction": friction}
    engine = impact(sphere, liquid, film, speed, **given)
    equations = exact(sphere, liquid, film, speed, **given, spring="cut")
    assert engine.duration == pytest.approx(equations.duration, rel=5e-3)
    assert engine.restitution == pytest.approx(equations.restitution, abs=5e-3)
    assert engine.energy_lost == pytest.approx(equations.energy_lost, abs=0.01 * sum(equations.energy_lost.values()))
    if angle:
        assert engine.restitution_tangential == pytest.approx(equations.restitution_tangential, abs=5e-3)
        assert engine.spin == pytest.approx(equations.spin, rel=0.01)


@pytest.mark.slow
def test_spheres_stick_in_the_particle_engine() -> None:
    """Buck et al.: 0.345 m/s; within 2 %."""
    found = sticking_velocity("glass_1.74", "water", 100e-6, precision=4e-3)
    assert found == pytest.approx(0.345, rel=0.02)


def test_the_particle_engine_refuses_readings_that_it_does_not_have() -> None:
    with pytest.raises(InputError, match="spring"):
        impact("alumina_1.74", None, angle=30, spring="kept")
    with pytest.raises(InputError, match="capillary_phases"):
        impact(capillary_phases="bridge")
    with pytest.raises(InputError, match="solver"):
        impact(solver="engine")


@pytest.mark.parametrize(
    ("sphere", "liquid", "film", "published"),
    [
        ("glass_1.74", "water", 100e-6, 0.345),
        ("glass_1.74", "water", 200e-6, 0.456),
        ("glass_0.91", "water", 100e-6, 0.587),
        ("alumina_1.74", "tween", 100e-6, 0.549),
    ],
)
def test_spheres_stick_below_a_velocity(sphere: str, liquid: str, film: float, published: float) -> None:
    """Within 2 % of an earlier solution of the same equations."""
    assert sticking_velocity(sphere, liquid, film, precision=1e-3, solver="equations") == pytest.approx(
        published, rel=0.02
    )


@pytest.mark.parametrize("angle", [52.0, 60.0, 75.0, 85.0])
@pytest.mark.parametrize("spin", [0.0, 200.0])
def test_a_dry_sphere_that_slides_throughout_follows_coulomb(angle: float, spin: float) -> None:
    """e_t = 1 - mu (1 + e)/tan(angle), spin changes by -2.5 mu (1 + e) v/R, for steep angles; to 1e-3."""
    mu, e, radius = 0.195, 0.76, 0.87e-3
    dry = exact("alumina_1.74", None, angle=angle, spin=spin)
    assert dry.restitution == pytest.approx(e, abs=1e-4)
    assert dry.restitution_tangential == pytest.approx(1.0 - mu * (1.0 + e) / math.tan(math.radians(angle)), abs=1e-3)
    assert dry.spin - spin == pytest.approx(-2.5 * mu * (1.0 + e) / radius, rel=1e-3)


@pytest.mark.parametrize("speed", [0.05, 0.5, 5.0])
def test_a_dry_head_on_impact_has_the_restitution_of_its_solids(speed: float) -> None:
    assert exact("glass_1.74", None, velocity=speed, gravity=0.0).restitution == pytest.approx(0.96, abs=1e-5)


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]}-{case[1]}-{case[4]}-{case[5]}")
def test_the_channels_take_all_the_energy_that_is_lost(case: tuple[Any, ...]) -> None:
    """Kinetic energy of the three motions before, less after, over the mass; by the path of each force."""
    sphere, liquid, film, _, speed, angle, spin, friction = case
    result = exact(sphere, liquid, film, speed, angle=angle, spin=spin, friction=friction)
    speeds = np.array([result.history[name][[0, -1]] for name in ("speed", "speed_along")])
    turning = 0.4 * (SPHERES[sphere][0] * result.history["spin"][[0, -1]]) ** 2
    before, after = 0.5 * ((speeds**2).sum(axis=0) + turning)
    assert sum(result.energy_lost.values()) == pytest.approx(before - after, rel=1e-7)
    assert result.energy_lost["viscous"] > 0.0
    assert result.energy_lost["contact"] > 0.0


def test_normal_and_tangential_motion_are_superposed() -> None:
    head_on = exact("alumina_1.74", "tween", 100e-6)
    for angle, spin in ((20.0, 0.0), (70.0, -960.0)):
        oblique = exact("alumina_1.74", "tween", 100e-6, angle=angle, spin=spin)
        assert oblique.restitution == pytest.approx(head_on.restitution, abs=1e-6)


def test_thicker_films_more_viscous_liquids_and_slower_impacts_rebound_less() -> None:
    e = [exact("glass_1.74", "water", film, half_filling_angle=45).restitution for film in (50e-6, 100e-6, 200e-6)]
    assert e == sorted(e, reverse=True)
    e = [exact("glass_1.74", liquid, 200e-6, half_filling_angle=45).restitution for liquid in list(LIQUIDS)[::2]]
    assert e == sorted(e, reverse=True)
    e = [exact(velocity=speed).restitution for speed in (0.4, 0.6, 1.0, 2.0)]
    assert e == sorted(e)
    assert e[-1] < 0.96


def test_the_result_does_not_hang_on_the_tolerance() -> None:
    loose, tight = exact(tolerance=1e-7), exact(tolerance=1e-12)
    assert loose.restitution == pytest.approx(tight.restitution, abs=1e-5)


@pytest.mark.parametrize(
    "reading",
    [{"capillary_phases": "rebound"}, {"capillary_phases": "bridge"}, {"length_from": "wall"}, {"smallest_gap": 5e-6}],
)
def test_other_readings_are_options(reading: dict[str, Any]) -> None:
    assert 1e-4 < abs(exact(**reading).restitution - exact().restitution) < 0.1


def test_the_printed_signs_of_the_film_hardly_matter() -> None:
    case: dict[str, Any] = {"particle": "alumina_1.74", "liquid": "tween", "angle": 45.0}
    ours, printed = exact(**case), exact(film_signs="printed", **case)
    assert 0.0 < abs(ours.restitution_tangential - printed.restitution_tangential) < 1e-3
    assert 0.0 < abs(ours.spin / printed.spin - 1.0) < 0.01


@pytest.mark.parametrize(("angle", "engine"), [(10.0, 0.8133), (20.0, 0.7085), (30.0, 0.6633), (40.0, 0.6546)])
def test_a_spring_that_is_cut_acts_as_in_the_particle_engine(angle: float, engine: float) -> None:
    """The engine's restitution of the same dry impact, at 0.2 % of the Hertz time."""
    cut = exact("alumina_1.74", None, angle=angle, spring="cut", tolerance=1e-8)
    assert cut.restitution_tangential == pytest.approx(engine, abs=0.012)
    assert cut.restitution == pytest.approx(0.76, abs=1e-4)


def test_cutting_the_spring_matters_only_where_a_contact_slides_for_a_part() -> None:
    differences = {}
    for angle in (3.0, 30.0, 60.0):
        kept, cut = (exact("alumina_1.74", None, angle=angle, spring=s, tolerance=1e-8) for s in ("kept", "cut"))
        differences[angle] = abs(kept.restitution_tangential - cut.restitution_tangential)
    assert differences[3.0] < 5e-3
    assert differences[30.0] > 0.2
    assert differences[60.0] < 5e-3  # a contact that is cut has no friction in the weak pull at its end


def test_a_thick_liquid_holds_a_sphere() -> None:
    """A stiff film of 10 Pa s: the sphere stops, and the result comes soon."""
    syrup = Liquid(density=1200, viscosity=10.0, surface_tension=0.06)
    steel = Material(density=7800, youngs_modulus=200e9, poisson=0.3, restitution=0.95)
    held = exact(Ball(material=steel, diameter=2e-3), syrup, 100e-6, 0.2, half_filling_angle=40)
    assert (held.outcome, held.restitution) == ("stick", 0.0)


@pytest.mark.parametrize(("sphere", "film"), [("glass_1.74", 400e-6), ("glass_0.91", 200e-6), ("alumina_1.74", 400e-6)])
def test_a_toroid_that_is_singular_is_refused_by_name(sphere: str, film: float) -> None:
    with pytest.raises(InputError, match=r"half_filling_angle = .*contact line"):
        exact(sphere, "water", film)
    assert exact(sphere, "water", film, 3.0, smallest_arc=5e-6).outcome == "rebound"
    assert exact(sphere, "water", film, 3.0, capillary_phases="bridge").outcome == "rebound"


@pytest.mark.slow
def test_a_toroid_that_is_nearly_singular_is_said_to_be() -> None:
    """Alumina under 100 um of water, 28 degrees: an arc of 1 um at contact; the others have 22 um and more."""
    case = ("alumina_1.74", "water", 100e-6)
    assert "smallest_arc" in exact(*case).warnings[0]
    assert exact(*case, smallest_arc=10e-6).warnings == exact(*case, capillary_phases="bridge").warnings == ()
    for sphere, liquid, film in (("glass_1.74", "water", 200e-6), ("alumina_1.74", "glycerol_51", 200e-6)):
        assert exact(sphere, liquid, film).warnings == ()
    assert sticking_velocity(*case, precision=1e-3, smallest_arc=5e-6) == pytest.approx(0.652, rel=0.02)


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"particle": "wood"}, "particle"),
        ({"liquid": "watr"}, "did you mean 'water'"),
        ({"film": -1e-6}, "film"),
        ({"velocity": 0.0}, "velocity"),
        ({"velocity": math.nan}, "velocity"),
        ({"angle": 90.0}, "angle"),
        ({"spin": math.inf}, "spin"),
        ({"angle": 30.0}, "friction"),
        ({"film": 150e-6}, "half_filling_angle.*100 um, 200 um"),
        ({"half_filling_angle": 91.0}, "half_filling_angle"),
        ({"capillary_phases": "never"}, "capillary_phases"),
        ({"spring": "cutt"}, "spring"),
        ({"smallest_gap": 0.0}, "smallest_gap"),
        ({"tolerance": 1.0}, "tolerance"),
        ({"velocity": 1e300}, "at most 1000 m/s"),
        ({"spin": -1e300, "friction": 0.1}, "spin"),
        ({"gravity": 1e300}, "gravity"),
    ],
    ids=lambda value: str(value),
)
def test_an_impossible_impact_is_refused_by_name(given: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError, match=field):
        exact(**given)


def test_a_pendular_bridge_does_the_work_of_its_pull() -> None:
    """Integral of the pull over the gap, by Simpson's rule."""
    sigma, theta, radius, volume = 0.07, 0.3, 0.4e-3, 2e-12
    gap = np.linspace(0.0, 3e-4, 20001)
    force = np.array([capillary.pendular_pull(sigma, theta, radius, volume, float(h)) for h in gap])
    weights = np.ones_like(gap)
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    work = float((weights * force).sum() * (gap[1] - gap[0]) / 3.0)
    assert capillary.pendular_energy(sigma, theta, radius, volume, 3e-4) == pytest.approx(work, rel=1e-9)


def test_sliding_and_spin_in_the_film_are_reciprocal() -> None:
    """6 pi (force of spin) = 8 pi (torque of sliding), as the reciprocal theorem asks; the fits hold it to 1e-3."""
    for ratio in (1e-5, 1e-3, 1e-1):
        assert 6.0 * layer.spin_force(ratio) == pytest.approx(8.0 * layer.sliding_torque(ratio), abs=1e-3)


@pytest.mark.parametrize("solver", ["equations", pytest.param("particles", marks=pytest.mark.slow)])
def test_the_command_prints_the_result_and_refuses_by_name(solver: str, capsys: pytest.CaptureFixture[str]) -> None:
    from cfddem.cli.app import app

    def say(*words: str) -> str:
        app(["wet-wall", *words, "--solver", solver], result_action="return_value")
        return str(capsys.readouterr().out)

    printed = parsed(say("--film", "2e-4", "--velocity", "0.6", "--json"))
    found = impact(film=200e-6, velocity=0.6, solver=solver)
    assert printed["restitution"] == pytest.approx(found.restitution, abs=1e-9)
    assert printed["restitution_tangential"] is None
    assert "contact_lost" in say()
    with pytest.raises(InputError, match="half_filling_angle"):
        say("--film", "4e-4")
