"""The folder of a run: whole at every instant, open to VTK, h5py and pyvista, and never written over."""

from __future__ import annotations

import os
import random
import shutil
import signal
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
import toy_run

from cfddem.errors import CfddemError, InputError, RunFailed
from cfddem.particles.encounters import ENCOUNTER
from cfddem.record import output
from cfddem.record.output import RunFolder
from cfddem.record.provenance import provenance
from cfddem.record.reading import open_run

GRID = SimpleNamespace(cells=(4, 3, 5), spacing=(0.1, 0.2, 0.3), origin=(0.0, -1.0, 0.0))


def series(path: Path) -> Iterator[tuple[float, dict]]:
    """All steps of an index as VTK's own reader sees them: time, block name -> pyvista object."""
    import pyvista
    import vtk

    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    for when in reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()):
        reader.UpdateTimeStep(when)
        blocks = pyvista.wrap(reader.GetOutputDataObject(0))
        yield when, {blocks.get_block_name(k): blocks[k] for k in range(len(blocks))}


def fluid(number: float) -> dict[str, np.ndarray]:
    return {"voidage": number + np.arange(60.0).reshape(5, 3, 4), "velocity": np.full((5, 3, 4, 3), number)}


def grains(count: int, seed: int = 1) -> dict[str, np.ndarray]:
    random_numbers = np.random.default_rng(seed)
    return {
        "id": random_numbers.permutation(count).astype(np.int64),
        "position": random_numbers.random((count, 3)),
        "velocity": random_numbers.random((count, 3)),
        "radius": np.full(count, 1e-3),
    }


def short_run(folder: Path, snapshots: int = 3, **options: object) -> RunFolder:
    run = RunFolder.create(folder, "toy = true\n", provenance(3), GRID, **options)  # type: ignore[arg-type]
    for k in range(snapshots):
        run.append_history({"time": 0.1 * k, "bed_height": 0.01 * k})
        run.write_snapshot(0.1 * k, 10 * k, fluid(k), grains(7 + k, seed=k))
    return run


def one_line(failure: CfddemError) -> str:
    assert "\n" not in str(failure)
    return str(failure)


# ---------------------------------------------------------------- what stands in it


@pytest.mark.parametrize("counts", [(5,), (5, 0, 7), (0,), (3, 3)])
@pytest.mark.parametrize("blocks", ["both", "particles", "fluid"])
def test_vtk_reads_every_step(tmp_path, counts, blocks):
    """VTK's own reader gives back what was written, also of one step, and where no particle is left."""
    run = RunFolder.create(tmp_path / "run", "", {}, None if blocks == "particles" else GRID, precision="double")
    for k, count in enumerate(counts):
        run.write_snapshot(
            0.1 * k, k, None if blocks == "particles" else fluid(k), None if blocks == "fluid" else grains(count, k)
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
            written = grains(counts[k], k)
            order = np.argsort(written["id"])
            assert seen["particles"].n_points == counts[k]
            if counts[k]:
                assert np.array_equal(seen["particles"].points, written["position"][order])
                assert np.array_equal(seen["particles"].point_data["velocity"], written["velocity"][order])


def test_every_dataset_carries_unit_and_long_name(tmp_path):
    run = short_run(tmp_path / "run", fields={"bed_height": ("m", "height of the bed, as I define it")})
    for path in [*run.folder.glob("data/*.h5"), run.folder / "history.h5"]:
        with h5py.File(path) as file:
            seen = []
            file.visititems(lambda name, each, seen=seen: seen.append(each) if isinstance(each, h5py.Dataset) else None)
            assert seen and all(each.attrs["unit"] and each.attrs["long_name"] for each in seen)
    with h5py.File(run.folder / "run.vtkhdf") as file:
        assert file["VTKHDF/fluid/CellData/velocity"].attrs["unit"] == "m/s"
        assert file["history/bed_height"].attrs["long_name"] == "height of the bed, as I define it"
        assert file["case"].asstr()[()] == "toy = true\n"


def test_a_field_without_unit_is_refused(tmp_path):
    run = short_run(tmp_path / "run", 0)
    with pytest.raises(InputError, match=r"fluid\.colour: must be declared with its unit"):
        run.write_snapshot(0.0, 0, {"colour": np.zeros((5, 3, 4))}, None)
    with pytest.raises(InputError, match=r"history\.mood"):
        run.append_history({"time": 0.0, "mood": 1.0})


def test_fields_of_other_shape_or_name_are_refused(tmp_path):
    run = short_run(tmp_path / "run", 1)
    with pytest.raises(InputError, match="voidage"):
        run.write_snapshot(1.0, 1, {"voidage": np.zeros((4, 3, 5))}, grains(3))
    with pytest.raises(InputError, match="the same fields"):
        run.write_snapshot(1.0, 1, {"voidage": np.zeros((5, 3, 4))}, grains(3))
    with pytest.raises(InputError, match="after the snapshot before it"):
        run.write_snapshot(0.0, 1, fluid(1), grains(3))


@pytest.mark.parametrize("precision, kind", [("single", "f4"), ("double", "f8")])
def test_precision_is_chosen_and_ids_stay_whole(tmp_path, precision, kind):
    run = short_run(tmp_path / "run", precision=precision)
    seen = open_run(run.folder).particles()
    assert seen["position"].dtype == kind and seen["id"].dtype == "i8"


# ---------------------------------------------------------------- reading


def test_open_run_gives_back_what_was_written(tmp_path):
    run = short_run(tmp_path / "run", precision="double")
    encounters = np.zeros(2, ENCOUNTER)
    encounters["restitution"] = 0.5, 0.75
    run.write_snapshot(0.3, 30, fluid(3), grains(10, 3), encounters)
    run.finish("finished", "done")
    seen = open_run(run.folder)
    assert (seen.status, seen.message, seen.provenance["seed"]) == ("finished", "done", 3)
    assert seen.times.tolist() == [0.0, 0.1, 0.2, 0.3] and seen.steps.tolist() == [0, 10, 20, 30]
    assert np.array_equal(seen.fluid("velocity", 1), fluid(1)["velocity"])
    assert seen.fluid_fields == ["velocity", "voidage"] and seen.unit("velocity") == "m/s"
    written = grains(8, 1)
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


def test_a_missing_snapshot_is_reported_and_reads_as_no_number(tmp_path, caplog):
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


def test_an_index_that_lags_is_completed(tmp_path, monkeypatch):
    """Beyond many snapshots the index may lag; reading looks into the folder, the end writes it."""
    monkeypatch.setattr(output, "_ALWAYS_INDEXED", 2)
    monkeypatch.setattr(output, "_SHARE_OF_INDEX", 0.0)
    run = short_run(tmp_path / "run", 5)
    assert len(list(series(run.folder / "run.vtkhdf"))) == 2
    assert len(open_run(run.folder).times) == 5
    run.finish("stopped")
    assert len(list(series(run.folder / "run.vtkhdf"))) == 5


# ---------------------------------------------------------------- going on


def test_what_is_later_than_the_checkpoint_is_dropped(tmp_path):
    run = short_run(tmp_path / "run", 4)
    run.finish("stopped")
    again = RunFolder.reopen(run.folder)
    again.drop_after(0.1)
    assert [when for when, _ in series(run.folder / "run.vtkhdf")] == [0.0, 0.1]
    assert open_run(run.folder).history["time"].tolist() == [0.0, 0.1]
    again.append_history({"time": 0.2, "bed_height": 5.0})
    again.write_snapshot(0.2, 20, fluid(9), grains(4))
    seen = open_run(run.folder)
    assert seen.fluid("voidage").min() == 9.0 and seen.history["bed_height"][-1] == 5.0
    again.drop_after(-1.0)
    assert len(open_run(run.folder).snapshots) == 0 and not (run.folder / "run.vtkhdf").exists()


class Undisturbed:
    """The states of the toy run, computed without files."""

    def __init__(self) -> None:
        self.states = [toy_run.beginning()]

    def __getitem__(self, step: int) -> dict:
        while len(self.states) <= step:
            self.states.append(toy_run.advance(self.states[-1]))
        return self.states[step]


def check_killed(folder: Path, undisturbed: Undisturbed) -> int:
    """Every snapshot, its place in VTK's series, and the history are those of the undisturbed run."""
    if not (folder / "run.json").exists():
        return 0
    seen = open_run(folder)
    count, rows = len(seen.snapshots), len(seen.history.get("time", ()))
    assert not seen.missing and rows >= count
    for k in range(rows):
        assert seen.history["bed_height"][k] == undisturbed[k + 1]["position"].max()
    steps = list(series(folder / "run.vtkhdf")) if (folder / "run.vtkhdf").exists() else []
    if len(steps) == 2 and steps[1][0] == np.nextafter(steps[0][0], 1.0):
        steps.pop()  # a single step is shown twice
    assert count - 1 <= len(steps) <= count  # the index may be behind by the snapshot of the very instant
    for k in range(count):
        assert (seen.steps[k], seen.times[k]) == (k + 1, (k + 1) * toy_run.STEP)
        position = undisturbed[k + 1]["position"].astype("f4")
        assert np.array_equal(seen.particles(k)["position"], position)
        assert np.array_equal(seen.fluid("voidage", k), undisturbed[k + 1]["voidage"].astype("f4"))
        assert k >= len(steps) or np.array_equal(steps[k][1]["particles"].points, position)
    return count


def kill_and_go_on(folder: Path, kills: int, seed: int) -> None:
    """Kill a run again and again at random instants, look at it, let it go on, and look at its end."""
    undisturbed, instants, reached = Undisturbed(), random.Random(seed), [0]
    for _ in range(kills):
        writer = subprocess.Popen(
            [sys.executable, toy_run.__file__, folder / "run", "1000000"],
            stdout=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        )
        assert writer.stdout is not None
        for _ in range(instants.randint(1, 6)):
            assert writer.stdout.readline()
        time.sleep(instants.uniform(0.0, 0.05))
        writer.kill()
        assert writer.wait() == -signal.SIGKILL
        writer.stdout.close()
        reached.append(check_killed(folder / "run", undisturbed))
    assert max(reached) > 3
    toy_run.run(folder / "run", max(reached) + 3)
    assert check_killed(folder / "run", undisturbed) == max(reached) + 3
    assert open_run(folder / "run").status == "finished"


def test_ten_kills_leave_the_run_whole_and_its_end_the_same(tmp_path):
    kill_and_go_on(tmp_path, kills=10, seed=1)


@pytest.mark.slow
def test_a_hundred_kills_leave_the_run_whole_and_its_end_the_same(tmp_path):
    kill_and_go_on(tmp_path, kills=100, seed=2)


# ---------------------------------------------------------------- where it must refuse


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own, of one megabyte."""
    disk = tmp_path / "disk"
    disk.mkdir()
    made = os.geteuid() == 0 and shutil.which("mount")
    if (
        not made
        or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", disk], capture_output=True).returncode
    ):
        pytest.skip("needs the right to mount a small tmpfs")
    try:
        yield disk
    finally:
        subprocess.run(["umount", "-l", disk], check=True)


def test_a_full_disk_is_one_line_and_the_good_data_stay(small_disk):
    run = RunFolder.create(small_disk / "run", "", {}, GRID)
    written = 0
    with pytest.raises(RunFailed) as failure:
        for k in range(1000):
            run.append_history({"time": 0.1 * k})
            run.write_snapshot(0.1 * k, k, fluid(k), grains(2000, k))
            run.write_checkpoint({"step": k, "position": np.zeros((500, 3))})
            written = k + 1
    assert "no space left" in one_line(failure.value) and "free space" in one_line(failure.value)
    seen = open_run(run.folder)
    assert written > 2 and len(seen.times) in (written, written + 1)
    assert np.array_equal(seen.fluid("voidage", written - 1), fluid(written - 1)["voidage"].astype("f4"))
    assert len(list(series(run.folder / "run.vtkhdf"))) >= written
    assert not list(run.folder.rglob("*.partial"))
    run.finish("failed", "the disk is full")  # no second failure hides the first


def test_a_read_only_folder_is_one_line(small_disk):
    short_run(small_disk / "run").finish("stopped")
    subprocess.run(["mount", "-o", "remount,ro", small_disk], check=True)
    with pytest.raises(InputError, match="must be a folder that can be written to; read-only file system") as failure:
        RunFolder.create(small_disk / "other", "", {})
    one_line(failure.value)
    with pytest.raises(RunFailed, match="read-only file system; choose a folder on a disk that can be written"):
        RunFolder.reopen(small_disk / "run")
    assert len(open_run(small_disk / "run").times) == 3


def test_a_folder_that_holds_a_run_is_not_written_over(tmp_path):
    run = short_run(tmp_path / "run")
    run.finish("finished")
    before = {path: path.read_bytes() for path in run.folder.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=r"holds no run yet .*; go on with `cfddem resume") as failure:
        RunFolder.create(tmp_path / "run", "other = true\n", {})
    one_line(failure.value)
    assert before == {path: path.read_bytes() for path in run.folder.rglob("*") if path.is_file()}


def test_a_case_of_the_user_is_not_written_over(tmp_path):
    (tmp_path / "case.toml").write_text("mine = true\n")
    with pytest.raises(InputError, match=r"case\.toml found"):
        RunFolder.create(tmp_path, "other = true\n", {})
    assert (tmp_path / "case.toml").read_text() == "mine = true\n"


def test_a_run_of_a_newer_format_is_refused(tmp_path):
    run = short_run(tmp_path / "run")
    about = run.folder / "run.json"
    about.write_text(about.read_text().replace('"format": 1', '"format": 99'))
    for opening in (open_run, RunFolder.reopen):
        with pytest.raises(InputError, match="newer cfddem") as failure:
            opening(run.folder)
        one_line(failure.value)


def test_a_run_that_is_being_written_is_not_resumed_by_another_process(tmp_path):
    run = short_run(tmp_path / "run", 1)
    code = "import sys, pathlib, cfddem.record.output as o; o.RunFolder.reopen(pathlib.Path(sys.argv[1]))"
    command = [sys.executable, "-c", code, run.folder]
    other = subprocess.run(command, capture_output=True, text=True)
    assert other.returncode and "another process is writing this run now" in other.stderr
    run.finish("stopped")
    assert subprocess.run(command).returncode == 0


def test_a_folder_without_a_run_says_so(tmp_path):
    with pytest.raises(InputError, match=r"must be the folder of a run; run\.json is not in it"):
        open_run(tmp_path)
