"""Two spheres, or a sphere and a wall, in a fluid: `scenarios.collisions.immersed_pair.study.collide`.

References: converged solutions in `scenarios/data/binary_collision_*.csv`, and closed forms of the equations
of Nijssen, Ottens & Padding, Powder Technol. 413 (2023) 118017.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import call, parsed
from impacts import Pair

from cfddem.backend.errors import InputError, UnstableStep
from cfddem.case.materials import Material
from cfddem.particles.interactions.laws import Laws
from closures import restitution, timescales
from scenarios.collisions.bouncing_sphere.study import bounce
from scenarios.collisions.immersed_pair import MATERIALS, Collision, collide
from scenarios.validation.table import numbers, reference

DELRIN, GLASS, STEEL = MATERIALS["delrin"], MATERIALS["glass"], MATERIALS["steel_smooth"]
CUTOFF = 12.7e-3 / 4
WATER, GLYCEROL_80 = 1.0e-3, 60.1e-3


def table(name: str) -> list[dict[str, float]]:
    """Rows of a table of converged solutions."""
    columns = numbers(f"binary_collision_{name}")
    return [dict(zip(columns, map(float, line))) for line in zip(*columns.values())]


def test_a_collision_prints_in_a_few_lines_and_a_name_is_no_material() -> None:
    assert len(repr(collide(MATERIALS["delrin"], velocity=0.1, stokes=30))) < 400
    with pytest.raises(InputError, match=r"material = 'delrin': must be a Material, such as MATERIALS\['glass'\]"):
        collide("delrin", velocity=0.1, stokes=30)  # type: ignore[arg-type]


def test_materials_are_those_of_yang_and_hunt() -> None:
    columns = reference("immersed_materials_yang_hunt")
    names = {"steel ball bearing": "steel_smooth", "steel bead": "steel_rough", "glass sphere": "glass"}
    for line in zip(*columns.values()):
        name, _, *values = line
        density, modulus, poisson, dry, roughness, friction, lubricated = map(float, values)
        expected = Material(
            density=density,
            youngs_modulus=modulus * 1e9,
            poisson=poisson,
            restitution=dry,
            roughness=roughness * 1e-9,
            friction=friction,
            friction_lubricated=lubricated,
        )
        material = MATERIALS[names.get(name, "delrin")]
        assert material.model_dump(exclude_none=True) == pytest.approx(expected.model_dump(exclude_none=True))


@pytest.mark.parametrize("row", table("head_on"), ids=lambda row: f"St {row['St']:.0f}")
@pytest.mark.parametrize("name", ["delrin", "glass"])
def test_head_on_restitution_is_the_converged_one(row: dict[str, float], name: str) -> None:
    result = collide(MATERIALS[name], velocity=0.1, stokes=row["St"])
    assert result.restitution == pytest.approx(row[f"e_{name}"], abs=1e-3)
    assert result.stokes == row["St"]
    assert math.isnan(result.restitution_tangential)
    assert result.rebound_angle_striker == result.rebound_angle_relative == 0.0


@pytest.mark.parametrize("row", table("oblique_frozen"), ids=lambda row: f"{row['angle']:.0f} deg")
def test_oblique_rebound_with_a_frozen_line_of_centres(row: dict[str, float]) -> None:
    result = collide(DELRIN, viscosity=WATER, stokes=100.0, angle=row["angle"])
    assert result.restitution == pytest.approx(0.8016, abs=1e-3)
    assert result.restitution_tangential == pytest.approx(row["e_t"], abs=5e-3)
    assert result.rebound_angle_striker == pytest.approx(row["angle_striker"], abs=0.3)
    assert result.rebound_angle_relative == pytest.approx(row["angle_relative"], abs=0.3)


@pytest.mark.slow  # a law set of its own; as plain tests: a frozen line of centres, and momentum with this friction
@pytest.mark.parametrize("row", table("oblique_full"), ids=lambda row: f"{row['angle']:.0f} deg")
def test_oblique_rebound_on_the_full_path_with_friction_at_overlap(row: dict[str, float]) -> None:
    result = collide(
        DELRIN,
        viscosity=WATER,
        stokes=100.0 * math.cos(math.radians(row["angle"])),
        angle=row["angle"],
        trajectory="full",
        friction_onset="overlap",
    )
    assert result.restitution == pytest.approx(row["e_n"], abs=5e-3)
    assert result.restitution_tangential == pytest.approx(row["e_t"], abs=5e-3)
    assert result.rebound_angle_striker == pytest.approx(row["angle_striker"], abs=0.3)


@pytest.mark.parametrize("stokes", [1.0, 2.0, 5.0, 8.2])
@pytest.mark.parametrize("trajectory", ["frozen", "full"])
def test_a_slow_pair_halts_in_the_film_where_the_logarithm_says(stokes: float, trajectory: str) -> None:
    """Below St = ln(h_co/h_min) the spheres halt at h_co exp(-St) (eqs. 1 and 2, exact)."""
    result = collide(DELRIN, velocity=0.1, stokes=stokes, trajectory=trajectory)
    assert result.outcome == "no_touch"
    assert result.stop_gap == pytest.approx(restitution.stop_gap(stokes, CUTOFF), rel=1e-3)
    assert result.restitution == pytest.approx(0.0, abs=1e-4)
    assert result.gap.min() > DELRIN.roughness


def test_in_the_film_the_speed_is_linear_in_the_logarithm_of_the_gap() -> None:
    """u = -v0 + B ln(h_co/h) inbound, with B = v0/St."""
    result = collide(GLASS, velocity=0.1, stokes=30.0, trajectory="full")
    inbound = np.arange(len(result.gap)) < result.gap.argmin()
    inbound &= (result.gap > GLASS.roughness) & (result.gap < 0.999 * CUTOFF)
    line = -0.1 + 0.1 / 30.0 * np.log(CUTOFF / result.gap[inbound])
    assert inbound.sum() > 50
    np.testing.assert_allclose(result.history["normal_speed"][inbound], line, atol=1e-3 * 0.1)


@pytest.mark.parametrize(
    ("stokes", "outcome", "stop"),
    [
        (8.29, "no_touch", 1.0 * 796e-9),
        (8.40, "touch_no_rebound", 1.0 * 796e-9),
        (9.0, "touch_no_rebound", 1.0 * 796e-9),
        (10.0, "touch_no_rebound", 2.0 * 796e-9),
        (15.0, "touch_no_rebound", 0.064 * CUTOFF),
        (17.0, "touch_no_rebound", 0.447 * CUTOFF),
        (17.80, "touch_no_rebound", None),
        (17.86, "rebound", None),
        (50.0, "rebound", None),
    ],
)
def test_outcomes_of_delrin(stokes: float, outcome: str, stop: float | None) -> None:
    """Halt before touch; touch and creep back to h_min; touch, bounce, halt in the film; leave the film."""
    result = collide(DELRIN, velocity=0.1, stokes=stokes)
    assert result.outcome == outcome
    assert (result.stop_gap is None) == (outcome == "rebound")
    assert (result.restitution > 0.0) == (outcome == "rebound")
    if stop is not None:
        assert result.stop_gap == pytest.approx(stop, rel=0.012)


@pytest.mark.parametrize("name", MATERIALS)
@pytest.mark.parametrize("stokes", [30.0, 100.0, 1000.0])
def test_deep_contacts_follow_the_closed_form_with_its_half(name: str, stokes: float) -> None:
    result = collide(MATERIALS[name], velocity=0.3, stokes=stokes)
    exact = restitution.immersed(stokes, 0.97, CUTOFF, film_gap(MATERIALS[name], 0.3, stokes))
    assert result.restitution == pytest.approx(exact, abs=1e-3)


def film_gap(material: Material, speed: float, stokes: float) -> float:
    """h_min of two spheres of 12.7 mm."""
    mass = material.density * math.pi / 12.0 * 12.7e-3**3
    viscosity = mass * speed / (6.0 * math.pi * CUTOFF**2 * stokes)
    modulus = material.youngs_modulus / (2.0 * (1.0 - material.poisson**2))
    return max(material.roughness, 0.37 * (viscosity * speed / modulus) ** 0.4 * CUTOFF**0.6)


@pytest.mark.parametrize("stokes", [30.0, 60.0, 300.0])
def test_a_wall_takes_exactly_the_logarithm_of_two_more(stokes: float) -> None:
    """With h_co = R* a pair and a wall differ by (1 + e_dry) ln 2 / St where asperities set h_min."""
    pair, wall = (collide(DELRIN, velocity=0.1, stokes=stokes, against=body) for body in ("sphere", "wall"))
    assert pair.restitution - wall.restitution == pytest.approx(1.97 * math.log(2.0) / stokes, abs=1e-3)
    assert wall.spin[1] == 0.0


@pytest.mark.parametrize(
    ("material", "viscosity", "stokes", "mechanism", "friction"),
    [
        (STEEL, GLYCEROL_80, 20.0, "elastohydrodynamic", 0.02),
        (DELRIN, WATER, 100.0, "roughness", 0.20),
        (STEEL, WATER, 1000.0, "roughness", 0.11),
    ],
    ids=["steel in 80 % glycerol", "Delrin in water", "steel in water"],
)
def test_friction_is_lubricated_where_the_film_holds_the_solids_apart(
    material: Material, viscosity: float, stokes: float, mechanism: str, friction: float
) -> None:
    """The three classes of figure 5; steel in glycerol meets on a film of 47 nm."""
    result = collide(material, viscosity=viscosity, stokes=stokes, angle=30.0)
    assert (result.mechanism, result.friction_used) == (mechanism, friction)
    if mechanism == "elastohydrodynamic":
        assert result.minimum_gap == pytest.approx(47e-9, rel=0.01)
        assert result.restitution == 0.0
        assert result.rebound_angle_relative == pytest.approx(90.0)


def test_a_rebound_keeps_the_film_that_turned_it_back() -> None:
    result = collide(STEEL, velocity=0.3, stokes=30.0)
    assert result.outcome == "rebound"
    assert result.minimum_gap == pytest.approx(film_gap(STEEL, 0.3, 30.0), rel=1e-6)
    assert (result.mechanism, result.friction_used) == ("elastohydrodynamic", 0.02)


def test_unlike_bodies_take_the_mean_roughness_and_share_momentum() -> None:
    result = collide((GLASS, STEEL), diameter=(6e-3, 10e-3), viscosity=0.001, velocity=0.35, trajectory="full")
    masses = np.array([2540 * 6e-3**3, 7780 * 10e-3**3]) * math.pi / 6
    first, last = result.history["velocity"][0], result.history["velocity"][-1]
    assert result.minimum_gap == pytest.approx(79e-9)
    assert result.outcome == "rebound"
    np.testing.assert_allclose(masses @ last, masses @ first, rtol=0, atol=1e-12 * masses[0] * 0.35)
    reduced = masses[0] * masses[1] / masses.sum()
    radius = 3e-3 * 5e-3 / 8e-3
    assert result.stokes == pytest.approx(reduced * 0.35 / (6 * math.pi * 0.001 * radius**2), rel=1e-12)
    assert result.restitution == pytest.approx(restitution.immersed(result.stokes, 0.97, radius, 79e-9), abs=1e-3)


@pytest.mark.parametrize(
    ("material", "stokes"),
    [
        (DELRIN, 20.0),
        (DELRIN, 100.0),
        *(pytest.param(*each, marks=pytest.mark.slow) for each in ((MATERIALS["steel_rough"], 30.0), (GLASS, 200.0))),
    ],
)
def test_plain_verlet_is_within_its_limit_where_it_resolves_the_film(material: Material, stokes: float) -> None:
    exact = collide(material, velocity=0.02, stokes=stokes, step_fraction=5e-4)
    plain = collide(material, velocity=0.02, stokes=stokes, integrator="verlet")
    assert plain.warnings == ()
    assert plain.restitution == pytest.approx(exact.restitution, abs=0.012)


def test_plain_verlet_warns_or_refuses_where_it_does_not() -> None:
    with pytest.warns(UserWarning, match="poorly resolved"):
        deep = collide(STEEL, velocity=0.3, stokes=30.0, integrator="verlet")
    assert "drift" in deep.warnings[0]
    small = GLASS.model_copy(update={"roughness": 20e-9})
    with pytest.raises(UnstableStep, match="film"):
        collide(small, diameter=100e-6, viscosity=1.0, velocity=0.1, integrator="verlet")


@pytest.mark.parametrize("seed", range(6))
def test_a_step_of_two_percent_is_converged_with_the_lubricated_drift(seed: int) -> None:
    """Points drawn over 0.2 to 13 mm and 50 MPa to 190 GPa, either mechanism."""
    random = np.random.default_rng(seed)
    diameter = 10.0 ** random.uniform(math.log10(2e-4), math.log10(13e-3))
    material = Material(
        density=random.uniform(1100, 8000),
        youngs_modulus=10.0 ** random.uniform(math.log10(50e6), math.log10(190e9)),
        poisson=0.3,
        restitution=random.uniform(0.9, 0.98),
        roughness=10.0 ** random.uniform(-8.5, -6.5),
    )
    setting: dict[str, Any] = {
        "diameter": diameter,
        "velocity": 10.0 ** random.uniform(-1.5, 0.0),
        "stokes": random.uniform(20.0, 200.0),
    }
    fine = collide(material, **setting, step_fraction=5e-4)
    assert collide(material, **setting).restitution == pytest.approx(fine.restitution, abs=1e-3)


@pytest.mark.parametrize("dry", [0.9, 0.97, 1.0])
def test_without_viscosity_the_collision_is_dry(dry: float) -> None:
    result = collide(GLASS.model_copy(update={"restitution": dry}), velocity=0.2, viscosity=0.0)
    assert result.restitution == pytest.approx(dry, abs=1e-3)
    assert (result.outcome, result.mechanism, result.stokes) == ("rebound", "dry", math.inf)
    assert (result.minimum_gap, result.stop_gap, result.friction_used) == (0.0, None, 0.40)


def test_fields_of_a_result_have_their_documented_types() -> None:
    result = collide(GLASS, diameter=12.7e-3, viscosity=1e-3, velocity=0.05, angle=25, trajectory="frozen")
    assert isinstance(result, Collision)
    for name in ("stokes", "restitution", "restitution_tangential", "minimum_gap", "friction_used"):
        assert isinstance(getattr(result, name), float), name
    assert 0.0 < result.rebound_angle_striker <= 90.0
    assert 0.0 < result.rebound_angle_relative <= 90.0
    assert result.outcome in ("no_touch", "touch_no_rebound", "rebound")
    assert result.mechanism in ("roughness", "elastohydrodynamic")
    assert result.stop_gap is None
    assert len(result.spin) == 2
    assert result.spin[0] * result.spin[1] > 0.0  # friction turns both the same way
    assert result.time.shape == result.gap.shape == result.history["normal_speed"].shape
    assert np.all(np.diff(result.time) > 0.0)
    assert result.gap[0] == pytest.approx(CUTOFF)


@pytest.mark.parametrize("stokes", [30.0, 200.0])
def test_the_record_of_the_engine_agrees_with_the_scenario(stokes: float) -> None:
    """The same pair, put into the engine by hand, with its record of collisions."""
    radius, speed = 6.35e-3, 0.1
    pair = Pair((DELRIN, DELRIN), (radius, radius), speed, gap=0.5 * radius * 1.000001)
    pair = replace(pair, viscosity=speed * pair.reduced_mass / (6 * math.pi * (0.5 * radius) ** 2 * stokes))
    run = pair.simulation(Laws(film=True), record=True)
    step = 0.02 * timescales.hertz_time(pair.reduced_mass, pair.stiffness, speed)
    while not len(run.collisions.table):
        run.advance(step, 500)
    (row,) = run.collisions.table
    expected = collide(DELRIN, velocity=speed, stokes=stokes)
    assert row["restitution"] == pytest.approx(expected.restitution, abs=1e-3)
    assert row["stokes"] == pytest.approx(stokes, rel=1e-3)
    assert row["minimum_gap"] == expected.minimum_gap
    assert row["friction"] == expected.friction_used
    assert not row["deformed"]
    assert (row["first"], row["second"]) == (0, 1)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"velocity": 0.1, "viscosity": 1e-3, "stokes": 10.0}, "two of the three"),
        ({"velocity": 0.1}, "two of the three"),
        ({"velocity": -0.1, "stokes": 10.0}, "velocity = -0.1"),
        ({"velocity": math.nan, "stokes": 10.0}, "velocity = nan"),
        ({"velocity": 5e-324, "stokes": 10.0}, "between 1e-12 and 1000 m/s"),
        ({"velocity": 0.1, "viscosity": -1e-3}, "viscosity = -0.001"),
        ({"velocity": 0.1, "stokes": 0.0}, "stokes = 0.0"),
        ({"velocity": 0.1, "stokes": 10.0, "diameter": -1e-3}, "diameter = -0.001"),
        ({"velocity": 0.1, "stokes": 10.0, "angle": 90.0}, "angle = 90.0"),
        ({"velocity": 0.1, "stokes": 10.0, "step_fraction": 0.0}, "step_fraction = 0.0"),
        ({"velocity": 0.1, "stokes": 10.0, "against": "floor"}, "one of sphere, wall"),
        ({"velocity": 0.1, "stokes": 10.0, "integrator": "euler"}, "one of drift, verlet|one of verlet, drift"),
    ],
    ids=lambda value: value if isinstance(value, str) else " ".join(value),
)
def test_bad_input_is_refused_by_name_value_and_limit(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        collide(DELRIN, **wrong)


def test_measured_rebounds_are_computed_drawn_and_scored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A point at the computed restitution, and one three errors above it."""
    monkeypatch.chdir(tmp_path)
    once = parsed(call("collide", "--velocity", "0.1", "--stokes", "100", "--json").out)["restitution"]
    (tmp_path / "points.csv").write_text(f"St [-], e [-], error [%]\n100, {once}, 2\n100, {once + 0.06}, 2\n")
    done = call("collide", "--velocity", "0.1", "--data", "points.csv", "--json")
    score = parsed(done.out)
    assert score["points"] == 2 and score["chi2"] == pytest.approx(4.5) and score["holds"] is False
    assert (tmp_path / "collide.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("speed [m/s], e [-]\n1, 0.5\n", "one of stokes and angle"),
        ("St [-], e [mm]\n1, 0.5\n", "units of 1"),
        ("St [-], e [-]\n0, 0.5\n", "above 0"),
        ("angle [deg], rebound angle [deg]\n90, 30\n", "below 90 degrees"),
        ("St [-], e [-], error [-]\n1, 0.5, 0\n", "above 0"),
    ],
)
def test_a_wrong_file_of_rebounds_is_one_line(
    text: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "points.csv").write_text(text)
    done = call("collide", "--velocity", "0.1", "--data", "points.csv")
    assert (done.code, done.err.count("\n")) == (2, 1) and said in done.err, done.err


@pytest.mark.parametrize("against", ["sphere", "wall"])
def test_a_pair_is_followed_beyond_its_neighbour_list(against: Any) -> None:
    """It parts by more than the list reaches, without a force, at the speed at which it has left the film."""
    result = collide(GLASS, viscosity=0.001, velocity=0.5, until=0.1, against=against)
    assert result.gap[-1] > 12.7e-3
    assert result.time[-1] == pytest.approx(0.1, rel=1e-6)
    assert result.history["normal_speed"][-1] == pytest.approx(result.restitution * 0.5, rel=1e-3)


def test_a_sphere_that_falls_back_onto_its_wall_finds_it_again() -> None:
    """The bouncing sphere without forces of the fluid leaves the list of its wall, and comes back."""
    time, gap = bounce(0.12, ())
    after = gap[time > 0.0]
    assert np.isfinite(gap).all() and after.max() > 1e-3
    assert after[-1] < 1e-5
