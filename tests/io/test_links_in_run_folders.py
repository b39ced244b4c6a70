"""Nothing is written, cut off or deleted behind a link in a run folder, or in another folder that a command fills."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from command_line import call
from made_up_run import made_up

from cfddem.backend.errors import InputError
from cfddem.io import checkpoint
from cfddem.io.files import write_whole
from cfddem.io.folder import WRITTEN
from cfddem.io.reading import open_run
from cfddem.io.writer import RunFolder


def one_line(text: str) -> str:
    """The only line of an error, whether it is wrapped or not."""
    assert text.startswith("cfddem: ") and text.count("\n") == 1 and len(text) < 400, text
    return text


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def replaced_by_link(path: Path, target: Path) -> None:
    """Move a member of a run folder elsewhere and put a link to it in its place; make it if there is none."""
    if path.exists():
        path.rename(target)
    elif path.name in ("checkpoint", "surfaces", "measured"):
        target.mkdir()
    else:
        target.write_text("precious")
    path.symlink_to(target)


@pytest.mark.parametrize("name", WRITTEN)
def test_a_run_with_a_link_in_its_folder_is_not_continued(name: str, tmp_path: Path) -> None:
    """Nothing is written, cut off or deleted behind the link."""
    folder, elsewhere = made_up(tmp_path / "run", rows=101), tmp_path / "elsewhere"
    replaced_by_link(folder / name, elsewhere)
    if elsewhere.is_dir():
        for number in range(5):
            (elsewhere / f"{number:08d}.h5").write_bytes(b"precious")
    before = contents(tmp_path)
    with pytest.raises(
        InputError, match=rf"run/{name}: must be no link; it leads to '.*elsewhere'; put a copy"
    ) as failure:
        RunFolder.reopen(folder)
    assert one_line(f"cfddem: {failure.value}\n")
    assert contents(tmp_path) == before


def test_resume_writes_and_deletes_nothing_behind_a_checkpoint_that_is_a_link(tmp_path: Path) -> None:
    folder, elsewhere = made_up(tmp_path / "run", rows=101), tmp_path / "elsewhere"
    for number in range(5):
        checkpoint.write(folder, {"time": 2.0, "overrides": {}, "number": number})
    replaced_by_link(folder / "checkpoint", elsewhere)
    before = contents(elsewhere)
    done = call("resume", str(folder), "--until", "2.5")
    assert done.code == 2
    assert "checkpoint: must be no link; it leads to " in one_line(done.err)
    assert contents(elsewhere) == before


@pytest.mark.parametrize("name", ["data", "surfaces", "measured", ".lock"])
def test_a_run_is_not_begun_in_a_folder_with_a_link(name: str, tmp_path: Path) -> None:
    folder, elsewhere = tmp_path / "run", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    (folder / name).symlink_to(elsewhere)
    done = call("run", "settling", "-o", str(folder))
    assert done.code == 2
    assert f"{name}: must be no link" in one_line(done.err)
    assert not contents(elsewhere)


def test_a_run_folder_may_itself_be_a_link(tmp_path: Path) -> None:
    """Its name was chosen by the user, for instance to have it on another disk."""
    (tmp_path / "link").symlink_to(made_up(tmp_path / "run", rows=101))
    RunFolder.reopen(tmp_path / "link").finish("finished")
    assert open_run(tmp_path / "run").status == "finished"
    assert (tmp_path / "link").is_symlink()


def test_no_file_is_written_through_a_link_with_the_name_of_its_temporary_file(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("precious")
    (tmp_path / f".run.json.{os.getpid()}.partial").symlink_to(precious)
    write_whole(tmp_path / "run.json", b"new")
    assert ((tmp_path / "run.json").read_text(), precious.read_text()) == ("new", "precious")


def test_export_and_sweep_write_through_no_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    made_up(tmp_path / "run", rows=101)
    precious = tmp_path / "precious"
    precious.write_text("precious")
    for folder in ("run-vtu", "sweep"):
        (tmp_path / folder).mkdir()
        for name in ("particles-00000000.vtu", ".sweep.csv", "jobs.txt"):
            (tmp_path / folder / name).symlink_to(precious)
    (tmp_path / "run-csv").symlink_to(tmp_path / "sweep")
    over = ("--over", "bed.inlet_velocity=0.01,0.02", "-o", "sweep")
    for words in (("export", "run"), ("export", "run", "--to", "csv"), ("sweep", "settling", *over)):
        done = call(*words)
        assert done.code == 2, done
        assert "must be no link" in one_line(done.err)
    assert precious.read_text() == "precious"
