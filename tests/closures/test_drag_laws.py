"""Drag, bed, lift and added-mass laws: limits, transitions and published values."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from closures import REGISTRY, added_mass, balance, bed, check, drag, drag_resolved, drag_single, law, lift
from closures.drag import ergun

DATA = Path(__file__).parents[2] / "scenarios" / "data"
Drag = Callable[[float, float], float]
SINGLE: list[Drag] = [drag_single.stokes, drag_single.schiller_naumann, drag_single.abraham, drag_single.brown_lawler]
SINGLE += [drag_single.clift]
BEDS: list[Drag] = [drag.wen_yu, drag_resolved.koch_hill, drag_resolved.beetstra]
BEDS += [drag_resolved.tang, drag_resolved.tenneti]
DALLAVALLE: list[Drag] = [drag_single.dallavalle, drag.di_felice, drag_resolved.rong]


@pytest.mark.parametrize("law", SINGLE + BEDS)
def test_isolated_spheres_have_stokes_drag_at_low_reynolds_numbers(law: Drag) -> None:
    assert law(1e-9, 1.0) == pytest.approx(1.0, abs=1e-4)
    assert law(0.0, 1.0) == 1.0


@pytest.mark.parametrize("law", DALLAVALLE)
def test_laws_based_on_dallavalle_are_four_percent_below_stokes(law: Drag) -> None:
    assert law(0.0, 1.0) == pytest.approx(0.96)


@pytest.mark.parametrize("law", [drag.gidaspow, drag.gidaspow_smooth])
@pytest.mark.parametrize("reynolds", [1e-3, 1e4])
def test_gidaspow_equals_ergun_in_dense_beds(law: Drag, reynolds: float) -> None:
    assert law(reynolds, 0.42) == pytest.approx(ergun(reynolds, 0.42), rel=5e-3)


def test_width_of_the_smooth_transition_of_gidaspow() -> None:
    """Half of each law at eps = 0.8; at 0.81 a share of 1/2 + arctan(2.625)/pi of Wen & Yu."""
    for voidage, share in [(0.8, 0.5), (0.81, 0.8840), (0.79, 0.1160)]:
        mixture = share * drag.wen_yu(10.0, voidage) + (1.0 - share) * ergun(10.0, voidage)
        assert drag.gidaspow_smooth(10.0, voidage) == pytest.approx(mixture, rel=1e-5)


@pytest.mark.parametrize("law", [drag_resolved.koch_hill, drag_resolved.beetstra, drag_resolved.tenneti])
def test_creeping_dense_beds_are_within_30_percent_of_ergun(law: Drag) -> None:
    """Simulations give a Carman constant of 180, Ergun's is 150."""
    assert law(0.0, 0.4) == pytest.approx(ergun(0.0, 0.4), rel=0.3)


@pytest.mark.parametrize("law", [*SINGLE, *BEDS, *DALLAVALLE[:2], ergun, drag.gidaspow])
def test_drag_increases_with_reynolds_number_and_solid_fraction(law: Drag) -> None:
    for voidage in (0.45, 0.6, 0.75, 0.9):
        values = [law(reynolds, voidage) for reynolds in np.geomspace(1e-3, 300.0, 60)]
        assert (np.diff(values) >= -1e-12).all(), voidage
    for reynolds in (0.01, 1.0, 10.0):
        values = [law(reynolds, voidage) for voidage in np.linspace(0.79, 0.45, 40)]
        assert (np.diff(values) >= -1e-12).all(), reynolds


def test_size_of_published_jumps() -> None:
    def jump(low: float, high: float) -> float:
        return high / low - 1.0

    assert jump(drag.gidaspow(0.0, 0.8), drag.gidaspow(0.0, 0.8 + 1e-9)) == pytest.approx(-0.133, abs=1e-3)
    assert jump(drag.gidaspow(100.0, 0.8), drag.gidaspow(100.0, 0.8 + 1e-9)) == pytest.approx(-0.42, abs=5e-3)
    koch = drag_resolved.koch_hill
    assert jump(koch(0.0, 0.6 + 1e-9), koch(0.0, 0.6 - 1e-9)) == pytest.approx(0.0105, abs=1e-3)
    naumann = drag_single.schiller_naumann
    assert jump(naumann(1000.0, 1.0), naumann(1000.0 + 1e-9, 1.0)) == pytest.approx(0.004, abs=1e-3)


def test_ergun_pressure_drop_of_the_packed_bed() -> None:
    table = np.loadtxt(DATA / "cfdem_ergun_test_dp.csv", delimiter=",", comments="#", skiprows=2)
    for velocity, drop in table:
        assert bed.ergun_gradient(velocity, 1e-3, 10.0, 1.5e-3, 0.451335) * 15.6e-3 == pytest.approx(drop, rel=1e-3)
        factor = ergun(10.0 * velocity * 1e-3 / 1.5e-3, 0.451335)
        gradient = 18.0 * 1.5e-3 * (1.0 - 0.451335) * factor * velocity / (0.451335 * 1e-6)
        assert gradient * 15.6e-3 == pytest.approx(drop, rel=1e-3)


@pytest.mark.parametrize(
    ("law", "limit"), [(bed.terminal_reynolds_abraham, 0.08), (bed.terminal_reynolds_brown_lawler, 0.08)]
)
def test_terminal_velocity_of_mordants_glass_bead(law: Callable[[float], float], limit: float) -> None:
    """Both laws are 7 % above the experiment, whose error is about 3 %."""
    viscosity, galileo, speed = 8.9e-7, 49.14, 0.0741
    assert law(galileo**2) * viscosity / 0.5e-3 == pytest.approx(speed, rel=limit)


@pytest.mark.parametrize("number", [1e-2, 1.0, 1e2, 1e4, 1e6])
def test_terminal_velocity_balances_weight_and_drag(number: float) -> None:
    for root, single in [
        (bed.terminal_reynolds_abraham(number), drag_single.abraham),
        (bed.terminal_reynolds_brown_lawler(number), drag_single.brown_lawler),
    ]:
        assert 18.0 * root * single(root, 1.0) == pytest.approx(number, rel=1e-10)


def test_minimum_fluidisation_balances_weight_and_drag() -> None:
    for number in (1.0, 1e3, 1e6):
        root = bed.fluidisation_reynolds_ergun(number, 0.4)
        assert 18.0 * root * ergun(root, 0.4) / 0.4 == pytest.approx(number, rel=1e-10)


@pytest.mark.parametrize(
    ("law", "limit"),
    [(drag_single.schiller_naumann, 0.08), (drag_single.brown_lawler, 0.06), (drag_single.abraham, 0.10)],
)
def test_isolated_spheres_against_the_standard_drag_curve(law: Drag, limit: float) -> None:
    """Up to Re = 1000, against the curve of Clift, Grace & Weber (1978)."""
    for reynolds in np.geomspace(0.01, 1000.0, 100):
        assert law(reynolds, 1.0) == pytest.approx(drag_single.clift(reynolds, 1.0), rel=limit)


def test_standard_drag_curve_of_clift() -> None:
    """Values of the library `fluids`, and the minimum in the drag crisis, C_D = 0.07."""
    assert 24.0 / 200.0 * drag_single.clift(200.0, 1.0) == pytest.approx(0.7756342422322543, rel=1e-12)
    assert 24.0 / 4e5 * drag_single.clift(4e5, 1.0) == pytest.approx(0.0702, abs=1e-4)
    assert 24.0 / 2e6 * drag_single.clift(2e6, 1.0) == pytest.approx(0.15)
    assert 24.0 / 1e-3 * drag_single.clift(1e-3, 1.0) == pytest.approx(24e3 + 0.1875, rel=1e-9)
    for switch, limit in [(0.01, 0.002), (20.0, 0.008), (260.0, 1e-4), (1500.0, 7e-4), (1.2e4, 1e-4), (3.38e5, 0.006)]:
        below, above = (drag_single.clift(switch * (1.0 + sign * 1e-12), 1.0) for sign in (-1.0, 1.0))
        assert abs(above / below - 1.0) < limit


@pytest.mark.parametrize("law", [drag_resolved.koch_hill, drag_resolved.tenneti])
def test_independent_simulations_agree_in_creeping_flow(law: Drag) -> None:
    """Lattice Boltzmann (Hill, van der Hoef) and immersed boundary (Tenneti): 10 % for 0.1 < phi < 0.5.

    A law of the total force, used as one without the pressure gradient, would differ by 25 to 100 %.
    """
    for voidage in np.linspace(0.5, 0.9, 9):
        assert law(0.0, voidage) == pytest.approx(drag_resolved.van_der_hoef(0.0, voidage), rel=0.10)


def test_polydisperse_drag_has_the_published_total_force() -> None:
    """Drag plus pressure gradient equals (eps y + (1 - eps) y^2 + 0.064 eps y^3) / eps times F."""
    voidage, diameters, numbers = 0.55, np.array([1.0, 1.7]), np.array([3.0, 1.0])
    mean = (numbers * diameters**3).sum() / (numbers * diameters**2).sum()
    ratios = diameters / mean
    factor = drag_resolved.beetstra(0.0, voidage)
    forces = np.array([drag_resolved.beetstra_polydisperse(0.0, voidage, ratio) for ratio in ratios])
    linear = forces - 0.064 * ratios**3 * factor
    volumes = math.pi / 6.0 * diameters**3
    gradient = (numbers * 3.0 * math.pi * diameters * linear).sum() / ((numbers * volumes).sum() / (1.0 - voidage))
    total = forces + volumes * gradient / voidage / (3.0 * math.pi * diameters)
    published = voidage * ratios + (1.0 - voidage) * ratios**2 + 0.064 * voidage * ratios**3
    assert total * voidage == pytest.approx(published * factor, rel=1e-12)
    assert (numbers * diameters * linear).sum() == pytest.approx((numbers * diameters * ratios).sum() * factor)


def test_polydisperse_drag_uses_the_reynolds_number_of_the_mean_sphere() -> None:
    same = drag_resolved.beetstra_polydisperse(20.0, 0.6, 2.0) / (2.0 + 0.064 * 8.0)
    assert same == pytest.approx(drag_resolved.beetstra(10.0, 0.6), rel=1e-14)


@pytest.mark.parametrize("law", [*BEDS, *DALLAVALLE, ergun, drag.gidaspow_smooth], ids=lambda law: law.__name__)
def test_any_drag_law_balances_weight(law: Drag) -> None:
    for number in (1e-3, 1.0, 1e4, 1e6):
        for voidage in (0.42, 0.7) if law is ergun else (0.42, 0.7, 1.0):
            root = balance.reynolds_in_balance(number, voidage, law)
            assert 18.0 * root * law(root, voidage) / voidage == pytest.approx(number, rel=1e-10)
            if voidage != 0.42:
                assert balance.voidage_in_balance(number, root, law) == pytest.approx(voidage, abs=1e-9)


def test_a_bed_at_rest_and_a_sphere_blown_away() -> None:
    assert balance.voidage_in_balance(1e4, 1e-3, drag.wen_yu, packed_voidage=0.41) == 0.41
    assert balance.voidage_in_balance(1.0, 1.0, drag.wen_yu) == 1.0
    assert balance.reynolds_in_balance(0.0, 0.5, drag.wen_yu) == 0.0


def test_balance_agrees_with_the_closed_forms() -> None:
    for number in (1.0, 1e3, 1e6):
        ours = balance.reynolds_in_balance(number, 0.4, ergun)
        assert ours == pytest.approx(bed.fluidisation_reynolds_ergun(number, 0.4), rel=1e-10)
        alone = balance.reynolds_in_balance(number, 1.0, drag_single.brown_lawler)
        assert alone == pytest.approx(bed.terminal_reynolds_brown_lawler(number), rel=1e-10)
        assert bed.terminal_reynolds_khan_richardson(number) == pytest.approx(alone, rel=0.06)


def test_minimum_fluidisation_of_the_netl_challenge() -> None:
    """Nylon of 3.256 mm in air, measured 1.05 m/s: Ergun at eps = 0.42 to 4 %; Wen & Yu to 10 %."""
    ergun_velocity = balance.fluidising_velocity(3.256e-3, 1131.0, 1.2, 1.8e-5, 0.42, ergun)
    assert ergun_velocity == pytest.approx(1.05, rel=0.04)
    number = 9.81 * 1.2 * (1131.0 - 1.2) * 3.256e-3**3 / 1.8e-5**2
    wen_yu_velocity = bed.fluidisation_reynolds_wen_yu(number) * 1.8e-5 / (1.2 * 3.256e-3)
    assert wen_yu_velocity == pytest.approx(1.05, rel=0.10)


@pytest.mark.parametrize("number", [1e-2, 1.0, 1e2, 1e3, 1e4, 1e5, 1e6])
def test_beds_of_di_felice_expand_like_richardson_and_zaki(number: float) -> None:
    """Within 0.025 of the voidage, from its own terminal velocity."""
    alone = balance.reynolds_in_balance(number, 1.0, drag.di_felice)
    power = bed.exponent_richardson_zaki(bed.terminal_reynolds_brown_lawler(number), 0.0)
    for voidage in (0.5, 0.6, 0.7, 0.8, 0.9):
        expanded = balance.voidage_in_balance(number, alone * voidage**power, drag.di_felice)
        assert expanded == pytest.approx(voidage, abs=0.025)


@pytest.mark.parametrize(("law", "power"), [(drag.wen_yu, 4.65), (drag.di_felice, 4.70)])
def test_exponent_of_creeping_beds(law: Drag, power: float) -> None:
    ratio = balance.reynolds_in_balance(1e-9, 0.6, law) / balance.reynolds_in_balance(1e-9, 1.0, law)
    assert math.log(ratio) / math.log(0.6) == pytest.approx(power, abs=1e-3)


def test_limits_of_the_expansion_exponents() -> None:
    assert bed.exponent_garside(0.0) == pytest.approx(5.1)
    assert bed.exponent_garside(1e9) == pytest.approx(2.7, abs=1e-3)
    assert bed.exponent_khan_richardson(1e14, 0.0) == pytest.approx(2.4, abs=1e-3)
    assert bed.exponent_richardson_zaki(0.1, 0.02) == pytest.approx(4.65 + 0.39)
    assert bed.exponent_khan_richardson(1e4, 0.1) > bed.exponent_khan_richardson(1e4, 0.0)
    for factor in (bed.wall_factor_richardson_zaki, bed.wall_factor_khan_richardson):
        values = [factor(ratio) for ratio in np.linspace(0.0, 0.2, 21)]
        assert values[0] == 1.0
        assert (np.diff(values) < 0.0).all()


def test_limits_of_shear_lift() -> None:
    """Saffman's 1.615 in creeping flow; Mei's factor 0.3314 sqrt(beta) far above it; zero without shear."""
    scale = 3.0 * math.pi / 1.615
    assert lift.saffman_mei(1e-8, 1e-12) * scale / 1e-6 == pytest.approx(1.0, rel=1e-6)
    assert lift.saffman_mei(0.0, 1e-4) * scale / 1e-2 == pytest.approx(1.0, rel=1e-6)
    assert lift.saffman_mei(39.0, 7.8) * scale / math.sqrt(7.8) == pytest.approx(0.3314 * math.sqrt(0.1), rel=0.19)
    assert lift.saffman_mei(100.0, 20.0) * scale / math.sqrt(20.0) == pytest.approx(0.0524 * math.sqrt(10.0))
    assert lift.saffman_mei(10.0, 0.0) == 0.0


def test_limits_of_spin_lift_and_torque() -> None:
    assert lift.magnus(0.0) == 1.0
    assert lift.magnus(1.0 + 1e-12) == pytest.approx(1.0, rel=1e-9)
    assert lift.magnus(1e3) == pytest.approx(0.2, abs=0.001)
    assert lift.torque(32.0) == 1.0
    assert lift.torque(32.0 + 1e-9) == pytest.approx(1.0, abs=0.002)
    # 12.9 / sqrt(Re) + 128.4 / Re of Dennis et al., against 64 pi / Re
    assert lift.torque(1000.0) == pytest.approx((12.9 / math.sqrt(1000.0) + 0.1284) / (0.064 * math.pi), rel=1e-12)


def test_added_mass_of_an_isolated_sphere_is_one_half() -> None:
    assert added_mass.constant(0.3) == added_mass.constant(1.0) == added_mass.zuber(1.0) == 0.5
    for solids in (0.01, 0.001):  # 1/2 (1 + 3 phi) in a dilute suspension
        assert added_mass.zuber(1.0 - solids) == pytest.approx(0.5 * (1.0 + 3.0 * solids), abs=2.0 * solids**2)


KNOWN = {
    "clift": ["force decreases with reynolds at reynolds = 3.5", "jumps by -21 % at reynolds = 4e+05"],  # drag crisis
    "gidaspow": ["jumps by -73 % at voidage = 0.8"],
    "koch_hill": ["jumps by -1 % at voidage = 0.6"],
}


@pytest.mark.parametrize(
    "name", [name for name, entry in REGISTRY["drag"].items() if "closures" in entry.function.__module__]
)
def test_drag_laws_pass_the_check_of_their_kind(name: str) -> None:
    """Except for the jumps and the decrease of the published laws."""
    problems = check(REGISTRY["drag"][name].function)
    assert len(problems) == len(KNOWN.get(name, []))
    for found, expected in zip(problems, KNOWN.get(name, [])):
        assert found.startswith(expected)


def check_new(kind: str, function: Callable[..., float], **ranges: tuple[float, float]) -> list[str]:
    """Problems that the check finds in a new law."""
    function.__name__ = "check_new"
    try:
        return check(law(kind, "test", **ranges)(function))
    finally:
        del REGISTRY[kind]["check_new"]


def test_check_finds_errors_of_user_drag_laws() -> None:
    ranges = {"reynolds": (0.01, 300.0), "voidage": (0.5, 0.9)}
    assert check_new("drag", lambda reynolds, voidage: (1.0 + 0.15 * reynolds**0.687) * voidage**-2.7, **ranges) == []
    assert check_new("drag", lambda reynolds, voidage: (1.0 + 0.15 * reynolds**0.687) * voidage**-3.7) == []
    wrong: list[tuple[Drag, str]] = [
        (lambda reynolds, voidage: 1.15 + 0.15 * reynolds**0.687, "tends to 1.15 for a slow isolated sphere"),
        (lambda reynolds, voidage: 24.0 / reynolds, "at reynolds = 0; the slip velocity"),
        (lambda reynolds, voidage: voidage**2.7, "decreases with solid_fraction"),
        (lambda reynolds, voidage: 1.0 / (1.0 + reynolds * reynolds), "force decreases with reynolds"),
        (lambda reynolds, voidage: 1.0 if voidage > 0.7 else 1.1, "jumps by -9.1 % at voidage = 0.7"),
        (lambda reynolds, voidage: voidage - 1.0, "drag must be positive"),
        (lambda reynolds, voidage: drag_resolved.tenneti(reynolds, voidage) / voidage, "is 2.5 times Ergun's"),
    ]
    for function, problem in wrong:
        found = check_new("drag", function)
        assert any(problem in line for line in found), (problem, found)
    assert "must take" in check_new("drag", lambda speed: 1.0)[0]
    assert "inf" in check_new("drag", lambda reynolds, voidage: math.inf)[0]
    assert "compiled" in check_new("drag", lambda reynolds, voidage: float(str(1.0)))[0]


def test_check_finds_errors_of_other_kinds() -> None:
    assert "outside" in check_new("minimum_gap", lambda roughness: -roughness)[0]
    assert "decreases with approach_speed" in check_new("minimum_gap", lambda approach_speed: 2.0 - approach_speed)[0]
    assert "outside" in check_new("restitution", lambda stokes, restitution: restitution + 0.01 * stokes)[0]
    assert "must be 1/2" in check_new("added_mass", lambda voidage: 1.0 / voidage)[0]
    assert "without shear" in check_new("lift", lambda reynolds, shear_reynolds: 1.0 + shear_reynolds)[0]
    with pytest.raises(KeyError, match="is not a registered law"):
        check(lambda reynolds, voidage: 1.0)


AS_OTHERS: list[tuple[Drag, float, float, float]] = [
    (drag_resolved.beetstra, 1.0, 0.5, 20.53869),  # MFIX, drag_gs.f
    (drag_resolved.beetstra, 100.0, 0.5, 50.41343),
    (drag_resolved.beetstra, 20.0, 0.85, 4.949023),
    (drag.gidaspow, 1.0, 0.5, 17.05556),
    (drag.gidaspow, 100.0, 0.5, 55.55556),
    (drag.gidaspow, 20.0, 0.85, 3.935547),
    (drag.wen_yu, 1.0, 0.5, 14.43635),
    (drag.wen_yu, 100.0, 0.5, 57.10366),
    (drag_resolved.koch_hill, 1.0, 0.5, 20.22893),  # CFDEMcoupling, KochHillDrag.C
    (drag_resolved.koch_hill, 100.0, 0.5, 42.8925),
    (drag_resolved.koch_hill, 20.0, 0.85, 4.584273),
    (drag_resolved.tang, 1.0, 0.5, 21.63961),  # waLBerla, discrete particle methods
    (drag_resolved.tang, 100.0, 0.5, 44.44313),
    (drag_resolved.tang, 20.0, 0.85, 5.334413),
    (drag_resolved.tenneti, 1.0, 0.5, 19.34625),
    (drag_resolved.tenneti, 100.0, 0.5, 40.70708),
    (drag_resolved.tenneti, 20.0, 0.85, 4.686045),
    (drag.di_felice, 1.0, 0.5, 13.79351),  # PhasicFlow, DiFelice and Rong
    (drag.di_felice, 100.0, 0.5, 44.82992),
    (drag.di_felice, 20.0, 0.85, 3.977214),
    (drag_resolved.rong, 1.0, 0.5, 15.82148),
    (drag_resolved.rong, 100.0, 0.5, 46.90914),
    (drag_resolved.rong, 20.0, 0.85, 4.103855),
    (drag_single.brown_lawler, 1.0, 1.0, 1.150002),  # Fluidity, flow past a sphere
    (drag_single.brown_lawler, 100.0, 1.0, 4.471412),
]


@pytest.mark.parametrize(("law", "reynolds", "voidage", "factor"), AS_OTHERS)
def test_drag_equals_that_of_other_codes(law: Drag, reynolds: float, voidage: float, factor: float) -> None:
    """Formulas of public codes, converted to the normal form and evaluated independently."""
    assert law(reynolds, voidage) == pytest.approx(factor, rel=1e-6)


@pytest.mark.parametrize(
    ("reynolds", "shear_reynolds", "factor"), [(1.0, 0.5, 0.1115476), (20.0, 4.0, 0.07743626), (80.0, 16.0, 0.1015869)]
)
def test_shear_lift_equals_that_of_openfoam(reynolds: float, shear_reynolds: float, factor: float) -> None:
    """SaffmanMeiLiftForce, converted to lift over Stokes drag."""
    assert lift.saffman_mei(reynolds, shear_reynolds) == pytest.approx(factor, rel=1e-6)
