"""Wet pairs: converged solutions of each film, closed forms, soft against hard contacts, and film laws."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from command_line import call, parsed
from test_three_spheres import failed

from cfddem.backend.errors import InputError
from closures.bridge import deforming_potential, deforming_share, static_potential, static_share
from closures.registry import law_of
from closures.restitution import davis_sitison, singh
from scenarios.collisions.wet_pair import TRANSITION_PRESSURES, collide_wet
from scenarios.validation import wet as study


@pytest.mark.parametrize(
    "part",
    [*(pytest.param(part, marks=pytest.mark.slow) for part in (study.pairs, study.engine_pairs)), study.thick_films],
    ids=lambda part: part.__name__,
)
def test_converged_solutions_hold(part, tmp_path) -> None:
    """Restitution 0.003, spin 1 %, critical St_n 0.01; soft against hard contact 1 % and 2 %; in the engine 1 %."""
    assert failed(part(tmp_path, {})) == []


@pytest.mark.parametrize("pair", [(static_share, static_potential), (deforming_share, deforming_potential)])
def test_the_potential_of_a_bridge_is_the_integral_of_its_resistance(pair) -> None:
    share, potential = pair
    gap = np.geomspace(0.02, 0.98, 20001)
    resistance = np.array([share(each, 1.0) / each for each in gap])
    integral = np.sum(0.5 * (resistance[1:] + resistance[:-1]) * np.diff(gap))
    assert potential(0.98, 1.0) - potential(0.02, 1.0) == pytest.approx(integral, rel=1e-6)
    assert potential(1.0, 1.0) == pytest.approx(0.0, abs=1e-15)
    assert potential(3.0, 1.0) == potential(1.0, 1.0)


def test_other_films_and_a_pull_have_the_converged_solutions() -> None:
    """Against the table of the validation: spin 1 %, restitution 0.003."""
    exact = partial(collide_wet, angle=60.0, solver="equations")
    assert exact(1.2, tangential="nase").spin == pytest.approx(12.3, rel=0.01)
    assert exact(0.5, tangential="none").restitution == pytest.approx(0.117, abs=0.003)
    assert exact(0.5, capillary=True).restitution == pytest.approx(0.0716, abs=0.003)


@pytest.mark.parametrize(
    ("bridge", "solver"),
    [
        ("static", "equations"),
        ("deforming", "particles"),
        pytest.param("static", "particles", marks=pytest.mark.slow),  # its law set is compiled for no other plain test
    ],
)
def test_head_on_with_zero_cut_is_the_closed_form(bridge: str, solver: str) -> None:
    """e = e_dry - (1 + e_dry) K/St, with K the potential at h_min; the pull of the damped contact's end aside."""
    potential = {"static": static_potential, "deforming": deforming_potential}[bridge]
    for stokes in (1.6, 2.5, 4.0):
        run = collide_wet(stokes, bridge=bridge, solver=solver)  # type: ignore[arg-type]
        lost = -potential(run.minimum_gap, 270e-6)
        assert run.restitution == pytest.approx(0.9 - 1.9 * lost / stokes, abs=2e-4)
        if bridge == "deforming":
            assert run.restitution == pytest.approx(davis_sitison(stokes, 0.9, run.minimum_gap / 270e-6), abs=2e-4)


@pytest.mark.slow
def test_a_dry_contact_returns_its_restitution_and_rolls() -> None:
    """Next to no film: e_dry head-on, and full sliding turns each sphere by 2.5 mu (1 + e) v_n / (2 R)."""
    thin = {"viscosity": 1e-8, "film": 1e-6, "tangential": "none", "stokes": 4e5, "radius": 1e-3}
    assert collide_wet(**thin).restitution == pytest.approx(0.9, abs=1e-3)  # type: ignore[arg-type]
    run = collide_wet(**thin, angle=60.0, friction=0.05)  # type: ignore[arg-type]
    assert run.spin == pytest.approx(2.5 * 0.05 * 1.9 * run.velocity / (2.0 * 1e-3), rel=2e-3)


def test_angular_momentum_passes_from_the_line_of_centres_to_the_spins() -> None:
    """Angular momentum changes only because the film pulls at the arm R and not at half the distance: below 1 %."""
    for stokes, friction in ((0.8, 0.0), (2.0, 0.05)):
        history = collide_wet(stokes, 60.0, friction=friction, solver="equations").history
        orbit = 0.5 * (2.0 * 12.7e-3 + history["gap"]) ** 2 * history["turning"]
        total = orbit + 2.0 * 0.4 * 12.7e-3**2 * history["spin"]
        assert np.ptp(total) / total[0] < 0.01


@pytest.mark.parametrize("solver", ["equations", pytest.param("particles", marks=pytest.mark.slow)])
def test_outcomes(solver: str) -> None:
    collide = partial(collide_wet, solver=solver)
    assert collide(0.5).outcome == "stick"
    assert collide(0.5).separation_time is None
    assert collide(0.8, 60.0).outcome == "stick_rotate_separate"
    assert collide(2.0, 60.0).outcome == "bounce"
    assert collide(0.2, 60.0, duration=0.07).outcome == "stick"


@pytest.mark.slow
def test_a_faster_liquid_glass_keeps_the_solids_farther_apart() -> None:
    """h_min grows as the root of the speed and ends at the film."""
    slow, fast = collide_wet(1.0).minimum_gap, collide_wet(4.0).minimum_gap
    assert fast / slow == pytest.approx(2.0)
    with pytest.warns(UserWarning, match="the whole film .* is above its glass transition pressure"):
        stiff = collide_wet(6.0, bridge="deforming", cut="constant")
    assert stiff.minimum_gap == 270e-6
    assert len(stiff.warnings) == 1


def test_a_thin_liquid_without_its_own_pressure_and_a_radius_in_mm_are_warned_of() -> None:
    with pytest.warns(UserWarning) as caught:
        found = collide_wet(1.2, viscosity=1e-3, radius=1.0)
    assert len(caught) == len(found.warnings) == 2
    assert "is that of silicone oil of 10 Pa s" in found.warnings[0] and "did you mean 0.001 m?" in found.warnings[1]


@pytest.mark.slow
@pytest.mark.parametrize("kind", TRANSITION_PRESSURES, ids="-".join)
def test_films_dissipate_in_the_expected_order(kind: tuple[str, str]) -> None:
    """A constant film below h_min takes more than none at the same pressure; oblique impacts never lose more."""
    bridge, cut = kind
    runs = [collide_wet(2.0, bridge=bridge, cut=each, glass_transition_pressure=1e7) for each in ("constant", "zero")]
    assert runs[0].restitution < runs[1].restitution
    assert collide_wet(2.0, 60.0, bridge, cut).restitution > collide_wet(2.0, 0.0, bridge, cut).restitution


def test_the_law_of_thick_films_reports_its_range() -> None:
    assert law_of(singh).outside(stokes=1000.0, film_ratio=0.1) == []
    assert law_of(singh).outside(stokes=20.0, film_ratio=0.01) == ["stokes", "film_ratio"]
    stokes = np.geomspace(34.0, 3440.0, 4001)
    for ratio in (0.05, 0.08, 0.143):
        e = np.array([singh(each, ratio) for each in stokes])
        planes = np.exp(
            [-1.76 + 0.17 * np.log(stokes) - 0.16 * np.log(ratio), -0.90 + 0.01 * np.log(stokes) - 0.22 * np.log(ratio)]
        )
        assert np.abs(e / planes.min(0) - 1.0).max() < 1e-14
        assert np.diff(e).min() > 0.0
        assert np.abs(np.diff(np.log(e))).max() < 0.171 * np.log(stokes[1] / stokes[0])  # no jump


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [("stokes", 0.0, "above 0"), ("stokes", 5e-324, "1e-12 to 1000 m/s"),
     ("angle", 90.0, "below 90"), ("bridge", "bent", "static"), ("cut", "none", "zero"),
     ("tangential", "nas", "nase"), ("film", math.inf, "finite"), ("restitution", 0.0, "above 0"),
     ("poisson", 0.6, "0.5"), ("glass_transition_pressure", -1.0, "above 0"),
     ("friction", math.nan, "finite")],
)  # fmt: skip
def test_invalid_arguments_are_refused_by_name(name: str, value: object, said: str) -> None:
    with pytest.raises(InputError, match=f"{name}.*{said}"):
        collide_wet(**{"stokes": 2.0, name: value})  # type: ignore[arg-type]


def test_the_command_prints_json() -> None:
    result = parsed(call("wet-pair", "--stokes", "2", "--angle", "45", "--json").out)
    assert (result["outcome"], round(result["restitution"], 3)) == ("bounce", 0.527)


def test_a_pair_that_comes_to_rest_is_followed_without_a_warning(recwarn: pytest.WarningsRecorder) -> None:
    assert collide_wet(0.7999999999999999, 15.0, "static", "zero", solver="equations").restitution == 0.0
    assert not recwarn.list
