"""A movie of several beds side by side: the spheres in a slice through the middle, coloured by their vertical speed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.collections import EllipseCollection

from cfddem.io.reading import open_run

FASTEST = 0.06
"""Vertical speed at the ends of the colour scale [m/s]."""

FRAMES_PER_SECOND = 20


def side_by_side(folders: Mapping[str, Path], path: Path, every: int = 1) -> None:
    """Write a movie of runs with equal times.

    folders  title -> folder of the run
    path     of the movie, a GIF
    every    snapshots from frame to frame
    """
    runs = {title: open_run(folder) for title, folder in folders.items()}
    first = next(iter(runs.values()))
    figure, axes = plt.subplots(1, len(runs), figsize=(2.2 * len(runs), 4.4), sharey=True, layout="constrained")
    beads = [run.particles(n) for run in runs.values() for n in (0, -1)]
    width, _, top = np.max([(each["position"] + each["radius"][:, None]).max(axis=0) for each in beads], axis=0)
    drawn = []
    for one, title in zip(axes, runs, strict=True):
        one.set(xlabel="x [mm]", title=title, xlim=(0, 1e3 * width), ylim=(0, 1.05e3 * top), aspect="equal")
        drawn.append(_no_spheres(one))
    axes[0].set_ylabel("height [mm]")
    figure.colorbar(drawn[-1], ax=axes, label="vertical speed [mm/s]", shrink=0.6)
    clock = axes[0].text(0.04, 0.965, "", transform=axes[0].transAxes)

    def draw(frame: int) -> list[object]:
        for spheres, run in zip(drawn, runs.values(), strict=True):
            _place(spheres, run.particles(frame))
        clock.set_text(f"{first.times[frame]:.2f} s")
        return [*drawn, clock]

    frames = range(0, len(first.times), every)
    FuncAnimation(figure, draw, frames=frames).save(path, PillowWriter(fps=FRAMES_PER_SECOND // every), dpi=80)  # type: ignore[arg-type]
    plt.close(figure)


def _no_spheres(axes: plt.Axes) -> EllipseCollection:
    spheres = EllipseCollection(
        [], [], [], units="x", offsets=np.zeros((0, 2)), offset_transform=axes.transData, cmap="RdBu_r", linewidth=0.2,
        edgecolor="0.3",
    )  # fmt: skip
    spheres.set_clim(-1e3 * FASTEST, 1e3 * FASTEST)
    axes.add_collection(spheres)
    return spheres


def _place(spheres: EllipseCollection, particles: Mapping[str, np.ndarray]) -> None:
    """Draw the spheres that the plane through the middle cuts, as the circles of the cut."""
    position, radius = particles["position"], particles["radius"]
    across = position[:, 1] - 0.5 * (position[:, 1].min() + position[:, 1].max())
    cut = np.abs(across) < radius
    size = 2e3 * np.sqrt(radius[cut] ** 2 - across[cut] ** 2)
    spheres.set_offsets(1e3 * position[cut][:, [0, 2]])
    spheres.set_widths(size)
    spheres.set_heights(size)
    spheres.set_angles(np.zeros(len(size)))
    spheres.set_array(1e3 * particles["velocity"][cut, 2])
