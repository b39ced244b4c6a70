"""Three wet spheres: printed numbers, the analytic law of two, a second solution, and conservation laws."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from command_line import call, parsed
from matplotlib.colors import to_hex

from cfddem.backend.errors import InputError
from closures.restitution import davis_sitison
from scenarios.collisions.three_spheres import centres, figures, outcomes, simulate_three_spheres
from scenarios.collisions.three_spheres import validation as study
from scenarios.references.three_spheres import events as three_sphere_events
from scenarios.references.three_spheres.cartesian import cartesian
from scenarios.validation.table import Row

hard_spheres = partial(simulate_three_spheres, solver="equations")


def failed(rows: list[Row]) -> list[object]:
    return [row.as_dict() for row in rows if row.verdict == "FAILS"]


@pytest.mark.parametrize(
    "part",
    [*(pytest.param(part, marks=pytest.mark.slow) for part in (study.printed, study.thresholds)), study.two_spheres],
    ids=lambda part: part.__name__,
)
def test_published_numbers_hold(part, tmp_path) -> None:
    """Within 0.5 % of Davis (2023), and 1e-4 of the analytic law of Davis & Sitison (2020)."""
    assert failed(part(tmp_path, {})) == []


@pytest.mark.parametrize(("angle", "threshold"), [(30.0, 14.1), (45.0, 7.0)])
def test_the_first_pair_separates_before_the_second_contact_below_a_threshold(angle: float, threshold: float) -> None:
    """Davis (2023): the Stokes number at which e12 jumps, within 0.6 %."""
    assert study.parts_before(0.994 * threshold, angle) != study.parts_before(1.006 * threshold, angle)


@pytest.mark.slow
def test_contacts_that_stick_are_those_of_the_equations() -> None:
    """Times and restitutions within 0.2 %; a spring that gives slip back would change them by 1 to 3 %."""
    conditions = {"stokes": 15.0, "theta12": 37.5, "friction": 0.15, "restitution": 0.95}
    soft = simulate_three_spheres(**conditions)
    hard = hard_spheres(**conditions)
    assert [(e.kind, e.pair) for e in soft.events] == [(e.kind, e.pair) for e in hard.events]
    assert [e.time for e in soft.events] == pytest.approx([e.time for e in hard.events], rel=2e-3)
    assert soft.restitution12 == pytest.approx(hard.restitution12, rel=2e-3)
    assert soft.restitution23 == pytest.approx(hard.restitution23, rel=2e-3)
    assert len(soft.history["time"]) < 5000  # steps; a uniform step of 1e-3 would make 640 000


@pytest.mark.slow
@pytest.mark.parametrize(
    "conditions", [{"stokes": 2.0, "theta12": 45.0}, {"stokes": 3.5, "theta12": 45.0, "capillary_number": 100.0}]
)
def test_spheres_that_stay_pressed_together_are_those_of_the_equations(conditions: dict[str, float]) -> None:
    """Films part and meet within 0.1 %, at the same speed within 0.005, after hundreds of slow contacts."""
    soft, hard = (
        [event for event in run.events if event.kind != "contact"]
        for run in (simulate_three_spheres(**conditions), hard_spheres(**conditions))
    )
    assert [(e.kind, e.pair) for e in soft] == [(e.kind, e.pair) for e in hard]
    assert [e.time for e in soft] == pytest.approx([e.time for e in hard], rel=1e-3)
    assert [e.speed for e in soft] == pytest.approx([e.speed for e in hard], abs=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_the_particle_engine_with_soft_contacts_agrees(friction: float) -> None:
    """Cartesian coordinates, Hertz contacts, films laid over: times within 0.2 %, restitution within 0.005."""
    conditions = {"stokes": 8.0, "theta12": 45.0, "friction": friction}
    until = 3.2 * 0.01 / math.cos(math.radians(45.0))
    soft = simulate_three_spheres(**conditions, until=until)
    hard = hard_spheres(**conditions)
    assert [(e.kind, e.pair) for e in soft.events] == [(e.kind, e.pair) for e in hard.events[:3]]
    for a, b in zip(soft.events, hard.events):
        assert a.time == pytest.approx(b.time, rel=2e-3)
    assert soft.restitution12 == pytest.approx(hard.restitution12, abs=5e-3)


@pytest.mark.parametrize("conditions", study.UNPRINTED, ids=lambda each: f"St {each['stokes']:g}")
def test_a_second_solution_in_other_coordinates_agrees(conditions: dict[str, float]) -> None:
    """Events in the same order; times within 0.2 %, normal speeds within 0.005."""
    ours, theirs = hard_spheres(**conditions, until=2.0).events, cartesian(**conditions)
    assert len(theirs) >= 2
    for a, (kind, pair, time, speed) in zip(ours, theirs, strict=False):
        assert (a.kind, a.pair) == (kind, pair)
        assert a.time == pytest.approx(time, rel=2e-3)
        assert a.speed == pytest.approx(speed, abs=5e-3)


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_results_do_not_depend_on_the_slowest_bounce(friction: float) -> None:
    """St 2: sphere 3 presses 1 and 2 together, which bounce ever faster; the partings come out the same."""
    runs = [hard_spheres(2.0, 45.0, friction=friction, slowest_bounce=slowest) for slowest in (1e-3, 1e-4, 1e-5)]
    contacts = [run.summary()["contacts"]["12"] for run in runs]
    assert contacts[0] < contacts[1] < contacts[2]
    assert contacts[2] > 100
    for kind, pair in (("meet", 13), ("separate", 12), ("separate", 13)):
        times = [study.of(run, f"{kind} t_star", pair) for run in runs]
        assert max(times) - min(times) < 1e-6


def test_solids_never_come_closer_than_the_minimum_gap() -> None:
    """Also where a capillary pull keeps all three pressed together."""
    for conditions in ({"stokes": 2.0, "theta12": 45.0}, {"stokes": 3.5, "theta12": 45.0, "capillary_number": 100.0}):
        history = hard_spheres(**conditions).history
        for pair in ("12", "23", "13"):
            assert history[f"gap{pair}"].min() > 0.05 - 1e-8


def momentum_of_turning(history: dict[str, np.ndarray], film_ratio: float) -> np.ndarray:
    """Angular momentum about the common centre, over mass, diameter and delta_12/v_n0."""
    place = centres(history, film_ratio) / film_ratio
    # velocities from the rates of the pairs, the centre at rest
    steps = []
    for pair in ("12", "23"):
        angle = np.radians(history[f"angle{pair}"])
        c, s = np.cos(angle), np.sin(angle)
        across = (1.0 / film_ratio + history[f"gap{pair}"]) * history[f"turning{pair}"]
        steps.append(
            np.stack([-history[f"approach{pair}"] * c - across * s, -history[f"approach{pair}"] * s + across * c], 1)
        )
    velocity = np.stack([np.zeros_like(steps[0]), steps[0], steps[0] + steps[1]], 1)
    orbit = (place[..., 0] * velocity[..., 1] - place[..., 1] * velocity[..., 0]).sum(1)
    orbit -= 3.0 * (place.mean(1)[:, 0] * velocity.mean(1)[:, 1] - place.mean(1)[:, 1] * velocity.mean(1)[:, 0])
    spin = sum(history[f"spin{sphere}"] for sphere in (1, 2, 3)) * 0.1 / film_ratio**2
    return np.asarray(orbit + spin)


def test_angular_momentum_changes_only_by_the_arms_of_the_film() -> None:
    """Without friction and film across it is kept to 1e-9; the torque of the film acts at a R, half a gap short."""
    turning = momentum_of_turning(hard_spheres(8.0, 45.0, friction=0.2, until=3.0).history, 0.01)
    assert np.ptp(turning) / abs(turning[0]) < 1e-3
    head_on = momentum_of_turning(hard_spheres(8.0, 0.0, until=3.0).history, 0.01)
    assert np.abs(head_on).max() < 1e-9 * 100.0


def test_energy_falls() -> None:
    """Films and contacts only take: the speeds squared fall from event to event."""
    history = hard_spheres(6.0, 30.0, friction=0.1, restitution=0.9, until=2.0).history
    squares = []
    for pair in ("12", "23"):
        squares.append(
            history[f"approach{pair}"] ** 2 + ((100.0 + history[f"gap{pair}"]) * history[f"turning{pair}"]) ** 2
        )
    first, second = (np.array(each) for each in squares)
    angle = np.radians(history["angle23"] - history["angle12"])
    ahead = [history["approach12"], (100.0 + history["gap12"]) * history["turning12"]]
    after = [history["approach23"], (100.0 + history["gap23"]) * history["turning23"]]
    dot = (ahead[0] * after[0] + ahead[1] * after[1]) * np.cos(angle) + (
        ahead[0] * after[1] - ahead[1] * after[0]
    ) * np.sin(angle)
    # kinetic energy about the common centre of three equal masses, by the two relative velocities
    energy = (first + second + dot) / 3.0 + 0.05e4 * sum(history[f"spin{sphere}"] ** 2 for sphere in (1, 2, 3))
    assert np.diff(energy).max() < 1e-8 * energy[0]
    assert energy[-1] < 0.8 * energy[0]


@pytest.mark.parametrize("solver", ["equations", pytest.param("particles", marks=pytest.mark.slow)])
def test_the_outcomes_have_their_names(solver: str) -> None:
    """FA, PA1, PA2, PA3 and FS, each where the source finds it."""
    collide = partial(simulate_three_spheres, solver=solver)
    assert collide(2.0, 45.0).outcome == "PA1"
    assert collide(2.0, 45.0, -45.0, minimum_gap=0.04).outcome == "PA2"
    assert collide(8.0, 0.0).outcome == "PA3"
    assert collide(4.0, 0.0).outcome == "FA"
    assert collide(10.0, 45.0).outcome == "FS"
    assert collide(10.0, 0.0, spheres=2).outcome == "FS"
    assert collide(3.0, 0.0, spheres=2).outcome == "FA"


def test_a_map_equals_single_runs_within_its_tolerance() -> None:
    table = outcomes([3.0, 9.0], [10.0, 50.0], friction=0.1)
    for row, angle in enumerate((10.0, 50.0)):
        for column, stokes in enumerate((3.0, 9.0)):
            run = hard_spheres(stokes, angle, friction=0.1)
            assert table["outcome"][row, column] == run.outcome
            assert table["restitution12"][row, column] == pytest.approx(run.restitution12, abs=1e-7)
            assert table["restitution23"][row, column] == pytest.approx(run.restitution23, abs=1e-7)


def test_a_map_shows_each_outcome_in_its_colour(tmp_path: Path) -> None:
    table = {"outcome": np.array([["FS", "PA1"], ["FA", "PA3"]])}
    mesh = figures.outcome_map(np.array([1.0, 2.0]), np.array([10.0, 20.0]), table).axes[0].collections[0]
    shown = mesh.cmap(mesh.norm(mesh.get_array())).reshape(2, 2, 4)
    for place, outcome in np.ndenumerate(table["outcome"]):
        assert to_hex(shown[place]) == figures.COLOURS[outcome]
    figures.draw_map(tmp_path / "map.png", {"stokes": 8.0, "friction": 0.1}, count=3)
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_two_spheres_head_on_follow_the_law_to_rounding_of_the_integrator() -> None:
    assert hard_spheres(10.0, 0.0, spheres=2).restitution12 == pytest.approx(davis_sitison(10.0, 1.0, 0.05), abs=1e-8)


@pytest.mark.parametrize(
    ("name", "value"),
    [("stokes", 0.0), ("stokes", math.nan), ("theta12", 90.0), ("minimum_gap", 1.0), ("film_ratio", -0.01),
     ("gap23", 0.01), ("capillary_number", 0.0), ("restitution", 1.1), ("friction", -0.1), ("spheres", 4),
     ("until", 0.0), ("theta23", 180.0)],
)  # fmt: skip
def test_invalid_arguments_are_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        hard_spheres(**{"stokes": 5.0, "theta12": 30.0, name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("solver", ["equations", pytest.param("particles", marks=pytest.mark.slow)])
def test_the_command_prints_json(solver: str) -> None:
    result = parsed(call("three-spheres", "--stokes", "20", "--theta12", "30", "--solver", solver, "--json").out)
    assert (result["outcome"], round(result["restitution12"], 3)) == ("FS", 0.774)
    assert result["events"][0]["pair"] == 12
    words = call("three-spheres", "--stokes", "20", "--theta12", "30", "--solver", "equations").out
    assert "FS: all separate" in words and "t*: time over (diameter / impact speed)" in words


@pytest.mark.parametrize("conditions", [{"stokes": 5.0, "theta12": 30.0}, {"stokes": 2.0, "theta12": 45.0}])
def test_times_of_events_are_converged(conditions: dict[str, float], monkeypatch: pytest.MonkeyPatch) -> None:
    """Within 1e-8 of their value of times with tolerances a hundred times tighter, endless bouncing included."""
    usual = hard_spheres(**conditions).events
    monkeypatch.setattr(three_sphere_events, "RELATIVE", 1e-13)
    monkeypatch.setattr(three_sphere_events, "ABSOLUTE", 1e-15)
    tight = hard_spheres(**conditions).events
    assert [(e.kind, e.pair) for e in usual] == [(e.kind, e.pair) for e in tight]
    assert [e.time for e in usual] == pytest.approx([e.time for e in tight], rel=1e-8)


def test_a_pair_in_endless_bouncing_keeps_its_minimum_gap() -> None:
    """St 2: sphere 3 presses spheres 1 and 2 together; a missed contact would let them overlap and separate late."""
    run = hard_spheres(2.0, 45.0)
    assert run.history["gap12"].min() > 0.05 - 1e-9
    assert study.of(run, "separate t_star", 12) == pytest.approx(2.596286, abs=1e-5)
