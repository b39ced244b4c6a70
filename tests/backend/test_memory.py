"""Memory that the arrays of a run give back."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from cfddem.backend.launch import keep_freed_memory


def test_the_memory_of_a_freed_array_is_kept_for_the_next() -> None:
    """The system clears no pages for arrays that follow one another."""
    if not keep_freed_memory():
        pytest.skip("the C library cannot keep memory")
    import resource

    def faults() -> int:
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

    np.ones(10**6)
    before = faults()
    for _ in range(20):
        np.ones(10**6)
    assert faults() - before < 10**6 * 8 // 4096  # pages of one of the arrays


def test_only_linux_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    assert not keep_freed_memory()
