"""Resolved suspension: verification of the method, then the points of the matrix; a run that was killed goes on."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path
from typing import Any

from cfddem.backend.compile import use_threads
from scenarios.references.resolved_suspension import matrix, pictures
from scenarios.references.resolved_suspension.verification import PARTS
from scenarios.validation.table import Progress, Row, replacing


def study(folder: Path, progress: Progress) -> list[Row]:
    """Verify the method, run the points of the matrix that are not in table.json, and return the table.

    Verification and points that the folder holds already are read from it.
    """
    use_threads(1)  # several studies at a time use a machine better than several threads of one
    rows = verified(folder, progress)
    kept = {matrix.name(matrix.Point(**row["point"])): row for row in stored()}
    found = [kept.get(matrix.name(point)) or matrix.run(point, folder / "matrix", progress) for point in matrix.runs()]
    matrix.write_table(found, folder / "table.json", matrix.MADE)
    progress("pictures")
    pictures.correlations(found, folder / "force_correlation.png")
    return rows + [row for each in found for row in measured(each)]


def verified(folder: Path, progress: Progress) -> list[Row]:
    """Rows of the verification; a part that is finished is read from its file."""
    rows: list[Row] = []
    home = folder / "verification"
    home.mkdir(parents=True, exist_ok=True)
    for part in PARTS:
        file = home / f"{part.__name__}.json"
        if not file.exists():
            progress((part.__doc__ or "").splitlines()[0])
            with replacing(file) as fresh:
                fresh.write_text(json.dumps([row.as_dict() for row in part()], indent=1) + "\n", encoding="utf-8")
        rows += [_row(each) for each in json.loads(file.read_text(encoding="utf-8"))]
    return rows


def _row(values: dict[str, Any]) -> Row:
    return Row(**{name: value for name, value in values.items() if name not in ("difference", "verdict")})


def measured(row: dict[str, Any]) -> list[Row]:
    """What a run of the matrix adds to the table; reported, never judged."""
    point = row["point"]
    name = f"density ratio {point['density_ratio']:g}, solid fraction {point['solid_fraction']:g}, seed {point['seed']}"
    temperature, error = row["temperature"]
    return [
        Row(f"{name}: drag over Tenneti et al.", row["drag_over_tenneti"], 1.0, note=f"Re_m {row['reynolds']:.0f}"),
        Row(
            f"{name}: granular temperature over w^2",
            temperature,
            note="" if error is None else f"standard error {error:.2g}",
        ),
    ]


def stored() -> list[dict[str, Any]]:
    """Rows of table.json: the runs of the matrix that are finished and kept with the package."""
    text = resources.files(__package__).joinpath("table.json").read_text(encoding="utf-8")
    rows: list[dict[str, Any]] = json.loads(text)["rows"]
    return rows
