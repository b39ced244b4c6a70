"""Five thousand wet spheres at four capillary numbers: conservation, and growth of agglomerates.

There is no published result for this case. Limits are set for what bridges must conserve (spheres, momentum, liquid),
and agglomerates must grow as the capillary number falls.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cfddem.plotting.curves import BLUE, ORANGE, decades, label, legend, panels, save, shades
from scenarios.collisions.wet_tumbler.study import Tumbling, tumble
from scenarios.validation.table import Columns, Progress, Row, worst, write_histories

CAPILLARY_NUMBERS = (0.3, 0.1, 0.03, 0.01)
COUNT, UNTIL = 5000, 0.2
"""Spheres, and length of each run [s]."""


def study(folder: Path, progress: Progress) -> list[Row]:
    """Run the tumbler at each capillary number, write histories and figures, and return the table."""
    runs = []
    for number in CAPILLARY_NUMBERS:
        progress(f"{COUNT} wet spheres at Ca = {number:g}")
        runs.append(
            tumble(number, COUNT, until=UNTIL, progress=lambda share, ca=number: progress(f"Ca = {ca:g}: {share:.0%}"))  # type: ignore[misc]
        )
    write_histories(folder / "wet_tumbler.h5", {f"Ca_{run.capillary_number:g}": _columns(run) for run in runs})
    _draw_growth(folder / "wet_tumbler_growth.png", runs)
    draw_spheres(folder / "wet_tumbler.png", [runs[0], runs[-1]])
    sizes = [run.late(run.mean_size) for run in runs]
    rows = [
        worst("spheres", [(run.capillary_number, run.spheres, COUNT) for run in runs], 0.0),
        worst("momentum less the flow's impulse", [(r.capillary_number, r.momentum_error, 0.0) for r in runs], 1e-12),
        worst("liquid in films and bridges, change", [(r.capillary_number, r.liquid_error, 0.0) for r in runs], 1e-12),
        Row("agglomerates that did not grow as Ca fell", float((np.diff(sizes) <= 0.0).sum()), 0.0, 0.0),
    ]
    for run, size in zip(runs, sizes):
        name = f"Ca = {run.capillary_number:g}: mean size, later half"
        rows += [
            Row(name, size, unit="spheres"),
            Row(f"Ca = {run.capillary_number:g}: share of spheres in the largest", run.late(run.largest_size) / COUNT),
            Row(f"Ca = {run.capillary_number:g}: bridges per sphere, later half", run.late(run.bridges)),
            Row(f"Ca = {run.capillary_number:g}: bridges broken over formed", run.broken / run.formed),
        ]
    return rows


def _columns(run: Tumbling) -> Columns:
    return {
        "time": (run.time, "s"),
        "mean_size": (run.mean_size, "-"),
        "weighed_size": (run.weighed_size, "-"),
        "largest_size": (run.largest_size, "-"),
        "bridges_per_sphere": (run.bridges, "-"),
    }


def _draw_growth(path: Path, runs: list[Tumbling]) -> None:
    """Sizes of agglomerates in time, and their means against the capillary number."""
    figure, axes = panels(2, width=10.0)
    for run, colour in zip(runs, shades(len(runs))):
        axes[0].plot(run.time, run.mean_size, color=colour, label=f"Ca = {run.capillary_number:g}")
    label(axes[0], "time", "s", "mean size of agglomerates", "spheres")
    legend(axes[0])
    numbers = [run.capillary_number for run in runs]
    axes[1].loglog(numbers, [run.late(run.mean_size) for run in runs], "o-", color=BLUE, label="mean")
    axes[1].loglog(
        numbers, [run.late(run.weighed_size) for run in runs], "s--", color=ORANGE, label="that a sphere is in"
    )
    label(axes[1], "capillary number of the stirring", "-", "size, later half of the run", "spheres")
    decades(axes[1], *numbers)
    axes[1].set_yticks(marks := [2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000], [f"{mark}" for mark in marks])
    axes[1].set_ylim(1.0, None)
    axes[1].minorticks_off()
    legend(axes[1])
    save(figure, path)


def draw_spheres(path: Path, runs: list[Tumbling]) -> None:
    """The spheres of each run seen from the front, far ones first, coloured by the size of their agglomerate."""
    import matplotlib as mpl
    from matplotlib.collections import EllipseCollection
    from matplotlib.colors import LogNorm

    figure, axes = panels(len(runs), width=5.3 * len(runs), height=4.8)
    norm, scale = LogNorm(1.0, max(float(run.largest_size[-1]) for run in runs)), mpl.colormaps["viridis_r"]
    for axis, run in zip(np.atleast_1d(axes), runs):
        spheres, box = run.run.particles, run.run.box
        place = 1e3 * (spheres.position % box)
        named = run.agglomerates
        order = np.argsort(-place[:, 1])
        near = 1.0 - place[order, 1] / (1e3 * box[1])  # 0 at the back, 1 in front
        colour = scale(norm(np.bincount(named)[named][order]))
        colour[:, :3] = 1.0 - (1.0 - colour[:, :3]) * (0.25 + 0.75 * near[:, None])
        width = 2e3 * spheres.radius[order]
        axis.add_collection(
            EllipseCollection(
                width, width, np.zeros(len(width)), units="x", offsets=place[order][:, [0, 2]],
                offset_transform=axis.transData, facecolors=colour, edgecolors="#00000055", linewidths=0.3,
            )
        )  # fmt: skip
        axis.set(xlim=(0.0, 1e3 * box[0]), ylim=(0.0, 1e3 * box[2]), aspect="equal")
        axis.grid(False)
        label(axis, "x", "mm", "z", "mm", f"Ca = {run.capillary_number:g}, {run.time[-1]:.2f} s")
    bar = mpl.cm.ScalarMappable(norm, scale)
    figure.colorbar(bar, ax=list(np.atleast_1d(axes)), label="spheres in the agglomerate  [-]", shrink=0.85)
    save(figure, path)
