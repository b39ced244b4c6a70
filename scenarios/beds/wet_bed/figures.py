"""Figure of Mueller's wet bed: what the pull of the bridges changes, and the ramps of the gas velocity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cfddem.plotting.curves import BLUE, GREEN, ORANGE, label, legend, line_styles, panels, save

Estimate = tuple[float, float]
"""A mean and its standard error."""

QUANTITIES = (
    ("bubble", "bubble diameter", BLUE, "o"),
    ("pressure_deviation", "pressure fluctuation", ORANGE, "s"),
    ("temperature", "granular temperature", GREEN, "^"),
)
"""Quantities whose ratios to the dry bed are drawn: name, words, colour, marker."""

SMOOTHED = 0.4
"""Time over which the curves of the ramps are averaged [s]."""


class Ramp(NamedTuple):
    """A bed while its gas velocity falls."""

    time: np.ndarray  # (n,) [s]
    velocity: np.ndarray  # (n,) superficial [m/s]
    share: np.ndarray  # (n,) pressure drop over the weight
    onset: float  # minimum fluidisation [m/s]; NaN if not found
    note: str = ""  # why it was not found


def draw(
    path: Path, pulls: Sequence[float], ratios: Mapping[str, Sequence[Estimate]], ramps: Mapping[str, Ramp]
) -> None:
    """Ratios to the dry bed against the pull of a bridge, and the pressure drop of the ramps.

    pulls   of each state over the weight of a particle
    ratios  quantity -> its mean in each state over that of the dry bed
    ramps   by state
    """
    figure, (left, right) = panels(2, width=10.0, height=4.4)
    for name, words, colour, marker in QUANTITIES:
        values, errors = np.array(ratios[name]).T
        left.errorbar(pulls, values, 2.0 * errors, color=colour, marker=marker, capsize=3.0, label=words)
    left.set_yscale("log")
    left.set_yticks((0.3, 0.5, 1.0, 2.0), ("0.3", "0.5", "1", "2"))
    left.minorticks_off()
    label(left, "pull of a bridge over weight", "-", "over that of the dry bed", "-", "In the bubbling bed")
    legend(left)
    for style, (name, ramp) in zip(line_styles(len(ramps)), ramps.items()):
        width = max(round(SMOOTHED / float(np.median(np.diff(ramp.time)))), 1)
        kernel = np.full(width, 1.0 / width)
        velocity, share = (np.convolve(each, kernel, "valid") for each in (ramp.velocity, ramp.share))
        right.plot(velocity, share, label=name, **style)
        right.plot([ramp.onset], [1.0], "o", color=style["color"], markersize=7.0)
    label(right, "gas velocity", "m/s", "pressure drop over weight", "-", "While the velocity falls")
    if ramps:
        legend(right)
    save(figure, path)
