"""Reading a run folder: times, fields, particles and history as numpy arrays; a snapshot as pyvista objects.

>>> from cfddem import open_run                     # doctest: +SKIP
>>> run = open_run("bed-run")                       # doctest: +SKIP
>>> run.history["bed_height"][-1], run.fluid("voidage").min(), run.track(17)["position"]  # doctest: +SKIP
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cfddem.backend import html
from cfddem.backend.errors import InputError, RunFailed, library, nearest
from cfddem.case.toml_text import read_text
from cfddem.io.files import ArrayFile, opened, require_cells, require_columns, require_particles
from cfddem.io.folder import AVERAGES_FROM, NUMBERED, read_about, read_columns, read_snapshot_header
from cfddem.io.index import POINTS, GridBox, Snapshot, field_name, listed
from cfddem.io.quantities import Quantity, declared, from_json, shown_unit

if TYPE_CHECKING:
    import pyvista
    import xarray

_log = logging.getLogger("cfddem")

MOST_MISSING = 1000
"""Largest ratio of missing snapshots to those in the folder; beyond it a number names no snapshot."""

_SHOWN = ("time", "bed_height", "bed_voidage", "pressure_drop", "largest_speed", "contact_count", "particle_count")
"""Columns of the history that a notebook shows."""


def open_run(folder: str | Path) -> RunData:
    """Open a run folder, finished or still being written.

    folder   of the run
    returns  RunData; fields are read on demand
    errors   InputError if the folder holds no run or a run of another format

    >>> run = open_run("bed")                    # doctest: +SKIP
    >>> run.history["bed_height"], run.times     # doctest: +SKIP
    >>> run.fluid("voidage", -1)                 # doctest: +SKIP
    """
    return RunData(Path(folder))


def newest_run(place: Path) -> Path:
    """The most recently written run folder: the given folder or one in it.

    errors  InputError if there is none
    """
    runs = [path for path in (place / "run.json", *place.glob("*/run.json")) if path.exists()]
    if not runs:
        raise InputError("folder", None, "a run folder", f"there is none in {place.resolve()}")
    return max(runs, key=_last_change).parent


def _last_change(about: Path) -> float:
    """When a run folder with this `run.json` was last written [s]."""
    return max(path.stat().st_mtime for path in (about, about.with_name("data")) if path.exists())


class Columns(dict[str, np.ndarray]):
    """Columns by name; a name that is missing is refused with the nearest one."""

    def __missing__(self, name: str) -> np.ndarray:
        raise InputError("history column", name, nearest(name, self))


class RunData:
    """A written run. Snapshots are numbered in time: 0 is the first, -1 the last."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.about = read_about(folder)
        self.quantities = from_json(self.about["quantities"])
        grid = self.about["grid"]
        self.grid = None if grid is None else GridBox(**{key: tuple(values) for key, values in grid.items()})
        self.snapshots, self.missing = self._find()
        if self.missing:
            shown = ", ".join(self.missing[:3]) + (" ..." if len(self.missing) > 3 else "")
            _log.warning("%s: %d snapshots are missing: %s", folder / "data", len(self.missing), shown)

    def __repr__(self) -> str:
        ends = f"{self.times[0]:g} to {self.times[-1]:g} s" if len(self.snapshots) else "no time"
        return f"RunData({str(self.folder)!r}: {self.status}, {len(self.snapshots)} snapshots, {ends})"

    def _repr_html_(self) -> str:
        """Status, the last row of the history and the last snapshot, in a notebook."""
        rows = [("status", self.status), ("snapshots", f"{len(self.snapshots)}")]
        for name, column in self.history.items():
            if len(column) and np.isfinite(column[-1]) and name in _SHOWN:
                rows.append((name.replace("_", " "), f"{column[-1]:.4g} {shown_unit(self.unit(name)).strip('-')}"))
        drawing = ""
        if {"position", "radius", "velocity"} <= set(self.particle_fields):
            last = self.particles(-1)
            drawing = html.spheres(last["position"], last["radius"], last["velocity"])
        return html.table(f"Run {self.folder.name}", rows, drawing)

    # ------------------------------------------------------------ about

    @property
    def status(self) -> str:
        """running, finished, stopped or failed; a killed run remains `running`."""
        return str(self.about["status"])

    @property
    def message(self) -> str:
        """Why the run stopped or failed."""
        return str(self.about["message"])

    @property
    def averages_from(self) -> float | None:
        """Start of averages in a run that ended because its means were known [s]; None for others."""
        start = self.about.get(AVERAGES_FROM)
        return start if isinstance(start, float) else None

    @property
    def provenance(self) -> dict[str, Any]:
        """Versions, platform and random seed."""
        return dict(self.about["provenance"])

    @cached_property
    def case_text(self) -> str:
        """The case in TOML as it was run."""
        return read_text(self.folder / "case.toml")

    @cached_property
    def times(self) -> np.ndarray:
        """Time of each snapshot [s]."""
        return np.array([snapshot.time for snapshot in self.snapshots])

    @cached_property
    def steps(self) -> np.ndarray:
        """Particle steps up to each snapshot."""
        return np.array([snapshot.step for snapshot in self.snapshots], np.int64)

    @property
    def fluid_fields(self) -> list[str]:
        """Names of the fluid fields."""
        return self._names["fluid"]

    @property
    def particle_fields(self) -> list[str]:
        """Names of the particle fields."""
        return self._names["particles"]

    def quantity(self, name: str) -> Quantity:
        """Unit and meaning of a column of the history, or of a field of particles, fluid or collisions.

        errors  InputError if the run has no such quantity
        """
        for block in ("history", "particles", "fluid", "collisions"):
            if name in self.quantities.get(block, {}):
                return self.quantities[block][name]
        names = {quantity for block in self.quantities.values() for quantity in block}
        raise InputError("quantity", name, nearest(name, sorted(names)))

    def unit(self, name: str) -> str:
        """Unit of a field or column, `1` for a plain number."""
        return self.quantity(name).unit

    # ------------------------------------------------------------ values

    def fluid(self, name: str, snapshot: int = -1) -> np.ndarray:
        """A fluid field (nz, ny, nx) or (nz, ny, nx, 3) of one snapshot."""
        self._require_name(name, self.fluid_fields, "fluid")
        with self._opened(snapshot) as data:
            values = data.read(data.file[f"fluid/{name}"], 0)
            require_cells(values, name, self.grid.shape if self.grid is not None else (0, 0, 0))
            return values

    def particles(self, snapshot: int = -1) -> dict[str, np.ndarray]:
        """All particle fields of one snapshot, one row per particle, in the order of ids."""
        with self._opened(snapshot) as data:
            fields = {field_name(name): data.read(dataset) for name, dataset in data.file.get("particles", {}).items()}
            require_particles(fields)
            return fields

    def track(self, particle: int) -> dict[str, np.ndarray]:
        """One particle in all snapshots that contain it: `time` and every field, one row per snapshot.

        particle  its id
        """
        self._require_name("id", self.particle_fields, "particles")
        rows: dict[str, list[Any]] = {"time": []}
        for place, time in enumerate(self.times):
            with self._opened(place) as data:
                group = data.file["particles"]
                ids = data.read(group["id"])
                at = int(np.searchsorted(ids, particle))
                if at < len(ids) and ids[at] == particle:
                    rows["time"].append(time)
                    for name, dataset in group.items():
                        rows.setdefault(field_name(name), []).append(data.read(dataset, at))
        if not rows["time"]:
            raise InputError("particle", particle, "the id of a particle in this run")
        return {name: np.array(values) for name, values in rows.items()}

    @cached_property
    def history(self) -> dict[str, np.ndarray]:
        """Measures in time, name -> column; `pandas.DataFrame(run.history)` makes a table."""
        return Columns(read_columns(self.folder / "history.h5"))

    @cached_property
    def collisions(self) -> dict[str, np.ndarray]:
        """All completed collisions, name -> column; empty if the run records none."""
        parts: dict[str, list[np.ndarray]] = {}
        for place in range(len(self.snapshots)):
            for name, column in self.collisions_of(place).items():
                parts.setdefault(name, []).append(column)
        return {name: np.concatenate(pieces) for name, pieces in parts.items()}

    def collisions_of(self, snapshot: int) -> dict[str, np.ndarray]:
        """The collisions that were completed between the previous snapshot and this one; empty without a record."""
        with self._opened(snapshot) as data:
            columns = {name: data.read(dataset) for name, dataset in data.file.get("collisions", {}).items()}
            require_columns({name: column for name, column in columns.items() if name != "place"})
            return columns

    def mesh(self, snapshot: int = -1) -> pyvista.MultiBlock:
        """One snapshot as pyvista objects: an ImageData `fluid` with cell fields and a PolyData `particles`."""
        import pyvista

        blocks = pyvista.MultiBlock()
        if self.grid is not None:
            image = pyvista.ImageData(
                dimensions=[n + 1 for n in self.grid.cells], spacing=self.grid.spacing, origin=self.grid.origin
            )
            for name in self.fluid_fields:
                values = self.fluid(name, snapshot)
                image.cell_data[name] = values.reshape(-1, *values.shape[3:])
            blocks["fluid"] = image
        particles = self.particles(snapshot)
        if particles:
            points = pyvista.PolyData(particles.pop("position"))
            for name, values in particles.items():
                points.point_data[name] = values
            blocks["particles"] = points
        return blocks

    def dataset(self) -> xarray.Dataset:
        """The run as an xarray Dataset with units; field values are read when they are asked for.

        Fluid fields have the dimensions time, z, y, x, with the centres of the cells [m] as coordinates, and vectors
        a last one, component. A column of the history is `history_NAME`, with its own times `history_time`. A
        particle field is `particle_NAME`, with the dimensions time and particle and the coordinate `id`. Particles
        are left out unless all snapshots hold the same ones.

        errors  InputError if xarray is not installed
        """
        xarray = library("xarray", "dataset", "data")
        coordinates: dict[str, Any] = {"time": ("time", self.times, {"units": "s"})}
        fields: dict[str, Any] = {}
        if self.grid is not None and self.fluid_fields:
            fields |= self._series("fluid", "", ("z", "y", "x"))
            for axis, x0, h, n in zip("xyz", self.grid.origin, self.grid.spacing, self.grid.cells):
                coordinates[axis] = axis, x0 + h * (np.arange(n) + 0.5), {"units": "m"}
        ids = self._common_ids()
        if ids is not None:
            fields |= self._series("particles", "particle_", ("particle",))
            fields.pop("particle_id")
            coordinates["id"] = "particle", ids, {"units": "1"}
        if any("component" in dimensions for dimensions, *_ in fields.values()):
            coordinates["component"] = ["x", "y", "z"]
        for name, column in self.history.items():
            block = coordinates if name == "time" else fields
            block[f"history_{name}"] = "history_time", column, self._labels("history", name)
        return xarray.Dataset(fields, coordinates, {"run": self.folder.resolve().name})

    # ------------------------------------------------------------ details

    def _series(self, block: str, prefix: str, axes: tuple[str, ...]) -> dict[str, Any]:
        """Variables for xarray of the fields of a block: prefix and name -> dimensions, lazy values, attributes."""
        from cfddem.io.lazy import blank, series

        read = {"fluid": self.fluid, "particles": self._particle_field}[block]
        variables: dict[str, Any] = {}
        forms: dict[str, np.ndarray] = {}
        with self._opened(-1) as data:
            for key, dataset in data.file[block].items():
                name = field_name(key)
                data.require_own(dataset)
                form = blank(dataset.dtype, dataset.shape[1:] if block == "fluid" else dataset.shape)
                if self.grid is not None and block == "fluid":
                    require_cells(form, name, self.grid.shape)
                forms[name] = form
                component = "component" if form.shape[-1:] == (3,) else f"{name}_component"
                last = () if form.ndim == len(axes) else (component,)
                values = series(partial(read, name), len(self.snapshots), form)
                variables[prefix + name] = ("time", *axes, *last), values, self._labels(block, name)
            if block == "particles":
                require_particles(forms)
        return variables

    def _labels(self, block: str, name: str) -> dict[str, str]:
        quantity = declared(self.quantities, block, name)
        return {"units": quantity.unit, "long_name": quantity.meaning}

    def _particle_field(self, name: str, snapshot: int) -> np.ndarray:
        """One particle field of one snapshot."""
        with self._opened(snapshot) as data:
            values = data.read(data.file["particles"][POINTS if name == "position" else name])
            require_particles({name: values})
            return values

    def _common_ids(self) -> np.ndarray | None:
        """The ids of the particles if all snapshots hold the same ones, else None."""
        if "id" not in self.particle_fields or len({snapshot.particles for snapshot in self.snapshots}) != 1:
            return None
        ids = self._particle_field("id", -1)
        same = (np.array_equal(ids, self._particle_field("id", place)) for place in range(len(self.snapshots) - 1))
        return ids if all(same) else None

    def _find(self) -> tuple[list[Snapshot], list[str]]:
        """The snapshots in the folder, indexed or not, and the names of missing ones.

        Snapshots are numbered without a gap, so a gap is a loss.
        """
        present = {path.name for path in (self.folder / "data").glob("*.h5") if NUMBERED.fullmatch(path.name)}
        indexed = {
            snapshot.name: snapshot
            for snapshot in _indexed(self.folder / "run.vtkhdf")
            if NUMBERED.fullmatch(snapshot.name)
        }
        snapshots = [
            indexed[name] if name in indexed else read_snapshot_header(self.folder / "data" / name)[0]
            for name in sorted(present)
        ]
        last = max((int(name[:8]) for name in {*present, *indexed}), default=-1)
        if last > MOST_MISSING * (len(snapshots) + MOST_MISSING):
            limit = f"the folder has {len(snapshots)} snapshots; move a file that is not of this run elsewhere"
            raise RunFailed(f"{self.folder / 'data'}: there is no snapshot {last:08d}.h5, as {limit}")
        return snapshots, [name for name in (f"{k:08d}.h5" for k in range(last + 1)) if name not in present]

    @cached_property
    def _names(self) -> dict[str, list[str]]:
        if not self.snapshots:
            return {"fluid": [], "particles": []}
        with self._opened(-1) as data:
            return {block: sorted(map(field_name, data.file.get(block, {}).keys())) for block in ("fluid", "particles")}

    @contextmanager
    def _opened(self, snapshot: int) -> Iterator[ArrayFile]:
        """The open file of a snapshot."""
        if not self.snapshots:
            raise InputError("folder", str(self.folder), "a run with a snapshot", "the run ended before its first one")
        if not -len(self.snapshots) <= snapshot < len(self.snapshots):
            raise InputError("snapshot", snapshot, f"from 0 to {len(self.snapshots) - 1}, or -1 for the last")
        with opened(self.folder / "data" / self.snapshots[snapshot].name) as data:
            yield data

    def _require_name(self, name: str, names: list[str], where: str) -> None:
        if name not in names:
            raise InputError(f"{where} field", name, nearest(name, names))


def _indexed(path: Path) -> list[Snapshot]:
    """The snapshots in the index; none if it is missing or unreadable, since every snapshot can be read by itself."""
    try:
        return listed(path)
    except RunFailed:
        return []
