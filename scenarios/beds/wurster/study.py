"""Circulation of a bed through a draft tube, and the spray on it: how many pellets rise and how fast, that none passes
the wall of the tube, how many get liquid, and how evenly."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.case.walls import CaseWall
from cfddem.features.spray import cone
from cfddem.io.reading import RunData, open_run
from cfddem.plotting.curves import BLUE, ORANGE, legend, panels, save
from scenarios.beds.vessel_slice import CUBIC_MILLIMETRES, WALL, draw_spheres, draw_vessel

INNER = 0.25
"""Part of the tube at each end that is left out [-]."""

PARTS = 20
"""Parts of the time between snapshots at which pellets are looked for in the spray."""

MOST = 0.05
"""Liquid on a pellet at the end of the colours [mm3]."""


@dataclass(frozen=True)
class Circulation:
    """Pellets within and around the inner part of a draft tube, snapshot by snapshot."""

    time: np.ndarray  # [s]
    rising: np.ndarray  # rate through the tube, upward [1/s]
    falling: np.ndarray  # rate around the tube, downward [1/s]
    velocity: np.ndarray  # mean in the tube, upward [m/s]; NaN where there are none
    top: np.ndarray  # height below which 99 % of the pellets are [m]
    crossings: int  # pellets that are on the other side of its wall in the next snapshot


def tube_of(case: Case) -> CaseWall:
    """The draft tube of a case, its first thin wall."""
    return case.thin_walls[0]


def circulation(run: RunData, case: Case) -> Circulation:
    """Rates are the sum of the vertical velocities over the length of the inner part.

    A pellet that is in the inner part in two snapshots after each other, and once within the tube and once around it,
    has passed its wall: there is no time for the way around an end.
    """
    tube, rows, crossings = tube_of(case), list[tuple[float, float, float, float]](), 0
    length, radius = tube.length or np.nan, tube.radius or np.nan
    low, high = tube.point[2] + INNER * length, tube.point[2] + (1.0 - INNER) * length
    before: tuple[np.ndarray, np.ndarray] | None = None
    for n in range(len(run.times)):
        particles = run.particles(n)
        x, y, z = particles["position"].T
        order = np.argsort(particles["id"])
        level, within = (z > low) & (z < high), np.hypot(x - tube.point[0], y - tube.point[1]) < radius
        up = particles["velocity"][:, 2]
        mean = float(up[level & within].mean()) if (level & within).any() else np.nan
        rise, fall = (float(up[level & region].sum()) / (high - low) for region in (within, ~within))
        rows.append((rise, -fall, mean, float(np.quantile(z, 0.99))))
        now = level[order], within[order]
        if before is not None:
            crossings += int(np.count_nonzero(now[0] & before[0] & (now[1] != before[1])))
        before = now
    rising, falling, velocity, top = np.array(rows).T
    return Circulation(np.array(run.times), rising, falling, velocity, top, crossings)


@dataclass(frozen=True)
class Coating:
    """Pellets in the spray while it is on, and the liquid on all pellets at the end."""

    reached: float  # share of the pellets that were in the spray [-]
    visits: float  # entries into it, over all pellets and the time [1/s]
    residence: float  # mean time of a visit [s]
    missed: float  # share of the drops that found no pellet [-]
    liquid: np.ndarray  # of each pellet, its part of bridges included, the driest first [m3]

    @property
    def wet(self) -> float:
        """Share of the pellets that carry liquid at the end [-]."""
        return float((self.liquid > 0.0).mean())

    @property
    def variation(self) -> float:
        """Standard deviation of the liquid on a pellet over its mean, dry ones included [-]."""
        return float(self.liquid.std() / self.liquid.mean())

    @property
    def half_on(self) -> float:
        """Share of the pellets, those with the most liquid, that carry half of it [-]."""
        carried = np.cumsum(self.liquid[::-1])
        return float((np.searchsorted(carried, 0.5 * carried[-1]) + 1) / len(carried))


def coating(run: RunData, case: Case) -> Coating:
    """The spray on a bed, from its begin to the end of the run.

    Pellets move along straight lines between snapshots. The time of a visit is that of all pellets in the spray over
    the number of entries.
    """
    spray = case.spray
    assert spray
    zone = cone(np.array(spray.nozzle), spray.axis, np.radians(spray.angle), spray.length or 0.0)
    chosen = [n for n, time in enumerate(run.times) if time > spray.begin - 1e-9]
    places = []
    for n in chosen:
        particles = run.particles(n)
        places.append(particles["position"][np.argsort(particles["id"])].astype(float))
    between = (np.arange(PARTS) + 1.0) / PARTS
    inside = np.array([zone(places[0])] + [zone(a + part * (b - a)) for a, b in pairwise(places) for part in between])
    entries, span = int((inside[1:] & ~inside[:-1]).sum()), float(run.times[chosen[-1]] - run.times[chosen[0]])
    sprayed, missed = (float(run.history[name][-1]) for name in ("liquid_sprayed", "liquid_missed"))
    return Coating(
        reached=float(inside.any(axis=0).mean()),
        visits=entries / inside.shape[1] / span,
        residence=float(inside[1:].mean(axis=0).sum()) * span / entries,
        missed=missed / (sprayed + missed),
        liquid=np.sort(run.particles(-1)["liquid_carried"]),
    )


# ---------------------------------------------------------------- figure of the coater


def figure(run: RunData, case: Case, times: Sequence[float], path: Path) -> None:
    """Pellets near the middle plane at some times, coloured by their liquid, mean velocity and temperature of the air,
    the circulation, and how many pellets carry how much."""
    ratios = [*[1.0] * (len(times) + 2), 1.6, 1.6]
    drawn, axes = panels(len(times) + 4, width=11.0, height=3.1, width_ratios=ratios)
    for axis, time in zip(axes, times):
        shown, balls = draw_spheres(axis, run, case, time, reach=0.75, size=9.0, most=MOST, by="liquid")
        axis.set_title(f"{shown:.2f} s", fontsize=9.5)
    *_, flow, heat, curve, histogram = axes
    bar = drawn.colorbar(balls, ax=axes[len(times) - 1], shrink=0.7, pad=0.04, extend="max")
    bar.ax.set_title("mm3", fontsize=9.5)
    late = [n for n, time in enumerate(run.times) if time > 0.5 * run.times[-1]]
    velocity = np.mean([run.fluid("velocity", n)[..., 2] for n in late], axis=0)
    celsius = np.mean([run.fluid("temperature", n) for n in late], axis=0) - 273.15
    for axis, values, least, title in ((flow, velocity, 0.0, "air, upward  [m/s]"), (heat, celsius, None, "air  [°C]")):
        rows = slice(values.shape[1] // 2 - 1, values.shape[1] // 2 + 1)
        air = axis.imshow(
            values[:, rows].mean(axis=1), origin="lower", cmap="plasma" if axis is heat else "viridis", vmin=least,
            extent=(0.0, case.column.width, 0.0, case.column.height),
        )  # fmt: skip
        axis.grid(False)
        drawn.colorbar(air, ax=axis, shrink=0.7, pad=0.04)
        axis.set_title(title, fontsize=9.5)
    tube = tube_of(case)
    ends = [tube.point[2], tube.point[2] + (tube.length or 0.0)]
    for axis in axes[:-2]:
        draw_vessel(axis, case, case.column.height)
        for side in (-1.0, 1.0):
            axis.plot(2 * [tube.point[0] + side * (tube.radius or 0.0)], ends, color=WALL, lw=1.6)
    for axis in axes[1:-2]:
        axis.set(ylabel="", yticklabels=[])
    pellets = circulation(run, case)
    curve.plot(pellets.time, pellets.rising / 1e3, color=BLUE, label="rise in the tube")
    curve.plot(pellets.time, pellets.falling / 1e3, color=ORANGE, label="fall around it")
    curve.set(xlabel="time  [s]", ylim=(0.0, 1.4e-3 * float(np.nanmax(pellets.rising))))
    curve.set_title("pellets in a second, thousands", fontsize=9.5)
    legend(curve, loc="upper right")
    carried = coating(run, case).liquid * CUBIC_MILLIMETRES
    histogram.hist(carried[carried > 0.0], bins=np.linspace(0.0, max(2.0 * MOST, float(carried.max())), 25), color=BLUE)
    histogram.set(xlabel="on a pellet  [mm3]", yscale="log")
    histogram.set_title("wet pellets, at the end", fontsize=9.5)
    save(drawn, path)


if __name__ == "__main__":
    figure(open_run(sys.argv[1]), gallery()["wurster"], (0.3, 0.6), Path(sys.argv[2]))
