"""A page in the browser: rotate a run, move through time, see its history; follows a run that is still going.

The server draws and sends images, so that the page needs no graphics of its own and nothing from the network.
It accepts connections from this computer only, and requires the key in the address that it prints.
"""

from __future__ import annotations

import asyncio
import os
import secrets
import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cfddem.backend.errors import CfddemError, InputError
from cfddem.io.quantities import shown_unit
from cfddem.io.reading import RunData, open_run
from cfddem.plotting import colours, rendering
from cfddem.plotting.curves import BLUE, blank, encoded
from cfddem.plotting.pictures import title_of
from cfddem.plotting.scene import NOTHING, Look, Scene

HOST = "127.0.0.1"
"""The only address that the server listens to."""

PORT = 8080
"""The port that is tried first; where it is taken, any free one."""

EVERY = 2.0
"""Wall time between two looks at the folder of a run [s]."""

PACE = 0.15
"""Wall time of one snapshot while time plays [s]."""

USUAL = ("bed_height", "pressure_drop", "kinetic_energy", "largest_speed")
"""Columns that are shown at first, as far as a run has them."""

_MOST, _USED = 6, 3
_WIDTH, _PANEL, _AROUND = 4.2, 1.35, 0.5  # of the image, of a panel, of the time axis [inch]

_SIDE = "width: 430px; min-width: 430px; overflow-y: auto; border-left: 1px solid #ddd; padding: 12px"
_MARK = (
    "`position: absolute; width: 2px; background: #e08a00; left: ${100 * mark}%; top: ${100 * strip_top}%; "
    "height: ${100 * (strip_bottom - strip_top)}%`"
)


def browse(folder: str | Path, colour: str = colours.SPEED, port: int | None = None) -> None:
    """Serve the page of a run until it is interrupted from the keyboard.

    folder  of a run, finished or still going
    colour  of the spheres at first
    port    to listen to; 8080 or any free one if not given
    errors  InputError if trame is not installed, or the port is taken; RunFailed if this machine cannot render
    """
    viewer = Viewer(folder, colour)
    if not len(viewer.run.times):
        raise InputError("folder", str(folder), "a run with a snapshot", "none has been written yet")
    key = secrets.token_hex(16)
    os.environ["TRAME_ARGS"] = f"--authKey {key}"  # trame would read the options of cfddem otherwise

    def ready(**_: Any) -> None:
        address = f"http://{HOST}:{viewer.server.port}/?secret={key}"
        print(f"{address}\nopen this address in a browser on this computer; stop with Ctrl-C", flush=True)
        asyncio.get_event_loop().create_task(viewer.watch())
        if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            webbrowser.open(address)

    viewer.server.controller.on_server_ready.add(ready)
    viewer.server.start(
        port=_free_port(port), host=HOST, timeout=0, open_browser=False, show_connection_info=False,
        disable_logging=True,
    )  # fmt: skip


class Viewer:
    """The state of the page, and what happens when it changes.

    folder  of a run
    colour  of the spheres at first
    name    of the trame server
    """

    def __init__(self, folder: str | Path, colour: str = colours.SPEED, name: str | None = None) -> None:
        self.server = _server(name)
        rendering.require_rendering()
        self.folder = Path(folder)
        self.run = open_run(folder)
        self.state: Any = self.server.state
        self.scene: Scene | None = None
        self._strip: Strip | None = None
        self._stamp = self._signature()
        self._motion: asyncio.Task[None] | None = None  # through time, while it plays
        self.state.update(
            {
                "title": title_of(self.run), "colour": colour, "layer": NOTHING, "place": 0.5, "cut": True,
                "place_counts": False, "snapshot": 0, "last": 0, "clock": "", "status": "", "problem": "",
                "playing": False, "follow": True, "colours": [], "layers": [], "columns": [], "known_columns": [],
                "strip": "", "mark": 0.0, "strip_top": 0.0, "strip_bottom": 0.0,
            }
        )  # fmt: skip
        self.view: Any = None
        self._take(self.run)
        names = ("snapshot", "colour", "layer", "place", "cut")
        self.state.change(*names)(self._show)
        self.state.change("columns")(self._draw_history)
        self.state.change("playing")(self._play)

    # ------------------------------------------------------------ what the page asks for

    def turn_to_front(self) -> None:
        """Put the camera back."""
        if self.scene is not None:
            self.scene.turn_to_front()
            self._push()

    async def watch(self) -> None:
        """Look at the folder from time to time, as long as the page is served."""
        while True:
            await asyncio.sleep(EVERY)
            with self.state:
                self.refresh()

    def refresh(self) -> bool:
        """Read the run again if its folder has changed; with `follow`, go to the last snapshot."""
        stamp = self._signature()
        if stamp == self._stamp:
            return False
        self._stamp = stamp
        try:
            self.state.problem = ""
            self._take(open_run(self.folder))
        except CfddemError as failure:
            self.state.problem = str(failure)
        return True

    # ------------------------------------------------------------ what the page shows

    def _take(self, run: RunData) -> None:
        """Show a run, just read."""
        self.run = run
        self.state.status = f"{run.status}: {run.message}" if run.message else run.status
        self._find_columns()
        if not len(run.times):
            self.state.problem = "no snapshot has been written yet"
            return
        at_end = self.scene is None or (self.state.follow and self.state.snapshot == self.state.last)
        if self.scene is None:
            self._begin(run)
        else:
            self.scene.take(run)
        self.state.last = len(run.times) - 1
        if at_end:
            self.state.snapshot = self.state.last
        self._show()
        self._draw_history()

    def _begin(self, run: RunData) -> None:
        """The first snapshot: which colours and layers there are; the page is built."""
        self.scene = Scene(run, off_screen=True)
        choices = colours.choices(run)
        if self.state.colour not in choices:
            colours.values(run, -1, self.state.colour)  # raises the error that names the nearest
        self.state.colours, self.state.layers = [*choices, NOTHING], [*self.scene.layers, NOTHING]
        self.state.layer = self.state.layers[0]
        self._page, self.view = layout(self)

    def _show(self, **_: Any) -> None:
        """Draw the snapshot that is chosen and mark its time."""
        if self.scene is None:
            return
        state = self.state
        look = Look(int(state.snapshot), state.colour, state.layer, float(state.place), bool(state.cut))
        try:
            self.scene.show(look)
        except CfddemError as failure:  # such as a damaged snapshot
            state.problem = str(failure)
            return
        state.clock = f"{self.run.times[look.snapshot]:.4g} s"
        self._mark()
        self._push()

    def _push(self) -> None:
        if self.view is not None:
            self.view.update()

    def _find_columns(self) -> None:
        columns = [name for name in self.run.history if name not in ("time", "step")]
        if columns and not self.state.known_columns:
            self.state.columns = usual_columns(columns)
        self.state.known_columns = columns

    def _draw_history(self, **_: Any) -> None:
        self._strip = strip(self.run, self.state.columns)
        self.state.strip = self._strip.image if self._strip else ""
        self._mark()

    def _mark(self) -> None:
        """Put the line of the present time over the curves."""
        if self._strip and self.scene is not None:
            time = float(self.run.times[int(self.state.snapshot)])
            self.state.mark = self._strip.place_of(time)
            self.state.strip_top, self.state.strip_bottom = self._strip.top, self._strip.bottom

    def _play(self, playing: bool = False, **_: Any) -> None:
        if playing and (self._motion is None or self._motion.done()):
            self._motion = asyncio.get_event_loop().create_task(self._advance())

    async def _advance(self) -> None:
        """Move through time until the last snapshot, from the first if it is at the last."""
        if self.state.snapshot >= self.state.last:
            with self.state:
                self.state.snapshot = 0
        while self.state.playing and self.state.snapshot < self.state.last:
            await asyncio.sleep(PACE)
            with self.state:
                self.state.snapshot += 1
        with self.state:
            self.state.playing = False

    def _signature(self) -> tuple[Any, ...]:
        """What changes in the folder of a run when it goes on."""
        times = []
        for name in ("run.json", "history.h5", "data"):
            try:
                times.append((self.folder / name).stat().st_mtime_ns)
            except OSError:
                times.append(0)
        return tuple(times)


def _server(name: str | None) -> Any:
    """A server of trame.

    errors  InputError with the remedy if a part of trame is missing
    """
    try:
        from trame.app import get_server
        from trame.ui import vuetify3  # noqa: F401
        from trame.widgets import vtk  # noqa: F401
    except ImportError:
        raise InputError("--web", None, "used with trame installed", "`pip install 'cfddem[web]'`") from None
    return get_server(name, client_type="vue3")


def _free_port(port: int | None) -> int:
    """A port that can be listened to: the given one, else 8080, else any (0).

    errors  InputError if the given port is taken
    """
    import socket

    for wanted in (PORT, 0) if port is None else (port,):
        with socket.socket() as tried:
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                tried.bind((HOST, wanted))
                return wanted
            except (OSError, OverflowError) as failure:
                why = getattr(failure, "strerror", None) or str(failure)
    raise InputError("port", port, "a free port from 1 to 65535", why.lower())


# ---------------------------------------------------------------- the page: view, choices, history, time


def layout(viewer: Viewer) -> tuple[Any, Any]:
    """Build the page; returns it, and the view in it, whose `update()` sends a new image."""
    from trame.ui.vuetify3 import VAppLayout
    from trame.widgets import html
    from trame.widgets import vtk as vtk_widgets
    from trame.widgets import vuetify3 as v3

    server = viewer.server
    server.state.trame__title = f"cfddem: {server.state.title}"
    with VAppLayout(server) as page:
        with v3.VAppBar(density="compact", flat=True, border=True):
            v3.VAppBarTitle("{{ title }}")
            html.Span("{{ status }}", classes="text-medium-emphasis mr-4", id="status")
            v3.VBtn("front", click=viewer.turn_to_front, variant="text", id="front")
        with v3.VMain(style="height: 100vh"), html.Div(style="display: flex; height: 100%"):
            with html.Div(style="flex: 1; min-width: 0; position: relative"):
                view = vtk_widgets.VtkRemoteView(
                    viewer.scene.plotter.render_window,  # type: ignore[union-attr]
                    interactive_ratio=1, still_quality=95,
                )  # fmt: skip
                v3.VAlert(
                    "{{ problem }}", v_if="problem", type="warning", density="compact",
                    style="position: absolute; top: 8px; left: 8px; right: 8px",
                )  # fmt: skip
            with html.Div(style=_SIDE):
                _choices(v3)
                _curves(html, v3)
        with v3.VFooter(app=True, border=True, classes="py-1", style="gap: 12px"):
            _time(html, v3)
    return page, view


def _choices(v3: Any) -> None:
    """What the view shows."""
    options = {"density": "compact", "hide_details": True, "variant": "outlined", "classes": "mb-3"}
    v3.VSelect(v_model=("colour",), items=("colours",), label="colour of the spheres", id="colour", **options)
    v3.VSelect(v_model=("layer",), items=("layers",), label="layer of the fluid", id="layer", **options)
    v3.VSlider(
        v_model=("place",), min=0, max=1, step=0.02, label="position of the layer", density="compact",
        hide_details=True, id="place",
    )  # fmt: skip
    v3.VCheckbox(
        v_model=("cut",), label="spheres behind the layer only", density="compact", hide_details=True, id="cut"
    )


def _curves(html: Any, v3: Any) -> None:
    """The history, with a line at the time of the view."""
    v3.VSelect(
        v_model=("columns",), items=("known_columns",), label="history", multiple=True, chips=True, density="compact",
        hide_details=True, variant="outlined", classes="mb-2 mt-2", id="columns",
    )  # fmt: skip
    with html.Div(style="position: relative", v_if="strip", id="strip"):
        html.Img(src=("strip",), style="width: 100%; display: block")
        html.Div(style=(_MARK,), id="mark")


def _time(html: Any, v3: Any) -> None:
    """Time: play, slider, clock, follow."""
    v3.VBtn(
        icon=("playing ? 'mdi-pause' : 'mdi-play'",), click="playing = !playing", variant="text", density="compact",
        id="play",
    )  # fmt: skip
    v3.VSlider(v_model=("snapshot",), min=0, max=("last",), step=1, hide_details=True, density="compact", id="time")
    html.Span(
        "snapshot {{ snapshot }} of {{ last }},  t = {{ clock }}",
        style="min-width: 230px; white-space: nowrap",
        id="clock",
    )
    v3.VSwitch(v_model=("follow",), label="follow", hide_details=True, density="compact", color="primary", id="follow")


# ---------------------------------------------------------------- the history as one narrow image


@dataclass(frozen=True)
class Strip:
    """An image of curves, with the place of its time axis in parts of the image."""

    image: str  # PNG as an address that holds its data
    left: float  # of the first time
    right: float  # of the last time
    top: float
    bottom: float
    first: float  # time at `left` [s]
    last: float  # time at `right` [s]

    def place_of(self, time: float) -> float:
        """Horizontal place of a time, 0 to 1 of the image."""
        part = (time - self.first) / (self.last - self.first)
        return self.left + min(max(part, 0.0), 1.0) * (self.right - self.left)


def usual_columns(columns: Sequence[str]) -> list[str]:
    """The columns that are shown at first."""
    return [name for name in USUAL if name in columns][:_USED] or list(columns[:_USED])


def strip(run: RunData, columns: Sequence[str]) -> Strip | None:
    """Curves of some columns against time, one below the other; None if there is nothing to draw."""
    names = [name for name in columns if name in run.history][:_MOST]
    if not names or len(run.history["time"]) < 2:
        return None
    time = run.history["time"]
    figure, axes = blank(len(names), 1, width=_WIDTH, height=_AROUND + _PANEL * len(names), sharex=True)
    for name, panel in zip(names, axes):
        panel.plot(time, run.history[name], color=BLUE, linewidth=1.3)
        panel.set_title(f"{name.replace('_', ' ')}  [{shown_unit(run.unit(name))}]", loc="left", fontsize=10)
        panel.tick_params(labelsize=9)
        panel.locator_params(axis="y", nbins=4)
    first, last = float(time[0]), float(time[-1])
    axes[-1].set_xlim(first, last if last > first else first + 1.0)
    axes[-1].set_xlabel("time  [s]", fontsize=10)
    image = "data:image/png;base64," + encoded(figure, 200)  # lays the figure out, too
    boxes = [panel.get_position() for panel in axes]
    begin, end = axes[-1].get_xlim()
    return Strip(image, boxes[0].x0, boxes[0].x1, 1.0 - boxes[0].y1, 1.0 - boxes[-1].y0, begin, end)
