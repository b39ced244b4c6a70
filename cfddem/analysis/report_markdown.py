"""The report of a run as Markdown: the same contents, in the same order, as the page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from cfddem.analysis.report_text import bounds_note, spelled, steadiness, window, with_error
from cfddem.io.quantities import shown_unit


def markdown(result: dict[str, Any], figures: Mapping[str, str] | None = None) -> str:
    """The report as Markdown.

    result   of :func:`cfddem.analysis.report.report`
    figures  caption -> place of a picture
    """
    end = result["window"][1]
    laws = (
        (row["law"], f"{row['computed']:.4g}", f"{row['expected']:.4g}", f"{row['ratio']:.3f}", shown_unit(row["unit"]))
        for row in result["laws"]
    )
    parts = [
        f"# {_plain(result['case'])}",
        f"{result['status']} at {end:g} s; {_plain(window(result))}",
        *_table(("", "value", "verdict"), map(_answer, result["answers"])),
        *bounds_note(result),
        *_measured(result["measured"]),
        *_advice(result["advice"]),
        *(f"![{caption}](<{place}>)" for caption, place in (figures or {}).items()),
        "## Means",
        *_table(("measure", "mean", "in time"), map(_measure, result["measures"].items())),
        *(["## Published laws", *_table(("law", "run", "law", "run / law", "unit"), laws)] if result["laws"] else ()),
        *([result["laws_note"]] if result["laws_note"] else ()),
        "## Conservation",
        *_table(("largest imbalance", ""), ((spelled(k), f"{v:.2g}") for k, v in result["ledger"].items())),
        "## References of the laws",
        "\n".join(f"- {_plain(' '.join(law.values()))}" for law in result["references"]),
    ]
    return "\n\n".join(parts) + "\n"


def _answer(each: dict[str, Any]) -> tuple[str, ...]:
    return f"**{each['name']}**", with_error(each), each["verdict"]


def _measured(found: list[dict[str, Any]]) -> list[str]:
    rows = ((each["name"], f"{each['points']} of {spelled(each['quantity'])}", each["verdict"]) for each in found)
    return _table(("measured data", "points", "verdict"), rows) if found else []


def _measure(item: tuple[str, dict[str, Any]]) -> tuple[str, ...]:
    name, each = item
    return spelled(name), with_error(each), steadiness(each)


def _advice(grouped: dict[str, list[str]]) -> Iterator[str]:
    for action, found in grouped.items():
        yield f"**{action[0].upper()}{action[1:]}**"
        yield "\n".join(f"- {_plain(each)}" for each in found)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return ["\n".join("| " + " | ".join(map(_plain, cells)) + " |" for cells in lines)]


def _plain(text: str) -> str:
    """Text without the signs that Markdown reads; bold is kept."""
    for sign in ("\\", "|", "<", "_", "`"):
        text = text.replace(sign, f"\\{sign}")
    return text
