"""Resolved suspension: verification of the method, then the points of the matrix; a run that was killed goes on."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.compile import use_threads
from cfddem.plotting.curves import BLUE, ORANGE, label, panels, save
from scenarios.references.resolved_suspension import matrix
from scenarios.references.resolved_suspension.suspension import Suspension
from scenarios.references.resolved_suspension.verification import PARTS
from scenarios.validation.table import Progress, Row, replacing


def study(folder: Path, progress: Progress) -> list[Row]:
    """Verify the method, run the points of the matrix that are not in table.json, and return the table.

    Verification and points that the folder holds already are read from it.
    """
    use_threads(1)  # several studies at a time use a machine better than several threads of one
    rows = verified(folder, progress)
    kept = {matrix.name(matrix.Point(**row["point"])): row for row in stored()}
    results = [
        kept.get(matrix.name(point)) or matrix.run(point, folder / "matrix", progress) for point in matrix.runs()
    ]
    matrix.write_table(results, folder / "table.json", matrix.MADE)
    progress("pictures")
    correlations(results, folder / "force_correlation.png")
    return rows + [row for result in results for row in measured(result)]


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
        rows += [_row(row) for row in json.loads(file.read_text(encoding="utf-8"))]
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


# ---------------------------------------------------------------- pictures


def slice_of(suspension: Suspension, path: Path) -> None:
    """Speed of the fluid over the mean slip in the plane y = half of the box, the spheres it cuts in white."""
    flow = suspension.flow
    nx, ny, nz = flow.shape
    extent = (-0.5, nx - 0.5, -0.5, nz - 0.5)
    frame, slip = suspension.velocity.mean(axis=0), float(np.linalg.norm(suspension.mean_slip()))
    velocity = (flow.velocity()[:, :, ny // 2] - frame[:, None, None]) / slip
    solid = np.where(flow.share[:, ny // 2] > 0.5, 1.0, np.nan)
    figure, axis = panels(1, width=6.0)
    image = axis.imshow(velocity[2], origin="lower", cmap="RdBu_r", vmin=-3.0, vmax=3.0, extent=extent)
    axis.imshow(solid, origin="lower", cmap="gray", vmin=0.0, vmax=1.2, alpha=0.6, extent=extent)
    step = max(nx // 24, 1)
    x, z = np.meshgrid(np.arange(0, nx, step), np.arange(0, nz, step))
    axis.quiver(x, z, velocity[0, ::step, ::step], velocity[2, ::step, ::step], scale=60.0, width=0.002)
    figure.colorbar(image, ax=axis, label="vertical velocity against the spheres' mean, over w")
    label(axis, "x", "cells", "z", "cells")
    save(figure, path)


def correlations(rows: list[dict[str, Any]], path: Path) -> None:
    """Autocorrelation of the force per sphere, along and across, of all runs."""
    figure, axes = panels(2, width=10.0)
    for axis, which, colour in ((axes[0], "along", BLUE), (axes[1], "across", ORANGE)):
        for row in rows:
            values = row[f"correlation_{which}"]
            axis.plot(row["lag"][: len(values)], values[: len(row["lag"])], color=colour, linewidth=0.8)
        axis.axhline(0.0, color="black", linewidth=0.5)
        label(axis, "lag", "d/w", f"autocorrelation of the force {which}", "-")
    save(figure, path)
