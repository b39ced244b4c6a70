"""Drag and bed laws: their limits, their switches, and published numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from closures import bed, drag, drag_resolved, drag_single
from closures.drag import ergun

DATA = Path(__file__).parents[1] / "scenarios" / "data"
Drag = Callable[[float, float], float]
SINGLE: list[Drag] = [drag_single.stokes, drag_single.schiller_naumann, drag_single.abraham, drag_single.brown_lawler]
BEDS: list[Drag] = [drag.wen_yu, drag_resolved.koch_hill, drag_resolved.beetstra]
BEDS += [drag_resolved.tang]
DALLAVALLE: list[Drag] = [drag_single.dallavalle, drag.di_felice]


@pytest.mark.parametrize("law", SINGLE + BEDS)
def test_a_slow_sphere_alone_feels_stokes_drag(law: Drag) -> None:
    assert law(1e-9, 1.0) == pytest.approx(1.0, abs=1e-4)
    assert law(0.0, 1.0) == 1.0


@pytest.mark.parametrize("law", DALLAVALLE)
def test_laws_on_dallavalle_are_four_percent_below_stokes(law: Drag) -> None:
    assert law(0.0, 1.0) == pytest.approx(0.96)


@pytest.mark.parametrize("law", [drag.gidaspow, drag.gidaspow_smooth])
@pytest.mark.parametrize("reynolds", [1e-3, 1e4])
def test_gidaspow_is_ergun_in_dense_beds(law: Drag, reynolds: float) -> None:
    assert law(reynolds, 0.42) == pytest.approx(ergun(reynolds, 0.42), rel=5e-3)


@pytest.mark.parametrize("law", [drag_resolved.koch_hill, drag_resolved.beetstra])
def test_creeping_dense_beds_lie_near_ergun(law: Drag) -> None:
    """Carman's constant of the simulations is 180 against Ergun's 150: up to 30 %."""
    assert law(0.0, 0.4) == pytest.approx(ergun(0.0, 0.4), rel=0.3)


@pytest.mark.parametrize("law", [*SINGLE, *BEDS, *DALLAVALLE[:2], ergun, drag.gidaspow])
def test_drag_rises_with_reynolds_number_and_crowding(law: Drag) -> None:
    for voidage in (0.45, 0.6, 0.75, 0.9):
        values = [law(reynolds, voidage) for reynolds in np.geomspace(1e-3, 300.0, 60)]
        assert (np.diff(values) >= -1e-12).all(), voidage
    for reynolds in (0.01, 1.0, 10.0):
        values = [law(reynolds, voidage) for voidage in np.linspace(0.79, 0.45, 40)]
        assert (np.diff(values) >= -1e-12).all(), reynolds


def test_published_jumps_have_their_published_size() -> None:
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
    """Both laws are 7 % fast against the experiment; the datum is good to about 3 %."""
    viscosity, galileo, speed = 8.9e-7, 49.14, 0.0741
    assert law(galileo**2) * viscosity / 0.5e-3 == pytest.approx(speed, rel=limit)


@pytest.mark.parametrize("number", [1e-2, 1.0, 1e2, 1e4, 1e6])
def test_terminal_velocity_balances_weight_and_drag(number: float) -> None:
    for root, law in [
        (bed.terminal_reynolds_abraham(number), drag_single.abraham),
        (bed.terminal_reynolds_brown_lawler(number), drag_single.brown_lawler),
    ]:
        assert 18.0 * root * law(root, 1.0) == pytest.approx(number, rel=1e-10)


def test_minimum_fluidisation_balances_weight_and_drag() -> None:
    for number in (1.0, 1e3, 1e6):
        root = bed.fluidisation_reynolds_ergun(number, 0.4)
        assert 18.0 * root * ergun(root, 0.4) / 0.4 == pytest.approx(number, rel=1e-10)
