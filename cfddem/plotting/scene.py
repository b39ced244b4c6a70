"""A run in space that can be turned: its spheres and one layer of its fluid, a snapshot at a time.

The window on the screen and the page in the browser show this scene.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import RunFailed
from cfddem.io.quantities import declared, shown_unit
from cfddem.io.reading import RunData, open_run
from cfddem.plotting import colours, rendering
from cfddem.plotting.pictures import SOLID, bounds_of, depth_of, limits_of_fluid, spread_over
from cfddem.plotting.rendering import add_walls, walls_of

NOTHING = "none"
"""Choice of a layer or a colour that is not drawn."""

SPHERES, FLUID = 0, 1
"""Sides of the scene."""

_MOST_EXAMINED = 8
"""Snapshots that set the limits of view and colours."""

_SHADES = {"voidage": "Blues_r", "pressure": "cividis"}
"""Colour maps of fluid fields; of others that of the speed."""


@dataclass(frozen=True)
class Look:
    """What a scene shows."""

    snapshot: int = -1
    colour: str = colours.SPEED  # of the spheres, or none
    layer: str = NOTHING  # field of the fluid, or none
    place: float = 0.5  # of the layer, as a part of the depth
    cut: bool = False  # leave out the spheres in front of the layer


class Scene:
    """Spheres of a run and, beside them, a layer of its fluid; both are turned together, with axes in metres.

    run         with at least one snapshot
    off_screen  draw to memory only
    """

    def __init__(self, run: RunData, off_screen: bool = False) -> None:
        import pyvista

        make: Any = pyvista.Plotter
        self.plotter = make(
            off_screen=off_screen, shape=(1, 2), border=False, title=f"cfddem: {run.folder.name}", lighting="none"
        )
        self.plotter.set_background("white", all_renderers=True)
        self.plotter.link_views()
        self._bars: dict[int, str] = {}
        self.take(run)
        self.turn_to_front()

    def take(self, run: RunData) -> None:
        """Show a run from now on: the same one, read again when it has more snapshots."""
        self.run = run
        self._examined = spread_over(run, _MOST_EXAMINED)
        self._limits: dict[tuple[int, str], tuple[float, float]] = {}
        self.bounds, self._walls = bounds_of(run, self._examined), walls_of(run)
        self.depth = depth_of(self.bounds)
        for side in (SPHERES, FLUID):
            self.plotter.subplot(0, side)
            axes = self.plotter.show_bounds(
                bounds=self.bounds.ravel(), xtitle="x", ytitle="y", ztitle="z", color="black",
                show_xlabels=self.depth == 1, show_ylabels=self.depth == 0, font_size=9, n_xlabels=3, n_ylabels=3,
                n_zlabels=4, fmt="%.3g m", location="outer",
            )  # fmt: skip
            axes.SetEnableDistanceLOD(False)  # labels would vanish where the view is small
            axes.SetEnableViewAngleLOD(False)

    @property
    def layers(self) -> list[str]:
        """Fluid fields that a layer can show, the voidage first."""
        names = ["speed" if name == "velocity" else name for name in self.run.fluid_fields]
        return sorted(names, key=lambda name: (name != "voidage", name))

    def turn_to_front(self) -> None:
        """Look at the run from the front, slightly from above."""
        eye = (0.35, -1.0, 0.2) if self.depth == 1 else (1.0, -0.35, 0.2)
        self.plotter.camera_position = [eye, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
        self.plotter.reset_camera(bounds=self.bounds.ravel())
        self.plotter.camera.zoom(1.1)

    def show(self, look: Look) -> None:
        """Draw what is chosen; the camera stays."""
        place = range(len(self.run.times))[look.snapshot]
        shown = look.colour != NOTHING and bool(self.run.particle_fields), look.layer != NOTHING and bool(self.layers)
        middle = 0.5 if all(shown) else float(shown[SPHERES] or not shown[FLUID])
        for side, (begin, end) in enumerate([(0.0, middle), (middle, 1.0)]):
            self.plotter.renderers[side].SetViewport(begin, 0.0, end, 1.0)
            self.plotter.renderers[side].SetDraw(end > begin)
            self.plotter.subplot(0, side)
            self._clear(side)
        if shown[FLUID]:
            self._add_layer(place, look)
        self.plotter.subplot(0, SPHERES)
        if shown[SPHERES]:
            self._add_spheres(place, look)
            add_walls(self.plotter, self._walls, self.bounds, self.run.times[place])
        self.plotter.add_text(f"t = {self.run.times[place]:.4g} s", name="time", color="black", font_size=10)

    # ------------------------------------------------------------ parts of the scene

    def _clear(self, side: int) -> None:
        """Remove what a side has drawn before."""
        self.plotter.remove_actor("drawn", render=False)
        title = self._bars.pop(side, None)
        if title in self.plotter.scalar_bars:
            self.plotter.remove_scalar_bar(title, render=False)

    def _add_spheres(self, snapshot: int, look: Look) -> None:
        particles, values = colours.values(self.run, snapshot, look.colour)
        position, radius = particles["position"], particles["radius"]
        if look.cut:
            behind = position[:, self.depth] - self._position_of_layer(look)
            kept = behind >= 0.0 if self.depth == 1 else behind <= 0.0
            position, radius, values = position[kept], radius[kept], values[kept]
        title = None if look.colour == colours.AGGLOMERATE else colours.label(self.run, look.colour)
        rendering.add_spheres(
            self.plotter, position, radius, values, self._limits_of(SPHERES, look.colour),
            colours.colour_map(look.colour), name="drawn", render=False, **self._bar(SPHERES, title),
        )  # fmt: skip

    def _add_layer(self, snapshot: int, look: Look) -> None:
        """One layer of cells, up to the top of the view, as a plane through their centres."""
        import pyvista

        grid: Any = self.run.grid
        cells, origin = np.array(grid.cells), np.array(grid.origin, float)
        cells[2] = min(cells[2], math.ceil((self.bounds[2, 1] - origin[2]) / grid.spacing[2] - 1e-9))
        values = np.take(self._fluid(look.layer, snapshot)[: cells[2]], self._layer_number(look), axis=2 - self.depth)
        corners = cells + 1
        corners[self.depth] = 1
        origin[self.depth] = self._position_of_layer(look)
        plane = pyvista.ImageData(dimensions=corners, spacing=grid.spacing, origin=origin)
        plane.cell_data["values"] = values.ravel()
        unit = declared(self.run.quantities, "fluid", "velocity" if look.layer == "speed" else look.layer).unit
        label = f"{look.layer}{'' if look.layer == 'voidage' else ' of the fluid'}  [{shown_unit(unit)}]"
        self.plotter.add_mesh(
            plane, scalars="values", cmap=_shades_of(look.layer),
            clim=self._limits_of(FLUID, look.layer), name="drawn", lighting=False, render=False,
            nan_color=SOLID, **self._bar(FLUID, label),
        )  # fmt: skip

    def _fluid(self, layer: str, snapshot: int) -> np.ndarray:
        """Values of a fluid field (nz, ny, nx); of a vector its magnitude. NaN in solid cells."""
        values = self.run.fluid("velocity" if layer == "speed" else layer, snapshot)
        values = colours.magnitude(values) if values.ndim == 4 else values
        if "solid" not in self.run.fluid_fields or layer == "solid":
            return values
        return np.where(self.run.fluid("solid", snapshot) > 0, np.nan, values)

    def _layer_number(self, look: Look) -> int:
        count = self.run.grid.cells[self.depth]  # type: ignore[union-attr]
        return min(int(look.place * count), count - 1)

    def _position_of_layer(self, look: Look) -> float:
        """Position of the layer along the line of sight [m]; without a grid, that of the same part of the depth."""
        if self.run.grid is None:
            low, high = self.bounds[self.depth]
            return float(low + look.place * (high - low))
        grid = self.run.grid
        return float(grid.origin[self.depth] + (self._layer_number(look) + 0.5) * grid.spacing[self.depth])

    def _limits_of(self, side: int, name: str) -> tuple[float, float]:
        """Values of the first and the last colour, alike for all snapshots."""
        if (side, name) not in self._limits:
            if side == SPHERES:
                arrays = [colours.values(self.run, snapshot, name)[1] for snapshot in self._examined]
            else:
                arrays = [self._fluid(name, snapshot).ravel() for snapshot in self._examined]
            together = np.concatenate(arrays)
            together = together[np.isfinite(together)]
            of_fluid = side == FLUID and name != "speed" and together.size
            self._limits[side, name] = (limits_of_fluid if of_fluid else colours.limits)(together, name)
        return self._limits[side, name]

    def _bar(self, side: int, title: str | None) -> dict[str, Any]:
        """Options of a vertical colour bar; none without a title."""
        if title is None:
            return {"show_scalar_bar": False}
        self._bars[side] = title
        return {
            "scalar_bar_args": {
                "title": title, "color": "black", "title_font_size": 12, "label_font_size": 12, "vertical": True,
                "position_x": 0.84, "position_y": 0.25, "width": 0.1, "height": 0.5, "fmt": "%.3g",
            }
        }  # fmt: skip


def _shades_of(layer: str) -> Any:
    """Colour map of a layer of cells."""
    if layer == colours.TEMPERATURE:
        return colours.colour_map(layer)
    return _SHADES.get(layer) or colours.part_of("YlGnBu", 0.0, 0.9)


# ---------------------------------------------------------------- a window


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


def scene(run: RunData, colour: str = "speed", off_screen: bool = False) -> Any:
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
