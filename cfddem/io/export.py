"""Export a run to VTU (meshio), CSV (pandas) or netCDF (xarray)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfddem.backend.errors import InputError, library, nearest
from cfddem.io.files import require_no_links
from cfddem.io.quantities import shown_unit
from cfddem.io.reading import RunData, open_run

FORMATS = ("vtu", "csv", "netcdf")


def export(
    folder: str | Path, kind: str, output: str | Path | None = None, snapshots: Sequence[int] | None = None
) -> list[Path]:
    """Write a run in another format.

    folder     of the run
    kind       vtu: particles as points and fluid as hexahedra, one file each per snapshot;
               csv: particles of each snapshot, the history, the collisions;
               netcdf: the fluid in time, the history, the particles of each snapshot
    output     folder, created if needed; NAME-KIND in the current folder if not given
    snapshots  numbers of snapshots, 0 the first, -1 the last; all if not given
    returns    the written files
    errors     InputError for an unknown format, or if its library is not installed
    """
    if kind not in FORMATS:
        raise InputError("to", kind, nearest(kind, FORMATS))
    run = open_run(folder)
    home = Path(f"{run.folder.resolve().name}-{kind}" if output is None else output)
    count = len(run.times)
    places = list(range(count)) if snapshots is None else list(snapshots)
    for place in places:
        if not -count <= place < count:
            raise InputError("snapshot", place, f"from 0 to {count - 1}, or -1 for the last")
    places = [place % count for place in places]
    package = library({"vtu": "meshio", "csv": "pandas", "netcdf": "xarray"}[kind], "export", "export")
    if output is None:
        require_no_links(Path(), [home.name])
    home.mkdir(parents=True, exist_ok=True)
    require_no_links(home)
    return {"vtu": _vtu, "csv": _csv, "netcdf": _netcdf}[kind](run, home, places, package)


def _vtu(run: RunData, home: Path, places: list[int], meshio: Any) -> list[Path]:
    files = []
    for place in places:
        particles = run.particles(place)
        if particles:
            points = particles.pop("position")
            cells = [("vertex", np.arange(len(points))[:, None])]
            files.append(home / f"particles-{place:08d}.vtu")
            meshio.Mesh(points, cells, point_data=particles).write(files[-1])
        if run.grid is not None:
            corners, cells = _hexahedra(run.grid)
            fields = {name: [_by_cell(run.fluid(name, place))] for name in run.fluid_fields}
            files.append(home / f"fluid-{place:08d}.vtu")
            meshio.Mesh(corners, cells, cell_data=fields).write(files[-1])
    return files


def _csv(run: RunData, home: Path, places: list[int], pandas: Any) -> list[Path]:
    tables = {f"particles-{place:08d}.csv": _flat(run, run.particles(place)) for place in places}
    tables["history.csv"] = _flat(run, run.history)
    tables["collisions.csv"] = _flat(run, run.collisions)
    files = []
    for name, table in tables.items():
        if table:
            files.append(home / name)
            pandas.DataFrame(table).to_csv(files[-1], index=False)
    return files


def _netcdf(run: RunData, home: Path, places: list[int], xarray: Any) -> list[Path]:
    library("h5netcdf", "export", "export")
    files = []

    def write(name: str, variables: dict[str, Any], coordinates: dict[str, Any]) -> None:
        files.append(home / name)
        xarray.Dataset(variables, coordinates, {"run": run.folder.resolve().name}).to_netcdf(
            files[-1], engine="h5netcdf"
        )

    if run.grid is not None:
        files.append(home / "fluid.nc")
        run.dataset()[run.fluid_fields].isel(time=places).to_netcdf(files[-1], engine="h5netcdf")
    for place in places:
        particles = {
            name: (("particle", "component")[: array.ndim], array, {"units": run.unit(name)})
            for name, array in run.particles(place).items()
        }
        if particles:
            instant = ((), run.times[place], {"units": "s"})
            write(f"particles-{place:08d}.nc", particles, {"time": instant, "component": ["x", "y", "z"]})
    if run.history:
        columns = {
            name: ("time", series, {"units": run.unit(name)}) for name, series in run.history.items() if name != "time"
        }
        write("history.nc", columns, {"time": ("time", run.history["time"], {"units": "s"})})
    return files


def _flat(run: RunData, columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Columns named with their units, vectors as three columns."""
    flat: dict[str, np.ndarray] = {}
    for name, values in columns.items():
        unit = shown_unit(run.unit(name))
        parts = {name: values} if values.ndim == 1 else {f"{name}_{axis}": values[:, k] for k, axis in enumerate("xyz")}
        flat |= {f"{part} [{unit}]" if unit != "-" else part: column for part, column in parts.items()}
    return flat


def _by_cell(field: np.ndarray) -> np.ndarray:
    return field.reshape(-1, *field.shape[3:])


def _hexahedra(grid: Any) -> tuple[np.ndarray, list[tuple[str, np.ndarray]]]:
    """Corners of a grid and the eight corners of each cell, cells in the order of the fields."""
    nx, ny, nz = (n + 1 for n in grid.cells)
    z, y, x = np.meshgrid(
        *[x0 + h * np.arange(n) for x0, h, n in zip(grid.origin, grid.spacing, (nx, ny, nz))][::-1], indexing="ij"
    )
    row = np.arange(nx * ny * nz).reshape(nz, ny, nx)
    low, high = row[:-1], row[1:]
    corners = [layer[around] for layer in (low, high) for around in _AROUND]
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), [
        ("hexahedron", np.stack([corner.ravel() for corner in corners], axis=1))
    ]


_FIRST, _SECOND = slice(None, -1), slice(1, None)
_AROUND = tuple(
    (slice(None), *corner) for corner in ((_FIRST, _FIRST), (_FIRST, _SECOND), (_SECOND, _SECOND), (_SECOND, _FIRST))
)
"""Corners of a cell in a layer, counter-clockwise, as (y, x) slices."""
