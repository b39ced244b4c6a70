"""The page in the browser: what it shows, that it follows a run, and that it is served to this computer only."""

from __future__ import annotations

import base64
import io
import os
import re
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from html import escape
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from chromium import Chromium, programs, until
from command_line import HOME, call
from made_up_run import made_up
from PIL import Image

from cfddem.backend.errors import InputError
from cfddem.io.quantities import TIME, Quantity, of_fields
from cfddem.io.reading import open_run
from cfddem.io.writer import RunFolder
from cfddem.particles.collision_events import COLLISION, COLLISION_FIELDS
from cfddem.particles.state import PARTICLE_FIELDS
from cfddem.plotting import colours, rendering
from cfddem.plotting.browser import strip
from cfddem.plotting.report_page import page
from cfddem.plotting.scene import FLUID, NOTHING, Look, Scene

GRID = SimpleNamespace(cells=(10, 4, 20), spacing=(0.01, 0.01, 0.01), origin=(0.0, 0.0, 0.0))
QUANTITIES = {
    "history": {"time": TIME, "bed_height": Quantity("m", "bed height"), "pressure_drop": Quantity("Pa", "drop")},
    "particles": of_fields(PARTICLE_FIELDS)
    | {"liquid": Quantity("m3", "liquid"), "agglomerate": Quantity("1", "name")},
    "fluid": {"voidage": Quantity("1", "voidage"), "velocity": Quantity("m/s", "velocity")},
    "collisions": of_fields(COLLISION_FIELDS),
}
POINTS = np.random.default_rng(1).random((300, 3)) * [0.1, 0.04, 0.1]


@pytest.fixture(autouse=True, scope="module")
def renders() -> None:
    """Skip with the reason if this machine cannot render."""
    fault = rendering.why_not()
    if fault:
        pytest.skip(fault)


@pytest.fixture
def run(tmp_path: Path) -> RunFolder:
    """A run that is still going, with three snapshots."""
    return written(tmp_path)


def written(place: Path) -> RunFolder:
    """A run in the folder `bed` of a place, still going, with three snapshots."""
    folder = RunFolder.create(place / "bed", 'title = "small bed"\n', {}, GRID, QUANTITIES)
    for k in range(3):
        write(folder, k)
    return folder


def write(run: RunFolder, k: int) -> None:
    """Write snapshot k: spheres that speed up, a rising bubble, one collision of particles 3 and 7 more each time."""
    z, y, x = np.meshgrid(*[0.01 * (np.arange(n) + 0.5) for n in (20, 4, 10)], indexing="ij")
    away = np.sqrt((x - 0.05) ** 2 + (y - 0.02) ** 2 + (z - 0.04 - 0.01 * k) ** 2)
    particles = {
        "id": np.arange(300), "position": POINTS, "velocity": POINTS * k, "radius": np.full(300, 2e-3),
        "liquid": 1e-12 * np.arange(300), "agglomerate": np.arange(300) // 2,
    }  # fmt: skip
    fluid = {"voidage": np.where((z > 0.1) | (away < 0.02), 1.0, 0.42), "velocity": np.stack([x, y, z + 0.1], axis=-1)}
    collisions = np.zeros(k, COLLISION)
    collisions["first"], collisions["second"], collisions["weight"] = 3, 7, 1.0
    run.append_history({"time": 0.1 * k, "bed_height": 0.1, "pressure_drop": 900.0 + k})
    run.write_snapshot(0.1 * k, k, fluid, particles, collisions)
    run.flush_history()


# ---------------------------------------------------------------- scene, colours and curves, without a server


def test_a_run_offers_the_colours_that_it_holds(run: RunFolder) -> None:
    assert colours.choices(open_run(run.folder)) == [
        "speed", "liquid", "agglomerate", "moisture", "collisions", "radius",
    ]  # fmt: skip


def test_collisions_are_counted_for_both_particles_since_the_previous_snapshot(run: RunFolder) -> None:
    counts = colours.values(open_run(run.folder), 2, "collisions")[1]
    assert counts[3] == counts[7] == 2.0 and counts.sum() == 4.0


def test_the_scene_draws_spheres_and_the_layer_of_cells_at_its_place(run: RunFolder) -> None:
    scene = Scene(open_run(run.folder), off_screen=True)
    images = {}
    for name, look in {
        "empty": Look(2, NOTHING, NOTHING), "spheres": Look(2), "cut": Look(2, cut=True),
        "layer": Look(2, NOTHING, "voidage"), "speed": Look(2, NOTHING, "speed"),
    }.items():  # fmt: skip
        scene.show(look)
        images[name] = scene.plotter.screenshot(return_img=True).astype(int)
    assert all(np.abs(images[name] - images["empty"]).mean() > 1.0 for name in images if name != "empty")
    assert np.abs(images["spheres"] - images["cut"]).mean() > 0.5
    assert np.abs(images["layer"] - images["speed"]).mean() > 1.0
    scene.show(Look(0, NOTHING, "voidage", place=0.9))
    plane = scene.plotter.renderers[FLUID].actors["drawn"].mapper.dataset
    assert plane.bounds[2:4] == pytest.approx((0.035, 0.035))  # the last of four layers
    values = plane.cell_data["values"].reshape(14, 10)  # up to 1.4 times the height of the bed
    assert (values[4, 5], values[4, 1]) == pytest.approx((1.0, 0.42))  # in the bubble and beside it
    scene.plotter.close()


def test_a_time_has_its_place_on_the_curves(run: RunFolder) -> None:
    curves = strip(open_run(run.folder), ["bed_height", "pressure_drop"])
    assert curves is not None
    image = np.asarray(Image.open(io.BytesIO(base64.b64decode(curves.image.split(",")[1]))).convert("L"))
    row = image[round((curves.bottom - 0.3 * (curves.bottom - curves.top)) * image.shape[0])]
    axis = int(np.flatnonzero(row < 200)[0])  # the vertical axis is at the first time
    assert curves.place_of(0.0) * image.shape[1] == pytest.approx(axis, abs=3)
    assert curves.place_of(0.1) == pytest.approx(0.5 * (curves.left + curves.right))
    assert curves.place_of(9.0) == curves.right
    assert strip(open_run(run.folder), []) is None


def test_a_missing_package_is_named(run: RunFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "trame.app", None)
    done = call("view", str(run.folder), "--web")
    assert (done.code, done.out) == (2, "")
    assert done.err == "cfddem: --web: must be used with trame installed; `pip install 'cfddem[web]'`\n"


# ---------------------------------------------------------------- the server, without a browser


@pytest.fixture
def viewer(run: RunFolder, request: pytest.FixtureRequest) -> Any:
    """The state of the page of the run."""
    pytest.importorskip("trame", reason="needs `pip install 'cfddem[web]'`")
    from cfddem.plotting.browser import Viewer

    return Viewer(run.folder, name=request.node.name)


def test_the_page_begins_at_the_last_snapshot_and_follows_the_run(viewer: Any, run: RunFolder) -> None:
    state = viewer.state
    assert (state.snapshot, state.last, state.clock, state.status) == (2, 2, "0.2 s", "running")
    assert state.colours[-1] == NOTHING and state.layers == ["voidage", "speed", NOTHING]
    assert not viewer.refresh()
    write(run, 3)
    assert viewer.refresh()
    assert (state.snapshot, state.last, state.clock) == (3, 3, "0.3 s")
    state.snapshot = 1
    write(run, 4)
    run.finish("finished")
    assert viewer.refresh()
    assert (state.snapshot, state.last, state.status) == (1, 4, "finished"), "someone looks at an earlier time"


def test_a_run_without_a_snapshot_is_waited_for(tmp_path: Path) -> None:
    pytest.importorskip("trame", reason="needs `pip install 'cfddem[web]'`")
    from cfddem.plotting.browser import Viewer

    folder = RunFolder.create(tmp_path / "bed", 'title = "small bed"\n', {}, GRID, QUANTITIES)
    viewer = Viewer(folder.folder, name="empty")
    assert viewer.state.problem == "no snapshot has been written yet"
    write(folder, 0)
    assert viewer.refresh() and viewer.state.problem == "" and viewer.state.clock == "0 s"


def test_an_unknown_colour_is_refused(run: RunFolder) -> None:
    pytest.importorskip("trame", reason="needs `pip install 'cfddem[web]'`")
    from cfddem.plotting.browser import Viewer

    with pytest.raises(InputError, match="did you mean 'liquid'"):
        Viewer(run.folder, "liqid", name="unknown")


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """The run that the command shows, still going."""
    return written(tmp_path_factory.mktemp("served"))


@pytest.fixture(scope="module")
def address(served: RunFolder, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address that the command prints."""
    pytest.importorskip("trame", reason="needs `pip install 'cfddem[web]'`")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"} | {"PYTHONPATH": str(HOME)}
    tmp_path = tmp_path_factory.mktemp("log")
    with open(tmp_path / "log", "w") as log:
        line = [sys.executable, "-m", "cfddem", "view", str(served.folder), "--web", "--port", str(port)]
        server = subprocess.Popen(line, stdout=log, stderr=log, env=environment)
    try:
        until(lambda: server.poll() is not None or "http" in (tmp_path / "log").read_text(), 60, "the server starts")
        printed = (tmp_path / "log").read_text()
        found = re.match(rf"(http://127\.0\.0\.1:{port}/\?secret=\S+)\nopen this address", printed)
        assert found, printed
        yield found[1]
    finally:
        server.terminate()
        server.wait(20)


def test_the_server_answers_this_computer_only(address: str) -> None:
    page = urllib.request.urlopen(address, timeout=20)
    assert page.status == 200 and b"<script" in page.read()
    port = int(address.split(":")[2].split("/")[0])
    with socket.socket() as other, pytest.raises(OSError):
        other.settimeout(2)
        other.connect(("127.0.0.2", port))  # a loopback address that a server on all addresses would answer


# ---------------------------------------------------------------- the page in Chromium


@pytest.fixture
def chromium(tmp_path: Path) -> Iterator[Chromium]:
    """A browser; skips if there is none."""
    if programs() is None:
        pytest.skip("needs chromium and chromedriver")
    browser = Chromium(tmp_path / "profile")
    yield browser
    browser.close()


def test_a_report_fits_the_screen_of_a_phone(tmp_path: Path, chromium: Chromium) -> None:
    """390 pixels wide: the page itself does not scroll sideways, and key results are read without scrolling a table."""
    page(made_up(tmp_path / "bed", trend=1e-3), tmp_path / "report.html")
    outer = tmp_path / "phone.html"
    frame = f'<iframe id="phone" width="390" height="800" srcdoc="{escape((tmp_path / "report.html").read_text())}">'
    outer.write_text(f"<!doctype html><body style='margin:0'>{frame}</iframe>")
    chromium.open(outer.as_uri())
    inner = "const page = document.getElementById('phone').contentDocument;"
    chromium.wait(f"{inner} return page.querySelector('table.key_results') && page.readyState == 'complete'")
    assert chromium.script(f"{inner} return page.documentElement.scrollWidth") <= 390
    wide = "return [...page.querySelectorAll('table.key_results')].map(each => each.scrollWidth - each.clientWidth)"
    assert chromium.script(f"{inner} {wide}") == [0]
    chromium.screenshot(tmp_path / "phone.png")


def test_the_page_needs_its_key(address: str, chromium: Chromium) -> None:
    chromium.open(address.split("?")[0])
    with pytest.raises(AssertionError):
        chromium.wait("return document.getElementById('clock')?.textContent", 4.0)


def test_the_page_is_drawn_and_moves_through_time(address: str, served: RunFolder, chromium: Chromium) -> None:
    chromium.open(address)
    clock = "return document.getElementById('clock')?.textContent.trim()"
    chromium.wait(f"{clock} == 'snapshot 2 of 2, t = 0.2 s'")
    chromium.wait("return document.querySelector('#strip img')?.naturalWidth > 100")
    picture = "return Array.from(document.querySelectorAll('img')).filter(each => each.naturalWidth > 600).length"
    chromium.wait(picture.replace("return ", "return 0 < "))
    mark = "return document.getElementById('mark').getBoundingClientRect().x"
    at_end = chromium.script(mark)
    chromium.keys("footer .v-slider-thumb", "\ue012")  # arrow to the left
    chromium.wait(f"{clock} == 'snapshot 1 of 2, t = 0.1 s'")
    assert chromium.script(mark) < at_end - 50
    chromium.keys("footer .v-slider-thumb", "\ue014")  # arrow to the right
    chromium.wait(f"{clock} == 'snapshot 2 of 2, t = 0.2 s'")
    write(served, 3)
    chromium.wait(f"{clock} == 'snapshot 3 of 3, t = 0.3 s'")
    chromium.click("#play")  # at the end it begins again
    chromium.wait(f"{clock} != 'snapshot 3 of 3, t = 0.3 s'")
    chromium.wait(f"{clock} == 'snapshot 3 of 3, t = 0.3 s'")
    asked = [each for each in chromium.requests() if not each.startswith(("data:", "blob:", "chrome:", "about:"))]
    own = tuple(scheme + address.split("/?")[0][4:] for scheme in ("http", "ws"))
    assert asked and all(each.startswith(own) for each in asked), "nothing is loaded from elsewhere"
    assert not [
        each for each in chromium.complaints() if "/paraview/" not in each
    ]  # where the client first asks for a session
