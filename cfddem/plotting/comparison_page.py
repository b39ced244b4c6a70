"""The comparison of several runs as one self-contained HTML page: what differs, means, and curves over each other."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.analysis.comparison import compare, mean_of, relative
from cfddem.analysis.profiles import profiles_of
from cfddem.analysis.report import case_of
from cfddem.analysis.report_text import spelled, with_error
from cfddem.analysis.report_values import KeyResult
from cfddem.backend.errors import RunFailed
from cfddem.backend.html import page_template
from cfddem.io.files import write_whole
from cfddem.io.quantities import shown_unit
from cfddem.io.reading import RunData, open_run
from cfddem.plotting.curves import blank, encoded, label, legend_below, line_styles, plain_ticks, save

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
