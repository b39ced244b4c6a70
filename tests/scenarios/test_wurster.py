"""The Wurster coater: its tube, its inflow, and what counts as circulation and as a pellet that passes the tube."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfddem.case.gallery import gallery
from cfddem.preflight.summary import preflight
from scenarios.beds.wurster import circulation
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
