"""Reads measured points from a CSV file whose header gives units, in brackets or parentheses. Nothing is executed.

    time [s], bed height [mm], error [mm]
    0.5, 41.2, 0.4

Lines that begin with `#` are comments. Columns are divided by commas, semicolons or tabs; values are converted to SI.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cfddem.backend.errors import InputError, nearest, shown

Array = NDArray[np.float64]

LARGEST, MOST_ROWS, MOST_COLUMNS = 5_000_000, 100_000, 50
"""Largest file [bytes], most points, and most columns."""

UNITS: dict[str, tuple[float, str]] = {
    "1": (1.0, "1"), "-": (1.0, "1"), "%": (0.01, "1"), "rad": (1.0, "1"), "deg": (1.0, "deg"),
    "m": (1.0, "m"), "cm": (1e-2, "m"), "mm": (1e-3, "m"), "um": (1e-6, "m"), "nm": (1e-9, "m"),
    "s": (1.0, "s"), "ms": (1e-3, "s"), "min": (60.0, "s"), "h": (3600.0, "s"), "Hz": (1.0, "1/s"), "1/s": (1.0, "1/s"),
    "m/s": (1.0, "m/s"), "cm/s": (1e-2, "m/s"), "mm/s": (1e-3, "m/s"),
    "m2/s2": (1.0, "m2/s2"), "cm2/s2": (1e-4, "m2/s2"), "mm2/s2": (1e-6, "m2/s2"),
    "Pa": (1.0, "Pa"), "hPa": (100.0, "Pa"), "mbar": (100.0, "Pa"), "kPa": (1e3, "Pa"), "bar": (1e5, "Pa"),
    "kg": (1.0, "kg"), "g": (1e-3, "kg"), "mg": (1e-6, "kg"), "J": (1.0, "J"), "mJ": (1e-3, "J"), "uJ": (1e-6, "J"),
    "m3": (1.0, "m3"), "cm3": (1e-6, "m3"), "ml": (1e-6, "m3"), "l": (1e-3, "m3"), "ul": (1e-9, "m3"),
    "mm3": (1e-9, "m3"), "m/s2": (1.0, "m/s2"), "rad/s": (1.0, "rad/s"), "N": (1.0, "N"), "mN": (1e-3, "N"),
    "kg/s": (1.0, "kg/s"), "g/s": (1e-3, "kg/s"), "kg/m3": (1.0, "kg/m3"), "g/cm3": (1e3, "kg/m3"),
    "g/ml": (1e3, "kg/m3"), "Pa s": (1.0, "Pa s"), "mPa s": (1e-3, "Pa s"), "P": (0.1, "Pa s"), "cP": (1e-3, "Pa s"),
    "N/m": (1.0, "N/m"), "mN/m": (1e-3, "N/m"), "dyn/cm": (1e-3, "N/m"), "dyn": (1e-5, "N"), "dyn/cm2": (0.1, "Pa"),
    "mmH2O": (9.80665, "Pa"), "cmH2O": (98.0665, "Pa"), "inH2O": (249.08891, "Pa"), "mmHg": (133.322387, "Pa"),
    "m3/s": (1.0, "m3/s"), "cm3/s": (1e-6, "m3/s"), "ml/s": (1e-6, "m3/s"), "l/min": (1e-3 / 60.0, "m3/s"),
    "l/s": (1e-3, "m3/s"), "l/h": (1e-3 / 3600.0, "m3/s"), "ml/min": (1e-6 / 60.0, "m3/s"),
    "m3/h": (1.0 / 3600.0, "m3/s"),
}  # fmt: skip
"""Units of a header: their size and the SI unit that they belong to."""

_PLAIN = str.maketrans({"²": "2", "³": "3", "µ": "u", "μ": "u", "^": None})

_HEADING = re.compile(r"\s*(?P<name>[^\[\]]*?)\s*(?:\[\s*(?P<unit>[^\[\]]*?)\s*\])?\s*")


@dataclass(frozen=True)
class Column:
    """A column of a table, in SI units."""

    name: str  # as the file spells it, lower case, with _ for spaces
    unit: str  # SI
    values: Array


def read_table(path: Path) -> list[Column]:
    """All columns of a CSV file of numbers, in SI units.

    errors  InputError, one line with file, line and column, for anything else
    """
    rows = list(_rows(path))
    if not rows:
        raise InputError(f"{path}", None, "a table", "the file is empty")
    (first, heading), *body = rows
    if not 1 <= len(heading) <= MOST_COLUMNS:
        raise InputError(f"{path}:{first}", len(heading), f"a header of at most {MOST_COLUMNS} columns")
    columns = [_heading(f"{path}:{first}", text) for text in heading]
    names = [name for name, _ in columns]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}:{first}", shown(name), "a name that no other column has")
    if not body:
        raise InputError(f"{path}", None, "a table with at least one line of numbers below its header")
    if len(body) > MOST_ROWS:
        raise InputError(f"{path}", len(body), f"a table of at most {MOST_ROWS} lines")
    values = np.array([_numbers(f"{path}:{line}", cells, names) for line, cells in body])
    return [
        Column(name, UNITS[unit][1], values[:, place] * UNITS[unit][0]) for place, (name, unit) in enumerate(columns)
    ]


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of every line that is neither empty nor a comment."""
    text = _text(path)
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and line.lstrip()[0] != "#"]
    if not lines:
        return
    sign = max(",;\t", key=lines[0][1].count)
    for number, line in lines:
        try:
            cells = next(csv.reader([line], delimiter=sign, strict=True))
        except (csv.Error, StopIteration) as failure:
            raise InputError(f"{path}:{number}", None, "a line of a CSV file", str(failure)) from None
        yield number, cells


def _text(path: Path) -> str:
    try:
        if not path.is_file():
            raise InputError(f"{path}", None, "a file", "a folder or device" if path.exists() else "it does not exist")
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
    except (OSError, ValueError) as failure:
        why = (failure.strerror or str(failure)) if isinstance(failure, OSError) else str(failure)
        if isinstance(failure, InputError):
            raise
        raise InputError(shown(str(path)), None, "a file that can be read", why) from None
    if len(content) > LARGEST:
        raise InputError(f"{path}", None, f"a file of at most {LARGEST // 1_000_000} MB")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as failure:
        raise InputError(f"{path}", None, "UTF-8 text", f"byte {failure.start} is not; save it as UTF-8") from None


def _heading(place: str, text: str) -> tuple[str, str]:
    """Name and unit of a column."""
    text = text if "[" in text else re.sub(r"\(([^()]*)\)\s*$", r"[\1]", text)
    heading = _HEADING.fullmatch(text)
    if heading is None or not heading["name"] or not text.isprintable():
        raise InputError(place, shown(text), "a name and a unit, such as: bed height [mm]")
    unit = re.sub(r"\b([mu]?)L\b", r"\1l", (heading["unit"] or "").translate(_PLAIN))
    if heading["unit"] is None:
        raise InputError(place, shown(text), "followed by its unit, such as: bed height [mm], voidage [-]")
    if unit not in UNITS:
        raise InputError(f"{place} unit", shown(unit), nearest(unit, UNITS))
    return re.sub(r"[\s_]+", "_", heading["name"].lower()), unit


def _numbers(place: str, cells: list[str], names: list[str]) -> list[float]:
    """The numbers of a line."""
    if len(cells) != len(names):
        raise InputError(place, len(cells), f"{len(names)} numbers, one for each column of the header")
    numbers = []
    for name, text in zip(names, cells):
        try:
            value = float(text)
        except ValueError:
            remedy = "write decimals with a point" if re.fullmatch(r"\s*[-+]?\d+,\d+\s*", text) else ""
            raise InputError(f"{place} {name}", shown(text.strip()), "a number", remedy) from None
        if not math.isfinite(value) or "_" in text:
            raise InputError(f"{place} {name}", shown(text.strip()), "a finite number")
        numbers.append(value)
    return numbers
