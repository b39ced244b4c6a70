"""An interactive window: rotate a run and move through time."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import RunFailed
from cfddem.io.reading import Run, open_run
from cfddem.plotting import rendering
from cfddem.plotting.panels import Stage


def window(folder: str | Path, colour: str = "speed") -> None:
    """Show a run in a window with a time slider, until the window is closed.

    folder  of a run
    colour  of the spheres: speed, or a recorded field; of a vector its magnitude
    errors  RunFailed if there is no screen
    """
    if not os.environ.get("DISPLAY"):
        raise RunFailed("view: there is no screen (DISPLAY is not set); leave out --window to write a picture")
    scene(open_run(folder), colour).show()


def scene(run: Run, colour: str = "speed", off_screen: bool = False) -> Any:
    """Spheres, a slice of the voidage, axes in metres and a time slider, as a pyvista Plotter."""
    import pyvista

    last = len(run.times) - 1
    stage = Stage.of(run, [last], (), colour, cut=False)
    plotter: Any = pyvista.Plotter(off_screen=off_screen, title=f"cfddem: {run.folder.name}")
    plotter.set_background("white")

    def show(time: float) -> None:
        place = int(np.abs(run.times - time).argmin())
        if "spheres" in stage.panels:
            rendering.add_spheres(
                plotter, run.particles(place)["position"], *stage.coloured(place), stage.limits["spheres"],
                stage.colours, name="spheres", scalar_bar_args=_bar(stage.label, 0.05),
            )  # fmt: skip
        if "voidage" in stage.panels:
            layer: Any = run.mesh(place)["fluid"]
            plotter.add_mesh(
                layer.slice(normal="xy"[stage.depth]), scalars="voidage", cmap="Blues_r", clim=stage.limits["voidage"],
                name="voidage", lighting=False, scalar_bar_args=_bar("voidage  [-]", 0.88),
            )  # fmt: skip
        plotter.add_text(f"t = {run.times[place]:.4g} s", name="time", color="black", font_size=12)

    show(float(run.times[last]))
    plotter.show_bounds(
        bounds=stage.bounds.ravel(), xtitle="x [m]", ytitle="y [m]", ztitle="z [m]", color="black", font_size=10,
        n_xlabels=3, n_ylabels=3, n_zlabels=5, fmt="%.3g", location="outer",
    )  # fmt: skip
    if last > 0:
        plotter.add_slider_widget(
            show, [run.times[0], run.times[last]], value=run.times[last], title="time [s]", color="black",
            pointa=(0.3, 0.07), pointb=(0.7, 0.07), title_height=0.02, fmt="%.3g",
        )  # fmt: skip
    plotter.view_vector((0.5, -1.0, 0.3))
    plotter.camera.zoom(0.8)
    return plotter


def _bar(title: str, left: float) -> dict[str, Any]:
    """Options of a vertical colour bar."""
    return {"title": title, "vertical": True, "position_x": left, "position_y": 0.25, "height": 0.5, "color": "black"}
