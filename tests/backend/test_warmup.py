"""The loops of the fluid that another process compiles on a new machine."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from cfddem.backend.compile import prange, threaded, use_threads
from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.run import warmup


@pytest.mark.parametrize("name", ["liquid-bed", "segregation", "spouted-bed"])
def test_one_species_two_and_a_jet_can_be_rehearsed(name: str) -> None:
    """A warmup that fails says nothing; here it would."""
    warmup.warm_up(gallery()[name])
    assert not warmup.is_new()


def test_a_machine_that_has_run_a_fluid_is_not_new(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    case = gallery()["liquid-bed"]
    warmup.warm_up(case)
    assert not warmup.is_new()
    monkeypatch.setattr(subprocess, "Popen", None)  # nothing is started
    with warmup.warmup(case):
        pass
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert warmup.is_new()


@threaded
def compiled(numbers: np.ndarray) -> None:
    for n in prange(len(numbers)):
        numbers[n] *= 2.0


@threaded
def never_called(numbers: np.ndarray) -> None:
    for n in prange(len(numbers)):
        numbers[n] *= 3.0


@pytest.mark.parametrize("threads", [1, use_threads(None)])
def test_the_loop_that_is_sought_in_the_cache_may_have_any_name(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its name in the cache follows from the function, and from whether it runs on one thread."""
    before = use_threads(None)
    use_threads(threads)
    try:
        compiled(np.ones(2))
        monkeypatch.setattr(warmup, "transport", compiled)
        assert not warmup.is_new()
        monkeypatch.setattr(warmup, "transport", never_called)
        assert warmup.is_new()
    finally:
        use_threads(before)


def test_the_other_process_rehearses_the_case_it_reads() -> None:
    case = gallery()["liquid-bed"]
    done = subprocess.run(
        [sys.executable, "-m", "cfddem.run.warmup"], input=case.to_toml().encode(), capture_output=True,
        env=os.environ | {"NUMBA_NUM_THREADS": "1"},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, b"")


def test_the_other_process_is_given_the_case_and_stopped(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """It lives as long as what it stands beside, and its own end disturbs nobody."""
    started, start = [], subprocess.Popen
    stand_in = "import pathlib, sys, time; pathlib.Path(sys.argv[1]).write_text(sys.stdin.read()); time.sleep(60)"

    def watched(words: list[str], **more: object) -> subprocess.Popen[bytes]:
        assert words == [sys.executable, "-P", "-m", "cfddem.run.warmup"]
        started.append(start([sys.executable, "-c", stand_in, str(tmp_path / "case.toml")], **more))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", watched)
    monkeypatch.setattr(warmup, "is_new", lambda: True)
    monkeypatch.setattr(warmup, "_cores", lambda: 2)
    case = gallery()["liquid-bed"]
    with warmup.warmup(case):
        assert started[0].poll() is None
        while not (tmp_path / "case.toml").exists() or not (tmp_path / "case.toml").read_text():
            time.sleep(0.05)
    assert started[0].poll() is not None
    assert Case.from_toml(tmp_path / "case.toml") == case
