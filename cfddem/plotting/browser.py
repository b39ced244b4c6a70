"""A page in the browser: rotate a run, move through time, see its history; follows a run that is still going.

The server draws and sends images, so that the page needs no graphics of its own and nothing from the network.
It accepts connections from this computer only, and requires the key in the address that it prints.
"""

from __future__ import annotations

import asyncio
import os
import secrets
import webbrowser
from pathlib import Path
from typing import Any

from cfddem.backend.errors import CfddemError, InputError
from cfddem.io.reading import Run, open_run
from cfddem.plotting import colours, rendering
from cfddem.plotting.browser_page import layout
from cfddem.plotting.history_strip import Strip, strip, usual_columns
from cfddem.plotting.panels import title_of
from cfddem.plotting.scene import NOTHING, Look, Scene

HOST = "127.0.0.1"
"""The only address that the server listens to."""

PORT = 8080
"""The port that is tried first; where it is taken, any free one."""

EVERY = 2.0
"""Wall time between two looks at the folder of a run [s]."""

PACE = 0.15
"""Wall time of one snapshot while time plays [s]."""


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

    def _take(self, run: Run) -> None:
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
            self.scene.follow(run)
        self.state.last = len(run.times) - 1
        if at_end:
            self.state.snapshot = self.state.last
        self._show()
        self._draw_history()

    def _begin(self, run: Run) -> None:
        """The first snapshot: which colours and layers there are; the page is built."""
        self.scene = Scene(run, off_screen=True)
        known = colours.choices(run)
        if self.state.colour not in known:
            colours.values(run, -1, self.state.colour)  # raises the error that names the nearest
        self.state.colours, self.state.layers = [*known, NOTHING], [*self.scene.layers, NOTHING]
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
        known = [name for name in self.run.history if name not in ("time", "step")]
        if known and not self.state.known_columns:
            self.state.columns = usual_columns(known)
        self.state.known_columns = known

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
