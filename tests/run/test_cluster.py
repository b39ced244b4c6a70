"""Runs on several ranks under MPI have the bits of a run in one process."""

from __future__ import annotations

from functools import cache
from typing import Any

import cluster_runs
import numpy as np
import pytest
from cluster import needs_mpi, on_mpi
from test_ghosts import assert_same_bits, joined

from cfddem.backend.communicator import SERIAL

pytestmark = needs_mpi


@cache
def alone(kind: str, count: int, steps: int) -> dict[str, np.ndarray]:
    """Particles and pairs of a run in one process."""
    return joined([cluster_runs.bed(SERIAL, kind, count, steps)["state"]])


def shared(ranks: int, *case: Any) -> tuple[dict[str, np.ndarray], int, int]:
    """Particles and pairs of a run on ranks, particles that changed rank, and lists."""
    parts = on_mpi(ranks, "cluster_runs:bed", *case, timeout=1200.0)
    return joined([each["state"] for each in parts]), sum(each["arrived"] for each in parts), parts[0]["lists"]


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=[pytest.mark.slow] * (kind != "moving_mesh")) for kind in cluster_runs.KINDS],
)
def test_two_ranks_have_the_bits_of_one(kind: str) -> None:
    """Every field of particles and pairs, one of a user among them; particles change ranks several times."""
    found, moved, lists = shared(2, kind, 600, 200)
    assert moved > 10 and lists > 5
    assert_same_bits(found, alone(kind, 600, 200))


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [2, 3, 4])
@pytest.mark.parametrize("kind", cluster_runs.KINDS)
def test_many_ranks_have_the_bits_of_one(kind: str, ranks: int) -> None:
    """10 000 particles, 500 steps."""
    found, moved, lists = shared(ranks, kind, 10_000, 500)
    assert moved > 50 and lists > 5
    assert_same_bits(found, alone(kind, 10_000, 500))


@pytest.mark.parametrize("without", [pytest.param("film", marks=pytest.mark.slow), "memory"])
def test_an_exchange_that_is_left_out_is_noticed(without: str) -> None:
    """Velocities between kick and film impulses; memories of pairs that change rank."""
    kind = "film" if without == "film" else "dry"
    found, moved, _ = shared(2, kind, 600, 200, without)
    assert moved > 10
    with pytest.raises(AssertionError, match=r"^(velocity|position)"):
        assert_same_bits(found, alone(kind, 600, 200))
