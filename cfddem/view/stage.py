"""What the pictures of a run have in common: their panels, what they show of space, the limits of their colours.

Panels are seen from the front, along the thinner horizontal side of the bed, and have axes in metres.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cfddem.errors import InputError, nearest
from cfddem.record.quantities import KNOWN
from cfddem.record.reading import Run
from cfddem.view import rendering
from cfddem.view.colours import bright, colour_bar, with_walls
from cfddem.view.layout import Layout
from cfddem.view.plots import BLUE, ORANGE, SKY, placed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BUBBLE = 0.8
"""Voidage on the border of a bubble."""

ABOVE = 1.4
"""Height that a picture shows over the largest height of the bed."""

SHARP = 200
"""Pixels of a rendered image per inch of paper."""

PANELS = ("spheres", "voidage", "bubbles", "streamlines")


@dataclass(frozen=True)
class Stage:
    """What stays the same from picture to picture: the panels, what they show of space, and the limits of colours."""

    run: Run
    panels: tuple[str, ...]
    bounds: np.ndarray  # (3, 2) [m]
    depth: int  # axis along which the bed is seen
    colour: str
    cut: bool
    limits: dict[str, tuple[float, float]]

    @classmethod
    def of(cls, run: Run, snapshots: Sequence[int], show: Sequence[str], colour: str, cut: bool | None) -> Stage:
        panels = tuple(show) or tuple(
            name
            for name, there in (("spheres", run.particle_fields), ("voidage", "voidage" in run.fluid_fields))
            if there
        )
        for name in panels:
            if name not in PANELS:
                raise InputError("show", name, nearest(name, PANELS))
        if "spheres" in panels or "bubbles" in panels:
            rendering.must_render()
        bounds = _bounds(run, snapshots)
        size = np.diff(bounds, axis=1).ravel()
        depth = 0 if size[0] < size[1] else 1
        limits: dict[str, tuple[float, float]] = {}
        deep = False
        if "spheres" in panels:
            shown = [run.particles(each) for each in snapshots]
            values = np.concatenate([_values(each, colour) for each in shown])
            high = float(np.quantile(values, 0.998)) if values.size else 1.0
            low = 0.0 if values.size == 0 or values.min() >= 0.0 else float(values.min())
            limits["spheres"] = (low, high if high > low else low + 1.0)
            largest = max((float(each["radius"].max()) for each in shown if len(each["radius"])), default=0.0)
            deep = size[depth] > 12.0 * largest
        if "voidage" in panels:
            lowest = min(float(np.nanmin(run.fluid("voidage", each))) for each in snapshots)
            limits["voidage"] = (min(np.floor(20.0 * lowest) / 20.0, 0.95), 1.0)
        if "streamlines" in panels:
            fastest = max(float(np.nanmax(_magnitude(run.fluid("velocity", each)))) for each in snapshots)
            limits["streamlines"] = (0.0, fastest or 1.0)
        return cls(run, panels, bounds, depth, colour, deep if cut is None else cut, limits)

    def frames(self) -> Iterator[np.ndarray]:
        """Images of all snapshots, 800 pixels wide at most."""
        for snapshot in range(len(self.run.times)):
            canvas: Any = self.figure(snapshot).canvas
            canvas.draw()
            image = np.asarray(canvas.buffer_rgba())[..., :3]
            yield image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2]  # films want even numbers

    def figure(self, snapshot: int) -> Figure:
        """The picture of one snapshot."""
        place = Layout.of(len(self.panels), self._size[1] / self._size[0])
        figure, axes = placed(place.figure, place.boxes)
        for name, panel, bar in zip(self.panels, axes[::2], axes[1::2]):
            pixels = (round(place.panel[0] * SHARP), round(place.panel[1] * SHARP))
            getattr(self, f"_{name}")(panel, bar, snapshot, pixels)
            self._finish(panel, place.panel)
        title = f"{_title(self.run)},  t = {self.run.times[snapshot]:.4g} s"
        heading = figure.suptitle(title, fontsize=12, fontweight="bold")
        too_wide = heading.get_window_extent().width / (0.96 * figure.bbox.width)
        heading.set_fontsize(12 / max(1.0, too_wide))
        return figure

    @property
    def label(self) -> str:
        """What the colour of the spheres shows, and its unit."""
        return f"{self.colour.replace('_', ' ')}  [{_unit(self.run, self.colour)}]"

    def coloured(self, snapshot: int) -> tuple[np.ndarray, np.ndarray]:
        """Radius of the spheres, and what their colour shows."""
        particles = self.run.particles(snapshot)
        return particles["radius"], _values(particles, self.colour)

    # ------------------------------------------------------------ panels

    def _spheres(self, axes: Axes, bar: Axes, snapshot: int, pixels: tuple[int, int]) -> None:
        particles = self.run.particles(snapshot)
        position, values = particles["position"], _values(particles, self.colour)
        title, behind = "spheres\nall", np.ones(len(position), bool)
        if self.cut:
            middle = float(self.bounds[self.depth].mean())
            behind = position[:, self.depth] >= middle if self.depth == 1 else position[:, self.depth] <= middle
            title = f"spheres\nbehind {'xy'[self.depth]} = {middle:.3g} m"
        colours = bright("viridis")
        image = rendering.spheres(
            position[behind], particles["radius"][behind], values[behind], self.bounds, self.depth,
            self.limits["spheres"], colours, pixels,
        )  # fmt: skip
        axes.imshow(image, extent=self._extent, aspect="equal", interpolation="antialiased")
        colour_bar(bar, colours, self.limits["spheres"], self.label)
        axes.set_title(title, loc="left")

    def _voidage(self, axes: Axes, bar: Axes, snapshot: int, pixels: tuple[int, int]) -> None:
        values, where = self._slice(self.run.fluid("voidage", snapshot))
        axes.imshow(
            values, origin="lower", extent=self._grid_extent, cmap=with_walls("Blues_r"), aspect="equal",
            vmin=self.limits["voidage"][0], vmax=1.0, interpolation="nearest",
        )  # fmt: skip
        title = f"voidage\nat {where}"
        if np.nanmin(values) < BUBBLE < np.nanmax(values) and min(values.shape) > 1:
            x, z = self._centres
            axes.contour(x, z, values, levels=[BUBBLE], colors=[ORANGE], linewidths=1.4)
            title += f", line: {BUBBLE:g}"
        colour_bar(bar, with_walls("Blues_r"), self.limits["voidage"], "voidage  [-]")
        axes.set_title(title, loc="left")

    def _bubbles(self, axes: Axes, bar: Axes, snapshot: int, pixels: tuple[int, int]) -> None:
        bubbles, freeboard = _bubbles(self.run.fluid("voidage", snapshot), self.run.grid)
        image = rendering.surfaces({SKY: bubbles, "#e3e3e3": freeboard}, self.bounds, self.depth, pixels)
        axes.imshow(image, extent=self._extent, aspect="equal", interpolation="antialiased")
        axes.set_title(
            "bubbles" + ("" if bubbles.n_points else ": none") + f"\nsurface of voidage {BUBBLE:g}", loc="left"
        )
        bar.set_visible(False)

    def _streamlines(self, axes: Axes, bar: Axes, snapshot: int, pixels: tuple[int, int]) -> None:
        velocity, where = self._slice(self.run.fluid("velocity", snapshot))
        speed = _magnitude(velocity)
        axes.imshow(
            speed, origin="lower", extent=self._grid_extent, cmap=with_walls("YlGnBu", 0.65), aspect="equal",
            vmin=0.0, vmax=self.limits["streamlines"][1], interpolation="nearest",
        )  # fmt: skip
        x, z = self._centres
        if min(speed.shape) > 1 and np.nanmax(speed) > 0.0:
            along, up = velocity[..., 1 - self.depth], velocity[..., 2]
            axes.streamplot(x, z, along, up, color=BLUE, linewidth=0.7, arrowsize=0.7, density=1.1)
        colour_bar(bar, with_walls("YlGnBu", 0.65), self.limits["streamlines"], "fluid speed  [m/s]")
        axes.set_title(f"fluid\nat {where}", loc="left", fontsize=10.5)

    # ------------------------------------------------------------ geometry

    @property
    def _size(self) -> tuple[float, float]:
        """Width and height of what a panel shows [m]."""
        size = np.diff(self.bounds, axis=1).ravel()
        return float(size[1 - self.depth]), float(size[2])

    @property
    def _extent(self) -> tuple[float, float, float, float]:
        return (*self.bounds[1 - self.depth], *self.bounds[2])

    @property
    def _grid_extent(self) -> tuple[float, float, float, float]:
        low, high = _edges(self.run)
        return low[1 - self.depth], high[1 - self.depth], low[2], high[2]

    @property
    def _centres(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates of the cells of a slice [m]."""
        grid: Any = self.run.grid
        lines = [x + h * (np.arange(n) + 0.5) for x, h, n in zip(grid.origin, grid.spacing, grid.cells)]
        return lines[1 - self.depth], lines[2]

    def _slice(self, field: np.ndarray) -> tuple[np.ndarray, str]:
        """The middle layer of cells [z, across], and where it lies."""
        grid: Any = self.run.grid
        layer = grid.cells[self.depth] // 2
        place = grid.origin[self.depth] + (layer + 0.5) * grid.spacing[self.depth]
        return np.take(field, layer, axis=2 - self.depth), f"{'xy'[self.depth]} = {place:.3g} m"

    def _finish(self, axes: Axes, inches: tuple[float, float]) -> None:
        """Both axes in metres, as many ticks as there is room for, a thin frame."""
        axes.set_xlim(*self._extent[:2])
        axes.set_ylim(*self._extent[2:])
        axes.set_xlabel(f"{'yx'[self.depth]}  [m]")
        axes.set_ylabel("z  [m]")
        axes.set_title(axes.get_title(loc="left"), loc="left", fontsize=10.5)
        axes.grid(False)
        axes.locator_params(axis="x", nbins=max(1, int(inches[0] / 0.7)))
        axes.locator_params(axis="y", nbins=max(2, int(inches[1] / 0.5)))
        for side in axes.spines.values():
            side.set_visible(True)
            side.set_color("#888888")


# ---------------------------------------------------------------- what is shown


def _values(particles: dict[str, np.ndarray], colour: str) -> np.ndarray:
    """What the colour of the spheres shows."""
    if "radius" not in particles:
        raise InputError("particles", sorted(particles), "recorded with their radius to be drawn")
    name = "velocity" if colour == "speed" else colour
    if name not in particles:
        raise InputError("colour", colour, nearest(colour, ["speed", *sorted(particles)]))
    values = particles[name]
    return _magnitude(values) if values.ndim == 2 else values.astype(float)


def _magnitude(vectors: np.ndarray) -> np.ndarray:
    length: np.ndarray = np.linalg.norm(vectors, axis=-1)
    return length


def _unit(run: Run, colour: str) -> str:
    unit = KNOWN["velocity"].unit if colour == "speed" else run.unit(colour)
    return "-" if unit == "1" else unit


def _edges(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of the grid [m]."""
    grid: Any = run.grid
    low = np.array(grid.origin)
    return low, low + np.array(grid.cells) * np.array(grid.spacing)


def _bounds(run: Run, snapshots: Sequence[int]) -> np.ndarray:
    """What the pictures show of space (3, 2) [m]: the grid up to where the bed ever came and a little higher, or else
    the particles with a little room."""
    if run.grid is not None:
        low, high = _edges(run)
        heights = run.history.get("bed_height", np.zeros(0))
        if np.isfinite(heights).any():
            high[2] = min(high[2], low[2] + max(ABOVE * float(np.nanmax(heights)), float((high - low)[:2].max())))
        return np.stack([low, high], axis=1)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for each in snapshots:
        particles = run.particles(each)
        if len(particles["position"]):
            reach = particles.get("radius", np.zeros(len(particles["position"])))[:, None]
            low = np.minimum(low, (particles["position"] - reach).min(axis=0))
            high = np.maximum(high, (particles["position"] + reach).max(axis=0))
    if not np.isfinite(low).all():
        raise InputError("snapshot", list(snapshots), "one with particles", "there is nothing to draw")
    room = 0.02 * float((high - low).max())
    return np.stack([low - room, high + room], axis=1)


def _title(run: Run) -> str:
    """The title that the case gives itself, or the name of the folder."""
    name = tomllib.loads(run.case_text).get("title")
    return name if isinstance(name, str) else run.folder.resolve().name


def _bubbles(voidage: np.ndarray, grid: Any) -> tuple[Any, Any]:
    """Surfaces of the regions of high voidage: those inside the bed, and the one that is open above.

    Side walls and bottom close a region.
    """
    import pyvista

    padded = np.pad(voidage, ((1, 0), (1, 1), (1, 1)), constant_values=float(np.nanmin(voidage)))
    first = np.array(grid.origin) - 0.5 * np.array(grid.spacing)
    image = pyvista.ImageData(dimensions=padded.shape[::-1], spacing=grid.spacing, origin=first)
    image.point_data["voidage"] = padded.ravel()
    border = image.contour([BUBBLE], scalars="voidage")
    if border.n_points == 0:
        return border, border
    parts = border.connectivity("all")
    regions, faces = np.asarray(parts.point_data["RegionId"]), parts.regular_faces
    top = parts.points[:, 2] > image.bounds[5] - 0.01 * grid.spacing[2]
    above = np.isin(regions, np.unique(regions[top]))[faces[:, 0]]
    closed, freeboard = (pyvista.PolyData.from_regular_faces(parts.points, faces[each]) for each in (~above, above))
    return closed.clean(), freeboard.clean()
