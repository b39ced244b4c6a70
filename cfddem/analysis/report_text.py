"""The report of a run as text and as JSON."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Iterator
from typing import Any

from cfddem.io.quantities import shown_unit

WIDTH = 98
"""Columns of wrapped lines."""

NO_BREAK = "\N{NO-BREAK SPACE}"


def lines(result: dict[str, Any]) -> list[str]:
    """The report as text, at most 100 columns wide.

    result  of :func:`cfddem.analysis.report.report`
    """
    return [
        *_headline(result),
        *_laws(result["laws"], result["laws_note"]),
        *_ledger(result["ledger"]),
        *_collisions(result["collisions"]),
        *_impacts(result["impacts"]),
        *_energy(result),
        *_wall_time(result["wall_time"]),
        *_warnings(result["warnings"]),
    ]


def as_json(result: Any) -> str:
    """The report as JSON, with null for NaN and infinity."""

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: plain(each) for name, each in value.items()}
        if isinstance(value, list | tuple):
            return [plain(each) for each in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return json.dumps(plain(result), allow_nan=False)


def steadiness(measure: dict[str, Any]) -> str:
    """Whether a measure is stationary, in words."""
    if measure["stationary"] is None:
        return "too few rows"
    if measure["stationary"]:
        return "stationary"
    drift = measure["drift"]
    return f"drifts by {drift:+.2g}" if abs(drift) > 3.0 * measure["drift_error"] else "still settling"


def spelled(name: str) -> str:
    """The name of a column in words."""
    return name.replace("_", " ")


def _headline(result: dict[str, Any]) -> Iterator[str]:
    begin, end = result["window"]
    yield f"{result['case']}: {result['status']}"
    yield f"means from {begin:g} to {end:g} s"
    yield ""
    for name, each in result["measures"].items():
        error = "" if math.isnan(each["error"]) else f" +- {each['error']:.2g}"
        unit = "" if each["unit"] == "1" else each["unit"]
        value = f"{each['mean']:.4g}{error} {unit}".rstrip()
        yield f"  {spelled(name):<26} {value:<28} {steadiness(each)}"


def _laws(rows: list[dict[str, Any]], note: str) -> Iterator[str]:
    if not rows:
        return
    wide = max(40, *(len(row["law"]) for row in rows))
    yield ""
    yield f"  {'law':<{wide}} {'run':>10} {'law':>10} {'ratio':>7} unit"
    for row in rows:
        numbers = f"{row['computed']:>10.4g} {row['expected']:>10.4g} {row['ratio']:>7.3f}"
        yield f"  {row['law']:<{wide}} {numbers} {shown_unit(row['unit'])}"
    yield from textwrap.wrap(note, WIDTH, initial_indent="  ", subsequent_indent="    ")


def _ledger(ledger: dict[str, float]) -> Iterator[str]:
    yield ""
    yield "  conservation, largest imbalance of the run"
    for name, value in ledger.items():
        yield f"  {spelled(name):<26} {value:.2g}"


def _collisions(found: dict[str, float]) -> Iterator[str]:
    if found:
        yield ""
        yield (
            f"  {found['number']:.0f} collisions with films: median St {found['median_stokes']:.3g}; solid contact in "
            f"{100.0 * found['contact_fraction']:.3g} %, deformed by the film in "
            f"{100.0 * found['deformed_fraction']:.3g} %"
        )


def _impacts(found: dict[str, float]) -> Iterator[str]:
    if found:
        yield ""
        touching = f"{found['contact_rate']:.3g} of them with solid contact"
        yield f"  {found['rate']:.3g} collisions of a particle per second, {touching}"
        yield f"  mean speed of approach {found['mean_speed']:.3g} m/s"


def _energy(result: dict[str, Any]) -> Iterator[str]:
    if result["energy"]:
        yield ""
        yield f"  energy budget, of an input of {result['energy']['put_in']:.4g} J"
        for row in result["energy_lines"]:
            percent = 100.0 * row["fraction"]
            yield f"  {row['group']:<26} {spelled(row['name']):<24} {row['energy']:>12.4g} J {percent:>9.3f} %"


def _wall_time(seconds: dict[str, float]) -> list[str]:
    total = sum(seconds.values())
    if not total:
        return []
    parts = sorted(seconds.items(), key=lambda each: -each[1])
    shares = ", ".join(f"{name} {100 * each / total:.0f}{NO_BREAK}%" for name, each in parts[:6])
    lines = textwrap.wrap(f"  wall time {total:.3g} s: {shares}", WIDTH, subsequent_indent="    ")
    return ["", *(line.replace(NO_BREAK, " ") for line in lines)]


def _warnings(found: list[str]) -> Iterator[str]:
    if found:
        yield ""
    for each in found:
        yield from textwrap.wrap(f"warning: {each}", WIDTH, initial_indent="  ", subsequent_indent="    ")
