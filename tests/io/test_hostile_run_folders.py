"""Run folders that somebody else has made, with sizes that no run has."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from command_line import call
from made_up_run import made_up

from cfddem.backend.errors import CfddemError, RunFailed
from cfddem.io import checkpoint, files
from cfddem.io.reading import open_run
from cfddem.io.writer import RunFolder

ROWS = 10**12


def enlarged(path: Path, name: str, *further: int) -> None:
    """Replace an array by one of 1e12 rows, of which the file stores nothing."""
    with h5py.File(path, "r+") as file:
        del file[name]
        file.create_dataset(name, (ROWS, *further), "f4", chunks=(2**20, *further), compression="gzip")
    assert path.stat().st_size < 200_000


def enlarge_history(folder: Path) -> str:
    enlarged(folder / "history.h5", "bed_height")
    return "history.h5: the file is damaged (bed_height has 1000000000000 values, 4e+12 bytes; a file of "


def enlarge_snapshot(folder: Path) -> str:
    for path in (folder / "data").glob("*.h5"):
        enlarged(path, "particles/Points", 3)
    return ".h5: the file is damaged (particles/Points has 1000000000000 x 3 values, 1.2e+13 bytes; a file of "


def enlarge_fluid(folder: Path) -> str:
    for path in (folder / "data").glob("*.h5"):
        enlarged(path, "fluid/voidage", 12, 4, 4)
    return ".h5: the file is damaged (fluid/voidage has 1000000000000 x 12 x 4 x 4 values, 7.68e+14 bytes; a file of "


def nest(folder: Path) -> str:
    (folder / "run.json").write_text("[" * 100_000)
    return "run.json: the file is damaged (maximum recursion depth exceeded"


def one_line(text: str) -> str:
    """The only line of an error, whether it is wrapped or not."""
    assert text.startswith("cfddem: ") and text.count("\n") == 1 and len(text) < 400, text
    return text


READ_BY = {
    "report run": (enlarge_history, nest),
    "compare run sound": (enlarge_history, nest),
    "export run": (enlarge_snapshot, enlarge_fluid, nest),
    "resume run": (enlarge_history, nest),
    "view run --history": (enlarge_history, nest),
    "view run --waves": (enlarge_snapshot, nest),
}
"""Commands, and files that each of them reads."""


@pytest.mark.parametrize(("words", "spoil"), [(words, each) for words, those in READ_BY.items() for each in those])
def test_arrays_larger_than_their_file_can_hold_are_refused_in_one_line(
    words: str, spoil: Callable[[Path], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    made_up(tmp_path / "sound", rows=101)
    said = spoil(made_up(tmp_path / "run", rows=101))
    done = call(*words.split())
    assert done.code == 3, done
    assert said in one_line(done.err)
    assert "retry" in done.err or "restore it" in done.err


@pytest.mark.parametrize("spoil", [enlarge_history, enlarge_snapshot, enlarge_fluid, nest])
def test_a_run_with_arrays_larger_than_their_file_is_not_continued(
    spoil: Callable[[Path], str], tmp_path: Path
) -> None:
    said = spoil(made_up(tmp_path / "run", rows=101))
    with pytest.raises(RunFailed) as failure:
        RunFolder.reopen(tmp_path / "run")
    assert said in str(failure.value)


def test_an_array_under_many_names_counts_as_often_as_it_is_read(tmp_path: Path) -> None:
    """Each name alone would fit."""
    path = made_up(tmp_path / "run", rows=101) / "history.h5"
    with h5py.File(path, "r+") as file:
        whole = file.create_dataset("big", (20_000_000,), "f4", chunks=(2**20,), compression="gzip")
        whole[:] = 0.0
        for number in range(99):
            file[f"big{number}"] = whole
    with pytest.raises(RunFailed, match=r"8\.\d*e\+07 bytes|1\.\d*e\+08 bytes|damaged \(big"):
        _ = open_run(tmp_path / "run").history


def test_zeros_that_are_compressed_most_are_read(tmp_path: Path) -> None:
    """The limit is that of the compression itself."""
    path = tmp_path / "zeros.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("zeros", data=np.zeros(30_000_000), compression="gzip", compression_opts=9, shuffle=True)
    assert path.stat().st_size < 30_000_000 * 8 / 500
    with files.opened(path) as data:
        assert not data.read(data.file["zeros"]).any()


def test_an_array_larger_than_the_memory_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up(tmp_path / "run", rows=101)
    monkeypatch.setattr(files, "memory", lambda: 1000.0)
    with pytest.raises(RunFailed, match=r"the memory of this machine holds at most 1e.03"):
        _ = open_run(tmp_path / "run").history


def test_a_checkpoint_with_a_valid_checksum_and_an_impossible_size_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def put(group: Any, values: dict[str, Any], where: str) -> None:
        group.create_dataset("position", (ROWS, 3), "f8", chunks=(2**20, 3), compression="gzip")

    monkeypatch.setattr(checkpoint, "_put", put)
    checkpoint.write(tmp_path, {})
    with pytest.raises(RunFailed, match=r"00000000.h5: the file is damaged \(position has 1000000000000 x 3 values"):
        checkpoint.newest(tmp_path)


def elsewhere(kind: str, group: Any, secret: Path) -> None:
    """An array `stolen` that lies in another file."""
    if kind == "external":
        group.create_dataset("stolen", (4,), "u1", external=[(str(secret), 0, 4)])
    elif kind == "link":
        group["stolen"] = h5py.ExternalLink(str(secret), "values")
    else:
        layout = h5py.VirtualLayout((4,), "f8")
        layout[:] = h5py.VirtualSource(str(secret), "values", (4,))
        group.create_virtual_dataset("stolen", layout)


@pytest.mark.parametrize("kind", ["external", "link", "virtual"])
def test_an_array_of_another_file_is_not_read(kind: str, tmp_path: Path) -> None:
    """A run folder could name any file of the reader; what is in it would be exported, drawn and passed on."""
    secret = tmp_path / "secret.h5"
    with h5py.File(secret, "w") as file:
        file["values"] = np.arange(4.0)
    folder = made_up(tmp_path / "run", rows=101)
    with h5py.File(folder / "history.h5", "r+") as file:
        elsewhere(kind, file, secret)
    with pytest.raises(RunFailed, match=r"history.h5: the file is damaged \(\w+ lies in another file\)"):
        _ = open_run(folder).history


def test_a_snapshot_with_an_impossible_number_is_refused(tmp_path: Path) -> None:
    folder = made_up(tmp_path / "run", rows=101)
    (folder / "data" / "99999999.h5").write_bytes((folder / "data" / "00000000.h5").read_bytes())
    with pytest.raises(RunFailed, match=r"there is no snapshot 99999999.h5, as the folder has 3 snapshots"):
        open_run(folder)


def test_a_nested_value_of_run_json_is_no_reason_for_a_traceback(tmp_path: Path) -> None:
    folder = made_up(tmp_path / "run", rows=101)
    about = json.loads((folder / "run.json").read_text())
    text = json.dumps(about)
    (folder / "run.json").write_text(text[:-1] + ', "more": ' + '{"a":' * 50_000 + "1" + "}" * 50_001)
    with pytest.raises(CfddemError, match=r"run.json: the file is damaged"):
        open_run(folder)


def test_an_array_in_the_place_of_the_particle_fields_is_damage(tmp_path: Path) -> None:
    """As a drawn folder had it: its rows were taken for names."""
    folder = made_up(tmp_path / "run", rows=101)
    with h5py.File(sorted((folder / "data").glob("*.h5"))[-1], "r+") as file:
        del file["particles"]
        file["particles"] = np.ones((3, 4))
    with pytest.raises(RunFailed, match=r"\.h5: the file is damaged"):
        _ = open_run(folder).particle_fields


@pytest.mark.parametrize("shape", [(), (2, 3, 4), (7,)])
def test_a_particle_field_of_another_shape_is_damage_in_a_dataset(shape: tuple[int, ...], tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    folder = made_up(tmp_path / "run", rows=101)
    with h5py.File(sorted((folder / "data").glob("*.h5"))[-1], "r+") as file:
        del file["particles/radius"]
        file["particles/radius"] = np.ones(shape)
    with pytest.raises(RunFailed, match=r"\.h5: the file is damaged \(particle"):
        open_run(folder).dataset()


@pytest.mark.parametrize("name", ["Points", "radius"])
def test_waves_of_a_run_without_positions_or_radii_are_refused(name: str, tmp_path: Path) -> None:
    folder = made_up(tmp_path / "run", rows=101)
    with h5py.File(folder / "data" / "00000000.h5", "r+") as file:
        del file[f"particles/{name}"]
    done = call("view", str(folder), "--waves")
    assert done.code == 2 and "snapshot = 0: must be one with positions and radii" in one_line(done.err), done
