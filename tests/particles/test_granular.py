"""Granular physics: one sphere on a floor, oblique impacts, beds at rest, slopes and hoppers.

MFIX DEM01, DEM02, DEM04: Garg, Galvin, Li & Pannala (2012), Powder Technol. 220, 122, cases as in
`scenarios/data/mfix_dem_verification_cases.csv`. Only the poured beds
have rolling friction.
"""

from __future__ import annotations

import numpy as np
import pytest
from impacts import rows

from cfddem.case.materials import Material
from cfddem.particles.material_pairs import pair_table
from cfddem.particles.solver import ParticleSolver
from cfddem.particles.state import make_particles
from scenarios.validation.particles.few_spheres import BALL_RADIUS, DROP_HEIGHT, drop, drop_exactly, slide, strike
from scenarios.validation.particles.granular_beds import hopper, rest, slope


@pytest.mark.parametrize("restitution", [0.6, 0.8, 1.0])
@pytest.mark.parametrize("stiffness", [1e4, 2.5e4, 5e4, 1e5])
def test_falling_sphere_follows_the_damped_oscillator(stiffness: float, restitution: float) -> None:
    """DEM01: free fall, contact and first rebound within 0.1 % of the height of the fall (MFIX: 5 %)."""
    time, height = drop(stiffness, restitution, 0.6)
    exact = drop_exactly(stiffness, restitution, time)
    assert np.abs(height - exact).max() <= 1e-3 * (DROP_HEIGHT - BALL_RADIUS)
    assert exact.min() < BALL_RADIUS


@pytest.mark.parametrize(("restitution", "until"), [(0.6, 0.93), (0.9, 1.8)])
def test_bounces_reach_their_heights(restitution: float, until: float) -> None:
    """DEM02: apex h_k = r + (h_0 - r) e^(2k) of a hard sphere; k_n = 5e6, three bounces, within 1 %.

    Two bounces are counted at e = 0.6. Softer springs lower the apex by up to 1 % themselves.
    """
    _, height = drop(5e6, restitution, until, samples=2000)
    inside = (height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])
    apexes = height[1:-1][inside]
    wanted = BALL_RADIUS + (DROP_HEIGHT - BALL_RADIUS) * restitution ** (2.0 * np.arange(1, 4))
    count = min(len(apexes), 3)
    assert count >= 2
    assert apexes[:count] == pytest.approx(wanted[:count], rel=0.01)


@pytest.mark.parametrize("linear", [False, True], ids=["Hertz", "linear"])
@pytest.mark.parametrize("friction", [0.2, 0.6, 1.0])
def test_sliding_sphere_rolls_at_five_sevenths(friction: float, linear: bool) -> None:
    """DEM04: sliding ends at mu g t/u0 = 2/7 within 0.6 %; then speed and spin are 5/7 of u0 and stay so.

    At the end of sliding within 0.5 % (the tangential spring is still being unloaded), rolling within 0.05 %.
    """
    found = slide(friction, linear)
    assert found["time"] == pytest.approx(2.0 / 7.0, rel=6e-3)
    for what in ("speed", "spin"):
        assert found[f"{what}, end of sliding"] == pytest.approx(5.0 / 7.0, rel=5e-3)
        assert found[f"{what}, rolling"] == pytest.approx(5.0 / 7.0, rel=5e-4)


SPANS = {"omega_out [rad/s]": 613.0, "com_rebound_angle [deg]": 57.5}
"""Range of the measured curves."""


@pytest.mark.parametrize("linear", [False, True], ids=["Hertz", "linear"])
@pytest.mark.parametrize("observable", ["e_t", "omega_out [rad/s]", "com_rebound_angle [deg]"])
def test_oblique_impacts_of_kharaz(observable: str, linear: bool) -> None:
    """Kharaz, Gorham & Salman (2001): e_t within 5 % of its value, angles within 5 % of their range, from 9 degrees on.

    The spin within 8 %: at 39 and 60 degrees the sphere slides throughout, so that mu and e alone give the spin,
    and the measured points lie 8 % above that; see the next test. Below 9 degrees e_t divides two small numbers.
    """
    limit = 0.08 if observable == "omega_out [rad/s]" else 0.05
    for row in rows("kharaz2001_oblique_experiment"):
        angle, value = float(row["impact_angle [deg]"]), float(row["value"])
        if row["observable"] == observable and angle >= 9.0:
            ours = strike(angle, linear)[observable]
            assert abs(ours - value) <= limit * SPANS.get(observable, value), angle


def test_spin_is_what_the_tangential_velocity_lost() -> None:
    """Friction at the rim gives a solid sphere spin = 5/2 (1 - e_t) v_t / R, whatever its law: ours to 1 %.

    The measured spins of Kharaz et al. are 5 % (39 degrees) and 14 % (60 degrees) above what their own measured e_t
    leaves, so that no law comes within 5 % of the spin and of e_t at once.
    """
    measured = rows("kharaz2001_oblique_experiment")

    def curve(observable: str) -> np.ndarray:
        chosen = [row for row in measured if row["observable"] == observable and row["digitisation"] == "Lethe"]
        return np.array([(float(row["impact_angle [deg]"]), float(row["value"])) for row in chosen])

    angles, spins = curve("omega_out [rad/s]").T
    left = np.interp(angles, *curve("e_t").T)
    excess = []
    for angle, spin, e_t in zip(angles, spins, left):
        along = 3.9 * np.sin(np.radians(angle))
        ours = strike(angle)
        assert ours["omega_out [rad/s]"] == pytest.approx(2.5 * (1.0 - ours["e_t"]) * along / 2.5e-3, rel=1e-2)
        excess.append(spin / (2.5 * (1.0 - e_t) * along / 2.5e-3) - 1.0)
    assert excess[4] == pytest.approx(0.05, abs=0.01)
    assert excess[6] == pytest.approx(0.14, abs=0.01)


def check_rest(count: int, width: float, periodic: bool, watch: float, latest: float) -> None:
    """A poured bed comes to rest in time and stays so; walls carry its weight."""
    bed = rest(count, width, watch, periodic)
    assert bed.settled < latest
    assert bed.energy.max() < 1e-7 * bed.poured
    assert bed.energy[-10:].mean() < bed.energy[:10].mean()
    assert bed.weight.mean() == pytest.approx(1.0, abs=1e-3)


def test_poured_bed_lies_still_on_its_floor() -> None:
    """E = 10 MPa, periodic sides: below 1e-7 of the poured energy within 0.5 s and never above again; the floor
    carries the weight within 0.1 % in the mean over the elastic swing of the bed."""
    check_rest(400, 8e-3, True, 0.05, 0.5)


@pytest.mark.slow
def test_poured_bed_lies_still_between_walls() -> None:
    """The same with 3 000 spheres in a closed column: floor and sides together carry the weight."""
    check_rest(3000, 15e-3, False, 0.1, 1.0)


@pytest.mark.slow
def test_hundred_thousand_spheres_lie_still() -> None:
    """The same with 1e5 spheres; takes an hour on one core."""
    check_rest(100_000, 60e-3, True, 0.05, 2.0)


@pytest.mark.slow
def test_slope_is_steeper_with_friction_and_as_steep_under_water() -> None:
    """A tilted bed starts to flow at an angle that grows with friction; with films on within 2 degrees of dry.

    Resting contacts live where film and contact share the load. Friction only at overlap leaves them slippery: the
    bed flows at less than two thirds of the angle.
    """
    dry = [slope(friction, False)[0] for friction in (0.2, 0.5)]
    wet = [slope(friction, True)[0] for friction in (0.2, 0.5)]
    assert dry[0] + 2.0 < dry[1]
    assert wet == pytest.approx(dry, abs=2.0)
    assert slope(0.5, True, "overlap")[0] < dry[1] / 1.5


@pytest.mark.slow
def test_slope_is_steeper_with_friction_against_rolling() -> None:
    """A dry tilted bed starts to flow later by at least two degrees where rolling is resisted, mu_r = 0.3."""
    assert slope(0.5, False, rolling_friction=0.3)[0] > slope(0.5, False)[0] + 2.0


@pytest.mark.slow
def test_hopper_discharges_as_beverloo_says() -> None:
    """Round hole of eight diameters in a flat bottom: within 15 % of Beverloo, Leniger & van de Velde (1961)."""
    flow, beverloo = hopper(5000, 8.0, 0.4)
    assert flow == pytest.approx(beverloo, rel=0.15)


def test_a_change_of_gravity_acts_from_the_next_forces_on() -> None:
    """Slopes tilt gravity: a sphere falls along z, then along x."""
    glass = Material(density=2500.0, youngs_modulus=1e7, poisson=0.25)
    spheres = make_particles(np.zeros((1, 3)), 1e-3, glass.density)
    run = ParticleSolver(spheres, pair_table([glass]), gravity=(0.0, 0.0, -10.0))
    run.advance(1e-3, 10)
    run.gravity = (10.0, 0.0, 0.0)
    run.refresh()
    run.advance(1e-3, 10)
    assert run.gravity == (10.0, 0.0, 0.0)
    assert run.particles.velocity[0] == pytest.approx([0.1, 0.0, -0.1], abs=1e-12)
