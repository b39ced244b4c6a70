"""Figures with curves: one style for all, units on every axis.

>>> from cfddem.plotting.curves import panels, save
>>> figure, (left, right) = panels(2)
>>> lines = left.plot([0, 1], [0, 1])
>>> label(left, "St", "-", "e", "-")
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cfddem.backend.errors import InputError, nearest
from cfddem.io.files import write_whole
from cfddem.io.quantities import shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from cfddem.analysis.fluctuations import RegimeMap

BLUE, SKY, ORANGE, GREEN, RED, GREY = "#0b4f8a", "#66b9e8", "#e08a00", "#12995a", "#8c1020", "#757575"
"""Colours that differ in print and for colour-blind readers, as `tests/plotting/test_figures.py` measures."""

_STYLE: Any = {
    "font.size": 11.0,
    "font.family": "sans-serif",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#444444",
    "axes.labelcolor": "#222222",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.8,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "lines.linewidth": 1.8,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 9.5,
}


def panels(columns: int = 1, *, width: float = 8.0, height: float = 4.6, **options: Any) -> tuple[Figure, Any]:
    """A figure with panels side by side.

    columns        number of panels
    width, height  of the figure [inch]
    options        of `Figure.subplots`, such as sharey=True
    returns        the figure, and its panel or array of panels
    """
    figure, axes = blank(1, columns, width=width, height=height, **options)
    return figure, axes if columns > 1 else axes[0]


def blank(
    rows: int, columns: int, *, width: float, height: float, layout: str = "constrained", **options: Any
) -> tuple[Figure, Any]:
    """A figure with rows and columns of panels.

    width, height  of the figure [inch]
    layout         of matplotlib: constrained, or compressed for panels of fixed aspect
    options        of `Figure.subplots`
    returns        the figure, and its panels in one array, row by row
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width, height), layout=layout)  # type: ignore[arg-type]
        FigureCanvasAgg(figure)
        return figure, figure.subplots(rows, columns, squeeze=False, **options).ravel()


def history(folder: str | Path, output: str | Path | None = None, columns: Sequence[str] = ()) -> Path:
    """Draw columns of the history against time, one panel per column.

    folder   of a run
    output   PNG; NAME-history.png in the current folder if not given
    columns  of the history; bed height and pressure drop if present, else all
    returns  the file
    errors   InputError for an unknown column
    """
    from cfddem.io.reading import open_run

    run = open_run(folder)
    listed = [name for name in run.history if name not in ("time", "step")]
    if not listed:
        raise InputError("folder", str(folder), "a run with a history", "the run ended before its first row")
    for name in columns:
        if name not in listed:
            raise InputError("columns", name, nearest(name, listed))
    usual = [name for name in ("bed_height", "pressure_drop") if name in listed]
    names = list(columns) or usual or listed
    figure, axes = blank(len(names), 1, width=8.0, height=0.7 + 2.1 * len(names), sharex=True)
    for name, panel in zip(names, axes):
        panel.plot(run.history["time"], run.history[name], color=BLUE)
        label(panel, "", "", name.replace("_", " "), shown_unit(run.unit(name)))
        panel.set_xlabel("")
    axes[-1].set_xlabel("time  [s]")
    figure.suptitle(run.folder.resolve().name, fontsize=12, fontweight="bold")
    output = Path(f"{run.folder.resolve().name}-history.png" if output is None else output)
    save(figure, output)
    return output


def collisions(folder: str | Path, output: str | Path | None = None) -> Path:
    """Draw the regime map of the collisions of a run.

    folder   of a run
    output   PNG; NAME-collisions.png in the current folder if not given
    returns  the file
    errors   InputError if the run has no recorded collisions with films
    """
    from cfddem.analysis.fluctuations import regime_map
    from cfddem.io.reading import open_run

    run = open_run(folder)
    regimes = regime_map(run.collisions)
    figure, axes = panels(1, width=6.4, height=4.8)
    draw_regimes(axes, regimes, run.folder.resolve().name)
    output = Path(f"{run.folder.resolve().name}-collisions.png" if output is None else output)
    save(figure, output)
    return output


def draw_regimes(axes: Axes, regimes: RegimeMap, title: str = "", most: float | None = None) -> Any:
    """Density of collisions over Stokes number and h_eps/h_sigma; an orange line marks half of them in solid contact.

    most     density of the darkest colour; that of the map if not given
    returns  the coloured mesh, for a colour bar
    """
    shown = np.where(regimes.density > 0.0, regimes.density, np.nan)
    shades = axes.pcolormesh(
        regimes.stokes, regimes.gap_ratio, shown, cmap="Blues", vmin=0.0, vmax=most, rasterized=True
    )
    column = np.nansum(regimes.contact * regimes.density, axis=0) / np.maximum(
        np.nansum(regimes.density, axis=0), 1e-300
    )
    crossed = np.flatnonzero((column[:-1] < 0.5) & (column[1:] >= 0.5))
    if len(crossed):
        axes.axvline(float(regimes.stokes[crossed[0] + 1]), color=ORANGE, linewidth=1.2)
    low, high = min(regimes.gap_ratio[0], 0.5), max(regimes.gap_ratio[-1], 2.0)
    axes.axhline(1.0, color=GREY, linewidth=1.0, linestyle="--")
    axes.set(xscale="log", yscale="log", xlim=(regimes.stokes[0], regimes.stokes[-1]), ylim=(low, high))
    label(axes, "Stokes number", "-", "elastohydrodynamic gap over roughness", "-", title)
    axes.text(
        0.02, 0.98, f"median St {regimes.median_stokes:.3g}\nsolid contact in {100.0 * regimes.contact_fraction:.3g} %",
        transform=axes.transAxes, ha="left", va="top", fontsize=9.5,
    )  # fmt: skip
    return shades


def draw_coating(axes: Axes, carried: np.ndarray) -> None:
    """Draw the distribution over the particles of the liquid that they carry [m3], over its mean."""
    share = carried / carried.mean()
    weights = np.full(share.size, 100.0 / share.size)
    axes.hist(share, bins=40, range=(0.0, float(np.quantile(share, 0.995))), color=BLUE, weights=weights)
    axes.axvline(1.0, color=ORANGE, linewidth=1.2, label="mean")
    label(axes, "liquid on a particle over the mean", "-", "particles", "%")
    legend(axes)


def label(axes: Axes, x: str, x_unit: str, y: str, y_unit: str, title: str = "") -> None:
    """Label both axes with their units."""
    axes.set_xlabel(f"{x}  [{x_unit}]")
    axes.set_ylabel(f"{y}  [{y_unit}]")
    if title:
        axes.set_title(title, loc="left", fontsize=11, fontweight="bold")


def legend(axes: Axes, **options: Any) -> None:
    """A legend without a frame."""
    axes.legend(**{"frameon": False, "fontsize": 9.5} | options)


def legend_below(figure: Figure, axes: Axes) -> None:
    """The legend of a panel below all panels, in as many columns as fit; the figure grows by its rows."""
    handles, names = axes.get_legend_handles_labels()
    wide = 0.6 + 0.09 * max(map(len, names))  # [inch]
    columns = max(1, min(len(names), int(figure.get_figwidth() / wide)))
    figure.set_figheight(figure.get_figheight() + 0.2 + 0.2 * -(-len(names) // columns))
    figure.legend(handles, names, loc="outside lower center", ncols=columns, frameon=False, fontsize=9.5)


def plain_ticks(axis: Any) -> None:
    """Whole numbers at the ticks of an axis, without a factor or offset beside it."""
    axis.set_major_formatter(lambda value, _: f"{value:.6g}")


def decades(axes: Axes, *ticks: float) -> None:
    """A logarithmic x axis with plain numbers at given ticks."""
    axes.set_xscale("log")
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()


def shades(count: int, name: str = "viridis") -> Sequence[Any]:
    """Colours from dark to light for an increasing parameter; the lightest can still be seen on white."""
    import matplotlib as mpl

    scale = mpl.colormaps[name]
    return [scale(0.8 * place / max(count - 1, 1)) for place in range(count)]


def line_styles(count: int) -> list[dict[str, Any]]:
    """Colour and dashes of each of several curves, told apart without colour too."""
    colours, dashes = (BLUE, ORANGE, GREEN, RED, SKY, GREY), ("-", (0, (5, 2)), (0, (1, 1.2)))
    return [
        {"color": colours[place % 6], "linestyle": dashes[(place + place // 6) % 3], "linewidth": 1.6}
        for place in range(count)
    ]


def save(figure: Figure, path: Path, dots_per_inch: int = 160) -> None:
    """Write a PNG atomically."""
    import matplotlib as mpl

    image = io.BytesIO()
    with mpl.rc_context(_STYLE):
        figure.savefig(image, format="png", dpi=dots_per_inch, facecolor="white")
    write_whole(Path(path), image.getbuffer())


def encoded(figure: Figure, dots_per_inch: int = 110) -> str:
    """A figure as PNG in base64."""
    image = io.BytesIO()
    figure.savefig(image, format="png", dpi=dots_per_inch, facecolor="white")
    return base64.b64encode(image.getvalue()).decode()
