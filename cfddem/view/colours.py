"""Colour maps of pictures, and the bars that explain them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def bright(name: str) -> Any:
    """A colour map without its darkest end, where the shape of a sphere cannot be seen."""
    import matplotlib as mpl
    from matplotlib.colors import ListedColormap

    return ListedColormap(mpl.colormaps[name](np.linspace(0.12, 1.0, 256)))


def with_walls(name: str, end: float = 1.0) -> Any:
    """A colour map that shows what is no number in grey; `end` leaves out its last colours."""
    import matplotlib as mpl
    from matplotlib.colors import ListedColormap

    return ListedColormap(mpl.colormaps[name](np.linspace(0.0, end, 256))).with_extremes(bad="#9a9a9a")


def colour_bar(axes: Axes, colours: Any, limits: tuple[float, float], label: str) -> None:
    """Draw the bar of a colour map between two limits."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    figure: Any = axes.figure
    bar = figure.colorbar(ScalarMappable(Normalize(*limits), colours), cax=axes)
    bar.set_label(label)
    bar.outline.set_visible(False)
    axes.locator_params(axis="y", nbins=6)
