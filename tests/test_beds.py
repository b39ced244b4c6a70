"""Beds: what is read from their runs has known answers on made-up ones; short runs obey published laws."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cfddem.card import card
from cfddem.case import Case
from cfddem.gallery import gallery
from cfddem.report import buoyant_weight
from closures.balance import fluidising_velocity
from closures.bed import exponent_richardson_zaki
from closures.drag import ergun
from scenarios.defluidisation import onsets
from scenarios.gas_bed import mueller, standard_bed, van_wachem
from scenarios.sedimentation import Settling, exponent, in_periodic_box


@pytest.mark.parametrize("name", ["gas-bed", "gas-bed-flat", "defluidisation", "sedimentation"])
def test_no_bed_of_the_gallery_is_refused(name: str) -> None:
    assert card(Case.from_toml(gallery()[name])).colour != "red"


def test_weights_of_measured_beds() -> None:
    """189.6 Pa and 39 g, as published with them."""
    assert buoyant_weight(mueller()) / mueller().column.floor_area == pytest.approx(189.6, rel=1e-3)
    bed = van_wachem()
    mass = bed.particle_count * bed.solid.density * math.pi / 6.0 * bed.bed.diameter**3
    assert mass == pytest.approx(0.039, rel=1e-2)


def test_standard_bed_is_as_described() -> None:
    """24 750 spheres at rest in the column, none deep in another or in a wall, up to 155.8 mm."""
    from scipy.spatial import cKDTree

    case = standard_bed()
    places, radius = np.array(case.bed.positions), 0.5 * case.bed.diameter
    assert case.particle_count == 24_750
    nearest = cKDTree(places).query(places, 2)[0][:, 1]
    assert nearest.min() > 1.98 * radius
    assert (np.minimum(places, np.array(case.column.size) - places) > 0.98 * radius).all()
    assert places[:, 2].max() == pytest.approx(0.1558, abs=1e-4)


def test_exponent_of_an_exact_power_law() -> None:
    known = [Settling(solids, 0.08 * (1.0 - solids) ** 3.2, 0.08) for solids in (0.05, 0.2, 0.4)]
    assert exponent(known) == pytest.approx((3.2, 0.08), rel=1e-12)


def test_onset_of_an_exact_bed_is_the_balance() -> None:
    """Pressure drop by Ergun at voidage 0.42 up to the weight, then the weight: both branches give the balance."""
    case = Case.from_toml(gallery()["defluidisation"], {"laws.drag": "ergun"})
    assert case.fluid is not None and not isinstance(case.bed.inlet_velocity, float)
    balance = fluidising_velocity(1.2e-3, 1000.0, case.fluid.density, case.fluid.viscosity, 0.42, ergun)
    times, speeds = np.array(case.bed.inlet_velocity).T
    time = np.linspace(0.0, times[-1], 300)
    velocity = np.interp(time, times, speeds)

    def pull(speed: np.ndarray) -> np.ndarray:
        numbers = case.fluid.density * speed * case.bed.diameter / case.fluid.viscosity  # type: ignore[union-attr]
        return np.array([number * ergun(number, 0.42) for number in numbers])

    weight = buoyant_weight(case) / case.column.floor_area
    drop = weight * np.minimum(pull(velocity) / pull(np.array([balance])), 1.0)
    history = {"time": time, "pressure_drop": drop, "bed_voidage": np.full(300, 0.42)}
    for onset in onsets(case, history):
        assert onset.balance == pytest.approx(balance, rel=1e-12)
        assert onset.velocity == pytest.approx(balance, rel=1e-6)


@pytest.mark.slow
def test_hindered_settling_follows_richardson_and_zaki() -> None:
    """Exponent within 10 % between solid fractions of 0.1 and 0.3, in water (Trans. Inst. Chem. Eng. 32, 35)."""
    found = [in_periodic_box(share, way=20.0) for share in (0.1, 0.3)]
    reynolds = 1000.0 * found[0].terminal * 5e-4 / 8.9e-4
    assert exponent(found)[0] == pytest.approx(exponent_richardson_zaki(reynolds, 0.0), rel=0.1)
