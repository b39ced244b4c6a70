"""The number of threads of a run."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import call

from cfddem.backend.errors import InputError
from cfddem.case.gallery import gallery_files
from cfddem.case.schema import Case
from cfddem.run.warmup import threads_for


@pytest.mark.parametrize(
    ("name", "changes", "expected"),
    [
        ("liquid-bed", {}, 1),
        ("liquid-bed", {"bed.count": 20_000}, None),
        ("liquid-bed", {"column.cell": 0.0005}, None),
        ("hopper", {}, 1),
        ("gas-bed-flat", {}, None),
    ],
)
def test_small_cases_take_one_thread(name: str, changes: dict[str, float], expected: int | None) -> None:
    assert threads_for(Case.from_toml(gallery_files()[name], changes), None) == expected


def test_what_the_user_asks_for_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int | None] = []

    def refuse(*_: object, **__: object) -> None:
        raise InputError("run", None, "never begun here")

    monkeypatch.setattr("cfddem.backend.compile.use_threads", asked.append)
    monkeypatch.setattr("cfddem.run.runner.Run.begin", refuse)
    monkeypatch.setattr("cfddem.run.warmup.is_new", lambda: False)
    for words in ((), ("--threads", "2")):
        assert call("run", "liquid-bed", "-o", str(tmp_path / "bed"), *words).code == 2
    assert asked == [1, 2]
