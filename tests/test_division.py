"""Division of space among ranks: slabs with equally many particles, ghosts of near slabs, and planes that move."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from in_process_ranks import on_ranks
from test_ghosts import STEP, assert_same_bits, finished, joined, settings, state

from cfddem.backend.communicator import Communicator
from cfddem.particles.ghosts import IMBALANCE, Slabs

OPEN = np.full(3, np.inf)


@pytest.mark.parametrize("ranks", [2, 3, 7])
def test_balanced_slabs_hold_equally_many_particles(ranks: int) -> None:
    """Of a cloud that is much denser on one side; each rank knows a part of it."""
    places = np.random.default_rng(1).uniform(0.0, 1.0, (30_000, 3)) ** 3
    whole = Slabs.balanced(1, places, ranks)
    counts = np.bincount(whole.owner(places), minlength=ranks)
    assert counts.sum() == 30_000 and counts.max() < IMBALANCE * counts.mean()
    assert np.all(np.diff(whole.planes) > 0.0)
    parts = on_ranks(3, lambda rank: Slabs.balanced(1, places[rank.rank :: 3], ranks, rank))
    assert all(np.array_equal(each.planes, whole.planes) for each in parts)


def test_near_slabs_are_those_within_reach() -> None:
    """Across several thin slabs, and across a periodic border."""
    slabs = Slabs(0, [0.1, 0.15, 0.2, 0.8])
    assert slabs.near(1, 0.04, OPEN) == [0, 2]
    assert slabs.near(0, 0.06, OPEN) == [1, 2]
    assert slabs.near(4, 0.05, OPEN) == [3]
    assert slabs.near(4, 0.05, np.array([1.0, 1.0, 1.0])) == [0, 3]
    assert slabs.near(4, 0.12, np.array([1.0, 1.0, 1.0])) == [0, 1, 3]


@pytest.mark.slow
def test_planes_follow_the_particles_and_bits_stay() -> None:
    """All particles begin on one rank of three; another has none."""
    spheres, given = settings(True, True)

    def program(communicator: Communicator) -> tuple[dict[str, np.ndarray], int]:
        division = Slabs(0, [1e-4, 1.0])
        run = finished(spheres.copy(), given, 0, communicator=communicator, division=division, balance=True)
        run.advance(STEP, 200)
        return state(run), run.particles.owned

    whole = finished(spheres.copy(), given, 0)
    whole.advance(STEP, 200)
    results = on_ranks(3, program)
    counts = np.array([owned for _, owned in results])
    assert counts.sum() == spheres.count and counts.max() < 1.2 * counts.mean()
    assert_same_bits(joined([each for each, _ in results]), joined([state(whole)]))


def test_a_rank_without_particles_changes_nothing() -> None:
    """The planes stay where they are."""
    spheres, given = settings(True, False)

    def program(communicator: Communicator) -> tuple[dict[str, np.ndarray], int]:
        division = Slabs(1, [10.0])
        run = finished(spheres.copy(), given, 150, communicator=communicator, division=division)
        return state(run), run.particles.owned

    results = on_ranks(2, program)
    assert [owned for _, owned in results] == [spheres.count, 0]
    assert_same_bits(joined([each for each, _ in results]), joined([state(finished(spheres.copy(), given, 150))]))
