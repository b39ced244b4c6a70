"""Detector of defluidisation: from when a wet bed no longer moves, or no longer carries its weight, and why."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cfddem.analysis.bed_laws import weight_over_floor
from cfddem.case.bed import at_times
from cfddem.case.schema import Case
from cfddem.io.reading import RunData
from cfddem.preflight.bed_estimate import estimate_bed, share_of_jet

Series = NDArray[np.float64]

CARRIED = 0.8
"""Pressure drop over weight below which gas passes the bed without carrying it [-]."""

STILL = 0.1
"""Granular temperature over its largest value so far, below which a bed has come to rest [-]."""

NEVER_MOVED = 1e-4
"""Granular temperature over the square of the inlet velocity above minimum fluidisation, below which a bed rests [-].

In bubbling beds it is a few thousandths."""

SMOOTHED = 0.05
"""Share of the series over which it is averaged before it is judged [-]."""

LASTING = 4
"""Averages that a bed must fail one after the other, up to the end."""

LASTING_STILL = 2
"""The same for a bed in which hardly anything moves: bubbling beds make no such pauses."""


@dataclass(frozen=True)
class Defluidisation:
    """When a bed stopped being fluidised, and what shows it."""

    time: float  # [s]
    rests: bool  # its particles hardly move relative to each other
    passed: bool  # gas passes it without carrying its weight
    largest_share: float  # of the particles in the largest agglomerate then [-]

    def __str__(self) -> str:
        signs = [
            f"the granular temperature is below {100.0 * STILL:g} % of its maximum, or that of a moving bed"
            * self.rests,
            f"the pressure drop is below {100.0 * CARRIED:g} % of the weight" * self.passed,
        ]
        reasons = " and ".join(filter(None, signs))
        largest = f"; the largest agglomerate holds {100.0 * self.largest_share:.0f} % of the particles"
        return f"defluidised from t = {self.time:.3g} s on: {reasons}{largest}"


def defluidisation_of(run: RunData, case: Case) -> Defluidisation | None:
    """Defluidisation of a wet bed at a velocity that fluidises it dry; None if it is fluidised at the end, or dry.

    A spout carries a part of the weight, and moves most as it breaks through: a bed with a jet is only found at rest.
    """
    weight, history = weight_over_floor(case), run.history
    if case.liquid is None or weight is None or "largest_agglomerate" not in history or "pressure_drop" not in history:
        return None
    inlet, jet, bed, time = case.bed.inlet_velocity, case.bed.jet, estimate_bed(case), history["time"]
    speed = at_times(inlet, time)
    if jet:
        speed = speed + share_of_jet(case, jet) * (jet.velocity - speed)
    joined = history["largest_agglomerate"] > 1.0  # before a spray begins, no liquid holds the particles
    largest_share = history["largest_agglomerate"] / np.maximum(history["particle_count"], 1.0)
    return defluidisation(
        time, history["pressure_drop"] / weight, history["granular_temperature"], largest_share,
        np.where(joined, speed - bed.onset, 0.0), spouts=bool(jet),
    )  # fmt: skip


def defluidisation(
    time: Series, carried: Series, temperature: Series, largest_share: Series, excess: Series, *, spouts: bool = False
) -> Defluidisation | None:
    """The time from which on a bed is not fluidised although it is blown; None if it is fluidised at the end.

    time           of the rows (n,) [s]
    carried        pressure drop over weight (n,)
    temperature    granular temperature (n,) [m2/s2]
    largest_share  of the particles in the largest agglomerate (n,)
    excess         inlet velocity above minimum fluidisation of the dry bed; rows without are left out (n,) [m/s]
    spouts         whether a jet enters: neither the load nor the largest motion of a spout says anything

    >>> time = np.linspace(0.0, 1.0, 101)
    >>> moving = np.where(time < 0.5, 1e-3, 1e-6)
    >>> print(defluidisation(time, np.ones(101), moving, 0.9 * np.ones(101), 0.5 * (time > 0.1)))
    defluidised from t = 0.53 s on: the granular temperature is below 10 % of its maximum, or that of a moving bed; the largest agglomerate holds 90 % of the particles
    """  # noqa: E501  the line is printed as one
    rows = np.flatnonzero((excess > 0.0) & np.isfinite(carried) & np.isfinite(temperature))
    width = max(1, round(SMOOTHED * len(rows)))
    if len(rows) < 4 * width or rows[-1] != len(time) - 1:
        return None
    load, motion, least = (_averaged(series[rows], width) for series in (carried, temperature, NEVER_MOVED * excess**2))
    still, passed = motion < least, (load < CARRIED) & (not spouts)
    rests = still | ((motion < STILL * np.maximum.accumulate(motion)) & (not spouts))
    failed = rests | passed
    if not (failed[-LASTING * width :].all() or still[-LASTING_STILL * width :].all()):
        return None
    first = len(failed) - int(np.argmin(failed[::-1])) if not failed.all() else 0
    row = rows[first]
    share = float(largest_share[row])
    return Defluidisation(float(time[row]), bool(rests[first:].mean() > 0.5), bool(passed[first:].mean() > 0.5), share)


def _averaged(series: Series, width: int) -> Series:
    """Mean over this and the `width` - 1 rows before, fewer at the start."""
    total = np.cumsum(np.concatenate([[0.0], series]))
    end = np.arange(1, len(series) + 1)
    begin = np.maximum(end - width, 0)
    return np.asarray((total[end] - total[begin]) / (end - begin))
