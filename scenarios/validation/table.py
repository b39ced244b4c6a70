"""Validation: results of the package compared with published results.

A target is a module with a function `study(folder, progress)` that runs its cases, writes figures and histories
into the folder, reports what it is doing through `progress`, and returns the rows of the table. A row with a limit
passes or fails; a row without a limit is for information.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

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
