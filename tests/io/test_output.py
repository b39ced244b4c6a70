"""Run folders: whole at every instant, readable by VTK, h5py and pyvista, and never overwritten."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from toy_run import series

from cfddem.backend.errors import CfddemError, InputError, RunFailed
from cfddem.io import writer
from cfddem.io.files import PARTIAL
from cfddem.io.folder import FORMAT, provenance, require_no_foreign_files
from cfddem.io.quantities import TIME, Quantity, of_fields
from cfddem.io.reading import open_run
from cfddem.io.writer import RunFolder
from cfddem.particles.collision_events import COLLISION, COLLISION_FIELDS
from cfddem.particles.state import PARTICLE_FIELDS

GRID = SimpleNamespace(cells=(4, 3, 5), spacing=(0.1, 0.2, 0.3), origin=(0.0, -1.0, 0.0))
QUANTITIES = {
    "history": {"time": TIME, "bed_height": Quantity("m", "bed height as defined here")},
    "particles": of_fields(PARTICLE_FIELDS),
    "fluid": {"voidage": Quantity("1", "voidage"), "velocity": Quantity("m/s", "velocity")},
    "collisions": of_fields(COLLISION_FIELDS),
}


def fluid(number: float) -> dict[str, np.ndarray]:
    return {"voidage": number + np.arange(60.0).reshape(5, 3, 4), "velocity": np.full((5, 3, 4, 3), number)}


def particles(count: int, seed: int = 1) -> dict[str, np.ndarray]:
    random_numbers = np.random.default_rng(seed)
    return {
        "id": random_numbers.permutation(count).astype(np.int64),
        "position": random_numbers.random((count, 3)),
        "velocity": random_numbers.random((count, 3)),
        "radius": np.full(count, 1e-3),
    }


def short_run(folder: Path, snapshots: int = 3, **options: object) -> RunFolder:
    run = RunFolder.create(folder, "toy = true\n", provenance(3), GRID, QUANTITIES, **options)  # type: ignore[arg-type]
    for k in range(snapshots):
        run.append_history({"time": 0.1 * k, "bed_height": 0.01 * k})
        run.write_snapshot(0.1 * k, 10 * k, fluid(k), particles(7 + k, seed=k))
    return run


def one_line(failure: CfddemError) -> str:
    assert "\n" not in str(failure)
    return str(failure)


# ---------------------------------------------------------------- content


@pytest.mark.parametrize("counts", [(5,), (5, 0, 7), (0,), (3, 3)])
@pytest.mark.parametrize("blocks", ["both", "particles", "fluid"])
def test_vtk_reads_every_step(tmp_path, counts, blocks):
    """VTK returns the written values, also of a single step and of steps without particles."""
    grid = None if blocks == "particles" else GRID
    run = RunFolder.create(tmp_path / "run", "", {}, grid, QUANTITIES, precision="double")
    for k, count in enumerate(counts):
        run.write_snapshot(
            0.1 * k, k, None if blocks == "particles" else fluid(k), None if blocks == "fluid" else particles(count, k)
        )
    steps = list(series(run.folder / "run.vtkhdf"))[-len(counts) :]
    assert len(steps) == len(counts)
    for k, (when, seen) in enumerate(steps):
        assert when == pytest.approx(0.1 * k, abs=1e-300)
        assert set(seen) == {"both": {"fluid", "particles"}}.get(blocks, {blocks})
        if "fluid" in seen:
            assert np.array_equal(seen["fluid"].cell_data["voidage"], fluid(k)["voidage"].ravel())
            assert seen["fluid"].bounds == pytest.approx((0.0, 0.4, -1.0, -0.4, 0.0, 1.5))
        if "particles" in seen:
            written = particles(counts[k], k)
            order = np.argsort(written["id"])
            assert seen["particles"].n_points == counts[k]
            if counts[k]:
                assert np.array_equal(seen["particles"].points, written["position"][order])
                assert np.array_equal(seen["particles"].point_data["velocity"], written["velocity"][order])


def test_every_dataset_has_its_unit_and_meaning(tmp_path):
    run = short_run(tmp_path / "run")
    for path in [*run.folder.glob("data/*.h5"), run.folder / "history.h5"]:
        with h5py.File(path) as file:
            seen = []
            file.visititems(lambda name, each, seen=seen: seen.append(each) if isinstance(each, h5py.Dataset) else None)
            assert seen and all(each.attrs["unit"] and each.attrs["long_name"] for each in seen)
    with h5py.File(run.folder / "run.vtkhdf") as file:
        assert file["VTKHDF/fluid/CellData/velocity"].attrs["unit"] == "m/s"
        assert file["history/bed_height"].attrs["long_name"] == "bed height as defined here"
        assert file["case"].asstr()[()] == "toy = true\n"


def test_an_undeclared_field_or_column_is_refused(tmp_path):
    run = short_run(tmp_path / "run", 0)
    with pytest.raises(InputError, match=r"fluid\.colour: must be declared with its unit and meaning"):
        run.write_snapshot(0.0, 0, {"colour": np.zeros((5, 3, 4))}, None)
    with pytest.raises(InputError, match=r"history\.mood"):
        run.append_history({"time": 0.0, "mood": 1.0})


def test_fields_of_a_different_shape_or_name_are_refused(tmp_path):
    run = short_run(tmp_path / "run", 1)
    with pytest.raises(InputError, match="voidage"):
        run.write_snapshot(1.0, 1, {"voidage": np.zeros((4, 3, 5))}, particles(3))
    with pytest.raises(InputError, match="the same fields"):
        run.write_snapshot(1.0, 1, {"voidage": np.zeros((5, 3, 4))}, particles(3))
    with pytest.raises(InputError, match="later than the previous snapshot"):
        run.write_snapshot(0.0, 1, fluid(1), particles(3))


@pytest.mark.parametrize("precision, kind", [("single", "f4"), ("double", "f8")])
def test_real_fields_have_the_chosen_precision_and_ids_stay_integers(tmp_path, precision, kind):
    run = short_run(tmp_path / "run", precision=precision)
    seen = open_run(run.folder).particles()
    assert seen["position"].dtype == kind and seen["id"].dtype == "i8"


# ---------------------------------------------------------------- reading


def test_open_run_returns_what_was_written(tmp_path):
    run = short_run(tmp_path / "run", precision="double")
    collisions = np.zeros(2, COLLISION)
    collisions["restitution"] = 0.5, 0.75
    run.write_snapshot(0.3, 30, fluid(3), particles(10, 3), collisions)
    run.finish("finished", "done")
    seen = open_run(run.folder)
    assert (seen.status, seen.message, seen.provenance["seed"]) == ("finished", "done", 3)
    assert seen.times.tolist() == [0.0, 0.1, 0.2, 0.3] and seen.steps.tolist() == [0, 10, 20, 30]
    assert np.array_equal(seen.fluid("velocity", 1), fluid(1)["velocity"])
    assert seen.fluid_fields == ["velocity", "voidage"] and seen.unit("velocity") == "m/s"
    written = particles(8, 1)
    assert np.array_equal(seen.particles(1)["position"], written["position"][np.argsort(written["id"])])
    assert seen.history["bed_height"].tolist() == [0.0, 0.01, 0.02]
    assert seen.collisions["restitution"].tolist() == [0.5, 0.75]
    track = seen.track(8)
    assert track["time"].tolist() == [0.2, 0.3] and track["velocity"].shape == (2, 3)
    blocks = seen.mesh(1)
    assert np.array_equal(blocks["fluid"].cell_data["voidage"], fluid(1)["voidage"].ravel())
    assert blocks["particles"].n_points == 8
    with pytest.raises(InputError, match="did you mean 'voidage'"):
        seen.fluid("voidge")
    with pytest.raises(InputError, match="from 0 to 3"):
        seen.particles(4)


def test_a_missing_snapshot_is_reported_and_reads_as_nan(tmp_path, caplog):
    run = short_run(tmp_path / "run")
    (run.folder / "data/00000001.h5").unlink()
    seen = open_run(run.folder)
    assert seen.missing == ["00000001.h5"] and len(seen.times) == 2
    assert "00000001.h5" in caplog.text
    (run.folder / "run.vtkhdf").rename(run.folder / "lost")
    assert open_run(run.folder).missing == ["00000001.h5"]
    (run.folder / "lost").rename(run.folder / "run.vtkhdf")
    voidage = [blocks["fluid"].cell_data["voidage"] for _, blocks in series(run.folder / "run.vtkhdf")]
    assert np.isnan(voidage[1]).all() and not np.isnan(voidage[2]).any()


def test_a_folder_can_be_moved(tmp_path):
    short_run(tmp_path / "run")
    shutil.move(tmp_path / "run", tmp_path / "elsewhere")
    assert not np.isnan(list(series(tmp_path / "elsewhere/run.vtkhdf"))[2][1]["fluid"].cell_data["voidage"]).any()


def test_a_thousand_snapshots_open_within_a_second(tmp_path):
    run = short_run(tmp_path / "run", 1)
    first = run.snapshots[0]
    run.snapshots = [replace(first, name=f"{k:08d}.h5", time=0.1 * k, step=k) for k in range(1000)]
    for each in run.snapshots[1:]:
        os.link(run.folder / "data" / first.name, run.folder / "data" / each.name)
        run.append_history({"time": each.time, "bed_height": 0.0})
    run.finish("finished")
    begin = time.perf_counter()
    seen = open_run(run.folder)
    assert len(seen.times) == 1000 and len(seen.history["time"]) == 1000 and seen.particles()["id"].size
    assert time.perf_counter() - begin < 1.0


def test_an_index_that_lags_behind_is_completed(tmp_path, monkeypatch):
    """With many snapshots the index may lag behind; reading looks into the folder, and the end of the run writes it."""
    monkeypatch.setattr(writer, "_ALWAYS_INDEXED", 2)
    monkeypatch.setattr(writer, "_INDEX_SHARE", 0.0)
    run = short_run(tmp_path / "run", 5)
    assert len(list(series(run.folder / "run.vtkhdf"))) == 2
    assert len(open_run(run.folder).times) == 5
    run.finish("stopped")
    assert len(list(series(run.folder / "run.vtkhdf"))) == 5


# ---------------------------------------------------------------- resuming


def test_snapshots_and_rows_after_the_checkpoint_are_dropped(tmp_path):
    run = short_run(tmp_path / "run", 4)
    run.finish("stopped")
    again = RunFolder.reopen(run.folder)
    again.drop_after(0.1)
    assert [when for when, _ in series(run.folder / "run.vtkhdf")] == [0.0, 0.1]
    assert open_run(run.folder).history["time"].tolist() == [0.0, 0.1]
    again.append_history({"time": 0.2, "bed_height": 5.0})
    again.write_snapshot(0.2, 20, fluid(9), particles(4))
    seen = open_run(run.folder)
    assert seen.fluid("voidage").min() == 9.0 and seen.history["bed_height"][-1] == 5.0
    again.drop_after(-1.0)
    assert len(open_run(run.folder).snapshots) == 0 and not (run.folder / "run.vtkhdf").exists()


# ---------------------------------------------------------------- refusals


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A separate file system of one megabyte."""
    disk = tmp_path / "disk"
    disk.mkdir()
    made = os.geteuid() == 0 and shutil.which("mount")
    if (
        not made
        or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", disk], capture_output=True).returncode
    ):
        pytest.skip("mounting a tmpfs is not permitted")
    try:
        yield disk
    finally:
        subprocess.run(["umount", "-l", disk], check=True)


def test_a_full_disk_gives_one_line_and_earlier_data_stay(small_disk):
    run = RunFolder.create(small_disk / "run", "", {}, GRID, QUANTITIES)
    written = 0
    with pytest.raises(RunFailed) as failure:
        for k in range(1000):
            run.append_history({"time": 0.1 * k})
            run.write_snapshot(0.1 * k, k, fluid(k), particles(2000, k))
            run.write_checkpoint({"step": k, "position": np.zeros((500, 3))})
            written = k + 1
    assert "no space left" in one_line(failure.value) and "free space" in one_line(failure.value)
    seen = open_run(run.folder)
    assert written > 2 and len(seen.times) in (written, written + 1)
    assert np.array_equal(seen.fluid("voidage", written - 1), fluid(written - 1)["voidage"].astype("f4"))
    assert len(list(series(run.folder / "run.vtkhdf"))) >= written
    assert not list(run.folder.rglob("*.partial"))
    run.finish("failed", "the disk is full")  # a second failure does not hide the first


@pytest.mark.skipif(os.name == "nt", reason="needs limits of processes")
@pytest.mark.parametrize("room", [4_000, 20_000, 60_000])
def test_a_limit_of_file_sizes_gives_one_line(tmp_path, room):
    """A buffered file may fail as it seeks, too; HDF5 then ends the process unless the failure waits for its end."""
    script = f"""
import resource
from pathlib import Path
import numpy as np
from cfddem.io.files import write_hdf5
resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}))
write_hdf5(Path("x.h5"), lambda file: [file.create_dataset(str(n), data=np.ones(1000)) for n in range(20)])
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "cannot write the file: file too large; raise the limit of file sizes" in done.stderr.split("\n")[-2]
    assert "Exception ignored" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_read_only_folder_gives_one_line(small_disk):
    short_run(small_disk / "run").finish("stopped")
    subprocess.run(["mount", "-o", "remount,ro", small_disk], check=True)
    with pytest.raises(InputError, match="must be a writable folder; read-only file system") as failure:
        RunFolder.create(small_disk / "other", "", {})
    one_line(failure.value)
    with pytest.raises(RunFailed, match="read-only file system; choose a folder on a writable disk"):
        RunFolder.reopen(small_disk / "run")
    assert len(open_run(small_disk / "run").times) == 3


def test_a_folder_that_holds_a_run_is_not_overwritten(tmp_path):
    run = short_run(tmp_path / "run")
    run.finish("finished")
    before = {path: path.read_bytes() for path in run.folder.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=r"a folder without a run .*; continue that run with") as failure:
        RunFolder.create(tmp_path / "run", "other = true\n", {})
    one_line(failure.value)
    assert before == {path: path.read_bytes() for path in run.folder.rglob("*") if path.is_file()}


def test_a_run_does_not_begin_among_other_files_and_a_folder_of_runs_names_them(tmp_path):
    short_run(tmp_path / "sweep" / "seed-1").finish("finished")
    with pytest.raises(InputError, match=r"it contains no run.json, but the runs seed-1"):
        open_run(tmp_path / "sweep")
    with pytest.raises(InputError, match=r"a new or empty folder \(seed-1 found\)"):
        require_no_foreign_files(tmp_path / "sweep")
    require_no_foreign_files(tmp_path / "new")
    (tmp_path / "killed" / "data").mkdir(parents=True)
    (tmp_path / "killed" / f".run.json.1{PARTIAL}").touch()
    require_no_foreign_files(tmp_path / "killed")


def test_a_case_file_of_the_user_is_not_overwritten(tmp_path):
    (tmp_path / "case.toml").write_text("mine = true\n")
    with pytest.raises(InputError, match=r"case\.toml found"):
        RunFolder.create(tmp_path, "other = true\n", {})
    assert (tmp_path / "case.toml").read_text() == "mine = true\n"


@pytest.mark.parametrize("number, remedy", [(1, r"earlier version of cfddem; run .*case\.toml again"), (99, "update")])
def test_a_run_of_another_format_is_refused(tmp_path, number, remedy):
    run = short_run(tmp_path / "run")
    about = run.folder / "run.json"
    about.write_text(about.read_text().replace(f'"format": {FORMAT}', f'"format": {number}'))
    for opening in (open_run, RunFolder.reopen):
        with pytest.raises(InputError, match=rf"format = {number}: must be {FORMAT}; .*{remedy}") as failure:
            opening(run.folder)
        one_line(failure.value)


def test_a_run_that_is_being_written_is_not_resumed_by_another_process(tmp_path):
    run = short_run(tmp_path / "run", 1)
    code = "import sys, pathlib, cfddem.io.writer as o; o.RunFolder.reopen(pathlib.Path(sys.argv[1]))"
    command = [sys.executable, "-c", code, run.folder]
    other = subprocess.run(command, capture_output=True, text=True)
    assert other.returncode and "another process is writing this run" in other.stderr
    run.finish("stopped")
    assert subprocess.run(command).returncode == 0


def test_a_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"must be a run folder; it contains no run\.json"):
        open_run(tmp_path)
