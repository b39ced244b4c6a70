"""One thread for every test that does not ask for more, and the order of the files."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
import rooms  # noqa: F401  tests import each other

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Read when NumPy is first imported. Two workers whose products of small matrices run on all cores wait for each other:
they take five times the processor time."""

LONGEST = (
    "test_gallery", "test_many_bridges", "test_wall_bridges", "test_bridges", "test_docs", "test_coupling_ranks",
    "test_cluster_failures", "test_empty_ranks", "study", "test_wet_wall", "test_golden", "test_ghosts", "test_run",
    "test_wet_beds",
)  # fmt: skip
"""Files that take longest, most of it to compile loops. They come first, so that two workers end together.

The first of them compiles loops of a fluid, the next three those of bridges: two workers do not wait for each other.
"""


COMPILE_THEIR_OWN = (
    "scenarios.collisions.wet_wall.study", "scenarios.collisions.wet_wall.study.sticking_velocity",
    "scenarios.collisions.three_spheres.study",
)  # fmt: skip
"""Examples in docstrings that are slow tests: no plain test shares the loops that they compile, 20 s for each study."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first, and mark examples that are slow."""
    for item in items:
        if item.name in COMPILE_THEIR_OWN:
            item.add_marker(pytest.mark.slow)
    rank = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path.stem, len(rank)))


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> Iterator[None]:
    """Run threaded loops on one thread."""
    from cfddem.backend.compile import use_threads

    before = use_threads(None)
    use_threads(1)
    yield
    use_threads(before)


@pytest.fixture
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages are written without their pictures, which take seconds: for tests of the words on a page."""
    for module in ("report_page", "comparison_page"):
        monkeypatch.setattr(f"cfddem.plotting.{module}.encoded", lambda *_: "")


@pytest.fixture(autouse=True)
def one_thread_again(one_thread: None) -> Iterator[None]:
    """A test that leaves more threads behind would let all later ones compile and run loops for several."""
    from cfddem.backend.compile import use_threads

    yield
    use_threads(1)
