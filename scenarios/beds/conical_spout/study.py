"""Onset of spouting in a cone, from the fountain of a run, beside a published correlation."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import find_peaks

from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.io.reading import RunData, open_run
from cfddem.plotting.curves import BLUE, GREY, ORANGE, legend, panels, save
from scenarios.beds.vessel_slice import draw_spheres, draw_vessel

OPEN = 0.7
"""Voidage on the axis from which a layer of the bed belongs to the spout [-]."""

BED = 0.9
"""Share of the height of the bed at rest up to which the spout is looked for [-]."""

PROMINENT = 50.0
"""A peak of the pressure drop that is a spout which closes stands out from its sides by this much [Pa]."""


@dataclass(frozen=True)
class Spouting:
    """What the voidage on the axis, snapshot by snapshot, and the pressure drop tell of a spout."""

    time: np.ndarray  # [s]
    velocity: np.ndarray  # through the nozzle [m/s]
    voidage: np.ndarray  # lowest on the axis, in the bed [-]
    closes: float  # velocity at the last peak of the pressure drop: the minimum of spouting; NaN without a peak [m/s]

    @property
    def last_open(self) -> float:
        """Velocity at which a spout last reaches through the bed [m/s]; NaN if none does."""
        is_open = np.flatnonzero(self.voidage > OPEN)
        return float(self.velocity[is_open[-1]]) if len(is_open) else math.nan


def olazar(case: Case) -> float:
    """Minimum velocity of spouting in the nozzle [m/s], by Olazar et al., Ind. Eng. Chem. Res. 31 (1992) 1784.

    Re = 0.126 Ar^0.5 (D_b/D_o)^1.68 tan(gamma/2)^-0.57, with Re of the particle diameter and the velocity in the
    nozzle, the diameter D_b of the surface of the bed at rest, D_o of the nozzle, and the angle gamma of the cone. The
    constants were not compared with the paper.
    """
    (_, low), (length, high) = case.line[:2]
    fluid, diameter, nozzle = case.required_fluid, case.bed.diameter, case.patch["nozzle"].diameter or math.nan
    slope = (high - low) / length
    surface = 2.0 * (low + slope * (case.bed.height or math.nan))
    excess = case.solid_density - fluid.density
    archimedes = diameter**3 * fluid.density * excess * abs(case.laws.gravity[2]) / fluid.viscosity**2
    reynolds = 0.126 * math.sqrt(archimedes) * (surface / nozzle) ** 1.68 * slope**-0.57
    return reynolds * fluid.viscosity / (fluid.density * diameter)


def spouting(run: RunData, case: Case) -> Spouting:
    """A spout of a run whose velocity falls at the end.

    The lowest voidage on the axis is that of the four cells around it, up to most of the height of the bed at rest. The
    velocity at which the pressure drop peaks as it falls is what experiments take for the minimum of spouting.
    """
    nozzle, grid = case.patch["nozzle"], run.grid
    assert grid is not None
    nx, ny, _ = grid.cells
    top = round(BED * (case.bed.height or math.nan) / grid.spacing[2])
    middle = np.s_[:top, ny // 2 - 1 : ny // 2 + 1, nx // 2 - 1 : nx // 2 + 1]
    lowest = [run.fluid("voidage", n)[middle].mean(axis=(1, 2)).min() for n in range(len(run.times))]
    peaks = find_peaks(run.history["pressure_drop"], prominence=PROMINENT)[0]
    speeds, at_peaks = ([nozzle.speed(float(t)) for t in times] for times in (run.times, run.history["time"][peaks]))
    closes = [speed for speed in at_peaks if speed < max(speeds)] or [math.nan]
    return Spouting(np.array(run.times), np.array(speeds), np.array(lowest), closes[-1])


# ---------------------------------------------------------------- figure of the conical spout


def figure(run: RunData, case: Case, times: Sequence[float], path: Path) -> None:
    """Spheres near the middle plane at some times, and the voidage on the axis as the velocity falls."""
    drawn, axes = panels(len(times) + 1, width=11.0, height=3.2, width_ratios=[*[1.0] * len(times), 1.5])
    for axis, time in zip(axes, times):
        shown, _ = draw_spheres(axis, run, case, time, reach=1.0, size=20.0, most=0.6)
        draw_vessel(axis, case, 0.6 * case.column.height)
        axis.set_title(f"{shown:.2f} s, {case.patch['nozzle'].speed(shown):.3g} m/s", fontsize=9.5)
    spout, curve = spouting(run, case), axes[-1]
    curve.plot(spout.time, spout.voidage, color=BLUE, label="lowest voidage on the axis")
    curve.plot(spout.time, spout.velocity / olazar(case), color=ORANGE, label="velocity / Olazar et al.")
    curve.plot(
        run.history["time"], run.history["pressure_drop"] / 1e3, color=GREY, lw=1.0, label="pressure drop  [kPa]"
    )
    curve.set(ylim=(0.0, 2.4), xlabel="time  [s]")
    legend(curve, loc="upper right")
    save(drawn, path)


if __name__ == "__main__":
    figure(open_run(sys.argv[1]), gallery()["conical-spout"], (0.14, 0.42, 0.7), Path(sys.argv[2]))
