"""Division of space among ranks: bricks with equally many particles, ghosts of near bricks, and planes that move."""

from __future__ import annotations

import numpy as np
import pytest
from in_process_ranks import on_ranks
from test_ghosts import STEP, assert_same_bits, finished, joined, settings, state

from cfddem.backend.communicator import Communicator
from cfddem.particles.bricks import Bricks

OPEN = np.full(3, np.inf)


@pytest.mark.parametrize("shape", [(1, 2, 1), (1, 7, 1), (3, 2, 2), (4, 4, 4)])
def test_balanced_bricks_have_equal_work(shape: tuple[int, int, int]) -> None:
    """Of a heap in one corner, whose parts differ along every axis; each rank knows a part of it."""
    draw, ranks = np.random.default_rng(1), int(np.prod(shape))
    places = draw.uniform(0.0, 1.0, (30_000, 3)) ** 2
    places = places[places.sum(axis=1) < 1.0]
    work = draw.integers(1, 20, len(places))
    whole = Bricks.balanced(shape, places, work=work)
    shares = np.bincount(whole.owner(places), weights=work, minlength=ranks)
    assert shares.sum() == work.sum() and shares.max() < 1.05 * shares.mean()
    assert all(np.all(np.diff(each, axis=-1) > 0.0) for each in whole.planes)
    parts = on_ranks(3, lambda rank: Bricks.balanced(shape, places[rank.rank :: 3], rank, work[rank.rank :: 3]))
    assert all(np.array_equal(*planes) for each in parts for planes in zip(each.planes, whole.planes))


def test_a_brick_owns_what_lies_between_its_ends() -> None:
    """Planes differ from layer to layer and from column to column; near bricks are those whose ends are near."""
    places = np.random.default_rng(4).uniform(0.0, 1.0, (4000, 3)) ** 2
    bricks = Bricks.balanced((3, 2, 4), places)
    low, high = bricks.ends
    inside = ((places[:, None] >= low) & (places[:, None] < high)).all(axis=2)
    assert (inside.sum(axis=1) == 1).all() and np.array_equal(inside.argmax(axis=1), bricks.owner(places))
    for rank in range(24):
        apart = np.maximum(low - high[rank], low[rank] - high).max(axis=1)
        assert bricks.near(rank, 0.05, OPEN) == [n for n in range(24) if n != rank and apart[n] < 0.05]


def test_near_slabs_are_those_within_reach() -> None:
    """Across several thin slabs, and across a periodic border."""
    slabs = Bricks.slabs(0, [0.1, 0.15, 0.2, 0.8])
    assert slabs.near(1, 0.04, OPEN) == [0, 2]
    assert slabs.near(0, 0.06, OPEN) == [1, 2]
    assert slabs.near(4, 0.05, OPEN) == [3]
    assert slabs.near(4, 0.05, np.array([1.0, 1.0, 1.0])) == [0, 3]
    assert slabs.near(4, 0.12, np.array([1.0, 1.0, 1.0])) == [0, 1, 3]


def test_near_bricks_are_those_within_reach_along_every_axis() -> None:
    """26 of 27 in the middle, 7 of 8 at a corner; over the borders of a periodic box; rows by their distance."""
    thirds = (1.0, 2.0)
    bricks = Bricks((thirds, thirds, thirds))
    assert bricks.near(13, 0.1, OPEN) == [n for n in range(27) if n != 13]
    assert bricks.near(0, 0.1, OPEN) == [1, 3, 4, 9, 10, 12, 13]
    assert bricks.near(0, 0.1, np.array([3.0, np.inf, np.inf])) == [1, 3, 4, 9, 10, 12, 13, 18, 19, 21, 22]
    places = np.random.default_rng(2).uniform(0.0, 3.0, (5000, 3))
    assert np.array_equal(bricks.owner(places), (places.astype(int) * (9, 3, 1)).sum(axis=1))
    for rank, rows in zip((4, 13), bricks.rows_near((4, 13), places, 0.1, OPEN)):
        low = np.array(np.unravel_index(rank, (3, 3, 3)), float)
        beyond = np.maximum(low - places, places - low - 1.0).max(axis=1)
        assert np.array_equal(rows, np.flatnonzero(beyond < 0.1))


def test_the_shape_follows_the_particles() -> None:
    """A cube, a long box, a flat bed; what all ranks own is all there is."""
    uniform = np.random.default_rng(3).uniform(0.0, 1.0, (20_000, 3))
    assert Bricks.of_least_work(8, uniform, 0.02).shape == (2, 2, 2)
    assert Bricks.of_least_work(8, uniform * (9.0, 1.0, 1.0), 0.02).shape == (8, 1, 1)
    assert Bricks.of_least_work(4, uniform * (1.0, 1.0, 0.1), 0.02).shape == (2, 2, 1)
    assert Bricks.of_least_work(27, uniform, 0.02).work(uniform, 0.0) < 1.1
    assert Bricks.of_least_work(4, uniform[:1], 0.02).shape[2] == 1  # all planes at one place


@pytest.mark.slow
@pytest.mark.parametrize(
    "division", [Bricks.slabs(0, [1e-4, 1.0]), Bricks(([1e-4], [1.0], ()))], ids=["slabs", "bricks"]
)
def test_planes_follow_the_particles_and_bits_stay(division: Bricks) -> None:
    """All particles begin on one rank of three or four; the others have none."""
    spheres, given = settings(True, True)

    def program(communicator: Communicator) -> tuple[dict[str, np.ndarray], int]:
        run = finished(spheres.copy(), given, 0, communicator=communicator, division=division, balance=True)
        run.advance(STEP, 200)
        return state(run), run.particles.owned

    whole = finished(spheres.copy(), given, 0)
    whole.advance(STEP, 200)
    results = on_ranks(int(np.prod(division.shape)), program)
    counts = np.array([owned for _, owned in results])
    assert counts.sum() == spheres.count and counts.max() < 1.2 * counts.mean()
    assert_same_bits(joined([each for each, _ in results]), joined([state(whole)]))


@pytest.mark.slow
def test_a_rank_without_particles_changes_nothing() -> None:
    """The planes stay where they are."""
    spheres, given = settings(True, False)

    def program(communicator: Communicator) -> tuple[dict[str, np.ndarray], int]:
        division = Bricks.slabs(1, [10.0])
        run = finished(spheres.copy(), given, 150, communicator=communicator, division=division)
        return state(run), run.particles.owned

    results = on_ranks(2, program)
    assert [owned for _, owned in results] == [spheres.count, 0]
    assert_same_bits(joined([each for each, _ in results]), joined([state(finished(spheres.copy(), given, 150))]))
