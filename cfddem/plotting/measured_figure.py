"""Measured points with their errors on the curves of a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cfddem.analysis.measured import MeasuredComparison
from cfddem.case.compare import ABSCISSAE
from cfddem.io.quantities import shown_unit
from cfddem.plotting.curves import BLUE, ORANGE, blank, label, legend


def measured_figure(found: Sequence[MeasuredComparison]) -> Any:
    """One panel for each set of measured data: the run as a line, the points with error bars."""
    figure, axes = blank(len(found), 1, width=8.0, height=0.5 + 3.0 * len(found))
    for each, panel in zip(found, axes):
        points, bars = each.points, np.where(np.isfinite(each.points.error), each.points.error, 0.0)
        name = points.quantity.replace("_", " ")
        style: dict[str, Any] = {"fmt": "o", "color": ORANGE, "markersize": 5.0, "capsize": 2.5, "zorder": 3}
        if points.against == "height":
            panel.plot(each.line[1], each.line[0], color=BLUE, label="run")
            panel.errorbar(points.value, points.place, xerr=bars, label="measured", **style)
            label(panel, name, shown_unit(points.unit), "height", "m", points.name)
        elif points.against:
            marker = "o-" if points.against == "inlet_velocity" else "-"
            panel.plot(*each.line, marker, color=BLUE, label="run")
            panel.errorbar(points.place, points.value, yerr=bars, label="measured", **style)
            axis = (points.against.replace("_", " "), ABSCISSAE[points.against])
            label(panel, *axis, name, shown_unit(points.unit), points.name)
        else:
            place, mean = np.arange(len(points.value)) + 1.0, float(each.computed[0])
            error = float(np.max(each.computed_error))
            panel.axhspan(mean - error, mean + error, color=BLUE, alpha=0.2, linewidth=0)
            panel.axhline(mean, color=BLUE, label="run")
            panel.errorbar(place, points.value, yerr=bars, label="measured", **style)
            label(panel, "measurement", "-", name, shown_unit(points.unit), points.name)
            panel.set_xticks(place if len(place) <= 20 else [])
            panel.set_xlim(0.5, len(place) + 0.5)
        legend(panel)
    return figure
