"""Curves: one clean style for all figures, units on every axis.

>>> from cfddem.view.plots import panels, save
>>> figure, (left, right) = panels(2)
>>> lines = left.plot([0, 1], [0, 1])
>>> label(left, "St", "-", "e", "-")
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, SKY, ORANGE, GREEN, RED, GREY = "#0b4f8a", "#56a6d9", "#e07b00", "#1b8a5a", "#b8323c", "#7a7a7a"
"""Colours that stay apart in print and for the colour-blind."""

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
    "figure.constrained_layout.use": True,
}


def panels(columns: int = 1, *, width: float = 8.0, height: float = 4.6, **options: Any) -> tuple[Figure, Any]:
    """A figure with panels side by side.

    columns        number of panels
    width, height  of the figure [inch]
    options        handed to `Figure.subplots`, such as sharey=True
    returns        the figure, and its panel or array of panels
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width, height))
        FigureCanvasAgg(figure)
        return figure, figure.subplots(1, columns, **options)


def label(axes: Axes, x: str, x_unit: str, y: str, y_unit: str, title: str = "") -> None:
    """Name both axes with their units."""
    axes.set_xlabel(f"{x}  [{x_unit}]")
    axes.set_ylabel(f"{y}  [{y_unit}]")
    if title:
        axes.set_title(title, loc="left", fontsize=11, fontweight="bold")


def legend(axes: Axes, **options: Any) -> None:
    """A legend without a frame."""
    axes.legend(**{"frameon": False, "fontsize": 9.5} | options)


def decades(axes: Axes, *marks: float) -> None:
    """A logarithmic x axis with plain numbers at the given marks."""
    axes.set_xscale("log")
    axes.set_xticks(marks, [f"{mark:g}" for mark in marks])
    axes.minorticks_off()


def shades(count: int, name: str = "viridis") -> Sequence[Any]:
    """Colours from dark to light for a parameter that grows."""
    import matplotlib as mpl

    scale = mpl.colormaps[name]
    return [scale(0.9 * place / max(count - 1, 1)) for place in range(count)]


def save(figure: Figure, path: Path, dots_per_inch: int = 160) -> None:
    """Write a PNG; the file appears whole or not at all."""
    import matplotlib as mpl

    path = Path(path)
    fresh = path.with_name(f".{os.getpid()}-{path.name}")
    with mpl.rc_context(_STYLE):
        figure.savefig(fresh, format="png", dpi=dots_per_inch, facecolor="white")
    os.replace(fresh, path)
