"""Drawings of a round vessel and its spheres, seen along y."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from cfddem.case.schema import Case
from cfddem.io.reading import RunData
from cfddem.plotting.curves import GREY, label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PathCollection

WALL = "#222222"
"""Colour of walls."""

CUBIC_MILLIMETRES = 1e9
"""In a cubic metre."""


def draw_spheres(
    axes: Axes, run: RunData, case: Case, time: float, reach: float, size: float, most: float,
    by: Literal["rise", "liquid"] = "rise",
) -> tuple[float, PathCollection]:  # fmt: skip
    """Spheres near the middle plane, coloured by their upward velocity or by the liquid that they carry.

    time     of the snapshot, or near it [s]
    reach    distance of centres from the plane, over the diameter [-]
    size     of a sphere on the page [points squared]
    most     velocity [m/s] or liquid [mm3] at the end of the colours
    by       "rise" or "liquid"
    returns  the time of the snapshot [s], and the spheres, for a bar of colours
    """
    n = int(np.abs(run.times - time).argmin())
    particles = run.particles(n)
    position = particles["position"]
    near = np.abs(position[:, 1] - 0.5 * case.column.width) < reach * case.bed.diameter
    rises = by == "rise"
    value = particles["velocity"][:, 2] if rises else particles["liquid_carried"] * CUBIC_MILLIMETRES
    spheres = axes.scatter(
        position[near, 0], position[near, 2], s=size, c=value[near], cmap="RdBu_r" if rises else "YlGnBu",
        vmin=-most if rises else 0.0, vmax=most, linewidths=0.3, edgecolors=GREY,
    )  # fmt: skip
    return float(run.times[n]), spheres


def draw_vessel(axes: Axes, case: Case, top: float) -> None:
    """The wall of the vessel, and axes up to a height [m]."""
    heights, radii = np.array(case.line).T
    for side in (-1.0, 1.0):
        axes.plot(0.5 * case.column.width + side * radii, heights, color=WALL, lw=1.6)
    axes.set(xlim=(0.0, case.column.width), ylim=(0.0, top), aspect="equal")
    axes.set_xticks([0.0, case.column.width])
    label(axes, "x", "m", "z", "m")
