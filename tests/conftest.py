"""One thread for every test that does not ask for more, and the order of the files."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import pytest
import rooms  # noqa: F401  tests import each other

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Read when NumPy is first imported. Two workers whose products of small matrices run on all cores wait for each other:
they take five times the processor time."""

ROOMS = (
    "particles", "collisions", "closures", "package", "cli", "studies", "analysis", "io", "plotting", "preflight",
    "backend", "run", "case", "scenarios", "features", "fluid", "coupling",
)  # fmt: skip
"""Order of the folders: loops of particles first, those of the fluid last, and between them tests that compile little.

Two workers begin at the two ends and meet between them. What several loops have in common is compiled in each process
that compiles one of them: loops of nine files of contacts, films and bridges took 1.4 times as long to compile in two
mixed workers as in one process.
"""


COMPILE_THEIR_OWN = (
    "scenarios.collisions.wet_wall.study", "scenarios.collisions.wet_wall.study.sticking_velocity",
    "scenarios.collisions.three_spheres.study",
)  # fmt: skip
"""Examples in docstrings that are slow tests: no plain test shares the loops that they compile, 20 s for each study."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put tests in the order of their folders, and mark examples that are slow."""
    for item in items:
        if item.name in COMPILE_THEIR_OWN:
            item.add_marker(pytest.mark.slow)
    items.sort(key=lambda item: min(_places(item), default=len(ROOMS) // 2))


def _places(item: pytest.Item) -> list[int]:
    """Places in the order of the folders in which a test lies."""
    return [ROOMS.index(name) for name in item.path.relative_to(item.config.rootpath).parts if name in ROOMS]


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Let the first worker take files from the front, and the others from the back."""
    from xdist.scheduler import LoadFileScheduling

    class FromBothEnds(LoadFileScheduling):
        def _assign_work_unit(self, node: Any) -> None:
            if node is not self.nodes[0]:
                self.workqueue.move_to_end(next(reversed(self.workqueue)), last=False)
            super()._assign_work_unit(node)

    return FromBothEnds(config, log) if config.getvalue("dist") == "loadfile" else None


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
    monkeypatch.setattr("cfddem.plotting.report_page.encoded", lambda *_: "")


@pytest.fixture(autouse=True)
def one_thread_again(one_thread: None) -> Iterator[None]:
    """A test that leaves more threads behind would let all later ones compile and run loops for several."""
    from cfddem.backend.compile import use_threads

    yield
    use_threads(1)
