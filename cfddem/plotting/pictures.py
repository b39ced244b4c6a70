"""Pictures and films of a run: coloured spheres, slices of voidage, bubbles, streamlines.

>>> from cfddem.plotting.pictures import picture       # doctest: +SKIP
>>> picture("bed-run", "bed.png")                  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cfddem.backend.errors import InputError, nearest
from cfddem.case.toml_text import parse
from cfddem.io.files import PARTIAL
from cfddem.io.reading import RunData, open_run
from cfddem.plotting import colours, rendering
from cfddem.plotting.curves import BLUE, ORANGE, SKY, blank, save
from cfddem.plotting.rendering import add_walls, walls_of, with_walls

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_EXAMINED = 20  # snapshots that set the colour limits of a film


def picture(
    folder: str | Path,
    output: str | Path | None = None,
    *,
    snapshot: int = -1,
    show: Sequence[str] = (),
    colour: str | None = None,
    cut: bool | None = None,
) -> Path:
    """Draw one snapshot: spheres coloured by species in a mixture, else by speed, and with a fluid a slice of voidage.

    folder    of a run
    output    PNG; NAME.png in the current folder if not given
    snapshot  0 the first, -1 the last
    show      panels: spheres, voidage, bubbles, streamlines, temperature and vapour of the fluid
    colour    of the spheres: speed, moisture, or a recorded field; of a vector its magnitude; None for the usual one
    cut       leave out the spheres in front of the middle plane; None does so in deep beds
    returns   the file
    errors    RunFailed with the remedy if this machine cannot render
    """
    run = open_run(folder)
    output = Path(f"{Path(folder).resolve().name}.png" if output is None else output)
    if output.suffix.lower() != ".png":
        raise InputError("output", str(output), "a file that ends in .png", "use movie for films")
    stage = Stage.of(run, [snapshot], show, colour, cut)
    save(stage.figure(snapshot), output)
    return output


def movie(
    folder: str | Path,
    output: str | Path,
    *,
    frames_per_second: float = 10.0,
    show: Sequence[str] = (),
    colour: str | None = None,
    cut: bool | None = None,
) -> Path:
    """Make a film of all snapshots, drawn as by `picture`, with the same colour limits throughout.

    output             ends in .gif or .mp4
    frames_per_second  of the film [1/s]
    others, returns    as `picture`
    errors             RunFailed if this machine cannot render; InputError if .mp4 lacks its package
    """
    run, output = open_run(folder), Path(output)
    if output.suffix.lower() not in (".gif", ".mp4"):
        raise InputError("output", str(output), "a file that ends in .gif or .mp4")
    if output.suffix.lower() == ".mp4":
        _require_ffmpeg()
    stage = Stage.of(run, spread_over(run, _MOST_EXAMINED), show, colour, cut)
    fresh = output.with_name(f".{output.stem}{PARTIAL}{output.suffix}")
    fresh.unlink(missing_ok=True)
    try:
        (_write_gif if output.suffix.lower() == ".gif" else _write_mp4)(fresh, stage.frames(), frames_per_second)
        fresh.replace(output)
    finally:
        fresh.unlink(missing_ok=True)
    return output


def _require_ffmpeg() -> None:
    from importlib.util import find_spec

    if find_spec("imageio") is None or find_spec("imageio_ffmpeg") is None:
        raise InputError(
            "output", ".mp4", "written by imageio-ffmpeg", "`pip install 'cfddem[movie]'`, or ask for .gif"
        )


def _write_gif(path: Path, frames: Iterator[np.ndarray], frames_per_second: float) -> None:
    from PIL import Image

    images = (Image.fromarray(frame).quantize(256, kmeans=1) for frame in frames)
    first = next(images)
    first.save(path, save_all=True, append_images=images, duration=round(1000 / frames_per_second), loop=0)


def _write_mp4(path: Path, frames: Iterator[np.ndarray], frames_per_second: float) -> None:
    import imageio

    writer: Any = imageio.get_writer(path, fps=frames_per_second, macro_block_size=2, quality=8)
    with writer:
        for frame in frames:
            writer.append_data(frame)


# ---------------------------------------------------------------- panels


BUBBLE = 0.8
"""Voidage at the boundary of a bubble."""

HEADROOM = 1.4
"""Height of a picture over the largest bed height."""

SHARP = 200
"""Pixels of a rendered image per inch of paper."""

SOLID = "#9a9a9a"
"""Colour of solid cells."""

SCALARS = {"temperature": "temperature of the fluid  [K]", "vapour": "mass fraction of vapour  [-]"}
"""Panels of a field of the fluid, and the labels of their colours."""

PANELS = ("spheres", "voidage", "bubbles", "streamlines", *SCALARS)

BESIDE = {"temperature": "temperature", "moisture": "vapour"}
"""Field of the fluid that is drawn beside spheres of a colour."""

_WIDTH, _HEIGHT, _NARROWEST = 8.0, 6.0, 0.9  # of the page, of a panel, of a panel [inch]
_BESIDE, _AROUND, _TITLE = 1.86, 1.12, 0.42  # labels and colour bar; labels and panel title; title of the page [inch]
_TALL = 0.9  # height over width of the bed from which panels stand side by side


@dataclass(frozen=True)
class Stage:
    """What all pictures of a run share: panels, view and colour limits."""

    run: RunData
    panels: tuple[str, ...]
    bounds: np.ndarray  # (3, 2), lowest and highest x, y, z in view [m]
    depth: int  # axis of the line of sight, 0 or 1
    colour: str  # field that colours the spheres
    cut: bool  # whether spheres in front of the middle plane are left out
    limits: dict[str, tuple[float, float]]  # of the colours, by panel

    @classmethod
    def of(
        cls, run: RunData, snapshots: Sequence[int], show: Sequence[str], colour: str | None, cut: bool | None
    ) -> Stage:
        """The stage for a run.

        snapshots  that set the limits of view and colours
        show       panels; spheres and voidage as far as they are recorded if empty
        colour     speed, or a particle field; None for species in a mixture, else speed
        cut        None cuts deep beds only
        errors     InputError for an unknown panel or field; RunFailed if this machine cannot render
        """
        colour = colour or colours.usual(run)
        beside = BESIDE.get(colour, "")
        recorded = {
            "spheres": run.particle_fields, "voidage": "voidage" in run.fluid_fields, beside: beside in run.fluid_fields
        }  # fmt: skip
        panels = tuple(show) or tuple(name for name, there in recorded.items() if there)
        for name in panels:
            if name not in PANELS:
                raise InputError("show", name, nearest(name, PANELS))
            if name in SCALARS and name not in run.fluid_fields:
                fields = ", ".join(run.fluid_fields)
                raise InputError("show", name, f"a recorded field of the fluid; this run has {fields or 'none'}")
        if "spheres" in panels or "bubbles" in panels:
            rendering.require_rendering()
        bounds = bounds_of(run, snapshots)
        size, depth = np.diff(bounds, axis=1).ravel(), depth_of(bounds)
        limits: dict[str, tuple[float, float]] = {}
        deep = False
        if "spheres" in panels:
            shown = [colours.values(run, snapshot, colour) for snapshot in snapshots]
            limits["spheres"] = colours.limits(np.concatenate([values for _, values in shown]), colour)
            largest = max((float(particles["radius"].max(initial=0.0)) for particles, _ in shown), default=0.0)
            deep = size[depth] > 12.0 * largest
        for name in set(panels) & {"voidage", *SCALARS}:
            limits[name] = limits_of_fluid(np.stack([run.fluid(name, snapshot) for snapshot in snapshots]), name)
        if "streamlines" in panels:
            fastest = max(float(colours.magnitude(run.fluid("velocity", snapshot)).max()) for snapshot in snapshots)
            limits["streamlines"] = (0.0, fastest or 1.0)
        return cls(run, panels, bounds, depth, colour, deep if cut is None else cut, limits)

    def frames(self) -> Iterator[np.ndarray]:
        """Images of all snapshots, at most 800 pixels wide."""
        for snapshot in range(len(self.run.times)):
            canvas: Any = self.figure(snapshot).canvas
            canvas.draw()
            image = np.asarray(canvas.buffer_rgba())[..., :3]
            yield image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2]  # film formats require even sizes

    def figure(self, snapshot: int) -> Figure:
        """The picture of one snapshot."""
        tall = self._size[1] / self._size[0]
        columns = 2 if len(self.panels) > 1 and tall >= _TALL else 1
        rows = -(-len(self.panels) // columns)
        width = max(min(_WIDTH / columns - _BESIDE, _HEIGHT / tall), _NARROWEST)
        page = columns * max(width + _BESIDE, 3.4), rows * (width * tall + _AROUND) + _TITLE
        figure, axes = blank(rows, columns, width=page[0], height=page[1], layout="compressed")
        for name, panel in zip(self.panels, axes):
            if name in SCALARS:
                self._scalar(panel, snapshot, name)
            else:
                getattr(self, f"_{name}")(panel, snapshot, (round(width * SHARP), round(width * tall * SHARP)))
            self._finish(panel, width, tall)
        for unused in axes[len(self.panels) :]:
            unused.remove()
        title = f"{title_of(self.run)},  t = {self.run.times[snapshot]:.4g} s"
        heading = figure.suptitle(title, fontsize=12, fontweight="bold")
        too_wide = heading.get_window_extent().width / (0.96 * figure.bbox.width)
        heading.set_fontsize(12 / max(1.0, too_wide))
        return figure

    # ------------------------------------------------------------ panels

    def _spheres(self, axes: Axes, snapshot: int, pixels: tuple[int, int]) -> None:
        particles, values = colours.values(self.run, snapshot, self.colour)
        position, half = particles["position"], None
        title, behind = "spheres\nall", np.ones(len(position), bool)
        if self.cut:
            middle = float(self.bounds[self.depth].mean())
            behind = position[:, self.depth] >= middle if self.depth == 1 else position[:, self.depth] <= middle
            title = f"spheres\nbehind {'xy'[self.depth]} = {middle:.3g} m"
            half = self._behind(middle)
        shades, limits = colours.colour_map(self.colour), self.limits["spheres"]
        view = rendering.View(self.bounds, self.depth, pixels)
        image = rendering.spheres(
            view, position[behind], particles["radius"][behind], values[behind], limits, shades,
            lambda plotter: add_walls(plotter, walls_of(self.run), self.bounds, self.run.times[snapshot], half),
        )  # fmt: skip
        axes.imshow(image, extent=self._extent, interpolation="antialiased")
        if self.colour == colours.AGGLOMERATE:
            title = title.replace("spheres", "agglomerates, grey: single")
        else:
            label, whole = colours.label(self.run, self.colour), self.colour == colours.SPECIES
            _colour_bar(axes, shades, limits, label, whole)
        axes.set_title(title, loc="left")

    def _behind(self, middle: float) -> Callable[[Any], Any]:
        """Keeps the part of a mesh behind the middle plane."""
        origin = np.eye(3)[self.depth] * middle
        normal = np.eye(3)[self.depth] * (1.0 if self.depth == 1 else -1.0)
        return lambda mesh: mesh.clip(normal, origin=origin, invert=False)

    def _voidage(self, axes: Axes, snapshot: int, pixels: tuple[int, int]) -> None:
        values, where = self._slice(self.run.fluid("voidage", snapshot))
        self._cells(axes, values, "Blues_r", self.limits["voidage"], "voidage  [-]")
        title = f"voidage\nat {where}"
        if values.min() < BUBBLE < values.max() and min(values.shape) > 1:
            axes.contour(*self._centres, values, levels=[BUBBLE], colors=[ORANGE], linewidths=1.4)
            title += f", line: {BUBBLE:g}"
        axes.set_title(title, loc="left")

    def _bubbles(self, axes: Axes, snapshot: int, pixels: tuple[int, int]) -> None:
        bubbles, freeboard = _bubbles(self.run.fluid("voidage", snapshot), self.run.grid)
        view = rendering.View(self.bounds, self.depth, pixels)
        image = rendering.surfaces(view, {SKY: bubbles, "#e3e3e3": freeboard})
        axes.imshow(image, extent=self._extent, interpolation="antialiased")
        how_many = "" if bubbles.n_points else ": none"
        axes.set_title(f"bubbles{how_many}\nsurface of voidage {BUBBLE:g}", loc="left")

    def _streamlines(self, axes: Axes, snapshot: int, pixels: tuple[int, int]) -> None:
        velocity, where = self._slice(self.run.fluid("velocity", snapshot))
        speed = colours.magnitude(velocity)
        self._cells(axes, speed, colours.part_of("YlGnBu", 0.0, 0.65), self.limits["streamlines"], "fluid speed  [m/s]")
        if min(speed.shape) > 1 and speed.max() > 0.0:
            across, up = velocity[..., 1 - self.depth], velocity[..., 2]
            axes.streamplot(*self._centres, across, up, color=BLUE, linewidth=0.7, arrowsize=0.7, density=1.1)
        axes.set_title(f"fluid\nat {where}", loc="left")

    def _scalar(self, axes: Axes, snapshot: int, name: str) -> None:
        values, where = self._slice(self.run.fluid(name, snapshot))
        self._cells(axes, values, colours.colour_map(name), self.limits[name], SCALARS[name])
        axes.set_title(f"{name}\nat {where}", loc="left")

    def _cells(self, axes: Axes, values: np.ndarray, shades: Any, limits: tuple[float, float], label: str) -> None:
        """Draw a slice of cells with its colour bar."""
        from matplotlib.colors import to_rgba

        low, high = _corners(self.run)
        extent = low[1 - self.depth], high[1 - self.depth], low[2], high[2]
        axes.imshow(
            values, origin="lower", extent=extent, cmap=shades, vmin=limits[0], vmax=limits[1], interpolation="nearest"
        )
        if "solid" in self.run.fluid_fields:
            solid = self._slice(self.run.fluid("solid"))[0][..., None] > 0
            axes.imshow(solid * to_rgba(SOLID), origin="lower", extent=extent, interpolation="nearest", zorder=3)
        _colour_bar(axes, shades, limits, label)

    # ------------------------------------------------------------ geometry

    @property
    def _size(self) -> tuple[float, float]:
        """Width and height of the view [m]."""
        size = np.diff(self.bounds, axis=1).ravel()
        return float(size[1 - self.depth]), float(size[2])

    @property
    def _extent(self) -> tuple[float, float, float, float]:
        return (*self.bounds[1 - self.depth], *self.bounds[2])

    @property
    def _centres(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates of the cell centres of a slice [m]."""
        grid: Any = self.run.grid
        lines = [x + h * (np.arange(n) + 0.5) for x, h, n in zip(grid.origin, grid.spacing, grid.cells)]
        return lines[1 - self.depth], lines[2]

    def _slice(self, field: np.ndarray) -> tuple[np.ndarray, str]:
        """The middle layer of cells [z, across], and its position in words."""
        grid: Any = self.run.grid
        layer = grid.cells[self.depth] // 2
        place = grid.origin[self.depth] + (layer + 0.5) * grid.spacing[self.depth]
        return np.take(field, layer, axis=2 - self.depth), f"{'xy'[self.depth]} = {place:.3g} m"

    def _finish(self, axes: Axes, width: float, tall: float) -> None:
        """Limits, labels, ticks and frame of a panel of a given width [inch]."""
        axes.set_xlim(*self._extent[:2])
        axes.set_ylim(*self._extent[2:])
        axes.set_xlabel(f"{'yx'[self.depth]}  [m]")
        axes.set_ylabel("z  [m]")
        axes.set_title(axes.get_title(loc="left"), loc="left", fontsize=10.5)
        axes.grid(False)
        axes.locator_params(axis="x", nbins=max(1, int(width / 0.7)))
        axes.locator_params(axis="y", nbins=max(2, int(width * tall / 0.5)))
        for side in axes.spines.values():
            side.set_visible(True)
            side.set_color("#888888")


# ---------------------------------------------------------------- colour bars and surfaces


def _colour_bar(axes: Axes, shades: Any, limits: tuple[float, float], label: str, whole: bool = False) -> None:
    """Draw a colour bar; `whole` has one colour and one tick for each whole number."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    figure: Any = axes.figure
    numbers = np.arange(limits[0], limits[1] + 0.5)
    steps = {"values": numbers, "boundaries": np.arange(limits[0] - 0.5, limits[1] + 1.0), "ticks": numbers}
    bar = figure.colorbar(
        ScalarMappable(Normalize(*limits), shades), ax=axes, fraction=0.08, pad=0.03, aspect=30,
        **(steps if whole else {}),
    )  # fmt: skip
    bar.set_label(label)
    bar.outline.set_visible(False)
    if not whole:
        bar.ax.locator_params(axis="y", nbins=6)


def _corners(run: RunData) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of the grid [m]."""
    grid: Any = run.grid
    low = np.array(grid.origin)
    return low, low + np.array(grid.cells) * np.array(grid.spacing)


def spread_over(run: RunData, most: int) -> list[int]:
    """Numbers of the snapshots of a run, or of so many that are spread evenly over it."""
    count = len(run.times)
    return sorted(set(np.linspace(0, count - 1, min(count, most)).astype(int).tolist()))


def depth_of(bounds: np.ndarray) -> int:
    """Axis of the line of sight: the shorter one of x and y."""
    width, depth = np.ptp(bounds[:2], axis=1)
    return int(width >= depth)


def limits_of_fluid(values: np.ndarray, name: str) -> tuple[float, float]:
    """Values of the first and the last colour of a field of the fluid."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    if name == "voidage":
        return min(float(np.floor(20.0 * low)) / 20.0, 0.95), 1.0
    return low, high if high > low else low + 1.0


def bounds_of(run: RunData, snapshots: Sequence[int]) -> np.ndarray:
    """The space in view (3, 2) [m]: the grid up to somewhat above the highest bed, or else particles and walls."""
    if run.grid is not None:
        low, high = _corners(run)
        heights = run.history.get("bed_height", np.zeros(0))
        if np.isfinite(heights).any():
            high[2] = min(high[2], low[2] + max(HEADROOM * float(np.nanmax(heights)), float((high - low)[:2].max())))
        return np.stack([low, high], axis=1)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for snapshot in snapshots:
        particles = run.particles(snapshot)
        if len(particles["position"]):
            reach = particles.get("radius", np.zeros(len(particles["position"])))[:, None]
            low = np.minimum(low, (particles["position"] - reach).min(axis=0))
            high = np.maximum(high, (particles["position"] + reach).max(axis=0))
    if not np.isfinite(low).all():
        raise InputError("snapshot", list(snapshots), "one with particles", "there is nothing to draw")
    margin = 0.02 * float((high - low).max())
    return with_walls(np.stack([low - margin, high + margin], axis=1), run)


def title_of(run: RunData) -> str:
    """Title of the case, or name of the folder."""
    name = parse(run.case_text, str(run.folder / "case.toml")).get("title")
    return name if isinstance(name, str) else run.folder.resolve().name


def _bubbles(voidage: np.ndarray, grid: Any) -> tuple[Any, Any]:
    """Surfaces of high voidage: those inside the bed, closed at walls and floor, and that of the freeboard."""
    import pyvista

    padded = np.pad(voidage, ((1, 0), (1, 1), (1, 1)), constant_values=float(voidage.min()))
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
    closed, freeboard = (pyvista.PolyData.from_regular_faces(parts.points, faces[side]) for side in (~above, above))
    return closed.clean(), freeboard.clean()
