"""The report of a run as one self-contained HTML page: key results, warnings by what to do, figures, details.

And the comparison of several runs as such a page: what differs, means, and curves over each other.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.bed_laws import weight_over_floor
from cfddem.analysis.comparison import compare, mean_of, relative
from cfddem.analysis.fluctuations import impacts
from cfddem.analysis.layers import FEWEST_TIMES, Profiles, layer_map, profiles_of, waves
from cfddem.analysis.measured import MeasuredComparison, compared_with_measured, with_files
from cfddem.analysis.report import case_of, recorded_regimes
from cfddem.analysis.report import report as summary
from cfddem.analysis.report_text import (
    Report,
    bounds_note,
    energy_cells,
    film_solution,
    law_cells,
    ledger_cells,
    markdown,
    spelled,
    steadiness,
    window,
    with_error,
)
from cfddem.analysis.report_values import KeyResult
from cfddem.analysis.run_warnings import NOTE
from cfddem.backend.errors import CfddemError, RunFailed
from cfddem.backend.html import page_template
from cfddem.case.compare import ABSCISSAE
from cfddem.case.schema import Case
from cfddem.io.files import write_whole
from cfddem.io.quantities import shown_unit
from cfddem.io.reading import RunData, open_run
from cfddem.plotting import colours, rendering
from cfddem.plotting.case_drawing import case_drawing
from cfddem.plotting.curves import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    SKY,
    blank,
    draw_coating,
    draw_regimes,
    encoded,
    label,
    legend,
    legend_below,
    line_styles,
    panels,
    plain_ticks,
    save,
)
from cfddem.plotting.pictures import Stage
from cfddem.plotting.study_figures import BED, draw_impacts, draw_map
from cfddem.preflight.bed_waves import is_liquid_bed

Rows = list[tuple[str, ...]]


def page(folder: Path, output: Path | None = None, result: Report | None = None, data: Sequence[Path] = ()) -> Path:
    """Write the report of a run as a page.

    folder   of the run
    output   HTML; NAME-report.html in the current folder if not given
    result   of :func:`cfddem.analysis.report.report`, if it has been made already
    data     files of measured points beside those of the case
    returns  the file
    """
    folder = Path(folder)
    run, result = open_run(folder), summary(folder, data) if result is None else result
    output = Path(f"{folder.resolve().name}-report.html" if output is None else output)
    write_whole(output, render(run, result, data).encode())
    return output


def markdown_page(folder: Path, output: Path, result: Report | None = None, data: Sequence[Path] = ()) -> Path:
    """Write the report of a run as Markdown, with its figures as PNG files beside it.

    output  Markdown; figures are named after it
    others  as :func:`page`
    returns  the file
    """
    run, result = open_run(folder), summary(folder, data) if result is None else result
    places = {}
    for name, (drawn, caption) in figures_of(run, with_files(case_of(run), data), result).items():
        place = output.with_name(f"{output.stem}-{name}.png")
        save(drawn, place, dots_per_inch=110)
        places[caption] = place.name
    write_whole(output, markdown(result, places).encode())
    return output


def render(run: RunData, result: Report, data: Sequence[Path] = ()) -> str:
    """The page as text."""
    case, end, steps = with_files(case_of(run), data), result.window[1], result.steps
    counts = f"{steps['particles']} particle steps, {steps['fluid']} fluid steps"
    figures = figures_of(run, case, result).items()
    text: str = page_template("report.html").render(
        result=result,
        status=f"{result.status} at {end:g} s; {counts}; {window(result)}",
        bounds_note=bounds_note(result),
        film_solution=film_solution(result.film_solution),
        note=NOTE,
        laws=[(*cells, row.outside_range) for cells, row in zip(law_cells(result), result.laws)],
        ledger=ledger_cells(result),
        energy=energy_cells(result),
        preflight=_preflight(result.preflight),
        wall_time=_wall_time(result.wall_time),
        provenance=_provenance(result.provenance),
        case_text=run.case_text,
        figures={name: (encoded(figure), caption) for name, (figure, caption) in figures},
        **{function.__name__: function for function in (with_error, spelled, shown_unit, steadiness)},
    )
    return text


# ---------------------------------------------------------------- tables


def _preflight(preflight: dict[str, Any]) -> Rows:
    return [
        (group, name, "-" if number["value"] is None else f"{number['value']:.4g}", number["unit"], number["note"])
        for group, numbers in preflight["numbers"].items()
        for name, number in numbers.items()
    ]


def _wall_time(seconds: dict[str, float]) -> Rows:
    total = sum(seconds.values())
    parts = sorted(seconds.items(), key=lambda part_and_seconds: -part_and_seconds[1])
    shares: Rows = [
        (name, f"{part_seconds:.3g}", f"{100.0 * part_seconds / total:.1f} %") for name, part_seconds in parts if total
    ]
    return [*shares, ("all", f"{total:.3g}", "")]


def _provenance(values: dict[str, Any]) -> Rows:
    tables = {name: content if isinstance(content, dict) else {"": content} for name, content in values.items()}
    return [
        (f"{name}: {key}".removesuffix(": "), _words(value))
        for name, table in tables.items()
        for key, value in table.items()
    ]


def _words(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {item_value}" for name, item_value in value.items() if item_value)
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


# ---------------------------------------------------------------- figures


Figures = dict[str, tuple[Any, str]]
"""Name of a figure, the figure, and its caption."""


def figures_of(run: RunData, case: Case, result: Report) -> Figures:
    """All figures that a run has, in reading order.

    result  of :func:`cfddem.analysis.report.report`
    """
    return {name: (figure, caption) for name, figure, caption in _all(run, case, result)}


def _all(run: RunData, case: Case, result: Report) -> Iterator[tuple[str, Any, str]]:
    begin, end = result.window
    means = {name: measure.mean for name, measure in result.measures.items()}
    height = means.get("bed_height")
    if compared := compared_with_measured(run, case, begin):
        yield "measured", measured_figure(compared), "Measured points with their standard errors, and the run."
    for name, colour, about in _pictures(run):
        if (picture := _picture(run, colour)) is not None:
            yield name, picture, f"The last snapshot, at {run.times[-1]:.4g} s{about}."
    yield "series", _series(run, case, begin, end), "Grey: averaging window. Orange: means."
    if (profiles := _profiles(run, case, begin)) is not None:
        caption = (
            f"Means over {profiles.snapshots} snapshots; shaded: standard deviation of the voidage in time; dashed: "
        )
        yield "profiles", _draw_profiles(profiles, height), f"{caption}bed height."
    if (
        height is not None
        and is_liquid_bed(case)
        and len(run.times) >= FEWEST_TIMES
        and "radius" in run.particle_fields
    ):
        figure, axes = panels(1, width=8.0, height=3.8)
        found_map = layer_map(run, case)
        draw_map(axes, found_map, waves(found_map, BED[0] * height, BED[1] * height, begin), (begin, end))
        caption = (
            "Solid fraction of layers of 2.5 diameters in all snapshots. The line shows the speed of the waves; it "
        )
        yield "waves", figure, f"{caption}needs several snapshots per period."
    if result.impacts.get("rate", 0.0) > 0.0:
        figure, axes = panels(1, width=6.4, height=3.8)
        temperature = means.get("granular_temperature")
        draw_impacts(axes, impacts(run.collisions, begin, end, int(run.history["particle_count"][-1])), temperature)
        caption = "Normal speed of approach of collisions between particles in the averaging window, and a Maxwellian "
        yield "impacts", figure, f"{caption}gas of the same granular temperature."
    if "liquid_carried" in run.particle_fields and (carried := run.particles(-1)["liquid_carried"]).any():
        figure, axes = panels(1, width=6.4, height=3.8)
        draw_coating(axes, carried)
        caption = f"Liquid on each particle, with its part of the liquid of its bridges, at {run.times[-1]:.4g} s."
        yield "coating", figure, caption
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


def _pictures(run: RunData) -> Iterator[tuple[str, str, str]]:
    """Name, colour of the spheres, and end of the caption of every picture of a run."""
    yield "bed", colours.usual(run), ""
    if colours.TEMPERATURE in run.particle_fields:
        yield "temperature", colours.TEMPERATURE, ", by temperature"
        if "vapour" in run.fluid_fields and colours.MOISTURE in colours.choices(run):
            yield "moisture", colours.MOISTURE, ", by moisture"


def _picture(run: RunData, colour: str) -> Any:
    """Spheres and cells of the last snapshot; None if there is nothing to draw, or this machine cannot render."""
    if not len(run.times) or rendering.why_not() is not None:
        return None
    try:
        return Stage.of(run, [-1], (), colour, None).figure(-1)
    except CfddemError:
        return None


def _series(run: RunData, case: Case, begin: float, end: float) -> Any:
    """Bed height, pressure drop over the buoyant weight, granular temperature, and temperatures in time, with their
    means."""
    history, weight = run.history, weight_over_floor(case)
    curves = [("bed height\n[m]", history["bed_height"])]
    if "pressure_drop" in history:
        named = "pressure drop\n[Pa]" if weight is None else "pressure drop\nover weight  [-]"
        curves.append((named, history["pressure_drop"] / (weight or 1.0)))
    if "granular_temperature" in history:
        curves.append(("granular\ntemperature  [m2/s2]", history["granular_temperature"]))
    for column, named in (
        ("mean_temperature", "temperature of\nparticles  [K]"),
        ("outlet_temperature", "temperature at\nthe outlet  [K]"),
        ("outlet_vapour", "vapour at\nthe outlet  [-]"),
    ):  # fmt: skip
        if column in history:
            curves.append((named, history[column]))
    inside = history["time"] >= begin
    curves = [curve for curve in curves if np.isfinite(curve[1][inside]).any()]
    figure, axes = blank(len(curves), 1, width=8.0, height=0.6 + 1.8 * len(curves), sharex=True)
    for panel, (name, values) in zip(axes, curves):
        panel.axvspan(begin, end, color="#f3f3f3", zorder=0)
        panel.plot(history["time"], values, color=BLUE)
        panel.hlines(np.nanmean(values[inside]), begin, end, color=ORANGE, linewidth=1.2)
        panel.set_ylabel(name)
    axes[-1].set_xlabel("time  [s]")
    figure.align_ylabels()
    return figure


def _profiles(run: RunData, case: Case, begin: float) -> Profiles | None:
    """The profiles of a run; None if no snapshot in the window can be read, or none has a quantity to show."""
    try:
        profiles = profiles_of(run, case, begin)
    except RunFailed:
        return None
    return None if profiles is None or (profiles.voidage is None and profiles.upward is None) else profiles


def _draw_profiles(profiles: Profiles, bed_height: float | None) -> Any:
    """Voidage, solids flux and granular temperature against height, as far as they are recorded."""
    columns = (profiles.voidage is not None) + 2 * (profiles.upward is not None)
    figure, axes = blank(1, columns, width=2.8 * columns + 0.4, height=3.8, sharey=True)
    remaining = list(axes)
    if profiles.voidage is not None and profiles.voidage_spread is not None:
        panel = remaining.pop(0)
        low, high = profiles.voidage - profiles.voidage_spread, profiles.voidage + profiles.voidage_spread
        panel.fill_betweenx(profiles.height, low, high, color=SKY, alpha=0.4, linewidth=0)
        panel.plot(profiles.voidage, profiles.height, color=BLUE)
        label(panel, "voidage", "-", "", "")
    if profiles.upward is not None and profiles.downward is not None and profiles.temperature is not None:
        flux, temperature = remaining
        flux.plot(profiles.upward, profiles.height, color=GREEN, label="up")
        flux.plot(profiles.downward, profiles.height, color=ORANGE, label="down")
        flux.legend(frameon=False, fontsize=9.5)
        label(flux, "solids flux", "m/s", "", "")
        temperature.plot(profiles.temperature, profiles.height, color=BLUE)
        label(temperature, "granular temperature", "m2/s2", "", "")
    for panel in axes:
        panel.set_ylabel("")
        panel.set_ylim(0.0, float(profiles.height[-1] + profiles.height[0]))
        panel.locator_params(axis="x", nbins=4)
        panel.xaxis.set_major_formatter(lambda value, _: f"{value:.3g}")
        if bed_height is not None:
            panel.axhline(bed_height, color=GREY, linewidth=1.0, linestyle="--")
    axes[0].set_ylabel("height  [m]")
    return figure


# ---------------------------------------------------------------- measured points


def measured_figure(comparisons: Sequence[MeasuredComparison]) -> Any:
    """One panel for each set of measured data: the run as a line, the points with error bars."""
    figure, axes = blank(len(comparisons), 1, width=8.0, height=0.5 + 3.0 * len(comparisons))
    for comparison, panel in zip(comparisons, axes):
        points, bars = comparison.points, np.where(np.isfinite(comparison.points.error), comparison.points.error, 0.0)
        name = points.quantity.replace("_", " ")
        style: dict[str, Any] = {"fmt": "o", "color": ORANGE, "markersize": 5.0, "capsize": 2.5, "zorder": 3}
        if points.against == "height":
            panel.plot(comparison.line[1], comparison.line[0], color=BLUE, label="run")
            panel.errorbar(points.value, points.place, xerr=bars, label="measured", **style)
            label(panel, name, shown_unit(points.unit), "height", "m", points.name)
        elif points.against:
            marker = "o-" if points.against == "inlet_velocity" else "-"
            panel.plot(*comparison.line, marker, color=BLUE, label="run")
            panel.errorbar(points.place, points.value, yerr=bars, label="measured", **style)
            axis = (points.against.replace("_", " "), ABSCISSAE[points.against])
            label(panel, *axis, name, shown_unit(points.unit), points.name)
        else:
            place, mean = np.arange(len(points.value)) + 1.0, float(comparison.computed[0])
            error = float(np.max(comparison.computed_error))
            panel.axhspan(mean - error, mean + error, color=BLUE, alpha=0.2, linewidth=0)
            panel.axhline(mean, color=BLUE, label="run")
            panel.errorbar(place, points.value, yerr=bars, label="measured", **style)
            label(panel, "measurement", "-", name, shown_unit(points.unit), points.name)
            panel.set_xticks(place if len(place) <= 20 else [])
            panel.set_xlim(0.5, len(place) + 0.5)
        legend(panel)
    return figure


# ---------------------------------------------------------------- the page of a comparison


SHOWN = ("bed_height", "bed_voidage", "pressure_drop", "granular_temperature", "largest_speed")
"""Columns of the history that are drawn, as far as all runs have them."""


def comparison_page(folders: Sequence[Path], output: Path, result: dict[str, Any] | None = None) -> Path:
    """Write the comparison of runs as a page, or its figure of the histories if the file ends in .png.

    folders  of the runs; the first is the reference
    output   HTML or PNG
    result   of :func:`cfddem.analysis.comparison.compare`, if it has been made already
    returns  the file
    """
    runs = [open_run(folder) for folder in folders]
    result = compare(folders) if result is None else result
    names = [run["name"] for run in result["runs"]]
    if output.suffix.lower() == ".png":
        save(histories(runs, names), output)
        return output
    figures = {"Histories": encoded(histories(runs, names))}
    if (drawn := profiles(runs, names, result)) is not None:
        figures["Profiles over the averaging window"] = encoded(drawn)
    text = page_template("comparison.html").render(
        result=result, names=names, key_results=_key_results(result), measures=_measures(result), figures=figures
    )
    write_whole(output, text.encode())
    return output


def histories(runs: Sequence[RunData], names: Sequence[str]) -> Any:
    """Columns of the history of all runs against time, one panel each."""
    columns = [name for name in SHOWN if all(np.isfinite(run.history.get(name, np.nan)).any() for run in runs)]
    columns = columns or ["particle_count"]
    figure, axes = blank(len(columns), 1, width=8.0, height=0.9 + 1.9 * len(columns), sharex=True)
    for name, panel in zip(columns, axes):
        for run, title, style in zip(runs, names, line_styles(len(runs))):
            panel.plot(run.history["time"], run.history[name], label=title, **style)
        panel.set_ylabel(f"{textwrap.fill(spelled(name), 14)}\n[{shown_unit(runs[0].unit(name))}]")
        plain_ticks(panel.yaxis)
    axes[-1].set_xlabel("time  [s]")
    legend_below(figure, axes[0])
    figure.align_ylabels()
    return figure


def profiles(runs: Sequence[RunData], names: Sequence[str], result: dict[str, Any]) -> Any:
    """Voidage and granular temperature of all runs against height; None if a run has no profiles."""
    of_runs = []
    for run, described in zip(runs, result["runs"]):
        try:
            of_runs.append(profiles_of(run, case_of(run), described["window"][0]))
        except RunFailed:
            return None
    kinds = [
        kind
        for kind in ("voidage", "temperature")
        if all(getattr(profile, kind, None) is not None for profile in of_runs)
    ]
    if not kinds:
        return None
    titles = {"voidage": ("voidage", "-"), "temperature": ("granular temperature", "m2/s2")}
    figure, axes = blank(1, len(kinds), width=4.0 * len(kinds) + 0.4, height=4.2, sharey=True)
    for kind, panel in zip(kinds, axes):
        for profile, title, style in zip(of_runs, names, line_styles(len(runs))):
            assert profile is not None
            panel.plot(getattr(profile, kind), profile.height, label=title, **style)
        label(panel, *titles[kind], "", "")
        panel.set_ylabel("")
        panel.locator_params(axis="x", nbins=5)
        plain_ticks(panel.xaxis)
    axes[0].set_ylabel("height  [m]")
    legend_below(figure, axes[0])
    return figure


def _key_results(result: dict[str, Any]) -> list[tuple[str, list[str]]]:
    def words(key_result: KeyResult | None) -> str:
        return "-" if key_result is None else with_error(key_result)

    return [(name, [words(key_result) for key_result in row]) for name, row in result["key_results"].items()]


def _measures(result: dict[str, Any]) -> list[tuple[str, str, list[tuple[str, str, str]]]]:
    """Name, unit, and mean, difference and verdict of each run."""
    rows = []
    for name, measure in result["measures"].items():
        cells = []
        for place, row in enumerate(measure["runs"]):
            value = "-" if row["mean"] is None else mean_of(row, "")
            apart = "" if place == 0 or row["mean"] is None else relative(row)
            cells.append((value, apart, "" if place == 0 else row["verdict"]))
        rows.append((spelled(name), shown_unit(measure["unit"]), cells))
    return rows
