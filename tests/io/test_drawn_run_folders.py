"""Run folders with damage that is drawn at random: each command answers in lines of its own, without a traceback."""

from __future__ import annotations

import json
import logging
import shutil
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest import mock

import h5py
import numpy as np
import pytest
from command_line import call
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from made_up_run import made_up

import cfddem
from cfddem.backend.errors import CfddemError, InputError

COMMANDS = (
    "report run", "report run --json", "compare run sound", "export run --to csv -o out.csv", "resume run --until 3",
    "view run", "view run --history", "view run --waves", "run --from run --set until=3 -o other", "dataset",
)  # fmt: skip

NUMBERS = st.one_of(st.integers(-(2**70), 2**70), st.floats(), st.sampled_from([0, 1, -1, 1e300, 10**400]))
VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), NUMBERS, st.text(max_size=20)),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
SHAPES = st.lists(st.integers(0, 5), max_size=4).map(tuple)
KINDS = st.sampled_from(["f4", "f8", "i8", "u1", "?", "c8", "S5"])

Spoil = Callable[[Path], None]

DRAWN: Counter[str] = Counter()
"""How often each command has run."""


def at_a_place(values: Any, places: list[int], new: Any) -> Any:
    """Nested values with one of them replaced; each number chooses the way down."""
    if not places or not isinstance(values, dict | list) or not values:
        return new
    keys = list(values) if isinstance(values, dict) else list(range(len(values)))
    key = keys[places[0] % len(keys)]
    values[key] = at_a_place(values[key], places[1:], new)
    return values


@st.composite
def in_about(draw: Any) -> Spoil:
    """Another value somewhere in `run.json`."""
    places, new = draw(st.lists(st.integers(0, 40), max_size=4)), draw(VALUES)

    def spoil(folder: Path) -> None:
        path = folder / "run.json"
        path.write_text(json.dumps(at_a_place(json.loads(path.read_text()), places, new)))

    return spoil


@st.composite
def in_the_case(draw: Any) -> Spoil:
    """Another text somewhere in the case."""
    at, length, new = draw(st.integers(0, 359)), draw(st.integers(0, 30)), draw(st.text(max_size=20))

    def spoil(folder: Path) -> None:
        text = (folder / "case.toml").read_text()
        (folder / "case.toml").write_text(text[:at] + new + text[at + length :], errors="surrogatepass")

    return spoil


@st.composite
def in_an_array(draw: Any) -> Spoil:
    """An array of another kind, shape or value, a group in its place, none, or another unit."""
    number, which = draw(st.integers(0, 30)), draw(st.integers(0, 40))
    what = draw(st.sampled_from(["array", "array", "group", "nothing", "unit"]))
    shape, kind, value, unit = (
        draw(SHAPES),
        draw(KINDS),
        draw(st.sampled_from([0.0, np.nan, np.inf, -1.0, 1e30])),
        draw(st.one_of(st.text(max_size=5).filter(lambda text: "\0" not in text), st.integers(0, 9))),
    )

    def spoil(folder: Path) -> None:
        files = sorted([*folder.rglob("*.h5")])
        with h5py.File(files[number % len(files)], "r+") as file:
            names: list[str] = []
            file.visit(names.append)
            name = names[which % len(names)]
            if what == "unit":
                file[name].attrs["unit"] = unit
                return
            del file[name]
            if what == "array":
                with np.errstate(all="ignore"):
                    file[name] = np.full(shape, value).astype(kind) if kind != "S5" else np.full(shape, b"text")
            elif what == "group":
                file.create_group(name)

    return spoil


@st.composite
def in_a_file(draw: Any) -> Spoil:
    """A file that is shorter, that has other bytes, or that is a folder, empty or missing."""
    number, share, what = (
        draw(st.integers(0, 20)),
        draw(st.floats(0, 1)),
        draw(st.sampled_from(["cut", "bytes", "folder", "gone"])),
    )
    new = draw(st.binary(min_size=1, max_size=16))

    def spoil(folder: Path) -> None:
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        path = files[number % len(files)]
        old = path.read_bytes()
        at = int(share * len(old))
        path.unlink()
        if what == "folder":
            path.mkdir()
        elif what != "gone":
            path.write_bytes(old[:at] if what == "cut" else old[:at] + new + old[at + len(new) :])

    return spoil


SPOILS = st.lists(st.one_of(in_about(), in_the_case(), in_an_array(), in_a_file()), min_size=1, max_size=2)


def answers(command: str, spoils: list[Spoil], sound: Path, home: Path) -> None:
    """Spoil a copy of a run; the command ends with a code of its own, and its errors say what is wrong."""
    shutil.rmtree(home / "run", ignore_errors=True)
    shutil.copytree(sound, home / "run")
    for spoil in spoils:
        with suppress(OSError, KeyError, ValueError, RuntimeError, IndexError, ZeroDivisionError):  # already spoilt
            spoil(home / "run")
    DRAWN[command] += 1
    if command == "dataset":
        pytest.importorskip("xarray")
        with suppress(CfddemError):
            cfddem.open_run(home / "run").dataset().load()
        return
    shutil.rmtree(home / "other", ignore_errors=True)
    with mock.patch("cfddem.run.runner.Simulation", side_effect=InputError("run", None, "not begun here")):
        done = call(*command.split())
    assert done.code in (0, 2, 3), done
    assert "Traceback" not in done.err, done
    assert done.code == 0 or done.err.startswith("cfddem: ") or '"error"' in done.out, done


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_up(tmp_path_factory.mktemp("drawn") / "sound", rows=101)


def test_a_missing_snapshot_is_warned_of_in_a_line_of_the_program(sound: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(sound.parent)
    monkeypatch.setattr(logging.root, "handlers", [])  # as outside of tests
    shutil.copytree(sound, "gap")
    Path("gap/data/00000001.h5").unlink()
    done = call("compare", "gap", "sound")
    assert done.err.startswith("cfddem: warning: gap/data: 1 snapshots are missing: 00000001.h5\n"), done


@pytest.mark.slow
@settings(max_examples=500, deadline=None, database=None, phases=[Phase.generate], suppress_health_check=[*HealthCheck])
@given(command=st.sampled_from(COMMANDS), spoils=SPOILS)
def test_no_drawn_run_folder_ends_in_a_traceback(
    command: str, spoils: list[Spoil], sound: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(sound.parent)
    answers(command, spoils, sound, sound.parent)
