"""A hopper with a gate, a feed and an outlet: its discharge beside the law of Beverloo.

>>> from cfddem.case.gallery import gallery
>>> from cfddem.case.schema import Case
>>> round(beverloo(gallery()["hopper"]), 3)
0.404
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.case.bed import POURED_SOLID_FRACTION
from cfddem.case.schema import Case
from cfddem.io.reading import RunData
from cfddem.plotting.curves import BLUE, GREY, blank, label, legend, save
from closures import discharge as laws_of_discharge


@dataclass(frozen=True)
class Discharge:
    """Mass flow out of the hopper."""

    mean: float  # over the averaging window [kg/s]
    halves: tuple[float, float]  # over its two halves [kg/s]
    law: float  # by Beverloo [kg/s]


def beverloo(case: Case) -> float:
    """Discharge of the first wall, a cone, by Beverloo with a correction for its angle [kg/s]."""
    cone = case.wall[0]
    orifice = cone.radius or 0.0
    return of_cone(case, orifice, ((cone.top_radius or 0.0) - orifice) / (cone.length or 1.0))


def bulk_of(case: Case) -> float:
    """Density of a poured bed [kg/m3]."""
    return POURED_SOLID_FRACTION * case.solid.density


def of_cone(case: Case, orifice: float, slope: float) -> float:
    """Discharge through the lower end of a cone, without air [kg/s].

    orifice  its radius [m]
    slope    increase of the radius with height [-]
    """
    gravity = math.hypot(*case.laws.gravity)
    flat = laws_of_discharge.beverloo(bulk_of(case), 2.0 * orifice, case.bed.diameter, gravity)
    return flat * laws_of_discharge.cone_factor(slope)


def discharge(run: RunData, case: Case) -> Discharge:
    """Discharge of a run, from the mass that its outlet has removed."""
    begin, end = case.run.average_from or 0.5 * case.run.until, case.run.until
    middle = 0.5 * (begin + end)
    rates = [removal_rate(run, *span) for span in ((begin, end), (begin, middle), (middle, end))]
    return Discharge(rates[0], (rates[1], rates[2]), beverloo(case))


def removal_rate(run: RunData, begin: float, end: float) -> float:
    """Mass that outlets remove per time, between two times [kg/s]."""
    time = run.history["time"]
    inside = (time >= begin) & (time <= end)
    return float(np.polyfit(time[inside], run.history["removed_mass"][inside], 1)[0])


# ---------------------------------------------------------------- figure of the hopper


TIMES = (0.0, 0.1, 0.5)
"""Times of the pictures [s]."""

FASTEST = 1.0
"""Speed of the brightest colour [m/s]."""


def figure(run: RunData, case: Case, path: Path) -> None:
    """Beads behind the middle plane, coloured by speed, between the walls; and the removed mass against time."""
    drawn, axes = blank(1, len(TIMES) + 1, width=11.0, height=4.2, gridspec_kw={"width_ratios": [1, 1, 1, 1.5]})
    for panel, time in zip(axes, TIMES):
        colours = _beads(panel, run, case, int(np.abs(run.times - time).argmin()))
        _walls(panel, case, time)
        label(panel, "x", "mm", "z", "mm", f"t = {time:g} s")
        if panel is not axes[0]:
            panel.set_ylabel("")
    drawn.colorbar(colours, ax=list(axes[: len(TIMES)]), label="speed [m/s]", shrink=0.8, pad=0.02)
    history, law = run.history, beverloo(case)
    axes[-1].plot(history["time"], history["removed_mass"], color=BLUE, label="run")
    late = history["time"] >= (case.run.average_from or 0.0)
    begin = history["time"][late][0], history["removed_mass"][late][0]
    line = begin[1] + law * (history["time"][late] - begin[0])
    axes[-1].plot(history["time"][late], line, color=GREY, ls="--", label=f"Beverloo, {law:.2f} kg/s")
    label(axes[-1], "time", "s", "removed mass", "kg")
    legend(axes[-1])
    save(drawn, path)


def _beads(axes: Any, run: RunData, case: Case, place: int) -> Any:
    """Beads with centres behind the middle plane, the nearest on top."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle

    particles = run.particles(place)
    position, speed = particles["position"], np.linalg.norm(particles["velocity"], axis=1)
    behind = np.flatnonzero(position[:, 1] >= 0.5 * case.column.size[1])
    order = behind[np.argsort(-position[behind, 1])]
    x, z, radius = 1e3 * position[:, 0], 1e3 * position[:, 2], 1e3 * particles["radius"]
    circles = [Circle((float(x[n]), float(z[n])), float(radius[n])) for n in order]
    drawn = PatchCollection(circles, cmap="viridis", edgecolor="black", linewidth=0.2)
    drawn.set_array(speed[order])
    drawn.set_clim(0.0, FASTEST)
    axes.add_collection(drawn)
    axes.set_xlim(25.0, 125.0)
    axes.set_ylim(25.0, 190.0)
    axes.set_aspect("equal")
    axes.grid(False)
    return drawn


def _walls(axes: Any, case: Case, time: float) -> None:
    """Outlines of upright walls in the middle plane."""
    for wall in case.wall:
        active = min(max(time, wall.begin), wall.end or time) - wall.begin if time > wall.begin else 0.0
        middle = 1e3 * (wall.point[0] + wall.velocity[0] * active)
        low, length = 1e3 * wall.point[2], 1e3 * (wall.length or 0.0)
        lower, upper = 1e3 * (wall.radius or 0.0), 1e3 * (wall.top_radius or wall.radius or 0.0)
        if wall.caps:
            axes.fill_between([middle - lower, middle + lower], low, low + length, color=GREY)
            continue
        for side in (-1.0, 1.0):
            axes.plot([middle + side * lower, middle + side * upper], [low, low + length], color="black", lw=1.5)
