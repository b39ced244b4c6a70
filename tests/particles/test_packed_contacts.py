"""Contacts of a loose bed are computed for the pairs that touch alone."""

from __future__ import annotations

import numpy as np
from golden.many_particles import swarm

from cfddem import ParticleSolver
from cfddem.particles.interactions.pair_loops import FEW

ALWAYS = 255
"""Steps for which all listed pairs are visited, without asking which of them touch."""


def loose() -> ParticleSolver:
    """Spheres that fly and collide, with so wide a list that it outlasts the run."""
    return swarm(600, solid=0.3, speed=0.35, skin=4e-4)


def test_all_pairs_and_those_that_touch_give_the_same_bits() -> None:
    """Contacts begin and end while the list lasts; what has ended is forgotten, and few of the pairs touch."""
    packed, whole = loose(), loose()
    touched, parted = np.zeros(len(packed.edges.force), bool), 0
    for _ in range(12):
        whole.system.packed.wait[:] = ALWAYS
        packed.advance(1e-6, 10)
        whole.advance(1e-6, 10)
        assert (packed.system.packed.wait == 0).all()
        touches = packed.edges.force.any(axis=1)
        parted += int((touched & ~touches).sum())
        touched = touches
        for name in ("force", "couple", "spring"):
            assert np.array_equal(packed.edges[name], whole.edges[name])
        for name in ("position", "velocity", "spin"):
            assert np.array_equal(packed.particles[name], whole.particles[name])
    assert packed.lists.made == whole.lists.made == 0
    assert parted > 10
    assert 0 < touched.sum() < FEW * len(touched)
