"""A run as an xarray Dataset: the numbers of the snapshots, read when they are asked for."""

from __future__ import annotations

import json
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from test_pictures import GRID, QUANTITIES

from cfddem.backend.errors import InputError, RunFailed
from cfddem.io.reading import RunData, open_run
from cfddem.io.writer import RunFolder

xarray = pytest.importorskip("xarray", reason="needs `pip install 'cfddem[data]'`")


def written(folder: Path, ids: tuple[tuple[int, ...], ...]) -> Path:
    """A snapshot for each row of ids, with values that differ in time and place, and twice as many history rows."""
    run = RunFolder.create(folder, 'title = "small"\n', {}, GRID, QUANTITIES)
    random = np.random.default_rng(3)
    for k, each in enumerate(ids):
        n = len(each)
        particles = {
            "id": np.array(each), "position": random.random((n, 3)), "velocity": random.random((n, 3)),
            "radius": np.full(n, 1e-3 * (k + 1)),
        }  # fmt: skip
        for part in range(2):
            run.append_history({"time": 0.1 * k + 0.05 * part, "bed_height": 0.1 * k, "pressure_drop": 900.0 + part})
        fluid = {"voidage": random.random((20, 4, 10)), "velocity": random.random((20, 4, 10, 3))}
        run.write_snapshot(0.1 * k, k, fluid, particles)
    run.finish("finished")
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("runs") / "small", ((3, 5, 8),) * 4)


def test_fluid_fields_are_those_of_the_snapshots_at_cell_centres_in_metres(folder):
    run = open_run(folder)
    data = run.dataset()
    assert data["voidage"].dims == ("time", "z", "y", "x")
    assert data["velocity"].dims == ("time", "z", "y", "x", "component")
    for name in run.fluid_fields:
        assert np.array_equal(data[name], [run.fluid(name, k) for k in range(4)])
        assert data[name].dtype == run.fluid(name).dtype
    assert data["z"].values == pytest.approx(0.01 * (np.arange(20) + 0.5)) and data["z"].units == "m"
    assert (data["velocity"].units, data["velocity"].long_name) == ("m/s", "velocity")
    assert data["time"].values == pytest.approx([0.0, 0.1, 0.2, 0.3]) and data["time"].units == "s"
    at = data["velocity"].sel(component="y").sel(time=0.2, z=0.105, y=0.005, x=0.015, method="nearest")
    assert at.item() == run.fluid("velocity", 2)[10, 0, 1, 1]


@pytest.mark.parametrize(
    "key",
    [
        {"time": -1}, {"time": slice(None, None, -1)}, {"time": [3, 0], "z": [1, 5], "x": [2, 2, 0]},
        {"time": slice(1, 1)}, {"time": 1, "z": 2, "y": 3, "x": 4}, {"time": slice(1, 3), "z": 0, "x": [4, 1]},
        {"z": slice(15, 2, -4), "y": -1},
    ],
    ids=str,
)  # fmt: skip
def test_every_kind_of_index_chooses_what_numpy_chooses(folder, key):
    data = open_run(folder).dataset()["voidage"]
    assert np.array_equal(data.isel(key), data.copy(deep=True).load().isel(key))
    assert data.isel(key).shape == data.load().isel(key).shape


def test_points_are_chosen_pairwise(folder):
    run = open_run(folder)
    places = xarray.DataArray([0, 3, 2], dims="point")
    chosen = run.dataset()["voidage"].isel(time=places, z=places, y=0, x=places)
    assert chosen.values.tolist() == [run.fluid("voidage", k)[k, 0, k] for k in (0, 3, 2)]


def test_only_snapshots_that_are_asked_for_are_read(folder, monkeypatch):
    read: list[tuple[str, int]] = []
    fluid = RunData.fluid

    def noted(self: RunData, name: str, snapshot: int = -1) -> np.ndarray:
        read.append((name, snapshot))
        return fluid(self, name, snapshot)

    monkeypatch.setattr(RunData, "fluid", noted)
    data = open_run(folder).dataset()
    repr(data), data._repr_html_(), data["voidage"].isel(time=slice(0, 2)), data.nbytes
    assert not read
    data["voidage"].isel(time=[0, 3], z=4).load()
    assert read == [("voidage", 0), ("voidage", 3)]


def test_history_has_its_own_times_and_units(folder):
    data = open_run(folder).dataset()
    assert data["history_bed_height"].dims == ("history_time",) and data.sizes["history_time"] == 8
    assert np.array_equal(data["history_time"], open_run(folder).history["time"])
    assert np.array_equal(data["history_pressure_drop"], open_run(folder).history["pressure_drop"])
    assert (data["history_time"].units, data["history_pressure_drop"].units) == ("s", "Pa")


def test_the_same_particles_in_all_snapshots_are_a_dimension(folder):
    run = open_run(folder)
    data = run.dataset()
    assert data["id"].values.tolist() == [3, 5, 8] and data["id"].dims == ("particle",)
    assert data["particle_position"].dims == ("time", "particle", "component")
    for name in ("position", "velocity", "radius"):
        assert np.array_equal(data[f"particle_{name}"], [run.particles(k)[name] for k in range(4)])
        assert data[f"particle_{name}"].units == run.quantities["particles"][name].unit
    one = data["particle_position"].sel(particle=data["id"] == 5).squeeze("particle")
    assert np.array_equal(one, run.track(5)["position"])


@pytest.mark.parametrize("ids", [((1, 2), (1, 2, 3)), ((1, 2), (1, 3))], ids=["more", "others"])
def test_particles_that_change_are_left_out(tmp_path, ids):
    data = open_run(written(tmp_path / "run", ids)).dataset()
    assert "particle" not in data.sizes and "id" not in data.coords
    assert data["voidage"].sizes["time"] == 2


def test_dry_runs_and_runs_without_a_snapshot_have_what_there_is(tmp_path):
    run = RunFolder.create(tmp_path / "dry", "", {}, None, QUANTITIES)
    for k in range(2):
        run.write_snapshot(0.1 * k, k, None, {"id": np.arange(3), "position": np.eye(3) * k})
    run.finish("finished")
    dry = open_run(tmp_path / "dry").dataset()
    assert "z" not in dry.dims and dry["particle_position"].shape == (2, 3, 3)
    RunFolder.create(tmp_path / "empty", "", {}, GRID, QUANTITIES)
    empty = open_run(tmp_path / "empty").dataset()
    assert dict(empty.sizes) == {"time": 0} and not empty.data_vars


def test_reading_writes_nothing(folder):
    before = {path: (path.stat().st_mtime_ns, path.stat().st_size) for path in [folder, *folder.rglob("*")]}
    data = open_run(folder).dataset()
    data.load()
    assert {path: (path.stat().st_mtime_ns, path.stat().st_size) for path in [folder, *folder.rglob("*")]} == before


def test_a_dataset_goes_to_another_process(folder):
    data = open_run(folder).dataset()
    assert pickle.loads(pickle.dumps(data)).identical(data)


def test_a_snapshot_of_another_shape_is_named(folder, tmp_path):
    changed = tmp_path / "changed"
    shutil.copytree(folder, changed)
    with h5py.File(changed / "data/00000001.h5", "r+") as file:
        del file["fluid/voidage"]
        file["fluid/voidage"] = np.zeros((1, 20, 4, 10, 3), "f4")
    data = open_run(changed).dataset()
    assert data["voidage"].isel(time=0).shape == (20, 4, 10)
    with pytest.raises(RunFailed, match="snapshot 1: a field has the shape"):
        data["voidage"].load()


def test_a_grid_larger_than_its_fields_is_refused_before_memory_is_taken(folder, tmp_path):
    changed = tmp_path / "changed"
    shutil.copytree(folder, changed)
    about = json.loads((changed / "run.json").read_text())
    about["grid"]["cells"] = [10**12, 4, 20]
    (changed / "run.json").write_text(json.dumps(about))
    with pytest.raises(RunFailed, match="fluid/velocity has the shape"):
        open_run(changed).dataset()


def test_without_xarray_one_line_says_how_to_install_it(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(InputError) as failure:
        open_run(folder).dataset()
    assert str(failure.value) == "dataset: must be used with xarray installed; `pip install 'cfddem[data]'`"


def test_without_xarray_runs_are_made_read_and_reported(folder):
    """In a new process, because the blocked package may have been imported here."""
    program = f"""
import sys
sys.modules["xarray"] = None
import cfddem.run.runner, cfddem.analysis.report
from cfddem import open_run
print(open_run({str(folder)!r}).fluid("voidage").shape)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "(20, 4, 10)\n"), done.stderr
