"""Validation: results of the package compared with published results.

A target is a module with a function `study(folder, progress)` that runs its cases, writes figures and histories
into the folder, reports what it is doing through `progress`, and returns the rows of the table. A row with a limit
passes or fails; a row without a limit is for information.
"""

from __future__ import annotations

import csv
import json as _json
import os
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib import import_module, resources
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError
from scenarios.validation.targets import TARGETS

WIDTH = 100
"""Width of a printed table [characters]."""

Progress = Callable[[str], None]
Columns = Mapping[str, tuple[Any, str]]
"""Arrays by name, each with its unit ("-" where it has none)."""

Curves = dict[str, Columns]
"""Arrays of a target for its histories and figures, by name."""


@dataclass(frozen=True)
class Row:
    """One comparison: |value - reference| against a limit, or without a limit for information."""

    quantity: str
    value: float
    reference: float | None = None
    limit: float | None = None
    unit: str = "-"
    note: str = ""
    points: list[dict[str, float]] = field(default_factory=list)  # all comparisons of which this is the worst

    @property
    def difference(self) -> float | None:
        """Value minus reference."""
        return None if self.reference is None else self.value - self.reference

    @property
    def verdict(self) -> str:
        """`holds`, `FAILS`, or `report` where there is no limit."""
        if self.limit is None or self.difference is None:
            return "report"
        return "holds" if abs(self.difference) <= self.limit else "FAILS"

    def as_dict(self) -> dict[str, Any]:
        """The row for JSON."""
        return asdict(self) | {"difference": self.difference, "verdict": self.verdict}


def worst(quantity: str, points: Iterable[tuple[float, float, float]], limit: float | None = None, **more: Any) -> Row:
    """A row for many points (where, value, reference): it shows the largest difference and keeps them all."""
    listed = [(float(at), float(value), float(reference)) for at, value, reference in points]
    _, value, reference = max(listed, key=lambda point: _size(point[1] - point[2]))
    kept = [{"at": at, "value": value, "reference": reference} for at, value, reference in listed]
    return Row(f"{quantity} ({len(listed)})", value, reference, limit, points=kept, **more)


def in_parts(
    parts: Iterable[Callable[[Curves], list[Row]]],
    draw: Callable[[Path, Curves], None],
    folder: Path,
    progress: Progress,
) -> list[Row]:
    """Run the parts of a target, write histories and figures, and return the table."""
    rows: list[Row] = []
    curves: Curves = {}
    for part in parts:
        progress((part.__doc__ or "").splitlines()[0])
        rows += part(curves)
    progress("figures")
    write_histories(folder / "histories.h5", curves)
    draw(folder, curves)
    return rows


def _size(difference: float) -> float:
    """Magnitude; NaN counts as infinite."""
    return float("inf") if difference != difference else abs(difference)


def validate(
    name: str, output: Path, json: bool = False, data: Sequence[Path] = (), hours: float | None = None
) -> bool:
    """Run a target, print its table and write its files into `output`/`name`.

    name     one of TARGETS
    output   folder for all targets
    json     print the table as JSON
    data     files of measured points, for targets that have a function `compare_data`
    hours    after which a target of `PIECEMEAL` begins no further piece; the table is made of those there are
    returns  whether every limit holds
    """
    folder = Path(output) / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / ".writable").touch()
        (folder / ".writable").unlink()
    except OSError as refusal:
        raise InputError("output", str(output), "a folder that can be written", str(refusal)) from refusal
    begin = perf_counter()
    with _progress(name) as progress:
        module = import_module(TARGETS[name])
        compared: Sequence[Row] = [module.compare_data(folder, path) for path in data]  # wrong files end early
        limited = {} if hours is None else {"hours": hours}
        rows: Sequence[Row] = [*module.study(folder, progress, **limited), *compared]
    seconds = perf_counter() - begin
    report = {
        "target": name,
        "holds": all(row.verdict != "FAILS" for row in rows),
        "seconds": round(seconds, 1),
        "versions": {"python": platform.python_version()}
        | {package: version(package) for package in ("cfddem", "numpy", "numba")},
        "rows": [row.as_dict() for row in rows],
    }
    text = _json.dumps(_finite(report), indent=1)
    with replacing(folder / "table.json") as path:
        path.write_text(text + "\n", encoding="utf-8")
    if json:
        print(text)
    else:
        _show(name, rows, folder, seconds)
    return bool(report["holds"])


def _finite(value: Any) -> Any:
    """The same value with None for NaN and infinity, which JSON cannot hold."""
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


@contextmanager
def _progress(name: str) -> Iterator[Progress]:
    """Show on a terminal what is being computed; print nothing otherwise."""
    from rich.console import Console

    with Console(stderr=True).status(name) as status:
        yield lambda doing: status.update(f"{name}: {doing}")


def _show(name: str, rows: Sequence[Row], folder: Path, seconds: float) -> None:
    """Print the table, the verdict and the folder of the files."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console(highlight=False)
    console = Console(highlight=False, width=min(WIDTH, console.width) if console.is_terminal else WIDTH)
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("quantity (worst of n)", overflow="fold")
    for heading in ("model", "reference", "difference", "limit"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    colour = {"holds": "green", "FAILS": "bold red", "report": "dim"}
    for row in rows:
        label = escape(row.quantity if row.unit == "-" else f"{row.quantity} [{row.unit}]")
        verdict = f"[{colour[row.verdict]}]{row.verdict}"
        table.add_row(label, *map(_number, (row.value, row.reference, row.difference, row.limit)), verdict)
    console.print(table)
    failed = sum(row.verdict == "FAILS" for row in rows)
    judged = sum(row.verdict != "report" for row in rows)
    console.print(f"{name}: {judged - failed} of {judged} limits hold; {len(rows) - judged} rows are for information.")
    print(f"{seconds:.0f} s; figures, histories and table in {folder}")


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Write a temporary file, and move it to its place when it is complete."""
    fresh = path.with_name(f".{os.getpid()}-{path.name}")
    try:
        yield fresh
        os.replace(fresh, path)
    finally:
        fresh.unlink(missing_ok=True)


def write_histories(path: Path, groups: Mapping[str, Columns]) -> None:
    """Write arrays to HDF5; every dataset has an attribute `units`."""
    import h5py

    with replacing(path) as fresh, h5py.File(fresh, "w") as file:
        for group, columns in groups.items():
            for name, (values, unit) in columns.items():
                file.create_dataset(f"{group}/{name}", data=np.asarray(values)).attrs["units"] = unit


def reference(name: str) -> dict[str, list[str]]:
    """Columns of a file in scenarios/data; its `#` lines give the source."""
    text = resources.files("scenarios").joinpath("data", f"{name}.csv").read_text(encoding="utf-8")
    heading, *lines = csv.reader(line for line in text.splitlines() if not line.startswith("#"))
    return {title: [line[place] for line in lines] for place, title in enumerate(heading)}


def numbers(name: str) -> dict[str, np.ndarray]:
    """Columns of a file in scenarios/data, all numeric; names without units."""
    return {title.split(" [")[0]: np.array(column, float) for title, column in reference(name).items()}
