"""Prints results as aligned lines."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from cfddem.backend.tables import table

_COLOURS = {"ok": "32", "warning": "33", "error": "31"}
"""Terminal colour codes of the words that state a status."""


def announce_compilation() -> None:
    """Print a message when loops are compiled for the first time. Loads the compiler."""
    from cfddem.backend.compile import announce_compilation

    announce_compilation()


def with_colour(lines: Iterable[str]) -> Iterator[str]:
    """Lines with their leading status word coloured on a terminal; unchanged elsewhere, or where NO_COLOR is set."""
    if not sys.stdout.isatty() or os.environ.get("NO_COLOR"):
        yield from lines
        return
    for line in lines:
        yield re.sub(r"^(ok|warning|error)(?=:)", lambda word: f"\x1b[{_COLOURS[word[0]]}m{word[0]}\x1b[0m", line)


def show(values: Mapping[str, Any], units: Mapping[str, str]) -> None:
    """Print a result as aligned lines."""
    shown = {name: "" if value is None else units.get(name, "") for name, value in values.items()}
    print("\n".join(table([(name, f"{_readable(values[name])} {unit}") for name, unit in shown.items()], gap=2)))


def _readable(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(_readable(element) for element in value) or "-"
    return str(value)
