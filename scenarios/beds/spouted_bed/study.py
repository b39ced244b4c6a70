"""A jet of air from a slot in the floor blows a spout through a bed: velocity profiles of the particles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfddem.backend.errors import InputError
from cfddem.case.gallery import gallery
from cfddem.case.schema import Case
from cfddem.io.reading import RunData

BED_HEIGHT = 0.2
"""H0, height of the bed at rest in the experiment [m]."""

HEIGHTS = tuple(BED_HEIGHT * share for share in (0.15, 0.30, 0.45, 0.60, 0.75, 0.80))
"""Heights at which the particle speed was measured [m]."""

SPOUTED = 2.0 / math.pi
"""Pressure drop over weight of a bed of the largest depth that spouts, by the theory of
Lefroy & Davidson, Trans. Inst. Chem. Eng. 47 (1969) 120: its gradient is a sine of the height."""


@dataclass(frozen=True)
class Profile:
    """Means in time at one height, across the bed."""

    height: float  # [m]
    place: np.ndarray  # middle of each bin, from the middle of the bed (n,) [m]
    speed: np.ndarray  # mean particle speed; NaN where there were no particles (n,) [m/s]
    upward: np.ndarray  # vertical velocity (n,) [m/s]

    @property
    def spout_width(self) -> float:
        """Width of mean upward motion [m]."""
        return float(np.nansum(self.upward > 0.0) * (self.place[1] - self.place[0]))


def bed() -> Case:
    """The slice of the gallery."""
    return gallery()["spouted-bed"]


def profiles(
    run: RunData, width: float, begin: float, heights: Sequence[float] = HEIGHTS, bin_width: float = 0.008,
) -> list[Profile]:  # fmt: skip
    """Particle velocities across the bed at some heights, averaged over the snapshots of a run.

    run        to be evaluated
    width      of the bed [m]
    begin      of the average [s]
    heights    [m]; particles within half a bin above and below count
    bin_width  [m]
    """
    chosen = np.flatnonzero(run.times >= begin)
    if not len(chosen):
        raise InputError("begin", begin, f"at most {run.times[-1]:g} s, the last snapshot")
    bins = round(width / bin_width)
    sums = np.zeros((3, len(heights), bins))
    for place in chosen:
        particles = run.particles(int(place))
        speed = np.linalg.norm(particles["velocity"], axis=1)
        column = np.clip((particles["position"][:, 0] / width * bins).astype(int), 0, bins - 1)
        for row, height in enumerate(heights):
            near = np.abs(particles["position"][:, 2] - height) <= 0.5 * bin_width
            for sum_of, values in zip(sums[:, row], (np.ones_like(speed), speed, particles["velocity"][:, 2])):
                sum_of += np.bincount(column[near], values[near], bins)
    with np.errstate(invalid="ignore"):
        means = sums[1:] / sums[0]
    middles = ((np.arange(bins) + 0.5) / bins - 0.5) * width
    return [Profile(height, middles, *means[:, row]) for row, height in enumerate(heights)]
