"""Particles from files with tables of centres and diameters."""

from __future__ import annotations

from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from cfddem.backend.errors import InputError, nearest
from cfddem.particles.state import Particles, make_particles

COLUMNS = ("x", "y", "z", "diameter", "density", "material")


def read_particles(path: str | Path, density: float | None = None, material: int = 0, scale: float = 1.0) -> Particles:
    """Particles at rest, read from a file.

    A `.csv` file begins with a line of names: `x, y, z, diameter` and optionally `density, material`; units in
    brackets after a name are ignored. A `.npz` file has the arrays `position` (N, 3) and `diameter` (N,), and
    optionally the same.

    path      of the file
    density   of all particles if the file has none [kg/m3]
    material  of all particles if the file has none
    scale     length of the file's unit [m]
    """
    path = Path(path)
    if not path.is_file():
        raise InputError("particles", str(path), "a file that exists")
    read = {".csv": _columns, ".npz": _arrays}.get(path.suffix.lower())
    if read is None:
        raise InputError("particles", str(path), "a .csv or .npz file")
    columns = read(path)
    for name in ("position", "diameter", *(("density",) if density is None else ())):
        if name not in columns:
            raise InputError(f"particles in {path.name}", sorted(columns), f"a table with {name}")
    for name, values in columns.items():
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values.reshape(len(values), -1)).all(axis=1)))
            raise InputError(f"{name} in {path.name}, particle {row}", values[row].tolist(), "a number")
    return make_particles(
        scale * columns["position"],
        0.5 * scale * columns["diameter"],
        columns.get("density", density),  # type: ignore[arg-type]
        material=columns.get("material", material),  # type: ignore[arg-type]
    )


def _columns(path: Path) -> dict[str, np.ndarray]:
    with path.open(encoding="utf-8") as lines:
        head = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    names = [name.split("[")[0].strip() for name in head.split(",")]
    for name in names:
        if name not in COLUMNS:
            raise InputError(f"column in {path.name}", name, nearest(name, COLUMNS))
    try:
        table = np.genfromtxt(path, delimiter=",", skip_header=_lines_before_numbers(path), ndmin=2)
    except ValueError as refusal:
        raise InputError(f"particles in {path.name}", None, f"rows of {len(names)} numbers", str(refusal)) from None
    if table.shape[1] != len(names):
        raise InputError(f"particles in {path.name}", table.shape[1], f"{len(names)} numbers in a row")
    columns = dict(zip(names, table.T))
    if {"x", "y", "z"} <= set(names):
        columns["position"] = np.stack([columns.pop(axis) for axis in "xyz"], axis=1)
    return columns


def _lines_before_numbers(path: Path) -> int:
    with path.open(encoding="utf-8") as lines:
        for number, line in enumerate(lines):
            if line.strip() and not line.startswith("#"):
                return number + 1
    return 0


def _arrays(path: Path) -> dict[str, np.ndarray]:
    names = ("position", "diameter", "density", "material")
    try:
        with np.load(path) as file:
            columns = {name: np.asarray(file[name], float) for name in file.files if name in names}
    except (ValueError, OSError, BadZipFile):
        raise InputError("particles", str(path), "a file of numpy arrays") from None
    if "position" in columns and (columns["position"].ndim != 2 or columns["position"].shape[1] != 3):
        raise InputError(f"position in {path.name}", columns["position"].shape, "a table (N, 3)")
    return columns
