"""Closed forms of liquid bridges: against YADE, their limits, and their energies."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cfddem.backend.errors import InputError
from cfddem.particles.interactions.bridge_law import BridgeLaws
from closures import bridge, capillary_pull, numbers, rupture

YADE = Path(__file__).parents[1] / "data" / "yade_capillary.csv"
PULLS = {
    "Willett_analytic": (capillary_pull.willett_pull, capillary_pull.willett_energy),
    "Lambert": (capillary_pull.lambert_pull, capillary_pull.lambert_energy),
    "Rabinovich": (capillary_pull.rabinovich_pull, capillary_pull.rabinovich_energy),
}
Pull = Callable[[float, float, float, float, float], float]
for_each_pull = pytest.mark.parametrize(("pull", "energy"), PULLS.values(), ids=PULLS)
SIGMA, THETA, REDUCED = 0.0728, 0.4, 0.5e-3


def _rows() -> list[dict[str, str]]:
    with YADE.open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def test_pulls_and_rupture_agree_with_yade() -> None:
    """Three volumes and five gaps each, and one pair of unequal spheres; YADE's gap has a rounding error of 1e-19 m."""
    rows = _rows()
    assert len(rows) == 48
    for row in rows:
        value = {name: float(text) for name, text in row.items() if name != "law"}
        reduced = value["radius"] * value["other_radius"] / (value["radius"] + value["other_radius"])
        theta = math.radians(value["contact_angle"])
        pull = PULLS[row["law"]][0](value["surface_tension"], theta, reduced, value["volume"], value["gap"])
        assert pull == pytest.approx(value["pull"], rel=1e-12)
        assert rupture.willett_rupture(theta, reduced, value["volume"]) == pytest.approx(value["rupture"], rel=1e-12)


@for_each_pull
@pytest.mark.parametrize("volume", [1e-15, 1e-13, 1e-12])
def test_the_energy_is_the_integral_of_the_pull(pull: Pull, energy: Pull, volume: float) -> None:
    """Composite rule of Gauss and Legendre, on pieces that grow with the gap."""
    length = math.sqrt(volume / REDUCED)
    ends = np.concatenate([[0.0], np.geomspace(1e-3, 10.0, 60)]) * length
    nodes, weights = np.polynomial.legendre.leggauss(8)
    work = 0.0
    for low, high in pairwise(ends):
        gaps = 0.5 * (high + low) + 0.5 * (high - low) * nodes
        work += (
            0.5 * (high - low) * sum(w * pull(SIGMA, THETA, REDUCED, volume, float(h)) for w, h in zip(weights, gaps))
        )
        assert energy(SIGMA, THETA, REDUCED, volume, float(high)) == pytest.approx(work, rel=1e-9)


@for_each_pull
def test_a_pull_falls_with_the_gap_and_does_not_change_in_overlap(pull: Pull, energy: Pull) -> None:
    gaps = np.linspace(0.0, 1e-4, 200)
    force = [pull(SIGMA, THETA, REDUCED, 1e-13, float(gap)) for gap in gaps]
    assert np.all(np.diff(force) < 0.0)
    assert pull(SIGMA, THETA, REDUCED, 1e-13, -1e-6) == force[0]
    assert energy(SIGMA, THETA, REDUCED, 1e-13, -1e-6) == 0.0
    assert pull(SIGMA, THETA, REDUCED, 1e-13, 1e-8) == pytest.approx(force[0], rel=2e-3), "continuous at contact"


@for_each_pull
def test_a_wall_pulls_twice_as_much_at_contact_as_an_equal_sphere(pull: Pull, energy: Pull) -> None:
    """R* = R at a wall and R/2 between equal spheres; for Rabinovich's law in the limit of a small volume."""
    wall, pair = (pull(SIGMA, THETA, reduced, 1e-24, 0.0) for reduced in (1e-3, 0.5e-3))
    assert wall / pair == pytest.approx(2.0, rel=1e-3)
    assert pair == pytest.approx(2.0 * math.pi * 1e-3 * SIGMA * math.cos(THETA), rel=1e-3)


def test_willett_at_unit_stretch_is_a_fifth_of_the_pull_at_contact() -> None:
    gap = math.sqrt(1e-13 / (2.0 * REDUCED))
    pulls = [capillary_pull.willett_pull(SIGMA, THETA, REDUCED, 1e-13, h) for h in (gap, 0.0)]
    assert pulls[0] / pulls[1] == pytest.approx(1.0 / 4.55, rel=1e-14)


@pytest.mark.parametrize("volume", [1e-15, 1e-12])
def test_share_and_potential_of_a_bridge_of_constant_volume(volume: float) -> None:
    """dL/dh = share/h; the share is 1 at contact, static with H in place of d, and L vanishes far away."""
    length = math.sqrt(volume / (math.pi * REDUCED))
    assert bridge.pitois_share(0.0, REDUCED, volume) == 1.0
    assert bridge.pitois_potential(1e5 * length, REDUCED, volume) == pytest.approx(0.0, abs=1e-20)
    for gap in np.geomspace(1e-6, 30.0, 40) * length:
        edge = math.hypot(gap, length)
        assert bridge.pitois_share(gap, REDUCED, volume) == pytest.approx(bridge.static_share(gap, edge), abs=1e-14)
        above, below = (bridge.pitois_potential(gap * step, REDUCED, volume) for step in (1.0 + 1e-5, 1.0 - 1e-5))
        slope = (above - below) / 2e-5
        assert slope == pytest.approx(bridge.pitois_share(gap, REDUCED, volume), rel=1e-6, abs=1e-10)
        assert below <= above <= 0.0


def test_redistribution_keeps_all_liquid() -> None:
    """Both shares add to one; equal bodies get one half."""
    for law, first, second in (
        (rupture.share_by_radius, 1e-3, 3e-3),
        (rupture.share_by_contact_angle, 0.2, 1.2),
        (rupture.share_by_contact_angle, 0.2, 2.5),
    ):
        assert law(first, second) + law(second, first) == pytest.approx(1.0, rel=1e-15)
        assert law(first, first) == 0.5
    assert rupture.share_by_contact_angle(0.2, 2.5) == 1.0


def test_angles_on_walls_are_those_on_particles_unless_given() -> None:
    laws = BridgeLaws(contact_angle=0.3, wall_contact_angle=1.2, redistribution="contact_angle")
    assert laws.numbers.wall_contact_angle == 1.2
    assert BridgeLaws(contact_angle=0.3).numbers.wall_contact_angle == 0.3
    with pytest.raises(InputError, match="wall_contact_angle"):
        BridgeLaws(wall_contact_angle=4.0).check()


def test_rupture_laws_meet_for_a_small_volume() -> None:
    laws = (rupture.lian_rupture, rupture.willett_rupture)
    lian, willett = (law(THETA, REDUCED, 1e-21) for law in laws)
    assert willett == pytest.approx(lian, rel=2e-5)
    assert rupture.willett_rupture(THETA, REDUCED, 1e-12) > rupture.lian_rupture(THETA, REDUCED, 1e-12)


def test_ennis_is_the_impact_that_its_film_just_stops() -> None:
    """The equation of motion m v dv/dh = -A v/h, integrated in and out: no speed is left at the outer edge."""
    film, roughness, dry = 20e-6, 1e-6, 0.8
    critical = numbers.ennis_critical_stokes(dry, film, roughness)
    steps = {"rtol": 1e-11, "atol": 1e-12}
    arrived = solve_ivp(lambda gap, speed: 1.0 / gap + 0.0 * speed, (film, roughness), [critical], **steps).y[0, -1]
    left = solve_ivp(lambda gap, speed: -1.0 / gap + 0.0 * speed, (roughness, film), [dry * arrived], **steps).y[0, -1]
    assert left == pytest.approx(0.0, abs=1e-8)
    assert numbers.ennis_critical_stokes(dry, roughness, film) == 0.0
