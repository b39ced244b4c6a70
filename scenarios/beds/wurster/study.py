"""Circulation of a bed through a draft tube: how many pellets rise in it, how fast, and that none passes its wall."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.case.walls import CaseWall
from cfddem.io.reading import RunData, open_run
from cfddem.plotting.curves import BLUE, ORANGE, legend, panels, save
from scenarios.beds.vessel_slice import WALL, draw_spheres, draw_vessel

INNER = 0.25
"""Part of the tube at each end that is left out [-]."""


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
        rise, fall = (float(up[level & each].sum()) / (high - low) for each in (within, ~within))
        rows.append((rise, -fall, mean, float(np.quantile(z, 0.99))))
        now = level[order], within[order]
        if before is not None:
            crossings += int(np.count_nonzero(now[0] & before[0] & (now[1] != before[1])))
        before = now
    rising, falling, velocity, top = np.array(rows).T
    return Circulation(np.array(run.times), rising, falling, velocity, top, crossings)


# ---------------------------------------------------------------- figure of the coater


def figure(run: RunData, case: Case, times: Sequence[float], path: Path) -> None:
    """Pellets near the middle plane at some times, the mean velocity of the air, and the circulation."""
    drawn, axes = panels(len(times) + 2, width=11.0, height=4.0, width_ratios=[*[1.0] * (len(times) + 1), 1.5])
    for axis, time in zip(axes, times):
        shown = draw_spheres(axis, run, case, time, reach=0.75, size=11.0, fastest=1.5)
        axis.set_title(f"{shown:.2f} s", fontsize=9.5)
    late = [n for n, time in enumerate(run.times) if time > 0.5 * run.times[-1]]
    velocity = np.mean([run.fluid("velocity", n)[..., 2] for n in late], axis=0)
    rows = slice(velocity.shape[1] // 2 - 1, velocity.shape[1] // 2 + 1)
    seen = axes[-2].imshow(
        velocity[:, rows].mean(axis=1), origin="lower", cmap="viridis", vmin=0.0,
        extent=(0.0, case.column.width, 0.0, case.column.height),
    )  # fmt: skip
    drawn.colorbar(seen, ax=axes[-2], shrink=0.7, pad=0.04)
    axes[-2].set_title("air, upward  [m/s]", fontsize=9.5)
    tube = tube_of(case)
    ends = [tube.point[2], tube.point[2] + (tube.length or 0.0)]
    for axis in axes[:-1]:
        draw_vessel(axis, case, case.column.height)
        for side in (-1.0, 1.0):
            axis.plot(2 * [tube.point[0] + side * (tube.radius or 0.0)], ends, color=WALL, lw=1.6)
    found, curve = circulation(run, case), axes[-1]
    curve.plot(found.time, found.rising, color=BLUE, label="rise in the tube  [1/s]")
    curve.plot(found.time, found.falling, color=ORANGE, label="fall around it  [1/s]")
    curve.set(xlabel="time  [s]", ylim=(0.0, 1.3 * float(np.nanmax(found.rising))))
    legend(curve, loc="upper right")
    save(drawn, path)


if __name__ == "__main__":
    figure(open_run(sys.argv[1]), gallery()["wurster"], (0.1, 0.2, 0.4), Path(sys.argv[2]))
