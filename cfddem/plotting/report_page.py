"""The report of a run as one self-contained HTML page: answer, warnings by what to do, figures, details."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from cfddem.analysis.measured import with_files
from cfddem.analysis.report import case_of
from cfddem.analysis.report import report as summary
from cfddem.analysis.report_markdown import markdown
from cfddem.analysis.report_text import bounds_note, spelled, steadiness, window, with_error
from cfddem.analysis.run_warnings import NOTE
from cfddem.io.files import write_whole
from cfddem.io.quantities import shown_unit
from cfddem.io.reading import Run, open_run
from cfddem.plotting.curves import encoded, save
from cfddem.plotting.report_figures import figures_of

Rows = list[tuple[str, ...]]


def page(
    folder: Path, output: Path | None = None, result: dict[str, Any] | None = None, data: Sequence[Path] = ()
) -> Path:
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


def markdown_page(folder: Path, output: Path, result: dict[str, Any] | None = None, data: Sequence[Path] = ()) -> Path:
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


def render(run: Run, result: dict[str, Any], data: Sequence[Path] = ()) -> str:
    """The page as text."""
    case, end, steps = with_files(case_of(run), data), result["window"][1], result["steps"]
    counts = f"{steps['particles']} particle steps, {steps['fluid']} fluid steps"
    drawn = figures_of(run, case, result)
    text: str = _template().render(
        result=result,
        status=f"{result['status']} at {end:g} s; {counts}; {window(result)}",
        bounds_note=bounds_note(result),
        note=NOTE,
        answers=_answers(result["answers"]),
        measures=_measures(result["measures"]),
        laws=_laws(result["laws"]),
        ledger=[(spelled(name), f"{value:.2g}") for name, value in result["ledger"].items()],
        energy=_energy(result["energy_lines"]),
        preflight=_preflight(result["preflight"]),
        wall_time=_wall_time(result["wall_time"]),
        provenance=_provenance(result["provenance"]),
        case_text=run.case_text,
        figures={name: (encoded(figure), caption) for name, (figure, caption) in drawn.items()},
    )
    return text


@cache
def _template() -> Any:
    from jinja2 import Environment, PackageLoader

    return Environment(loader=PackageLoader("cfddem", "plotting"), autoescape=True).get_template("report.html")


# ---------------------------------------------------------------- tables


def _answers(found: list[dict[str, Any]]) -> list[dict[str, str]]:
    marks = {True: "good", False: "bad", None: "open"}
    return [
        {
            "name": each["name"],
            "value": with_error(each).replace("+-", "±"),
            "verdict": each["verdict"].replace("+-", "±"),
            "mark": marks[each["holds"]],
        }
        for each in found
    ]


def _measures(measures: dict[str, Any]) -> list[dict[str, str]]:
    rows = []
    for name, each in measures.items():
        error = "-" if math.isnan(each["error"]) else f"{each['error']:.2g}"
        rows.append(
            {
                "name": spelled(name),
                "meaning": each["meaning"],
                "mean": f"{each['mean']:.4g}",
                "error": f"at least {error}" if each["error_is_lower_bound"] and error != "-" else error,
                "unit": shown_unit(each["unit"]),
                "steadiness": steadiness(each),
            }
        )
    return rows


def _laws(laws: list[dict[str, Any]]) -> Rows:
    return [
        (each["law"], f"{each['computed']:.4g}", f"{each['expected']:.4g}", f"{each['ratio']:.3f}",
         shown_unit(each["unit"]), each["outside_range"])
        for each in laws
    ]  # fmt: skip


def _energy(lines: list[dict[str, Any]]) -> Rows:
    return [
        (each["group"], spelled(each["name"]), f"{each['energy']:.4g}", f"{100.0 * each['fraction']:.3f}")
        for each in lines
    ]


def _preflight(made: dict[str, Any]) -> Rows:
    return [
        (group, name, "-" if each["value"] is None else f"{each['value']:.4g}", each["unit"], each["note"])
        for group, numbers in made["numbers"].items()
        for name, each in numbers.items()
    ]


def _wall_time(seconds: dict[str, float]) -> Rows:
    total = sum(seconds.values())
    parts = sorted(seconds.items(), key=lambda each: -each[1])
    shares: Rows = [(name, f"{each:.3g}", f"{100.0 * each / total:.1f} %") for name, each in parts if total]
    return [*shares, ("all", f"{total:.3g}", "")]


def _provenance(values: dict[str, Any]) -> Rows:
    rows: Rows = []
    for name, each in values.items():
        if isinstance(each, dict):
            rows += [(f"{name}: {inner}", _words(value)) for inner, value in each.items()]
        else:
            rows.append((name, " ".join(map(str, each)) if isinstance(each, list) else str(each)))
    return rows


def _words(value: Any) -> str:
    return (
        ", ".join(f"{name} {each}" for name, each in value.items() if each) if isinstance(value, dict) else str(value)
    )
