"""Runs side by side: what their cases differ in, and whether their means differ by more than their errors."""

from __future__ import annotations

import itertools
import math
import os
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cfddem.analysis.key_results import AGREES
from cfddem.analysis.report import case_of, report
from cfddem.analysis.report_text import Report, number, spelled
from cfddem.analysis.report_values import KeyResult
from cfddem.backend.errors import InputError
from cfddem.backend.tables import line_width, table
from cfddem.case.schema import Case
from cfddem.io.reading import RunData, open_run

MOST = 12
"""Largest number of runs that are compared."""

LONGEST_NAME = 20
"""Most characters of the name of a folder that names a run; longer ones give way to the values that differ."""


def compare(folders: Sequence[Path]) -> dict[str, Any]:
    r"""Means of several runs and their differences from the first one.

    .. math:: z = \frac{x - x_1}{\sqrt{s^2 + s_1^2}}

    folders  of the runs; the first is the reference
    returns  plain values: `runs` (name, folder, case, status, window), `changed` (key -> value of each run),
             `key_results` (name -> value of each run), `measures` (name -> unit, and for each run mean, error,
             difference, its error, z = difference over its error, and a verdict in words). z is NaN where a mean
             still drifts, or where the difference exceeds errors that are lower bounds
    errors   InputError for fewer than two or more than MOST runs
    """
    if not 2 <= len(folders) <= MOST:
        raise InputError("folders", len(folders), f"2 to {MOST} run folders")
    results = [report(folder) for folder in folders]
    runs = [open_run(folder) for folder in folders]
    keys = changed([case_of(run) for run in runs])
    keys |= _changed_laws(runs)
    numbers = [_numbers(result) for result in results]
    measures = {}
    for name, first in numbers[0].items():
        rows = [numbers_of_run.get(name) for numbers_of_run in numbers]
        if sum(row is not None for row in rows) > 1 and any(row and row["mean"] != 0.0 for row in rows):
            measures[name] = {"unit": first["unit"], "runs": [_difference(row, first) for row in rows]}
    return {
        "runs": [
            {"name": name, **{key: getattr(result, key) for key in ("folder", "case", "status", "window", "warnings")}}
            for name, result in zip(run_names(folders, keys), results)
        ],
        "changed": keys,
        "key_results": _key_results(results),
        "measures": measures,
    }


def distinct_names(folders: Sequence[Path]) -> list[str]:
    """Names of folders, with as many of their parents as are needed to tell them apart.

    >>> distinct_names([Path("a/bed"), Path("b/bed")]), distinct_names([Path("a/one"), Path("a/two")])
    (['a/bed', 'b/bed'], ['one', 'two'])
    """
    parts = [folder.absolute().parts for folder in folders]
    for length in range(1, max(map(len, parts)) + 1):
        names = ["/".join(parts_of_run[-length:]) for parts_of_run in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{Path(*parts_of_run).name} ({place})" for place, parts_of_run in enumerate(parts, 1)]


def run_names(folders: Sequence[Path], keys: Mapping[str, Sequence[Any]]) -> list[str]:
    """Names of runs: those of their folders, or of long ones the values of the keys that differ.

    keys  that differ, with the value of each run

    >>> long = [Path("drag-postdoc_inlet_velocity-0.045"), Path("drag-postdoc_inlet_velocity-0.055")]
    >>> run_names(long, {"laws.drag": ["postdoc", "di_felice"], "bed.inlet_velocity": [0.045, 0.045]})
    ['postdoc, 0.045', 'di_felice, 0.045']
    >>> run_names(long, {"bed.inlet_velocity": [0.045, 0.055]})
    ['inlet_velocity 0.045', 'inlet_velocity 0.055']
    >>> run_names(long, {})
    ['0.045', '0.055']
    """
    names = distinct_names(folders)
    if max(map(len, names)) <= LONGEST_NAME:
        return names
    values = [", ".join("-" if value is None else f"{value}" for value in row) for row in zip(*keys.values())]
    if len(keys) == 1:
        values = [f"{next(iter(keys)).split('.')[-1]} {title}" for title in values]
    if len(set(values)) == len(names) and max(map(len, values)) <= max(map(len, names)):
        return values
    common = re.match(r"(.*[-_/])?", os.path.commonprefix(names))  # noqa: RUF071  character by character
    return [name[common.end() :] or name for name in names] if common else names


def changed(cases: Sequence[Case]) -> dict[str, list[Any]]:
    """Keys whose values differ, with the value of each case; None where a case lacks the key.

    Copies of one file do not differ.
    """
    dumps = (case.model_dump(mode="json", fallback=lambda law: getattr(law, "__name__", str(law))) for case in cases)
    flat = [dict(_values(dump, "")) for dump in dumps]
    return {key: values for key, values in _differing(flat).items() if not _same_files(key, values)}


def _differing(tables: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Keys whose values differ, with that of each table; None where it has none."""
    rows = {key: [table.get(key) for table in tables] for key in dict.fromkeys(itertools.chain(*tables))}
    return {key: values for key, values in rows.items() if any(value != values[0] for value in values)}


def _same_files(key: str, files: Sequence[Any]) -> bool:
    """Whether the files of a key are copies of the same one."""
    if not key.endswith(".file") or None in files:
        return False
    try:
        return len({Path(file).read_bytes() for file in files}) == 1
    except OSError:
        return False


def _changed_laws(runs: Sequence[RunData]) -> dict[str, list[Any]]:
    """Fingerprints of users' laws that differ, with that of each run; None where a run has no such law."""
    used: list[dict[str, Any]] = [run.provenance.get("laws", {}) for run in runs]
    return _differing([{f"laws.{kind}, source": law.get("fingerprint") for kind, law in of.items()} for of in used])


def lines(result: dict[str, Any]) -> list[str]:
    """The comparison as text, at most 100 columns wide."""
    return [*_runs(result), *_changes(result["changed"]), *_means(result)]


def relative(row: Mapping[str, Any]) -> str:
    """The difference from the first run in percent of the value there."""
    first = row["mean"] - row["difference"]
    return f"{100.0 * row['difference'] / abs(first):+.2f} %" if first else f"{row['difference']:+.3g}"


def mean_of(row: Mapping[str, Any], unit: str) -> str:
    """The mean of a run with its error and unit."""
    return number(row["mean"], row["error"], unit, row["error_is_lower_bound"])


def _difference(row: dict[str, Any] | None, first: dict[str, Any]) -> dict[str, Any]:
    """A mean beside that of the first run."""
    if row is None:
        missing = dict.fromkeys(("mean", "error", "difference", "difference_error", "stationary"))
        return {**missing, "error_is_lower_bound": False, "z": math.nan, "verdict": "not recorded"}
    difference, error = row["mean"] - first["mean"], math.hypot(row["error"], first["error"])
    z = 0.0 if difference == 0.0 else difference / error if error > 0.0 else math.nan
    z, verdict = _judged(z, (row, first))
    kept = {key: row[key] for key in ("mean", "error", "error_is_lower_bound", "stationary")}
    return {**kept, "difference": difference, "difference_error": error, "z": z, "verdict": verdict}


def _judged(z: float, rows: Sequence[dict[str, Any]]) -> tuple[float, str]:
    """Difference over its error, NaN where that number says nothing, and whether two means differ, in words."""
    if z == 0.0:
        return z, "equal"
    if any(row["stationary"] is False for row in rows):
        return math.nan, "not judged: a mean drifts"
    if math.isnan(z):
        return z, "no error is known"
    if abs(z) <= AGREES:
        return z, "same within errors"
    if any(row["error_is_lower_bound"] for row in rows):
        return math.nan, "not judged: errors are lower bounds"
    return z, f"differs by {min(abs(z), 999.0):.1f} errors"


def _numbers(result: Report) -> dict[str, dict[str, Any]]:
    """The key results of a report that are numbers, and then all other means, by their names."""
    first = {
        key_result.name.replace(" ", "_"): {**asdict(key_result), "mean": key_result.value, "stationary": None}
        for key_result in result.key_results
        if not isinstance(key_result.value, str)
    }
    return first | {name: asdict(mean) for name, mean in result.measures.items()}


def _key_results(results: Sequence[Report]) -> dict[str, list[KeyResult | None]]:
    """The key results of all runs by name."""
    by_name: dict[str, list[KeyResult | None]] = {}
    for place, result in enumerate(results):
        for key_result in result.key_results:
            by_name.setdefault(key_result.name, [None] * len(results))[place] = key_result
    return by_name


def _values(values: Any, key: str) -> Iterator[tuple[str, Any]]:
    """Every value of nested tables, with its dotted key; lists of numbers are one value."""
    if isinstance(values, Mapping):
        for name, value in values.items():
            yield from _values(value, f"{key}.{name}".lstrip("."))
    elif isinstance(values, list) and values and isinstance(values[0], Mapping):
        for place, value in enumerate(values):
            yield from _values(value, f"{key}.{place}")
    else:
        yield key, values


# ---------------------------------------------------------------- text


def _runs(result: dict[str, Any]) -> Iterator[str]:
    for place, run in enumerate(result["runs"]):
        begin, end = run["window"]
        head = "reference" if place == 0 else ""
        name = run["name"] if run["folder"].endswith(run["name"]) else f"{run['name']} ({run['folder']})"
        yield f"{head:<10} {name}: {run['status']}; means from {begin:g} to {end:g} s"
    for name, row in result["key_results"].items():
        if any(key_result is not None and isinstance(key_result.value, str) for key_result in row):
            words = "; ".join(str(key_result.value) if key_result else "-" for key_result in row)
            yield from textwrap.wrap(f"{name:<10} {words}", line_width() - 2, subsequent_indent=" " * 11)


def _changes(keys: dict[str, list[Any]]) -> Iterator[str]:
    yield ""
    yield "keys of the cases that differ" if keys else "the cases are the same"
    for key, values in keys.items():
        text = "  ".join("-" if value is None else f"{value}"[:40] for value in values)
        yield from textwrap.wrap(f"  {key:<28} {text}", line_width() - 2, subsequent_indent=" " * 31)


def _means(result: dict[str, Any]) -> Iterator[str]:
    names = [run["name"] for run in result["runs"]]
    wide = min(30, max(map(len, names)))
    for name, measure in result["measures"].items():
        yield ""
        yield spelled(name)
        rows = []
        for place, (run, row) in enumerate(zip(names, measure["runs"])):
            value = "-" if row["mean"] is None else mean_of(row, measure["unit"])
            judged = ("", "") if place == 0 or row["mean"] is None else (relative(row), f" {row['verdict']}")
            rows.append((run[:wide], value, *judged))
        yield from table(rows, right=(2,), widths=(wide, 30, 10), indent=2)
