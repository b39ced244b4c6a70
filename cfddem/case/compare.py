"""Measured data that a case names: the report draws them beside the run and scores the run against them.

Measured points are read from a CSV file whose header gives units, in brackets or parentheses. Nothing is executed.

    time [s], bed height [mm], error [mm]
    0.5, 41.2, 0.4

Lines that begin with `#` are comments. Columns are divided by commas, semicolons or tabs; values are converted to SI.
"""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from cfddem.backend.errors import InputError, nearest, shown
from cfddem.case.bed import Positive
from cfddem.case.materials import Checked
from cfddem.case.walls import kept

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


COPIES = "measured"
"""Folder inside a run folder with copies of the measured data."""

ABSCISSAE = {"time": "s", "height": "m", "inlet_velocity": "m/s"}
"""Columns that say where a point was measured, and their units; without one, the points are means over the averaging
window."""

VELOCITIES = ("velocity", "superficial_velocity", "gas_velocity", "liquid_velocity")
"""Other names of a column of inlet velocities."""

HELD = 0.01
"""Relative difference up to which a case holds a measured velocity [-]."""

PROFILES = {"voidage": "1", "granular_temperature": "m2/s2"}
"""Quantities that a run has against height, and their units."""

ERROR = "error"
"""Column of the standard errors; with several columns of values, `NAME error` is that of one."""


class CaseData(Checked):
    """Measured points of one quantity, in a CSV file beside the case."""

    file: str = Field(description="CSV file whose header has units; its place is relative to the case file")
    quantity: str | None = Field(
        None, description="measure that was measured, as in the report; default: the name of the column of values"
    )
    column: str | None = Field(None, description="column of values; default: the only one beside time, height, error")
    error: Positive | None = Field(None, description="standard error of every point, unless a column gives it [SI]")
    relative_error: Positive | None = Field(None, description="standard error over the value, instead of error [-]")
    weight: Positive = Field(1.0, description="weight in a calibration [-]")

    @model_validator(mode="after")
    def _one_error(self) -> CaseData:
        if self.error is not None and self.relative_error is not None:
            raise InputError("relative_error", self.relative_error, "left out where error is given")
        if "\0" in self.file or not self.file:
            raise InputError("file", self.file, "the name of a file")
        return self


@dataclass(frozen=True)
class Points:
    """Measured points in SI units."""

    name: str  # of the data
    quantity: str
    unit: str
    against: str  # "time", "height", "inlet_velocity", or "" for means
    place: Array  # (n,) time [s], height [m] or velocity [m/s]; zeros for means
    value: Array  # (n,)
    error: Array  # (n,) standard errors; NaN if unknown
    weight: float = 1.0


def points_of(name: str, data: CaseData) -> Points:
    """Read measured points.

    name    of the data
    data    with a path that can be opened
    errors  InputError, one line
    """
    path = Path(data.file)
    columns = _columns(path)
    against = [name for name in ABSCISSAE if name in columns]
    if len(against) > 1:
        remedy = "call the height of a bed: bed height" if "height" in against else ""
        raise InputError(f"{path}", None, f"a table with one of {' and '.join(against)}", remedy)
    others = _value_columns(columns)
    wanted = "_".join(data.column.lower().split()) if data.column is not None else None
    if wanted is None and len(others) != 1:
        names = ", ".join(others) or "none"
        raise InputError(f"{path}", None, f"a table with one column of values; found {names}", "name one: column")
    if wanted is not None and wanted not in columns:
        raise InputError(f"compare.{name}.column", data.column, nearest(wanted, others))
    chosen = columns[wanted or others[0]]
    place = columns[against[0]].values if against else np.zeros(len(chosen.values))
    if against and columns[against[0]].unit != ABSCISSAE[against[0]]:
        kind = {"time": "time", "height": "length"}.get(against[0], "velocity")
        raise InputError(f"{path} {against[0]}", None, f"given in units of {kind}")
    return Points(
        name, data.quantity or chosen.name, chosen.unit, against[0] if against else "", place, chosen.values,
        _errors(path, data, chosen, columns.get(f"{chosen.name}_{ERROR}", columns.get(ERROR))), data.weight,
    )  # fmt: skip


def value_columns(path: Path) -> list[str]:
    """Names of the columns of values of a file of measured points.

    errors  InputError, one line
    """
    return _value_columns(_columns(path))


def _columns(path: Path) -> dict[str, Column]:
    """The columns of a file by their names; a velocity is that of the inlet."""
    columns = {column.name: column for column in read_table(path)}
    for name, column in columns.items():
        if column.unit == "m3/s":
            remedy = "divide the flow rate by the floor area of the column in which it was measured"
            raise InputError(f"{path} {name}", None, "a velocity, such as: velocity [cm/s]", remedy)
    for name in VELOCITIES:
        if name in columns and "inlet_velocity" not in columns:
            columns["inlet_velocity"] = columns.pop(name)
    return columns


def _value_columns(columns: Mapping[str, Column]) -> list[str]:
    return [name for name in columns if name not in ABSCISSAE and name != ERROR and not name.endswith(f"_{ERROR}")]


def held(inlet: float | Sequence[tuple[float, float]], until: float, velocities: Array) -> np.ndarray:
    """Whether a case holds each of some inlet velocities, all the time or during a step of its table (n,) bool.

    inlet  velocity of the case [m/s]
    until  end of the run [s]
    """
    if isinstance(inlet, float):
        steps = [inlet]
    else:
        steps = [low for (_, low), (_, high) in pairwise(inlet) if math.isclose(low, high, rel_tol=HELD)]
        steps += [velocity for time, velocity in inlet[-1:] if time < until]
    return np.array([any(math.isclose(velocity, step, rel_tol=HELD) for step in steps) for velocity in velocities])


def steps_of(velocities: Array, until: float) -> str:
    """Inlet velocities of a case that holds each of some velocities for an equal time, as in a case file.

    velocities  [m/s]
    until       end of the run [s]

    >>> steps_of(np.array([0.03, 0.05]), 2.0)
    'bed.inlet_velocity = [[0, 0.03], [1, 0.03], [1.01, 0.05], [2, 0.05]]'
    """
    held_at = sorted(set(velocities.tolist()))
    step = until / len(held_at)
    begins = [step * (place + 0.01 * (place > 0)) for place in range(len(held_at))]
    pairs = [
        f"[{begin:.4g}, {end:.4g}], [{step * (place + 1):.4g}, {end:.4g}]"
        for place, (begin, end) in enumerate(zip(begins, held_at))
    ]
    return f"bed.inlet_velocity = [{', '.join(pairs)}]"


def _errors(path: Path, data: CaseData, chosen: Column, column: Column | None) -> Array:
    """Standard error of every point."""
    if column is not None:
        if column.unit != chosen.unit:
            raise InputError(f"{path} error", column.unit, f"given in the unit of {chosen.name}, {chosen.unit}")
        if not (column.values > 0.0).all():
            raise InputError(f"{path} error", float(column.values.min()), "above 0", "leave the column out if unknown")
        return column.values
    if data.relative_error is not None:
        if (chosen.values == 0.0).any():
            raise InputError(f"{path} {chosen.name}", 0.0, "not 0 with relative_error", "give error, or a column error")
        return data.relative_error * np.abs(chosen.values)
    return np.full(len(chosen.values), np.nan if data.error is None else data.error)


def require_measured_units(measured: Mapping[str, CaseData], units: Mapping[str, str]) -> None:
    """Refuse measured data that a run will not have, or will have in another unit, before it runs.

    units   of the columns of the history, by their names
    errors  InputError
    """
    for name, data in measured.items():
        require_measured_unit(points_of(name, data), units)


def require_measured_unit(points: Points, units: Mapping[str, str]) -> None:
    """Refuse measured points that a run will not have, or will have in another unit.

    units   of the columns of the history, by their names
    errors  InputError
    """
    units_of = PROFILES if points.against == "height" else {key: unit for key, unit in units.items() if key != "time"}
    if points.quantity not in units_of:
        raise unknown_quantity(points.name, points.quantity, units_of)
    require_unit(points, units_of[points.quantity])


def unknown_quantity(name: str, quantity: str, names: Iterable[str]) -> InputError:
    """The error of measured data of a quantity that no run has.

    name      of the data
    quantity  that they are of
    names     of the measures of the run
    """
    remedy = "name the column after a measure of the report, such as bed height or pressure drop"
    return InputError(f"compare.{name}.quantity", quantity, nearest(quantity, names), remedy)


def require_unit(points: Points, unit: str) -> None:
    """Refuse points in another unit.

    errors  InputError
    """
    if points.unit != unit:
        raise InputError(f"compare.{points.name} unit", points.unit, f"a unit of {points.quantity}, such as {unit}")


# ---------------------------------------------------------------- places of files


def data_in(measured: Mapping[str, CaseData], folder: Path) -> dict[str, CaseData]:
    """Measured data with the places of their files; a run folder has copies, other paths are relative to it.

    folder  of the case file
    errors  InputError for a file outside of the folder, unless its whole path is given
    """
    is_run = (folder / "run.json").is_file()

    def place(name: str, file: str) -> str:
        copy = copy_of(folder, name)
        copied = is_run and copy.is_file()
        return os.path.abspath(
            kept(folder, copy, f"compare.{name}.file", file) if copied else _inside(folder, name, file)
        )

    return with_data(measured, place)


def with_data(measured: Mapping[str, CaseData], place: Callable[[str, str], str]) -> dict[str, CaseData]:
    """Measured data with other files, each from the name of the data and the file that they have now."""
    return {name: points.model_copy(update={"file": place(name, points.file)}) for name, points in measured.items()}


def copy_of(folder: Path, name: str) -> Path:
    """Copy of measured data in a run folder."""
    return folder / COPIES / f"{name}.csv"


def _inside(folder: Path, name: str, file: str) -> Path:
    """The path of a file that lies in a folder, or was given as a whole."""
    path = Path(file)
    if path.is_absolute():
        return path
    if not os.path.realpath(folder / path).startswith(os.path.realpath(folder) + os.sep):
        remedy = "give the whole path, or copy the file there"
        raise InputError(f"compare.{name}.file", file, f"inside the folder of the case, {folder.resolve()}", remedy)
    return folder / path
