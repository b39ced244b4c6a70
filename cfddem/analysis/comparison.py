"""Runs side by side: what their cases differ in, and whether their means differ by more than their errors."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cfddem.analysis.answers import AGREES
from cfddem.analysis.report import case_of, report
from cfddem.analysis.report_text import WIDTH, number, spelled
from cfddem.backend.errors import InputError
from cfddem.case.schema import Case
from cfddem.io.reading import open_run

MOST = 12
"""Largest number of runs that are compared."""


def compare(folders: Sequence[Path]) -> dict[str, Any]:
    r"""Means of several runs and their differences from the first one.

    .. math:: z = \frac{x - x_1}{\sqrt{s^2 + s_1^2}}

    folders  of the runs; the first is the reference
    returns  plain values: `runs` (name, folder, case, status, window), `changed` (key -> value of each run), `answers`
             (name -> value of each run), `measures` (name -> unit, and for each run mean, error, difference, its error,
             and z = difference over its error)
    errors   InputError for fewer than two or more than MOST runs
    """
    if not 2 <= len(folders) <= MOST:
        raise InputError("folders", len(folders), f"2 to {MOST} run folders")
    results = [report(folder) for folder in folders]
    names = distinct_names(folders)
    measures = {}
    for name, first in results[0]["measures"].items():
        rows = [result["measures"].get(name) for result in results]
        if sum(row is not None for row in rows) > 1:
            measures[name] = {"unit": first["unit"], "runs": [_difference(row, first) for row in rows]}
    return {
        "runs": [
            {"name": name, **{key: result[key] for key in ("folder", "case", "status", "window", "warnings")}}
            for name, result in zip(names, results)
        ],
        "changed": changed([case_of(open_run(folder)) for folder in folders]),
        "answers": _answers(results),
        "measures": measures,
    }


def distinct_names(folders: Sequence[Path]) -> list[str]:
    """Names of folders, with as many of their parents as are needed to tell them apart.

    >>> distinct_names([Path("a/bed"), Path("b/bed")]), distinct_names([Path("a/one"), Path("a/two")])
    (['a/bed', 'b/bed'], ['one', 'two'])
    """
    parts = [folder.absolute().parts for folder in folders]
    for length in range(1, max(map(len, parts)) + 1):
        names = ["/".join(each[-length:]) for each in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{Path(*each).name} ({place})" for place, each in enumerate(parts, 1)]


def changed(cases: Sequence[Case]) -> dict[str, list[Any]]:
    """Keys whose values differ, with the value of each case; None where a case lacks the key."""
    flat = [dict(_values(case.model_dump(mode="json", fallback=_law_name), "")) for case in cases]
    keys = dict.fromkeys(key for each in flat for key in each)
    rows = {key: [each.get(key) for each in flat] for key in keys}
    return {key: values for key, values in rows.items() if any(value != values[0] for value in values)}


def lines(result: dict[str, Any]) -> list[str]:
    """The comparison as text, at most 100 columns wide."""
    return [*_runs(result), *_changes(result["changed"]), *_means(result)]


def verdict(row: Mapping[str, Any]) -> str:
    """Whether a run differs from the first one, in words.

    row  of one run in `measures`
    """
    if row["mean"] is None:
        return "not recorded"
    if math.isnan(row["z"]):
        return "no error is known"
    return "same within errors" if abs(row["z"]) <= AGREES else f"differs by {min(abs(row['z']), 999.0):.1f} errors"


def relative(row: Mapping[str, Any]) -> str:
    """The difference from the first run in percent of the value there."""
    first = row["mean"] - row["difference"]
    return f"{100.0 * row['difference'] / abs(first):+.2f} %" if first else f"{row['difference']:+.3g}"


def _difference(row: dict[str, Any] | None, first: dict[str, Any]) -> dict[str, Any]:
    if row is None:
        return {"mean": None, "error": None, "difference": None, "difference_error": None, "z": math.nan}
    difference, error = row["mean"] - first["mean"], math.hypot(row["error"], first["error"])
    z = 0.0 if difference == 0.0 else difference / error if error > 0.0 else math.nan
    return {
        "mean": row["mean"], "error": row["error"], "difference": difference, "difference_error": error, "z": z,
        "stationary": row["stationary"],
    }  # fmt: skip


def _answers(results: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any] | None]]:
    """The answers of all runs by name."""
    found: dict[str, list[dict[str, Any] | None]] = {}
    for place, result in enumerate(results):
        for each in result["answers"]:
            found.setdefault(each["name"], [None] * len(results))[place] = each
    return found


def _law_name(value: Any) -> str:
    return getattr(value, "__name__", str(value))


def _values(values: Any, key: str) -> Iterator[tuple[str, Any]]:
    """Every value of nested tables, with its dotted key; lists of numbers are one value."""
    if isinstance(values, Mapping):
        for name, each in values.items():
            yield from _values(each, f"{key}.{name}".lstrip("."))
    elif isinstance(values, list) and values and isinstance(values[0], Mapping):
        for place, each in enumerate(values):
            yield from _values(each, f"{key}.{place}")
    else:
        yield key, values


# ---------------------------------------------------------------- text


def _runs(result: dict[str, Any]) -> Iterator[str]:
    for place, each in enumerate(result["runs"]):
        begin, end = each["window"]
        head = "reference" if place == 0 else ""
        yield f"{head:<10} {each['name']}: {each['status']}; means from {begin:g} to {end:g} s"
    for name, answers in result["answers"].items():
        if any(each is not None and isinstance(each["value"], str) for each in answers):
            words = "; ".join(each["value"] if each else "-" for each in answers)
            yield from textwrap.wrap(f"{name:<10} {words}", WIDTH, subsequent_indent=" " * 11)


def _changes(keys: dict[str, list[Any]]) -> Iterator[str]:
    yield ""
    yield "keys of the cases that differ" if keys else "the cases are the same"
    for key, values in keys.items():
        text = "  ".join("-" if each is None else f"{each}"[:40] for each in values)
        yield from textwrap.wrap(f"  {key:<28} {text}", WIDTH, subsequent_indent=" " * 31)


def _means(result: dict[str, Any]) -> Iterator[str]:
    names = [each["name"] for each in result["runs"]]
    wide = min(30, max(map(len, names)))
    for name, measure in result["measures"].items():
        yield ""
        yield spelled(name)
        for place, (run, row) in enumerate(zip(names, measure["runs"])):
            value = "-" if row["mean"] is None else number(row["mean"], row["error"], measure["unit"])
            opening = f"  {run[:wide]:<{wide}} {value:<30}"
            yield (
                opening.rstrip()
                if place == 0 or row["mean"] is None
                else (f"{opening} {relative(row):>10}  {verdict(row)}")
            )
