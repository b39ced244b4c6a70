"""The figures of a report: the bed, the case, series, profiles, waves, collisions; each with its caption."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cfddem.analysis.bed_laws import weight_over_floor
from cfddem.analysis.fluctuations import impacts
from cfddem.analysis.measured import compared_with_measured
from cfddem.analysis.profiles import Profiles, profiles_of
from cfddem.analysis.report import recorded_regimes
from cfddem.analysis.waves import FEWEST_TIMES, layer_map, waves
from cfddem.backend.errors import CfddemError, RunFailed
from cfddem.case.schema import Case
from cfddem.io.reading import Run
from cfddem.plotting import rendering
from cfddem.plotting.case_drawing import case_drawing
from cfddem.plotting.curves import BLUE, GREEN, GREY, ORANGE, SKY, blank, draw_regimes, label, panels
from cfddem.plotting.measured_figure import measured_figure
from cfddem.plotting.panels import Stage
from cfddem.plotting.wave_figures import BED, draw_impacts, draw_map
from cfddem.preflight.bed_waves import is_liquid_bed

Figures = dict[str, tuple[Any, str]]
"""Name of a figure, the figure, and its caption."""


def figures_of(run: Run, case: Case, result: dict[str, Any]) -> Figures:
    """All figures that a run has, in reading order.

    result  of :func:`cfddem.analysis.report.report`
    """
    return {name: (figure, caption) for name, figure, caption in _all(run, case, result)}


def _all(run: Run, case: Case, result: dict[str, Any]) -> Iterator[tuple[str, Any, str]]:
    begin, end = result["window"]
    height = result["measures"].get("bed_height", {}).get("mean")
    if compared := compared_with_measured(run, case, begin):
        yield "measured", measured_figure(compared), "Measured points with their standard errors, and the run."
    if (picture := _picture(run)) is not None:
        yield "bed", picture, f"The last snapshot, at {run.times[-1]:.4g} s."
    yield "series", _series(run, case, begin, end), "Grey: averaging window. Orange: means."
    if (found := _profiles(run, case, begin)) is not None:
        caption = f"Means over {found.snapshots} snapshots; shaded: standard deviation of the voidage in time; dashed: "
        yield "profiles", _draw_profiles(found, height), f"{caption}bed height."
    if is_liquid_bed(case) and len(run.times) >= FEWEST_TIMES and "radius" in run.particle_fields:
        figure, axes = panels(1, width=8.0, height=3.8)
        found_map = layer_map(run, case)
        draw_map(axes, found_map, waves(found_map, BED[0] * height, BED[1] * height, begin), (begin, end))
        caption = (
            "Solid fraction of layers of 2.5 diameters in all snapshots. The line shows the speed of the waves; it "
        )
        yield "waves", figure, f"{caption}needs several snapshots per period."
    if result["impacts"].get("rate", 0.0) > 0.0:
        figure, axes = panels(1, width=6.4, height=3.8)
        temperature = result["measures"].get("granular_temperature", {}).get("mean")
        draw_impacts(axes, impacts(run.collisions, begin, end, int(run.history["particle_count"][-1])), temperature)
        caption = "Normal speed of approach of collisions between particles in the averaging window, and a Maxwellian "
        yield "impacts", figure, f"{caption}gas of the same granular temperature."
    if (regimes := recorded_regimes(run, begin)) is not None:
        figure, axes = panels(1, width=6.4, height=4.6)
        draw_regimes(axes, regimes)
        caption = (
            f"{regimes.collisions:.0f} collisions in the averaging window. Above the dashed line the film pressure "
            "keeps the solids apart, below it the asperities. To the right of the orange line most collisions end in "
            "contact."
        )
        yield "collisions", figure, caption
    yield "case", case_drawing(case, height), "The case before it runs, seen along y; dashed: bed height of the run."


def _picture(run: Run) -> Any:
    """Spheres and voidage of the last snapshot; None if there is nothing to draw, or this machine cannot render."""
    if not len(run.times) or rendering.why_not() is not None:
        return None
    try:
        return Stage.of(run, [-1], (), "speed", None).figure(-1)
    except CfddemError:
        return None


def _series(run: Run, case: Case, begin: float, end: float) -> Any:
    """Bed height, pressure drop over the buoyant weight, and granular temperature in time, with their means."""
    history, weight = run.history, weight_over_floor(case)
    curves = [("bed height\n[m]", history["bed_height"])]
    if "pressure_drop" in history:
        named = "pressure drop\n[Pa]" if weight is None else "pressure drop\nover weight  [-]"
        curves.append((named, history["pressure_drop"] / (weight or 1.0)))
    if "granular_temperature" in history:
        curves.append(("granular\ntemperature  [m2/s2]", history["granular_temperature"]))
    inside = history["time"] >= begin
    curves = [each for each in curves if np.isfinite(each[1][inside]).any()]
    figure, axes = blank(len(curves), 1, width=8.0, height=0.6 + 1.8 * len(curves), sharex=True)
    for each, (name, values) in zip(axes, curves):
        each.axvspan(begin, end, color="#f3f3f3", zorder=0)
        each.plot(history["time"], values, color=BLUE)
        each.hlines(np.nanmean(values[inside]), begin, end, color=ORANGE, linewidth=1.2)
        each.set_ylabel(name)
    axes[-1].set_xlabel("time  [s]")
    figure.align_ylabels()
    return figure


def _profiles(run: Run, case: Case, begin: float) -> Profiles | None:
    """The profiles of a run; None if no snapshot in the window can be read, or none has a quantity to show."""
    try:
        found = profiles_of(run, case, begin)
    except RunFailed:
        return None
    return None if found is None or (found.voidage is None and found.upward is None) else found


def _draw_profiles(found: Profiles, bed_height: float | None) -> Any:
    """Voidage, solids flux and granular temperature against height, as far as they are recorded."""
    columns = (found.voidage is not None) + 2 * (found.upward is not None)
    figure, axes = blank(1, columns, width=2.8 * columns + 0.4, height=3.8, sharey=True)
    remaining = list(axes)
    if found.voidage is not None and found.voidage_spread is not None:
        panel = remaining.pop(0)
        low, high = found.voidage - found.voidage_spread, found.voidage + found.voidage_spread
        panel.fill_betweenx(found.height, low, high, color=SKY, alpha=0.4, linewidth=0)
        panel.plot(found.voidage, found.height, color=BLUE)
        label(panel, "voidage", "-", "", "")
    if found.upward is not None and found.downward is not None and found.temperature is not None:
        flux, temperature = remaining
        flux.plot(found.upward, found.height, color=GREEN, label="up")
        flux.plot(found.downward, found.height, color=ORANGE, label="down")
        flux.legend(frameon=False, fontsize=9.5)
        label(flux, "solids flux", "m/s", "", "")
        temperature.plot(found.temperature, found.height, color=BLUE)
        label(temperature, "granular temperature", "m2/s2", "", "")
    for panel in axes:
        panel.set_ylabel("")
        panel.set_ylim(0.0, float(found.height[-1] + found.height[0]))
        panel.locator_params(axis="x", nbins=4)
        panel.xaxis.set_major_formatter(lambda value, _: f"{value:.3g}")
        if bed_height is not None:
            panel.axhline(bed_height, color=GREY, linewidth=1.0, linestyle="--")
    axes[0].set_ylabel("height  [m]")
    return figure
