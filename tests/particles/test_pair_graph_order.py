"""The order in which the pairs of each particle are listed."""

from __future__ import annotations

import numpy as np
import pytest

from cfddem import Material, ParticleSolver, make_particles, pair_table
from cfddem.particles.pair_graph import HOME, _incidence

GLASS = Material(density=2500.0, youngs_modulus=1e7, poisson=0.25)


@pytest.mark.parametrize("near", [0, 1])
def test_every_edge_is_listed_once(near: int) -> None:
    """A pair that may touch, or cannot, and a wall: the wall comes before a far pair and after a near one."""
    ends = np.array([0, 0], np.int32), np.array([1, 0], np.int32), np.full(2, HOME, np.int8)
    start, incident = _incidence(*ends, near, 1, np.arange(2))
    assert start.tolist() == [0, 2, 3]
    assert incident.tolist() == ([0, 1, -1] if near else [1, 0, -1])


@pytest.mark.parametrize("box", [(None, None, None), (0.02, None, None), (0.02, 0.02, None), (0.02, 0.02, 0.02)])
def test_two_spheres_that_touch_are_one_pair_in_any_box(box: tuple[float | None, float | None, float | None]) -> None:
    """Along an open axis no image of the box is another one."""
    spheres = make_particles([(0.005, 0.005, 0.005), (0.0069, 0.005, 0.005)], 1e-3, 2500.0)
    solver = ParticleSolver(spheres, pair_table([GLASS]), box=box)
    assert len(solver.gap) == 1
