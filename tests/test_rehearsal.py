"""The loops of the fluid that another process compiles on a new machine."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from cfddem import rehearsal
from cfddem.case import Case
from cfddem.gallery import gallery


@pytest.mark.parametrize("name", ["liquid-bed", "segregation", "spouted-bed"])
def test_one_species_two_and_a_jet_can_be_rehearsed(name: str) -> None:
    """A rehearsal that fails says nothing; here it would."""
    rehearsal.rehearse(Case.from_toml(gallery()[name]))


def test_a_machine_that_has_run_a_fluid_is_not_new(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    case = Case.from_toml(gallery()["liquid-bed"])
    rehearsal.rehearse(case)
    assert not rehearsal.is_new()
    monkeypatch.setattr(subprocess, "Popen", None)  # nothing is started
    with rehearsal.rehearsal(case):
        pass
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert rehearsal.is_new()


def test_the_other_process_takes_the_case_and_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    """It lives as long as what it stands beside, and its own end disturbs nobody."""
    started, start = [], subprocess.Popen

    def watched(words: list[str], **more: object) -> subprocess.Popen[bytes]:
        started.append(start([sys.executable, "-c", "import sys, time; sys.stdin.read(); time.sleep(60)"], **more))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", watched)
    monkeypatch.setattr(rehearsal, "is_new", lambda: True)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    with rehearsal.rehearsal(Case.from_toml(gallery()["liquid-bed"])):
        assert started[0].poll() is None
    assert started[0].poll() is not None
