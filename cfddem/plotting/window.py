"""An interactive window: rotate a run and move through time."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import RunFailed
from cfddem.io.reading import Run, open_run
from cfddem.plotting import rendering
from cfddem.plotting.scene import NOTHING, Look, Scene


def window(folder: str | Path, colour: str = "speed") -> None:
    """Show a run in a window with a time slider, until the window is closed.

    folder  of a run
    colour  of the spheres: speed, collisions, or a recorded field; of a vector its magnitude
    errors  RunFailed if there is no screen
    """
    if not os.environ.get("DISPLAY"):
        raise RunFailed(
            "view: there is no screen (DISPLAY is not set); use --web for a page in the browser, "
            "or leave out --window to write a picture"
        )
    scene(open_run(folder), colour).show()


def scene(run: Run, colour: str = "speed", off_screen: bool = False) -> Any:
    """Spheres, a layer of the voidage, axes in metres and a time slider, as a pyvista Plotter."""
    rendering.require_rendering()
    shown = Scene(run, off_screen)
    layer = "voidage" if "voidage" in run.fluid_fields else NOTHING

    def show(time: float) -> None:
        shown.show(Look(int(np.abs(run.times - time).argmin()), colour, layer))

    show(float(run.times[-1]))
    if len(run.times) > 1:
        shown.plotter.add_slider_widget(
            show, [run.times[0], run.times[-1]], value=run.times[-1], title="time [s]", color="black",
            pointa=(0.3, 0.07), pointb=(0.7, 0.07), title_height=0.02, fmt="%.3g",
        )  # fmt: skip
    return shown.plotter
