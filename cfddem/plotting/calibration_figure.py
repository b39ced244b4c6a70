"""The figure of a calibration: differences of all trials against each key, and data beside the best trial."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from cfddem.case.compare import ABSCISSAE
from cfddem.io.quantities import shown_unit
from cfddem.plotting.curves import BLUE, GREY, ORANGE, SKY, blank, label, legend, save
from cfddem.plotting.sweep_figure import unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cfddem.case.compare import Points


class Found(Protocol):
    """What the figure needs of a calibration."""

    @property
    def variables(self) -> Any: ...
    @property
    def data(self) -> Any: ...
    @property
    def finished(self) -> Any: ...
    @property
    def best(self) -> Any: ...
    def estimates(self) -> list[dict[str, Any]]: ...


def calibration_figure(found: Found, path: Path) -> None:
    """Write the figure."""
    columns = len(found.variables) + len(found.data)
    rows = -(-columns // 3)
    figure, axes = blank(rows, min(columns, 3), width=3.7 * min(columns, 3), height=3.6 * rows)
    estimates = {each["key"]: each for each in found.estimates()}
    for each, panel in zip(found.variables, axes):
        values = [trial.values[each.key] for trial in found.finished]
        panel.plot(values, [trial.chi2 for trial in found.finished], "o", color=BLUE, markersize=4.5, alpha=0.8)
        if (estimate := estimates.get(each.key)) is not None:
            low, high = estimate["value"] - estimate["error"], estimate["value"] + estimate["error"]
            panel.axvspan(low, high, color=ORANGE, alpha=0.25, linewidth=0)
            panel.axvline(estimate["value"], color=ORANGE)
        panel.set(yscale="log", xlim=(each.low, each.high), **({"xscale": "log"} if each.logarithmic else {}))
        label(panel, each.key.split(".")[-1].replace("_", " "), unit_of(each.key), "mean square difference", "errors²")
    begin = 0
    for each, panel in zip(found.data, axes[len(found.variables) :]):
        end = begin + len(each.value)
        if each.against:
            _series(panel, found, each, slice(begin, end))
        else:
            _mean(panel, found, each, slice(begin, end))
        legend(panel)
        begin = end
    for panel in axes[:columns]:
        if panel.get_xscale() == "linear":
            panel.locator_params(axis="x", nbins=4)
            panel.ticklabel_format(axis="x", scilimits=(-2, 4), useMathText=True)
    for panel in axes[columns:]:
        panel.remove()
    axes[0].axhline(1.0, color=GREY, linewidth=1.0, linestyle="--")
    save(figure, path)


def _series(panel: Axes, found: Found, data: Points, part: slice) -> None:
    """Points in time or height beside all trials."""
    for trial in found.finished:
        panel.plot(data.place, trial.computed[part], color=SKY, alpha=0.35, linewidth=0.8, marker=".", markersize=3)
    panel.plot([], [], color=SKY, label="all trials")
    panel.plot(data.place, found.best.computed[part], color=BLUE, marker=".", label="best trial")
    style: dict[str, Any] = {"fmt": "o", "color": ORANGE, "capsize": 2.5, "zorder": 3}
    panel.errorbar(data.place, data.value, yerr=data.error, label="measured", **style)
    axis = (data.against.replace("_", " "), ABSCISSAE[data.against])
    label(panel, *axis, data.quantity.replace("_", " "), shown_unit(data.unit))


def _mean(panel: Axes, found: Found, data: Points, part: slice) -> None:
    """Means of all trials against the key that the data identify best, and the measured ones as bands."""
    shares = [each["error"] / (each["high"] - each["low"]) for each in found.estimates()]
    key = found.variables[int(np.argmin(shares)) if shares else 0]
    values = [trial.values[key.key] for trial in found.finished]
    panel.plot(values, [trial.computed[part][0] for trial in found.finished], "o", color=BLUE, label="trials")
    for value, error in zip(data.value, data.error):
        panel.axhspan(value - error, value + error, color=ORANGE, alpha=0.25, linewidth=0)
        panel.axhline(value, color=ORANGE, label="measured" if value == data.value[0] else None)
    label(panel, key.key.split(".")[-1].replace("_", " "), unit_of(key.key), data.quantity.replace("_", " "),
          shown_unit(data.unit))  # fmt: skip
