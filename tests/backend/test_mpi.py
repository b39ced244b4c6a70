"""Sums, extremes and messages between processes under MPI."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cluster import needs_mpi, on_mpi

from cfddem.backend import launch
from cfddem.backend.communicator import SERIAL, Communicator
from cfddem.backend.errors import InputError


def parcel(giver: int, taker: int) -> np.ndarray:
    """Bytes of a length of their own; none from the first to itself."""
    return np.array([giver, taker] * (giver + taker), np.uint8)


def reductions(communicator: Communicator, values: list[np.ndarray]) -> dict[str, Any]:
    """What a rank gets from all calls."""
    rank, mine = communicator.rank, values[communicator.rank]
    incoming = {n: np.zeros((len(each), 2)) for n, each in enumerate(values)}
    communicator.swap({n: np.stack([mine, mine + n], axis=1) for n in range(communicator.size)}, incoming)
    return {
        "sum": communicator.sum(mine),
        "columns": communicator.sum(np.stack([mine[:1], mine[-1:]], axis=1), axis=0),
        "largest": communicator.largest(mine), "smallest": communicator.smallest(mine),
        "nan": communicator.largest([np.nan if rank else 1.0]),
        "any": communicator.any(mine > 2.0), "all": communicator.all(mine > 2.0),
        "count": communicator.count(mine > 0.0), "mean": communicator.mean(mine),
        "big": communicator.sum([2**60 + rank]), "mixed": communicator.largest([] if rank else [3], default=-np.inf),
        "joined": communicator.joined(mine), "gathered": communicator.gathered(np.stack([mine, mine], 1)[::-1]),
        "flags": communicator.joined(mine[:rank] > 0.0),
        "first": communicator.first(f"rank {rank}" if rank else None),
        "broadcast": communicator.broadcast({"from": rank}, 1),
        "exchange": communicator.exchange({n: parcel(rank, n) for n in range(communicator.size)}),
        "beside": communicator.exchange({0: parcel(rank, 0)} if rank == 1 else {}, [[1], [0, 2], [1]][rank]),
        "swap": incoming,
    }  # fmt: skip


@needs_mpi
def test_all_ranks_get_the_bits_of_one_process() -> None:
    """Three parts whose sum by floats depends on the order."""
    draw = np.random.default_rng(1)
    values = [draw.normal(0.0, 1.0, 5), draw.normal(0.0, 1e9, 7)]
    values.append(-values[1][::-1].copy())
    results = on_mpi(3, "test_mpi:reductions", values)
    sums = [np.sum(each) for each in values]
    assert (sums[0] + sums[1]) + sums[2] != sums[0] + (sums[1] + sums[2])
    for rank, each in enumerate(results):
        assert each["sum"] == SERIAL.sum(np.concatenate(values)) == pytest.approx(math.fsum(np.concatenate(values)))
        assert np.array_equal(each["columns"], SERIAL.sum([[v[0], v[-1]] for v in values], axis=0))
        assert each["largest"] == max(v.max() for v in values) and each["smallest"] == min(v.min() for v in values)
        assert np.isnan(each["nan"]) and each["any"] is True and each["all"] is False
        assert each["count"] == sum((v > 0).sum() for v in values)
        assert each["big"] == 3 * 2**60 + 3 and each["mixed"] == 3
        gathered = np.concatenate([np.stack([v, v], 1)[::-1] for v in values]) if rank == 0 else np.zeros((0, 2))
        assert np.array_equal(each["gathered"], gathered)
        assert np.array_equal(each["flags"], np.concatenate([v[:n] > 0.0 for n, v in enumerate(values)]))
        assert np.array_equal(each["joined"], np.concatenate(values)) and each["first"] == "rank 1"
        assert {n: list(got) for n, got in each["beside"].items()} == ({1: [1, 0]} if rank == 0 else {})
        given = {n: list(parcel(n, rank)) for n in range(3) if n + rank}  # rank 0 gives itself nothing
        assert each["broadcast"] == {"from": 1} and {n: list(got) for n, got in each["exchange"].items()} == given
        assert all(
            np.array_equal(got, np.stack([v, v + rank], axis=1)) for got, v in zip(each["swap"].values(), values)
        )


def test_one_process_imports_no_mpi() -> None:
    """Neither the solver, nor a simulation, nor the command line."""
    program = (
        "import sys, cfddem.cli.app, cfddem.run.runner, cfddem.particles.solver\n"
        "from cfddem.backend.launch import communicator\n"
        "assert communicator().size == 1\n"
        "print([name for name in sys.modules if name.split('.')[0] in ('mpi4py', 'petsc4py')])"
    )
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


def test_the_launcher_states_the_number_of_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """MPICH, Open MPI, and Slurm with PMIx; a batch script of Slurm alone starts one process."""
    for name in (*launch.SIZES, "PMIX_RANK"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("SLURM_NTASKS", "8")
    assert launch.launched() == 1 and launch.communicator() is SERIAL
    for name in launch.SIZES:
        with monkeypatch.context() as patch:
            patch.setenv(name, "4")
            assert launch.launched() == 4
    monkeypatch.setenv("SLURM_STEP_NUM_TASKS", "8")
    monkeypatch.setenv("PMIX_RANK", "0")
    assert launch.launched() == 8


def test_several_ranks_without_mpi4py_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """With what to install."""
    monkeypatch.setattr(launch, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"cfddem\[cluster\]"):
        launch.require_mpi4py(2)


def test_options_of_the_launchers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Open MPI needs options for the user root and for more ranks than cores."""
    monkeypatch.setattr(launch, "find_launcher", lambda: Path("/x/mpiexec"))
    monkeypatch.setattr(launch.os, "geteuid", lambda: 0)
    monkeypatch.setattr(launch, "is_open_mpi", lambda _: True)
    many = launch.launch_command(10_000, ["a", "b"], {})
    assert many == ["/x/mpiexec", "--oversubscribe", "--allow-run-as-root", "-n", "10000", "a", "b"]
    monkeypatch.setattr(launch, "is_open_mpi", lambda _: False)
    assert launch.launch_command(3, ["a"], {}) == ["/x/mpiexec", "-n", "3", "a"]
