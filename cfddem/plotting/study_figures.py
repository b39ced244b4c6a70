"""Figures of a sweep, means against the first key that was changed, of a calibration, and of waves of a bed."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cfddem.analysis.fluctuations import Impacts, maxwellian_impact_speed
from cfddem.analysis.layers import LayerMap, Waves, layer_map, waves
from cfddem.analysis.measures import bed_height
from cfddem.analysis.report import case_of, window_of
from cfddem.case.compare import ABSCISSAE, Points
from cfddem.case.input_errors import field_of
from cfddem.case.schema import Case
from cfddem.io.quantities import shown_unit
from cfddem.io.reading import open_run
from cfddem.plotting.curves import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    SKY,
    blank,
    label,
    legend,
    legend_below,
    panels,
    save,
    shades,
)
from cfddem.preflight.bed_waves import BedWaves

if TYPE_CHECKING:
    from matplotlib.axes import Axes


SHOWN = ("bed_height", "bed_voidage", "pressure_drop")
"""Measures in the figure."""

VELOCITY = "bed.inlet_velocity"
"""Key of a sweep beside which measured curves are drawn."""

OF_COLLISIONS = {"stokes": "-", "angle": "deg"}
"""What collisions were measured against, and its unit."""

MOST_LABELLED = 8
"""Largest number of curves with a legend."""


class Point(NamedTuple):
    """One finished run."""

    values: Mapping[str, Any]  # of the changed keys
    measures: Mapping[str, tuple[float, float, str]]  # mean, error, unit


def sweep_figure(points: Sequence[Point], path: Path, measured: Sequence[Points] = ()) -> bool:
    """Draw the means against the first key with numbers, one curve for each combination of the other keys.

    Where all keys have words, each word of the first key has its place, and its points are not joined.

    measured  curves against the inlet velocity, for a sweep of it
    returns   whether there was anything to draw
    """
    names = [name for name in SHOWN if points and all(name in point.measures for point in points)]
    if not names:
        return False
    keys = list(points[0].values)
    first = next((key for key in keys if _is_numeric(points, key)), keys[0])
    numeric, others = _is_numeric(points, first), [key for key in keys if key != first]
    groups: dict[str, list[Point]] = {}
    for point in points:
        group = ", ".join(f"{key.split('.')[-1]} = {point.values[key]}" for key in others)
        groups.setdefault(group, []).append(point)
    ticks = {value: k for k, value in enumerate(dict.fromkeys(str(point.values[first]) for point in points))}
    figure, panels = blank(1, len(names), width=4.2 * len(names), height=4.0)
    for name, panel in zip(names, panels):
        for (group, members), colour in zip(groups.items(), shades(len(groups))):
            x = [point.values[first] if numeric else ticks[str(point.values[first])] for point in members]
            mean, error = zip(*(point.measures[name][:2] for point in members))
            bars = [0.0 if math.isnan(number) else number for number in error]
            style = "o-" if numeric else "o"
            panel.errorbar(x, mean, yerr=bars, fmt=style, color=colour, capsize=2.0, label=group or None)
            if name == "bed_voidage" and numeric and not others:
                _draw_laws(panel, x, members)
        if first == VELOCITY:
            _draw_measured(panel, [data for data in measured if data.quantity == name])
        unit = shown_unit(points[0].measures[name][2])
        label(panel, first, unit_of(first), name.replace("_", " "), unit)
        if not numeric:
            panel.set_xticks(range(len(ticks)), list(ticks))
            panel.set_xlabel(first)
            panel.margins(x=0.2)
    if others and len(groups) <= MOST_LABELLED:
        legend_below(figure, panels[0])
    save(figure, path)
    return True


def _is_numeric(points: Sequence[Point], key: str) -> bool:
    """Whether all values of a key are numbers."""
    return all(isinstance(point.values[key], int | float) for point in points)


def _draw_measured(panel: Any, measured: Sequence[Points]) -> None:
    """Draw measured points with their errors."""
    for data in measured:
        bars = np.where(np.isfinite(data.error), data.error, 0.0)
        style = {"color": ORANGE, "markersize": 5.0, "capsize": 2.5, "zorder": 3}
        panel.errorbar(data.place, data.value, yerr=bars, fmt="s", label=f"measured: {data.name}", **style)
    if measured:
        legend(panel)


LAW_STYLES: tuple[Any, ...] = ("--", ":", "-.", (0, (1, 3)), (0, (8, 2)), (0, (8, 2, 1, 2)))
"""Dashes of the curves of published laws."""

LAW_COLOUR = "0.4"
"""Of the curves of published laws, and of their range."""


def _draw_laws(panel: Any, x: Sequence[Any], points: Sequence[Point]) -> None:
    """Draw the voidages by published laws that all points have, and their range as a band."""
    named = [name for name in points[0].measures if name.startswith("voidage by ")]
    laws = [name for name in named if all(name in point.measures for point in points)]
    if not laws:
        return
    order = np.argsort(x)
    place, curves = np.array(x)[order], np.array([[point.measures[name][0] for point in points] for name in laws])
    curves = curves[:, order]
    if len(laws) > 1:
        band = {"color": LAW_COLOUR, "alpha": 0.15, "linewidth": 0.0}
        panel.fill_between(place, curves.min(axis=0), curves.max(axis=0), label="range of published laws", **band)
    for name, style, curve in zip(laws, LAW_STYLES, curves):
        panel.plot(place, curve, ls=style, color=LAW_COLOUR, linewidth=1.0, label=name[11:])
    legend(panel)


def sample_figure(points: Sequence[Point], path: Path) -> bool:
    """Draw the means of runs with sampled values: a row for each measure, a column for each key.

    returns  whether there was anything to draw
    """
    names = [name for name in SHOWN if points and all(name in point.measures for point in points)]
    if not names:
        return False
    keys = list(points[0].values)
    figure, panels = blank(
        len(names), len(keys), width=0.6 + 3.4 * len(keys), height=0.6 + 2.8 * len(names), sharex="col", sharey="row"
    )
    for place, panel in enumerate(panels):
        name, key = names[place // len(keys)], keys[place % len(keys)]
        mean, error = zip(*(point.measures[name][:2] for point in points))
        bars = [0.0 if math.isnan(number) else number for number in error]
        panel.errorbar([point.values[key] for point in points], mean, yerr=bars, fmt="o", color=BLUE, capsize=2.0)
        label(panel, key, unit_of(key), name.replace("_", " "), shown_unit(points[0].measures[name][2]))
        panel.label_outer()
    save(figure, path)
    return True


BARS = {
    "sobol": (("first", BLUE, "alone"), ("total", SKY, "with interactions")),
    "morris": (("effect", BLUE, "effect over the whole range"),),
}
"""Numbers of a sensitivity that are drawn, with colour and name."""


def sensitivity_figure(result: Any, path: Path) -> None:
    """Draw how much each key matters: a panel for each measure, bars with standard errors for each key.

    result  a `Sensitivity` of `cfddem.studies.sensitivity`
    """
    names, bars = result.shown(), BARS[result.kind]
    if not names:
        return
    short = [key if len(key) < 28 else f"...{key[-25:]}" for key in result.keys]
    place, thick = np.arange(len(short)), 0.8 / len(bars)
    high = 1.2 + 0.34 * len(bars) * len(short)
    figure, panels = blank(1, len(names), width=1.6 + 3.2 * len(names), height=high, sharey=True)
    for name, panel in zip(names, panels):
        unit, rows = result.measures[name]
        for number, (column, colour, words) in enumerate(bars):
            size, error = ([row[column_name] for row in rows] for column_name in (column, f"{column}_error"))
            panel.barh(place + number * thick, size, thick, xerr=error, color=colour, label=words, capsize=2.0)
        panel.set_yticks(place + 0.5 * thick * (len(bars) - 1), short)
        label(
            panel, name.replace("_", " "), shown_unit(unit) if result.kind == "morris" else "share of variance", "", ""
        )
        panel.set_ylabel("")
    panels[0].invert_yaxis()
    legend_below(figure, panels[0])
    save(figure, path)


def unit_of(key: str) -> str:
    """Unit of a key of a case, from its description."""
    unit = re.search(r"\[([^\]]*)\]$", field_of(Case, key.split(".")) or "")
    return unit[1] if unit else "-"


# ---------------------------------------------------------------- calibration


def calibration_figure(calibration: Any, path: Path) -> None:
    """Draw all trials of a calibration, its estimates, and the data.

    calibration  a `Calibration` of `cfddem.studies.calibration`
    """
    columns = len(calibration.variables) + len(calibration.data)
    rows = -(-columns // 3)
    figure, axes = blank(rows, min(columns, 3), width=3.7 * min(columns, 3), height=3.6 * rows)
    estimates = {estimate["key"]: estimate for estimate in calibration.estimates()}
    for variable, panel in zip(calibration.variables, axes):
        values = [trial.values[variable.key] for trial in calibration.finished]
        panel.plot(values, [trial.chi2 for trial in calibration.finished], "o", color=BLUE, markersize=4.5, alpha=0.8)
        if (estimate := estimates.get(variable.key)) is not None:
            low, high = estimate["value"] - estimate["error"], estimate["value"] + estimate["error"]
            panel.axvspan(low, high, color=ORANGE, alpha=0.25, linewidth=0)
            panel.axvline(estimate["value"], color=ORANGE)
        panel.set(
            yscale="log", xlim=(variable.low, variable.high), **({"xscale": "log"} if variable.logarithmic else {})
        )
        name = variable.key.split(".")[-1].replace("_", " ")
        label(panel, name, unit_of(variable.key), "mean square difference", "errors²")
    begin = 0
    for data, panel in zip(calibration.data, axes[len(calibration.variables) :]):
        end = begin + len(data.value)
        if data.against:
            _series(panel, calibration, data, slice(begin, end))
        else:
            _mean(panel, calibration, data, slice(begin, end))
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


def _series(panel: Axes, calibration: Any, data: Points, part: slice) -> None:
    """Points in time or height beside all trials."""
    for trial in calibration.finished:
        panel.plot(data.place, trial.computed[part], color=SKY, alpha=0.35, linewidth=0.8, marker=".", markersize=3)
    panel.plot([], [], color=SKY, label="all trials")
    panel.plot(data.place, calibration.best.computed[part], color=BLUE, marker=".", label="best trial")
    style: dict[str, Any] = {"fmt": "o", "color": ORANGE, "capsize": 2.5, "zorder": 3}
    panel.errorbar(data.place, data.value, yerr=data.error, label="measured", **style)
    axis = (data.against.replace("_", " "), (ABSCISSAE | OF_COLLISIONS)[data.against])
    if data.against == "stokes":
        panel.set_xscale("log")
    label(panel, *axis, data.quantity.replace("_", " "), shown_unit(data.unit))


def _mean(panel: Axes, calibration: Any, data: Points, part: slice) -> None:
    """Means of all trials against the key that the data identify best, and the measured ones as bands."""
    shares = [of_key["error"] / (of_key["high"] - of_key["low"]) for of_key in calibration.estimates()]
    key = calibration.variables[int(np.argmin(shares)) if shares else 0]
    values = [trial.values[key.key] for trial in calibration.finished]
    panel.plot(values, [trial.computed[part][0] for trial in calibration.finished], "o", color=BLUE, label="trials")
    for value, error in zip(data.value, data.error):
        panel.axhspan(value - error, value + error, color=ORANGE, alpha=0.25, linewidth=0)
        panel.axhline(value, color=ORANGE, label="measured" if value == data.value[0] else None)
    label(panel, key.key.split(".")[-1].replace("_", " "), unit_of(key.key), data.quantity.replace("_", " "),
          shown_unit(data.unit))  # fmt: skip


# ---------------------------------------------------------------- waves of a bed


COUNT = 200
"""Wavelengths of a curve."""

BED = (0.1, 0.8)
"""Part of the bed height in which waves are sought."""


def growth_curves(bed_waves: BedWaves, output: Path) -> None:
    """Draw growth and speed of waves against wavelength.

    output  PNG
    """
    lengths = bed_waves.wavelengths(COUNT)
    figure, (left, right) = panels(2, width=9.6, height=3.9)
    several = bed_waves.agitated is not bed_waves.bed
    plain = [bed_waves.bed.wave(length) for length in lengths]
    in_mm = 1e3 * np.array(lengths)
    left.plot(in_mm, [wave.growth for wave in plain], color=GREY, linestyle="--", label="theory")
    of_cells = [bed_waves.on_cells(bed_waves.bed, length).growth for length in lengths]
    left.plot(in_mm, of_cells, color=BLUE, label="on the cells")
    right.plot(in_mm, [wave.speed for wave in plain], color=BLUE, label="without agitation")
    if several:
        agitated = [bed_waves.on_cells(bed_waves.agitated, length) for length in lengths]
        left.plot(in_mm, [wave.growth for wave in agitated], color=ORANGE, label="on the cells, agitated")
        right.plot(in_mm, [wave.speed for wave in agitated], color=ORANGE, label="agitated")
        legend(right)
    left.axhline(0.0, color=GREY, linewidth=0.8)
    lowest = min(bed_waves.on_cells(bed_waves.agitated, length).growth for length in lengths[COUNT // 4 :])
    left.set_ylim(bottom=max(lowest, -3.0 * max(wave.growth for wave in plain) - 1.0))
    legend(left)
    label(left, "wavelength", "mm", "growth rate", "1/s")
    label(right, "wavelength", "mm", "upward speed", "m/s")
    for axes in (left, right):
        axes.set_xlim(in_mm[0], in_mm[-1])
    save(figure, output)


def wave_map(folder: str | Path, output: str | Path | None = None) -> Path:
    """Draw the solid fraction of a run over time and height, with the speed of its waves.

    folder  of a run
    output  PNG; NAME-waves.png in the current folder if not given
    """
    run = open_run(folder)
    case = case_of(run)
    layers = layer_map(run, case)
    begin, end = window_of(run, case)
    last = run.particles(-1)
    height = bed_height(last["position"], last["radius"])
    name = run.folder.resolve().name
    figure, axes = panels(1, width=8.0, height=4.2)
    draw_map(axes, layers, waves(layers, BED[0] * height, BED[1] * height, begin), (begin, end), name)
    output = Path(f"{name}-waves.png" if output is None else output)
    save(figure, output)
    return output


def draw_map(axes: Axes, layers: LayerMap, wave: Waves, window: tuple[float, float], title: str = "") -> None:
    """Solid fraction over time and height; a line shows the speed of the waves."""
    top = 1e3 * float(layers.height[layers.solid_fraction.max(axis=0) > 0.02].max(initial=1.5 * layers.height[0]))
    shades = axes.pcolormesh(
        layers.time, 1e3 * layers.height, layers.solid_fraction.T, cmap="Blues", vmin=0.0,
        vmax=float(layers.solid_fraction.max()), shading="nearest", rasterized=True,
    )  # fmt: skip
    axes.figure.colorbar(shades, ax=axes, label="solid fraction  [-]")
    axes.set(xlim=(layers.time[0], layers.time[-1]), ylim=(1e3 * layers.height[0], top))
    if np.isfinite(wave.speed) and wave.speed > 0.0:
        begin, passage = window[0], 0.7e-3 * top / wave.speed
        axes.plot([begin, begin + passage], [0.1 * top, 0.8 * top], color=ORANGE, linewidth=2.0)
        axes.text(
            0.01, 1.02, f"waves of {1e3 * wave.wavelength:.0f} mm, up at {wave.speed:.3f} m/s; "
            f"layers deviate by {wave.deviation:.3f}", transform=axes.transAxes, fontsize=9.5,
        )  # fmt: skip
    label(axes, "time", "s", "height", "mm")
    axes.set_title(title, loc="right", fontsize=11, fontweight="bold")
    axes.grid(False)


def draw_impacts(axes: Axes, impacts: Impacts, granular_temperature: float | None = None) -> None:
    """Distribution of the speeds of impact, and that of a Maxwellian gas with the granular temperature."""
    axes.stairs(impacts.density, impacts.edges, color=BLUE, fill=True, alpha=0.4, label="run")
    if granular_temperature:
        speed = np.linspace(0.0, impacts.edges[-1], 200)
        axes.plot(speed, maxwellian_impact_speed(speed, granular_temperature), color=GREEN, label="Maxwellian")
    legend(axes)
    label(axes, "normal speed of approach", "m/s", "probability density", "s/m")
