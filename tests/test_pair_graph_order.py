"""The order in which the pairs of each particle are listed."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem.particles.pair_graph import HOME, _incidence


@pytest.mark.parametrize("near", [0, 1])
def test_every_edge_is_listed_once(near: int) -> None:
    """A pair that may touch, or cannot, and a wall: the wall comes before a far pair and after a near one."""
    ends = np.array([0, 0], np.int32), np.array([1, 0], np.int32), np.full(2, HOME, np.int8)
    start, incident = _incidence(*ends, near, 1, np.arange(2))
    assert start.tolist() == [0, 2, 3]
    assert incident.tolist() == ([0, 1, -1] if near else [1, 0, -1])
