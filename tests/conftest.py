"""One thread for every test that does not ask for more, so that tests run alike on a busy machine."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> Iterator[None]:
    """Run threaded loops on one thread."""
    from cfddem.backend.compile import use_threads

    before = use_threads(None)
    use_threads(1)
    yield
    use_threads(before)
