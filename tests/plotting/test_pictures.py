"""Pictures: spheres at the right place in the right colour; exported formats with the same numbers."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from test_case_walls import HOPPER, TETRAHEDRON, write_binary_stl

from cfddem.backend.errors import InputError, RunFailed
from cfddem.io.export import export
from cfddem.io.quantities import TIME, Quantity, of_fields
from cfddem.io.reading import newest_run, open_run
from cfddem.io.writer import RunFolder
from cfddem.particles.state import PARTICLE_FIELDS
from cfddem.plotting import colours, rendering
from cfddem.plotting.colours import SINGLE, scattered
from cfddem.plotting.curves import history
from cfddem.plotting.pictures import BUBBLE, SCALARS, Stage, _bubbles, _colour_bar, movie, picture
from cfddem.plotting.rendering import _moved, _surface, walls_of
from cfddem.plotting.scene import Look, Scene, scene, window

GRID = SimpleNamespace(cells=(10, 4, 20), spacing=(0.01, 0.01, 0.01), origin=(0.0, 0.0, 0.0))
QUANTITIES = {
    "history": {"time": TIME, "bed_height": Quantity("m", "bed height"), "pressure_drop": Quantity("Pa", "drop")},
    "particles": of_fields(PARTICLE_FIELDS),
    "fluid": {"voidage": Quantity("1", "voidage"), "velocity": Quantity("m/s", "velocity")},
}
BOUNDS = np.array([[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]])


@pytest.fixture
def renders() -> None:
    """Skip with the reason if this machine cannot render."""
    fault = rendering.why_not()
    if fault:
        pytest.skip(fault)


@pytest.fixture(scope="module")
def bed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three snapshots of a bed with a bubble that fills half the column."""
    folder = tmp_path_factory.mktemp("runs") / "bed"
    run = RunFolder.create(folder, 'title = "small bed"\n', {}, GRID, QUANTITIES)
    points = np.random.default_rng(1).random((300, 3)) * [0.1, 0.04, 0.1]
    z, y, x = np.meshgrid(*[0.01 * (np.arange(n) + 0.5) for n in (20, 4, 10)], indexing="ij")
    for k in range(3):
        away = np.sqrt((x - 0.05) ** 2 + (y - 0.02) ** 2 + (z - 0.04 - 0.01 * k) ** 2)
        voidage = np.where((z > 0.1) | (away < 0.02), 1.0, 0.42)
        particles = {"id": np.arange(300), "position": points, "velocity": points * k, "radius": np.full(300, 2e-3)}
        fluid = {"voidage": voidage, "velocity": np.stack([x, y, z + 0.1], axis=-1)}
        run.append_history({"time": 0.1 * k, "bed_height": 0.1, "pressure_drop": 900.0 + k})
        run.write_snapshot(0.1 * k, k, fluid, particles)
    run.finish("finished")
    return folder


def drawn(position: list, radius: list, values: list, depth: int = 1) -> np.ndarray:
    """Spheres in a box of 1 x 2 x 3 m, at a hundred pixels per metre."""
    view = rendering.View(BOUNDS, depth, (100 if depth == 1 else 200, 300))
    return rendering.spheres(view, np.array(position, float), np.array(radius), np.array(values), (0.0, 1.0))


# ---------------------------------------------------------------- spheres


@pytest.mark.parametrize("depth", [0, 1])
def test_a_sphere_has_the_right_position_and_size(renders, depth):
    image = drawn([(0.25, 0.5, 2.5)], [0.2], [0.0], depth)
    seen = np.argwhere((image < 250).any(axis=2))
    row, column = seen.mean(axis=0)
    assert row == pytest.approx(50.0, abs=1.0)  # 0.5 m below the top
    assert column == pytest.approx(50.0 if depth == 0 else 25.0, abs=1.0)
    assert len(seen) == pytest.approx(np.pi * 20.0**2, rel=0.04)


def test_the_nearer_sphere_hides_the_farther_one(renders):
    """Along y the view is from the front, along x from the far side."""
    for depth, places in ((1, [(0.5, 0.2, 1.5), (0.5, 1.8, 1.5)]), (0, [(0.9, 1.0, 1.5), (0.1, 1.0, 1.5)])):
        for first in (0, 1):
            image = drawn([places[first], places[1 - first]], [0.3, 0.3], [float(first == 1), float(first == 0)], depth)
            red, _, blue = (int(each) for each in image[150, 100 // (depth + 1)])
            near_is_slow = blue > red  # viridis begins blue and ends yellow
            assert near_is_slow


def test_the_colour_shows_the_value_and_an_empty_image_is_white(renders):
    image = drawn([(0.5, 1.0, 2.0), (0.5, 1.0, 1.0)], [0.3, 0.3], [0.0, 1.0])
    low, high = image[100, 50], image[200, 50]
    assert np.abs(low - 255.0 * np.array(mpl.colormaps["viridis"](0.0)[:3])).max() < 12
    assert np.abs(high - 255.0 * np.array(mpl.colormaps["viridis"](1.0)[:3])).max() < 12
    assert (drawn([], [], []) == 255).all()


def test_agglomerates_have_a_colour_each_and_single_spheres_none():
    values = scattered(np.array([7, 7, 3, 12, 12, 12, 40]))
    assert values[2] == values[6] == 0.0
    assert values[0] == values[1] and values[3] == values[4] == values[5]
    assert min(values[0], values[3]) > SINGLE and abs(values[0] - values[3]) > 0.05
    assert scattered(np.array([1, 12, 12]))[1] == values[3], "the same colour in all snapshots"


# ---------------------------------------------------------------- pictures of a run


def test_picture_movie_and_window(renders, bed, tmp_path):
    import matplotlib.image

    path = picture(bed, tmp_path / "bed.png", show=("spheres", "voidage", "bubbles", "streamlines"))
    image = matplotlib.image.imread(path)
    assert image.shape[1] == 1280 and image[..., :3].std() > 0.1
    film = Image.open(movie(bed, tmp_path / "bed.gif", show=("voidage",)))
    assert film.n_frames == 3 and film.size[0] <= 800  # type: ignore[attr-defined]
    assert not list(tmp_path.glob(".*"))
    plotter = scene(open_run(bed), off_screen=True)
    assert plotter.screenshot(return_img=True).std() > 1.0
    plotter.close()


def test_a_film_as_mp4(renders, bed, tmp_path):
    pytest.importorskip("imageio_ffmpeg", reason="needs `pip install 'cfddem[movie]'`")
    import imageio

    frames = [each for each in imageio.get_reader(movie(bed, tmp_path / "bed.mp4", show=("voidage",)))]  # noqa: C416, a list() would ask for its endless length
    assert len(frames) == 3 and frames[0].shape[1] <= 800 and np.std(frames[0]) > 10.0  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def drying(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A snapshot of two beads in a fluid with temperature and vapour; one bead is warm, the other is wet."""
    fields = {
        "temperature": Quantity("K", "temperature"), "liquid": Quantity("m3", "film"),
        "liquid_carried": Quantity("m3", "liquid"),
    }  # fmt: skip
    cells = {"temperature": Quantity("K", "temperature"), "vapour": Quantity("1", "mass fraction")}
    quantities = {
        **QUANTITIES, "particles": QUANTITIES["particles"] | fields, "fluid": QUANTITIES["fluid"] | cells,
    }  # fmt: skip
    run = RunFolder.create(tmp_path_factory.mktemp("runs") / "drying", "", {}, GRID, quantities)
    shape = (20, 4, 10)
    fluid = {
        "voidage": np.ones(shape), "velocity": np.zeros((*shape, 3)), "vapour": np.full(shape, 0.01),
        "temperature": 330.0 - np.broadcast_to(np.arange(20.0)[:, None, None], shape),
    }  # fmt: skip
    beads = {
        "id": np.arange(2), "position": np.array([[0.02, 0.02, 0.05], [0.07, 0.02, 0.05]]), "radius": np.full(2, 5e-3),
        "velocity": np.zeros((2, 3)), "temperature": np.array([320.0, 300.0]), "liquid": np.zeros(2),
        "liquid_carried": np.array([0.0, 1e-9]),
    }  # fmt: skip
    run.write_snapshot(0.0, 0, fluid, beads)
    run.finish("finished")
    return run.folder


def test_spheres_are_coloured_by_temperature_and_by_moisture_beside_the_same_of_the_fluid(renders, drying):
    run = open_run(drying)
    assert colours.choices(run)[:4] == ["speed", "liquid", "temperature", "moisture"]
    for colour, beside, label, limits in (
        ("temperature", "temperature", "temperature  [K]", (300.0, 320.0)),
        ("moisture", "vapour", "moisture, liquid over solid volume  [-]", (0.0, 1e-9 / (np.pi / 6.0 * 1e-6))),
    ):
        stage = Stage.of(run, [0], (), colour, None)
        assert stage.panels == ("spheres", "voidage", beside)
        assert stage.limits["spheres"] == pytest.approx(limits, rel=3e-3)
        labels = {each.get_ylabel() for each in stage.figure(0).axes}
        assert {label, SCALARS[beside]} <= labels
    assert Stage.of(run, [0], ("temperature",), "speed", None).limits["temperature"] == (311.0, 330.0)
    first = Scene(run, off_screen=True)
    for layer in ("temperature", "vapour"):
        first.show(Look(0, "moisture", layer))
    first.plotter.close()


def test_axes_colour_bars_and_title_are_labelled(renders, bed):
    stage = Stage.of(open_run(bed), [2], (), "speed", None)
    figure = stage.figure(2)
    assert figure.get_suptitle() == "small bed,  t = 0.2 s"
    labels = {each.get_xlabel() for each in figure.axes} | {each.get_ylabel() for each in figure.axes}
    assert labels == {"", "x  [m]", "z  [m]", "speed  [m/s]", "voidage  [-]"}
    highest = float(open_run(bed).history["bed_height"].max())
    top = max(1.4 * highest, 0.1)
    assert top < 0.2, "the bed of this test leaves room above it"
    assert figure.axes[0].get_xlim() == (0.0, 0.1) and figure.axes[0].get_ylim() == pytest.approx((0.0, top))


def test_a_long_title_fits_a_narrow_picture(bed, monkeypatch):
    monkeypatch.setattr("cfddem.plotting.pictures.title_of", lambda run: "Liquid-fluidised bed of alumina beads")
    figure = Stage.of(open_run(bed), [2], ("voidage",), "speed", None).figure(2)
    left, right = figure._suptitle.get_window_extent().intervalx
    assert 0.0 < left < right < figure.bbox.width


def test_a_run_without_a_grid_is_framed_by_its_particles(renders, tmp_path):
    run = RunFolder.create(tmp_path / "run", "", {}, None, QUANTITIES)
    points = {"position": np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 3.0]]), "radius": np.array([0.1, 0.2])}
    run.write_snapshot(0.0, 0, None, points | {"velocity": np.zeros((2, 3))})
    stage = Stage.of(open_run(run.folder), [0], (), "speed", None)
    assert stage.panels == ("spheres",) and stage.depth == 1
    assert stage.bounds[:, 0] == pytest.approx(np.array([-0.1, -0.1, -0.1]), abs=0.07)
    assert stage.bounds[:, 1] == pytest.approx(np.array([1.2, 0.7, 3.2]), abs=0.07)
    assert picture(run.folder, tmp_path / "two.png").exists()


def test_walls_of_the_case_are_drawn_where_they_are_at_a_time(renders, tmp_path):
    """A hopper of 50 mm around two spheres; a plate from a file that moves 10 mm in the first 0.1 s, and turns."""
    write_binary_stl(tmp_path / "plate.stl", 0.01 * TETRAHEDRON + [0.0, 0.0, 0.02])
    plate = '[[wall]]\nshape = "surface"\nfile = "plate.stl"\nvelocity = [0.1, 0.0, 0.0]\nspin = [0.0, 0.0, 10.0]\n'
    for name, text in (("plain", ""), ("walls", HOPPER.replace("[run]", plate + "end = 0.1\n[run]"))):
        run = RunFolder.create(tmp_path / name, text, {}, None, QUANTITIES)
        if text:
            (tmp_path / name / "surfaces").mkdir()
            (tmp_path / "plate.stl").rename(tmp_path / name / "surfaces" / "wall_2.stl")
        points = {"position": np.array([[0.03, 0.03, 0.05], [0.03, 0.04, 0.1]]), "radius": np.full(2, 2e-3)}
        for step, time in enumerate((0.0, 0.1)):
            run.write_snapshot(time, step, None, points | {"velocity": np.zeros((2, 3))})
        stage = Stage.of(open_run(run.folder), [0], (), "speed", None)
    assert stage.figure(0).axes
    assert stage.bounds[0, 0] < 0.006 and stage.bounds[2, 1] == pytest.approx(0.2)  # the hopper is in view
    walls = walls_of(open_run(run.folder))
    shift = [_moved(_surface(walls[2], stage.bounds), walls[2], time).center for time in (0.0, 0.1, 0.2)]
    assert np.subtract(shift[1], shift[0])[0] == pytest.approx(0.01, abs=4e-3) and shift[2] == shift[1]
    assert _moved(_surface(walls[0], stage.bounds), walls[0], 0.0).bounds == pytest.approx(
        (5e-3, 55e-3) * 2 + (0.04, 0.07)
    )
    first = Scene(open_run(run.folder), off_screen=True)
    first.show(Look(0))
    assert {"wall 0", "wall 1", "wall 2", "edges 2"} <= first.plotter.renderers[0].actors.keys()
    first.plotter.close()


def test_solid_cells_are_grey(tmp_path):
    known = {**QUANTITIES, "fluid": {**QUANTITIES["fluid"], "solid": Quantity("1", "solid cells")}}
    run = RunFolder.create(tmp_path / "run", "", {}, GRID, known)
    solid = np.zeros((20, 4, 10), bool)
    solid[3:5, :, 2:6] = True
    fluid = {"voidage": np.ones(solid.shape), "velocity": np.zeros((*solid.shape, 3)), "solid": solid}
    run.write_snapshot(0.0, 0, fluid, {"id": [1], "position": np.full((1, 3), 0.01), "radius": np.full(1, 1e-3)})
    image = Stage.of(open_run(run.folder), [0], ("voidage",), "speed", None).figure(0).axes[0].images[-1].get_array()
    assert np.array_equal(image[..., 3] > 0.0, solid[:, 2]) and image[4, 3, 0] == pytest.approx(0x9A / 255)


def test_bubbles_and_freeboard_are_distinguished(bed):
    run = open_run(bed)
    bubble, freeboard = _bubbles(run.fluid("voidage", 0), run.grid)
    assert bubble.bounds[5] < 0.07 and bubble.center == pytest.approx((0.05, 0.02, 0.04), abs=0.006)
    assert freeboard.bounds[4] == pytest.approx(0.1, abs=0.01)
    assert not any(each.n_points for each in _bubbles(np.full((20, 4, 10), BUBBLE - 0.1), run.grid))


def test_curves_of_the_history(bed, tmp_path):
    assert history(bed, tmp_path / "curves.png").stat().st_size > 10_000
    with pytest.raises(InputError, match="did you mean 'bed_height'"):
        history(bed, tmp_path / "other.png", ["bed_hight"])


def test_species_of_a_mixture_colour_its_spheres_and_are_named(tmp_path: Path) -> None:
    text = 'title = "two"\n[bed.species.beads]\ncount = 2\n[bed.species.pellets]\ncount = 1\n'
    run = RunFolder.create(
        tmp_path / "two",
        text,
        {},
        None,
        QUANTITIES | {"particles": {**QUANTITIES["particles"], "species": Quantity("1", "")}},
    )
    particles = {"id": np.arange(3), "position": np.eye(3), "velocity": np.eye(3), "radius": np.full(3, 0.1)}
    run.write_snapshot(0.0, 0, None, particles | {"species": np.array([0, 1, 0], np.int32)})
    mixed = open_run(tmp_path / "two")
    assert colours.usual(mixed) == colours.choices(mixed)[0] == "species"
    assert colours.label(mixed, "species") == "0 beads, 1 pellets"
    low, high = colours.limits(colours.values(mixed, 0, "species")[1], "species")
    first, last = (colours.colour_map("species")((each - low) / (high - low)) for each in (0.0, 1.0))
    assert first[2] > first[0] and last[0] > last[2], "blue and orange"
    axes = Figure().add_subplot()
    _colour_bar(axes, colours.colour_map("species"), (low, high), "species", whole=True)
    bar = axes.figure.axes[1]
    assert (bar.get_yticks().tolist(), bar.get_ylim()) == ([0.0, 1.0], (-0.5, 1.5)), "one step for each species"


def test_wrong_options_give_one_line(renders, bed, tmp_path):
    with pytest.raises(InputError, match="did you mean 'bubbles'"):
        picture(bed, tmp_path / "a.png", show=("bubles",))
    with pytest.raises(InputError, match="did you mean 'radius'"):
        picture(bed, tmp_path / "a.png", colour="radus")
    with pytest.raises(
        InputError, match=r"show = 'vapour': must be a recorded field of the fluid; this run has velocity, voidage"
    ):
        picture(bed, tmp_path / "a.png", show=("vapour",))
    with pytest.raises(InputError, match=r"ends in \.png"):
        picture(bed, tmp_path / "a.jpg")
    with pytest.raises(InputError, match=r"ends in \.gif or \.mp4"):
        movie(bed, tmp_path / "a.avi")


# ---------------------------------------------------------------- missing graphics or packages


def test_the_remedy_is_named_if_the_machine_cannot_render(bed, tmp_path, monkeypatch):
    """A missing library kills the process; only the probe is killed."""
    monkeypatch.setattr(rendering, "_PROBE", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    monkeypatch.delenv("VTK_DEFAULT_OPENGL_WINDOW", raising=False)
    rendering.why_not.cache_clear()
    try:
        with pytest.raises(RunFailed, match="apt-get install -y --no-install-recommends libegl1 libgl1") as failure:
            picture(bed, tmp_path / "a.png")
        assert "\n" not in str(failure.value)
    finally:
        rendering.why_not.cache_clear()


def test_the_window_is_refused_without_a_screen(bed, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(RunFailed, match="there is no screen"):
        window(bed)


def test_a_missing_package_is_named(bed, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(InputError, match=r"meshio installed; `pip install 'cfddem\[export\]'`"):
        export(bed, "vtu", tmp_path)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'cfddem\[movie\]'"):
        movie(bed, tmp_path / "bed.mp4")


# ---------------------------------------------------------------- export


def test_vtu_holds_the_same_cells_and_particles(bed, tmp_path):
    pytest.importorskip("meshio", reason="needs `pip install 'cfddem[export]'`")
    import pyvista

    files = export(bed, "vtu", tmp_path / "out", [-1])
    assert [path.name for path in files] == ["particles-00000002.vtu", "fluid-00000002.vtu"]
    own, other = open_run(bed).mesh(2)["fluid"], pyvista.read(files[1])
    assert np.abs(own.cell_centers().points - other.cell_centers().points).max() < 1e-12  # type: ignore[union-attr]
    assert other.volume == pytest.approx(own.volume)  # type: ignore[union-attr]
    assert np.array_equal(own["voidage"], other["voidage"])  # type: ignore[index]
    assert np.array_equal(pyvista.read(files[0]).points, open_run(bed).particles(2)["position"])


def test_csv_has_units_and_the_same_numbers(bed, tmp_path):
    pandas = pytest.importorskip("pandas", reason="needs `pip install 'cfddem[export]'`")
    export(bed, "csv", tmp_path / "out")
    table = pandas.read_csv(tmp_path / "out/particles-00000001.csv")
    assert np.array_equal(table["velocity_y [m/s]"].astype("f4"), open_run(bed).particles(1)["velocity"][:, 1])
    assert pandas.read_csv(tmp_path / "out/history.csv")["pressure_drop [Pa]"].tolist() == [900.0, 901.0, 902.0]
    frame = pandas.DataFrame(open_run(bed).history)
    assert frame.columns.tolist() == ["time", "bed_height", "pressure_drop"]


def test_netcdf_holds_the_fluid_in_time(bed, tmp_path):
    xarray = pytest.importorskip("xarray", reason="needs `pip install 'cfddem[export]'`")
    pytest.importorskip("h5netcdf", reason="needs `pip install 'cfddem[export]'`")
    export(bed, "netcdf", tmp_path / "out")
    with xarray.open_dataset(tmp_path / "out/fluid.nc", engine="h5netcdf") as fluid:
        assert fluid["velocity"].dims == ("time", "z", "y", "x", "component")
        assert fluid["velocity"].attrs["units"] == "m/s"
        at = fluid["velocity"].sel(time=0.2, component="z").sel(z=0.105, x=0.015, y=0.005, method="nearest")
        assert float(at) == pytest.approx(0.205)
    with xarray.open_dataset(tmp_path / "out/particles-00000000.nc", engine="h5netcdf") as particles:
        assert np.array_equal(particles["position"], open_run(bed).particles(0)["position"])


def test_an_unknown_format_or_snapshot_is_one_line(bed, tmp_path):
    with pytest.raises(InputError, match="did you mean 'netcdf'"):
        export(bed, "netcdff", tmp_path)
    with pytest.raises(InputError, match="from 0 to 2"):
        export(bed, "csv", tmp_path, [3])


# ---------------------------------------------------------------- command line


def test_the_newest_run_is_found(bed, tmp_path):
    assert newest_run(bed.parent) == bed and newest_run(bed) == bed
    with pytest.raises(InputError, match="there is none in"):
        newest_run(tmp_path)


def test_commands_view_and_export(bed, tmp_path):
    def command(*words: str) -> subprocess.CompletedProcess:
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        line = [sys.executable, "-m", "cfddem", *words]
        return subprocess.run(line, cwd=tmp_path, env=environment, capture_output=True, text=True)

    assert command("view", str(bed), "--history").stdout == "bed-history.png\n"
    assert (tmp_path / "bed-history.png").exists()
    wrong = command("export", str(bed), "--to", "xls")
    assert wrong.returncode == 2 and wrong.stderr.startswith("cfddem: to = 'xls': must be one of vtu, csv, netcdf")
