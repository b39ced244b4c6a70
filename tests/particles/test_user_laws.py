"""Users' laws in the pair loop: the same motion as with built-in laws, checks, counts, and names in cases."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from example_case import TEXT

from cfddem.backend.errors import InputError, RunFailed
from cfddem.case.materials import Material
from cfddem.case.schema import Case
from cfddem.particles.initial.packing import random_packing
from cfddem.particles.interactions.contact_law import contact_named
from cfddem.particles.interactions.laws import Laws
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from cfddem.particles.walls.shapes import Plane
from cfddem.run.build import laws_of
from closures import check, registry
from closures.bridge import deforming_potential, deforming_share
from closures.minimum_gap import elastohydrodynamic
from closures.registry import REGISTRY, law
from scenarios.collisions.immersed_pair import MATERIALS, collide

GRAIN = Material(
    density=2540, youngs_modulus=60e9, contact_modulus=1e8, poisson=0.23, restitution=0.97, friction=0.4, roughness=1e-8
)
Shelve = Callable[..., Callable[..., float]]


@pytest.fixture
def register() -> Iterator[Shelve]:
    """Make a law of a function, for the length of a test."""
    made: list[tuple[str, str]] = []

    def of(kind: str, function: Callable[..., float], **ranges: tuple[float, float]) -> Callable[..., float]:
        made.append((kind, function.__name__))
        return law(kind, "a test", **ranges)(function)

    yield of
    for kind, name in made:
        REGISTRY[kind].pop(name, None)


def brenner(reduced_radius: float, gap: float, viscosity: float) -> float:
    return 6.0 * math.pi * viscosity * reduced_radius**2 / gap


def coated(gap: float, viscosity: float, reduced_radius: float) -> float:
    return 6.0 * math.pi * viscosity * reduced_radius**2 * deforming_share(gap, 1e-4) / gap


def thick(approach_speed: float, reduced_radius: float) -> float:
    return 1e-3 * reduced_radius * (1.0 + 10.0 * approach_speed)


def stirred(count: int, **laws: Any) -> ParticleSolver:
    """Spheres in a fluid, close together, with random velocities, above a wall; after 200 steps."""
    places, box = random_packing(np.full(count, 1.02e-3), 0.5, 1)
    velocity = np.random.default_rng(1).normal(0.0, 0.05, places.shape)
    run = ParticleSolver(
        make_particles(places + np.array([0.0, 0.0, 5e-4]), 0.5e-3, GRAIN.density, velocity=velocity, viscosity=1e-2),
        pair_table([GRAIN]),
        walls=[Plane()],
        laws=Laws(film=True, **laws),
        box=(box[0], box[1], None),
    )
    run.advance(1e-6, 200)
    return run


@pytest.mark.parametrize(
    ("count", "integrator"),
    [
        pytest.param(100, "drift", marks=pytest.mark.slow),
        pytest.param(100, "verlet", marks=pytest.mark.slow),
        pytest.param(1500, "drift", marks=pytest.mark.slow),
    ],
)
def test_a_users_law_gives_the_same_motion_as_the_same_built_in_law(
    register: Shelve, count: int, integrator: str
) -> None:
    """Velocities, springs, minimum gaps; on one thread and on all. The film's impulse is an integral, to 1e-11."""
    own = {"minimum_gap": elastohydrodynamic, "lubrication": register("lubrication", brenner)}
    built_in = stirred(count, integrator=integrator)
    for kind, function in own.items():
        run = stirred(count, integrator=integrator, **{kind: function})
        for name in ("velocity", "spin", "position"):
            expected = getattr(built_in.particles, name)
            assert np.abs(getattr(run.particles, name) - expected).max() < 1e-11 * np.abs(expected).max(), (kind, name)
        assert np.allclose(run.edges.minimum_gap, built_in.edges.minimum_gap, rtol=1e-12, atol=0.0)
    assert (built_in.edges.force != 0.0).any()
    assert built_in.edges.minimum_gap.max() > 1.1e-8  # some films are elastohydrodynamic


@pytest.mark.slow
def test_a_film_of_finite_extent_takes_the_impulse_of_its_potential(register: Shelve) -> None:
    """Head-on, in the lubricated drift: u = v0 + B L between where the film of 100 um begins and h_min."""
    glass = MATERIALS["glass"]
    given = {"velocity": 0.1, "viscosity": 0.01}
    run = collide(glass, lubrication=register("lubrication", coated), **given)  # type: ignore[arg-type]
    radius = 0.5 * 6.35e-3
    film_speed = 6.0 * math.pi * 0.01 * radius**2 / (0.5 * glass.density * math.pi / 6.0 * 12.7e-3**3)
    lost = -film_speed * (deforming_potential(run.minimum_gap, 1e-4) - 0.5) / 0.1
    assert run.restitution == pytest.approx(0.97 - 1.97 * lost, abs=2e-3)
    gapped = collide(glass, lubrication=coated, minimum_gap=register("minimum_gap", thick), **given)  # type: ignore[arg-type]
    assert gapped.minimum_gap == pytest.approx(1e-3 * radius * 2.0, rel=1e-3)
    assert run.restitution > collide(glass, **given).restitution + 0.05  # type: ignore[arg-type]


@pytest.mark.slow
def test_the_minimum_gap_is_what_the_law_says(register: Shelve) -> None:
    """Of the largest approach speed."""
    own = register("minimum_gap", thick)
    run = collide(MATERIALS["steel_smooth"], velocity=0.05, stokes=40, minimum_gap=own)
    assert run.mechanism == "thick"
    assert run.minimum_gap == pytest.approx(1e-3 * 3.175e-3 * 1.5, rel=1e-3)


@pytest.mark.slow
def test_the_minimum_gap_is_at_least_that_of_asperities_and_at_most_a_fiftieth_of_the_radius(register: Shelve) -> None:
    """Whatever the law says."""

    def none_at_all(approach_speed: float) -> float:
        return 0.0 * approach_speed

    def huge(reduced_radius: float) -> float:
        return reduced_radius

    rough = collide(MATERIALS["delrin"], velocity=0.05, stokes=40, minimum_gap=register("minimum_gap", none_at_all))
    assert (rough.minimum_gap, rough.mechanism) == (796e-9, "roughness")
    most = collide(MATERIALS["delrin"], velocity=0.05, stokes=400, minimum_gap=register("minimum_gap", huge))
    assert most.minimum_gap == pytest.approx(0.02 * 3.175e-3)


@pytest.mark.slow
def test_uses_outside_of_the_range_are_counted(register: Shelve) -> None:
    """None inside, one a pair and step for a film; counts survive new lists and checkpoints."""
    inside = stirred(100, lubrication=register("lubrication", brenner, viscosity=(1e-3, 1e-1), gap=(1e-9, 1.0)))
    assert inside.gap.min() < 1e-9  # below the minimum gap the law is evaluated at the minimum gap
    assert inside.outside == 0

    def thin(gap: float, viscosity: float, reduced_radius: float) -> float:
        return 6.0 * math.pi * viscosity * reduced_radius**2 / gap

    run = stirred(100, lubrication=register("lubrication", thin, viscosity=(1e-6, 1e-3)))
    counted = run.outside
    assert counted > 200 * 100
    run._relist()
    assert run.outside == counted
    run.advance(1e-6)
    assert run.outside > counted
    again = stirred(100, lubrication=thin)
    again.restore(run.checkpoint())
    assert again.outside == run.outside


def test_the_check_knows_films() -> None:
    from test_drag_laws import check_new

    assert check(elastohydrodynamic) == []
    assert (
        check_new("lubrication", lambda gap, viscosity, reduced_radius: 18.8 * viscosity * reduced_radius**2 / gap)
        == []
    )
    wrong: list[tuple[Callable[..., float], str]] = [
        (lambda gap, viscosity, reduced_radius: viscosity * reduced_radius * (1.0 + gap), "increases with gap"),
        (lambda gap, viscosity, reduced_radius: 1.0 / (gap * viscosity * reduced_radius), "decreases with viscosity"),
        (lambda gap, viscosity, reduced_radius: -viscosity * reduced_radius / gap, "outside"),
        (lambda gap, viscosity, reduced_radius: 75.4 * viscosity * reduced_radius**2 / gap, "is 4 times Brenner's"),
    ]
    for function, complaint in wrong:
        found = check_new("lubrication", function)
        assert any(complaint in line for line in found), (complaint, found)


def test_laws_that_the_loop_cannot_call_are_refused_by_name(register: Shelve) -> None:
    def speedy(gap: float, viscosity: float, reduced_radius: float, temperature: float) -> float:
        return gap * viscosity * reduced_radius * temperature

    def worded(approach_speed: float) -> float:
        return float(str(approach_speed))

    refused: list[tuple[dict[str, Any], str]] = [
        ({"lubrication": register("lubrication", speedy)}, "lubrication = 'speedy'.*gap, viscosity, reduced_radius"),
        ({"lubrication": elastohydrodynamic}, "lubrication = 'elastohydrodynamic'"),
        ({"minimum_gap": lambda approach_speed: 1e-6}, "minimum_gap.*decorate it"),
        ({"minimum_gap": register("minimum_gap", worded)}, "minimum_gap = 'worded'.*compiled"),
    ]
    for given, said in refused:
        with pytest.raises(InputError, match=said):
            stirred(100, **given)
    with pytest.raises(InputError, match=r"minimum_gap.*no films"):
        Laws(minimum_gap=elastohydrodynamic).check()


@pytest.mark.slow
def test_a_law_that_gives_nan_stops_the_run(register: Shelve) -> None:
    def lost(approach_speed: float) -> float:
        return math.sqrt(-approach_speed)

    with pytest.raises(RunFailed, match=r"particle .* is NaN"):
        stirred(1500, minimum_gap=register("minimum_gap", lost))


def test_a_case_names_laws_of_the_shelf_and_of_packages(monkeypatch: pytest.MonkeyPatch, register: Shelve) -> None:
    """A name in a file, a function in Python; a function goes into the case's text as its name."""
    points = [SimpleNamespace(name="own", load=lambda: register("lubrication", coated))]
    monkeypatch.setattr(registry, "entry_points", lambda group: points if group == "cfddem.closures" else [])
    registry.load_package_laws.cache_clear()
    try:
        case = Case.from_text(TEXT, "bed.toml", {"laws.lubrication": "coated"})
        hertz = contact_named("hertz")
        assert laws_of(case) == Laws(film=True, contact=hertz, lubrication=coated)
        from_python = case.with_(**{"laws.minimum_gap": register("minimum_gap", thick)})
        assert laws_of(from_python).minimum_gap is thick
        assert 'minimum_gap = "thick"' in from_python.to_toml()
        assert laws_of(Case.from_text(TEXT)) == Laws(film=True, contact=hertz)
        dry = case.with_(fluid=None)
        assert laws_of(dry) == Laws(contact=hertz)
    finally:
        registry.load_package_laws.cache_clear()
    for key, value, said in [
        ("laws.lubrication", "nijsen", "laws.lubrication = 'nijsen'"),
        ("laws.lubrication", "film_strength", "must take gap"),
        ("laws.minimum_gap", "glass_transition", "laws.minimum_gap = 'glass_transition'.*it may take roughness"),
    ]:
        with pytest.raises(InputError, match=said):
            Case.from_text(TEXT, "bed.toml", {key: value})
