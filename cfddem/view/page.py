"""The report of a run as one HTML page that needs nothing else: tables, figures in time, profile, case, versions."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from cfddem.assembly import grid_of
from cfddem.case import Case
from cfddem.errors import RunFailed
from cfddem.record.files import write_whole
from cfddem.record.measures import voidage_profile
from cfddem.record.reading import Run, open_run
from cfddem.report import buoyant_weight, case_of, energy_lines, recorded_regimes, steadiness
from cfddem.report import report as summary
from cfddem.view.plots import BLUE, GREY, ORANGE, SKY, blank, draw_regimes, label, panels

MOST_PROFILES = 40
"""Snapshots of the window that the profile of the voidage is averaged over, at most."""

_PAGE = Template("""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin-bottom: 0; } h2 { font-size: 1.1rem; margin: 2rem 0 .5rem; }
table { border-collapse: collapse; width: 100%; } caption { text-align: left; color: #666; padding: .3rem 0; }
th, td { text-align: left; padding: .25rem .8rem .25rem 0; border-bottom: 1px solid #e6e6e6; vertical-align: top; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
img { max-width: 100%; } pre { background: #f6f6f6; padding: .8rem; overflow-x: auto; font-size: 13px; }
.status { color: #666; margin-top: 0; } .warning { border-left: 4px solid #e07b00; padding-left: .8rem; }
.good { border-left: 4px solid #1b8a5a; padding-left: .8rem; } details { margin: .5rem 0; }
</style>
</head>
<body>
<h1>$title</h1>
<p class="status">$status</p>
<h2>Warnings</h2>
$warnings
<h2>Measures</h2>
$measures
$series
<h2>Laws</h2>
$laws
<h2>Profile</h2>
$profile
<h2>Ledger</h2>
$ledger
$energy
$encounters
<h2>Wall time</h2>
$wall
<h2>What the run was</h2>
$card
<details><summary>The case</summary><pre>$case</pre></details>
<details><summary>Versions and platform</summary>$provenance</details>
</body>
</html>
""")


def page(folder: Path, output: Path | None = None, result: dict[str, Any] | None = None) -> Path:
    """Write the report of a run as a page.

    folder   of the run
    output   HTML; NAME-report.html in this folder if not given
    result   of :func:`cfddem.report.report`, where it is at hand
    returns  the file
    """
    folder = Path(folder)
    run, result = open_run(folder), summary(folder) if result is None else result
    output = Path(f"{folder.resolve().name}-report.html" if output is None else output)
    write_whole(output, render(run, result).encode())
    return output


def render(run: Run, result: dict[str, Any]) -> str:
    """The page as text."""
    case = case_of(run)
    begin, end = result["window"]
    steps = result["steps"]
    counted = f"{steps['particles']} steps of the particles, {steps['fluid']} of the fluid"
    return _PAGE.substitute(
        title=escape(result["case"]),
        status=escape(f"{result['status']} at {end:g} s; {counted}; means from {begin:g} s on"),
        warnings=_warnings(result["warnings"]),
        measures=_measures(result["measures"]),
        series=_image(_series(run, case, result), "bed height and pressure drop in time"),
        laws=_laws(result["laws"]),
        profile=_profile(run, case, result),
        ledger=_table(("largest over the run", ""), _named(result["ledger"], 2)),
        energy=_energy(result["energy"]),
        encounters=_encounters(run, begin),
        wall=_wall(result["wall_time"]),
        card=_card(result["card"]),
        case=escape(run.case_text),
        provenance=_table(("", ""), _provenance(result["provenance"])),
    )


# ---------------------------------------------------------------- tables


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = (1,)) -> str:
    """Rows of texts, which are escaped here; columns of numbers stand to the right."""

    def line(cells: Sequence[str], tag: str) -> str:
        kinds = [' class="number"' if place in numbers else "" for place in range(len(cells))]
        return "<tr>" + "".join(f"<{tag}{kind}>{escape(each)}</{tag}>" for kind, each in zip(kinds, cells)) + "</tr>"

    top = line(head, "th") if any(head) else ""
    return f"<table>{top}{''.join(line(row, 'td') for row in rows)}</table>"


def _named(values: dict[str, float], digits: int) -> list[tuple[str, str]]:
    return [(name.replace("_", " "), f"{value:.{digits}g}") for name, value in values.items()]


def _energy(ledger: dict[str, float]) -> str:
    if not ledger:
        return ""
    rows = [
        (group, name.replace("_", " "), f"{value:.4g}", f"{100.0 * part:.3f}")
        for group, name, value, part in energy_lines(ledger)
    ]
    head = ("energy", f"of {ledger['put_in']:.4g} J put in", "J", "%")
    return f"<h2>Energy</h2>{_table(head, rows, (2, 3))}"


def _warnings(found: list[str]) -> str:
    if not found:
        return '<p class="good">none</p>'
    return "".join(f'<p class="warning">{escape(each)}</p>' for each in found)


def _measures(measures: dict[str, Any]) -> str:
    def row(each: dict[str, Any]) -> tuple[str, ...]:
        error = "-" if math.isnan(each["error"]) else f"{each['error']:.2g}"
        bound = ", at least" if each["error_is_lower_bound"] and error != "-" else ""
        unit = "-" if each["unit"] == "1" else each["unit"]
        return each["long_name"], f"{each['mean']:.4g}", error + bound, unit, steadiness(each)

    head = ("mean in the window", "value", "standard error", "unit", "in time")
    return _table(head, [row(each) for each in measures.values()], (1, 2))


def _laws(laws: list[dict[str, Any]]) -> str:
    if not laws:
        return "<p>No law of beds or of a sphere alone applies to this case.</p>"
    rows = [
        (each["law"], f"{each['computed']:.4g}", f"{each['expected']:.4g}", f"{each['ratio']:.3f}", each["unit"],
         each["outside_range"])
        for each in laws
    ]  # fmt: skip
    return _table(("", "run", "law", "ratio", "unit", ""), rows, (1, 2, 3))


def _wall(seconds: dict[str, float]) -> str:
    total = sum(seconds.values())
    if not total:
        return "<p>Nothing was measured.</p>"
    parts = sorted(seconds.items(), key=lambda each: -each[1])
    rows = [(name, f"{each:.3g}", f"{100.0 * each / total:.1f} %") for name, each in parts]
    note = "<p>First calls load or compile loops; in a long run they vanish.</p>"
    return _table(("part", "s", "share"), [*rows, ("all", f"{total:.3g}", "")], (1, 2)) + note


def _card(card: dict[str, Any]) -> str:
    found = [f"{each['colour']}: {each['key']}: {each['reason']}" if "key" in each else str(each)
             for each in card["findings"]]  # fmt: skip
    rows = [
        (group, name, "-" if each["value"] is None else f"{each['value']:.4g}", each["unit"], each["note"])
        for group, numbers in card["numbers"].items()
        for name, each in numbers.items()
    ]
    said = "".join(f'<p class="warning">{escape(each)}</p>' for each in found)
    return said + "<details><summary>The card</summary>" + _table(("", "", "", "unit", ""), rows, (2,)) + "</details>"


def _provenance(values: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    for name, each in values.items():
        if isinstance(each, dict):
            rows += [(f"{name}: {inner}", str(value)) for inner, value in each.items()]
        else:
            rows.append((name, " ".join(map(str, each)) if isinstance(each, list) else str(each)))
    return rows


# ---------------------------------------------------------------- figures


def _image(figure: Any, what: str) -> str:
    """A figure inside the page."""
    image = io.BytesIO()
    figure.savefig(image, format="png", dpi=110, facecolor="white")
    return f'<img alt="{escape(what)}" src="data:image/png;base64,{base64.b64encode(image.getvalue()).decode()}">'


def _series(run: Run, case: Case, result: dict[str, Any]) -> Any:
    """Bed height, pressure drop over the buoyant weight, granular temperature in time, with the window of the means."""
    history, weight = run.history, _weight(case)
    curves = [("bed height  [m]", history["bed_height"])]
    if "pressure_drop" in history:
        named = "pressure drop\n[Pa]" if weight is None else "pressure drop\nover weight  [-]"
        curves.append((named, history["pressure_drop"] / (weight or 1.0)))
    curves.append(("granular\ntemperature  [m2/s2]", history["granular_temperature"]))
    begin, end = result["window"]
    inside = history["time"] >= begin
    curves = [each for each in curves if np.isfinite(each[1][inside]).any()]  # one particle has no temperature
    figure, axes = blank(len(curves), 1, width=8.0, height=0.6 + 1.9 * len(curves), sharex=True)
    for each, (name, values) in zip(axes, curves):
        each.axvspan(begin, end, color="#f3f3f3", zorder=0)
        each.plot(history["time"], values, color=BLUE)
        each.hlines(np.nanmean(values[inside]), begin, end, color=ORANGE, linewidth=1.2)
        each.set_ylabel(name)
    axes[-1].set_xlabel("time  [s]   (grey: window of the means, orange)")
    return figure


def _encounters(run: Run, begin: float) -> str:
    """The regime map, where encounters on films were recorded."""
    found = recorded_regimes(run, begin)
    if found is None:
        return ""
    figure, axes = panels(1, width=6.4, height=4.6)
    draw_regimes(axes, found)
    return f"<h2>Encounters</h2>{_image(figure, 'regime map of encounters')}" + (
        f"<p>{found.encounters:.0f} encounters of the window. Above the dashed line the film's pressure keeps the "
        "solids apart, below it asperities do; right of the orange line most encounters bring the solids together.</p>"
    )


def _weight(case: Case) -> float | None:
    """Buoyant weight of the bed over its floor [Pa]; None where nothing has to carry it."""
    if case.fluid is None or case.bed.fixed or abs(case.laws.gravity[2]) == 0.0:
        return None
    return buoyant_weight(case) / case.column.floor_area


def _profile(run: Run, case: Case, result: dict[str, Any]) -> str:
    """Voidage against height, its mean and spread over the snapshots of the window."""
    if "voidage" not in run.fluid_fields:
        return "<p>A case without a fluid has no voidage on a grid.</p>"
    grid = grid_of(case.column)
    inside = np.flatnonzero(run.times >= result["window"][0])
    if not len(inside):
        return "<p>No snapshot lies in the window.</p>"
    chosen = inside[np.unique(np.linspace(0, len(inside) - 1, min(len(inside), MOST_PROFILES)).astype(int))]
    try:
        profiles = np.array([voidage_profile(run.fluid("voidage", int(place)), grid.open) for place in chosen])
    except RunFailed as damage:
        return f"<p>{escape(str(damage))}</p>"
    height = (np.arange(profiles.shape[1]) + 0.5) * grid.spacing[2]
    mean, spread = profiles.mean(axis=0), profiles.std(axis=0)
    figure, axes = panels(1, width=5.0, height=4.2)
    axes.fill_betweenx(height, mean - spread, mean + spread, color=SKY, alpha=0.4, linewidth=0)
    axes.plot(mean, height, color=BLUE)
    if "bed_height" in result["measures"]:
        axes.axhline(result["measures"]["bed_height"]["mean"], color=GREY, linewidth=1.0, linestyle="--")
    label(axes, "voidage", "-", "height", "m")
    return _image(figure, "voidage against height") + (
        f"<p>Mean of {len(chosen)} snapshots, and their standard deviation; dashed: the bed height.</p>"
    )
