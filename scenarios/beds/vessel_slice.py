"""Drawings of a round vessel and its spheres, seen along y."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cfddem.case.schema import Case
from cfddem.io.reading import RunData
from cfddem.plotting.curves import GREY, label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WALL = "#222222"
"""Colour of walls."""


def draw_spheres(axes: Axes, run: RunData, case: Case, time: float, reach: float, size: float, fastest: float) -> float:
    """Spheres near the middle plane, coloured by their upward velocity.

    time     of the snapshot, or near it [s]
    reach    distance of centres from the plane, over the diameter [-]
    size     of a sphere on the page [points squared]
    fastest  velocity at the ends of the colours [m/s]
    returns  the time of the snapshot [s]
    """
    n = int(np.abs(run.times - time).argmin())
    particles = run.particles(n)
    position, up = particles["position"], particles["velocity"][:, 2]
    near = np.abs(position[:, 1] - 0.5 * case.column.width) < reach * case.bed.diameter
    axes.scatter(
        position[near, 0], position[near, 2], s=size, c=up[near], cmap="RdBu_r", vmin=-fastest, vmax=fastest,
        linewidths=0.3, edgecolors=GREY,
    )  # fmt: skip
    return float(run.times[n])


def draw_vessel(axes: Axes, case: Case, top: float) -> None:
    """The wall of the vessel, and axes up to a height [m]."""
    heights, radii = np.array(case.line).T
    for side in (-1.0, 1.0):
        axes.plot(0.5 * case.column.width + side * radii, heights, color=WALL, lw=1.6)
    axes.set(xlim=(0.0, case.column.width), ylim=(0.0, top), aspect="equal")
    axes.set_xticks([0.0, case.column.width])
    label(axes, "x", "m", "z", "m")
