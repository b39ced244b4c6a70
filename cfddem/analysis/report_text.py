"""The report of a run as text and Markdown: key results first, then what to do about warnings, then details."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from cfddem.analysis.bed_laws import FROM_PRESSURE
from cfddem.analysis.report_values import Citation, EnergyLine, KeyResult, LawComparison, Measure
from cfddem.analysis.run_warnings import NOTE
from cfddem.backend import html
from cfddem.backend.tables import line_width, table
from cfddem.io.quantities import shown_unit

REMARKS = {FROM_PRESSURE: "; middle of the bed"}
"""What a reader should know about a mean, by its name."""

LOWER_BOUND = "'at least' before an error: the averaging window is too short to know it; run longer"
"""What "at least" before an error means."""

NO_BREAK = "\N{NO-BREAK SPACE}"


@dataclass(frozen=True)
class Report:
    """The report of a run, of :func:`cfddem.analysis.report.report`. `print` shows it as `cfddem report` does.

    window        start and end of the averaging window [s]
    films         lubrication films, in words
    surface       what particles at the surface of the bed see, in words
    key_results   most important first
    measures      by name
    measured      scores against measured data
    laws_note     a sentence on the published laws
    ledger        largest relative imbalance of each conserved quantity
    energy        energy budget at the end by line [J]; empty if the case does not ask for it
    collisions    of the window, if recorded; so are impacts
    film_solution iterations a step and largest damping number in the window; empty without films
    actions       all warnings by what to do about them, and notes
    wall_time     of each part of the run [s]
    preflight     the check of the case before the run
    provenance    versions, platform, random seed
    references    laws of the case
    """

    case: str
    folder: str
    status: str
    message: str
    window: tuple[float, float]
    films: str
    surface: str
    key_results: list[KeyResult]
    measures: dict[str, Measure]
    measured: list[dict[str, Any]]
    laws: list[LawComparison]
    laws_note: str
    ledger: dict[str, float]
    energy: dict[str, float]
    energy_lines: list[EnergyLine]
    collisions: dict[str, float]
    impacts: dict[str, float]
    film_solution: dict[str, float]
    warnings: list[str]
    actions: dict[str, list[str]]
    wall_time: dict[str, float]
    steps: dict[str, int]
    preflight: dict[str, Any]
    provenance: dict[str, Any]
    references: list[Citation]

    def __str__(self) -> str:
        return "\n".join(lines(self))

    def _repr_html_(self) -> str:
        """The key results, in a notebook."""
        rows = [(key_result.name, with_error(key_result), key_result.verdict) for key_result in self.key_results]
        return html.table(f"{self.case}: {self.status}; {window(self)}", rows)

    def summary(self) -> dict[str, Any]:
        """Plain values, as in `cfddem report --json`, where null stands for NaN."""
        return asdict(self)


def lines(result: Report) -> list[str]:
    """The report as text, at most 100 columns wide."""
    energy = [(group, name, f"{joule} J", f"{share} %") for group, name, joule, share in energy_cells(result)]
    shown = {key_result.name for key_result in result.key_results}
    others = [
        (name, mean, steady + REMARKS.get(key, ""))
        for key, (name, mean, steady) in zip(result.measures, mean_cells(result))
        if name not in shown
    ]
    blocks = (
        _headline(result),
        _key_results(result.key_results),
        _measured(result.measured),
        *(_action(*action_and_reasons) for action_and_reasons in result.actions.items()),
        ["  all other means", *table(others, widths=(28, 28), indent=2)],
        _laws(result),
        [
            "  conservation, largest relative imbalance of the run",
            *table(ledger_cells(result), widths=(26,), indent=2),
        ],
        _collisions(result),
        [f"  {film_solution(result.film_solution)}"] if result.film_solution else [],
        [
            f"  energy budget, of an input of {result.energy['put_in']:.4g} J",
            *table(energy, right=(2, 3), widths=(26, 24, 14, 11), indent=2),
        ]
        if result.energy
        else [],
        _wall_time(result.wall_time),
    )
    return [line for block in map(list, blocks) if block for line in ("", *block)][1:]


def mean_cells(result: Report) -> list[tuple[str, str, str]]:
    """Name, mean with error, and steadiness of every measure."""
    return [(spelled(name), with_error(measure), steadiness(measure)) for name, measure in result.measures.items()]


def law_cells(result: Report) -> list[tuple[str, ...]]:
    """Name, value of the run, that of the law, their ratio, and the unit, of every published law."""
    return [
        (row.law, f"{row.computed:.4g}", f"{row.expected:.4g}", f"{row.ratio:.3f}", shown_unit(row.unit))
        for row in result.laws
    ]


def ledger_cells(result: Report) -> list[tuple[str, str]]:
    """Name and largest imbalance of every conserved quantity."""
    return [(spelled(name), f"{value:.2g}") for name, value in result.ledger.items()]


def energy_cells(result: Report) -> list[tuple[str, str, str, str]]:
    """Group, name, energy [J] and share of the input [%] of every line of the budget."""
    return [
        (row.group, spelled(row.name), f"{row.energy:.4g}", f"{100.0 * row.fraction:.3f}")
        for row in result.energy_lines
    ]


def steadiness(measure: Measure) -> str:
    """Whether a measure is stationary, in words."""
    if measure.stationary is None:
        return "too few rows"
    if measure.stationary:
        return "stationary"
    drift, unit = measure.drift, "" if measure.unit == "1" else f" {measure.unit}"
    return f"drifts by {drift:+.2g}{unit}" if abs(drift) > 3.0 * measure.drift_error else "still settling"


def spelled(name: str) -> str:
    """The name of a column in words."""
    return name.replace("_", " ")


def number(value: float | str, error: float = math.nan, unit: str = "", at_least: bool = False) -> str:
    """A value with its error and unit; a text as it is.

    at_least  the error is a lower bound

    >>> number(0.04321, 0.0002, "m"), number(0.6, unit="1"), number("packed")
    ('0.04321 +- 0.0002 m', '0.6', 'packed')
    >>> number(0.04321, 0.0002, "m", at_least=True)
    '0.04321 +- at least 0.0002 m'
    """
    if isinstance(value, str):
        return value
    shown = "" if math.isnan(error) else f" +- {'at least ' if at_least else ''}{error:.2g}"
    return f"{value:.4g}{shown} {'' if unit == '1' else unit}".rstrip()


def with_error(row: KeyResult | Measure) -> str:
    """The value of a key result or the mean of a measure, with its error and unit."""
    value = row.mean if isinstance(row, Measure) else row.value
    return number(value, row.error, row.unit, row.error_is_lower_bound)


def window(result: Report) -> str:
    """The averaging window, the lubrication films and the surface of the bed of a run in words."""
    begin, end = result.window
    notes = (("lubrication films", result.films), ("surface of the bed", result.surface))
    return "; ".join([f"means from {begin:g} to {end:g} s", *(f"{name}: {words}" for name, words in notes if words)])


def bounds_note(result: Report) -> list[str]:
    """What "at least" means, if a key result says it."""
    bounds = (key_result.error_is_lower_bound and not math.isnan(key_result.error) for key_result in result.key_results)
    return [LOWER_BOUND] * any(bounds)


def _headline(result: Report) -> Iterator[str]:
    reason = f", {result.message}" if result.status == "finished" and result.message else ""
    yield f"{result.case}: {result.status}{reason}"
    parts = window(result).replace(" ", NO_BREAK).replace(f";{NO_BREAK}", "; ")  # a line ends between two parts
    for line in textwrap.wrap(parts, line_width() - 2, subsequent_indent="  ", break_long_words=False):
        yield line.replace(NO_BREAK, " ")
    yield from bounds_note(result)


def _key_results(results: Sequence[KeyResult]) -> Iterator[str]:
    wide = max(26, *(len(with_error(key_result)) for key_result in results if not isinstance(key_result.value, str)), 0)
    for key_result in results:
        opening = f"  {key_result.name:<16} {with_error(key_result):<{wide}} "
        if isinstance(key_result.value, str) and len(opening) > wide + 20:
            yield opening.rstrip()
            opening = " " * (wide + 20)
        wrapped = textwrap.wrap(
            opening + key_result.verdict, line_width() - 2, subsequent_indent=" " * (wide + 20), break_long_words=False
        )
        yield from wrapped or [opening]


def _measured(comparisons: list[dict[str, Any]]) -> Iterator[str]:
    if comparisons:
        yield "  comparison with measured data"
    for comparison in comparisons:
        points, outside = comparison["points"], comparison["outside"]
        part = f"{points} of {points + outside} points" if outside else f"{points} point{'' if points == 1 else 's'}"
        opening = f"  {comparison['name']:<16} {part} of {spelled(comparison['quantity'])}: "
        yield from textwrap.wrap(opening + comparison["verdict"], line_width() - 2, subsequent_indent=" " * 19)


def _laws(result: Report) -> Iterator[str]:
    if result.laws:
        headings = ("law", "run", "law", "ratio", "unit")
        yield from table(law_cells(result), headings, right=(1, 2, 3), widths=(40, 10, 10, 7), indent=2)
        yield from textwrap.wrap(result.laws_note, line_width() - 2, initial_indent="  ", subsequent_indent="    ")


def _collisions(result: Report) -> Iterator[str]:
    if regimes := result.collisions:
        yield (
            f"  {regimes['number']:.0f} collisions with films: median St {regimes['median_stokes']:.3g}; "
            f"solid contact in {100.0 * regimes['contact_fraction']:.3g} %, deformed by the film in "
            f"{100.0 * regimes['deformed_fraction']:.3g} %"
        )
    if regimes and result.impacts:
        yield ""
    if impacts := result.impacts:
        touching = f"{impacts['contact_rate']:.3g} of them with solid contact"
        yield f"  {impacts['rate']:.3g} collisions of a particle per second, {touching}"
        yield f"  mean speed of approach {impacts['mean_speed']:.3g} m/s"


def film_solution(solution: dict[str, float]) -> str:
    """How films were solved together, in words; empty if none were."""
    if not solution:
        return ""
    return (
        f"films solved together: {solution['iterations']:.3g} iterations a step, largest damping number X = "
        f"{solution['damping_number']:.3g}"
    )


def _wall_time(seconds: dict[str, float]) -> list[str]:
    total = sum(seconds.values())
    if not total:
        return []
    parts = sorted(seconds.items(), key=lambda part_and_seconds: -part_and_seconds[1])
    shares = ", ".join(f"{name} {100 * part_seconds / total:.0f}{NO_BREAK}%" for name, part_seconds in parts[:6])
    lines = textwrap.wrap(f"  wall time {total:.3g} s: {shares}", line_width() - 2, subsequent_indent="    ")
    return [line.replace(NO_BREAK, " ") for line in lines]


def _action(action: str, reasons: Sequence[str]) -> Iterator[str]:
    yield f"  {action}"
    opening = "" if action == NOTE else "warning: "
    for reason in reasons:
        yield from textwrap.wrap(f"{opening}{reason}", line_width() - 2, initial_indent="  ", subsequent_indent="    ")


# ---------------------------------------------------------------- Markdown


def markdown(result: Report, figures: Mapping[str, str] | None = None) -> str:
    """The report as Markdown.

    figures  caption -> place of a picture
    """
    law_headings = ("law", "run", "law", "run / law", "unit")
    actions = (
        (f"**{action[0].upper()}{action[1:]}**", "\n".join(f"- {_escaped(reason)}" for reason in reasons))
        for action, reasons in result.actions.items()
    )
    key_results = (
        (f"**{key_result.name}**", with_error(key_result), key_result.verdict) for key_result in result.key_results
    )
    measured = [
        (comparison["name"], f"{comparison['points']} of {spelled(comparison['quantity'])}", comparison["verdict"])
        for comparison in result.measured
    ]
    parts = [
        f"# {_escaped(result.case)}",
        f"{result.status} at {result.window[1]:g} s; {_escaped(window(result))}",
        _markdown_table(("", "value", "verdict"), key_results),
        *bounds_note(result),
        _markdown_table(("measured data", "points", "verdict"), measured) if measured else "",
        *itertools.chain(*actions),
        *(f"![{caption}](<{place}>)" for caption, place in (figures or {}).items()),
        "## Means",
        _markdown_table(("measure", "mean", "in time"), mean_cells(result)),
        *(("## Published laws", _markdown_table(law_headings, law_cells(result))) if result.laws else ()),
        result.laws_note,
        "## Conservation",
        _markdown_table(("largest imbalance", ""), ledger_cells(result)),
        film_solution(result.film_solution),
        "## References of the laws",
        "\n".join(f"- {_escaped(f'{law.kind} {law.name} {law.reference}')}" for law in result.references),
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def _markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(_escaped, cells)) + " |" for cells in lines)


def _escaped(text: str) -> str:
    """Text without the signs that Markdown reads; bold is kept."""
    for sign in ("\\", "|", "<", "_", "`"):
        text = text.replace(sign, f"\\{sign}")
    return text
