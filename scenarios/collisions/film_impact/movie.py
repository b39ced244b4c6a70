"""A movie of an impact: the bead in the film, the liquid coloured by its pressure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.plotting.curves import blank
from scenarios.collisions.film_impact.result import FilmImpact, Frame, Record
from scenarios.collisions.film_impact.solver import GridImpact
from scenarios.collisions.film_impact.study import impact
from scenarios.references.isph.impact import SmoothedImpact

FRAMES, FRAMES_PER_SECOND = 30, 12
"""Frames in the time in which the bead would fall through the film at constant speed, and how fast they are shown."""

MOST = 150
"""Frames after which the movie ends, of a bead that sticks."""

AFTER_CONTACT = 8
"""Steps after contact that have a frame each: the suction lasts for microseconds."""

LINEAR, HIGHEST = 1.0, 1e4
"""Pressure up to which the colours are linear, and that at their ends [kPa]."""


def movie(
    path: Path,
    diameter: float = 8e-3,
    liquid: str = "water",
    film: float = 0.4e-3,
    velocity: float = 1.0,
    **options: Any,
) -> FilmImpact:
    """Compute an impact, and write its movie.

    path     of the movie, a GIF
    options  of :func:`~scenarios.collisions.film_impact.impact`, as the other arguments
    returns  the result of the impact
    """
    if path.suffix.lower() != ".gif":
        raise InputError("movie", str(path), "a file that ends in .gif")
    frames: list[Frame] = []
    turning: list[int] = []

    def keep(run: GridImpact | SmoothedImpact) -> None:
        turning.extend([run.steps] * (run.contacts > 0 and len(turning) < AFTER_CONTACT))
        due = run.time * velocity / film >= (len(frames) - len(turning)) / FRAMES
        if len(frames) < MOST and (due or turning[-1:] == [run.steps]):
            frames.append(Record(run).frame())

    result = impact(diameter, liquid, film, velocity, progress=keep, **options)
    _write(path, frames, 0.5 * diameter, f"{diameter * 1e3:g} mm, {liquid}, {velocity:g} m/s")
    return result


def _write(path: Path, frames: list[Frame], radius: float, name: str) -> None:
    """Draw the frames, and write them as a GIF."""
    from matplotlib.animation import FuncAnimation, PillowWriter
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import SymLogNorm

    figure, (axis,) = blank(1, 1, width=7.2, height=2.6, layout="compressed")
    first = frames[0]
    wide, high = len(first.liquid) * first.dx * 1e3, first.liquid.shape[1] * first.dx * 1e3
    image = axis.imshow(
        _shown(first).T, origin="lower", extent=(-wide, wide, 0.0, high), cmap="RdBu_r",
        norm=SymLogNorm(LINEAR, vmin=-HIGHEST, vmax=HIGHEST), interpolation="nearest",
    )  # fmt: skip
    figure.colorbar(image, ax=axis, label="pressure  [kPa]", ticks=[-1e4, -100, -1, 1, 100, 1e4], shrink=0.9)
    across = np.linspace(-radius, radius, 400) * 1e3
    axis.set_facecolor("#dde6dd")
    axis.grid(False)
    axis.set(xlim=(-wide, wide), ylim=(0.0, 0.7 * high), xlabel="radius  [mm]", ylabel="height  [mm]")
    clock = axis.set_title("", loc="left")
    beads: list[PolyCollection] = []

    def draw(number: int) -> list[object]:
        frame = frames[number]
        for bead in beads:
            bead.remove()
        under = 1e3 * (frame.gap + radius) - np.sqrt((1e3 * radius) ** 2 - across**2)
        beads[:] = [axis.fill_between(across, under, 1e4 * radius, color="#a8a8a8", edgecolor="#444444", zorder=3)]
        image.set_data(_shown(frame).T)
        clock.set_text(f"{name}: {frame.time * 1e3:.3f} ms")
        return [image, clock, *beads]

    draw(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # or the panel would move from frame to frame
    FuncAnimation(figure, draw, frames=len(frames)).save(path, PillowWriter(fps=FRAMES_PER_SECOND), dpi=100)  # type: ignore[arg-type]


def _shown(frame: Frame) -> np.ndarray:
    """Pressure in kPa in the liquid cells, mirrored at the axis; NaN elsewhere."""
    pressure = np.where(frame.liquid, frame.pressure / 1e3, np.nan)
    return np.concatenate([pressure[::-1], pressure])
