"""The Wurster coater: its tube, its inflow, and what counts as circulation and as a pellet that passes the tube."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfddem.case.gallery import gallery
from cfddem.preflight.summary import preflight
from scenarios.beds.wurster import circulation, coating
from scenarios.beds.wurster.study import tube_of


def test_the_tube_has_its_area_in_cells_and_the_annulus_is_below_minimum_fluidisation():
    case = gallery()["wurster"]
    rows = {row.name: row.value for row in preflight(case).rows}
    assert rows["wall 0: area by its cells"] == pytest.approx(1.0, abs=0.011)
    assert case.patch["annulus"].highest < 0.6 * rows["u_mf"]
    assert not [each for each in preflight(case).issues if each.severity == "error"]


def test_circulation_counts_what_rises_and_falls_beside_the_inner_part_and_who_changes_sides():
    """Four pellets: one rises in the tube, one falls around it, one passes the wall, one is above the tube."""
    case = gallery()["wurster"]
    tube = tube_of(case)
    x, low, length = tube.point[0], tube.point[2], tube.length
    level = low + 0.5 * length
    places = np.array([[x, x, level], [x + 0.04, x, level], [x + 0.01, x, level], [x, x, low + 1.2 * length]])
    speeds = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -0.5], [0.0, 0.0, 0.2], [0.0, 0.0, 3.0]])
    after = places.copy()
    after[2, 0] = x + 0.03
    states = [{"position": each, "velocity": speeds, "id": np.array([3, 1, 0, 2])} for each in (places, after)]
    found = circulation(SimpleNamespace(times=np.array([0.0, 0.01]), particles=lambda n: states[n]), case)
    assert found.rising == pytest.approx(np.array([1.2, 1.0]) / (0.5 * length))
    assert found.falling == pytest.approx(np.array([0.5, 0.3]) / (0.5 * length))
    assert found.velocity == pytest.approx([0.6, 1.0]) and found.crossings == 1


def test_the_spray_lies_in_the_tube_and_coating_counts_who_passes_it():
    """Of four pellets one rises through the spray between two snapshots, one stays in it, one stays beside it, and one
    is at the height of its tip."""
    case = gallery()["wurster"]
    assert case.spray and case.spray.nozzle == (0.048, 0.048, 0.0) and case.spray.direction == (0.0, 0.0, 1.0)
    reach = case.spray.length * np.tan(np.radians(0.5 * case.spray.angle))
    assert reach < tube_of(case).radius and tube_of(case).point[2] < case.spray.length < case.column.height
    x, top = 0.048, case.spray.length
    before = np.array([[x, x, top], [x, x, top / 2], [x + 0.03, x, top / 2], [x + 0.03, x, 0.0]])
    passes = np.array([[x - 0.02, x, top / 2], *before[1:]])
    after = np.array([[x + 0.02, x, top / 2], *before[1:]])
    liquid = [np.zeros(4), np.zeros(4), np.array([3.0, 0.0, 2.0, 1.0])]
    states = [
        {"position": each, "id": np.arange(4), "liquid_carried": carried}
        for each, carried in zip((passes, passes, after), liquid)
    ]
    history = {"liquid_sprayed": np.array([1.0, 6.0]), "liquid_missed": np.array([0.0, 2.0])}
    times = np.array([0.1, 0.2, 0.3])
    found = coating(SimpleNamespace(times=times, particles=lambda n: states[n], history=history), case)
    width = top * np.tan(np.radians(0.5 * case.spray.angle))  # of the spray half way up, on the path of 0.04 m
    assert found.reached == 0.5 and found.visits == pytest.approx(0.25 / 0.1)
    assert found.residence == pytest.approx(0.1 + 0.1 * width / 0.04, abs=0.1 / 20)
    assert found.missed == pytest.approx(0.25) and found.half_on == 0.25 and found.wet == 0.75
    assert found.variation == pytest.approx(np.sqrt(1.25) / 1.5)


def test_the_air_can_carry_the_spray_and_the_check_warns_of_large_pellets_alone():
    found = preflight(gallery()["wurster"])
    rows = {row.name: row.value for row in found.rows}
    assert rows["water sprayed / carried"] == pytest.approx(0.42, abs=0.01)
    assert [each.key for each in found.issues if each.severity != "note"] == ["heat.solid_conductivity.pellet"]
